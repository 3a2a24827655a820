"""A rod little longer than its crank passes a dead centre: the slider turns back, or goes on through the shaft."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from sysdyn import api

CRANK = """model crank {
  coord a: rotation = 1 rad
  coord x: translation ~ 1.5 m
  energy T* = 1/2*(%(J)r kg.m^2)*a'^2 + 1/2*(%(m)r kg)*x'^2
  init a' = 1 rad/s
  phi rod: (x - 1 m*cos(a))^2 + (1 m*sin(a))^2 = (%(rod)r m)^2
}
scene go of crank { time 0 s to %(span)r s; trace a, x }
"""
SPAN = 10.0


def slider(a, rod):
    """Place, and its slope, on the branch on which the rod points outwards: (x - cos a)^2 + sin^2 a = rod^2."""
    along = np.sqrt((rod - np.sin(a)) * (rod + np.sin(a)))
    return np.cos(a) + along, -np.sin(a) - np.sin(a) * np.cos(a) / along


def exact(time, inertia, mass, rod):
    """a, x [time]: energy is kept, so a' = a'(0) sqrt(I(0)/I(a)), I = J + m (dx/da)^2."""

    def whole(a):
        return inertia + mass * slider(a, rod)[1] ** 2

    options = {"method": "DOP853", "rtol": 1e-12, "atol": 1e-13, "max_step": 0.1, "t_eval": time}
    a = solve_ivp(lambda _, a: np.sqrt(whole(1.0) / whole(a)), (0.0, SPAN), [1.0], **options).y[0]
    return a, slider(a, rod)[0]


@pytest.mark.parametrize("method", ["radau", "bdf", "dopri"])
@pytest.mark.parametrize("formulation", ["lagrangian", "hamiltonian"])
@pytest.mark.parametrize(("inertia", "mass"), [(1.0, 1.0), (1.0, 1e-2), (100.0, 1.0)])
@pytest.mark.parametrize("rod", [1.00001, 1.0000001])
def test_the_slider_stays_on_its_branch_or_the_run_is_refused(tmp_path, inertia, mass, rod, formulation, method):
    """Branches are 2 sqrt(2 (rod - 1)) m apart there, 9 and 0.9 mm: steps of any accuracy passed over."""
    refused = 0
    for accuracy in (1e-2, 1e-4):
        (tmp_path / "m.sd").write_text(CRANK % {"J": inertia, "m": mass, "rod": rod, "span": SPAN})
        try:
            trace = api.simulate(
                tmp_path / "m.sd", formulation=formulation, method=method, accuracy=accuracy, output=tmp_path / "out.h5"
            )
        except (api.SolverFailure, api.NotMet):
            refused += 1
            continue
        a, x = exact(trace.time, inertia, mass, rod)
        assert (trace["x"].values - np.cos(trace["a"].values) > 0.0).all()
        assert np.abs(trace["x"].values - x).max() < 3.0 * accuracy * x.max()
        assert np.abs(trace["a"].values - a).max() < 3.0 * accuracy * a.max()
    assert refused <= (rod < 1.00001)


def test_a_motion_through_the_singular_place_itself_goes_on(tmp_path):
    """Rod and crank of one length: the slider comes to the shaft with the rod upright, and goes on as it came."""
    (tmp_path / "m.sd").write_text(CRANK % {"J": 1.0, "m": 1.0, "rod": 1.0, "span": 1.5})
    trace = api.simulate(tmp_path / "m.sd", method="radau", output=tmp_path / "out.h5")
    assert np.abs(trace["x"].values - 2.0 * np.cos(trace["a"].values)).max() < 1e-3
