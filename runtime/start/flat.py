"""Laws without a slope where they are asked (a turbulent valve at rest): where to begin beside them, what is at rest.

They say nothing there of what they pass, and where they hold so its rate is none: it grows as a root of time.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from sysdyn.runtime.model.description import Floats, Ints
from sysdyn.runtime.model.slopes import rows_without_slope
from sysdyn.runtime.numerics.gauss_newton import solve
from sysdyn.runtime.start.equations import HIDDEN
from sysdyn.runtime.start.least import problem_of
from sysdyn.runtime.start.starter import Mask, Starter

NEXT_TO_NOTHING, HOLDS = 1e-8, 1e-15
"""Of the largest alike: roots of round-off; scaled residual of rows that hold to it."""
NO_SLOPE = 1e-10
"""Of the slope beside: what is less is none (slopes are those next to a root where others are no numbers at it)."""
OWN = 1e-6
"""Scaled residual of rows that are missed."""


def _beside(starter: Starter, t: float, x: Floats, follows: Mask) -> Floats:
    """X with what follows moved by its magnitude."""
    return x + np.where(follows, starter.scale(t, x), 0.0)


def flat_at(starter: Starter, t: float, x: Floats, follows: Mask) -> Mask:
    """Entries [entries] of rows that have no slope in what follows from the state at x, but beside it."""
    beside = _beside(starter, t, x, follows)
    here, there = np.abs(starter.jacobian(t, x)), np.abs(starter.jacobian(t, beside))
    flat = (here <= NO_SLOPE * there) & (there > 0.0) & follows[starter.columns]
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
    flat_rows = np.bincount(starter.rows, flat, starter.settled.rows) > 0.0
    flat_here = np.bincount(starter.columns, flat, x.size) > 0.0
    rows = without_rates(starter) & ~flat_rows
    at = solve(problem_of(starter, t, x, x, rows=rows, free=follows & ~flat_here), x).x
    at = starter.without_noise(at, starter.scale(t, x))
    with np.errstate(invalid="ignore"):  # infinite rows are missed
        missed = ~(np.abs(starter.residual(t, at)) * starter.row_scale(t, at, starter.scale(t, at)) <= OWN)
    some = np.bincount(starter.columns, flat & missed[starter.rows], x.size) > 0.0
    yield np.where(some, beside, x) if some.any() else x, follows & (some | ~flat_here)
    if some.any() and (some != flat_here).any():
        yield np.where(flat_here, beside, x), follows


def at_rest(starter: Starter, t: float, x: Floats, follows: Mask) -> Mask:
    """Of what follows what stays as it is at x: flows of laws without a slope there whose rates are not asked for."""
    if not starter.resting.any():
        return np.zeros_like(follows)
    flat = flat_at(starter, t, x, follows) & starter.resting[starter.rows]
    return np.asarray(np.bincount(starter.columns, flat, x.size) > 0.0)


def rested(starter: Starter, t: float, x: Floats, follows: Mask) -> Floats:
    """X with nothing where laws whose rates are not asked for pass next to nothing, and hold so to round-off."""
    size = starter.largest_alike(np.maximum(starter.scale(t, starter.guess), np.abs(x)))
    near = np.where(follows & (np.abs(x) <= NEXT_TO_NOTHING * size), 0.0, x)
    at = np.where(at_rest(starter, t, near, follows), near, x)
    laws = starter.resting & starter.reading(at != x)
    missed = np.abs(starter.residual(t, at)) * starter.row_scale(t, at, size)
    return at if (missed[laws] <= HOLDS).all() else x


def unasked(starter: Starter, flat: Ints) -> bool:
    """Asks for no rates of these rows of the system; whether any were asked for.

    Where a law is flat, or infinitely steep, the flow that it determines grows as a root of time: the equations hold,
    and a rate of it there is none.
    """
    before, rated = int(starter.every.sum()), np.zeros_like(starter.every)
    first = {(group, family): row for group, family, row in starter.settled.form.groups}
    for group, family, row in starter.system.form.groups:
        own = flat[(flat >= row) & (flat < row + starter.system.description.rows[family].size)]
        rates = first.get((f"{group}_rate", family))
        if rates is not None:
            rated[rates + own - row] = True
            starter.resting[first[group, family] + own - row] = True
    starter.let_go(rated)
    return int(starter.every.sum()) < before


def unrated(starter: Starter, t: float, x: Floats) -> bool:
    """Asks for no rates of laws that have no slope at x, nor where rows of rates are no numbers there (an infinite
    slope times none); whether any were asked for.
    """
    nothing = starter.every & ~np.isfinite(starter.residual(t, x)) & starter.groups(*HIDDEN)
    starter.let_go(nothing)
    y, yd = starter.expand(x)
    size = starter.largest_alike(np.maximum(starter.scale(t, starter.guess), np.abs(x)))[: y.size]
    return unasked(starter, rows_without_slope(starter.system, t, y, yd, size, steep=True)) or bool(nothing.any())


def without_rates(starter: Starter) -> Mask:
    """Rows in which no rate is [rows]."""
    return starter.every & ~starter.groups(*(group for group in HIDDEN if group != "phi_rate"))
