"""Instances that are cast are what the whole way makes of them, and what is wrong with one is told of it alone."""

import random

import pytest
from sysdyn.dsl import load
from sysdyn.dsl.elaborate.instances.moulds import Likeness, Moulds
from sysdyn.dsl.model.network_text import show
from sysdyn.dsl.text.diagnostics import Report, SourceText

HEAD = """from std.electrical import capacitor, diode, inductor, resistor, voltage

component leak {
  param G: 1/ohm
  param G0 = 2*G
  branch: electrical
  law f = (G + G0)*e + G0*e^3*(1 V^-2)
  require G0 >= G
  require G > 0 A/V
}

component noisy {
  param R: ohm
  param f = 3 ohm
  branch: electrical
  law e = (R + 1 ohm)*f
}

model net {
"""
KINDS = (
    "resistor(R = {} ohm)",
    "capacitor(C = {} uF)",
    "inductor(L = {} mH)",
    "leak(G = {} mA/V)",
    "leak(G = {} mA/V, G0 = 9 A/V)",
    "diode()",
    "noisy(R = {} ohm)",
)


def net(n=60, bad=None, at=0):
    """A net of n branches joined at random, each kind again and again; one of them wrong."""
    draw = random.Random(7)
    lines = [f"  node v{k}: electrical" for k in range(n // 3)]
    for k in range(n):
        a, b = draw.sample(range(n // 3), 2)
        lines.append(f"  X{k}: {KINDS[k % len(KINDS)].format(draw.randrange(1, 9))} v{a} -> v{b}")
    lines += [f"  C{k}: capacitor(C = 1 uF) v{k}" for k in range(n // 3)]
    lines.append("  init C3.e = 1 V")
    if bad is not None:
        lines.insert(n // 3 + 20 + at, f"  {bad}")
    return HEAD + "\n".join(lines) + "\n}\n\nscene s of net { time 0 s to 1 s; trace X7.e, X8.f, X9.p }\n"


def read(text):
    report = Report()
    document = load.document(SourceText("net.sd", text), report)
    made = load.network(document, document.models["net"], document.scenes["s"], report)
    return made, [(d.severity, d.code, d.message, d.help, str(d.place), *map(str, d.related)) for d in report]


BAD = [
    None,
    "W: resistor(R = -3 ohm) v1 -> v2",
    "W: resistor(R = 3 kg) v1 -> v2",
    "W: resistor(R = 3) v1 -> v2",
    "W: resistor(R = 3 foo) v1 -> v2",
    "W: resistor(R = 0) v1 -> v2",
    "W: resistor(R = q) v1 -> v2",
    "W: resistor(R = 3 ohm, R = 4 ohm) v1 -> v2",
    "W: resistor(R = 3 ohm, S = 4 ohm) v1 -> v2",
    "W: resistor(3 ohm) v1 -> v2",
    "W: resistor() v1 -> v2",
    "W: resistor(R = 3 ohm) v1 -> v1",
    "W: resistor(R = 3 ohm) v1 -> nowhere",
    "W: resistor(R = 3 ohm) ground -> ground",
    "W: resistor(R = 3 ohm)",
    "W: resistor(R = 3 ohm) v1 -> v2, v3 -> v4",
    "X3: resistor(R = 3 ohm) v1 -> v2",
    "W[2]: resistor(R = 3 ohm) v1 -> v2",
    "W: resistor.fine(R = 3 ohm) v1 -> v2",
    "W: leak(G = 5 A/V, G0 = 1 A/V) v1 -> v2",
    "W: noisy(R = 5 ohm) v1 -> W.e",
    "W: resistor(R = X0.R) v1 -> v2",
    "for i in 1..3 { W[i]: resistor(R = 3 ohm) v1 -> v2 }",
    "coord y: m",
    "node w: translational",
]


@pytest.mark.parametrize("bad", BAD)
@pytest.mark.long
def test_the_whole_way_and_a_mould_make_the_same(bad, monkeypatch):
    made, found = read(net(bad=bad))
    with monkeypatch.context() as patch:
        patch.setattr(Moulds, "cast", lambda *_: False)
        whole, said = read(net(bad=bad))
    assert found == said
    assert (made is None) == (whole is None)
    if made is not None:
        assert show(made) == show(whole)
        assert [(r.name, r.unit, r.place.start) for r in made.parameters] == [
            (r.name, r.unit, r.place.start) for r in whole.parameters
        ]


def test_most_instances_of_a_net_are_cast(monkeypatch):
    made = []
    before = Likeness.__init__
    monkeypatch.setattr(Likeness, "__init__", lambda self, *given: (made.append(self), before(self, *given))[1])
    assert read(net())[0] is not None
    assert len(made) > 60
