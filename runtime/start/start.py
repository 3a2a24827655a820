"""A consistent state at t0 from fixed values and guesses.

Unknowns and equations: see starter.py.  Fixed values never move.  Guesses move least, those of the text first, then
what no text says of stores, then displacements that hold nothing; what follows from these moves freely: each step is
the least change from the *guess* on the linearised rows in this order (Gauss-Newton, in unknowns scaled by magnitude,
rank-deficient rows tolerated; by weights where matrices are sparse).  The strategies of globalisation (strategies.py)
are tried in order until the rows hold; the name of the one that found it stays with the state.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence

import numpy as np
from sysdyn.runtime import tuning
from sysdyn.runtime.model.description import Floats, Ints, Places
from sysdyn.runtime.model.failures import InconsistentStart, RowLabel, SolverFailure
from sysdyn.runtime.model.held_rows import switch_rows
from sysdyn.runtime.model.inertia import own_unknown
from sysdyn.runtime.model.patterns import read_only
from sysdyn.runtime.model.slopes import labels, rows_without_slope
from sysdyn.runtime.model.system import LARGE, System
from sysdyn.runtime.numerics.gauss_newton import Solution, least_residual, solve
from sysdyn.runtime.numerics.least_change import DENSE
from sysdyn.runtime.numerics.rank import NotFiniteError
from sysdyn.runtime.numerics.stretches import Stretches, whole_of
from sysdyn.runtime.numerics.tall import free_unknowns
from sysdyn.runtime.numerics.work import Budget, OutOfTimeError, Work
from sysdyn.runtime.start.corrections import EXACT
from sysdyn.runtime.start.exact import anew, sharp
from sysdyn.runtime.start.flat import OWN, off_the_flat, unasked, without_rates
from sysdyn.runtime.start.held import FARTHER
from sysdyn.runtime.start.least import problem_of
from sysdyn.runtime.start.linearly import contradicting, no_start
from sysdyn.runtime.start.moved import moved_guesses
from sysdyn.runtime.start.starter import STATE, Mask, Starter
from sysdyn.runtime.start.strategies import (
    applicable,
    around,
    first,
)
from sysdyn.values import dataclass

NOTHING = 1e-100
"""Of any unit: what an iteration down a steep law leaves of zero."""
HELD = "#held "
"""Before the name of a coordinate: what its flow and others hold together (compiler/forms/lowering.py)."""
MOVED = tuning.UNSEEN
"""Of its magnitude: what a fixed value that is in the way has to move by, at least."""
BESIDE = tuning.SMALL
"""Of the move of the fixed value most in the way: what moves by less is not."""
QUICK = 0.3
"""Times what a search may take: what one may that is asked for quickly; those that succeed take at most 0.1."""
EXPLAINED = 0.1
"""Share of the work of a search that explaining what was not found may take."""


@dataclass(frozen=True, slots=True)
class ConsistentState:
    """held_y, held_yd: y, yd [unknowns as written] at t; residual: largest scaled row.

    moved: (name, guess, value, "asked for by ...") of written guesses that moved.  strategy: the one of STRATEGIES that
    found it; "" of a state that was not sought from guesses.  zeros: where y is what the search left of a zero (None:
    nowhere), by which nothing else is sized: a slope made of such a current would have 1e19 K balance a voltage.
    kept: whether all that carries the state is as the text guesses it; far: of a small model how far it is from there,
    by level (least.py).  sampled: it is the point behind the samples that are due at t.
    """

    t: float
    held_y: Floats | Stretches[np.float64]
    held_yd: Floats | Stretches[np.float64]
    moved: tuple[tuple[str, float, float, str], ...]
    residual: float
    strategy: str = ""
    zeros: Mask | Stretches[np.bool_] | None = None
    kept: bool = True
    far: tuple[float, ...] = ()
    sampled: bool = False

    def farther(self, other: ConsistentState) -> bool:
        """Whether it is farther from the guess than another state of the model, by what moves least."""
        # one that kept its guesses is nearer than one that moved
        if self.kept or other.kept:
            return other.kept and not self.kept
        apart = (a - b for a, b in zip(self.far, other.far, strict=True))
        return next((d for d in apart if abs(d) > FARTHER), 0.0) > 0.0

    @property
    def y(self) -> Floats:
        """Made where it is held by its stretches."""
        return whole_of(self.held_y)

    @property
    def yd(self) -> Floats:
        """As y."""
        return whole_of(self.held_yd)

    def put_away(self) -> None:
        """Of a large model: nobody reads the point for a while."""
        for name, array in (("held_y", self.y), ("held_yd", self.yd)):
            object.__setattr__(self, name, Stretches(array))  # the same point

    def for_form(self, system: System) -> tuple[Floats, Floats]:
        """y, yd in the layout of an index form: new multipliers are zero.  Read-only where they are the state's own."""
        own, own_d = self.y, self.yd
        # a form of the same size
        if system.unknowns == own.size:
            return read_only(own[:]), read_only(own_d[:])
        y, yd = np.zeros(system.unknowns), np.zeros(system.unknowns)
        y[: own.size], yd[: own.size] = own, own_d
        return y, yd

    def without_noise(self, y: Floats) -> Floats:
        """Its y in any layout with these zeros."""
        # no zero is known as round-off
        if self.zeros is None:
            return y
        clean, zeros = y.copy(), whole_of(self.zeros)
        clean[: zeros.size][zeros] = 0.0
        return clean


