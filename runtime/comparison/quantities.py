"""Quantities compared block by block: memory holds the instants of both traces and a block of one quantity.

The instants of both traces divide the common span into cells in which both curves are cubics.  In each cell the largest
difference is compared with the limit in closed form; cells beyond it are judged by the tube in value and time
(tube.py).  Where a whole cell of one is a whole cell of the other, up to the tolerance in time, and only one has
rates, both are lines there: the rows say all that both know.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np
from sysdyn.runtime import tuning
from sysdyn.runtime.comparison.curve import (
    Curve,
    Flags,
    Floats,
    Ints,
    bernstein,
    cells_at,
    largest_magnitude,
    value_at,
    whole_cells,
)
from sysdyn.runtime.comparison.resolution import untold
from sysdyn.runtime.comparison.tube import band, outside
from sysdyn.runtime.comparison.verdict import About, Compared, Source, Tolerance, Worst
from sysdyn.values import dataclass

BLOCK = 1 << 16
"""Cells at a time: about 30 arrays of half a megabyte."""
FIRST = 64
"""Cells beyond the limit that are judged by the tube at first: most often they decide."""
SLIVER = tuning.SMALL
"""Part of a cell by which cells of both traces differ at most that are one cell."""


@dataclass(frozen=True, slots=True)
class Pair:
    """A quantity of both: its name in each; scale, offset: from the test's unit to the reference's."""

    ref: About
    test: About
    scale: float
    offset: float


@dataclass(slots=True)
class _State:
    """What is known of a pair so far."""

    pair: Pair
    nominal: float
    limit: float
    worst: Worst
    status: str = "equal"
    note: str = ""


def compare_quantities(
    ref: Source,
    test: Source,
    times: tuple[Floats, Floats],
    pairs: Sequence[Pair],
    tolerance: Tolerance,
    time_scale: float,
) -> list[Compared]:
    """All pairs, blocks outside, quantities inside.  time_scale: of the test's time."""
    states = [_state(ref, pair, tolerance, times[0].size) for pair in pairs]
    tau = tolerance.tau or 0.0
    # blocks outside: rows of one stretch are read once for each quantity
    for block in _blocks(*times):
        rows = tuple(_rows(time, block, tau) for time in times)
        # the cell of each trace at every part of the block
        inner = tuple(cells_at(t[a:b], block.left) for t, (a, b) in zip(times, rows, strict=True))
        cells = (inner[0], inner[1])
        for state in states:
            # without a nominal value there is no limit to compare with
            if state.status == "nominal":
                continue
            curves = _curves(ref, test, times, rows, state.pair, time_scale)
            # rows at the ends belong to no cell on one side
            if block.last or block.first:
                _ends(state, curves, block, tau)
            _nonfinite(state, curves, tau)
            _block(state, curves, cells, block, tau)
    found = [_result(state) for state in states]
    return [
        # of those that differ: whether the rows are dense enough to say so
        replace(c, note=_untold(ref, test, times, pair, c, time_scale)) if c.status == "differs" else c
        for c, pair in zip(found, pairs, strict=True)
    ]


def _untold(
    ref: Source, test: Source, times: tuple[Floats, Floats], pair: Pair, found: Compared, time_scale: float
) -> str:
    """Whether rows are too far apart for what differs between them."""
    at, excess = found.worst.time, (found.worst.ratio - 1.0) * found.limit
    # where the difference is no number nothing can be said
    if not (math.isfinite(at) and math.isfinite(excess)):
        return ""
    cells = [int(cells_at(time, np.array([at]))[0]) for time in times]
    # the cell with its neighbours
    rows = tuple((max(k - 1, 0), min(k + 3, time.size)) for k, time in zip(cells, times, strict=True))
    return untold(_curves(ref, test, times, rows, pair, time_scale), at, excess)


