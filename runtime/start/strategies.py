"""Globalisation: what is tried, in the order of STRATEGIES, until all rows of a start hold.

Each strategy is a generator of solutions, found by Gauss-Newton steps (numerics/gauss_newton.py) on all rows or some.
Magnitudes that prove wrong on the way are taken anew.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace

import numpy as np
from sysdyn.runtime import tuning
from sysdyn.runtime.model.description import Floats, Ints
from sysdyn.runtime.model.inertia import own_unknown
from sysdyn.runtime.numerics.gauss_newton import CORRECTED, Solution, solve, stepped
from sysdyn.runtime.numerics.least_change import DENSE, least_norm
from sysdyn.runtime.start.corrections import EXACT, by_corrections
from sysdyn.runtime.start.flat import OWN, off_the_flat, without_rates
from sysdyn.runtime.start.held import CLOSED, RESCALINGS, following, least_change, own_residual, rescaled, tidied
from sysdyn.runtime.start.least import problem_of
from sysdyn.runtime.start.linearly import contradicting
from sysdyn.runtime.start.starter import Mask, Starter

_AMPLITUDES = tuple(10.0**power for power in (-2, -1, 0, -4, 1, -6, 2))
"""Of magnitudes: how far points around lie, the likelier first."""
STRAIGHT_ON, ALONG = 0.5, 2.0
"""Of the work of a search: what Newton's method may take before a homotopy is asked (twice what the hardest start of
the models does), and a homotopy (eight TTL gates between potentials: 1.8).
"""
FIRST_PART, LEAST_PART = 0.1, 1e-5
"""Of misses: what is faded out first; less is not faded out at once (chains of 2 to 8 TTL gates ask for 0.006)."""
FOLLOWED, NEARLY = 20, tuning.SLIGHT
"""Iterations in which Newton's method follows what fades, and the scaled residual at which it has."""


def _bent(starter: Starter, t: float, x: Floats) -> Mask:
    """Rows that are not linear."""
    here, there = (starter.jacobian(t, z) for z in (x, x + 1e-3 * starter.scale(t, x)))
    bent = np.zeros(starter.settled.rows, dtype=bool)
    bent[starter.rows[here != there]] = True
    return bent


Tries = Iterator[tuple[Solution, bool]]
Strategy = Callable[[Starter, float, Floats, Floats, Mask], Tries]
"""From t, a point x to begin at, the guess and the free unknowns: solutions, each with whether all rows hold."""


def first(tries: Tries, x: Floats) -> tuple[Solution, bool]:
    """The first at which all rows hold, else the one of the least residual; x where there is none."""
    best = Solution(x, np.inf)
    for found, holds in tries:
        if holds:
            return found, True
        best = found if found.residual < best.residual else best
    return best, False


def _of_the_state(starter: Starter, follows: Mask) -> Mask:
    """Rows that read nothing of what follows from the state: loops of springs, constraints of the state [rows]."""
    return starter.every & ~starter.reading(follows)


def _beyond(starter: Starter, t: float, x: Floats, follows: Mask) -> bool:
    """Whether rows of the state alone are missed."""
    missed = np.where(_of_the_state(starter, follows), np.abs(starter.residual(t, x)), 0.0)
    return bool(missed.any() and (missed * starter.row_scale(t, x, starter.scale(t, x)) > OWN).any())


def _on_its_rows(starter: Starter, t: float, x: Floats, guess: Floats, state: Mask, follows: Mask) -> Floats | None:
    """X with the state on the rows of the state alone, by its least change, to round-off; None where none was found."""
    problem = problem_of(starter, t, x, guess, rows=_of_the_state(starter, follows), free=state, least=True)
    found = solve(problem, x)
    return stepped(problem, found.x) if found.residual < EXACT else None


