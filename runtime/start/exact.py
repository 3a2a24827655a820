"""What was found made exact: its state to round-off in its own magnitudes, what follows by corrections that vanish.

Neither depends on the way to it then.  Beside steep laws what does not come to hold to its own round-off is no start.
"""

from __future__ import annotations

import numpy as np
from sysdyn.runtime import tuning
from sysdyn.runtime.model.description import Floats
from sysdyn.runtime.numerics.gauss_newton import Solution, solve
from sysdyn.runtime.numerics.least_change import DENSE, SINGULAR_VALUES
from sysdyn.runtime.start.corrections import EXACT, Corrected, by_corrections
from sysdyn.runtime.start.equations import HIDDEN
from sysdyn.runtime.start.flat import at_rest, bends, rested, without_flow, without_rates
from sysdyn.runtime.start.held import (
    BACK,
    CLOSED,
    astray,
    farther,
    following,
    least_change,
    nearest,
    own_residual,
    tidied,
)
from sysdyn.runtime.start.least import problem_of
from sysdyn.runtime.start.starter import NOISE, Mask, Starter

EPS, RESOLVED = float(np.finfo(float).eps), tuning.SMALL
"""Round-off; of contents: what it may be."""


def anew(starter: Starter, t: float, best: Solution, x: Floats, guess: Floats, free: Mask) -> tuple[Solution, bool]:
    """The solution with its state to round-off, in its own magnitudes, and what follows found from x as where no state
    moves: neither depends on the way here; whether that holds.  What is too large for full matrices is left alone.
    None that holds where its state has moved farther than its rows ask for.
    """
    state = free & ~starter.following(t, best.x)
    # nothing to do, nothing exact yet, or too large
    if best.residual >= EXACT or best.x.size > DENSE or not (best.x != guess)[state].any():
        return best, False
    found, sure = _renewed(starter, t, best, x, guess, free)
    # laws that do not bend where the state is: the rows say all of it
    if found.residual == np.inf or not any(bends(starter, t, at, free & ~state) for at in (found.x, guess)):
        return found, sure
    # what a law without a slope, or one beyond all bounds, asks of rates says nothing of the state
    with starter.granted():
        nearer = (least_change(starter, t, at, guess, without_rates(starter), free, state) for at in (found.x, best.x))
        settled = next((at for at in nearer if at is not None), None)
    # not nearer than what was found
    if settled is None or not farther(starter, t, found.x, settled, guess, free):
        return found, sure
    clean = tidied(starter, t, settled, guess, state)
    # what follows from that state, from the guess and from where it is
    for begun in (np.where(state, clean, x), clean):
        with starter.granted():
            again, holds = following(starter, t, begun, guess, free, free & ~state)
        if holds:
            return again, True
    # neither holds: what was found has moved farther than need be
    return Solution(best.x, np.inf), False


def _renewed(starter: Starter, t: float, best: Solution, x: Floats, guess: Floats, free: Mask) -> tuple[Solution, bool]:
    """The solution with its state to round-off, and whether it holds, by what all rows say of the state."""
    # the state nearest to the guess on all rows; what is round-off of that stays
    there = best.x
    state = free & ~starter.following(t, there)
    near = nearest(starter, t, there, guess, starter.every, free)
    largest = starter.largest_alike(np.maximum(starter.scale(t, guess), np.abs(near)))
    near = np.where(np.abs(near - there) <= NOISE * largest, there, near)
    back = np.where(np.abs(near - guess) <= BACK * largest, guess, near)
    # a guess that hardly moves stays as written
    steep, last = bool(starter.system.form.scales), near
    if steep:  # rows of small terms are lost beside all that moves: the rest by the least change from there
        last = nearest(starter, t, near, near, starter.every, free)
    # the guess, the nearest state, and that beside steep laws
    for moved in (back, near, last):
        begun = np.where(state, moved, x)
        follows = free & ~state & ~without_flow(starter, t, begun, free & ~state)
        with starter.granted():
            found, holds = following(starter, t, begun, guess, free, follows)
        held = holds and found.residual <= max(CLOSED, best.residual)
        # what is left where a guess of twelve digits stays is no round-off: beside steep laws that is no start
        if held and (moved is last or not steep or sharp(starter, t, found, free) is not None):
            return found, True
    # rates of flat laws may have pulled the state: without them
    unbound = nearest(starter, t, there, guess, without_rates(starter), free)
    if not astray(starter, t, there, unbound, guess, state):
        return best, False
    # once without rates, once with all rows
    for rows in (without_rates(starter), starter.every.copy()):
        with starter.granted():
            settled = least_change(starter, t, there, guess, rows, free, state)
            if settled is None:
                continue
            found, holds = following(starter, t, np.where(state, settled, x), guess, free, free & ~state)
        if holds:
            return found, True
    return Solution(there, np.inf), False


