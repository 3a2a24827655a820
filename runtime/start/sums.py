"""Sums of balances in which no rate of an inertia is left: rows of a start alone.

T* may hold flows in fewer combinations than there are flows (differences of floating nodes, levers): what the others do
follows from the balances, summed so that the rates go.  A sum stands in the place of one of its balances.
"""

from __future__ import annotations

import numpy as np
from sysdyn.runtime import tuning
from sysdyn.runtime.model.description import Floats, Places
from sysdyn.runtime.model.inertia import Inertia
from sysdyn.runtime.numerics.components import components
from sysdyn.runtime.numerics.least_change import Mask
from sysdyn.runtime.numerics.products import add_product, add_sizes
from sysdyn.runtime.numerics.rank import left_null_vectors, null_space
from sysdyn.values import dataclass

CANCELS = tuning.BY_SUMS
"""Of the terms of a sum: what is less is left of them by round-off, and no coefficient."""
Entries = tuple[Places, Places]


@dataclass(frozen=True, slots=True)
class Weights:
    """Of `number` sums of rows: sum, row and value of each [k]."""

    number: int
    sum: Places
    row: Places
    value: Floats


def weights(matrix: Floats) -> Weights:
    """Those of a full matrix [sums, rows]."""
    total, row = np.nonzero(matrix)
    return Weights(len(matrix), total, row, matrix[total, row])


class Sums:
    """weights: of the rows `summed` (places); rows, columns: the entries of the sums' derivatives.

    entries: rows and columns of what is summed, of as many unknowns.
    """

    def __init__(self, weights: Weights, summed: Places, entries: Entries, unknowns: int) -> None:
        self.weights, self.summed = weights, summed
        self.places = summed[: weights.number]
        self.rows = self.columns = np.zeros(0, dtype=np.int64)
        if not self.places.size:
            return
        place = np.full(int(max(entries[0].max(), summed.max())) + 1, -1)
        place[summed] = np.arange(summed.size)
        row = place[entries[0]]
        self._mine = np.flatnonzero(row >= 0)
        self._mine = self._mine[np.argsort(row[self._mine], kind="stable")]
        # entries of the rows that are summed
        begin = np.searchsorted(row[self._mine], np.arange(summed.size + 1))
        number = np.diff(begin)[weights.row]
        of = np.repeat(np.arange(weights.row.size), number)
        within = np.arange(of.size) - np.repeat(np.cumsum(number) - number, number)
        self._entry, self._weight = self._mine[begin[weights.row][of] + within], weights.value[of]
        # entries of one sum at one unknown are one
        key = weights.sum[of].astype(np.int64) * unknowns + entries[1][self._entry]
        keys, self._slot = np.unique(key, return_inverse=True)
        self.rows, self.columns = self.places[keys // unknowns], keys % unknowns

    def __len__(self) -> int:
        return len(self.places)

    def holding(self, rows: Mask) -> Places:
        """Places of the sums that hold some of these rows [rows]."""
        own = self.weights
        return self.places[np.unique(own.sum[rows[self.summed[own.row]]])]

    def slopes(self, values: Floats) -> Floats:
        """Values of what is summed with those of the sums behind them; of summed rows by themselves none are left."""
        terms = self._weight * values[self._entry]
        own, size = (np.bincount(self._slot, of, minlength=self.rows.size) for of in (terms, np.abs(terms)))
        # sums that cancel are zero
        own[np.abs(own) <= CANCELS * size] = 0.0
        alone = values.copy()
        alone[self._mine] = 0.0
        return np.append(alone, own)

    def put(self, values: Floats, *, sizes: bool = False) -> None:
        """The sums of values [rows] or [rows, k] in their places; sizes: of magnitudes, which do not cancel."""
        own, add = self.weights, add_sizes if sizes else add_product
        # by columns, in place
        for column in np.atleast_2d(values.T):
            column[self.places] = add(own.sum, own.row, own.value, column[self.summed], np.zeros(own.number))


def _scaled(matrix: Floats) -> Floats:
    """Matrices [.., rows, columns] with columns of largest entry one."""
    size = np.abs(matrix).max(axis=-2, keepdims=True)
    return np.asarray(matrix / np.where(size > 0.0, size, 1.0))


def of_few(matrix: Floats) -> Weights:
    """Sums [k, rows] of the rows of a full matrix of inertia that are nothing."""
    # no numbers: no sums
    if not np.isfinite(matrix).all():
        return weights(np.zeros((0, len(matrix))))
    return weights(null_space(_scaled(matrix).T).T)


def of_many(points: list[Inertia], own: Places, most: int) -> Weights:
    """Sums of rows that are nothing, of flows that inertia joins in groups, each at most `most` large; of larger ones
    the plain sum if it is one. points: inertia at several points; own [rows]: the flow whose balance a row is, or -1.
    """
    # groups of flows that stores join
    number = points[0].size
    joined = np.hstack([np.tile(np.arange(number), (2, 1)), *(point.joined_pairs() for point in points)])
    label = components(joined[0], joined[1], number)
    place = np.full(number, -1)
    place[own[own >= 0]] = np.flatnonzero(own >= 0)
    order = np.argsort(label, kind="stable")
    begin = np.append(np.flatnonzero(np.diff(label[order], prepend=-1)), number)
    size = np.diff(begin)
    # groups of one size at once
    found: list[tuple[Places, Floats]] = []
    for s in np.unique(size[(size > 1) & (size <= most)]):
        members = order[begin[:-1][size == s][:, None] + np.arange(s)]
        members = members[(place[members] >= 0).all(axis=1)]
        blocks = np.concatenate([point.blocks(members) for point in points], axis=2)
        members, blocks = (item[np.isfinite(blocks).all(axis=(1, 2))] for item in (members, blocks))
        group, vectors = left_null_vectors(_scaled(blocks))
        found += zip(place[members[group]], vectors, strict=True)
    # of a large group the plain sum, if it is one
    for c in np.flatnonzero(size > most):
        members = order[begin[c] : begin[c + 1]]
        if (place[members] >= 0).all() and all(point.cancels(members) for point in points):
            found.append((place[members], np.full(members.size, members.size**-0.5)))
    row = np.repeat(np.arange(len(found)), [len(p) for p, _ in found])
    columns, values = (np.concatenate([item[k] for item in found] or [np.zeros(0)]) for k in (0, 1))
    return Weights(len(found), row, columns.astype(np.int64), values)
