"""The active set of one-way flows that a short implicit step asks for: one linear complementarity problem.

    F(t + h, y1, (y1 - y)/h) = 0,   0 <= value(y1)  _|_  multiplier >= 0

linearised, over all inequalities of flows at once.  What an impulse does, what is done by a finite effort, and what by
its rate differ by powers of h: each counts before the next, as the limit of a short step has it (time stepping of
Moreau and Jean; Acary and Brogliato 2008, chapter 10).  What is passive makes the matrix of the problem positive
semidefinite (Camlibel, Heemels, van der Schaft and Schumacher 2003): Lemke's method finds its solution or shows that
there is none, where turning one inequality after the other may run in a circle.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from sysdyn.runtime import tuning
from sysdyn.runtime.events.contacts import Contacts
from sysdyn.runtime.model.description import Floats
from sysdyn.runtime.model.held_rows import switch_rows
from sysdyn.runtime.model.system import System
from sysdyn.runtime.numerics.equilibrate import factors
from sysdyn.runtime.numerics.rank import singular_decomposition

DENSE = tuning.DENSE
"""Unknowns up to which matrices are full; of larger models nothing is told."""
REGULAR = 3e-15
"""The least singular value of a regular matrix, of rows and columns of size 1."""
PIVOT = tuning.DEPENDENT
"""Of the largest entry of a column: what is less is no pivot."""
PIVOTS = 10
"""Of Lemke's method, an inequality."""
SHARE = tuning.SAME
"""Of a unit vector: a row's part in what is open."""
ROUND_OFF = 1e-15
"""Of the terms of a value: what is less is nothing."""
ALIKE = tuning.CANCELS
"""Of a ratio: two that differ by less are one."""


class Implicit:
    """Of a model's contacts; system: in the form in which one row reads a constraint, or its multiplier."""

    def __init__(self, contacts: Contacts, system: System) -> None:
        self.contacts, self.system = contacts, system
        rows, unknowns, numbers, _ = switch_rows(system.description, system.form)
        self._places = {int(k): (int(row), int(at)) for row, at, k in zip(rows, unknowns, numbers, strict=True)}

    def _free(self) -> list[int]:
        """The inequalities of flows that may hold or not."""
        contacts = self.contacts
        told = [k for k, c in enumerate(contacts.contacts) if c.kind == "psi" and c.number in self._places]
        return [k for k in told if k not in contacts.frozen and not contacts.barred[k]]

    def after(self, t: float, y: Floats, h: float) -> tuple[NDArray[np.bool_], Floats] | None:
        """The active set behind a step of h (s) from y [unknowns as written], on the rows at t, and the point there;
        None where there is none.
        """
        contacts, free = self.contacts, self._free()
        # dense matrices only
        if self.system.unknowns > DENSE:
            return None
        own = [contacts.contacts[k] for k in free]
        # rows of the inequalities, and places of their multipliers
        row, at = np.array([self._places[c.number] for c in own], dtype=int).reshape(-1, 2).T
        value = [c.value for c in own]
        matrix, residual, now = self._linear(t, y, h, free)
        # beyond the domain of a law
        if not (np.isfinite(matrix).all() and np.isfinite(residual).all()):
            return None
        # signed as the values are, which grow along their slopes
        slope = self._sign(t, y, matrix[row], value)[:, None] * matrix[row]
        unit = np.zeros_like(slope)
        unit[np.arange(len(free)), at] = 1.0
        # unknowns by the right sides of inequalities, and by what all rows miss
        right = np.zeros((len(matrix), len(free) + 1))
        right[:, -1], right[row, np.arange(len(free))] = -residual, 1.0
        pairs = (slope, unit), (now[value], y[at])
        # which of each pair is zero to begin with
        found = base_of(matrix, right, row, pairs, contacts.active[free])
        if found is None:
            return None
        moves, held = found
        told, end = (np.where(held[:, None] if one.ndim > 1 else held, other, one) for one, other in pairs)
        # pairs in units of their sizes
        largest = contacts.observer.largest
        pair = largest[value], largest[[c.multiplier for c in own]]
        size, grows = (np.where(held, *sizes) for sizes in (pair[::-1], pair))
        answer = told @ moves
        # w = q + M z: complementary pairs
        begin, slopes = end + answer[:, -1], answer[:, :-1] * grows / size[:, None]
        turned = lemke(slopes, begin / size)
        if turned is None:  # of values that are round-off one may seem to be less than zero
            terms = np.abs(end) + np.abs(told) @ np.abs(moves[:, -1])
            turned = lemke(slopes, np.where(np.abs(begin) <= ROUND_OFF * terms, 0.0, begin) / size)
        if turned is None:
            return None
        active = contacts.active.copy()
        active[free] = held ^ (turned > 0.0)
        return active, y + moves[:, :-1] @ (grows * turned) + moves[:, -1]

    def _linear(self, t: float, y: Floats, h: float, free: list[int]) -> tuple[Floats, Floats, Floats]:
        """Slopes of the rows of a step, in which all inequalities hold, and their residual; values [observed]."""
        # all inequalities hold: their rows read their values
        contacts, zeros = self.contacts, np.zeros_like(y)
        stood = contacts.state()
        contacts.active[free] = True
        contacts.apply()
        jy, jyd = self.system.jacobian(t, y, zeros)
        residual = self.system.residual(t, y, zeros)
        values = contacts.system.observe(t, y, zeros)
        contacts.become(stood)
        return self.system.dense(jy + jyd / h), residual, values

    def _sign(self, t: float, y: Floats, slopes: Floats, value: list[int]) -> Floats:
        """Of what rows read, beside the values that are not less than zero: each along its own slope."""
        observe, zeros = self.contacts.system.observe, np.zeros_like(y)
        here = observe(t, y, zeros)
        rises = [observe(t, y + slope, zeros)[k] >= here[k] for slope, k in zip(slopes, value, strict=True)]
        return np.where(rises, 1.0, -1.0)