def _newton(starter: Starter, t: float, x: Floats, guess: Floats, free: Mask) -> Tries:
    """What follows from the state alone, by Newton's method, the state as guessed, then as rows without rates have it;
    where that nearly holds everything: a guess rounded to ten digits satisfies rows nearly, and a stiff model pays for
    the rest with its first step.
    """
    follows, nearly = free & starter.following(t, x), False
    # states that may be held, until one nearly does
    for begun in _states(starter, t, x, guess, free, follows):
        with starter.granted(STRAIGHT_ON):
            found, nearly = following(starter, t, begun, guess, free, follows)
        exact = nearly and (found.residual <= CLOSED or own_residual(starter, t, found.x, found.x) <= CLOSED)
        near = None if exact else _by_corrections(starter, t, found, follows)
        yield (found, exact) if near is None else (near, True)
        if nearly:
            break
    # what jumps, by corrections of all rows
    if starter.jumping and (near := _by_corrections(starter, t, Solution(x, 0.0), free)) is not None:
        yield near, True
    if not nearly:
        return
    # everything at once, from what nearly holds
    everything, holds = next(_newton_with_moving_state(starter, t, x, guess, free))
    if x.size <= DENSE:
        moved = np.abs(everything.x - found.x) > OWN * starter.largest_alike(starter.scale(t, found.x))
        if (moved & ~follows).any():  # to another root
            yield found, True
    yield everything, holds
    yield found, True


def _newton_with_moving_state(starter: Starter, t: float, x: Floats, guess: Floats, free: Mask) -> Tries:
    """Everything by Newton's method, the state by its least change."""
    with starter.granted(STRAIGHT_ON):  # what a state that contradicts has taken is not missed then
        everything = rescaled(starter, t, x, guess, free)
    yield everything


def _states(starter: Starter, t: float, x: Floats, guess: Floats, free: Mask, follows: Mask) -> Iterator[Floats]:
    """Of a small model points with states that may be held: that of x, on the rows of the state alone; then what rows
    without rates make of it: a law that is flat where it holds (a turbulent valve at rest) has a rate that asks for
    another state.  A long chain is pulled straight at once.
    """
    small, near = x.size <= DENSE, x
    # the rows of the state alone do not hold: onto them first
    if _beyond(starter, t, x, follows):
        found = _on_its_rows(starter, t, x, guess, free & ~follows, follows) if small else None
        if found is not None:
            yield (near := found)
    else:
        yield x
    # then by rows without rates
    if small and not starter.jumping:
        *_, (near, _) = (near, free), *off_the_flat(starter, t, near, follows)
        with starter.granted():
            held = least_change(starter, t, near, guess, without_rates(starter), free, free & ~follows)
        if held is not None:
            clean = tidied(starter, t, held, guess, free & ~follows)
            yield np.where(follows, x, clean)
            yield clean


def _by_corrections(starter: Starter, t: float, found: Solution, free: Mask) -> Solution | None:
    """What is free as all rows determine it; None where they do not, or the problem is no small one."""
    # large, or no numbers
    if found.x.size > CORRECTED or not np.isfinite(found.residual):
        return None
    near = by_corrections(starter, t, found.x, starter.every, free, partly=True)
    # no correction, or rows that do not hold to round-off
    if near.x is found.x or not near.holds or not (residual := own_residual(starter, t, near.x, near.x)) < OWN:
        return None
    return Solution(near.x, residual)


def _completed(starter: Starter, t: float, x: Floats, guess: Floats, free: Mask) -> tuple[Solution, bool]:
    """From a point at which rows as written hold: rates, which follow from the rest by linear rows; where that is not
    all, everything at once.
    """
    x, sized = x.copy(), starter.without_noise(x, starter.scale(t, x))  # what round-off left is no magnitude
    x[starter.n :] = sized[starter.n :] = guess[starter.n :]
    # the state is as guessed: rates alone
    if (x == guess)[free & ~starter.following(t, x)].all():
        rates = free & (np.arange(x.size) >= starter.n)
        found, holds = rescaled(starter, t, x, x, rates, least=False, sized=sized)
        if holds:
            return found, holds
        x = found.x
    return rescaled(starter, t, x, guess, free, sized=sized)


def _homotopy_from_guess(starter: Starter, t: float, x: Floats, guess: Floats, free: Mask) -> Tries:
    """What follows from the state along what fades of the misses at x of rows without rates, as fast as Newton's method
    follows, then by all rows (Newton's homotopy: Allgower and Georg 1990): of a jump, its rise drawn out.
    """
    if (follows := _following_from(starter, t, x, free)) is not None:
        yield from _along(starter, t, (x, x), guess, follows)


