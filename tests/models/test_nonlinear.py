"""Nonlinear stores from their starts, against ordinary differential equations (scipy)."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import brentq
from sysdyn import api

FORMULATIONS = ("lagrangian", "hamiltonian", "co_lagrangian", "co_hamiltonian")

TANK = """
model tank {
  node a: hydraulic
  C: potential(q = 1.1 m^3*(tanh(e/(0.12 Pa)) + 0.8*(e/(0.12 Pa)))) a -> ground
  R: dissipator(e = 4.7 Pa*(f/(1.2 m^3/s) + 8.4*(f/(1.2 m^3/s))^3)) a -> ground
  S: flow(f = 0.73 m^3/s*sin(3 rad/s*t)^5) ground -> a
  init C.q = 0 m^3
}
scene fills of tank {
  time 0 s to 2 s
  trace C.e, R.f every 0.1 s
  accuracy 1e-6
}
"""

LINE = """
model line {
  node a, b: electrical
  R: dissipator(f = 0.201 A*(e/(3.064 V)/sqrt(1 + (e/(3.064 V))^2) + 0.1*(e/(3.064 V)))) a -> ground
  L: kinetic(p = 0.49 V.s*(f/(0.367 A)/sqrt(1 + (f/(0.367 A))^2) + 0.1*(f/(0.367 A)))) a -> ground
  K: kinetic(p = 1.503 V.s*(tanh(f/(0.129 A)) + 1.624*(f/(0.129 A)))) a -> b
  D: dissipator(e = 1.753 V*(f/(0.106 A) + 3.419*(f/(0.106 A))^3)) a -> ground
  S: effort(e = 0.678 V*sin(3 rad/s*t)^5) b -> ground
  init L.p = -0.303 V.s
  init K.p = 0 V.s
}
scene discharges of line {
  time 0 s to 2 s
  trace R.e, L.f, K.f, D.f every 0.1 s
  accuracy 1e-6
}
"""


def inverse(law, value):
    """The argument of an odd rising law."""
    return brentq(lambda x: law(x) - value, -1e3, 1e3, xtol=1e-15, rtol=1e-14)


def resistor(e):
    return 0.201 * (e / 3.064 / np.hypot(1.0, e / 3.064) + 0.1 * e / 3.064)


def tank(times):
    """Columns C.e, R.f."""
    capacitor = lambda e: 1.1 * (np.tanh(e / 0.12) + 0.8 * e / 0.12)  # noqa: E731
    valve = lambda f: 4.7 * (f / 1.2 + 8.4 * (f / 1.2) ** 3)  # noqa: E731
    run = solve_ivp(
        lambda t, q: 0.73 * np.sin(3 * t) ** 5 - inverse(valve, inverse(capacitor, q[0])),
        (0.0, 2.0), [0.0], "DOP853", times, rtol=1e-11, atol=1e-13,
    )  # fmt: skip
    effort = [inverse(capacitor, q) for q in run.y[0]]
    return np.transpose([effort, [inverse(valve, e) for e in effort]])


def line(times):
    """Columns R.e, L.f, K.f, D.f."""

    def solved(momenta):
        flows = (
            inverse(lambda f: 0.49 * (f / 0.367 / np.hypot(1.0, f / 0.367) + 0.1 * f / 0.367), momenta[0]),
            inverse(lambda f: 1.503 * (np.tanh(f / 0.129) + 1.624 * f / 0.129), momenta[1]),
        )
        law = lambda f: 1.753 * (f / 0.106 + 3.419 * (f / 0.106) ** 3)  # noqa: E731
        other = inverse(lambda f: f + resistor(law(f)), -sum(flows))
        return law(other), *flows, other

    def rates(t, momenta):
        effort = solved(momenta)[0]
        return [effort, effort - 0.678 * np.sin(3 * t) ** 5]

    run = solve_ivp(rates, (0.0, 2.0), [-0.303, 0.0], "DOP853", times, rtol=1e-11, atol=1e-13)
    return np.array([solved(m) for m in run.y.T])


@pytest.mark.parametrize("formulation", FORMULATIONS)
@pytest.mark.parametrize(("text", "reference"), [(TANK, tank), (LINE, line)], ids=["tank", "line"])
@pytest.mark.long
def test_a_store_that_saturates_runs_from_its_start(tmp_path, text, reference, formulation):
    # energies such as ln cosh are round-off of either sign at first, and efforts at rest those of a linear solve
    path = tmp_path / "model.sd"
    path.write_text(text)
    found = api.simulate(path, formulation=formulation, output=tmp_path / "out.h5")
    names = text.split("trace ")[1].split(" every")[0].split(", ")
    values = np.transpose([found[name] for name in names])
    exact = reference(np.asarray(found.time))
    assert (np.abs(values - exact).max(axis=0) / np.abs(exact).max(axis=0)).max() < 2e-6


FLOATING = """
model floating {
  node a, b, c: translation
  K: potential(e = 0.08 N*(q/(1 m) + (q/(1 m))^3)) a -> ground
  M: kinetic(p = 1.3 N.s*(f/(1 m/s) + (f/(1 m/s))^3)) b -> a
  D: dissipator(e = 2 N*tanh(f/(1 m/s))) c -> a
  S: potential(e = 0.3 N*tanh(q/(1 m))) a -> c
  R: dissipator(e = 1.6 N*(f/(1 m/s))) a -> b
  init K.q = 0 m
  init M.p = 0.2 N.s
  init S.q = 0.6 m
}
scene drifts of floating {
  time 0 s to 2 s
  trace c.f, S.q, D.e, R.f every 0.1 s
  accuracy 1e-4
}
"""


@pytest.mark.parametrize("formulation", [*FORMULATIONS, "kane"])
@pytest.mark.one_in(5)
def test_what_moves_with_a_difference_alone_has_no_inertia_of_its_own(tmp_path, formulation):
    # nothing holds a, b and c but the spring K, so it stays at rest: a hidden condition on the flows at the start
    path = tmp_path / "model.sd"
    path.write_text(FLOATING)
    found = api.simulate(path, formulation=formulation, output=tmp_path / "out.h5")
    times = np.asarray(found.time)

    def rates(t, x):
        flow = inverse(lambda f: 1.3 * (f + f**3), x[1])
        return [-np.arctanh(0.15 * np.tanh(x[0])), -1.6 * flow]

    run = solve_ivp(rates, (0.0, 2.0), [0.6, 0.2], "DOP853", times, rtol=1e-11, atol=1e-13)
    effort = 0.3 * np.tanh(run.y[0])
    flow = [-inverse(lambda f: 1.3 * (f + f**3), p) for p in run.y[1]]
    exact = np.transpose([np.arctanh(effort / 2.0), run.y[0], effort, flow])
    values = np.transpose([found[name] for name in ("c.f", "S.q", "D.e", "R.f")])
    assert (np.abs(values - exact).max(axis=0) / np.abs(exact).max(axis=0)).max() < 1e-4
