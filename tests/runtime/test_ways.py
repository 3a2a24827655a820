"""Ways to the rows of a start, each by itself; points beside a start: against roots found by bisection, and by hand."""

import math

import numpy as np
import pytest
import small_models as models
from scipy.optimize import brentq
from sysdyn.runtime.model.carrier import load
from sysdyn.runtime.model.failures import InconsistentStart
from sysdyn.runtime.model.system import System
from sysdyn.runtime.start.held import own_residual
from sysdyn.runtime.start.start import ConsistentState, consistent_start
from sysdyn.runtime.start.starter import Starter
from sysdyn.runtime.start.strategies import STRATEGIES, applicable, behind, first
from sysdyn.runtime.structure.redundancy import nearby, reactions, vanishing_constraints


def system_of(*parts, **more):
    manifest, binding, module = models.small(*parts, **more)
    return System(manifest, binding, load(module), "3")


def driven(law):
    """A mass that an effort pushes, and what that has to be."""
    rest = {"q_x": (0, True), "f_x": (0, True)}
    return system_of("x", "f_x**2/2", work={"x": "e_1"}, implicit=("1",), gamma={"law": law}, initial=rest)


def at_rest(system, **guess):
    """The equations of its start, unknowns with these values, and which of them are free."""
    starter = Starter(system)
    y = starter.guess[: starter.n].copy()
    for name, value in guess.items():
        y[starter.settled.unknown_names.index(name)] = value
    return starter, np.append(y, np.zeros(starter.rates.size)), starter.free.copy()


STEEP = "exp(e_1/0.025 - 28) + e_1 - 10"
"""1e-12 (exp(e/25 mV)) and a volt an ohm from 10 V: a diode behind a step."""


@pytest.mark.parametrize("name", ["newton", "homotopy"])
@pytest.mark.parametrize("guess", [0.0, 1.0, 17.0])
@pytest.mark.long
def test_each_way_leads_up_to_a_steep_law_and_down_it(name, guess):
    """From 0 V the first step would lead to 10 V and exp(372), from 17 V its exponent is 652."""
    starter, x, free = at_rest(driven(STEEP), e_1=guess)
    found, holds = first(dict(STRATEGIES[:2])[name](starter, 0.0, x, x, free), x)
    root = brentq(lambda e: math.exp(e / 0.025 - 28.0) + e - 10.0, 0.0, 2.0, xtol=1e-14)
    assert holds
    assert found.x[2] == pytest.approx(root, rel=1e-12)
    assert found.x[3:] == pytest.approx([root, found.x[4]], rel=1e-12)  # the mass is pushed by it
    assert (found.x[:2] == 0.0).all()
    assert own_residual(starter, 0.0, found.x, found.x) < 1e-12


def test_from_a_point_where_slopes_vanish_newtons_method_leads_away():
    """e^2 = 4 from e = 0: no step of Newton's says where to go; either root is one."""
    starter, x, free = at_rest(driven("e_1**2 - 4"))
    found, holds = first(STRATEGIES[0][1](starter, 0.0, x, x, free), x)
    assert holds
    assert abs(found.x[2]) == pytest.approx(2.0, rel=1e-12)


def test_behind_a_jump_the_root_is_found_and_none_where_there_is_none():
    starter, x, free = at_rest(driven(STEEP))
    found = behind(starter, 0.0, x, free)
    assert math.exp(found[2] / 0.025 - 28.0) + found[2] == pytest.approx(10.0, rel=1e-10)
    starter, x, free = at_rest(driven("exp(e_1) + 1"))
    assert behind(starter, 0.0, x, free) is None


@pytest.mark.parametrize(("law", "bent"), [("2*e_1 - 4", False), ("e_1**2 - 4", True), (STEEP, True)])
def test_linear_rows_are_not_sought_along_detours(law, bent):
    starter, x, free = at_rest(driven(law))
    found = [name for name, _ in applicable(starter, 0.0, x, free)]
    assert found == ([name for name, _ in STRATEGIES] if bent else ["newton", "newton"])


def test_the_way_that_was_taken_stays_with_the_state():
    assert consistent_start(driven(STEEP), 0.0).strategy == "newton"
    assert consistent_start(driven("e_1**2 - 4"), 0.0).strategy == "newton"
    with pytest.raises(InconsistentStart, match="nonfinite"):  # beyond the largest number at the guess and at rest
        consistent_start(driven("exp(e_1/0.025 + 800) + e_1 - 10"), 0.0)


def rod(length, x, y):
    """A state [as written] of a point on a rod."""
    made = system_of("x y", "(f_x**2 + f_y**2)/2", phi={"rod": f"q_x**2 + q_y**2 - {length}**2"})
    there = np.array([x, y, 0.0, 0.0, 0.0])
    return made, ConsistentState(0.0, there, np.zeros(5), (), 0.0)


def test_points_beside_a_start_lie_on_its_constraints():
    """Three, moved by hundredths, back on the circle; no two of them alike."""
    points = nearby(*rod(5.0, 3.0, 4.0))
    assert [math.hypot(*y[:2]) for y in points] == pytest.approx([5.0] * 3, rel=1e-9)
    moved = np.array([y[:2] for y in points]) - (3.0, 4.0)
    assert (np.linalg.norm(moved, axis=1) < 2.0).all()
    assert np.unique(np.round(moved, 9), axis=0).shape[0] == 3


@pytest.mark.parametrize(("length", "x", "y", "singular"), [(5.0, 3.0, 4.0, []), (0.0, 0.0, 0.0, [0])])
def test_a_gradient_that_vanishes_there_alone_is_singular(length, x, y, singular):
    """(2 x, 2 y) is zero at the origin, and the circle of radius 0 has no other point."""
    assert vanishing_constraints(*rod(length, x, y)).tolist() == singular


def test_reactions_are_the_gradients_of_constraints_scaled_to_one():
    system, state = rod(5.0, 3.0, 4.0)
    found = reactions(system, system.jacobian(0.0, state.y, state.yd)[0])
    assert system.unknown_names[found.multipliers[0]] == "kappa_rod"
    assert found.which.tolist() == [0, 0]
    assert np.abs(found.value) == pytest.approx([1.0, 1.0], abs=0.01)
