"""Sums of rows that a start settles: their values, sizes and slopes beside full matrices; which sums there are."""

import numpy as np
import pytest
from sysdyn.runtime.start.sums import Sums, floating, weights

ROWS, UNKNOWNS = 6, 4
SUMMED = np.array([1, 2, 4])


@pytest.fixture
def case():
    """Entries (row, column) with one place twice, their values, and two sums of the rows 1, 2 and 4 as a matrix."""
    rng = np.random.default_rng(3)
    row, column = np.array([0, 1, 1, 2, 2, 4, 5, 1]), np.array([0, 0, 3, 3, 1, 2, 2, 3])
    return (row, column), rng.normal(size=row.size), np.array([[1.0, -2.0, 0.0], [0.0, 0.5, 3.0]])


def full(entries, values):
    found = np.zeros((ROWS, UNKNOWNS))
    np.add.at(found, entries, values)
    return found


def test_slopes_of_sums_are_sums_of_slopes_and_stand_in_the_first_summed_rows(case):
    entries, values, matrix = case
    sums = Sums(weights([(np.arange(3), row) for row in matrix]), SUMMED, entries, UNKNOWNS)
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
    sums = Sums(weights([(np.arange(3), row) for row in matrix]), SUMMED, entries, UNKNOWNS)
    values = np.array([9.0, 2.0, 1.0, 9.0, 0.0, 9.0])
    sums.put(values)
    assert values.tolist() == [9.0, 0.0, 0.5, 9.0, 0.0, 9.0]
    sizes = np.array([9.0, 2.0, 1.0, 9.0, 1.0, 9.0])
    sums.put(sizes, sizes=True)
    assert sizes.tolist() == [9.0, 4.0, 3.5, 9.0, 1.0, 9.0]


def test_no_sums_leave_everything(case):
    entries, _, _ = case
    assert len(Sums(weights(()), SUMMED, entries, UNKNOWNS)) == 0


class Point:
    """An inertia that is a full matrix."""

    def __init__(self, matrix):
        self.matrix, self.size = matrix, len(matrix)

    def joined(self):
        return np.stack(np.nonzero(self.matrix))

    def blocks(self, members):
        return self.matrix[members[:, :, None], members[:, None, :]]


def sums_of(*matrices):
    """Sums [k, rows] of the balances of all flows."""
    found = floating([Point(m) for m in matrices], np.arange(len(matrices[0])), 400)
    shown = np.zeros((found.number, len(matrices[0])))
    shown[found.sum, found.row] = found.value
    return shown


def test_what_the_rows_of_an_inertia_hold_in_common():
    """A lever, x' - 2 y': its balances add up with the weights 2 and 1; a mass beside it has no such sum; what has no
    inertia is one by itself."""
    matrix = np.zeros((4, 4))
    matrix[:2, :2], matrix[2, 2] = [[1.0, -2.0], [-2.0, 4.0]], 3.0
    shown = sums_of(matrix)
    shown /= np.abs(shown).max(axis=1, keepdims=True) * np.sign(shown.sum(axis=1, keepdims=True))
    assert np.allclose(shown, [[0.0, 0.0, 0.0, 1.0], [1.0, 0.5, 0.0, 0.0]], rtol=0, atol=1e-14)
    turned = matrix.copy()
    turned[:2, :2] = [[4.0, -2.0], [-2.0, 1.0]]
    assert len(sums_of(matrix, turned)) == 1  # a sum that moves with the state is none
    assert sums_of(np.full((2, 2), np.nan)).shape == (0, 2)
