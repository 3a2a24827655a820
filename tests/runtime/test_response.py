"""Magnitudes of what starts at zero behind sources that do too: bounds by one step of implicit Euler."""

import ctypes

import numpy as np
import pytest
import small_models as models
from sysdyn.runtime.model import core_library as lib
from sysdyn.runtime.model import scales
from sysdyn.runtime.model.carrier import load
from sysdyn.runtime.model.system import System
from sysdyn.runtime.start.start import consistent_start

SPAN = 10.0
SWING = 3.0
"""N, of a force of 1 rad/s."""


def pushed(drag, force=f"{SWING}*sin(t)"):
    """1 kg pushed from rest against a law of drag."""
    initial = {"q_x": (0.0, True), "f_x": (0.0, True)}
    manifest, binding, module = models.small("x", "f_x**2/2", content=drag, work={"x": force}, initial=initial)
    system = System(manifest, binding, load(module), "2")
    y, yd = consistent_start(system, 0.0).for_form(system)
    return system, y, yd


def response(system, y, quick, span):
    y, scale = np.ascontiguousarray(y), np.ones(system.unknowns)
    least, most = np.zeros(system.unknowns), np.zeros(system.unknowns)
    core = scales.balance(system).address, ctypes.byref(system.core)
    arrays = map(lib.pointer, (y, scale, least, most))
    found = lib.core.sd_response(*core, None, 0.0, quick, span, *arrays)
    return found, least, most


def test_a_linear_response_is_that_of_implicit_euler():
    system, y, _ = pushed("f_x**2/2")
    _, least, most = response(system, y, 0.5, SPAN)
    for bound, step in ((least, 0.5), (most, SPAN)):
        flow = SWING * np.sin(0.5) * step / (1.0 + step)
        assert bound[system.kinds == "f"] == pytest.approx([flow], rel=1e-6)
        assert bound[system.kinds == "q"] == pytest.approx([step * flow], rel=1e-6)


def test_a_steep_law_holds_what_it_drives():
    """3 kN on what resists by exp(20 v) - 1: 0.4 m/s, and neither 3 kN for a second on 1 kg nor less than it does."""
    system, y, _ = pushed("exp(20*f_x)/20 - f_x", force="3000*sin(t)")
    _, least, most = response(system, y, 1.0, SPAN)
    held = np.log(1.0 + 3000.0 * np.sin(1.0)) / 20.0
    assert held == pytest.approx(least[system.kinds == "f"][0], rel=0.1)
    assert held == pytest.approx(most[system.kinds == "f"][0], rel=0.1)


@pytest.mark.parametrize("stiff", [1.0, 1e8])
def test_magnitudes_lie_between_the_bounds(stiff):
    system, y, yd = pushed(f"{stiff!r}*f_x**2/2")
    jy, jyd = system.jacobian(0.0, y, yd)
    found, _ = scales.magnitudes(system, 0.0, SPAN, y, yd, (jy, jyd, yd, None))
    _, least, most = response(system, y, 1.0, SPAN)
    carried = (system.kinds == "q") | (system.kinds == "f")
    assert (found[carried] >= 0.99 * least[carried]).all()
    assert (found[carried] <= 1.01 * most[carried]).all()
    # the largest flow of the motion: v = SWING sin(t - phase)/hypot(1, stiff)
    largest = SWING / np.hypot(1.0, stiff)
    assert largest / 3.0 <= found[system.kinds == "f"][0] <= 3.0 * largest


def test_a_path_that_does_not_begin_bounds_nothing():
    """Behind t = 0 the force is no number."""
    system, y, _ = pushed("f_x**2/2", force="3*sin(t)*sqrt(-t)")
    assert response(system, y, 1.0, SPAN)[0] == 0
