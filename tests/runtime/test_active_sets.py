"""Pivoting against linear complementarity problems solved by trying every set; conditions and bounces by hand."""

from itertools import product
from types import SimpleNamespace

import numpy as np
import pytest
from sysdyn.runtime.events.bounces import is_thrown
from sysdyn.runtime.events.conditions import holds
from sysdyn.runtime.events.pivoting import NoActiveSetError, Pivoting

ROUND_OFF = 1e-12


class Observed:
    """The values are the unknowns; what they have been is of no account."""

    largest = np.zeros(0)

    def __call__(self, t, y, yd):
        return y


class Problem:
    """w = M z + q, w >= 0, z >= 0, w z = 0: what `Contacts` is to pivoting, of inequalities alone."""

    def __init__(self, matrix, q):
        self.matrix, self.q, n = matrix, q, len(q)
        self.contacts = [SimpleNamespace(kind="phi", name=f"c{k}") for k in range(n)]
        self.active, self.p, self.frozen = np.zeros(n, dtype=bool), np.zeros(0), {}
        self.multiplier, self.open, self.observer, self.reversed = list(range(n)), frozenset(), Observed(), set()
        self.through, self.starting = set(), False

    def state(self):
        return tuple(self.active.tolist())

    def settle(self, t, y, yd):
        """(w, z) with z of the active set such that its w is zero."""
        a, z = np.flatnonzero(self.active), np.zeros(len(self.q))
        if a.size:
            block = self.matrix[np.ix_(a, a)]
            if abs(np.linalg.det(block)) < ROUND_OFF:
                return None
            z[a] = np.linalg.solve(block, -self.q[a])
        return np.append(self.matrix @ z + self.q, z), yd, np.zeros(len(self.q))

    def wrongs(self, values, impulses):
        w, z = np.split(values, 2)
        return [k for k in range(len(self.q)) if (z if self.active[k] else w)[k] < -ROUND_OFF]

    def impulses(self, y, found):
        return found[2]

    def fits(self, t, y, found):
        return not self.wrongs(found[0], found[2])

    def become(self, state):
        self.active[:] = state

    def turn(self, k, values):
        self.active[k] = not self.active[k]

    def backwards(self, t, y, found):
        return []

    def finite(self, t, y, yd):
        return frozenset()

    def apply(self):
        """Nothing follows the set here."""

    def every(self):
        """The solution, by trying all sets."""
        for held in product((False, True), repeat=len(self.q)):
            self.active[:] = held
            found = self.settle(0.0, None, None)
            if found is not None and self.fits(0.0, None, found):
                return found[0]
        return None


def matrix(seed, n=6):
    """Positive definite, and not symmetric."""
    random = np.random.default_rng(seed)
    a, skew = random.standard_normal((2, n, n))
    return a @ a.T + 0.1 * np.eye(n) + skew - skew.T, 3.0 * random.standard_normal(n)


@pytest.mark.parametrize("seed", range(12))
@pytest.mark.parametrize("begun", [0, 1])
@pytest.mark.one_in(12)
def test_the_set_that_fits_is_the_one_there_is(seed, begun):
    """Of a positive definite matrix there is exactly one solution, from wherever one begins (Murty 1974)."""
    of = Problem(*matrix(seed))
    expected = of.every()
    of.active[:] = begun
    y, _ = Pivoting(of, lambda *_: False).fit(0.0, np.zeros(12), np.zeros(12), of.settle)
    assert y == pytest.approx(expected, abs=1e-9)


def test_no_set_fits_where_there_is_no_solution():
    """w = -z - 1 is never positive for z >= 0."""
    of = Problem(np.array([[-1.0, 0.0], [0.0, 1.0]]), np.array([-1.0, 1.0]))
    assert of.every() is None
    with pytest.raises(NoActiveSetError) as told:
        Pivoting(of, lambda *_: False).fit(0.0, np.zeros(4), np.zeros(4), of.settle)
    assert "c0" in told.value.names


def test_a_set_that_contradicted_itself_is_not_settled_again():
    of, asked = Problem(np.eye(2), np.array([-1.0, -1.0])), []

    def settle(*point):
        asked.append(of.state())
        return None if of.active.any() else of.settle(*point)

    pivoting = Pivoting(of, lambda *_: True)
    for _ in range(2):
        of.active[:] = False
        with pytest.raises(NoActiveSetError):
            pivoting.fit(0.0, np.zeros(4), np.zeros(4), settle)
    held = [state for state in asked if any(state)]
    assert held
    assert len(held) == len(set(held))


@pytest.mark.parametrize(("operator", "sides"), [(">", (1,)), (">=", (0, 1)), ("<", (-1,)), ("<=", (-1, 0))])
@pytest.mark.one_in(2)
def test_a_relation_holds_by_its_side(operator, sides):
    still = [SimpleNamespace(moves=False)]
    for side in (-1, 0, 1):
        assert holds(("", 0, operator), np.array([float(side)]), still, ()) == (side in sides)


def test_what_moves_is_equal_at_the_instant_of_a_crossing_alone():
    moving, zero = [SimpleNamespace(moves=True)], np.array([0.0])
    assert not holds(("", 0, "=="), zero, moving, ())
    assert holds(("", 0, "=="), zero, moving, (0,))
    assert holds(("", 0, "!="), zero, moving, ())
    assert holds(("", 0, "=="), zero, [SimpleNamespace(moves=False)], ())


def test_conditions_are_joined():
    above, below = ("", 0, ">"), ("", 1, "<")
    sides, both = np.array([1.0, 1.0]), [SimpleNamespace(moves=True)] * 2
    assert not holds(("and", above, below), sides, both, ())
    assert holds(("or", above, below), sides, both, ())
    assert holds(("and", above, ("not", below)), sides, both, ())


def test_a_gap_that_is_thrown_open_rises_and_closes_again():
    """h = v^2/(2 g), T = 2 v/g; where nothing pulls it back it does not close."""
    bounce = is_thrown(2.0, 1e-12, 3.0, 9.81)
    assert (bounce.height, bounce.flight) == (pytest.approx(9.0 / 19.62), pytest.approx(6.0 / 9.81))
    assert (bounce.level, bounce.begins) == (0.0, 2.0)
    assert is_thrown(2.0, -1e-12, 3.0, 0.0).flight == np.inf
    assert is_thrown(2.0, -1e-12, 3.0, 0.0).level == -1e-12
