"""Bridges that block twice a period: one diode holds the load meanwhile, and hands it on where the source is zero."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from sysdyn.api import simulate

MAINS, R, L, C, LOAD = 325.0, 0.5, 2e-3, 1e-3, 50.0
SPAN = 0.2
TEXT = f"""from std.electrical import voltage, diode, capacitor, resistor, inductor
model rectifier {{
  node a, b, c, p, n: electrical
  V: voltage(v = {MAINS} V*sin(2*pi*50 Hz*t)) a -> ground
  R: resistor(R = {R} ohm) a -> b
  L: inductor(L = {L} H) b -> c
  D1: diode.complementary() c -> p
  D2: diode.complementary() ground -> p
  D3: diode.complementary() n -> c
  D4: diode.complementary() n -> ground
  C: capacitor(C = {C} F) p -> n
  Rl: resistor(R = {LOAD} ohm) p -> n
  init L.f = 0 A
  init C.e = 0 V
}}
scene s of rectifier {{ time 0 s to {SPAN} s; trace L.f, C.e }}
"""


def source(t):
    return MAINS * np.sin(100.0 * np.pi * t)


@pytest.fixture(scope="module")
def exact():
    """(time, current [A], voltage [V]) by pieces: sense 1 or -1 while the current flows, 0 while the bridge blocks."""
    t, y, sense, pieces = 0.0, [0.0, 0.0], 1, []
    while t < SPAN:

        def rates(t, y, sense=sense):
            return [sense**2 * (source(t) - R * y[0] - sense * y[1]) / L, (sense * y[0] - y[1] / LOAD) / C]

        events = [lambda t, y: y[0]] if sense else [lambda t, y, s=s: s * source(t) - y[1] for s in (1, -1)]
        for event in events:
            event.terminal, event.direction = True, -sense or 1
        found = solve_ivp(
            rates, (t, SPAN), y, "DOP853", rtol=1e-11, atol=1e-11, max_step=2e-4, events=events, dense_output=True
        )
        pieces.append((t, found.sol))
        t, y = found.t[-1], found.y[:, -1].copy()
        fired = [k for k, at in enumerate(found.t_events) if at.size]
        sense = 0 if sense else (1, -1)[fired[0]] if fired else 0
        y[0] = 0.0
    begins = np.array([begin for begin, _ in pieces])
    return lambda times: np.array([pieces[np.searchsorted(begins, s, "right") - 1][1](s) for s in times])


@pytest.mark.parametrize("formulation", ["lagrangian", "hamiltonian"])
@pytest.mark.parametrize("accuracy", [1e-4, 1e-6, 1e-7])
@pytest.mark.one_in(12)
def test_bridge_that_blocks_is_as_accurate_as_asked(accuracy, formulation, exact, tmp_path):
    """Behind its line a bridge shorts nothing where its source goes through zero: no steps of round-off there."""
    file = tmp_path / "m.sd"
    file.write_text(TEXT)
    found = simulate(file, formulation=formulation, accuracy=accuracy, output=tmp_path / "m.h5")
    current, voltage = exact(found.time).T
    for name, right in (("L.f", current), ("C.e", voltage)):
        assert np.abs(found[name] - right).max() <= accuracy * np.abs(right).max()
    handed = [e.time for e in found.events if abs(100.0 * e.time - round(100.0 * e.time)) < 1e-7]
    assert len(handed) == 2 * (round(100 * SPAN) - 1)  # one diode lets go and another holds, at one instant
    assert found.statistics["steps"] < 1000
