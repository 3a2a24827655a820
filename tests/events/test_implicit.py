"""Linear complementarity by Lemke's method, against all sets one by one."""

from itertools import product

import numpy as np
import pytest
from sysdyn.runtime.events.implicit import base_of, lemke


def by_sets(m, q):
    """Some z that solves the problem, of all 2^n sets; None without."""
    for held in product((False, True), repeat=q.size):
        which = np.flatnonzero(held)
        z = np.zeros(q.size)
        if which.size:
            z[which] = np.linalg.lstsq(m[np.ix_(which, which)], -q[which], rcond=None)[0]
        if (z >= -1e-9).all() and (q + m @ z >= -1e-9).all() and np.abs((q + m @ z)[which]).max(initial=0.0) < 1e-9:
            return z
    return None


@pytest.mark.long
def test_what_is_passive():
    """Semidefinite of rank 3 with a skew part (what coils and capacitors beside each other make of it): it finds a
    solution wherever there is one.
    """
    chance, some = np.random.default_rng(1), 0
    for _ in range(60):
        part, skew = chance.normal(size=(6, 3)), np.triu(chance.normal(size=(6, 6)))
        m, q = part @ part.T + (skew - skew.T), chance.normal(size=6)
        z, known = lemke(m, q), by_sets(m, q)
        assert (z is None) == (known is None)
        if z is not None:
            some += 1
            w = q + m @ z
            assert (z >= 0.0).all()
            assert w.min() > -1e-9
            assert np.abs(z * w).max() < 1e-9
    assert some > 20


def test_none_where_there_is_none():
    assert lemke(np.zeros((1, 1)), np.array([-1.0])) is None
    assert lemke(np.array([[0.0, -1.0], [1.0, 0.0]]), np.array([-1.0, -1.0])) is None


def test_a_base_that_leaves_nothing_open_is_found():
    """A source u, a diode to x and one back to ground, x held by nothing else: where both block x floats, where both
    conduct their currents are open; one of each does.
    """
    matrix = np.zeros((3, 3))  # unknowns x, currents a, b; rows: balance at x, then the pairs (voltage, current)
    matrix[0] = 0.0, 1.0, -1.0
    right = np.zeros((3, 3))
    right[1, 0] = right[2, 1] = 1.0
    voltages, currents = np.array([[1.0, 0.0, 0.0], [-1.0, 0.0, 0.0]]), np.array([[0.0, 1.0, 0.0], [0.0, 0.0, 1.0]])
    pairs = (voltages, currents), (np.array([0.0, 2.0]), np.zeros(2))
    for held in product((False, True), repeat=2):
        found = base_of(matrix.copy(), right.copy(), np.array([1, 2]), pairs, np.array(held))
        assert found is not None
        moves, base = found
        assert base.sum() == 1
        assert np.isfinite(moves).all()
