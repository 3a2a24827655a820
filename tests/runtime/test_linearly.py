"""Whether a point with a given state can exist: constraints that contradict each other, laws that bend."""

import numpy as np
import pytest
import small_models as models
from sysdyn.runtime.model.carrier import load
from sysdyn.runtime.model.system import System
from sysdyn.runtime.start.linearly import unmet
from sysdyn.runtime.start.settled import Settler


def settled(f, *parts, **more):
    """A settler of a model whose flow f_x, its state, is f, with that point: everything else one."""
    manifest, binding, module = models.small(*parts, **more)
    system = System(manifest, binding, load(module), "settled")
    names = [system.name(k) for k in range(system.unknowns)]
    state, y = np.zeros(system.unknowns, dtype=bool), np.ones(system.unknowns)
    state[[names.index("q_x"), names.index("f_x")]] = True
    y[names.index("f_x")] = f
    kinematics = system.form.k_span
    return Settler(system, kinematics, np.full(system.unknowns, f), 1.0, state), y, state


def asked(f, *parts, **more):
    """`unmet` there."""
    settler, y, state = settled(f, *parts, **more)
    return unmet(settler, 0.0, y, np.ones_like(y), state)


def test_rows_that_contradict_each_other_are_left_where_no_move_changes_anything():
    """Two speeds at once: of three searches, of up to 52 matrices, each ends at the point that is nearest to both."""
    settler, y, _ = settled(1.0, "x", "f_x**2/2", psi={"one": "f_x - 1", "two": "f_x - 2"})
    assert settler.settle(0.0, y, np.ones_like(y))[2] is False
    assert settler.linear.contents.factorisations <= 9


@pytest.mark.parametrize("unit", [1.0, 1e-9, 1e9])
@pytest.mark.long
def test_a_state_beside_its_constraint_is_no_point(unit):
    """A speed that is held at `unit`: it is there, a thousandth beside it, or held at two speeds at once."""
    one, two = {"one": f"f_x - {unit}"}, {"one": f"f_x - {unit}", "two": f"f_x - {2.0 * unit}"}
    assert not asked(unit, "x", "f_x**2/2", psi=one)
    assert asked(1.001 * unit, "x", "f_x**2/2", psi=one)
    assert asked(unit, "x", "f_x**2/2", psi=two)


def test_what_is_said_twice_can_be_met():
    assert not asked(1.0, "x", "f_x**2/2", psi={"one": "f_x - 1", "two": "2*f_x - 2"})


@pytest.mark.long
def test_of_laws_that_bend_nothing_is_said():
    """A flow without inertia behind a cubic law: f_y^3 = -1 has a point, and f_y^2 = -1 none; neither is linear."""
    for law in ("f_y**3", "f_y**2"):
        assert not asked(1.0, "x y", "f_x**2/2", work={"y": f"-{law} - 1"}, intangible=("y",))
    assert not asked(1.0, "x y", "f_x**2/2", work={"y": "-2*f_y - 1"}, intangible=("y",))
