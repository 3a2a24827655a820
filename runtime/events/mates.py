"""Inequalities that say the same as another one: diodes in series, or in parallel, of which one does for all.

In series the flows are one (the rows f_k >= 0 depend on each other where all block), in parallel the efforts (the rows
mu_k = 0 do where all conduct).  One of a series blocks for all, and the others conduct for good; one of a parallel
conducts for all, and the others block for good.  (Not so where a source is between them: no row may say more than a sum
of unknowns.)  What is left is looked at again, so that strings in parallel and parallels in series become one: a bridge
of 64 diodes is one of four.

What else holds at times may do so or not: what is alike, is so in each of its states.

Received: the contacts of a model; returned: those whose state never changes, and which it is.  That two rows depend on
each other, and that their multipliers may be shared out at will, is read from the null spaces of the pencil.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray
from sysdyn.runtime import tuning
from sysdyn.runtime.events.plan import Plan
from sysdyn.runtime.model.description import Floats
from sysdyn.runtime.model.held_rows import switch_rows
from sysdyn.runtime.model.system import System
from sysdyn.runtime.numerics.equilibrate import factors
from sysdyn.runtime.numerics.rank import CERTAIN, count, singular_decomposition

LARGE = 800
"""Unknowns up to which full matrices are decomposed."""
GENERIC = tuning.GENERIC
"""Of dF/dyd beside dF/dy: at it a regular pencil is a regular matrix."""
SAME = tuning.HALF_OF_ITS_DIGITS
"""Of a unit vector: what lies outside a space that it belongs to."""
ROUNDS = 20

Mask = NDArray[np.bool_]


def mates(plan: Plan, system: System, multiplier: list[int]) -> dict[int, bool]:
    """Contact -> whether it holds for good; multiplier: places of the multipliers in y."""
    asked = [k for k, c in enumerate(plan.contacts) if c.kind == "psi" and c.guard < 0]
    # one alone has no mate; of large models it costs too much
    if len(asked) < 2 or system.unknowns > LARGE:
        return {}
    before = system.description.switches.active.copy()
    try:
        return _Search(plan, system, multiplier, asked).found()
    finally:
        system.description.switches.set(before)


class _Search:
    """Alternates between series and parallels."""

    def __init__(self, plan: Plan, system: System, multiplier: list[int], asked: list[int]) -> None:
        self.contacts, self.system = plan.contacts, system.another("3")
        self.other = np.zeros(self.system.rows, dtype=bool)
        # rows that are no plain sums: what one point says of them may not hold at others
        for _, family, first in self.system.form.groups:
            self.other[first : first + system.description.rows[family].size] = family not in plan.plain
        rows, _, number, _ = switch_rows(system.description, self.system.form)
        row = dict(zip(number.tolist(), rows.tolist(), strict=True))
        # those that have a row in this form
        self.asked = [k for k in asked if plan.contacts[k].number in row]
        self.rows = np.array([row[plan.contacts[k].number] for k in self.asked], dtype=np.int64)
        self.places = np.array([multiplier[k] for k in self.asked], dtype=np.int64)
        self.frozen: dict[int, bool] = {}

    def found(self) -> dict[int, bool]:
        """Of all rounds."""
        # those in series, then those in parallel, until nothing more is found
        for _ in range(ROUNDS):
            some = self._freeze(blocks=True)
            some = self._freeze(blocks=False) or some
            if not some:
                break
        return self.frozen

    def _freeze(self, *, blocks: bool) -> bool:
        """What is alike where the others all block, or conduct, is frozen in the other state; whether there was any."""
        free = np.array([k not in self.frozen for k in self.asked])
        alike = np.ones((int(free.sum()),) * 2, dtype=bool)
        # in all states of what else holds, at two points of random numbers
        for active in self._states():
            for k in self.asked:
                active[self.contacts[k].number] = self.frozen.get(k, blocks)
            self.system.description.switches.set(active)
            for seed in (0, 1):
                alike &= self._alike(seed, free, blocks=blocks)
            if not np.triu(alike, 1).any():
                return False
        number = np.flatnonzero(free)
        done = np.zeros(number.size, dtype=bool)
        # of each pair the second is superfluous
        for i in range(number.size):
            for j in np.flatnonzero(alike[i] & ~done):
                if j > i and not done[i]:
                    done[j] = True
                    self.frozen[self.asked[number[j]]] = not blocks
        return bool(done.any())

    def _states(self) -> Iterator[Mask]:
        """Active sets in which the same must be alike: of what else holds at times (a switch beside a diode, a wire in
        one of its states) nothing, all, and each by itself.
        """
        asked = [self.contacts[k].number for k in self.asked]
        none = np.zeros(len(self.system.description.switches.places), dtype=bool)
        other = ~none
        other[asked] = False
        yield none.copy()
        if other.any():
            yield other.copy()
            for k in np.flatnonzero(other):
                none[k] = True
                yield none.copy()
                none[k] = False

    def _alike(self, seed: int, free: Mask, *, blocks: bool) -> NDArray[np.bool_]:
        """Which pairs of the free ones say the same, and share at will, at a point of random numbers [free, free]."""
        system, n = self.system, self.system.form.written
        y, yd = np.random.default_rng(seed).uniform(0.5, 1.5, (2, n))
        with np.errstate(all="ignore"):
            jy, jyd = system.jacobian(0.0, y, yd)
        none = np.zeros((int(free.sum()),) * 2, dtype=bool)
        # a point that is none
        if not (np.isfinite(jy).all() and np.isfinite(jyd).all()):
            return none
        # matrices of a step in general position
        full = system.dense(jy) + GENERIC * system.dense(jyd)
        values = full if blocks else self._values(y, yd)
        row, column = factors(full)
        left, sigma, right = singular_decomposition(row[:, None] * full * column)
        # regular: nothing depends on anything
        some = count(sigma, CERTAIN)
        if some == sigma.size:
            return none
        # how rows of contacts depend on each other, but for other constraints
        depend = _null_span(left[:, some:] * row[:, None], self.other)[self.rows[free]]
        shared = right[some:].T * column[:, None]
        # what can be shared at will
        shared = shared[self.places[free]] if blocks else values[self.rows[free]] @ shared
        return _pairs(depend) & _pairs(shared)

    def _values(self, y: Floats, yd: Floats) -> Floats:
        """Slopes of the values where all block [rows, unknowns]."""
        switches = self.system.description.switches
        before = switches.active.copy()
        switches.set(np.ones_like(before))
        slopes = self.system.dense(self.system.jacobian(0.0, y, yd)[0])
        switches.set(before)
        return slopes


def _null_span(vectors: Floats, rows: Mask) -> Floats:
    """What of the span of columns [n, number] is zero in these rows."""
    # no rows: the whole span
    if not rows.any():
        return vectors
    _, sigma, right = singular_decomposition(vectors[rows])
    size = np.zeros(vectors.shape[1])
    size[: sigma.size] = sigma
    return np.asarray(vectors @ right[size <= SAME * max(float(np.abs(vectors).max()), 1e-300)].T)


def _pairs(vectors: Floats) -> NDArray[np.bool_]:
    """Which e_k - e_l lie in the span of columns [items, number]."""
    if not vectors.shape[1]:
        return np.zeros((vectors.shape[0],) * 2, dtype=bool)
    basis, size, _ = singular_decomposition(vectors)
    basis = basis[:, : count(size, SAME)]
    p = basis @ basis.T
    # distance of e_k - e_l to the span
    diagonal = np.diag(p)
    return np.asarray(np.abs(diagonal[:, None] + diagonal[None, :] - 2.0 * p - 2.0) < SAME)
