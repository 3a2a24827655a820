"""A poppet that has rested on its seat lifts, flies and lands: how far it got tells what is nothing of its lift."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from sysdyn.api import simulate

MASS, SPRING, DAMPER, AREA, CLOSED, OIL, INFLOW, BOUNCE = 0.02, 2e4, 8.0, 1e-4, 200.0, 1e-12, 3e-4, 0.3
SPAN = 0.0102
TEXT = f"""model relief {{
  param closed = {CLOSED} N
  node oil: hydraulic
  node x: translation
  Q: flow(f = {INFLOW} m^3/s) ground -> oil
  C: potential(q = {OIL} m^3/Pa*e) oil -> ground
  V: dissipator(f = 0.61*pi*10 mm*max(x.q, 0)*sqrt(2/(850 kg/m^3))*e/(e^2 + (1 kPa)^2)^0.25) oil -> ground
  M: kinetic(p = {MASS} kg*f) x
  K: potential(e = {SPRING} N/m*q) x
  B: dissipator(e = {DAMPER} N.s/m*f) x
  S: effort(e = {AREA} m^2*oil.e - closed) ground -> x
  phi seat: x.q >= 0 m restitution {BOUNCE}
  init C.e = 0 bar
  init x.q = 0 m
  init x.f = 0 m/s
}}
scene s of relief {{ time 0 s to {SPAN} s; trace oil.e, x.q }}
"""


def through(lift, pressure):
    return 0.61 * np.pi * 0.01 * max(lift, 0.0) * np.sqrt(2.0 / 850.0) * pressure / (pressure**2 + 1e6) ** 0.25


@pytest.fixture(scope="module")
def exact():
    """(time) -> pressure [Pa], lift [m]; at rest until the pressure lifts it, then flights between impacts."""
    lifts = CLOSED * OIL / (AREA * INFLOW)
    pieces = [(0.0, lambda t: np.array([INFLOW * t / OIL, 0.0, 0.0]))]
    t, y = lifts, np.array([CLOSED / AREA, 0.0, 0.0])

    def rates(t, y):
        pressure, lift, speed = y
        force = AREA * pressure - CLOSED - SPRING * lift - DAMPER * speed
        return [(INFLOW - through(lift, pressure)) / OIL, speed, force / MASS]

    def lands(t, y):
        return y[1]

    lands.terminal, lands.direction = True, -1
    while t < SPAN:
        found = solve_ivp(
            rates, (t, SPAN), y, "DOP853", rtol=1e-11, atol=1e-13, max_step=5e-5, events=lands, dense_output=True
        )
        pieces.append((t, found.sol))
        t, y = found.t[-1], found.y[:, -1] * np.array([1.0, 0.0, -BOUNCE])
    begins = np.array([begin for begin, _ in pieces])
    return lambda times: np.array([pieces[np.searchsorted(begins, s, "right") - 1][1](s)[:2] for s in times])


@pytest.mark.parametrize("formulation", ["lagrangian", "hamiltonian"])
@pytest.mark.parametrize("accuracy", [1e-2, 1e-4, 1e-6])
@pytest.mark.one_in(12)
def test_first_landing_of_what_has_rested(accuracy, formulation, exact, tmp_path):
    """Its lift was compared with what it was on its seat: no set of constraints fitted (E930)."""
    file = tmp_path / "m.sd"
    file.write_text(TEXT)
    found = simulate(file, formulation=formulation, accuracy=accuracy, output=tmp_path / "m.h5")
    for name, right in zip(("oil.e", "x.q"), exact(found.time).T, strict=True):
        assert np.abs(found[name] - right).max() <= accuracy * np.abs(right).max()
