"""Globalisation: what is tried, in the order of STRATEGIES, until all rows of a start hold.

Each strategy is a generator of solutions, found by Gauss-Newton steps (numerics/gauss_newton.py) on all rows or some.
Magnitudes that prove wrong on the way are taken anew.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import replace

import numpy as np
from sysdyn.runtime.model.description import Floats, Ints
from sysdyn.runtime.model.inertia import own_unknown
from sysdyn.runtime.numerics.gauss_newton import CORRECTED, Solution, solve, stepped
from sysdyn.runtime.numerics.least_change import DENSE, least_norm
from sysdyn.runtime.start.corrections import EXACT, by_corrections
from sysdyn.runtime.start.equations import HIDDEN
from sysdyn.runtime.start.flat import OWN, off_the_flat, without_rates
from sysdyn.runtime.start.held import CLOSED, RESCALINGS, following, least_change, own_residual, rescaled, tidied
from sysdyn.runtime.start.least import problem_of
from sysdyn.runtime.start.linearly import contradicting
from sysdyn.runtime.start.starter import Mask, Starter

_AMPLITUDES = (1e-2, 1e-1, 1.0, 1e-4, 10.0, 1e-6, 1e2, 1e-1, 1.0, 10.0)
WALKED = 0.2
"""Share of the work of a search that walking down steep laws may take."""
LEAST_PART = 1e-6
"""Of misses: less is not faded out at once."""
BRACKETS = 10.0 ** np.arange(-6, 10)
"""Of the size of an unknown: how far from where it is a row is looked at for another sign."""
HALVINGS = 100
"""More than a double has digits between two arguments of unlike size."""
FOLLOWED, NEARLY = 12, 1e-4
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
    where that is not enough everything, the least first: a guess rounded to ten digits satisfies rows nearly, and a
    stiff model pays for the rest with its first step.
    """
    follows, nearly = free & starter.following(t, x), False
    for begun in _states(starter, t, x, guess, free, follows):
        with starter.granted():
            found, nearly = following(starter, t, begun, guess, free, follows)
        exact = nearly and (found.residual <= CLOSED or own_residual(starter, t, found.x, found.x) <= CLOSED)
        near = None if exact else _by_corrections(starter, t, found, follows)
        yield (found, exact) if near is None else (near, True)
        if nearly:
            break
    if starter.jumping and (near := _by_corrections(starter, t, Solution(x, 0.0), free)) is not None:
        yield near, True
    with starter.granted():  # what a state that contradicts has taken is not missed then
        everything = rescaled(starter, t, x, guess, free)
    if nearly and x.size <= DENSE:
        moved = np.abs(everything[0].x - found.x) > OWN * starter.largest_alike(starter.scale(t, found.x))
        if (moved & ~follows).any():  # to another root
            yield found, True
    yield everything
    if nearly:
        yield found, True


def _states(starter: Starter, t: float, x: Floats, guess: Floats, free: Mask, follows: Mask) -> Iterator[Floats]:
    """Of a small model points with states that may be held: that of x, on the rows of the state alone; then what rows
    without rates make of it: a law that is flat where it holds (a turbulent valve at rest) has a rate that asks for
    another state.  A long chain is pulled straight at once.
    """
    small, near = x.size <= DENSE, x
    if _beyond(starter, t, x, follows):
        found = _on_its_rows(starter, t, x, guess, free & ~follows, follows) if small else None
        if found is not None:
            yield (near := found)
    else:
        yield x
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
    if found.x.size > CORRECTED or not np.isfinite(found.residual):
        return None
    near = by_corrections(starter, t, found.x, starter.every, free, partly=True)
    if near.x is found.x or not near.holds or not (residual := own_residual(starter, t, near.x, near.x)) < OWN:
        return None
    return Solution(near.x, residual)


def _as_written(starter: Starter, t: float, x: Floats) -> Mask:
    """Rows as written and such derivatives as are linear: far from a solution the derivative of an exponential hides
    what itself is after.
    """
    return starter.every & ~(starter.groups(*HIDDEN) & _bent(starter, t, x))


def _completed(starter: Starter, t: float, x: Floats, guess: Floats, free: Mask) -> tuple[Solution, bool]:
    """From a point at which rows as written hold: rates, which follow from the rest by linear rows; where that is not
    all, everything at once.
    """
    x, sized = x.copy(), starter.without_noise(x, starter.scale(t, x))  # what round-off left is no magnitude
    x[starter.n :] = sized[starter.n :] = guess[starter.n :]
    if (x == guess)[free & ~starter.following(t, x)].all():
        rates = free & (np.arange(x.size) >= starter.n)
        found, holds = rescaled(starter, t, x, x, rates, least=False, sized=sized)
        if holds:
            return found, holds
        x = found.x
    return rescaled(starter, t, x, guess, free, sized=sized)


