"""Which row belongs to which unknown: told by hand, and by the symmetry that it gives a matrix."""

import numpy as np
import pytest
import small_models as models
from sysdyn.runtime.model.carrier import load
from sysdyn.runtime.model.own_rows import own_rows
from sysdyn.runtime.model.system import System

ROD = {"rod": "q_x**2 + q_y**2 - 25"}


def system(index, family="lagrangian"):
    """Two masses, coupled by inertia and a spring, on a rod."""
    kinetic, potential = "f_x**2 + f_y**2 + f_x*f_y/2", "3*(q_x - q_y)**2 + q_y**4"
    initial = {"q_x": (3.0, True), "q_y": (4.0, True)}
    made = models.small("x y", kinetic, potential, phi=ROD, initial=initial, form=family)
    return System(made[0], made[1], load(made[2]), index)


def named(of):
    """Unknown -> label of its row, and the group that it stands in."""
    label = {}
    for group, row, first in of.form.groups:
        found = of.description.rows[row]
        label |= {first + k: (group, found.named(k, found.label)) for k in range(found.size)}
    label |= {int(row): ("kinematics", of.name(int(f))) for row, f in zip(of.form.k_row, of.form.k_f, strict=True)}
    return {of.name(k): label.get(int(row)) for k, row in enumerate(own_rows(of)) if row >= 0}


@pytest.mark.long
def test_each_unknown_of_a_rod_has_its_row():
    found = named(system("3"))
    assert found["q_x"][0] == found["q_y"][0] == "dynamics"
    assert found["f_x"] == ("kinematics", "f_x")
    assert found["f_y"] == ("kinematics", "f_y")
    assert found["kappa_rod"] == ("phi", "rod")


@pytest.mark.long
def test_momenta_have_their_definitions():
    found = named(system("3", "hamiltonian"))
    assert found["p_x"][0] == found["p_y"][0] == "momentum"
    assert found["q_x"][0] == "dynamics"


@pytest.mark.parametrize("index", ["0", "1", "2", "3"])
@pytest.mark.parametrize("family", ["lagrangian", "hamiltonian"])
@pytest.mark.long
def test_no_row_belongs_to_two(index, family):
    own = own_rows(system(index, family))
    known = own[own >= 0]
    assert np.unique(known).size == known.size


@pytest.mark.long
def test_what_stores_couple_and_constraints_react_with_stands_on_both_sides_of_the_diagonal():
    """Forces k (x - y) and reactions kappa dphi/dq: the part of displacements and multipliers is symmetric."""
    of = system("3")
    y = np.zeros(of.unknowns)
    for k in range(of.unknowns):
        y[k] = {"q_x": 3.0, "q_y": 4.0, "kappa_rod": 0.7}.get(of.name(k), 0.0)
    full = of.dense(of.jacobian(0.0, y, np.zeros_like(y))[0])
    own, names = own_rows(of), [of.name(k) for k in range(of.unknowns)]
    part = [names.index(name) for name in ("q_x", "q_y", "kappa_rod")]
    square = full[np.ix_(own[part], part)]
    assert np.abs(square - square.T).max() == 0.0
    assert square[0, 1] == -6.0
