"""Efforts by class of a bead on a turning wire: r and th, a spring along r, drag, a force upwards, a stop."""

import math

import pytest
from catalogue import ONE, PLACE
from chains import blank, coordinate
from sysdyn.compiler.forms.efforts import effort, efforts
from sysdyn.compiler.model.energies import energies
from sysdyn.dsl.model import expression as x
from sysdyn.dsl.model.evaluation import evaluate
from sysdyn.dsl.model.network import Constraint, EnergyTerm, VirtualWork

pytestmark = pytest.mark.usefixtures("fresh")


def half(c, *factors):
    return x.mul(x.const(c / 2), *(x.power(v, x.const(2)) for v in factors))


def bead():
    """2 T* = 2 r'^2 + 2 r^2 th'^2, 2 V = 3 r^2, 2 D = th'^2, 7 on r sin(th), phi: r - 1 = 0, psi: th' - 2 r' = 0."""
    r, th, u, w = x.var("r", "q"), x.var("th", "q"), x.var("r", "f"), x.var("th", "f")
    return energies(blank(
        coordinates=(coordinate("r"), coordinate("th")),
        energies=(
            EnergyTerm("T*", x.add(half(2.0, u), half(2.0, r, w)), (), PLACE),
            EnergyTerm("V", half(3.0, r), (), PLACE),
            EnergyTerm("D", half(1.0, w), (), PLACE),
        ),
        works=(VirtualWork(x.const(7.0), x.mul(r, x.call("sin", th)), (), PLACE),),
        constraints=(
            Constraint("phi", "stop", (), x.sub(r, x.const(1)), (), ONE, PLACE),
            Constraint("psi", "gear", (), x.sub(w, x.mul(x.const(2), u)), (), ONE, PLACE),
        ),
    ))  # fmt: skip


VALUES = {("r", "q", 0): 1.5, ("th", "q", 0): 0.3, ("r", "f", 0): 0.2, ("th", "f", 0): 4.0, ("r", "p", 1): 10.0,
          ("th", "p", 1): 20.0, ("stop", "kappa", 0): 0.5, ("gear", "mu", 0): 0.25}  # fmt: skip
EXPECTED = {
    ("inertial", "r"): -10.0 + 2.0 * 1.5 * 4.0**2,  # -p' and the centrifugal force
    ("inertial", "th"): -20.0,
    ("potential", "r"): -3.0 * 1.5,
    ("dissipative", "th"): -4.0,
    ("source", "r"): 7.0 * math.sin(0.3),
    ("source", "th"): 7.0 * 1.5 * math.cos(0.3),
    ("constraint", "r"): -0.5 + 2.0 * 0.25,
    ("constraint", "th"): -0.25,
    ("implicit", "th"): 0.0,
}


@pytest.mark.parametrize(("name", "owner"), EXPECTED)
def test_each_class_is_its_force(name, owner):
    found = effort(bead(), x.var(owner, f"x:{name}"))
    assert evaluate([found], lambda n: VALUES[n.data]) == pytest.approx([EXPECTED[name, owner]], rel=1e-14)


def test_the_balance_of_a_coordinate_is_the_sum_of_its_classes():
    model = bead()
    for owner in ("r", "th"):
        summed = x.add(*(e.value for e in efforts(model, owner)))
        value = evaluate([summed], lambda n: VALUES[n.data])[0] + VALUES[owner, "p", 1]
        assert value == pytest.approx(-sum(v for (_, own), v in EXPECTED.items() if own == owner), rel=1e-14)
