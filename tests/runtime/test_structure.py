import numpy as np
import pytest
import small_models as models
from sysdyn.runtime.model.carrier import load
from sysdyn.runtime.model.patterns import Pattern
from sysdyn.runtime.model.system import System
from sysdyn.runtime.numerics.matching import match_rows
from sysdyn.runtime.start.start import consistent_start
from sysdyn.runtime.structure.structure import _growth_index, null_vectors, pencil_index, structure

# differential index of the seed's catalogue (tests/data/README.md)
CASES = {
    "pendulum": (models.pendulum, 3, 1),
    "pendulum hamiltonian": (lambda: models.pendulum("hamiltonian"), 3, 1),
    "lead_filter": (models.lead_filter, 2, 2),
    "mass_spring": (models.mass_spring, 0, 1),
    "mass_spring hamiltonian": (lambda: models.mass_spring("hamiltonian"), 1, 1),
    "dc_motor": (models.dc_motor, 1, 2),
    "slider_crank": (models.slider_crank, 3, 1),
    "slider_crank, pin without mass": (lambda: models.slider_crank(0.0), 2, 1),
    "slider_crank, slider without mass": (lambda: models.slider_crank(1.0, 0.0), 3, 1),
    "pendulum_spring": (models.pendulum_spring, 2, 2),
    "pendulum_spring, collar with mass": (lambda: models.pendulum_spring(1.0), 3, 2),
    "fluid_tank": (models.fluid_tank, 2, 1),
    "diode": (models.diode_circuit, 2, 2),
}


@pytest.mark.parametrize("name", CASES)
@pytest.mark.long
def test_index_and_freedom(name):
    make, index, dof = CASES[name]
    manifest, binding, module = make()
    system = System(manifest, binding, load(module))
    state = consistent_start(system, 0.0)
    facts = structure(system, state)
    assert facts.index == index
    assert facts.dof == dof
    assert facts.redundant == 0
    assert facts.undetermined == ()
    # the method for large models agrees
    assert _growth_index(system, list(system.jacobian(0.0, state.y, state.yd))) == index


@pytest.mark.parametrize(
    ("content", "index"),
    [("f_x**4 + 2*f_y**4", 1), ("f_x**3 + 2*f_y**3", None), ("f_x**4 + 2*f_y**3", None), ("(f_x + f_y)**4", None)],
)
def test_laws_that_are_flat_at_rest_determine_what_is_monotone(content, index):
    """Two dampers side by side, at rest: their speeds follow from 4 f^3 and 8 f^3, though not from the slopes there; at
    a fold, f^2, there are two or none.
    """
    manifest, binding, module = models.small("x y", 0, "(q_x + q_y)**2/2", content, initial={"q_x": (0, True)})
    system = System(manifest, binding, load(module))
    facts = structure(system, consistent_start(system, 0.0))
    assert facts.index == index
    assert {"f_x", "f_y"} <= set(facts.undetermined)


@pytest.mark.long
def test_redundant_rows_are_named_with_coefficients():
    manifest, binding, module = models.small(
        "x y",
        "f_x**2 + f_y**2",
        phi={"one": "q_x**2 + q_y**2 - 1", "two": "q_x**2/2 + q_y**2/2 - 1/2"},
        initial={"q_x": (0.6, True), "q_y": (0.8, False)},
    )
    system = System(manifest, binding, load(module))
    facts = structure(system, consistent_start(system, 0.0))
    assert (facts.rank, facts.redundant, facts.dof, facts.index) == (1, 1, 1, None)
    assert {label.label for label, _ in facts.dependent} == {"one", "two"}


@pytest.mark.parametrize("size", [1, 2, 3, 4, 5])
def test_pencil_of_known_index(size):
    # a nilpotent block of that size beside an ordinary differential equation, mixed by random bases
    rng = np.random.default_rng(size)
    n = size + 3
    e, b = np.eye(n), np.eye(n)
    e[:size, :size] = np.eye(size, k=1)
    b[size:, size:] = rng.normal(size=(3, 3))
    left, right = rng.normal(size=(n, n)), rng.normal(size=(n, n))
    assert pencil_index(left @ e @ right, left @ b @ right) == size


@pytest.mark.parametrize("spread", [0, 6, 12, 15])
@pytest.mark.parametrize("singular", [False, True])
def test_a_singular_pencil_is_told_from_one_whose_entries_lie_far_apart(spread, singular):
    """Chains of masses whose springs and masses lie up to 10^spread apart; singular ones hold one spring and one mass
    of another body twice.
    """
    rng = np.random.default_rng(spread)
    for _ in range(50):
        n = int(rng.integers(2, 7))
        springs = 10.0 ** rng.uniform(-spread / 2, spread / 2, n)
        mass = np.diag(10.0 ** rng.uniform(-spread / 2, spread / 2, n))
        stiff = np.diag(springs) + np.diag([*springs[1:], 0.0]) - np.diag(springs[1:], 1) - np.diag(springs[1:], -1)
        zero, one = np.zeros((n, n)), np.eye(n)
        e, b = np.block([[one, zero], [zero, mass]]), np.block([[zero, -one], [stiff, zero]])
        if singular:
            k = int(rng.integers(n, 2 * n - 1))
            e[k], b[k] = 3.0 * e[2 * n - 1], 3.0 * b[2 * n - 1]
        columns, rows = null_vectors(e, b)
        assert columns.shape[1] == rows.shape[0] == int(singular)


def test_a_matching_is_as_large_as_it_can_be_and_leaves_what_has_none():
    """Three columns that two rows are left for, and one with a row of its own."""
    column, row = np.array([0, 2, 4, 6, 7], dtype=np.int32), np.array([0, 1, 0, 1, 0, 1, 2], dtype=np.int32)
    found = match_rows(Pattern(3, 4, column, row))
    assert sorted(found) == [-1, 0, 1, 2]
    assert found[3] == 2
