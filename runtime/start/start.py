"""A consistent state at t0 from fixed values and guesses.

Unknowns and equations: see starter.py.  Fixed values never move.  Guesses move least, those of the text first, then
what no text says of stores, then displacements that hold nothing; what follows from these moves freely: each step is
the least change from the *guess* on the linearised rows in this order (Gauss-Newton, in unknowns scaled by magnitude,
rank-deficient rows tolerated; by weights where matrices are sparse).  Globalisation is the list STRATEGIES, tried in
order until the rows hold; the name of the one that found it stays with the state.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace

import numpy as np
from sysdyn.runtime.model.description import Floats
from sysdyn.runtime.model.failures import InconsistentStart, RowLabel, SolverFailure
from sysdyn.runtime.model.patterns import read_only
from sysdyn.runtime.model.system import LARGE, System
from sysdyn.runtime.numerics.least_change import (
    DENSE,
    FOLDS,
    SINGULAR_VALUES,
    OutOfTimeError,
    Solution,
    Work,
    corrected,
    least_residual,
    solve,
    stepped,
)
from sysdyn.runtime.start.moved import moved_guesses
from sysdyn.runtime.start.starter import NOISE, STATE, Mask, Starter, problem_of
from sysdyn.values import dataclass

_AMPLITUDES = (1e-2, 1e-1, 1.0, 1e-4, 10.0, 1e-6, 1e2, 1e-1, 1.0, 10.0)
_RESCALINGS = 6
HIDDEN = ("dynamics_rate", "momentum_rate", "phi_rate", "phi_acceleration", "psi_rate", "gamma_rate")
"""Groups of rows that are derivatives of others."""
EXACT = 1e-9
OWN = 1e-6
CLOSED = 1e-12
"""Scaled residual of rows that hold to round-off."""
BACK = 1e-10
"""Steps of this part of the largest alike are round-off of the linear algebra, and tried without."""
WALKED = 0.2
"""Share of the work of a search that walking down steep laws may take."""
LEAST_PART = 1e-6
"""Of misses: less is not faded out at once."""
SHARPER = 60
"""Corrections in which what follows from the state is found, or left as it was."""
FOLLOWED, NEARLY = 12, 1e-4
"""Iterations in which Newton's method follows what fades, and the scaled residual at which it has."""
EXPLAINED = 0.1
"""Share of the work of a search that explaining what was not found may take."""


@dataclass(frozen=True, slots=True)
class ConsistentState:
    """y, yd [unknowns as written] at t; residual: largest scaled row.

    moved: (name, guess, value, "asked for by ...") of written guesses that moved.  strategy: the one of STRATEGIES that
    found it; "" of a state that was not sought from guesses.  zeros: where y is what the search left of a zero (None:
    nowhere), by which nothing else is sized: a slope made of such a current would have 1e19 K balance a voltage.
    """

    t: float
    y: Floats
    yd: Floats
    moved: tuple[tuple[str, float, float, str], ...]
    residual: float
    strategy: str = ""
    zeros: Mask | None = None

    def for_form(self, system: System) -> tuple[Floats, Floats]:
        """y, yd in the layout of an index form: new multipliers are zero.  Read-only where they are the state's own."""
        if system.unknowns == self.y.size:
            return read_only(self.y[:]), read_only(self.yd[:])
        y, yd = np.zeros(system.unknowns), np.zeros(system.unknowns)
        y[: self.y.size], yd[: self.y.size] = self.y, self.yd
        return y, yd

    def without_noise(self, y: Floats) -> Floats:
        """Its y in any layout with these zeros."""
        if self.zeros is None:
            return y
        clean = y.copy()
        clean[: self.zeros.size][self.zeros] = 0.0
        return clean


def _onto(starter: Starter, t: float, x: Floats, guess: Floats, *, rows: Mask, free: Mask) -> Floats:
    """The point nearest to the guess on these rows, from x in these unknowns; x where they do not hold."""
    if not (rows.any() and free.any()):
        return x
    found = solve(problem_of(starter, t, x, guess, rows=rows, free=free), x)
    return found.x if found.residual < EXACT else x


