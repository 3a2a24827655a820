"""A consistent state at t0 from fixed values and guesses.

Unknowns and equations: see starter.py.  Fixed values never move.  Guesses move least: each step is the minimum-norm
solution of the linearised rows around the *guess* (Gauss-Newton, in unknowns scaled by magnitude, rank-deficient rows
tolerated).  Stages: positions onto phi and what else holds between them, then flows and momenta onto the first
derivatives, then everything.  Globalisation is the list STRATEGIES, tried in order until the rows hold; the name of
the one that found it stays with the state.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace

import numpy as np
from sysdyn.runtime.model import core_library as lib
from sysdyn.runtime.model.description import Floats
from sysdyn.runtime.model.failures import InconsistentStart, RowLabel, SolverFailure
from sysdyn.runtime.model.system import LARGE, System
from sysdyn.runtime.numerics.least_change import (
    DENSE,
    FOLDS,
    OutOfTimeError,
    Solution,
    Work,
    in_order,
    least_residual,
    solve,
)
from sysdyn.runtime.numerics.points import distinct
from sysdyn.runtime.start.starter import NOISE, STATE, WEIGHT, Mask, Starter, problem_of
from sysdyn.values import dataclass

_AMPLITUDES = (1e-2, 1e-1, 1.0, 1e-4, 10.0, 1e-6, 1e2, 1e-1, 1.0, 10.0)
_RESCALINGS = 6
_FEW = 3
"""Iterations that show whether what follows from the state is enough: rows that are linear in it take one."""
STAGES: tuple[tuple[tuple[str, ...], tuple[str, ...]], ...] = (
    (("phi",), ("q",)),
    (("phi_rate", "psi"), ("f",)),
    (("momentum",), ("p",)),
    (("phi", "phi_rate", "psi", "momentum"), STATE),
)
"""Groups of rows, and the kinds of unknowns that are moved onto them, one after the other."""
HIDDEN = ("dynamics_rate", "momentum_rate", "phi_rate", "phi_acceleration", "psi_rate", "gamma_rate")
"""Groups of rows that are derivatives of others."""
EXACT = 1e-9
OWN = 1e-6
CLOSED = 1e-12
"""Scaled residual of rows that hold to round-off."""
NEARER = 12
"""Steps towards the least change of the state."""
BACK = 1e-10
"""Steps of this part of the largest alike are round-off of the linear algebra, and tried without."""
FLOOR = 1e-5
"""Of the largest alike: below it rows hold to EXACT of that, ten times the round-off that full matrices make of it."""
EVEN = 1.05
"""Growth of the change of what is not written that a step may bring where nothing else moves less."""
WALKED = 0.2
"""Share of the work of a search that walking down steep laws may take."""
EXPLAINED = 0.1
"""Share of the work of a search that what comes after may take: steadying what was found, explaining what was not."""


@dataclass(frozen=True, slots=True)
class ConsistentState:
    """y, yd [unknowns as written] at t; residual: largest scaled row.

    moved: (name, guess, value, "asked for by ...") of written guesses that moved.  strategy: the one of STRATEGIES that
    found it; "" of a state that was not sought from guesses.
    """

    t: float
    y: Floats
    yd: Floats
    moved: tuple[tuple[str, float, float, str], ...]
    residual: float
    strategy: str = ""

    def for_form(self, system: System) -> tuple[Floats, Floats]:
        """y, yd in the layout of an index form: new multipliers are zero."""
        y, yd = np.zeros(system.unknowns), np.zeros(system.unknowns)
        y[: self.y.size], yd[: self.y.size] = self.y, self.yd
        return y, yd


def _onto(starter: Starter, t: float, x: Floats, guess: Floats, *, rows: Mask, free: Mask) -> Solution | None:
    """The point nearest to the guess on these rows, from x in these unknowns; None where they do not hold."""
    found = solve(problem_of(starter, t, x, guess, rows=rows, free=free), x)
    return found if found.residual < EXACT else None


def _guess(starter: Starter, t: float, guess: Floats, free: Mask) -> Floats:
    """The guess moved onto guessed expressions, as far as constraints and fixed values let it."""
    written = starter.guessed & ~starter.unsaid
    if not written.any():
        return guess
    free = free & (np.arange(free.size) < starter.n)
    # an expression gives its own unknown where the others are guessed by numbers: of several roots that one is meant
    own = free & ~starter.written
    given = _onto(starter, t, guess, guess, rows=written, free=own) if own.any() else None
    guess = guess if given is None else given.x
    rows = written | starter.groups("phi", "psi")
    found = solve(problem_of(starter, t, guess, guess, rows=rows, free=free), guess)
    if found.residual < EXACT or (np.isfinite(found.residual) and given is None):
        guess = found.x
    # of a flow that an expression guesses, the momentum is guessed with it
    momenta = free & starter.moves(("p",)) & ~starter.written
    moved = _onto(starter, t, guess, guess, rows=starter.groups("momentum"), free=momenta)
    return guess if moved is None else moved.x


def _stages(starter: Starter, t: float, x: Floats, guess: Floats, free: Mask) -> Floats:
    """Positions, flows, momenta one after the other, each the nearest to its guess with those before it held.

    What follows from the state moves alone where that is enough.
    """
    for groups, moving in STAGES:
        rows, may = starter.groups(*groups), free & starter.moves(moving)
        for use in (rows | starter.between(moving), rows):
            if not use.any() or not may.any():
                continue
            problem = problem_of(starter, t, x, guess, rows=use, free=may)
            found = solve(problem.within(may & starter.following(t, x)), x, _FEW)
            found = found if found.residual < EXACT else solve(problem, x)
            if found.residual < EXACT:
                x = starter.without_noise(found.x, problem.scale)
                break
    return x


def _rescaled(starter: Starter, t: float, x: Floats, guess: Floats, free: Mask) -> tuple[Solution, bool]:
    """Everything at once, and whether it holds.

    Magnitudes that proved wrong (currents of 1e-12 A at the guess, a diode at 2 V) are taken anew: the rows must hold
    in the magnitudes of the solution too.
    """
    at, best = x, Solution(x, np.inf, np.zeros(0))
    empty = None
    for k in range(_RESCALINGS):
        if k and starter.work.done:
            break
        scale = starter.scale(t, at)
        found = solve(problem_of(starter, t, at, guess, rows=starter.every, free=free), best.x)
        if empty is not None and found.residual >= EXACT and not found.residual < best.residual:
            if at is empty:
                break
            at = empty
            continue
        best = found
        if not np.isfinite(best.residual):
            break
        at = starter.without_noise(best.x, scale)
        # what is far below its magnitude may be zero, which has none of its own
        empty = np.where(free & (np.abs(at) < OWN * scale), 0.0, at)
        for candidate in (at, empty) if best.residual < EXACT else ():
            if _own(starter, t, candidate, candidate) < OWN:
                return Solution(candidate, best.residual, best.scaled), True
            if candidate is at and _own(starter, t, at, best.x) < OWN:
                return best, True
    return best, False


def _own(starter: Starter, t: float, magnitudes: Floats, x: Floats) -> float:
    """Largest residual at x of the rows that must hold, relative to their terms in magnitudes of a solution."""
    size = starter.row_scale(t, magnitudes, starter.scale(t, magnitudes))[starter.every]
    return float(np.max(np.abs(starter.residual(t, x)[starter.every]) * size, initial=0.0))


def _beside_gammas(starter: Starter, t: float, x: Floats, guess: Floats, free: Mask) -> Floats:
    """X with everything else as the implicit unknowns at their guesses make it: of two roots of a gamma the iteration
    then begins at that of the guess.

    Left out are gammas that are not linear, held what their text guesses of implicit unknowns (all that stand in them,
    where it guesses none).
    """
    implicit = starter.moves(("e",))
    gammas = starter.groups("gamma")
    if not gammas.any() or not implicit.any():
        return x
    bent = _bent(starter, t, x) & gammas
    own = bent[starter.rows] & implicit[starter.columns]
    own_rows, own_columns = starter.rows[own], starter.columns[own]
    said = np.zeros(starter.settled.rows, dtype=bool)
    said[own_rows[starter.written[own_columns]]] = True
    held = np.zeros(x.size, dtype=bool)
    held[own_columns[starter.written[own_columns] | ~said[own_rows]]] = True
    if not held.any():
        return x
    rows = starter.every & ~bent & ~starter.groups("gamma_rate")
    may = free & ~held & starter.following(t, x)
    problem = problem_of(starter, t, x, guess, rows=rows, free=may)
    found = solve(problem, x)
    return starter.without_noise(found.x, problem.scale) if found.residual < EXACT else x


def _bent(starter: Starter, t: float, x: Floats) -> Mask:
    """Rows that are not linear."""
    here, there = (starter.jacobian(t, z) for z in (x, x + 1e-3 * starter.scale(t, x)))
    bent = np.zeros(starter.settled.rows, dtype=bool)
    bent[starter.rows[here != there]] = True
    return bent


def _steadied(starter: Starter, t: float, best: Solution, guess: Floats, free: Mask) -> Solution:
    """The solution without what guesses of the state moved for the sake of what follows from it: that costs nothing.

    The least change of contents under all rows, of what the text guesses first, then of the rest, by steps to the least
    of the rows linearised; what follows from the state is free.  Positions in curved constraints are left alone, and
    what is too large for full matrices.
    """
    if best.x.size > DENSE:
        return best
    clean = _without_noise(starter, t, best.x, guess, free)
    best = best if clean is None else replace(best, x=clean)
    last = np.inf
    for _ in range(NEARER):
        found, moved = _nearer(starter, t, best, guess, free)
        if found is None or not moved < 0.5 * last:
            break
        best, last = found, moved
        if moved < CLOSED:
            break
    return best


def _closed(starter: Starter, t: float, best: Solution, free: Mask) -> Solution:
    """The nearest point to a solution on which rows that it misses by more than round-off hold: a guess rounded to ten
    digits satisfies rows as far as a search asks, and a stiff model pays for the rest with its first step.
    """
    if best.residual <= CLOSED:
        return best
    found = solve(problem_of(starter, t, best.x, best.x, rows=starter.every, free=free), best.x)
    clean = _without_noise(starter, t, found.x, best.x, free) if found.residual < best.residual else None
    return best if clean is None else replace(found, x=clean)


def _nearer(
    starter: Starter, t: float, best: Solution, guess: Floats, free: Mask
) -> tuple[Solution | None, float]:
    """One step of it, and how far it went in units of magnitudes; None where there is none."""
    x = best.x
    follows = starter.following(t, x) | starter.idle
    follows[starter.carried()] = True
    if not (x != guess)[free & ~follows].any():
        return None, 0.0
    curved = np.zeros(x.size, dtype=bool)
    bent = _bent(starter, t, x) & starter.groups("phi")
    curved[starter.columns[bent[starter.rows]]] = True
    free = free & ~(curved & starter.moves(("q",)))
    state = free & ~follows
    if not (x != guess)[state].any():
        return None, 0.0
    problem = problem_of(starter, t, x, guess, rows=starter.every, free=free)
    # rows of what is small beside the largest of its kind hold to the round-off that full matrices make of that
    largest = starter.largest_alike(np.maximum(problem.scale, np.abs(x)))
    scale = np.maximum(problem.scale, FLOOR * largest)
    weight = np.where(state, starter.by_content(t, x, scale), WEIGHT["following"] * scale / largest)
    problem = replace(problem, scale=scale, weight=weight)
    levels = state & starter.written, state & ~starter.written
    aim = in_order(problem, x, levels)
    size = np.maximum(problem.scale, starter.scale(t, guess))

    def change(z: Floats) -> list[float]:
        moved = (z - guess) * problem.weight / problem.scale
        return [float(np.linalg.norm(moved[level])) for level in levels]

    said, unsaid = change(x)
    for stays in (BACK * np.maximum(size, largest), NOISE * size):
        near = np.where(np.abs(aim - guess) > stays, aim, guess)
        found = solve(problem.within(free & ~state), np.where(state, near, x))
        clean = _without_noise(starter, t, found.x, guess, free) if found.residual < EXACT else None
        now = (np.inf, np.inf) if clean is None else change(clean)
        less = now[0] < (1.0 - NOISE) * said or (now[0] <= (1.0 + BACK) * said and now[1] <= EVEN * unsaid)
        if clean is not None and less:
            return replace(found, x=clean), float((np.abs(clean - x)[state] / size[state]).max(initial=0.0))
    return None, 0.0


def _without_noise(starter: Starter, t: float, x: Floats, guess: Floats, free: Mask) -> Floats | None:
    """A solution with zeros where it is round-off of the magnitudes that the guesses make, or of what is alike; or as
    it is.  The first that holds in its own magnitudes; None where none does.
    """
    z = starter.without_noise(x, starter.scale(t, x))
    empty = np.where(free & (np.abs(z) < NOISE * starter.scale(t, guess)), 0.0, z)
    return next((c for c in (empty, z, x) if _own(starter, t, c, c) < OWN), None)


Strategy = Callable[[Starter, float, Floats, Floats, Mask], tuple[Solution, bool]]
"""From t, a staged point x, the guess and the free unknowns: the best solution, and whether all rows hold."""


def _newton(starter: Starter, t: float, x: Floats, guess: Floats, free: Mask) -> tuple[Solution, bool]:
    """The state stays as staged, what follows from it by Newton's method."""
    return _rescaled(starter, t, x, guess, free & starter.following(t, x))