def _homotopy_from_nothing(starter: Starter, t: float, x: Floats, guess: Floats, free: Mask) -> Tries:
    """What the homotopy leads to from nothing, where sources and what stores hold rise (source stepping: Nagel 1975):
    at rest no law is steep.
    """
    # at rest already: no source to rise
    if x.any() and (follows := _following_from(starter, t, x, free)) is not None:
        yield from _along(starter, t, (np.zeros_like(x), x), guess, follows)


def _homotopy_from_between(starter: Starter, t: float, x: Floats, guess: Floats, free: Mask) -> Tries:
    """What the homotopy leads to from where flows of which nothing is said are between those beside them: a node
    guessed at 0 V below one at 400 V lies where no slope of a junction is left, or beyond the largest number.
    """
    follows = _following_from(starter, t, x, free)
    near = None if follows is None else _evened(starter, t, x, follows)
    if near is not None and follows is not None:
        yield from _along(starter, t, (near, near), guess, follows)


def _homotopy_with_moving_state(starter: Starter, t: float, x: Floats, guess: Floats, free: Mask) -> Tries:
    """Everything along what fades of the misses at x."""
    yield from _along(starter, t, (x, x), guess, free)


def _following_from(starter: Starter, t: float, x: Floats, free: Mask) -> Mask | None:
    """What follows from the state; None where rows that are linear in it, or those of the state alone, contradict."""
    follows = free & starter.following(t, x)
    contradict = _beyond(starter, t, x, follows) or contradicting(starter, t, x, follows) is not None
    return None if contradict else follows


def _along(starter: Starter, t: float, way: tuple[Floats, Floats], guess: Floats, free: Mask) -> Tries:
    """What the homotopy leads to, by all rows; with work of its own."""
    # with work of its own, then all rows
    with starter.granted(ALONG):
        end = _at_the_end(starter, t, way, free)
        found = None if end is None else _completed(starter, t, end, guess, free)
    if found is not None:
        yield found


def _at_the_end(starter: Starter, t: float, way: tuple[Floats, Floats], free: Mask) -> Floats | None:
    """Where the homotopy leads that draws what is not free along from the begin of the way to its end; None where it
    does not lead there.
    """
    (at, end), rows = way, without_rates(starter)
    begun, free, miss, done, part = at, free & starter.read(rows), starter.residual(t, at), 0.0, FIRST_PART
    grows = True  # but for the first part behind one that did not lead on
    # no numbers at the begin
    if not np.isfinite(miss[rows]).all():
        return None
    # parts that double, and halve where Newton's method fails
    while done < 1.0 and part > LEAST_PART and not starter.work.done:
        to = min(done + part, 1.0)
        drawn = np.where(free, at, begun + to * (end - begun))
        found = _follow(starter, t, drawn, (rows, free), _faded(starter, t, (1.0 - to) * miss))
        if found is None:
            part, grows = 0.5 * part, False
            continue
        at, done, part, grows = found, to, 2.0 * part if grows else part, True
    return at if done == 1.0 else None


def _faded(starter: Starter, t: float, miss: Floats) -> Callable[[Floats], Floats]:
    """Rows that hold where those of the start are missed by so much."""
    return lambda x: starter.residual(t, x) - miss


def _follow(
    starter: Starter, t: float, x: Floats, what: tuple[Mask, Mask], left: Callable[[Floats], Floats]
) -> Floats | None:
    """From x where these rows, in what is free, nearly hold in magnitudes of their own; None where Newton's method does
    not get there.
    """
    rows, free = what
    # magnitudes anew until the rows hold in their own
    for _ in range(RESCALINGS):
        problem = replace(problem_of(starter, t, x, x, rows=rows, free=free), residual=left, core=None)
        found = solve(problem, x, FOLLOWED)
        if not found.residual < NEARLY:
            return None
        x = found.x
        own = np.abs(left(x)) * starter.row_scale(t, x, starter.scale(t, x))
        if (own[rows] < NEARLY).all():
            return x
    return None


