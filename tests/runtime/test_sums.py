"""Sums of rows that a start settles: their values, sizes and slopes beside full matrices; which sums there are."""

import numpy as np
import pytest
from sysdyn.runtime.start.sums import Sums, of_few, weights

ROWS, UNKNOWNS = 6, 4
SUMMED = np.array([1, 2, 4])


@pytest.fixture
def case():
    """Entries (row, column) with one place twice, their values, and two sums of the rows 1, 2 and 4."""
    rng = np.random.default_rng(3)
    row, column = np.array([0, 1, 1, 2, 2, 4, 5, 1]), np.array([0, 0, 3, 3, 1, 2, 2, 3])
    return (row, column), rng.normal(size=row.size), np.array([[1.0, -2.0, 0.0], [0.0, 0.5, 3.0]])


def full(entries, values):
    found = np.zeros((ROWS, UNKNOWNS))
    np.add.at(found, entries, values)
    return found


def test_slopes_of_sums_are_sums_of_slopes_and_stand_in_the_first_summed_rows(case):
    entries, values, matrix = case
    sums = Sums(weights(matrix), SUMMED, entries, UNKNOWNS)
    got = sums.slopes(values)
    rows, columns = np.append(entries[0], sums.rows), np.append(entries[1], sums.columns)
    wanted = full(entries, values)
    own = matrix @ wanted[SUMMED]
    wanted[SUMMED] = 0.0
    wanted[SUMMED[:2]] = own
    assert np.allclose(full((rows, columns), got), wanted, rtol=0, atol=1e-15)
    assert len(set(zip(sums.rows, sums.columns, strict=True))) == sums.rows.size


def test_values_cancel_and_sizes_do_not(case):
    entries, _, matrix = case
    sums = Sums(weights(matrix), SUMMED, entries, UNKNOWNS)
    values = np.array([9.0, 2.0, 1.0, 9.0, 0.0, 9.0])
    sums.put(values)
    assert values.tolist() == [9.0, 0.0, 0.5, 9.0, 0.0, 9.0]
    sizes = np.array([9.0, 2.0, 1.0, 9.0, 1.0, 9.0])
    sums.put(sizes, sizes=True)
    assert sizes.tolist() == [9.0, 4.0, 3.5, 9.0, 1.0, 9.0]


def test_no_sums_leave_everything(case):
    entries, _, _ = case
    assert len(Sums(weights(np.zeros((0, 3))), SUMMED, entries, UNKNOWNS)) == 0


def test_what_the_rows_of_an_inertia_hold_in_common():
    """A lever, x' - 2 y': its balances add up with the weights 2 and 1; a mass beside it has no such sum."""
    matrix = np.array([[1.0, -2.0, 0.0], [-2.0, 4.0, 0.0], [0.0, 0.0, 3.0]])
    found = of_few(matrix)
    assert found.number == 1
    shown = np.zeros((1, 3))
    shown[found.sum, found.row] = found.value
    assert np.allclose(shown / shown[0, 1], [[2.0, 1.0, 0.0]], rtol=0, atol=1e-14)
    assert of_few(np.full((2, 2), np.nan)).number == 0
