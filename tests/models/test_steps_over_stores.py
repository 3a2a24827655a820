"""Steps of sources over stores of any law: charge and flux are balanced over the instant, read from the trace alone.

What each store holds before and behind a step follows from its effort or flow by its law (roots by brentq).  Charges
that stores gain are what sources hand on at each node; fluxes that they gain are differences of one impulse a node.
"""

import random

import numpy as np
import pytest
from model_runs import FOUR
from scipy.optimize import brentq
from sysdyn import api

SEEDS = range(20)
LOOP = """\
model m {
  node n0, n1, n2: electrical
  V0: effort(e = UE) n0 -> n1
  C1: potential(q = 0.3 F*e) n1 -> n2
  N2: potential(e = 2 V*(q/(1 C) + 0.2*(q/(1 C))^3)) n2 -> ground
  C3: potential(q = 0.3 F*e) ground -> n0
  L4: kinetic(p = 0.3 H*f) n2 -> n0
  I5: flow(f = UF) n2 -> ground
  JUMPS
}
scene s of m { time 0 s to 0.5 s; trace n2.e as e2, n0.e as e0, C1.e as c1 every 25 ms; accuracy 1e-6 }
"""
JUMPS = {
    "text": ("", "(if t < 0.2 s then 1 V else 3 V)", "(if t < 0.2 s then -3 A else 3 A)"),
    "event": (
        "discrete u = 1 V\n  discrete i = -3 A\n  when t > 0.2 s { u := 3 V }\n  when t > 0.2 s { i := 3 A }",
        "u",
        "i",
    ),
}


def _root(law, value):
    return brentq(lambda x: law(x) - value, -1e3, 1e3, xtol=1e-15, rtol=1e-15)


def _sides(trace, name, instant):
    """Values before and behind an instant."""
    at = np.flatnonzero(np.abs(trace.time - instant) < 1e-9)
    return trace[name].values[at[[0, -1]]]


@pytest.mark.parametrize("formulation", FOUR)
@pytest.mark.parametrize("way", JUMPS)
@pytest.mark.long
def test_charge_is_balanced_over_a_step_in_a_loop_of_capacitors(tmp_path, way, formulation):
    """Held as a dynamic variable, the charge of N2 stayed: 0.6 C came from nowhere, told as met."""
    jumps, effort, flow = JUMPS[way]
    text = LOOP.replace("UE", effort).replace("UF", flow).replace("JUMPS", jumps)
    (tmp_path / "m.sd").write_text(text)
    trace = api.simulate(tmp_path / "m.sd", formulation=formulation, output=tmp_path / "m.h5")
    (e2, e0, c1) = (_sides(trace, name, 0.2) for name in ("e2", "e0", "c1"))
    q2 = [_root(lambda q: 2.0 * (q + 0.2 * q**3), e) for e in e2]
    gained = np.array([0.3 * np.diff(c1)[0], np.diff(q2)[0], -0.3 * np.diff(e0)[0]])
    assert abs(gained).min() > 0.1
    assert np.ptp(gained) < 1e-8


SERIES = """\
model m {
  node a, b: electrical
  JUMPS
  V: effort(e = UE) a -> ground
  C1: FIRST a -> b
  C2: SECOND b -> ground
  R: dissipator(e = 1 ohm*f) b -> ground
  init C2.e = 0 V
}
scene s of m { time 0 s to 0.5 s; trace b.e as b every 10 ms; accuracy 1e-6 }
"""
LAWS = {  # text, charge by effort
    "linear": ("potential(q = 0.5 F*e)", lambda e: 0.5 * e),
    "of e": ("potential(q = 0.5 F*(e + 2*e^3/(1 V)^2))", lambda e: 0.5 * (e + 2.0 * e**3)),
    "of q": (
        "potential(e = 2 V*(q/(1 C) + 3*(q/(1 C))^3))",
        lambda e: _root(lambda q: 2.0 * (q + 3.0 * q**3), e),
    ),
    "saturates": ("potential(q = 0.5 C*tanh(e/(1 V)) + 0.01 F*e)", lambda e: 0.5 * np.tanh(e) + 0.01 * e),
    "exponential": ("potential(q = 0.1 C*(exp(e/(1 V)) - 1))", lambda e: 0.1 * np.expm1(e)),
}


@pytest.mark.parametrize("formulation", FOUR)
@pytest.mark.parametrize("second", LAWS)
@pytest.mark.parametrize("first", LAWS)
@pytest.mark.long
def test_charge_that_a_step_shares_between_stores_of_any_law(tmp_path, first, second, formulation):
    """Of 1 V, then 5 V: as much charge goes through both at once; three iterations had to do, and mean slopes."""
    text = SERIES.replace("JUMPS", "").replace("UE", "(if t < 0.2 s then 1 V else 5 V)")
    (tmp_path / "m.sd").write_text(text.replace("FIRST", LAWS[first][0]).replace("SECOND", LAWS[second][0]))
    trace = api.simulate(tmp_path / "m.sd", formulation=formulation, output=tmp_path / "m.h5")
    before, behind = _sides(trace, "b", 0.2)
    q1, q2 = LAWS[first][1], LAWS[second][1]
    wanted = brentq(lambda e: q1(5.0 - e) - q1(1.0 - before) - q2(e) + q2(before), -5.0, 10.0, xtol=1e-14)
    assert abs(behind - wanted) < 1e-8 * max(1.0, abs(wanted))