def _walked(starter: Starter, t: float, x: Floats, guess: Floats, free: Mask) -> tuple[Solution, bool]:
    """Down steep laws on the rows as written and such derivatives as are linear, with a share of work of its own; then
    everything at once.  Far from a solution the derivative of an exponential hides what itself is after.
    """
    own, starter.work = starter.work, Work(WALKED, starter.work.until)
    rows = starter.every & ~(starter.groups(*HIDDEN) & _bent(starter, t, x))
    for _ in range(_RESCALINGS):
        found = solve(problem_of(starter, t, x, guess, rows=rows, free=free), x, folds=FOLDS)
        if not np.isfinite(found.residual) or (found.x == x).all():
            break
        x = found.x
    # what round-off left is no magnitude; rates follow from the rest by linear rows
    x = starter.without_noise(x, starter.scale(t, x))
    starter.work = own
    return _rescaled(starter, t, np.where(starter.moves(("rate",)), guess, x), guess, free)


def _perturbed(starter: Starter, t: float, x: Floats, guess: Floats, free: Mask) -> tuple[Solution, bool]:
    """Everything at once from points around, always the same, as long as there is work left: where a guess lies on a
    singular point.
    """
    best, holds, random = Solution(x, np.inf, np.zeros(0)), False, np.random.default_rng(20)
    for amplitude in _AMPLITUDES:
        if holds or starter.work.done:
            break
        shaken = x + np.where(free, amplitude * starter.scale(t, x) * random.standard_normal(x.size), 0.0)
        found, holds = _rescaled(starter, t, shaken, guess, free)
        best = found if holds or found.residual < best.residual else best
    return best, holds