def _onto(starter: Starter, t: float, x: Floats, guess: Floats, *, rows: Mask, free: Mask) -> Floats:
    """The point nearest to the guess on these rows, from x in these unknowns; x where they do not hold."""
    # no rows, or nothing free
    if not (rows.any() and free.any()):
        return x
    found = solve(problem_of(starter, t, x, guess, rows=rows, free=free), x)
    return found.x if found.residual < EXACT else x


def _starting_point(starter: Starter, t: float, guess: Floats, free: Mask) -> Floats:
    """Where the iteration begins, on the roots that are meant: what written expressions give where the others are as
    guessed, then what follows beside implicit unknowns at their guesses.
    """
    # expressions that are written, then what follows
    own = free & ~starter.written & (np.arange(free.size) < starter.n)
    x, held = _onto(starter, t, guess, guess, rows=starter.told, free=own), starter.moves("e") & starter.written
    # no effort was guessed
    if not held.any():
        return x
    rows, may = (
        starter.every & ~starter.groups("gamma", "gamma_rate", "gamma_acceleration"),
        free & ~held & starter.following(t, x),
    )
    return starter.without_noise(_onto(starter, t, x, guess, rows=rows, free=may), starter.scale(t, x))


def _finite(starter: Starter, t: float, x: Floats, free: Mask) -> Floats:
    """X where rows are no numbers there (a current over a temperature of which nothing is said): what follows from the
    other rows as written, as long as these become fewer.
    """
    before = starter.settled.rows
    # as long as fewer rows are no numbers
    while 0 < (number := int(np.count_nonzero(~np.isfinite(rows := starter.residual(t, x))))) < before:
        may, before = free & starter.following(t, x), number
        told = without_rates(starter) & np.isfinite(rows) & starter.reading(may)
        x = _onto(starter, t, x, x, rows=told, free=may)
    return x


def _aimed(starter: Starter, t: float) -> Floats:
    """The guess, with the contents that coupled stores hold together there: of what the text says of each, the others
    at rest.  Where nothing else asks for it none of these moves then, whatever unknowns hold their contents.  Of a
    network the contents of each store are guessed, and stay.
    """
    families = starter.system.description.families
    # a network: contents of stores are guessed, and stay
    if any(f.kind in ("slack", "unsaid") and not f.owner.startswith(HELD) for f in families):
        return starter.guess
    return _with_contents(starter, t, _with_momenta(starter, t))


def _with_momenta(starter: Starter, t: float) -> Floats:
    """The guess with the momenta of flows that share inertia, and with what guesses of these miss."""
    known, guess = starter.equations, starter.guess
    joined, flows, placed = known.joined, starter.moves("f"), starter.moves("q")
    tied = starter.groups("psi", "phi_rate")
    # no momentum is shared, or all is at rest
    if not (joined.any() and (guess[flows].any() or starter.residual(t, guess)[tied].any())):
        return guess  # of a large model the room counts
    unsaid = flows & starter.free & ~starter.written
    # flows of which nothing is said, by what ties them
    x = _onto(starter, t, guess, guess, rows=tied | starter.groups("phi"), free=unsaid | placed & starter.free).copy()
    _rest(starter, t, x, rows=tied, of=unsaid)
    rows, missed = known.guessed
    x[missed] = starter.residual(t, x)[rows]
    momentum, own = known.momentum[joined[known.flow]], own_unknown(starter.settled, "momentum", "f")
    # momenta of shared inertia
    if momentum.size and not starter.written[momentum].any():
        free = np.zeros(x.size, dtype=bool)
        free[momentum] = True
        x = _onto(starter, t, x, x, rows=(own >= 0) & joined[own], free=free)
    x[placed] = guess[placed]
    return x