def _evened(starter: Starter, t: float, x: Floats, free: Mask) -> Floats | None:
    """X with these flows where differences of those that read each other in balances are least (as conductors of one
    size between all nodes would have them), subject to rows that say flows; None where that changes nothing.
    """
    flows, own = starter.moves("f"), own_unknown(starter.settled, "dynamics", "f")
    # flows without a value, beside each other in balances
    unsaid, alike = flows & free & ~starter.written, starter.equations.alike
    one, other = own[starter.rows], starter.columns
    pairs = (one >= 0) & flows[other] & (one != other) & (alike[one] == alike[other])
    one, other = (np.append(*ends) for ends in ((one[pairs], other[pairs]), (other[pairs], one[pairs])))
    one, other = one[unsaid[one]], other[unsaid[one]]
    said = starter.groups("phi_rate", "psi", "initial")[starter.rows] & unsaid[starter.columns]
    row, column, values = starter.rows[said], starter.columns[said], starter.jacobian(t, x)[said]
    saying = np.zeros(starter.settled.rows, dtype=bool)
    saying[row] = True
    row, column, size = _numbered(row, saying) + int(unsaid.sum()), _numbered(column, unsaid), int(unsaid.sum())
    one, inner, beside, apart = _numbered(one, unsaid), unsaid[other], _numbered(other, unsaid), x[other] - x[one]
    i = np.concatenate([one, one[inner], row, column])  # what rows say has multipliers behind the flows
    j = np.concatenate([one, beside[inner], column, row])
    v: Floats = np.concatenate([np.ones(one.size), -np.ones(int(inner.sum())), values, values])
    aim: Floats = np.append(np.bincount(one, apart, size), -starter.residual(t, x)[saying])
    # nothing to even out, or no numbers
    if not (one.size and aim.any() and np.isfinite(v).all() and np.isfinite(aim).all()):
        return None
    near = x.copy()
    near[unsaid] += least_norm((aim.size, aim.size), (i, j, v), aim)[:size]
    return near


def _numbered(places: Ints, used: Mask) -> Ints:
    """Places by their numbers among those in use."""
    return (np.cumsum(used) - 1)[places]


def around(starter: Starter, t: float, x: Floats, free: Mask) -> Iterator[Floats]:
    """Points around, always the same, as long as there is work left."""
    random = np.random.default_rng(20)
    for amplitude in _AMPLITUDES:
        if starter.work.done:
            return
        yield x + np.where(free, amplitude * starter.scale(t, x) * random.standard_normal(x.size), 0.0)


STRATEGIES: tuple[tuple[str, Strategy], ...] = (
    ("newton", _newton),
    ("homotopy", _homotopy_from_guess),
    ("homotopy", _homotopy_from_nothing),
    ("homotopy", _homotopy_from_between),
    ("newton", _newton_with_moving_state),
    ("homotopy", _homotopy_with_moving_state),
)
"""Globalisation: what is tried, in this order, until all rows hold: the state as it is before it moves."""


def applicable(
    starter: Starter, t: float, x: Floats, free: Mask, *, quickly: bool = False
) -> Iterator[tuple[str, Strategy]]:
    """Of these, what may help from x: rows that are all linear hold at once or nowhere, and no homotopy leads to where
    linear rows contradict.  quickly: Newton's method alone.
    """
    bent = False
    # beyond Newton's method only where some law bends
    for k, (name, strategy) in enumerate(STRATEGIES):
        if k == 1 and not quickly:  # slopes of steep laws underflow
            bent = bool(starter.settled.form.scales) or bool(_bent(starter, t, x).any())
            bent = bent and contradicting(starter, t, x, free) is None
        if bent or name == "newton":
            yield name, strategy


def behind(starter: Starter, t: float, x: Floats, free: Mask) -> Floats | None:
    """A point behind a jump at which all rows hold that must, from x; None where none was found.  A step of 10 V across
    a diode makes steep laws lie far behind it.
    """
    # ways as at a start
    ways = [way for _, way in applicable(starter, t, x, free)]
    with np.errstate(all="ignore"):  # an exponential may be beyond the largest number on the way, where nothing holds
        found, holds = first((found for way in ways for found in way(starter, t, x, x, free)), x)
    return found.x if holds else None