def sharp(starter: Starter, t: float, best: Solution, free: Mask) -> Solution | None:
    """The solution with what follows from its state by corrections that vanish, where rows determine them: values
    before rates, whose rows mix large slopes with small ones; what only leakage ties moves by volts under rows that
    hold to round-off of the largest current.  None where rows with steep laws do not come to hold to their own
    round-off: it is no solution.
    """
    # too large for singular values
    if best.x.size > SINGULAR_VALUES:
        return best
    # contents that are round-off of what makes them
    if not _resolved(starter, t, best.x):
        return None
    follows, steep = free & starter.following(t, best.x), bool(starter.system.form.scales)
    at = rested(starter, t, best.x, follows)
    # flat laws at rest first, then as they are
    for x, still in ((at, at_rest), (best.x, without_flow)):
        rests = still(starter, t, x, follows)
        values = _values(starter, t, x, follows, rests)
        if values.holds:
            break
    follows &= ~rests
    # steep laws that no correction satisfies
    if not values.holds and steep:
        return None
    found = values.holds and bool(values.known.any())
    x, rest = (values.x, follows & ~(values.known & _of_y(starter))) if found else (best.x, follows)
    # rates behind values, by the rows that read them
    rates = by_corrections(starter, t, x, starter.every & starter.reading(rest), rest)
    if rates.holds and rates.x is not x:
        return Solution(rates.x, own_residual(starter, t, rates.x, rates.x))
    # else one step more in all that is left
    if found and np.isfinite(starter.jacobian(t, x)).all():
        return solve(problem_of(starter, t, x, x, rows=starter.every, free=rest), x, 1)
    return best


def _resolved(starter: Starter, t: float, x: Floats) -> bool:
    """Whether contents that are guessed or said are more than round-off of the terms that make them, and states more
    than that of the largest of their like: beside potentials of 1e16 V any volt holds, beside 1e24 A of a junction a
    coil is empty.
    """
    state = starter.written & ~starter.following(t, x) & (starter.guess != 0.0)
    # what the text gave, lost beside what is larger by 1e16
    guess = np.abs(starter.guess)  # what was guessed as round-off (the cosine of a right angle) stays that
    lost = (guess < EPS * starter.largest_alike(x)) & (guess >= EPS * starter.largest_alike(guess))
    if lost[state].any():
        return False
    # guessed expressions beside their terms
    of = starter.groups("initial")[starter.rows]
    said = np.abs(starter.residual(t, np.zeros_like(x)))
    terms = np.zeros_like(said)
    np.maximum.at(terms, starter.rows[of], np.abs(starter.jacobian(t, x) * x[starter.columns])[of])
    return bool((EPS * terms <= RESOLVED * said)[starter.groups("initial") & (said > 0.0)].all())


def _of_y(starter: Starter) -> Mask:
    """Unknowns that are no rates."""
    return np.arange(starter.free.size) < starter.n


def _values(starter: Starter, t: float, x: Floats, follows: Mask, rests: Mask) -> Corrected:
    """X with what rows as written determine of what follows and does not rest, together with the rates that these read,
    from zero: of capacitors that float with 1e13 V/s rows hold differences of rates alone, microvolts a second.  Where
    they do not determine all of that (coils whose currents other rates tie), beside rates as they are.
    """
    of_y = _of_y(starter)
    written = rows = starter.every & ~starter.groups(*HIDDEN) & starter.reading(follows & of_y)
    # rows as written, and rates that they read
    follows = follows & ~rests
    for _ in range(2):  # rates of momenta read those of flows
        # momenta have rates that flows tell
        rates = follows & ~of_y & starter.read(rows)
        rows = rows | (starter.every & starter.groups("momentum_rate") & starter.reading(rates))
    begun, free = np.where(rates, 0.0, x), follows & (of_y | starter.read(rows))
    found = by_corrections(starter, t, begun, rows, free)
    # found, or the rows do not hold together
    if found.known.any() or not found.holds:
        return found
    found = by_corrections(starter, t, x, written, follows & of_y)
    return found if found.holds else by_corrections(starter, t, begun, rows, free, partly=True)