def _begun(starter: Starter, t: float, guess: Floats, free: Mask) -> Floats:
    """Where the iteration begins, on the roots that are meant: what written expressions give where the others are as
    guessed, then what follows beside implicit unknowns at their guesses.
    """
    own = free & ~starter.written & (np.arange(free.size) < starter.n)
    x, held = _onto(starter, t, guess, guess, rows=starter.told, free=own), starter.moves("e") & starter.written
    if not held.any():
        return x
    rows, may = starter.every & ~starter.groups("gamma", "gamma_rate"), free & ~held & starter.following(t, x)
    return starter.without_noise(_onto(starter, t, x, guess, rows=rows, free=may), starter.scale(t, x))


def _rescaled(
    starter: Starter, t: float, x: Floats, guess: Floats, free: Mask, *, least: bool = True, sized: Floats | None = None
) -> tuple[Solution, bool]:
    """Everything at once from x, and whether it holds; magnitudes are those of `sized` at first (None: x).

    Magnitudes that proved wrong (currents of 1e-12 A at the guess, a diode at 2 V) are taken anew: the rows must hold
    in the magnitudes of the solution too.
    """
    at, best = x if sized is None else sized, Solution(x, np.inf, np.zeros(0))
    for k in range(_RESCALINGS):
        if k and starter.work.done:
            break
        problem = problem_of(starter, t, at, guess, rows=starter.every, free=free, least=least)
        best = solve(problem, best.x)
        if not np.isfinite(best.residual):
            break
        at = starter.without_noise(best.x, problem.scale)
        if best.residual < EXACT:
            clean = next((c for c in (at, best.x) if _own(starter, t, at, c) < OWN), None)
            if clean is not None:
                return replace(best, x=clean), True
    return best, False


def _own(starter: Starter, t: float, magnitudes: Floats, x: Floats) -> float:
    """Largest residual at x of the rows that must hold, relative to their terms in magnitudes of a solution: those of
    noise beside their like are no less than that.
    """
    scale = np.maximum(starter.scale(t, magnitudes), NOISE * starter.largest_alike(magnitudes))
    size = starter.row_scale(t, magnitudes, scale)[starter.every]
    return float(np.max(np.abs(starter.residual(t, x)[starter.every]) * size, initial=0.0))


def _bent(starter: Starter, t: float, x: Floats) -> Mask:
    """Rows that are not linear."""
    here, there = (starter.jacobian(t, z) for z in (x, x + 1e-3 * starter.scale(t, x)))
    bent = np.zeros(starter.settled.rows, dtype=bool)
    bent[starter.rows[here != there]] = True
    return bent


def _anew(
    starter: Starter, t: float, best: Solution, x: Floats, guess: Floats, free: Mask
) -> tuple[Solution, bool]:
    """The solution with its state to round-off, in its own magnitudes, and what follows found from x as where no state
    moves: neither depends on the way here; whether that holds.  What is too large for full matrices is left alone.
    """
    there = best.x
    state = free & ~starter.following(t, there)
    if best.residual >= EXACT or there.size > DENSE or not (there != guess)[state].any():
        return best, False
    near = stepped(problem_of(starter, t, there, guess, rows=starter.every, free=free, least=True), there)
    largest = starter.largest_alike(np.maximum(starter.scale(t, guess), np.abs(near)))
    near = np.where(np.abs(near - there) <= NOISE * largest, there, near)
    back = np.where(np.abs(near - guess) <= BACK * largest, guess, near)
    for moved in (back, near):
        found, holds = _rescaled(starter, t, np.where(state, moved, x), guess, free & ~state, least=False)
        if holds and found.residual <= max(CLOSED, best.residual):
            return found, True
    return best, False


def _sharp(starter: Starter, t: float, best: Solution, free: Mask) -> Solution:
    """The solution with what follows from its state by corrections that vanish, where rows determine them: what only
    leakage ties moves by volts under rows that hold to round-off of the largest current.
    """
    if best.x.size > SINGULAR_VALUES:
        return best
    x, follows = best.x, free & starter.following(t, best.x)
    for k in range(SHARPER):
        problem = problem_of(starter, t, x, x, rows=starter.every, free=follows)
        near = corrected(problem, x)
        if near is None or starter.work.done:
            break
        if (np.abs(near - x) <= EXACT * np.maximum(problem.scale, np.abs(x))).all():
            return solve(problem, x, 1) if k else best
        x = near
    return best


