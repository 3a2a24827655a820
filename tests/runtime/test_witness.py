"""What a determinant says of eigenvalues, and which reduction is believed by it, against pencils made of known ones."""

import numpy as np
import pytest
import small_models as models
from scipy.stats import ortho_group
from sysdyn.runtime.linear.pencil import Descriptor
from sysdyn.runtime.linear.tangent import Given, NoLinearisation, Outputs, rows_at
from sysdyn.runtime.linear.witness import agrees, spread, witness
from sysdyn.runtime.linear.witnessed import reduce_witnessed
from sysdyn.runtime.model.carrier import load
from sysdyn.runtime.model.system import System
from sysdyn.runtime.start.start import consistent_start


def mixed(e, a, seed):
    """The same pencil in other unknowns and rows."""
    p, q = (ortho_group.rvs(len(e), random_state=seed + k) for k in (0, 1))
    return p @ e @ q, p @ a @ q


def pencil(values, algebraic=0):
    """E dy' = A dy with these eigenvalues, and rows without a rate."""
    n = len(values) + algebraic
    e, a = np.zeros((n, n)), np.eye(n)
    e[range(len(values)), range(len(values))] = 1.0
    a[range(len(values)), range(len(values))] = values
    return e, a


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize(
    ("values", "algebraic"), [([-1.0, -2.0, -7.0], 0), ([-1.0, -2.0, 0.0, 0.0], 2), ([-1e3, -1e-3, 5.0], 1)]
)
def test_a_determinant_counts_eigenvalues_and_knows_their_product(values, algebraic, seed):
    seen = witness(*mixed(*pencil(values, algebraic), seed)) if algebraic == 0 else witness(*pencil(values, algebraic))
    moving = [v for v in values if v]
    assert (seen.states, seen.zeros) == (len(values), values.count(0.0))
    assert seen.size == pytest.approx(np.log(np.abs(np.prod(moving))), abs=1e-9)
    assert seen.certain
    assert not seen.contradicts(np.array(values, dtype=complex))


def test_a_chain_of_integrals_has_no_eigenvalue():
    """0 = y1 - u, y2 = y1', y3 = y2': index 3, no state."""
    e, a = np.diag([1.0, 1.0], -1), np.eye(3)
    seen = witness(e, a)
    assert (seen.states, seen.zeros) == (0, 0)


def test_what_is_not_an_eigenvalue_is_contradicted():
    e, a = pencil([-1.0, -2.0, 0.0])
    seen = witness(e, a)
    for wrong in ([-1.0, -2.0], [-1.0, -2.0, 1e-9], [-1.0, -2.00001, 0.0], [-1.0, -2.0, 0.0, 0.0]):
        assert seen.contradicts(np.array(wrong, dtype=complex)), wrong
    assert agrees(e, a, np.array([-1.0, -2.0, 0.0], dtype=complex))
    assert not agrees(e, a, np.array([-1.0, -2.5, 0.0], dtype=complex))
    assert not agrees(e, a, np.array([-1.0, 0.0], dtype=complex))


def test_a_singular_pencil_has_no_witness():
    assert witness(np.zeros((2, 2)), np.array([[1.0, 1.0], [1.0, 1.0]])) is None
    assert witness(np.zeros((0, 0)), np.zeros((0, 0))) is None
    assert spread(np.diag([1e6, 1.0]), np.diag([3.0, 1.0])) == 1e6


def given(made):
    """Rows of a model at its start without inputs and outputs, and its pencil as written."""
    system = System(made[0], made[1], load(made[2]))
    state = consistent_start(system, 0.0)
    rows, n = rows_at(system, state), system.unknowns
    jy, jyd = system.jacobian(0.0, state.y, state.yd)
    e, a = system.dense(jyd), -system.dense(jy)
    nothing = np.zeros((rows.starter.settled.rows, 0))
    out = Outputs(np.zeros((0, n)), np.zeros((0, n)), (np.zeros((0, 0)),) * 3)
    found = Given(rows, system, state, (nothing,) * 4, out, (), np.zeros(n, dtype=bool))
    none = np.zeros((len(e), 0)), np.zeros((0, n)), np.zeros((0, n)), np.zeros((0, 0))
    return found, Descriptor(e, a, *none, tuple(system.unknown_names))


@pytest.mark.parametrize("form", ["lagrangian", "hamiltonian"])
@pytest.mark.parametrize(("stiff", "loss"), [(4.0, 0.3), (1e12, 1e3), (1e-12, 1e-9)])
@pytest.mark.long
def test_modes_of_two_masses_twelve_decades_apart_are_all_there(stiff, loss, form):
    """x'' = -c x' - k x beside y'' = -y - 0.1 y': roots of two quadratics."""
    made = models.small(
        "x y",
        "f_x**2/2 + f_y**2/2",
        f"{stiff!r}*q_x**2/2 + q_y**2/2",
        f"{loss!r}*f_x**2/2 + 0.1*f_y**2/2",
        initial={"q_x": (0.0, True), "q_y": (0.0, True), "f_x": (0.0, True), "f_y": (0.0, True)},
        form=form,
    )
    small = reduce_witnessed(*given(made), fixed=True)
    found = np.sort_complex(np.linalg.eigvals(small.a) if small.decomposed is None else _values(small))
    expected = np.sort_complex(np.concatenate([np.roots([1.0, loss, stiff]), np.roots([1.0, 0.1, 1.0])]))
    assert found == pytest.approx(expected, rel=1e-9, abs=0.0)


def _values(small):
    return np.array([complex(v) for v in small.decomposed.values])


def test_equations_that_leave_something_open_are_refused():
    made = models.small("x y", "f_x**2/2", "q_x**2/2", initial={"q_x": (0.0, True), "f_x": (0.0, True)})
    with pytest.raises(NoLinearisation):
        reduce_witnessed(*given(made), fixed=True)
