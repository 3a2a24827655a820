"""Laws without a slope where they are asked (a turbulent valve at rest): where to begin beside them, what is at rest.

They say nothing there of what they pass, and where they hold so its rate is none: it grows as a root of time.  In the
complementary forms the same law is infinitely steep: what is zero there is so by other rows, and is left alone.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from sysdyn.runtime import tuning
from sysdyn.runtime.model.description import Floats, Ints
from sysdyn.runtime.model.slopes import FALLS, rows_without_slope
from sysdyn.runtime.numerics.gauss_newton import solve
from sysdyn.runtime.start.equations import HIDDEN
from sysdyn.runtime.start.least import problem_of
from sysdyn.runtime.start.starter import Mask, Starter

NEXT_TO_NOTHING, NEARLY, HOLDS, STEEPLY = tuning.OPEN, tuning.SLIGHT, tuning.BY_SUMS, tuning.BY_FACTORS
"""Of the largest alike: roots of round-off; what a search leaves, which comes nearer by halves alone.  Scaled residual
of rows that hold to round-off; that roots of it make.
"""
ROOT = tuning.SMALL
"""Of magnitudes: beside a root slopes are others even so near, those of an exponential are not."""
NO_SLOPE = tuning.MET
"""Of the slope beside: what is less is none (slopes are those next to a root where others are no numbers at it)."""
OWN = tuning.UNSEEN
"""Scaled residual of rows that are missed."""


def _beside(starter: Starter, t: float, x: Floats, follows: Mask) -> Floats:
    """X with what follows moved by its magnitude."""
    return x + np.where(follows, starter.scale(t, x), 0.0)


def flat_at(starter: Starter, t: float, x: Floats, follows: Mask) -> Mask:
    """Entries [entries] of rows that have no slope in what follows from the state at x, but beside it."""
    return _flat(starter, t, x, _beside(starter, t, x, follows), follows)


def rooted_at(starter: Starter, t: float, x: Floats, follows: Mask) -> Mask:
    """Those of them whose slopes are others so near x that they have a root there."""
    beside = x + np.where(follows, ROOT * _largest(starter, t, x), 0.0)
    return _flat(starter, t, x, beside, follows, NO_SLOPE / ROOT)


def _flat(starter: Starter, t: float, x: Floats, beside: Floats, follows: Mask, least: float = NO_SLOPE) -> Mask:
    """Entries of rows that have less than this part of the slopes beside."""
    here, there = np.abs(starter.jacobian(t, x)), np.abs(starter.jacobian(t, beside))
    flat = (here <= least * there) & (there > 0.0) & follows[starter.columns]
    return np.asarray(flat & ~starter.groups(*HIDDEN)[starter.rows])


def off_the_flat(starter: Starter, t: float, x: Floats, follows: Mask) -> Iterator[tuple[Floats, Mask]]:
    """X with what follows from the state beside its guess where rows have no slope in it there, and what is free: those
    that are missed where the other rows hold, the rest as guessed, then all.  A turbulent valve at rest under pressure
    would have the vessel behind it filled rather than pass anything; under none it is at rest, which Newton's steps
    only approach.
    """
    beside = _beside(starter, t, x, follows)
    flat = flat_at(starter, t, x, follows)
    if not flat.any():
        return
    # the other rows hold first; flat laws that are missed then are begun beside
    flat_here = starter.columns_of(flat)
    rows = without_rates(starter) & ~starter.rows_of(flat)
    at = solve(problem_of(starter, t, x, x, rows=rows, free=follows & ~flat_here), x).x
    at = starter.without_noise(at, starter.scale(t, x))
    with np.errstate(invalid="ignore"):  # infinite rows are missed
        missed = ~(np.abs(starter.residual(t, at)) * starter.row_scale(t, at, starter.scale(t, at)) <= OWN)
    some = starter.columns_of(flat & missed[starter.rows])
    yield np.where(some, beside, x) if some.any() else x, follows & (some | ~flat_here)
    # all flat laws beside, where only some were
    if some.any() and (some != flat_here).any():
        yield np.where(flat_here, beside, x), follows


def beside_the_flat(starter: Starter, t: float, x: Floats, guess: Floats, rows: Mask, free: Mask) -> Floats | None:
    """The point nearest to the guess on these rows but those without a slope at x in what follows from the state; what
    follows is beside it where these are missed; None where none is flat, or the others do not hold.
    """
    # flat laws at rest in what follows
    follows = free & starter.following(t, x)
    x = rested(starter, t, x, follows)
    flat = rooted_at(starter, t, x, follows)
    flat &= rows[starter.rows]
    # no law is flat on these rows
    if not flat.any():
        return None
    others = problem_of(starter, t, x, guess, rows=rows & ~starter.rows_of(flat), free=free, least=True)
    found = solve(others, guess)
    # the others do not hold by themselves
    if found.residual >= OWN:
        return None
    near = starter.without_noise(found.x, starter.scale(t, x))  # what round-off left is no magnitude
    some = starter.columns_of(flat & ~(_missed(starter, t, near) <= OWN)[starter.rows])
    return np.where(some, _beside(starter, t, x, follows), near)


def _steep_at(starter: Starter, t: float, x: Floats, follows: Mask) -> Mask:
    """Entries [entries] of rows whose slope is beyond all bounds in what follows from the state, where that is zero."""
    at_zero: Mask = (follows & (x == 0.0))[starter.columns]
    # nothing is zero: no law is steep at zero
    if not at_zero.any():
        return at_zero
    here, beside = (np.abs(starter.jacobian(t, at)) for at in (x, _beside(starter, t, x, follows)))
    return np.asarray(at_zero & (beside < FALLS * here) & ~starter.groups(*HIDDEN)[starter.rows])


def bends(starter: Starter, t: float, x: Floats, follows: Mask) -> bool:
    """Whether some law has no slope near x in what follows from the state, or one beyond all bounds."""
    near = np.where(follows & (np.abs(x) <= NEARLY * _largest(starter, t, x)), 0.0, x)
    return bool(rooted_at(starter, t, near, follows).any() or _steep_at(starter, t, near, follows).any())


def without_flow(starter: Starter, t: float, x: Floats, follows: Mask) -> Mask:
    """Of what follows the flows of laws without a slope at x whose rates are not asked for."""
    if not starter.resting.any():
        return np.zeros_like(follows)
    return starter.columns_of(flat_at(starter, t, x, follows) & starter.resting[starter.rows])


def at_rest(starter: Starter, t: float, x: Floats, follows: Mask) -> Mask:
    """Of what follows what stays as it is at x: these, and what is zero where laws have no slope in it, or one beyond
    all bounds, and hold.
    """
    # flows of laws that rest, and what is zero where laws have no slope and hold
    still, at_zero = without_flow(starter, t, x, follows), follows & (x == 0.0)
    bent = (rooted_at(starter, t, x, follows) & at_zero[starter.columns]) | _steep_at(starter, t, x, follows)
    if not bent.any():
        return still
    return still | starter.columns_of(bent & (_missed(starter, t, x) <= STEEPLY)[starter.rows])


def rested(starter: Starter, t: float, x: Floats, follows: Mask) -> Floats:
    """X with nothing where flat laws pass next to nothing, and laws that are steep at nothing have next to nothing
    across them, and hold so to round-off.
    """
    size = _largest(starter, t, x)
    # laws that are flat, then laws that are steep at zero
    for bent, most in ((rooted_at, HOLDS), (_steep_at, STEEPLY)):
        near = np.where(follows & (np.abs(x) <= NEXT_TO_NOTHING * size), 0.0, x)
        # nothing is next to nothing
        if (near == x).all():
            break
        entries = bent(starter, t, near, follows)
        at = np.where(starter.columns_of(entries), near, x)
        # only where the laws that read it hold so
        laws = starter.reading(at != x) & starter.rows_of(entries)
        x = at if (_missed(starter, t, at)[laws] <= most).all() else x
    return x


def _largest(starter: Starter, t: float, x: Floats) -> Floats:
    """The largest magnitudes alike [unknowns], at the guess or at x."""
    return starter.largest_alike(np.maximum(starter.scale(t, starter.guess), np.abs(x)))


def _missed(starter: Starter, t: float, x: Floats) -> Floats:
    """Misses of rows [rows], of their terms in the largest magnitudes alike."""
    with np.errstate(invalid="ignore"):
        return np.abs(starter.residual(t, x)) * starter.row_scale(t, x, _largest(starter, t, x))


def unasked(starter: Starter, flat: Ints) -> bool:
    """Asks for no rates of these rows of the system; whether any were asked for.

    Where a law is flat, or infinitely steep, the flow that it determines grows as a root of time: the equations hold,
    and a rate of it there is none.
    """
    # rates of these rows, by group and family
    rated = np.zeros_like(starter.every)
    first = _first_rows(starter)
    for group, family, row in starter.system.form.groups:
        own = flat[(flat >= row) & (flat < row + starter.system.description.rows[family].size)]
        rates = first.get((f"{group}_rate", family))
        if rates is not None:
            rated[rates + own - row] = True
    return _let_go(starter, rated)


def _let_go(starter: Starter, rated: Mask) -> bool:
    """Asks for these rates of rows no more, which then are at rest; whether any were asked for."""
    before, first = int(starter.every.sum()), _first_rows(starter)
    # a law and its rate: the law rests where its rate is let go
    for (group, family), row in first.items():
        own = slice(row, row + starter.system.description.rows[family].size)
        law = first.get((group.removesuffix("_rate"), family), row)
        if law != row:
            starter.resting[law : law + own.stop - row] |= rated[own]
    starter.let_go(rated)
    return int(starter.every.sum()) < before


def _first_rows(starter: Starter) -> dict[tuple[str, int], int]:
    """First row of each group and family."""
    return {(group, family): row for group, family, row in starter.settled.form.groups}


def unrated(starter: Starter, t: float, x: Floats) -> bool:
    """Asks for no rates of laws that have no slope at x, nor where rows of rates are no numbers there (an infinite
    slope times none); whether any were asked for.
    """
    # rows of rates that are no number
    nothing = starter.every & ~np.isfinite(starter.residual(t, x)) & starter.groups(*HIDDEN)
    fewer = _let_go(starter, nothing)
    y, yd = starter.expand(x)
    size = _largest(starter, t, x)[: y.size]
    return unasked(starter, rows_without_slope(starter.system, t, y, yd, size, steep=True)) or fewer


def without_rates(starter: Starter) -> Mask:
    """Rows in which no rate is [rows]."""
    return starter.every & ~starter.groups(*(group for group in HIDDEN if group != "phi_rate"))
