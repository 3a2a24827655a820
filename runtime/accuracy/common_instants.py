"""The instants at which the runs of one simulation are compared: steps of the draft.

Accepted steps lie where the solution varies, so their thinned rows see a jump that a uniform grid steps over; finer
runs pass them between their own steps, and there their values are far better than the draft's.  Where the trace has an
interval its own rows are compared; where that stores few, instants of an irregular sequence.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray
from sysdyn.runtime import tuning
from sysdyn.runtime.accuracy.options import Options, instants
from sysdyn.runtime.integrate.request import COMPARED
from sysdyn.runtime.model.description import Floats, Ints
from sysdyn.runtime.numerics.points import distinct
from sysdyn.values import dataclass

MOST = 24
"""Instants at which runs are compared, at most twice that; of a long run this part of its steps, at most twice MANY."""
PART, MANY = 16, 500
"""Of a run with events at most twice MANY however short it is: behind one a motion relaxes within a step or two, whose
rows may lie between the instants compared (4 to 8 times off what was asked, told as met, in 3 of 120 runs)."""
GRID, VALUES = 10_000, 2_000_000
"""Rows of a trace with an interval that are compared at most, and values in them: behind an event a motion may relax
within a row (of every fourth alone, 13 times the accuracy asked went unseen).  A draft takes what is a part of its
step apart."""
FEW = 48
GOLDEN = 0.6180339887498949
"""Multiples of it modulo 1 fill an interval evenly and never regularly (Weyl's sequence)."""
NEAR = tuning.INSTANT
"""Of the span: nearer to an instant at which the text jumps nothing is compared, for sides may differ by round-off."""
KEPT = 10_000
"""Instants of rows up to which they are kept for the next run."""
APART = 0.1
"""Of the time between two events: where two runs differ by more in the instant of one, they are compared there too."""
AT_ONCE = 1e-7
"""Of the span: what a run has at once is one event, however often a condition turns."""


class Thinned:
    """Every k-th row of a stream, k doubled whenever there are too many, and the last one; of two rows at one instant,
    before and behind a jump, the former.  most: rows of a short run, at most twice that.
    """

    def __init__(self, most: int = MOST) -> None:
        self._most = most
        self._kept: list[Floats] = []
        self._stride, self.seen, self._number = 1, 0, 0
        self._last: Floats | None = None

    def take(self, rows: Floats) -> None:
        """Rows [k, width] in ascending time."""
        # of two rows at one instant the first counts: before a jump
        before = -np.inf if self._last is None else self._last[0, 0]
        rows = rows[np.diff(rows[:, 0], prepend=before) > 0.0]
        if not len(rows):
            return
        # every stride-th row counted over all batches
        first = -self.seen % self._stride
        self.seen += len(rows)
        if first < len(rows):
            self._kept.append(rows[first :: self._stride].copy())
            self._number += len(self._kept[-1])
        self._last = rows[-1:].copy()
        # too many: every second one goes, and only every second comes from here on
        while self._number > 2 * min(max(self._most, self.seen // PART), MANY):
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
        # rows of this run in ascending time
        found = self._all
        # the last row at or before each instant
        place = np.searchsorted(found[:, 0], instants, side="right") - 1
        return found[place] if np.array_equal(found[place, 0], instants) else found[:0]


def known_instants(times: Floats, options: Options, quantities: int) -> Floats | None:
    """Instants of comparison [s] where those of the trace are known before a run; None where they are its steps."""
    # a trace of steps: which instants there are a run alone tells
    if options.every is None:
        return None
    # a fine grid serves as it is, thinned
    if times.size >= FEW:
        most = min(GRID, max(VALUES // max(quantities, 1), FEW))
        return some(times, most)
    # a coarse grid: instants spread by the golden ratio, which no period resonates with
    span = options.t_end - options.t_start
    spread = options.t_start + span * (np.arange(1, MOST + 1) * GOLDEN % 1.0)
    return distinct(np.concatenate([spread, times[times > options.t_start], [options.t_end]]))


def some(times: Floats, most: int) -> Floats:
    """Every so many of ascending instants [s], `most` or one more, and the last."""
    return distinct(np.append(times[:: -(-times.size // most)], times[-1]))


def common(stored: Floats, options: Options) -> Floats:
    """Instants of comparison [s] for a run that stored rows at these."""
    found = distinct(stored)
    # stops (corners of sources) are no instants of comparison: two sides meet there
    stops = np.asarray([] if options.stops is None else options.stops, dtype=np.float64)
    stops = distinct(stops[np.isfinite(stops)])
    if stops.size:
        # the nearest stop on either side
        right = np.searchsorted(stops, found)
        near = np.minimum(
            np.abs(found - stops[np.minimum(right, stops.size - 1)]), np.abs(found - stops[np.maximum(right - 1, 0)])
        )
        found = found[near > NEAR * (options.t_end - options.t_start)]
    return found


def late_by(instants: Floats, one: Floats, two: Floats, span: float) -> Floats:
    """How far apart (s) two runs have the event (one, two [s] ascending) between which each instant lies [k], 0
    where there is none: each of both is the nearest to the other.  A value on one side of a jump is no error of one on
    the other.  What the jumps do is compared behind them.  Where both have it at the same instant, as sampled actions
    are, both values there are those before it.
    """
    # events that lie closer than round-off are one
    one, two = _group_bounds(one, span), _group_bounds(two, span)
    if not (one.size and two.size):
        return np.zeros(instants.size)
    # pairs of events that are each other's nearest
    own = _nearest(one[:, 0], two[:, 0])
    same = _nearest(two[:, 0], one[:, 0])[own] == np.arange(len(two))
    low, high = np.minimum(one[own, 0], two[:, 0]), np.maximum(one[own, 1], two[:, 1])
    # a pair counts where it is much closer than its neighbours are
    gap = np.diff(two[:, 0], prepend=-np.inf, append=np.inf)
    near = same & (low < high) & (high - low <= APART * np.minimum(gap[:-1], gap[1:]))
    low, high = low[near], high[near]
    # the pair that begins last before each instant
    place = np.searchsorted(low - NEAR * span, instants, side="right")
    within = instants <= np.append(-np.inf, high + NEAR * span)[place]
    return np.where(within, np.append(0.0, high - low)[place], 0.0)


def _group_bounds(events: Floats, span: float) -> Floats:
    """First and last [groups, 2] of what a run has at one event: a condition that stands at its edge may turn again at
    once in one run, and not in another.
    """
    new = np.diff(events, prepend=-np.inf) > AT_ONCE * span
    last = np.append(new[1:], True)[: events.size]
    return np.stack([events[new], events[last]], axis=1)


def _nearest(times: Floats, wanted: Floats) -> NDArray[np.intp]:
    """Which of ascending times is nearest to each that is wanted."""
    right = np.clip(np.searchsorted(times, wanted), 1, max(times.size - 1, 1))
    right = np.minimum(right, times.size - 1)
    left = np.maximum(right - 1, 0)
    return np.where(np.abs(times[left] - wanted) <= np.abs(times[right] - wanted), left, right)


def join_instants(instants: Floats, kinds: Ints, compared: Floats) -> tuple[Floats, Ints]:
    """Instants with their kinds, those of comparison among them."""
    # both sets of instants in one order; kinds are bits, so that one may be both
    every = distinct(np.concatenate([instants, compared]))
    found = np.zeros(every.size, dtype=np.int32)
    found[np.searchsorted(every, instants)] = kinds
    found[np.searchsorted(every, compared)] |= COMPARED
    return every, found


@dataclass(frozen=True, slots=True)
class _Joined:
    """Instants of comparison [s]; instants and kinds of rows with these among them; of a draft these alone."""

    compared: Floats
    every: tuple[Floats, Ints]
    draft: tuple[Floats, Ints]

    @classmethod
    def select_instants(cls, times: Floats, kinds: Ints, compared: Floats) -> _Joined:
        """Of instants and kinds of rows."""
        every = join_instants(times, kinds, compared)
        use = (every[1] & COMPARED) > 0
        return cls(compared, every, (every[0][use], every[1][use]))


class Instants:
    """Where the runs of a simulation write rows and are compared: times [s] and kinds of rows as asked; known [s]: of
    comparison, where the trace says (None: they are steps); common [s]: of the last run, at which the next one is
    compared with it (None: not known yet); open: while a draft takes its own from those of the trace.
    """

    def __init__(self, options: Options, kept: dict[str, Any], quantities: int) -> None:
        """kept: by the model; the run before had the same instants, or others; quantities: compared."""
        # what decides the instants: with the same the last run's are used again
        asked = options.t_start, options.t_end, options.every, options.at, options.sampled_at
        before = kept.get("instants")
        if before is None or before[0] != asked:
            times, kinds = instants(options)
            compared = known_instants(times, options, quantities)
            both = None if compared is None else _Joined.select_instants(times, kinds, compared)
            before = asked, (times, kinds, compared, both)
            # a long list is not kept between runs
            if times.size <= KEPT:
                kept["instants"] = before
        self.times: Floats
        self.kinds: Ints
        self.known: Floats | None
        self._joined: _Joined | None
        self.times, self.kinds, self.known, self._joined = before[1]
        self.common = self.known
        self.open = options.every is not None

    def close(self, common: Floats | None) -> None:
        """From now on runs are compared at these (s)."""
        self.common, self.open = common, False

    def take(self, own: Floats) -> None:
        """The next run is compared at these (s) of a run's own rows: steps are shorter than those of the draft."""
        self.common = self.known if self.known is not None and np.array_equal(own, self.known) else own

    def rows(self, *, compared: bool, draft: bool) -> tuple[Floats, Ints]:
        """Instants and kinds of a run's rows; compared: with those of comparison, of a draft these alone."""
        # without comparison, or before a draft has given instants
        if not compared or self.common is None:
            return self.times, self.kinds
        # joined anew where a run changed the instants
        if self._joined is None or self._joined.compared is not self.common:
            self._joined = _Joined.select_instants(self.times, self.kinds, self.common)
        return self._joined.draft if draft else self._joined.every