Tries = Iterator[tuple[Solution, bool]]
Strategy = Callable[[Starter, float, Floats, Floats, Mask], Tries]
"""From t, a point x to begin at, the guess and the free unknowns: solutions, each with whether all rows hold."""


def _first(tries: Tries, x: Floats) -> tuple[Solution, bool]:
    """The first at which all rows hold, else the one of the least residual; x where there is none."""
    best = Solution(x, np.inf, np.zeros(0))
    for found, holds in tries:
        if holds:
            return found, True
        best = found if found.residual < best.residual else best
    return best, False


def _beyond(starter: Starter, t: float, x: Floats, free: Mask) -> bool:
    """Whether rows that read none of these unknowns are missed: loops of springs, constraints of the state."""
    known = starter.equations
    read = np.bincount(known.rows, known.structural & free[known.columns], starter.settled.rows)
    missed = np.where((read == 0) & ~known.unsettled, np.abs(starter.residual(t, x)), 0.0)
    return bool(missed.any() and (missed * starter.row_scale(t, x, starter.scale(t, x)) > OWN).any())


def _newton(starter: Starter, t: float, x: Floats, guess: Floats, free: Mask) -> Tries:
    """What follows from the state alone, by Newton's method; where that is not enough everything, the least first: a
    guess rounded to ten digits satisfies rows nearly, and a stiff model pays for the rest with its first step.
    """
    follows, nearly = free & starter.following(t, x), False
    if not _beyond(starter, t, x, follows):
        found, nearly = _rescaled(starter, t, x, guess, follows, least=False)
        exact = nearly and (found.residual <= CLOSED or _own(starter, t, found.x, found.x) <= CLOSED)
        yield found, exact
    yield _rescaled(starter, t, x, guess, free)
    if nearly:
        yield found, True


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
        found, holds = _rescaled(starter, t, x, x, rates, least=False, sized=sized)
        if holds:
            return found, holds
        x = found.x
    return _rescaled(starter, t, x, guess, free, sized=sized)


def _walked(starter: Starter, t: float, x: Floats, guess: Floats, free: Mask) -> Tries:
    """Down steep laws on the rows as written, with a share of work of its own; then everything."""
    rows = _as_written(starter, t, x)
    with starter.granted(WALKED):
        for _ in range(_RESCALINGS):
            found = solve(problem_of(starter, t, x, guess, rows=rows, free=free), x, folds=FOLDS)
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


def _perturbed(starter: Starter, t: float, x: Floats, guess: Floats, free: Mask) -> Tries:
    """Everything at once from points around, always the same, as long as there is work left: where a guess lies on a
    singular point.
    """
    random = np.random.default_rng(20)
    for amplitude in _AMPLITUDES:
        if starter.work.done:
            return
        shaken = x + np.where(free, amplitude * starter.scale(t, x) * random.standard_normal(x.size), 0.0)
        yield _rescaled(starter, t, shaken, guess, free)


def _in_largest_scales(starter: Starter, t: float, x: Floats, guess: Floats, free: Mask) -> Tries:
    """Everything at once in the largest scales that rows propose, with work of its own; kept where it succeeds."""
    starter.generous = True
    with starter.granted():
        found, holds = _rescaled(starter, t, x, guess, free)
    starter.generous = holds
    if holds:
        yield found, True


STRATEGIES: tuple[tuple[str, Strategy], ...] = (
    ("newton", _newton),
    ("rows_as_written", _walked),
    ("homotopy", _led),
    ("perturbed_guess", _perturbed),
    ("largest_scales", _in_largest_scales),
)
"""Globalisation: what is tried, in this order, until all rows hold."""


def behind(starter: Starter, t: float, x: Floats, free: Mask) -> Floats | None:
    """A point behind a jump at which all rows hold that must, from x; None where none was found.  A step of 10 V across
    a diode makes steep laws lie far behind it.
    """
    tries = (found for strategy in (_newton, _walked, _led) for found in strategy(starter, t, x, x, free))
    found, holds = _first(tries, x)
    return found.x if holds else None