def _walked(starter: Starter, t: float, x: Floats, guess: Floats, free: Mask) -> Tries:
    """Down steep laws on the rows as written, with a share of work of its own; then everything."""
    rows = _as_written(starter, t, x)
    with starter.granted(WALKED):
        for _ in range(RESCALINGS):
            found = solve(problem_of(starter, t, x, guess, rows=rows, free=free), x)
            if not np.isfinite(found.residual) or (found.x == x).all():
                break
            x = found.x
    yield _completed(starter, t, x, guess, free)


def _led(starter: Starter, t: float, x: Floats, guess: Floats, free: Mask) -> Tries:
    """Along what fades of the misses of rows as written, as fast as Newton's method follows, the state held if that
    will do; then everything (Newton's homotopy: Allgower and Georg 1990): of a jump, its rise drawn out.  With work of
    its own.
    """
    follows = free & starter.following(t, x)
    for may in (follows, free) if (follows != free).any() else (free,):
        with starter.granted():
            found = _completed(starter, t, _at_the_end(starter, t, x, may), guess, may)
        yield found


def _faded(starter: Starter, t: float, miss: Floats) -> Callable[[Floats], Floats]:
    """Rows that hold where those of the start are missed by so much."""
    return lambda x: starter.residual(t, x) - miss


def _at_the_end(starter: Starter, t: float, x: Floats, free: Mask) -> Floats:
    """Where the homotopy leads; as far as it got where work is over."""
    every, miss, done, part = _as_written(starter, t, x), starter.residual(t, x), 0.0, 0.5
    while done < 1.0 and part > LEAST_PART and not starter.work.done:
        left = _faded(starter, t, max(1.0 - done - part, 0.0) * miss)
        rows = problem_of(starter, t, x, x, rows=every, free=free)
        found = solve(replace(rows, residual=left, core=None), x, FOLLOWED)
        follows = found.residual < NEARLY
        x, done, part = (found.x, done + part, 2.0 * part) if follows else (x, done, 0.25 * part)
    return solve(problem_of(starter, t, x, x, rows=every, free=free), x).x


def _between(starter: Starter, t: float, x: Floats, guess: Floats, free: Mask) -> Tries:
    """By Newton's method, and down steep laws, from where flows of which nothing is said are between those beside them:
    a node guessed at 0 V below one at 400 V lies where no slope of a junction is left, or beyond the largest number.
    With work of its own.
    """
    near = _evened(starter, t, x, free)
    if near is None:
        return
    for way in (_newton, _walked):
        with starter.granted():
            found = first(way(starter, t, near, guess, free), near)
        yield found


def _evened(starter: Starter, t: float, x: Floats, free: Mask) -> Floats | None:
    """X with these flows where differences of those that read each other in balances are least (as conductors of one
    size between all nodes would have them), subject to rows that say flows; None where that changes nothing.
    """
    flows, own = starter.moves("f"), own_unknown(starter.settled, "dynamics", "f")
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
    if not (one.size and aim.any() and np.isfinite(v).all() and np.isfinite(aim).all()):
        return None
    near = x.copy()
    near[unsaid] += least_norm((aim.size, aim.size), (i, j, v), aim)[:size]
    return near


def _numbered(places: Ints, used: Mask) -> Ints:
    """Places by their numbers among those in use."""
    return (np.cumsum(used) - 1)[places]


def _substituted(starter: Starter, t: float, x: Floats, guess: Floats, free: Mask) -> Tries:
    """By Newton's method from where forward substitution leads: rows as written that read one unknown which is not
    known yet determine it, one after another.  Behind a switch that opens on a coil the current of a diode is the
    coil's, and its effort the one at which its law carries that, e = vT ln(1 + f/Is), however flat it is at the guess.
    """
    near, unknown = x.copy(), free & starter.following(t, x)
    rows, multipliers = starter.settled.held  # which read "multiplier = 0"
    stands = ~np.isin(starter.rows, rows) | np.isin(starter.columns, multipliers)
    row, column = starter.rows[stands], starter.columns[stands]
    left = _as_written(starter, t, x)
    while True:
        counts = np.bincount(row[unknown[column]], minlength=left.size)
        places = np.flatnonzero((left & (counts == 1))[row] & unknown[column])
        if not places.size:
            break
        at = places[0]
        left[row[at]] = unknown[column[at]] = False
        if (root := _root_of_row(starter, t, near, int(row[at]), int(column[at]))) is None:
            return
        near[column[at]] = root
    if (near != x).any():
        with starter.granted():
            found = first(_newton(starter, t, near, guess, free), near)
        yield found