def _rest(starter: Starter, t: float, x: Floats, *, rows: Mask, of: Mask) -> None:
    """Those unknowns of X that these rows alone do not tell are as guessed again, in place."""
    take = rows[starter.rows] & of[starter.columns]
    entries = starter.rows[take], starter.columns[take], starter.jacobian(t, x)[take]
    # what the rows leave open is as guessed
    choice = free_unknowns((starter.settled.rows, x.size), entries)
    at_rest = of if choice is None else of & choice
    x[at_rest] = starter.guess[at_rest]


def _with_contents(starter: Starter, t: float, x: Floats) -> Floats:
    """X with the displacements that implicit efforts which are said tell with others (coupled coils, mirrored), and
    those efforts that balances alone make of what is said.
    """
    efforts, gammas = starter.moves("e"), starter.groups("gamma")
    if (_number(starter, gammas, efforts) > 1).any():  # of coupled stores
        balances = starter.groups("dynamics") & ~starter.reading(np.arange(x.size) >= starter.n)  # no rate in them
        unsaid = starter.moves("e", "f") & starter.free & ~starter.written
        found = _onto(starter, t, x, x, rows=balances, free=unsaid).copy()
        _rest(starter, t, found, rows=balances, of=unsaid)
        x = np.where(efforts, found, x)
    told = efforts & (x != 0.0)
    if not told.any():
        return x
    rows = gammas & starter.reading(told)
    free = np.zeros(x.size, dtype=bool)
    free[starter.columns[rows[starter.rows]]] = True
    return _onto(starter, t, x, x, rows=rows, free=free & starter.moves("q") & ~starter.written)


def _number(starter: Starter, rows: Mask, unknowns: Mask) -> Places:
    """How many of these unknowns each of these rows reads [rows]."""
    take = rows[starter.rows] & unknowns[starter.columns]
    return np.bincount(starter.rows[take], minlength=starter.settled.rows)


def _attempt(starter: Starter, t: float, guess: Floats, free: Mask, *, quickly: bool = False) -> tuple[Solution, str]:
    """The first strategy that holds, from the guess, and its name; the least residual and "" where none does."""
    x = _finite(starter, t, _starting_point(starter, t, guess, free), free)
    # strategies in turn, the exact solution of the first that holds
    best = Solution(x, np.inf)
    for name, strategy in applicable(starter, t, x, free, quickly=quickly):
        found, holds = first(strategy(starter, t, x, guess, free), x)
        again, sure = anew(starter, t, found, x, guess, free)
        with starter.granted():  # what led there has taken its own
            exact = sharp(starter, t, again, free) if sure or (holds and again.residual < np.inf) else None
        if exact is not None:
            return exact, name
        best = found if found.residual < best.residual else best
    return best, ""