def base_of(
    matrix: Floats,
    right: Floats,
    row: NDArray[np.intp],
    pairs: tuple[tuple[Floats, Floats], ...],
    held: NDArray[np.bool_],
) -> tuple[Floats, NDArray[np.bool_]] | None:
    """What the unknowns move by as those of each pair that are at zero grow, and at last without; which values those
    are: `held` [inequalities] where that leaves nothing open, else as much turned as it takes (of what is passive some
    choice is regular: Sznajder and Gowda 1995).  None: whatever holds, something else is open.
    """
    (slope, unit), (value, multiplier) = pairs
    held, turned = held.copy(), np.zeros(held.size, dtype=bool)
    # turn what the singular rows point at until they are regular
    while True:
        matrix[row], right[row, -1] = np.where(held[:, None], slope, unit), -np.where(held, value, multiplier)
        found, open_ = _solve_graded(matrix, right)
        if found is not None:
            return found, held
        part = np.where(turned, 0.0, open_[row])
        # singular whatever the inequalities are
        if not part.max(initial=0.0) > SHARE:
            return None
        k = int(np.argmax(part))
        held[k], turned[k] = not held[k], True


def _solve_graded(matrix: Floats, right: Floats) -> tuple[Floats | None, Floats]:
    """The solution of a square system whose rows and columns are of very different size; None: it is singular, and how
    much each row [rows] has to do with that.
    """
    row, column = (factor[:, None] for factor in factors(matrix))
    even = row * matrix * column.T
    # singular: its left null vector says by which rows
    left, sigma, _ = singular_decomposition(even)
    if not sigma[-1:].min(initial=1.0) > REGULAR:
        return None, np.abs(left[:, -1])
    found: Floats = column * np.linalg.solve(even, row * right)
    return found, np.zeros(len(matrix))


def lemke(m: Floats, q: Floats) -> Floats | None:
    """The z >= 0 with q + m z >= 0 and z'(q + m z) = 0, for a positive semidefinite m; None: there is none.

    Lemke 1965; Cottle, Pang and Stone 1992, section 4.4.
    """
    n = q.size
    # zero is the solution
    if not (q < 0.0).any():
        return np.zeros(n)
    table = np.hstack([np.eye(n), -m, -np.ones((n, 1)), q[:, None]])  # of w, z, the covering z0, and what they come to
    # the covering variable enters for the most negative
    basis, leaves, enters = np.arange(n), int(np.argmin(q)), 2 * n
    for _ in range(PIVOTS * (n + 1)):
        # one step of elimination
        table[leaves] /= table[leaves, enters]
        others = np.arange(n) != leaves
        table[others] -= np.outer(table[others, enters], table[leaves])
        out, basis[leaves] = int(basis[leaves]), enters
        # the covering variable has left: done
        if out == 2 * n:
            found = np.zeros(2 * n + 1)
            found[basis] = np.maximum(table[:, -1], 0.0)
            return found[n : 2 * n]
        # the partner of what left enters (complementary pivoting)
        enters = (out + n) % (2 * n)
        column = table[:, enters]
        grows = column > PIVOT * np.abs(column).max()
        # a ray: no solution
        if not grows.any():
            return None
        # the least ratio; among equals the covering variable, then the largest pivot
        ratio = np.where(grows, np.maximum(table[:, -1], 0.0) / np.where(grows, column, 1.0), np.inf)
        least = np.flatnonzero(ratio <= ratio.min() * (1.0 + ALIKE))
        covering = least[basis[least] == 2 * n]
        leaves = int(covering[0] if covering.size else least[np.argmax(column[least])])
    return None