def _in_largest_scales(starter: Starter, t: float, x: Floats, guess: Floats, free: Mask) -> tuple[Solution, bool]:
    """Everything at once in the largest scales that rows propose, with work of its own; kept where it succeeds."""
    own, starter.work, starter.generous = starter.work, Work(until=starter.work.until), True
    found, holds = _rescaled(starter, t, x, guess, free)
    starter.work, starter.generous = own, holds
    return (found if holds else replace(found, residual=np.inf)), holds


STRATEGIES: tuple[tuple[str, Strategy], ...] = (
    ("newton", _newton),
    ("all_unknowns", _rescaled),
    ("rows_as_written", _walked),
    ("perturbed_guess", _perturbed),
    ("largest_scales", _in_largest_scales),
)
"""Globalisation: what is tried, in this order, until all rows hold."""


def _attempt(starter: Starter, t: float, guess: Floats, free: Mask) -> tuple[Solution, str]:
    """The first strategy that holds from the staged state, and its name; the least residual and "" where none does."""
    starter.plain = True
    x = _stages(starter, t, guess.copy(), guess, free)
    x = _beside_gammas(starter, t, x, guess, free)
    best = Solution(x, np.inf, np.zeros(0))
    for name, strategy in STRATEGIES:
        starter.plain = name == "newton"
        found, holds = strategy(starter, t, x, guess, free)
        if holds:
            return found, name
        # what follows alone is no point to explain a failure at
        best = found if name == "all_unknowns" or found.residual < best.residual else best
    return best, ""


