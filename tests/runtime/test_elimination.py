"""What leaves a form: rows of constants that define unknowns, and the values that they give, computed by hand."""

import numpy as np
import pytest
import small_models as models
from sysdyn.runtime.condense.elimination import affine, definable, eliminate, steady, unread_families
from sysdyn.runtime.model.carrier import load
from sysdyn.runtime.model.system import System


def system_of(*parts, bent=(), **more):
    """Of a small model with what a manifest says besides: what kernels read, which rows (bent) are curved."""
    manifest, binding, module = models.small(*parts, observe={}, **more)
    labels = [row["label"] for row in manifest["structure"]["rows"]]
    for block in manifest["structure"]["blocks"].values():
        for kernel in block["kernels"]:
            kernel["reads"] = sorted({family for _, (family, _) in kernel["dy"]})
            kernel["curved"] = [row for row, _ in kernel["rows"] if labels[row] in bent]
    return System(manifest, binding, load(module))


def defining(system, y):
    """`definable` at a point, of a run that starts at zero."""
    zero = np.zeros(y.size)
    return definable(system, system.jacobian(0.0, y, zero)[0], system.residual(0.0, zero, zero), zero)


def eliminated(system, y):
    """Names of what leaves, in order, and y with their values by their rows alone."""
    jy = system.jacobian(0.0, y, np.zeros(y.size))[0]
    found = eliminate(system, defining(system, y))
    columns = system.pattern.columns_of()
    constant = system.residual(0.0, np.zeros(y.size), np.zeros(y.size))
    for k, (place, row) in enumerate(zip(found.place, found.row, strict=True)):
        entries = found.entry[found.start[k] : found.start[k + 1]]
        y[place] = -(constant[row] + jy[entries] @ y[columns[entries]]) / jy[found.pivot[k]]
    return [system.name(int(place)) for place in found.place], y


def values(system, **named):
    names = [system.name(k) for k in range(system.unknowns)]
    return np.array([named.get(name, 0.0) for name in names]), names


CHAIN = {"one": "e_1 - 3*e_2", "two": "e_2 - 5*f_x + 2"}


def chain(bent=()):
    return system_of("x", "f_x**2/2", work={"x": "-e_1"}, implicit=("1", "2"), gamma=CHAIN, bent=bent)


def test_definitions_are_followed_one_after_the_other():
    """e_2 = 5 f - 2, e_1 = 3 e_2: at f = 2 they are 8 and 24."""
    system = chain()
    y, names = values(system, f_x=2.0)
    gone, y = eliminated(system, y)
    assert gone == ["e_2", "e_1"]
    assert dict(zip(names, y.tolist(), strict=True)) == {"q_x": 0.0, "f_x": 2.0, "e_1": 24.0, "e_2": 8.0}


@pytest.mark.long
def test_what_bends_or_carries_the_state_stays():
    system = chain(bent=("two",))
    rows = [system.row_label(k).label for k in np.flatnonzero(affine(system))]
    assert "two" not in rows
    assert "one" in rows
    assert eliminated(system, values(system)[0])[0] == ["e_1"]
    law = {"gear": "f_x - 2*f_y"}
    heavy, light = (system_of("x y", kinetic, psi=law) for kinetic in ("f_x**2 + f_y**2", "f_x**2"))
    assert eliminated(heavy, values(heavy)[0])[0] == []
    assert "f_y" in eliminated(light, values(light)[0])[0]


def test_no_unknown_is_defined_through_itself():
    """e_1 = 2 e_2 + 1 and e_2 = 3 e_1: one of them leaves, through the other."""
    ring = {"one": "e_1 - 2*e_2 - 1", "two": "e_2 - 3*e_1"}
    system = system_of("x", "f_x**2/2", work={"x": "-e_1"}, implicit=("1", "2"), gamma=ring)
    gone, _ = eliminated(system, values(system)[0])
    assert len(gone) == 1


def allowed(system, y):
    """(label of a row, name of an unknown) that it may define."""
    may = np.flatnonzero(defining(system, y))
    rows, columns = system.pattern.row[may], system.pattern.columns_of()[may]
    return {(system.row_label(int(r)).label, system.name(int(c))) for r, c in zip(rows, columns, strict=True)}


@pytest.mark.parametrize("part", [0.0, 1e-12])
def test_a_vanishing_coefficient_defines_nothing(part):
    """e_1 = e_2/1e-12 would lose all digits; e_2 = 1e-12 e_1 keeps them.  A row of nothing defines nothing."""
    law = {"one": "q_x*e_1 - e_2", "two": "e_1 + e_2 - f_x", "three": "q_x*e_3"}
    system = system_of("x", "f_x**2/2", work={"x": "-e_1"}, implicit=("1", "2", "3"), gamma=law)
    may = allowed(system, values(system, q_x=part)[0])
    assert ("one", "e_1") not in may
    assert ("one", "e_2") in may
    assert (("three", "e_3") in may) == (part > 0.0)


@pytest.mark.parametrize(
    ("law", "leaves"),
    [
        ("e_1 - 1e12*q_x", True),
        ("e_1 - 1e12*q_x + 1e12", False),
        ("e_1 - 1e12*q_x + e_2", False),
        ("e_1 - 1e12*e_2", False),
    ],
)
def test_a_multiple_of_what_carries_the_state_keeps_its_digits(law, leaves):
    """The voltage of a capacitor of 1 pF by its charge, beside resistors of 1 ohm: no difference is taken of it, unless
    a constant or another unknown stands beside.
    """
    laws = {"one": law, "two": "e_1 - e_2 - f_x"}
    system = system_of("x", "f_x**2/2", work={"x": "-e_1"}, implicit=("1", "2"), gamma=laws)
    assert (("one", "e_1") in allowed(system, values(system)[0])) == leaves


@pytest.mark.parametrize(("potential", "gone"), [("q_x**2", ["q_y"]), ("q_x**2 + q_y**2", []), (0, ["q_x", "q_y"])])
def test_displacements_that_nothing_reads(potential, gone):
    system = system_of("x y", "f_x**2/2 + f_y**2/2", potential)
    blocks = [call.block for call in system.form.calls]
    families = system.description.families
    assert [families[k].name for k in unread_families(system.description, blocks)] == gone
    found = eliminate(system, defining(system, np.zeros(system.unknowns)))
    assert [system.name(int(k)) for k in found.unread] == gone


@pytest.mark.long
def test_constraints_that_their_rates_hold():
    assert steady(system_of("x y", "f_x**2", phi={"belt": "q_x - 2*q_y - 1"}).description)
    assert not steady(system_of("x y", "f_x**2", phi={"rod": "q_x**2 + q_y**2 - 1"}, bent=("rod",)).description)