POTENTIAL = {
    "potential(q = {c} F*e)": lambda c, a, e: c * e,
    "potential(q = {c} F*(e + {a}*e^3/(1 V)^2))": lambda c, a, e: c * (e + a * e**3),
    "potential(e = {c} V*(q/(1 C) + {a}*(q/(1 C))^3))": lambda c, a, e: _root(lambda q: c * (q + a * q**3), e),
}
KINETIC = {
    "kinetic(p = {c} H*f)": lambda c, a, f: c * f,
    "kinetic(p = {c} H*(f + {a}*f^3/(1 A)^2))": lambda c, a, f: c * (f + a * f**3),
    "kinetic(f = {c} A*(p/(1 Wb) + {a}*(p/(1 Wb))^3))": lambda c, a, f: _root(lambda p: c * (p + a * p**3), f),
}
HELD = {"potential": "e", "kinetic": "f"}
STEP = "(if t < 0.1 s then 0 {unit} else if t < 0.2 s then {v1} {unit} else {v2} {unit})"


def _drawn(seed):
    """Text, nodes, elements (name, kind, from, to, content by effort or flow) of a net with steps of its sources."""
    rng = random.Random(seed)
    nodes = [f"n{k}" for k in range(rng.randint(2, 4))]
    ends, lines, elements = [*nodes, "ground"], [], []
    passive = ["potential", "potential", "kinetic", "dissipator"]
    wanted = [(rng.choice(passive), node, rng.choice(ends[k + 1 :])) for k, node in enumerate(nodes)]
    wanted += [(rng.choice(passive), *rng.sample(ends, 2)) for _ in range(len(nodes) + 1)]
    wanted += [(kind, *rng.sample(ends, 2)) for kind in ("effort", "flow")[: rng.randint(1, 2)]]
    for k, (kind, a, b) in enumerate(wanted):
        numbers, content = {"c": round(rng.uniform(0.2, 1.0), 2), "a": round(rng.uniform(0.1, 1.5), 2)}, None
        if kind in ("potential", "kinetic"):
            laws = POTENTIAL if kind == "potential" else KINETIC
            text = rng.choice(list(laws))
            content, text = (lambda x, law=laws[text], n=numbers: law(n["c"], n["a"], x)), text.format(**numbers)
        elif kind == "dissipator":
            text = f"dissipator(e = {rng.uniform(0.3, 3.0):.2f} ohm*f)"
        else:
            v1, v2 = (round(rng.uniform(-2.0, 2.0), 1) for _ in range(2))
            letter, unit = ("e", "V") if kind == "effort" else ("f", "A")
            text = f"{kind}({letter} = {STEP.format(unit=unit, v1=v1, v2=v2)})"
        lines.append(f"  X{k}: {text} {a} -> {b}")
        elements.append((f"X{k}", kind, a, b, content))
    traced = ", ".join(f"X{k}.{HELD[kind]} as x{k}" for k, (kind, *_) in enumerate(wanted) if kind in HELD)
    scene = f"scene s of m {{ time 0 s to 0.3 s; trace {traced} every 0.1 s; accuracy 1e-6 }}"
    return (
        f"model m {{\n  node {', '.join(nodes)}: electrical\n" + "\n".join(lines) + f"\n}}\n{scene}\n",
        nodes,
        elements,
    )


@pytest.mark.parametrize("formulation", FOUR)
@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.long
def test_charge_and_flux_are_balanced_over_steps_in_random_nets(tmp_path, seed, formulation):
    text, nodes, elements = _drawn(seed)
    (tmp_path / "m.sd").write_text(text)
    trace = api.simulate(tmp_path / "m.sd", formulation=formulation, output=tmp_path / "m.h5")
    for instant in (0.1, 0.2):
        charge, sources, ends, flux = np.zeros(len(nodes)), [], [], []
        for k, (_, kind, a, b, content) in enumerate(elements):
            along = np.array([(node == a) - (node == b) for node in nodes], dtype=float)
            gained = np.subtract(*[content(x) for x in _sides(trace, f"x{k}", instant)[::-1]]) if content else 0.0
            if kind == "potential":
                charge -= along * gained
            if kind == "effort":
                sources.append(along)
            if kind != "flow":  # between its ends any impulse
                ends.append(along)
                flux.append(gained if kind == "kinetic" else 0.0)
        for matrix, aim in ((np.array(sources).T, charge), (np.array(ends), np.array(flux))):
            found = np.linalg.lstsq(matrix, aim)[0]
            assert np.abs(matrix @ found - aim).max() < 1e-7


ENERGY = """\
model m {
  node n0, n1, n2: electrical
  V0: effort(e = (if t < 0.2 s then 1 V else 3 V)) n0 -> n1
  C1: potential(q = 0.3 F*e) n1 -> n2
  N2: potential(e = 2 V*(q/(1 C) + 2*(q/(1 C))^3)) n2 -> ground
  C3: potential(q = 0.3 F*(e + e^3/(1 V)^2)) ground -> n0
  R: dissipator(e = 1 ohm*f) n2 -> n0
}
scene s of m { time 0 s to 0.5 s
  trace V0.energy + C1.energy + N2.energy + C3.energy + R.energy as sum, V0.energy as V every 25 ms; accuracy 1e-6 }
"""


@pytest.mark.parametrize("formulation", FOUR)
@pytest.mark.long
def test_a_source_pays_what_contents_of_any_law_take_along_the_rise(tmp_path, formulation):
    """In co-Hamilton's form the sum was off by 2 mJ, told as met, for the law of N2 does not hold on a straight way."""
    (tmp_path / "m.sd").write_text(ENERGY)
    trace = api.simulate(tmp_path / "m.sd", formulation=formulation, output=tmp_path / "m.h5")
    assert np.abs(trace["V"].values).max() > 1.0
    assert np.abs(trace["sum"].values).max() < 1e-6