def _state(ref: Source, pair: Pair, tolerance: Tolerance, rows: int) -> _State:
    """The state of one pair before its first block: its nominal value and limit, or why there is none."""
    nominal = pair.ref.nominal
    # no nominal value stored: the largest finite value of the reference
    if nominal is None:
        nominal = 0.0
        for first in range(0, rows, BLOCK):
            values = ref.read(pair.ref.name, first, min(first + BLOCK, rows))[0]
            nominal = max(nominal, float(np.max(np.abs(values[np.isfinite(values)]), initial=0.0)))
    # a nominal value that is no size
    if not (math.isfinite(nominal) and nominal >= 0.0):
        note = f"its nominal magnitude in the reference is {nominal:g}"
        return _State(pair, nominal, math.nan, Worst(math.inf), "nominal", note)
    return _State(pair, nominal, tolerance.atol + tolerance.rtol * nominal, Worst())


def _result(state: _State) -> Compared:
    # what no limit was found for counts as no number
    status = "nonfinite" if state.status == "nominal" else state.status
    # beyond the limit somewhere
    if status == "equal" and state.worst.ratio > 1.0:
        status = "differs"
    return Compared(
        state.pair.ref.name, status, state.worst, state.pair.ref.unit, state.nominal, state.limit, state.note
    )


@dataclass(frozen=True, slots=True)
class _Block:
    """Cells of the common grid: left, right [m] s; first, last: it touches the ends; same: rows of both are equal."""

    left: Floats
    right: Floats
    first: bool
    last: bool
    same: bool


def _blocks(ref: Floats, test: Floats) -> Iterator[_Block]:
    """The common span in blocks; one empty block where it is a point or there is none."""
    low, high = max(ref[0], test[0]), min(ref[-1], test[-1])
    # equal instants: cells of both coincide
    same = ref.size == test.size and np.array_equal(ref, test)
    edges = ref if same else np.concatenate([ref, test])
    edges = np.unique(edges[(edges >= low) & (edges <= high)])
    # a point in common, or nothing
    if edges.size < 2:
        yield _Block(edges[:0], edges[:0], True, True, same)
        return
    # blocks share their edges
    for first in range(0, edges.size - 1, BLOCK):
        part = edges[first : first + BLOCK + 1]
        yield _Block(part[:-1], part[1:], first == 0, first + BLOCK >= edges.size - 1, same)


def _rows(time: Floats, block: _Block, tau: float) -> tuple[int, int]:
    """Rows that a block needs: those of its cells, those within tau, and all at its ends."""
    # an empty block needs all rows
    if not block.left.size:
        return 0, time.size
    # a row more on both sides: the cell in which the edge lies
    first = 0 if block.first else int(np.searchsorted(time, block.left[0] - tau, side="left")) - 1
    last = time.size if block.last else int(np.searchsorted(time, block.right[-1] + tau, side="right")) + 1
    return max(first, 0), min(last, time.size)


def _curves(
    ref: Source,
    test: Source,
    times: tuple[Floats, Floats],
    rows: tuple[tuple[int, int], ...],
    pair: Pair,
    time_scale: float,
) -> tuple[Curve, Curve]:
    """The rows of both, the test's in the units of the reference."""
    (a, b), (c, d) = rows
    values, rates = ref.read(pair.ref.name, a, b)
    one = Curve(times[0][a:b], values, rates)
    values, rates = test.read(pair.test.name, c, d)
    # the test's values in the reference's units; rates by the ratio of both units
    if (pair.scale, pair.offset, time_scale) != (1.0, 0.0, 1.0):
        values = values * pair.scale + pair.offset
        rates = None if rates is None else rates * (pair.scale / time_scale)
    return one, Curve(times[1][c:d], values, rates)


