"""Small rooms of the compiler by themselves."""

import io

import pytest
from sysdyn.compiler.binding.jumps import jumps
from sysdyn.compiler.model.parameters import Parameters
from sysdyn.compiler.network.complements import complements
from sysdyn.compiler.network.sticking import as_relations
from sysdyn.dsl import load
from sysdyn.dsl.model.expression_text import to_text
from sysdyn.dsl.text.decoding import decode
from sysdyn.dsl.text.diagnostics import Report


def network_of(text):
    report = Report()
    document = load.document(decode("m.sd", io.BytesIO(text.encode())), report)
    network = load.network(document, document.models["m"], document.scenes["s"], report)
    assert not list(report.diagnostics), list(report.diagnostics)
    return network


MOVED = """model m {
  coord x: translation = 0 m
  let z = x + %s
  energy T* = 1/2*(2 kg)*z'^2
}
scene s of m { time 0 s to 5 s; trace x }
"""


@pytest.mark.parametrize(
    ("law", "codes"),
    [
        ("1 m*floor(t/(1 s) - 0.5)", ["E520"]),
        ("1 m*max(t/(1 s), 3)", []),  # branches meet: a kink, and a rate
        ("1 m*(if t < 2 s then t/(1 s) else 4 - t/(1 s))", []),
        ("1 m*(if t < 2 s then t/(1 s) else 3 - t/(1 s))", ["E520"]),
        ("1 m*(if t < 7 s then 0 else 1)", []),  # behind the span
    ],
)
def test_what_is_differentiated_may_bend_and_not_jump_within_the_span(law, codes):
    network = network_of(MOVED % law)
    assert [d.code for d in jumps(network, Parameters(network, {}), (0.0, 5.0))] == codes


BLOCK = """model m {
  coord x: translation = 0 m
  energy T* = 1/2*(2 kg)*x'^2
  work 3 N on x
  %s
}
scene s of m { time 0 s to 1 s; trace x }
"""


def test_dry_friction_is_one_unknown_and_its_relation():
    """c setsign(v) between bodies: s, closed by v = 0 while it sticks; a model without it is handed on as it is."""
    smooth, rough = (network_of(BLOCK % more) for more in ("", "content D = 4 N*abs(x')"))
    assert as_relations(smooth) is smooth
    found = as_relations(rough)
    assert len(found.unknowns) == len(rough.unknowns) + 1
    assert [s.kind for s in rough.switches] == ["friction"]
    assert [s.kind for s in found.switches] == ["relation"]
    assert len(found.parameters) == len(rough.parameters) + 1


HELD = """from std.electrical import %s, resistor, voltage
model m {
  node a, b: electrical
  V: voltage(v = 5 V) a -> ground
  D: %s a -> b
  R: resistor(R = 40 ohm) b -> ground
}
scene s of m { time 0 s to 3 s; trace D.f }
"""


@pytest.mark.parametrize(
    ("word", "element", "row", "guard"),
    [
        ("diode", "diode.complementary()", "D.e", None),
        ("switch", "switch(gate = (if t < 1 s then 1 else 0))", "-D.e", "-(if D.off != 0 then 1 else 0) + 1"),
    ],
)
def test_what_holds_of_a_flow_at_times_is_said_of_the_effort(word, element, row, guard):
    """-D.f <= 0 becomes D.e <= 0; D.f = 0 while it is off D.e = 0 while it is not; the reaction is the flow."""
    known = network_of(HELD % (word, element))
    found = complements(known)
    (constraint,), (switch,) = found.constraints, found.switches
    assert to_text(constraint.expression) == row
    assert (switch.dual, known.switches[0].dual) == (True, False)
    watched = {o.name: to_text(o.expression) for o in found.observations}
    assert watched[switch.value] == "-D.e"
    assert watched[switch.rate] == "-D.e'"
    assert (switch.guard and watched[switch.guard]) == guard


def test_without_any_a_network_is_handed_on_as_it_is():
    known = network_of(HELD % ("capacitor", "capacitor(C = 1 F)"))
    assert complements(known) is known
