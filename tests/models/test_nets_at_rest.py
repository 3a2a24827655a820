"""Vessels, pipes, turbulent valves: where two vessels have one pressure at the start a valve between them is at rest,
and its flow grows as the root of time.  Against scipy; the start was refused (E903) in one family or
another.  (Of digits that are not round differences of pressures leave round-off.)
"""

import numpy as np
import pytest
from model_runs import FOUR, trace_of
from scipy.integrate import solve_ivp

GRAVITY = 9806.65
ROOM, AREA = (1.1176000785409952e-3, 1.2322902529204305e-3), 1.6394500179526175e-4
HEAD = "from std.fluid import tank, valve, orifice, pipe, accumulator\nmodel net {\n"
BESIDE_A_PIPE = """  node a0, a1, a2: hydraulic
  T0: accumulator(V0 = 1.1176000785409952e-3 m^3, p0 = 1e5 Pa) a0
  T1: tank(A = 1.6394500179526175e-4 m^2) a1
  T2: accumulator(V0 = 1.2322902529204305e-3 m^3, p0 = 2e5 Pa) a2
  E0: valve(Cr = 138620473920.10684 Pa.s^2/m^6) a0 -> a1
  E1: pipe(I = 14561305.96091823 Pa.s^2/m^3, R = 43542510.86963702 Pa.s/m^3) a = a2, b = a0
  E2: valve(Cr = 85350040529.21593 Pa.s^2/m^6) a0 -> a2
  init T0.gas.e = 1e5 Pa
  init T1.store.e = 2.5e5 Pa
  init T2.gas.e = 1e5 Pa
"""
BESIDE_AN_ORIFICE = """  node a0, a1, a2, a3, s: hydraulic
  S: effort(e = 0 Pa) s -> ground
  T0: accumulator(V0 = 5.1e-3 m^3, p0 = 2e5 Pa) a0
  T1: tank(A = 7.2e-4 m^2) a1
  T2: tank(A = 2.2e-4 m^2) a2
  T3: accumulator(V0 = 2.3e-3 m^3, p0 = 2e5 Pa) a3
  E0: valve(Cr = 2.1e11 Pa.s^2/m^6) a0 -> a1
  E1: valve(Cr = 7.8e10 Pa.s^2/m^6) a1 -> a2
  E2: valve(Cr = 6.7e11 Pa.s^2/m^6) a3 -> a2
  E3: valve(Cr = 6.1e11 Pa.s^2/m^6) s -> a2
  E4: pipe(I = 7.2e7 Pa.s^2/m^3, R = 5.9e7 Pa.s/m^3) a = a0, b = a1
  E5: orifice(A = 5.4e-6 m^2) a3 -> a2
  E6: valve(Cr = 4.4e11 Pa.s^2/m^6) a2 -> s
  init T1.store.e = 1e5 Pa
  init T2.store.e = 1e5 Pa
  init T3.gas.e = 1e5 Pa
"""


def _valve(resistance, head):
    return np.sign(head) * np.sqrt(abs(head) / resistance)


def _gas(volume, pressure, content):
    return pressure * volume / (volume - content)


def _beside_a_pipe(_, x):
    p0, p1, p2 = _gas(ROOM[0], 1e5, x[0]), GRAVITY / AREA * x[1], _gas(ROOM[1], 2e5, x[2])
    out, back, pipe = _valve(138620473920.10684, p0 - p1), _valve(85350040529.21593, p0 - p2), x[3]
    return [pipe - out - back, out, back - pipe, (p2 - p0 - 43542510.86963702 * pipe) / 14561305.96091823]


def _beside_an_orifice(_, x):
    p0, p3 = _gas(5.1e-3, 2e5, x[0]), _gas(2.3e-3, 2e5, x[3])
    p1, p2 = GRAVITY / 7.2e-4 * x[1], GRAVITY / 2.2e-4 * x[2]
    one, two, three = _valve(2.1e11, p0 - p1) + x[4], _valve(7.8e10, p1 - p2), _valve(6.7e11, p3 - p2)
    orifice = 0.61 * 5.4e-6 * np.sqrt(2.0 / 850.0) * (p3 - p2) / ((p3 - p2) ** 2 + 1e6) ** 0.25
    drained = _valve(4.4e11, p2) + _valve(6.1e11, p2)
    flows = [-one, one - two, two + three + orifice - drained, -three - orifice]
    return [*flows, (p0 - p1 - 5.9e7 * x[4]) / 7.2e7]


NETS = {
    "pipe": (BESIDE_A_PIPE, _beside_a_pipe, [0.0, 2.5e5 * AREA / GRAVITY, -ROOM[1], 0.0], 1, AREA),
    "orifice": (BESIDE_AN_ORIFICE, _beside_an_orifice, [0, 72 / GRAVITY, 22 / GRAVITY, -2.3e-3, 0], 2, 2.2e-4),
}


CASES = [(name, f) for name in NETS for f in FOUR]
SLOW = {("orifice", f) for f in FOUR[2:]}  # 60000 steps within the first 1e-9 s


@pytest.mark.parametrize(
    ("name", "formulation"), [pytest.param(*c, marks=pytest.mark.long) if c in SLOW else c for c in CASES]
)
@pytest.mark.long
def test_a_valve_at_rest_begins_to_pass(tmp_path, name, formulation):
    text, slopes, begin, vessel, area = NETS[name]
    scene = f"}}\nscene go of net {{ time 0 s to 1 s; trace T{vessel}.store.e as p }}\n"
    trace = trace_of(tmp_path, HEAD + text + scene, formulation=formulation, accuracy=1e-5)
    exact = solve_ivp(slopes, (0.0, 1.0), begin, method="LSODA", rtol=1e-10, atol=1e-15, max_step=0.005)
    assert trace["p"].values[-1] == pytest.approx(GRAVITY / area * exact.y[vessel, -1], abs=1e-5 * trace["p"].nominal)


WARM = """model m {
  node a, b: thermal
  A: potential(e = 300 K*exp(q/(50 J/K))) a -> ground
  B: potential(e = 300 K*exp(q/(20 J/K))) b -> ground
  la: flow(f = 0.5 W/K*(a.e - b.e)/a.e) a -> ground
  lb: flow(f = 0.5 W/K*(a.e - b.e)/b.e) ground -> b
  init A.e = 400 K
  init B.e = 280 K
}
scene s of m { time 0 s to 10 s; trace a.e, b.e }
"""


@pytest.mark.parametrize("formulation", FOUR)
@pytest.mark.long
def test_a_current_of_entropy_begins_at_temperatures_that_follow(tmp_path, formulation):
    """At the guesses it is 0/0; energy of both stays 50*400 + 20*280 J whatever is made of entropy."""
    trace = trace_of(tmp_path, WARM, formulation=formulation, accuracy=1e-6)
    warm, cold = trace["a.e"].values, trace["b.e"].values
    assert 50.0 * warm + 20.0 * cold == pytest.approx(np.full(warm.size, 50.0 * 400.0 + 20.0 * 280.0), rel=1e-7)
    flow = 0.5 * (1.0 / 50.0 + 1.0 / 20.0)  # of the difference, which decays by it
    assert warm[-1] - cold[-1] == pytest.approx(120.0 * np.exp(-flow * 10.0), rel=1e-6)
