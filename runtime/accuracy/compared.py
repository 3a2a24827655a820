"""What the runs of one simulation are compared by: their rows at common instants.

Received: rows as a run writes them, and what it hands over at its end.  Handed on: `RunSample`, one beside the other in
`pairs.py`; where the last two differed most.
"""

from __future__ import annotations

from functools import partial

import numpy as np
from sysdyn.runtime.accuracy import fronts, pairs
from sysdyn.runtime.accuracy.common_instants import MANY, MOST, VALUES, Instants, Thinned, common, late_by
from sysdyn.runtime.accuracy.nominals import nominals_of_quantities, nominals_of_unknowns
from sysdyn.runtime.accuracy.options import Options
from sysdyn.runtime.accuracy.pairs import RunSample
from sysdyn.runtime.accuracy.quantities import Quantities
from sysdyn.runtime.integrate.request import COMPARED, RELAXING, TRACE, Finished
from sysdyn.runtime.integrate.weights.round_off import LeftOpen, left_open
from sysdyn.runtime.model import core_library as lib
from sysdyn.runtime.model.description import Floats, Ints
from sysdyn.runtime.model.system import System

SHORT = 1000
"""Steps of a run whose rows are all kept for the next, VALUES at most: of longer ones those in common see what happens.
"""
BEYOND = 100.0
"""Times its magnitude at steps: an unknown that is more within a step shows that the step passed over something."""