def _explain(starter: Starter, t: float, guess: Floats, free: Mask, best: Solution, flat: Ints) -> InconsistentStart:
    """Why there is no consistent state: rows in the way, and the fixed values that would have to move; flat: of laws
    without a slope.
    """
    # a law without slope: the likeliest reason
    if flat.size:
        return InconsistentStart("slope", float(best.residual), labels(starter.system, flat))
    # rows that are no numbers at the guess
    if not np.isfinite(best.residual):
        bad = np.flatnonzero(~np.isfinite(starter.residual(t, guess)))
        rows = tuple(starter.settled.row_label(int(row)) for row in bad[:5])
        return InconsistentStart("nonfinite", float("inf"), rows)
    starter.work = Work(EXPLAINED, starter.work.budget)
    # rows that are linear and contradict: these alone
    x, linear = best.x, contradicting(starter, t, guess, free)
    every = starter.every if linear is None else linear
    # where they are least, if the model is small
    if x.size <= DENSE:
        x = least_residual(problem_of(starter, t, guess, guess, rows=every, free=free), x)
    scaled = np.abs(starter.residual(t, x)) * starter.row_scale(t, x, starter.scale(t, guess))
    raw, scaled = (np.where(every, item, 0.0) for item in (np.abs(starter.residual(t, x)), scaled))
    order = np.argsort(-scaled)
    worst = [int(row) for row in order[:5] if scaled[row] > 0.1 * scaled[order[0]]]
    rows = tuple(dict.fromkeys(starter.settled.row_label(row) for row in worst))
    freed, found = _freed(starter, t, guess, free, linear)
    candidates: tuple[RowLabel, ...] = ()
    # rows that hold to round-off at some point contradict nothing: it was the search that failed
    contradict = bool(scaled[order[0]] > OWN)
    # fixed values that would have to move, the farthest first
    if found and contradict:
        scale = np.maximum(starter.scale(t, freed.x), starter.scale(t, guess))
        change = np.where(starter.free, 0.0, np.abs(freed.x - guess) / scale)
        least = max(MOVED, BESIDE * float(change.max(initial=0.0)))
        places = [int(k) for k in np.argsort(-change)[:5] if change[k] > least]
        candidates = tuple(dict.fromkeys(starter.label(k) for k in places))
    kind = "fixed"
    # no fixed value is in the way
    if not candidates:
        kind = "gamma" if rows and rows[0].kind.startswith("gamma") else "stuck"
        if contradict and rows and rows[0].kind.startswith(("phi", "psi", "initial")):
            kind = "fixed"
    return InconsistentStart(kind, float((scaled if kind == "stuck" else raw)[order[0]]), rows, candidates)


def _freed(starter: Starter, t: float, guess: Floats, free: Mask, linear: Mask | None) -> tuple[Solution, bool]:
    """The nearest point at which all rows hold, or those linear ones that contradict, were nothing fixed; whether it is
    one.
    """
    if free.all():
        return Solution(guess, np.inf), False
    # as a start without fixed values
    if linear is None:
        found, strategy = _attempt(starter, t, guess, np.ones_like(free))
        return found, bool(strategy)
    found = solve(problem_of(starter, t, guess, guess, rows=linear, free=np.ones_like(free)), guess)
    return found, found.residual < EXACT


def _flat(starter: Starter, t: float, guess: Floats, free: Mask) -> Ints:
    """Rows, of the system, of laws without a slope where the rows as written hold, near the guess; none where these
    hold nowhere.
    """
    # of large models nothing is said of slopes
    if guess.size > DENSE:
        return np.zeros(0, dtype=np.int64)
    starter.work = Work(EXPLAINED, starter.work.budget)
    rows, follows = without_rates(starter), free & starter.following(t, guess)
    moved = ((x, free) for x in itertools.chain([guess], around(starter, t, guess, free)))
    # the guess, points around, and beside laws that are flat
    for x, may in itertools.chain(off_the_flat(starter, t, guess, follows), moved):
        found = solve(problem_of(starter, t, x, guess, rows=rows, free=may), x)
        if found.residual < EXACT:
            near = starter.without_noise(found.x, starter.scale(t, guess))
            return rows_without_slope(starter.system, t, *starter.expand(near))
    return np.zeros(0, dtype=np.int64)


def consistent_start(
    system: System,
    t0: float,
    near: ConsistentState | None = None,
    budget: Budget | None = None,
    *,
    constants: bool = False,
    quickly: bool = False,
    silent: bool = False,
    without: Sequence[int] = (),
    jumped: tuple[Floats, Floats] | None = None,
) -> ConsistentState:
    """A state at t0 that satisfies all rows and their hidden derivatives.

    system: any index form of the model; near: a state to stay close to, else the guesses; budget: what the search draws
    on; constants: those of integrated constraints, which the model then has, follow from the rest; quickly: by the
    first strategy alone, and no word why there is none; silent: no word where linear rows contradict each other;
    without: switches of constraints that ask for nothing; jumped: points behind a step, and behind one of half its
    length, that say which stores alone move.
    Raises InconsistentStart; SolverFailure (max_wall).
    """
    starter = Starter(system if system.form.name == "3" else system.another("3"))
    system = starter.system
    # constants follow from the start: their rows are left out
    if constants:
        integrated, places = _integrated(starter)
        starter.every[integrated] = False
    # switches that ask for nothing
    if without:
        rows, _, numbers, _ = switch_rows(system.description, starter.settled.form)
        starter.every[rows[np.isin(numbers, without)]] = False
    budget = Budget() if budget is None else budget
    starter.work = Work(budget=budget.part(QUICK) if quickly else budget)
    try:
        if jumped is not None:
            starter.jump_alone(t0, jumped)
        guess = _aimed(starter, t0) if near is None else _close_to(starter, t0, near.y)
        best, strategy = _sought(starter, t0, guess, quickly=quickly, silent=silent or quickly)
    except OutOfTimeError as error:
        raise SolverFailure("max_wall", t0, 0.0) from error
    except NotFiniteError as error:
        raise InconsistentStart("nonfinite", float("inf")) from error
    # constants take up what their rows miss
    if constants:
        system.description.p[places] += starter.residual(t0, best.x)[integrated]
    found = _state(starter, t0, guess if near is None else _aimed(starter, t0), best, strategy)
    if best.x.size > LARGE:
        starter.forget()
        del starter, guess, best
        system.trim(LARGE)
    return found


