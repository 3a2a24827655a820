"""The instants at which the runs of one simulation are compared: steps of the draft.

Accepted steps lie where the solution varies, so their thinned rows see a jump that a uniform grid steps over; finer
runs pass them between their own steps, and there their values are far better than the draft's.  Where the trace has an
interval its own rows are compared; where that stores few, instants of an irregular sequence.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from sysdyn.runtime.integrate.options import Options
from sysdyn.runtime.integrate.request import COMPARED
from sysdyn.runtime.model.description import Floats, Ints
from sysdyn.runtime.numerics.points import distinct

MOST = 24
"""Instants at which runs are compared, at most twice that; of a long run this part of its steps, at most twice MANY."""
PART, MANY = 16, 500
GRID = 600
"""Rows of a trace with an interval that are compared at most: between steps errors differ from row to row."""
FEW = 48
GOLDEN = 0.6180339887498949
"""Multiples of it modulo 1 fill an interval evenly and never regularly (Weyl's sequence)."""
NEAR = 1e-9
"""Of the span: nearer to an instant at which the text jumps nothing is compared, for sides may differ by round-off."""


APART = 0.1
"""Of the time between two events: where two runs differ by more in the instant of one, they are compared there too."""


class Thinned:
    """Every k-th row of a stream, k doubled whenever there are too many, and the last one."""

    def __init__(self) -> None:
        self._kept: list[Floats] = []
        self._stride, self._seen, self._number = 1, 0, 0
        self._last: Floats | None = None

    def take(self, rows: Floats) -> None:
        """Rows [k, width] in ascending time."""
        if not len(rows):
            return
        first = -self._seen % self._stride
        self._seen += len(rows)
        if first < len(rows):
            self._kept.append(rows[first :: self._stride].copy())
            self._number += len(self._kept[-1])
        self._last = rows[-1:].copy()
        while self._number > 2 * min(max(MOST, self._seen // PART), MANY):
            self._kept = [np.concatenate(self._kept)[::2]]
            self._stride, self._number = 2 * self._stride, len(self._kept[0])

    @property
    def _all(self) -> Floats:
        assert self._last is not None
        return np.concatenate([*self._kept, self._last])

    @property
    def time(self) -> Floats:
        """Instants of the rows [s], the last row's twice where it is one of the others."""
        return self._all[:, 0] if self._last is not None else np.zeros(0)

    def rows(self, instants: Floats) -> Floats:
        """The rows at these instants, zeros of no row where they are not among its own."""
        found = self._all
        place = np.searchsorted(found[:, 0], instants, side="right") - 1
        return found[place] if np.array_equal(found[place, 0], instants) else found[:0]


def known(instants: Floats, options: Options) -> Floats | None:
    """Instants of comparison [s] where those of the trace are known before a run; None where they are its steps."""
    if options.every is None:
        return None
    if instants.size >= FEW:
        return distinct(np.append(instants[:: -(-instants.size // GRID)], instants[-1]))
    span = options.t_end - options.t_start
    return distinct(np.append(options.t_start + span * (np.arange(1, MOST + 1) * GOLDEN % 1.0), options.t_end))


def common(stored: Floats, options: Options) -> Floats:
    """Instants of comparison [s] for a run that stored rows at these."""
    found = distinct(stored)
    stops = np.asarray([] if options.stops is None else options.stops, dtype=np.float64)
    stops = distinct(stops[np.isfinite(stops)])
    if stops.size:
        right = np.searchsorted(stops, found)
        near = np.minimum(
            np.abs(found - stops[np.minimum(right, stops.size - 1)]), np.abs(found - stops[np.maximum(right - 1, 0)])
        )
        found = found[near > NEAR * (options.t_end - options.t_start)]
    return found


def beside(instants: Floats, one: Floats, two: Floats, span: float) -> NDArray[np.bool_]:
    """Which instants lie between those at which two runs have the same event (one, two [s] ascending): a value on one
    side of a jump is no error of one on the other.  What the jumps do is compared behind them.
    """
    number = min(one.size, two.size)
    if not number:
        return np.zeros(instants.size, dtype=bool)
    low, high = np.minimum(one[:number], two[:number]), np.maximum(one[:number], two[:number])
    gap = np.diff(two, prepend=-np.inf, append=np.inf)
    near = high - low <= APART * np.minimum(gap[:-1], gap[1:])[:number]
    low, high = low[near] - NEAR * span, high[near] + NEAR * span
    place = np.searchsorted(low, instants, side="right")
    return np.asarray(instants <= np.append(-np.inf, high)[place])


def joined(instants: Floats, kinds: Ints, compared: Floats) -> tuple[Floats, Ints]:
    """Instants with their kinds, those of comparison among them."""
    every = distinct(np.concatenate([instants, compared]))
    found = np.zeros(every.size, dtype=np.int32)
    found[np.searchsorted(every, instants)] = kinds
    found[np.searchsorted(every, compared)] |= COMPARED
    return every, found