class RunComparison:
    """samplings: of the last two runs; finished: the last; jumps (s): its events; observed: values in a row."""

    def __init__(self, options: Options, instants: Instants, observed: int) -> None:
        self.options, self.instants, self._observed = options, instants, observed
        self.samplings: tuple[RunSample, ...] = ()
        self.jumps: Floats | None = None
        self.finished: Finished | None = None
        self._at: Floats | None = None
        self._opened: tuple[Finished, LeftOpen] | None = None
        self._sized: tuple[Finished, Floats] | None = None
        self._range: Floats = np.zeros(0)  # of quantities whose errors are relative to it
        self._moves = np.zeros(0, dtype=bool)  # which of these have a range beyond round-off of what they ride on
        self._own: list[Floats] = []
        self.begin()

    def begin(self) -> None:
        """A run begins."""
        # rows at common instants, of own steps, and at instants of the trace
        self._rows: list[Floats] = []
        self._steps: list[Floats] = []
        self._traced: list[Floats] = []
        self._ends = np.full((2, self._observed), np.nan)  # least and largest values, where ranges are asked for
        self._jump, self._last = np.zeros(self._observed), np.zeros((0, lib.ROW_HEAD + 2 * self._observed))
        self._thinned = Thinned()
        # few observed quantities allow more rows
        room = VALUES // max(self._observed, 1)
        self._with_events, self._short = Thinned(min(max(room, MOST), MANY)), min(room, SHORT)

    def take(self, rows: Floats, kind: Ints) -> None:
        """Keeps what runs are compared by: rows at the instants of the run before, and its own, thinned."""
        self._take_jumps(rows)
        # ranges of quantities whose errors are relative to these
        if self.options.to_range:
            values = rows[:, lib.ROW_HEAD : lib.ROW_HEAD + self._observed]
            self._ends[0] = np.fmin(self._ends[0], np.fmin.reduce(values, initial=np.inf))
            self._ends[1] = np.fmax(self._ends[1], np.fmax.reduce(values, initial=-np.inf))
        # rows of the trace are the steps themselves: thinned, and all of a short run
        if self.options.every is None:
            traced = rows[(kind & TRACE) > 0]
            for thinned in (self._thinned, self._with_events):
                thinned.take(traced)
            if self._thinned.seen <= self._short:
                self._steps.append(traced.copy())
        elif (known := self.instants.known) is not None and self.instants.common is not known:
            traced = rows[(kind & TRACE) > 0]  # beside rows at instants of a draft, which this run's steps may pass by
            at = np.minimum(np.searchsorted(known, traced[:, 0]), known.size - 1)
            self._traced.append(traced[known[at] == traced[:, 0]])
        # rows at the common instants
        if (kind & COMPARED).any():
            self._rows.append(rows[(kind & COMPARED) > 0])

    def _take_jumps(self, rows: Floats) -> None:
        """Rows before and behind an event stand at one instant."""
        # the last row of the batch before may share its instant with the first of this
        rows = np.concatenate([self._last, rows])
        self._last = rows[-1:].copy()
        same = np.flatnonzero(np.diff(rows[:, 0]) == 0.0)
        if same.size:
            values = rows[:, lib.ROW_HEAD : lib.ROW_HEAD + self._observed]
            with np.errstate(invalid="ignore"):  # of values without bound
                jump = np.abs(values[same + 1] - values[same])
            self._jump = np.fmax(self._jump, jump.max(axis=0))

    def sample_run(self, tolerance: float, finished: Finished, quantities: Quantities) -> RunSample:
        """Of the run that has ended; the next is compared at its instants."""
        width = lib.ROW_HEAD + 2 * self._observed
        rows = np.concatenate(self._rows) if self._rows else np.zeros((0, width))
        # the draft's rows are what later runs are compared at
        if self.instants.open:
            self.instants.close(rows[:, 0])
        instants, there = self.instants.common, None
        # rows of its own steps, by which the next run is compared with this one
        own = self._of_its_own(finished)
        if own is not None:
            there = _values(own, finished, quantities), self._late(own, quantities, steps=True)
        self._at = instants if instants is not None else self.instants.common
        values = there[0] if there is not None and instants is None else _values(rows, finished, quantities)
        # what round-off leaves of each quantity, by the largest of its unit
        noise = pairs.ROUND_OFF * quantities.largest_of_unit(finished.largest, finished.magnitude)
        noise = np.append(noise, np.zeros(len(quantities.meters)))
        late = self._late(rows, quantities) if instants is not None else 0.0
        asked, own = quantities.accuracy_asked(self.options), quantities.terms_of_run(finished)
        sizes, steps = quantities.of_run(finished), finished.statistics.steps
        # more round-off than is asked: the nominal value bounds what is excused
        if ((own > 0.0) & (noise > _share(asked, own))).any():  # else noise excuses less than is asked
            nominal, excused = self._nominals_and_excuse(finished, quantities)
            sizes, noise = np.minimum(sizes, nominal), np.minimum(noise, excused)
        if quantities.to_range.size:
            sizes, noise = self._by_range(sizes, noise, quantities)
        open_ = partial(self._open_quantities, finished, quantities)
        between = self._between(rows, finished, quantities)
        # a meter accumulates: it has no jump of its own to be excused
        jump = np.append(self._jump[quantities.places], np.full(len(quantities.meters), np.inf))
        # what relaxes within a first step, where a row says so
        passed = np.where(rows[:, 1:2].astype(np.int32) & RELAXING, rows[:, 2:4], 0.0)
        found = RunSample(
            tolerance, values, sizes, steps, noise, open_, between, late, there, jump, len(finished.events), passed,
            self._passed_over(finished, quantities),
        )  # fmt: skip
        # only the last two runs are compared
        self.samplings, self.finished = (*self.samplings[-1:], found), finished
        return found

    def _by_range(self, sizes: Floats, noise: Floats, quantities: Quantities) -> tuple[Floats, Floats]:
        """Sizes and noise [compared] where those of some are their ranges over all rows of a run, but no less than
        round-off of what they ride on; what is excused of these is a share of that.
        """
        which, sizes, noise = quantities.to_range, sizes.copy(), noise.copy()
        # a quantity without finite range is measured by its size
        with np.errstate(invalid="ignore"):  # of values without bound
            span = (self._ends[1] - self._ends[0])[quantities.places[which]]
        span = np.where(np.isfinite(span), span, sizes[which])
        # round-off of x rides on x = 1e8 m: smaller ranges are none
        self._moves = span > pairs.ROUND_OFF * sizes[which]
        self._range = sizes[which] = np.maximum(span, pairs.ROUND_OFF * sizes[which])
        noise[which] = np.minimum(noise[which], quantities.accuracy_asked(self.options)[which] * self._range)
        return sizes, noise

    def ranges(self, values: Floats) -> Floats:
        """What errors of the quantities that are judged by their range are relative to: that, or where it is round-off
        the largest of their values [those quantities].
        """
        return np.where(self._moves, self._range, values)

    def _passed_over(self, finished: Finished, quantities: Quantities) -> Floats | None:
        """How far the compared quantities [compared] are from the run before in what one step of that passes over; None
        where events happen: runs with these are compared at more rows.
        """
        last, self._own = self._own, self._steps
        # with events or long runs the rows of comparison serve
        if finished.events or not last or not self._own or self._thinned.seen > self._short:
            return None
        places = lib.ROW_HEAD + quantities.places
        found = fronts.passed_over(np.concatenate(last), np.concatenate(self._own), places, places + self._observed)
        return np.append(found, np.zeros(len(quantities.meters)))

    def _of_its_own(self, finished: Finished) -> Floats | None:
        """Rows of the run at which the next one is compared with it; None: those of the run before serve.  So do those
        of a draft, which has no others, of runs with events, near which two runs differ by their instants, and of a
        trace of few rows.
        """
        # rows are steps: instants are those of this run, thinned
        if self.options.every is None:
            thinned = self._with_events if finished.events else self._thinned
            self.instants.common = common(thinned.time, self.options)
            return thinned.rows(self.instants.common)
        # a grid: rows of the trace beside those of the draft
        if finished.events or not any(map(len, self._traced)):
            return None
        own = np.concatenate(self._traced)
        own = own[np.diff(own[:, 0], prepend=-np.inf) > 0.0]  # before a jump, as rows of comparison are
        if self.instants.known is None or len(own) < self.instants.known.size:  # a trace of few rows: others are known
            return None
        # the next run has rows at these instants too
        self.instants.take(own[:, 0])
        return own

    def _between(self, rows: Floats, finished: Finished, quantities: Quantities) -> Floats | None:
        """What the compared quantities move by [k, quantities], as fast as at these rows, from an event of this run to
        the same one of the run before it; infinite at instants that are not between them.  None: no instant is.
        """
        # instants of the events of this run and the one before
        jumps = np.unique([e.time for e in finished.events]) if finished.events else np.zeros(0)
        last, self.jumps = self.jumps, jumps
        assert self._at is not None
        # no run before, or one whose rows are elsewhere
        if last is None or len(rows) != len(self._at):
            return None
        late = late_by(self._at, last, jumps, self.options.t_end - self.options.t_start)[:, None]
        # events at the same instants: nothing lies between
        if not late.any():
            return None
        moved = _with_meters(late * np.abs(self._rates(rows, quantities)), quantities)
        return np.where((late > 0.0) & np.isfinite(moved), moved, np.inf)

    def _rates(self, rows: Floats, quantities: Quantities) -> Floats:
        """Of the stored quantities at rows [k, columns]."""
        return rows[:, lib.ROW_HEAD + quantities.places + self._observed]

    def _late(self, rows: Floats, quantities: Quantities, *, steps: bool = False) -> Floats:
        """What the compared quantities move by within the time tolerance at these rows [k, quantities]; steps: rows of
        the run's own steps, whose rates are those of the equations.
        """
        options, rates = self.options, self._rates(rows, quantities)
        # the finest accuracy asked of any quantity sets the time tolerance
        asked = min((a for a in (options.accuracy, *(w for _, w in options.accuracy_on)) if a is not None), default=0.0)
        tau = min(pairs.TIMING, pairs.SHARE * asked) * (options.t_end - options.t_start)
        values = rows[:, lib.ROW_HEAD + quantities.places]
        late = pairs.lateness(rows[:, 0], values, rates, tau) if steps else tau * np.abs(rates)
        return _with_meters(late, quantities)

    def left_open(self, finished: Finished, system: System) -> LeftOpen:
        """Asked of the equations once a run: of its quantities, and of each of its ledgers."""
        if self._opened is None or self._opened[0] is not finished:
            assert finished.last is not None
            # the mean step of the run says at which rate differences count
            step = (finished.reached - self.options.t_start) / max(finished.statistics.steps, 1)
            point, met = finished.last
            self._opened = finished, left_open(system, finished.reached, (*point(), met), step)
        return self._opened[1]

    def _open_quantities(self, finished: Finished, quantities: Quantities) -> Floats:
        """What round-off excuses of each compared quantity: what the equations of a run leave open of it, but no more
        than the accuracy asked times its nominal value.
        """
        found = self.left_open(finished, quantities.system).quantities[quantities.places]
        found = np.append(found, np.zeros(len(quantities.meters)))
        return np.minimum(found, self._nominals_and_excuse(finished, quantities)[1])

    def _nominals_and_excuse(self, finished: Finished, quantities: Quantities) -> tuple[Floats, Floats]:
        """Nominal value of each compared quantity, and how much of it may be excused."""
        if self._sized is None or self._sized[0] is not finished:
            self._sized = finished, self._nominal(finished, quantities)
        nominal = self._sized[1]
        # what is relative to its range has that as nominal value
        if quantities.to_range.size:
            nominal = nominal.copy()
            nominal[quantities.to_range] = self._range
        return nominal, _share(quantities.accuracy_asked(self.options), nominal)

    def _nominal(self, finished: Finished, quantities: Quantities) -> Floats:
        """Nominal value of each compared quantity: its largest value or term, or what the rows that determine the
        unknowns make of it (`nominals.py`); no bound where a large system is not asked for it.
        """
        own = quantities.terms_of_run(finished)
        # a run that kept no last point: no bound
        if finished.last is None or finished.peaks is None:
            return np.full(own.size, np.inf)
        point = finished.reached, *finished.last[0]()
        step = (finished.reached - self.options.t_start) / max(finished.statistics.steps, 1)
        unknowns = nominals_of_unknowns(quantities.system, point, finished.peaks, step)
        by_rows = nominals_of_quantities(quantities.system, point, unknowns, step)[quantities.places]
        # the rows may say more than the run has shown
        own[: by_rows.size] = np.maximum(own[: by_rows.size], by_rows)
        return own

    def worst(self, names: tuple[str, ...], target: Floats) -> tuple[str, float, float | None, bool]:
        """Of the last two runs: the quantity whose difference is largest beside what is asked of it (target
        [compared]), that, the first instant [s] at which it differs by more, and whether it is no number there.
        """
        asked = {name: float(wanted) for name, wanted in zip(names, target, strict=True)}
        # where no two runs can be compared: the quantity of which most is asked
        name = min(asked, key=lambda n: asked[n], default="")
        if len(self.samplings) < 2 or self.samplings[0].own[0].shape != self.samplings[1].values.shape:
            return name, asked.get(name, 0.0), None, False
        one, two = self.samplings
        assert self._at is not None
        # the finer run's sizes count
        size = (one if one.tolerance < two.tolerance else two).largest
        with np.errstate(all="ignore"):
            ratio = pairs.distance_of_runs(one, two) / (size * target)
        # no number where an accuracy is asked is beyond any bound
        ratio = np.where(np.isfinite(ratio), ratio, np.where(np.isfinite(target), np.inf, 0.0))
        # equal values, and zeros by symmetry, are no errors
        same = (one.own[0] == two.values) & np.isfinite(two.values)
        ratio = np.where(same | pairs.zero(one, two, target), 0.0, ratio)
        k = int(np.argmax(ratio.max(axis=0)))
        # the first instant beyond what was asked
        beyond = np.flatnonzero(ratio[:, k] > 1.0)
        name, at = names[k], int(beyond[0]) if beyond.size else None
        undefined = at is not None and not np.isfinite([one.own[0][at, k], two.values[at, k]]).all()  # or at the edge
        return name, asked[name], None if at is None else float(self._at[at]), undefined


def _share(asked: Floats, sizes: Floats) -> Floats:
    """The accuracy asked times sizes; infinite where nothing is asked."""
    known = np.isfinite(asked)
    return np.where(known, np.where(known, asked, 0.0) * sizes, np.inf)


def _values(rows: Floats, finished: Finished, quantities: Quantities) -> Floats:
    """The compared quantities [k, quantities] at rows."""
    # an unknown went far beyond its magnitude: no value of the run counts
    if finished.beyond > BEYOND:
        rows = np.full_like(rows, np.nan)
    return rows[:, quantities.row]


def _with_meters(moved: Floats, quantities: Quantities) -> Floats:
    """What the compared quantities move by [k, quantities], of what the stored ones do: meters by nothing."""
    number = len(quantities.meters)
    return np.hstack([moved, np.zeros((len(moved), number))]) if number else moved