def _block(state: _State, curves: tuple[Curve, Curve], cells: tuple[Ints, Ints], block: _Block, tau: float) -> None:
    """Cells of one block: the largest difference, then the tube where it is beyond the limit."""
    if not block.left.size:
        return
    pieces = [
        whole_cells(curve, cell) if block.same else bernstein(curve, cell, block.left, block.right)
        for curve, cell in zip(curves, cells, strict=True)
    ]
    # where one has no rates both are compared as lines
    _as_lines(pieces, curves, cells, block, tau)
    with np.errstate(invalid="ignore", over="ignore"):
        difference = pieces[1] - pieces[0]
        size = np.abs(difference)
    # a polynomial lies within its Bernstein coefficients
    bound = size.max(axis=0)
    # somewhere no number
    if not math.isfinite(float(bound.max())):
        defined = [np.isfinite(curve.values) for curve in curves]
        whole = [d[cell] & d[cell + 1] for d, cell in zip(defined, cells, strict=True)]
        # one trace has numbers where the other has none
        one = np.flatnonzero(whole[0] != whole[1])
        if one.size:
            _undefined_quantity(state, float(block.left[one[0]]), "only one of the traces is a number there")
        # both are numbers and their difference is none
        bad = ~np.isfinite(bound)
        wild = np.flatnonzero(bad & whole[0] & whole[1])
        if wild.size:
            _undefined_quantity(state, float(block.left[wild[0]]), "the difference is beyond floating point")
        bound = np.where(bad, 0.0, bound)
        size = np.where(bad, 0.0, size)
    # at the ends; inside only where the bound allows a larger one
    deviation = np.maximum(size[0], size[3])
    best = max(float(deviation.max()), state.worst.ratio * state.limit if math.isfinite(state.worst.ratio) else 0.0)
    x = np.where(size[3] > size[0], 1.0, 0.0)
    inner = np.flatnonzero((bound > best) | ((bound > state.limit) & (deviation <= state.limit)))
    if inner.size:
        deviation[inner], x[inner] = largest_magnitude(difference[:, inner])
    # beyond the limit: within tau in time it may still be
    beyond = np.flatnonzero(deviation > state.limit)
    if beyond.size and tau > 0.0:
        moment = block.left + x * (block.right - block.left)
        _forgive(deviation, moment, beyond, state, curves, block, tau)
        k = int(np.argmax(deviation))
        _keep(state, float(deviation[k]), float(moment[k]), k, pieces, block)
        return
    k = int(np.argmax(deviation))
    _keep(state, float(deviation[k]), float(block.left[k] + x[k] * (block.right[k] - block.left[k])), k, pieces, block)


def _as_lines(
    pieces: list[Floats], curves: tuple[Curve, Curve], cells: tuple[Ints, Ints], block: _Block, tau: float
) -> None:
    """Cells of both traces at once (to tau: rows of events) of which only one has rates are compared as lines: the
    other says no more there.
    """
    lines = [_lines(curve, cell) for curve, cell in zip(curves, cells, strict=True)]
    mixed = lines[0] != lines[1]
    # partial cells count only where they are whole but for tau
    if mixed.any() and not block.same:
        apart = np.minimum(tau, SLIVER * (block.right - block.left))
        for curve, cell in zip(curves, cells, strict=True):
            mixed &= block.left - curve.time[cell] <= apart
            mixed &= curve.time[cell + 1] - block.right <= apart
    if not mixed.any():
        return
    for piece in pieces:
        first, last = piece[0, mixed], piece[3, mixed]
        with np.errstate(invalid="ignore", over="ignore"):
            piece[1, mixed], piece[2, mixed] = first + (last - first) / 3.0, last - (last - first) / 3.0


def _lines(curve: Curve, cell: Ints) -> Flags:
    """Cells without a rate at one of their ends."""
    # without rates all cells are lines
    if curve.rates is None:
        return np.ones(cell.size, dtype=np.bool_)
    known = np.isfinite(curve.rates)
    return ~(known[cell] & known[cell + 1])


def _forgive(
    deviation: Floats,
    moment: Floats,
    beyond: Ints,
    state: _State,
    curves: tuple[Curve, Curve],
    block: _Block,
    tau: float,
) -> None:
    """Replace differences beyond the limit by distances from the tube, the largest first, until no other can win."""
    order = beyond[np.argsort(-deviation[beyond], kind="stable")]
    best, size = 0.0, FIRST
    while order.size:
        # in batches that grow: the largest difference first
        now, order = np.sort(order[:size]), order[size:]
        found = outside(*curves, block.left[now], block.right[now], moment[now], state.limit, tau)
        deviation[now] = np.minimum(found.distance, deviation[now])
        moment[now] = np.where(found.distance > 0.0, found.time, moment[now])
        best = max(best, float(deviation[now].max()))
        # others can no longer win by more than a factor of two
        if order.size and best > state.limit and best >= 0.5 * deviation[order[0]]:
            # distances are at most the differences: the worst is known within a factor of two
            deviation[order] = np.minimum(deviation[order], best)
            return
        size *= 8


