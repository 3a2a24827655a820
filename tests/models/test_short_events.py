"""A diode that conducts for a part of a step is seen to, and sought where it was seen once points are settled."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from sysdyn import api

CLAMP = """\
from std.electrical import resistor, capacitor, inductor, voltage, diode
model clamp {
  node a, b, k: electrical
  L: inductor(L = 1 mH) a -> ground
  C: capacitor(C = 1 uF) a -> ground
  D: diode.complementary() a -> b
  Rb: resistor(R = 2 ohm) b -> k
  B: voltage(v = 12 V) k -> ground
  init C.e = 30 V
  init L.f = 0 A
}
scene rings of clamp {
  time 0 s to 2 ms
  trace a.e, L.f, D.f every 5 us
}
"""


def _slopes(_t, state):
    """Rates of the voltage and the current of the coil: the battery takes what is above 12 V through 2 ohm."""
    voltage, current = state
    return [-(current + max(voltage - 12.0, 0.0) / 2.0) / 1e-6, voltage / 1e-3]


@pytest.mark.parametrize("accuracy", [1e-5, 1e-6, 1e-7, 1e-8])
@pytest.mark.long
def test_a_clamp_takes_the_crest_of_every_swing(accuracy, tmp_path):
    """It conducts for 3 us of steps of 60: radau passed over some of eleven crests at half of all tolerances (E920)."""
    (tmp_path / "clamp.sd").write_text(CLAMP)
    trace = api.simulate(tmp_path / "clamp.sd", method="radau", accuracy=accuracy, output=tmp_path / "out.h5")
    times, places = np.unique(trace.time, return_index=True)
    exact = solve_ivp(
        _slopes, (0.0, 2e-3), [30.0, 0.0], method="DOP853", rtol=1e-12, atol=1e-12, max_step=2e-7, t_eval=times
    )
    assert len(trace.events) == 21
    for name, values in (("a.e", exact.y[0]), ("L.f", exact.y[1])):
        assert np.abs(trace[name].values[places] - values).max() <= accuracy * np.abs(values).max()


@pytest.mark.parametrize("rtol", np.logspace(-4, -12, 17))
@pytest.mark.one_in(30)
def test_at_every_tolerance(rtol, tmp_path):
    (tmp_path / "clamp.sd").write_text(CLAMP)
    trace = api.simulate(tmp_path / "clamp.sd", method="radau", rtol=float(rtol), output=tmp_path / "out.h5")
    assert len(trace.events) == 21


SWING = """\
model m {
  param w = 1 um
  param c = 0.3 m
  coord x: translation = 1 m
  energy T* = 1/2*(1 kg)*x'^2
  energy V = 1/2*(100 N/m)*x^2
  init x' = 0 m/s
  discrete n = 0
  discrete at = 0 s
  when CONDITION { n := n + 1 }
  when CONDITION { at := t }
}
scene s of m { time 0 s to 3 s; trace n, at; accuracy 1e-6 }
"""
WINDOWS = {
    "abs": ("abs(x - c) < w", (1e-4, 1e-6, 1e-7)),
    "max": ("max(x - c, c - x) < w", (1e-4, 1e-6, 1e-7)),
    "square": ("(x - c)^2 < w^2", (1e-2, 1e-3, 1e-4)),
}


@pytest.mark.parametrize("method", ["bdf", "radau", "dopri"])
@pytest.mark.parametrize("window", WINDOWS)
@pytest.mark.long
def test_a_window_as_narrow_as_the_accuracy_is_not_passed_over(window, method, tmp_path):
    """It is open for 0.2 us of steps of 30 ms: |x - c| falls below zero and comes back between two looks at a step."""
    condition, widths = WINDOWS[window]
    (tmp_path / "swing.sd").write_text(SWING.replace("CONDITION", condition))
    for c in np.linspace(-0.8, 0.9, 7):
        passes = np.sort([(k * 2.0 * np.pi + sign * np.arccos(c)) / 10.0 for k in range(6) for sign in (-1.0, 1.0)])
        passes = passes[(passes > 0.0) & (passes < 3.0)]
        for w in widths:
            settings = {"w": f"{w} m", "c": f"{c} m"}
            trace = api.simulate(tmp_path / "swing.sd", method=method, set=settings, output=tmp_path / "out.h5")
            assert trace["n"].values[-1] == passes.size
            assert abs(trace["at"].values[-1] - passes[-1]) < w + 1e-6
