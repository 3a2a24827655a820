"""Currents in a loop of capacitors: no law says them, they follow from the rates of their voltages.

At every row, those at the two sides of an instant among them, against Kirchhoff's laws in the voltages of that row.
"""

import numpy as np
import pytest
from model_runs import FOUR, trace_of
from start_strategies import started
from sysdyn.cli.run.events import plan
from sysdyn.cli.run.prepare import prepare
from sysdyn.dsl import load
from sysdyn.dsl.model import expression as ex
from sysdyn.dsl.text.diagnostics import Report
from sysdyn.dsl.text.source import SourceText
from sysdyn.runtime.events.observer import Observer
from sysdyn.runtime.events.start import eventful_start
from sysdyn.runtime.model.system import System

TEXT = """
model loop {{
  node a, b: electrical
  Ca: potential(q = 0.2 F*e) a -> ground
  Cb: potential(q = 0.3 F*e) b -> ground
  Cc: potential(q = 1.1 F*e) a -> b
  {what}
}}
scene run of loop {{
  time 0 s to 1 s
  trace Ca.e, Cb.e, Ca.f, Cb.f, Cc.f every 0.01 s
  accuracy 1e-7
}}
"""
FED = "S: flow(f = 7.7 A*sin(3 rad/s*t)^5) ground -> b\n  "
CASES = {
    "a resistor is switched": (
        "discrete h = 1\n  R: dissipator(e = 2 ohm*h*f) b -> a\n  " + FED + "every 0.794 s { h := 1.2 - h }",
        lambda behind: (np.where(behind(0.794), 2.0, 0.4), lambda t: 7.7 * np.sin(3 * t) ** 5),
    ),
    "a source jumps": (
        "R: dissipator(e = 2 ohm*f) b -> a\n  S: flow(f = 1.5 A*step(t - 0.305 s)) ground -> b",
        lambda behind: (2.0, lambda t: np.where(behind(0.305), 1.5, 0.0)),
    ),
}


@pytest.mark.parametrize("case", CASES)
@pytest.mark.parametrize("formulation", FOUR)
@pytest.mark.long
def test_currents_in_a_loop_of_capacitors(tmp_path, formulation, case):
    """(Ca + Cc) a' - Cc b' = i, (Cb + Cc) b' - Cc a' = s - i, i = (b - a)/R."""
    what, law = CASES[case]
    trace = trace_of(tmp_path, TEXT.format(what=what), scene="run", formulation=formulation)
    t = trace.time
    later = np.append(False, np.diff(t) == 0.0)  # of two rows at one instant
    resistance, source = law(lambda at: (t > at + 1e-9) | later & (t > at - 1e-9))
    source = source(t)
    a, b = trace["Ca.e"].values, trace["Cb.e"].values
    through = (b - a) / resistance
    rate = np.linalg.solve([[1.3, -1.1], [-1.1, 1.4]], [through, source - through])
    for name, flow in {"Ca.f": 0.2 * rate[0], "Cb.f": 0.3 * rate[1], "Cc.f": 1.1 * (rate[0] - rate[1])}.items():
        assert np.abs(trace[name].values - flow).max() < 1e-7 * np.abs(flow).max(), name


WINDING = """
from std.electrical import resistor, capacitor, inductor
model winding {{
  param n = {n}
  node s, v[0..n]: electrical
  {source}
  Rs: resistor(R = 50 ohm) s -> v[0]
  C: capacitor(C = 10 pF) v[0]
  for i in 1..n {{
    L[i]: inductor(L = 10 uH) v[i - 1] -> v[i]
    K[i]: capacitor(C = 50 pF) v[i - 1] -> v[i]
    G[i]: capacitor(C = 10 pF) v[i]
  }}
  Re: resistor(R = 1 kohm) v[n]
}}
scene run of winding {{
  time 0 s to 3 us
  trace v[0].e, C.f, K[1].f, G[1].f, L[2].f every 0.05 us
  accuracy 1e-6
}}
"""
JUMPS = {
    "the text": "Vs: effort(e = if t < 1 us then 0 V else 1 V) s -> ground",
    "an event": "discrete u = 0 V\n  Vs: effort(e = u) s -> ground\n  when t > 1 us { u := 1 V }",
}


