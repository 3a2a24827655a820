"""What moves least of a start: the order of what is said, the measure of each unknown, the problem that they make.

Guesses of what stores hold move least, then what was said of anything else is missed least, then positions of which
something is said, then what no text says of stores moves least (by positions where these are unknowns), then
displacements that hold nothing; what follows from these moves freely.  Of what stores hold momenta come before
displacements, in all formulations: the complementary ones have displacements for momenta.
"""

from __future__ import annotations

import numpy as np
from sysdyn.runtime.model.description import Floats
from sysdyn.runtime.model.inertia import own_inertia
from sysdyn.runtime.model.scales import largest_of_group
from sysdyn.runtime.model.system import LARGE
from sysdyn.runtime.numerics.gauss_newton import Problem
from sysdyn.runtime.numerics.least_change import DENSE
from sysdyn.runtime.start.starter import Mask, Starter

WEIGHT = {"unwritten": 1e-3, "following": 1e-6}
FLOOR = 1e-5
"""Of the largest alike: below it rows hold to EXACT of that, ten times the round-off that full matrices make of it."""


def _held(starter: Starter, t: float, x: Floats) -> Mask:
    """What stores hold, and positions; not flows without inertia, nor what guesses of these miss [unknowns]."""
    system, found = starter.system, starter.stored.copy()
    found[: system.unknowns] |= system.differential(system.slopes(t, *starter.expand(x), rate=True))
    return found


def _levels(starter: Starter, t: float, x: Floats, free: Mask) -> tuple[Mask, ...]:
    """The unknowns that carry the state, in the order in which they move least [unknowns]."""
    # first momenta that are written, then displacements, ...
    state, placed = free & ~starter.following(t, x), starter.moves("start")
    held, hollow, momenta = _held(starter, t, x), starter.hollow, starter.momenta
    said, unsaid = state & starter.written, state & ~starter.written
    stored = said & held & ~placed, unsaid & ~hollow
    (said_p, said_q), (unsaid_p, unsaid_q) = ((of & momenta, of & ~momenta) for of in stored)
    others, at = said & ~held & ~placed, unsaid_q & placed
    return said_p, said_q, others, said & placed, unsaid_p, at, unsaid_q & ~placed, unsaid & hollow


def inertias(starter: Starter, t: float, x: Floats) -> Floats:
    """Inertia of each flow, as the balances say what stores hold [unknowns as written]; none where these are shared."""
    # shared inertia: no measure of their own
    system, known = starter.system, starter.equations
    if not known.balanced:
        return np.zeros(0)
    y, yd = starter.expand(x)
    # without momenta rates alone are needed
    some = known.momentum.size > 0
    jy, jyd = system.jacobian(t, y, yd) if some else (None, system.slopes(t, y, yd, rate=True))
    del y, yd
    return own_inertia(system, jy, jyd)


def weights(starter: Starter, t: float, x: Floats, scale: Floats, inert: Floats) -> Floats:
    """Of changes in magnitudes [unknowns]: unknowns of one kind and unit are moved by one measure, whatever their
    values; those that hold what stores do by their contents, flows by their momenta.  What follows moves freely, by
    its values alone (by momenta 1e-9 of a pressure at a valve at rest were lost): where rows leave multipliers open
    they share alike.  inert: as `inertias` says.
    """
    known, content = starter.equations, scale.copy()
    # contents of flows: momenta, by their inertia
    np.multiply(content[: inert.size], np.abs(inert), out=content[: inert.size], where=inert != 0.0)
    settled = starter.settled
    # of one measure the largest is one
    content /= largest_of_group(settled.once_if_small("measures", lambda: known.measures(settled)), content)
    # what is not written moves more easily
    np.multiply(content, WEIGHT["unwritten"], out=content, where=~starter.written)
    own = largest_of_group(known.alike, scale)
    np.multiply(WEIGHT["following"], np.divide(scale, own, out=own), out=own)
    # what follows moves freely
    np.copyto(content, own, where=starter.following(t, x))
    content[starter.n :] = WEIGHT["following"]  # rates have magnitudes of their own each
    return content


def problem_of(
    starter: Starter, t: float, x: Floats, guess: Floats, *, rows: Mask, free: Mask, least: bool = False
) -> Problem:
    """The equations `rows` in the unknowns `free`, the others as in x; magnitudes and weights are those of x.

    least: the state moves least in the order of what is said of it, however much what follows has to; else by weights.
    """
    inert = inertias(starter, t, x)
    starter.spare()  # of a large model the room counts
    scale = starter.scale(t, x)
    # levels need full matrices
    ordered = least and max(int(rows.sum()), int(free.sum())) <= DENSE
    levels = _levels(starter, t, x, free) if ordered else ()
    # a floor, so that small unknowns may move at all
    if least:
        scale = np.maximum(scale, FLOOR * starter.largest_alike(np.maximum(scale, np.abs(x))))
    weight = weights(starter, t, x, scale, inert)
    del inert
    # fixed values count as large as they are
    fixed = starter.pinned & ~free
    scale = np.where(fixed, np.abs(x), scale) if fixed.any() else scale  # of a large model the room counts
    starter.spare()
    return Problem(
        residual=lambda z: starter.residual(t, z),
        jacobian=lambda z: starter.jacobian(t, z),
        rows=starter.rows,
        columns=starter.columns,
        number=starter.settled.rows,
        use=rows,
        free=free,
        guess=guess,
        scale=scale,
        weight=weight,
        levels=levels,
        idle=np.arange(x.size) >= starter.n,
        work=starter.work,
        core=None if starter.summed else (starter.core, t),
        check=starter.settled.failure.check,
        spare=lambda: starter.system.trim(LARGE),
    )