def _root_of_row(starter: Starter, t: float, x: Floats, row: int, column: int) -> float | None:
    """Where a row is zero along one unknown, nearest to where that is: by bisection, for a law may be flat or beyond
    the largest number on the way.  None where its sign does not change.
    """
    here, at = x.copy(), float(x[column])

    def value(z: float) -> float:
        here[column] = z
        with np.errstate(all="ignore"):
            return float(starter.residual(t, here)[row])

    begun = value(at)
    if begun == 0.0:
        return at
    size = max(float(starter.scale(t, x)[column]), abs(at))
    for part in BRACKETS:
        for low in (at + part * size, at - part * size):
            if value(low) * begun <= 0.0:
                return _bisected(value, low, at, begun)
    return None


def _bisected(value: Callable[[float], float], low: float, high: float, above: float) -> float:
    """The zero between two arguments, with the value at `high`, to the last digit or HALVINGS of their distance."""
    for _ in range(HALVINGS):
        middle = 0.5 * (low + high)
        if middle in (low, high):
            break
        if value(middle) * above > 0.0:
            high = middle
        else:
            low = middle
    return low


def _perturbed(starter: Starter, t: float, x: Floats, guess: Floats, free: Mask) -> Tries:
    """Everything at once from points around: where a guess lies on a singular point."""
    for beside in around(starter, t, x, free):
        yield rescaled(starter, t, beside, guess, free)


def around(starter: Starter, t: float, x: Floats, free: Mask) -> Iterator[Floats]:
    """Points around, always the same, as long as there is work left."""
    random = np.random.default_rng(20)
    for amplitude in _AMPLITUDES:
        if starter.work.done:
            return
        yield x + np.where(free, amplitude * starter.scale(t, x) * random.standard_normal(x.size), 0.0)


def _in_largest_scales(starter: Starter, t: float, x: Floats, guess: Floats, free: Mask) -> Tries:
    """Everything at once in the largest scales that rows propose, with work of its own; kept where it succeeds."""
    starter.generous = True
    with starter.granted():
        found, holds = rescaled(starter, t, x, guess, free)
    starter.generous = holds
    if holds:
        yield found, True


STRATEGIES: tuple[tuple[str, Strategy], ...] = (
    ("newton", _newton),
    ("rows_as_written", _walked),
    ("homotopy", _led),
    ("between", _between),
    ("perturbed_guess", _perturbed),
    ("largest_scales", _in_largest_scales),
)
"""Globalisation: what is tried, in this order, until all rows hold."""


def applicable(starter: Starter, t: float, x: Floats) -> Iterator[tuple[str, Strategy]]:
    """Of these, what may help from x: rows that are all linear hold at once or nowhere, but for magnitudes."""
    yield STRATEGIES[0]
    bent = bool(starter.settled.form.scales) or bool(_bent(starter, t, x).any())  # slopes of steep laws underflow
    yield from (named for named in STRATEGIES[1:] if bent or named[1] is _in_largest_scales)


def hopeful(
    starter: Starter, t: float, x: Floats, free: Mask, named: Iterable[tuple[str, Strategy]]
) -> Iterator[tuple[str, Strategy]]:
    """Of these, where the first has failed, what helps against linear rows that contradict: other magnitudes."""
    for k, (name, strategy) in enumerate(named):
        if k == 1 and strategy is not _in_largest_scales and contradicting(starter, t, x, free) is not None:
            yield STRATEGIES[-1]
            return
        yield name, strategy


def behind(starter: Starter, t: float, x: Floats, free: Mask) -> Floats | None:
    """A point behind a jump at which all rows hold that must, from x; None where none was found.  A step of 10 V across
    a diode makes steep laws lie far behind it.
    """
    some = {way for _, way in applicable(starter, t, x)}
    ways = (way for way in (_newton, _substituted, _walked, _led, _between) if way is _substituted or way in some)
    with np.errstate(all="ignore"):  # an exponential may be beyond the largest number on the way, where nothing holds
        found, holds = first((found for way in ways for found in way(starter, t, x, x, free)), x)
    return found.x if holds else None