def _attempt(starter: Starter, t: float, guess: Floats, free: Mask) -> tuple[Solution, str]:
    """The first strategy that holds, from the guess, and its name; the least residual and "" where none does."""
    x = _begun(starter, t, guess, free)
    best = Solution(x, np.inf, np.zeros(0))
    for name, strategy in STRATEGIES:
        found, holds = _first(strategy(starter, t, x, guess, free), x)
        again, sure = _anew(starter, t, found, x, guess, free)
        if holds or sure:
            return _sharp(starter, t, again, free), name
        best = found if found.residual < best.residual else best
    return best, ""


def _explain(starter: Starter, t: float, guess: Floats, free: Mask, best: Solution) -> InconsistentStart:
    """Why there is no consistent state: rows in the way, and the fixed values that would have to move."""
    if not np.isfinite(best.residual):
        bad = np.flatnonzero(~np.isfinite(starter.residual(t, guess)))
        rows = tuple(starter.settled.row_label(int(row)) for row in bad[:5])
        return InconsistentStart("nonfinite", float("inf"), rows)
    starter.work = Work(EXPLAINED, starter.work.until)
    x, scaled = best.x, best.scaled
    if x.size <= DENSE:
        problem = problem_of(starter, t, guess, guess, rows=starter.every, free=free)
        x = least_residual(problem, x)
        scaled = np.abs(starter.residual(t, x)) * starter.row_scale(t, x, problem.scale)
    raw, scaled = (np.where(starter.every, item, 0.0) for item in (np.abs(starter.residual(t, x)), scaled))
    order = np.argsort(-scaled)
    worst = [int(row) for row in order[:5] if scaled[row] > 0.1 * scaled[order[0]]]
    rows = tuple(dict.fromkeys(starter.settled.row_label(row) for row in worst))
    freed, found = _attempt(starter, t, guess, np.ones_like(free))
    candidates: tuple[RowLabel, ...] = ()
    # rows that hold to round-off at some point contradict nothing: it was the search that failed
    contradict = bool(scaled[order[0]] > OWN)
    if found and contradict:
        scale = starter.scale(t, freed.x)
        change = np.where(starter.free, 0.0, np.abs(freed.x - guess) / scale)
        places = [int(k) for k in np.argsort(-change)[:5] if change[k] > 1e-9]
        candidates = tuple(dict.fromkeys(starter.given.label(k) for k in places))
    kind = "fixed"
    if not candidates:
        kind = "gamma" if rows and rows[0].kind.startswith("gamma") else "stuck"
        if contradict and rows and rows[0].kind.startswith(("phi", "psi", "initial")):
            kind = "fixed"
    return InconsistentStart(kind, float((scaled if kind == "stuck" else raw)[order[0]]), rows, candidates)


def consistent_start(
    system: System, t0: float, near: ConsistentState | None = None, until: float | None = None
) -> ConsistentState:
    """A state at t0 that satisfies all rows and their hidden derivatives.

    system: any index form of the model; near: a state to stay close to, else the guesses; until: `time.monotonic()` at
    which the search is given up.  Raises InconsistentStart; SolverFailure (max_wall).
    """
    try:
        return _consistent(system, t0, near, until)
    except OutOfTimeError as error:
        raise SolverFailure("max_wall", t0, 0.0) from error


def _consistent(system: System, t0: float, near: ConsistentState | None, until: float | None) -> ConsistentState:
    """The same; OutOfTimeError."""
    system = system if system.form.name == "3" else system.another("3")
    starter = Starter(system)
    starter.work = Work(until=until)
    guess = starter.guess
    if near is not None:  # but for its multipliers, which redundant rows make as large as they like
        y = np.where(system.are(*STATE, "e"), near.y, starter.given.guess[: system.unknowns])
        guess = starter.unknowns(t0, y, np.zeros(y.size))
    best, strategy = _attempt(starter, t0, guess, starter.free)
    if not strategy:
        raise _explain(starter, t0, guess, starter.free, best)
    y, yd = starter.expand(best.x)
    moved = tuple(moved_guesses(starter, t0, best.x, starter.scale(t0, best.x)))
    largest = np.maximum(starter.scale(t0, guess), starter.largest_alike(best.x))
    zeros = (np.abs(best.x) <= EXACT * largest)[: y.size]
    if best.x.size > LARGE:
        starter.forget()
        del starter, guess
        system.trim()
    return ConsistentState(t0, y, yd, moved, best.residual, strategy, zeros)