@pytest.mark.parametrize("jump", JUMPS)
@pytest.mark.one_in(2)
def test_a_winding_of_many_coils(tmp_path, jump):
    """Hundreds of unknowns, each coil beside a capacitor: C v' = -D^T i - G v + u/50, L i' = D v, by the
    eigenvectors.
    """
    n, at = 80, 1e-6
    trace = trace_of(tmp_path, WINDING.format(n=n, source=JUMPS[jump]), scene="run", formulation="lagrangian")
    difference = np.eye(n, n + 1) - np.eye(n, n + 1, 1)
    store = 10e-12 * np.eye(n + 1) + 50e-12 * difference.T @ difference
    leak = np.diag([1 / 50.0, *np.zeros(n - 1), 1 / 1000.0])
    inverse = np.linalg.inv(store)
    matrix = np.block([[-inverse @ leak, -inverse @ difference.T], [difference / 10e-6, np.zeros((n, n))]])
    fed = np.append(inverse[:, 0] / 50.0, np.zeros(n))
    rest = np.linalg.solve(matrix, -fed)
    rates, vectors = np.linalg.eig(matrix)
    parts = np.linalg.solve(vectors, rest.astype(complex))
    t = trace.time
    here = np.isclose(t, at, rtol=1e-12)
    later = (t > at) & ~here
    later[np.flatnonzero(here)[-1]] = True  # of two rows at the instant the second one
    since = np.where(later, t - at, 0.0)
    motion = rest[:, None] - (vectors @ (parts[:, None] * np.exp(np.outer(rates, since)))).real
    slope = (matrix @ motion + fed[:, None]) * later
    expected = {
        "v[0].e": motion[0],
        "C.f": 10e-12 * slope[0],
        "K[1].f": 50e-12 * (slope[0] - slope[1]),
        "G[1].f": 10e-12 * slope[1],
        "L[2].f": motion[n + 2],
    }
    for name, values in expected.items():
        assert np.abs(trace[name].values - values).max() < 1e-6 * np.abs(values).max(), name


STAR = """
from std.electrical import capacitor
model star {
  node n1, n2: electrical
  C0: capacitor(C = 1 F) n1 -> ground
  C2: capacitor(C = 2 F) n1 -> ground
  C1: capacitor(C = 3 F) n1 -> n2
  C3: capacitor(C = 4 F) n2 -> ground
  init C0.e = 1 V
  init C1.e = 0.25 V
}
scene s of star {
  time 0 s to 1 s
  trace C0.e as v0, C1.e as v1, C2.e as v2, C3.e as v3 every 0.1 s
}
"""


@pytest.mark.parametrize("formulation", FOUR)
@pytest.mark.long
def test_charge_of_a_node_follows_where_loops_say_what_the_text_does_not(tmp_path, formulation):
    """C2 and C3 are left to the loops: the charge of n1, a constant of its integrated row, is 6.5 C and not 1.75 C."""
    trace = trace_of(tmp_path, STAR, formulation=formulation)
    for name, volts in (("v0", 1.0), ("v1", 0.25), ("v2", 1.0), ("v3", 0.75)):
        assert np.abs(trace[name].values - volts).max() < 1e-12


@pytest.mark.long
def test_numbers_of_the_text_stand_while_a_start_finds_others():
    """The runtime reads the binding's own array, until it has to write there: the charge of n1 is 1.75 C in the text's
    numbers, 3.75 C in the model's.
    """
    with ex.fresh():
        report = Report()
        document = load.document(SourceText("m.sd", STAR), report)
        network = load.network(document, document.models["star"], document.scenes["s"], report)
        made = prepare(network, report, formulation="lagrangian", backend="numpy")
        bound = made.binding.p.copy()
        system = System(made.structure, made.arrays, made.carrier)
        assert np.shares_memory(system.description.p, made.binding.p)
        with pytest.raises(ValueError, match="read-only"):
            system.description.p[0] = 0.0
        state = eventful_start(system, 0.0, plan(made, system))
    assert np.array_equal(made.binding.p, bound)
    ((_, at, number),) = system.description.constants
    assert number == 1
    assert abs(bound[at]) == 1.75
    assert abs(system.description.p[at]) == pytest.approx(1.0 + 2.0 + 3.0 * 0.25, rel=1e-14)
    assert np.abs(system.residual(0.0, state.y, state.yd)).max() < 1e-12