def _keep(state: _State, deviation: float, moment: float, k: int, pieces: Sequence[Floats], block: _Block) -> None:
    ratio = ratio_of(deviation, state.limit)
    # the worst so far, or the first of equals
    if ratio > state.worst.ratio or (math.isnan(state.worst.time) and ratio == state.worst.ratio):
        width = block.right[k] - block.left[k]
        x = np.array([(moment - block.left[k]) / width if width > 0.0 else 0.0])
        reference, test = (float(value_at(b[:, k : k + 1], x)[0]) for b in pieces)
        state.worst = Worst(ratio, moment, reference, test)


def ratio_of(deviation: float, limit: float) -> float:
    """How many times the limit; 0 of 0 is 0."""
    # equal values are within any limit, also within zero
    if deviation == 0.0:
        return 0.0
    return deviation / limit if limit > 0.0 else math.inf


def lonely(time: Floats) -> Flags:
    """Rows that are the end of no cell."""
    step = np.diff(time) > 0.0
    return ~(np.append(step, False) | np.insert(step, 0, False))


def _undefined_quantity(state: _State, time: float, note: str) -> None:
    if state.status != "nonfinite":
        state.status, state.note, state.worst = "nonfinite", note, Worst(math.inf, time)


def _nonfinite(state: _State, curves: tuple[Curve, Curve], tau: float) -> None:
    """Each row that is no number has one of the same kind at the same instant in the other trace."""
    kinds = [_kinds(curve.values) for curve in curves]
    if not (kinds[0].any() or kinds[1].any()):
        return
    # each trace against the other
    for one, two, which in ((0, 1, "reference"), (1, 0, "test")):
        rows = np.flatnonzero(kinds[one])
        if not rows.size:
            continue
        time = curves[two].time
        at = curves[one].time[rows]
        found = np.zeros(rows.size, dtype=bool)
        near = np.searchsorted(time, at)
        # the nearest rows on both sides, at the same instant to tau, of the same kind
        for step in (-1, 0, 1):
            k = np.clip(near + step, 0, time.size - 1)
            found |= (np.abs(time[k] - at) <= tau) & (kinds[two][k] == kinds[one][rows])
        inside = (at >= time[0] - tau) & (at <= time[-1] + tau)
        # inside the other's span alone
        bad = np.flatnonzero(~found & inside)
        if bad.size:
            value, other = curves[one].values[rows[bad[0]]], {"reference": "test", "test": "reference"}[which]
            _undefined_quantity(state, float(at[bad[0]]), f"the {which} is {value:g} there")
            there = float(np.interp(at[bad[0]], time, curves[two].values))
            state.worst = replace(state.worst, **{which: float(value), other: there})


def _kinds(values: Floats) -> Ints:
    """0 a number, 1 NaN, 2 +Inf, 3 -Inf [n]."""
    return np.where(np.isfinite(values), 0, np.where(np.isnan(values), 1, np.where(values > 0, 2, 3)))


def _ends(state: _State, curves: tuple[Curve, Curve], block: _Block, tau: float) -> None:
    """Rows that are the end of no cell: single points, more than two rows at one instant, jumps at the very ends."""
    for one, two in ((0, 1), (1, 0)):
        curve, other = curves[one], curves[two]
        # rows that no cell holds
        for k in np.flatnonzero(lonely(curve.time)):
            instant, value = float(curve.time[k]), float(curve.values[k])
            # what is no number is compared elsewhere
            if not math.isfinite(value):
                continue
            low, high = band(other, instant, tau)
            if low > high:
                continue  # the coverage says so
            distance = float(max(low - value, value - high, 0.0))
            # farther outside the other's band than anything so far
            ratio = ratio_of(distance, state.limit)
            if ratio > state.worst.ratio:
                nearest = float(low if value < low else high)
                pair = (value, nearest) if one == 0 else (nearest, value)
                state.worst = Worst(ratio, instant, *pair)