def _asked(starter: Starter, t: float, x: Floats, place: int) -> str:
    """Labels of the constraint rows that an unknown stands in."""
    found: list[str] = []
    values = starter.jacobian(t, x)
    hit = distinct(starter.rows[(starter.columns == place) & (values != 0.0)])
    for row in hit[~starter.unsaid[hit]]:
        label = starter.settled.row_label(int(row))
        base = label.kind.split("_")[0]
        text = f"{base} {label.label}"
        if base in ("phi", "psi", "gamma", "momentum", "initial") and text not in found:
            found.append(text)
    return "asked for by " + ", ".join(found[:4]) if found else "asked for by the balance of efforts"


def _moved(starter: Starter, t: float, x: Floats, scale: Floats) -> tuple[tuple[str, float, float, str], ...]:
    given = starter.given
    change = np.abs(x[: starter.n] - given.guess)
    places = np.flatnonzero(
        given.written & ~given.fixed & (change > 1e-9 * np.maximum(np.abs(given.guess), 1e-3 * scale[: starter.n]))
    )
    found = [
        (starter.system.name(int(k)), float(given.guess[k]), float(x[k]), _asked(starter, t, x, int(k)))
        for k in places[:100]
    ]
    return (*found, *_missed(starter, t, x, scale))


def _missed(starter: Starter, t: float, x: Floats, scale: Floats) -> Iterator[tuple[str, float, float, str]]:
    """Guesses by expressions that the start does not meet: name of what the expression guesses, its value, the start's.

    Where a row guesses several unknowns at once its label stands for them, and 0 for what it would miss.
    """
    rows = starter.guessed & ~starter.unsaid
    if not rows.any():
        return
    misses = starter.settled.residual(t, *starter.expand(x))
    size = starter.row_scale(t, x, scale)
    values = starter.jacobian(t, x)
    for row in np.flatnonzero(rows & (np.abs(misses) * size > 1e-9))[:100]:
        mine = (starter.rows == row) & (starter.columns < starter.n) & (values != 0.0)
        own = mine & ~starter.written[starter.columns]
        if own.sum() == 1:
            (entry,) = np.flatnonzero(own)
            k = int(starter.columns[entry])
            guess = float(x[k] - misses[row] / values[entry])
            yield starter.system.name(k), guess, float(x[k]), _asked(starter, t, x, k)
        else:
            label = starter.settled.row_label(int(row))
            yield f"guess of line {label.line}", 0.0, float(misses[row]), "what its two sides differ by"


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
        change = np.abs(freed.x - guess)[: starter.n] / scale[: starter.n] * starter.given.fixed
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
    guess = np.concatenate([starter.given.guess, np.zeros(starter.equations.unknowns - starter.n)])
    if near is not None:  # but for its multipliers, which redundant rows make as large as they like
        y = np.where(system.are(*STATE, "e")[: starter.n], near.y, starter.given.guess)
        guess = starter.unknowns(t0, y, np.zeros(starter.n))
    free = np.append(~starter.given.fixed, np.ones(guess.size - starter.n, dtype=bool))
    guess = _guess(starter, t0, guess, free)
    best, strategy = _attempt(starter, t0, guess, free)
    if not strategy:
        raise _explain(starter, t0, guess, free, best)
    starter.work = Work(EXPLAINED, until)
    best = _closed(starter, t0, _steadied(starter, t0, best, guess, free), free)
    y, yd = starter.expand(best.x)
    moved = _moved(starter, t0, best.x, starter.scale(t0, best.x))
    if best.x.size > LARGE:
        starter.forget()
        del starter, guess, free
        lib.core.sd_trim()
    return ConsistentState(t0, y, yd, moved, best.residual, strategy)
