"""Closed chains that pass positions in which they lie flat: constraints lose rank there, the motion does not stop.

Every method passes, compared with one equation of motion in an angle.
"""

import numpy as np
import pytest
from model_runs import FOUR, attempt, trace_of
from reduced import ROOT
from scipy.integrate import quad, solve_ivp
from sysdyn.runtime.trace.trace import Trace

PRIMAL = FOUR[:2]
METHODS = ("radau", "bdf", "dopri")


def cranks_in_parallel(times, n):
    """Angle from upright of each of n + 1 cranks that n couplers join: uniform bars of 1 kg, 1 m, at 1 m/s at first."""
    ratio = 9.81 * ((n + 1) / 2 + n) / ((n + 1) / 3 + n)
    known = {"method": "DOP853", "t_eval": times, "rtol": 1e-12, "atol": 1e-12}
    return solve_ivp(lambda _, y: (y[1], ratio * np.sin(y[0])), (0.0, times[-1]), (0.0, 1.0), **known).y[0]


def bars(accuracy):
    text = (ROOT / "models" / "benchmark" / "fourbar.sd").read_text()
    return text.replace("as y7", f"as y7 every 25 ms\n  accuracy {accuracy}")


def off(trace, n):
    """Largest distance of the first crank's tip from where it should be, in either coordinate [m]."""
    angle = cranks_in_parallel(trace.time, n)
    return max(np.abs(trace["y0"].values - np.sin(angle)).max(), np.abs(trace["y1"].values - np.cos(angle)).max())


@pytest.mark.parametrize("n", [1, 2])
@pytest.mark.parametrize("formulation", PRIMAL)
@pytest.mark.parametrize(("method", "accuracy"), [("radau", 1e-3), ("radau", 1e-6), ("dopri", 1e-5), ("bdf", 1e-3)])
@pytest.mark.one_in(30)
def test_cranks_in_parallel_pass_where_all_bars_lie_flat(tmp_path, method, accuracy, formulation, n):
    given = {"formulation": formulation, "method": method, "settings": (("n", str(n)),)}
    trace = trace_of(tmp_path, bars(accuracy), **given)
    assert np.sum(np.diff(np.sign(np.cos(cranks_in_parallel(trace.time, n)))) != 0) > 5
    assert off(trace, n) < accuracy


@pytest.mark.parametrize("accuracy", [1e-6, 1e-7, 1e-8])
@pytest.mark.parametrize("formulation", PRIMAL)
@pytest.mark.one_in(5)
def test_a_chain_that_folds_is_never_met(tmp_path, formulation, accuracy):
    """There the chain might fold, which takes energy: by round-off a fine run does; it is refused then."""
    ran, _ = attempt(tmp_path, bars(accuracy), formulation=formulation, method="dopri", settings=(("n", "1"),))
    trace = Trace.open(tmp_path / "trace.h5")
    assert ran.exit == 3 or off(trace, 1) < 3 * accuracy


CRANK = """
model crank {
  param L = 1 m
  param m = 1 kg
  coord a, b: rotation
  coord x: translation
  energy T* = 1/6*m*L^2*a'^2 + 1/24*m*L^2*b'^2 + 1/2*m*x'^2
  energy T* = 1/2*m*L^2*((-sin(a)*a' - sin(b)*b'/2)^2 + (cos(a)*a' + cos(b)*b'/2)^2)
  phi along: L*cos(a) + L*cos(b) = x
  phi across: L*sin(a) + L*sin(b) = 0 m
  init a = 0.3 rad
  init b ~ -0.3 rad
  init x ~ 2 m
  init a' = 2 rad/s
}
scene go of crank {
  time 0 s to 5 s
  accuracy 1e-6
  trace a, x every 10 ms
}
"""


@pytest.mark.parametrize("formulation", PRIMAL)
@pytest.mark.parametrize("method", METHODS)
@pytest.mark.long
def test_a_crank_as_long_as_its_rod_does_not_fold(tmp_path, method, formulation):
    """b = -a throughout: a' is what the energy leaves it, and the time to an angle an integral."""
    trace = trace_of(tmp_path, CRANK, formulation=formulation, method=method)
    angle = trace["a"].values

    def inertia(a):  # 2 T*/a'^2
        return 1 / 3 + 1 / 12 + 4 * np.sin(a) ** 2 + 9 / 4 * np.sin(a) ** 2 + np.cos(a) ** 2 / 4

    momentum = 2.0 * np.sqrt(inertia(0.3))
    rows = zip(angle[::20], trace.time[::20], strict=True)
    late = [quad(lambda a: np.sqrt(inertia(a)) / momentum, 0.3, a)[0] - t for a, t in rows]
    assert angle[-1] > 1.5 * np.pi
    np.testing.assert_allclose(late, 0.0, atol=5e-6)
    np.testing.assert_allclose(trace["x"].values, 2.0 * np.cos(angle), atol=2e-6)
