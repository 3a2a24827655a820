"""Which formulation is taken, and why one cannot be."""

from dataclasses import replace

import pytest
from catalogue import ONE, PLACE
from chains import blank, coordinate
from sysdyn.compiler.formulations import choose
from sysdyn.dsl.model import expression as x
from sysdyn.dsl.model.network import Constraint, EnergyTerm

pytestmark = pytest.mark.usefixtures("fresh")


def written(function, *read, co=False, constraint=None):
    """One coordinate x with an energy of what is read of it."""
    energy = EnergyTerm(function, x.mul(*(x.power(x.var("x", kind), x.const(2)) for kind in read)), (), PLACE)
    rows = () if constraint is None else (Constraint("phi", "rod", (), constraint, (), ONE, PLACE),)
    made = replace(coordinate("x"), complementary=co)
    return blank(coordinates=(made,), energies=(energy,), constraints=rows)


@pytest.mark.parametrize(
    ("function", "read", "co", "taken"),
    [
        ("T*", "f", False, "lagrangian"),
        ("T", "p", False, "hamiltonian"),
        ("V*", "e", True, "co_lagrangian"),
        ("V", "q", True, "co_hamiltonian"),
    ],
)
def test_the_energy_that_is_written_says_which_form_is_meant(function, read, co, taken):
    assert choose(written(function, read, co=co), "auto", None) == (taken, ())


def test_what_keeps_a_model_out_of_the_other_family_is_named():
    def reasons(network, wanted):
        return [(d.code, d.message) for d in choose(network, wanted, None)[1]]

    polar = written("T*", "f", "q")
    assert reasons(polar, "co_lagrangian") == [
        ("E601", "not expressible in co_lagrangian: T* depends on displacement x and on x'")
    ]
    rod = written("T*", "f", constraint=x.var("x", "q"))
    assert reasons(rod, "co_hamiltonian") == [
        ("E602", "not expressible in co_hamiltonian: phi rod depends on displacement x")
    ]
    assert reasons(written("T*", "f"), "co_lagrangian") == [("E603", "co_lagrangian of a model with 'coord' ('x')")]
    assert reasons(written("V*", "e", co=True), "kane") == [("E603", "kane of a model with the cocoordinate 'x'")]
    both = replace(polar, coordinates=(coordinate("x"), replace(coordinate("y"), complementary=True)))
    assert [code for code, _ in reasons(both, "auto")] == ["E604"]