def _integrated(starter: Starter) -> tuple[Places, Places]:
    """Rows of integrated constraints, and where their constants stand in p, which are subtracted there."""
    first = {family: row for group, family, row in starter.settled.form.groups if group == "phi"}
    pieces = starter.system.description.constants
    rows = [first[family] + np.arange(number) for family, _, number in pieces]
    places = [place + np.arange(number) for _, place, number in pieces]
    return np.concatenate(rows), np.concatenate(places)


def _close_to(starter: Starter, t: float, y: Floats) -> Floats:
    """A state as the guess, but for its multipliers, which redundant rows make as large as they like."""
    system = starter.system
    near = np.where(system.are(*STATE, "e"), y, starter.guess[: system.unknowns])
    return starter.unknowns(t, near, np.zeros(near.size))


def _sought(starter: Starter, t: float, guess: Floats, *, quickly: bool, silent: bool) -> tuple[Solution, str]:
    """The solution, and the strategy that found it; where there is none rates of laws without a slope are not asked for
    either, and the search begins anew.  InconsistentStart.
    """
    # a set among others whose linear rows contradict
    if silent and not starter.jumping and no_start(starter, t, guess, starter.free):
        raise InconsistentStart("stuck", float("inf"))
    budget = starter.work.budget
    best, strategy = _attempt(starter, t, guess, starter.free, quickly=quickly)
    if strategy:
        return best, strategy
    # quickly: no word why
    if quickly or starter.jumping:
        raise InconsistentStart("stuck", best.residual)
    flat = _flat(starter, t, guess, starter.free)
    # without rates of laws that have no slope
    if unasked(starter, flat):
        starter.work = Work(budget=budget)
        best, strategy = _attempt(starter, t, guess, starter.free)
        if strategy:
            return best, strategy
    raise _explain(starter, t, guess, starter.free, best, flat)


def _state(starter: Starter, t: float, guess: Floats, best: Solution, strategy: str) -> ConsistentState:
    """The state at a solution, and what moved for it."""
    starter.spare()
    largest = np.maximum(starter.scale(t, guess), starter.largest_alike(best.x))
    state = starter.free & ~starter.following(t, best.x)
    kept = bool((np.abs(best.x - guess) <= EXACT * largest)[state].all())
    far: tuple[float, ...] = ()
    # how far it is from the guess, by what moves least
    if not kept and best.x.size <= DENSE:
        measure = problem_of(starter, t, guess, guess, rows=starter.every, free=starter.free, least=True)
        far = measure.distances(best.x)
    # round-off of zeros
    small = ((np.abs(best.x) <= EXACT * largest) & ~starter.pinned)[: starter.system.form.written]
    zeros = Stretches(small) if small.size > LARGE else small
    del largest, small  # of a large model the room counts
    starter.spare()
    moved = tuple(moved_guesses(starter, t, best.x, starter.scale(t, best.x)))
    fixed = np.abs(best.x[starter.pinned])
    nothing = NOTHING * min(1.0, float(fixed[fixed > 0.0].min(initial=1.0)))
    y, yd = (np.where(np.abs(values) < nothing, 0.0, values) for values in starter.expand(best.x))
    return ConsistentState(t, y, yd, moved, best.residual, strategy, zeros, kept, far)