def test_events_write_into_numbers_of_their_own():
    text = """
model pulsed {
  node a: electrical
  discrete h = 1
  C: potential(q = 0.2 F*e) a -> ground
  R: dissipator(e = 2 ohm*h*f) a -> ground
  every 0.3 s { h := 1.2 - h }
  init C.e = 1 V
}
"""
    with ex.fresh():
        report = Report()
        document = load.document(SourceText("m.sd", text), report)
        network = load.network(document, document.models["pulsed"], None, report)
        made = prepare(network, report, formulation="lagrangian", backend="numpy")
        assert not np.shares_memory(System(made.structure, made.arrays, made.carrier).description.p, made.binding.p)


FORCED = """
model m {
  node a, b: electrical
  V: effort(e = 5 V) a -> ground
  C1: potential(q = 2 F*e) a -> b
  C2: potential(q = 3 F*e) b -> ground
  R: dissipator(e = 5 ohm*f) b -> ground
  I: flow(f = 2 A) c -> ground
  L1: kinetic(p = 0.25 H*f) d -> c
  L2: kinetic(p = 4 H*f) c -> d
  G: dissipator(e = 3 ohm*f) d -> ground
}
scene s of m { time 0 s to 1 s; trace C1.q, C2.q, L1.p, L2.p%s }
""".replace("node a, b", "node a, b, c, d")


@pytest.mark.parametrize("traced", ["", ", C1.energy", ", L2.energy", ", C2.energy + L1.energy as all"])
@pytest.mark.parametrize("formulation", FOUR)
@pytest.mark.long
def test_what_is_traced_does_not_move_the_start(formulation, traced):
    """Charges q1/2 F + q2/3 F = 5 V and fluxes p1/0.25 H - p2/4 H = 2 A of least squares, whatever is written down: the
    energy with which an element began pulled at them as a store of its own would.
    """
    begun = started(FORCED % traced, formulation)
    found = Observer(begun.system)(begun.state.t, *begun.state.for_form(begun.system))[:4]
    charges = 5.0 / (0.25 + 1.0 / 9.0) * np.array([0.5, 1.0 / 3.0])
    fluxes = 2.0 / (16.0 + 1.0 / 16.0) * np.array([4.0, -0.25])
    assert found == pytest.approx(np.append(charges, fluxes), rel=1e-9)


CUBIC = """
model m {
  node a, b: electrical
  V: effort(e = 1 V) c -> ground
  S: dissipator(e = 1 ohm*f) c -> a
  L1: kinetic(f = 0.5 A*(p/(1 Wb) + (p/(1 Wb))^3)) a -> b
  L2: kinetic(p = 0.2 H*f) b -> ground
  R: dissipator(e = 1 ohm*f) b -> ground
  init L1.f ~ -5 A
}
scene s of m { time 0 s to 1 s; trace L1.p, L2.p }
""".replace("node a, b", "node a, b, c")


@pytest.mark.parametrize("formulation", FOUR)
@pytest.mark.long
def test_a_guess_of_a_flow_moves_the_store_of_whose_law_it_tells_no_content(formulation):
    """p + p^3 = -10: p = -2; the store beside it, of which nothing is said, was moved as far (1 Wb)."""
    begun = started(CUBIC, formulation)
    found = Observer(begun.system)(begun.state.t, *begun.state.for_form(begun.system))[:2]
    assert found == pytest.approx([-2.0, 0.0], abs=1e-9)
