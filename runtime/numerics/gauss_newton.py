"""Nonlinear equations with more unknowns than rows: the solution nearest to a guess.

Gauss-Newton: with u = W (x - guess) / scale, each step takes the minimum-norm u of the linearised rows
A u = A u_k - r (least_change.py), with halving of the step while the rows grow or are not finite.
"""

from __future__ import annotations

import ctypes as c
from collections.abc import Callable
from dataclasses import field, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray
from sysdyn.runtime import _core, tuning
from sysdyn.runtime.model import core_library as lib
from sysdyn.runtime.model.description import Floats
from sysdyn.runtime.numerics.least_change import DENSE, SINGULAR_VALUES, Mask, in_order, least_norm
from sysdyn.runtime.numerics.products import add_product, add_sizes, norm_of, pieces
from sysdyn.runtime.numerics.rank import NotFiniteError, least_squares
from sysdyn.runtime.numerics.work import Work
from sysdyn.values import dataclass

SMALL = 64
"""Rows and unknowns up to which a problem that the core knows is solved there."""
CORRECTED = 240
"""The same up to which rows are corrected: a few eliminations in which each entry has its round-off."""
ITERATIONS = 60
_FOLDS: int = _core.SD_FOLDS
"""Iterations that an exponential, falling by e in each, takes from the largest number: as long as rows shrink as fast
as their terms do none is counted."""
_HALVINGS: int = _core.SD_HALVINGS
_FLATTEST = int(np.finfo(float).maxexp) - 1
STRAIGHT = tuning.SLIGHT
"""Of rows at the middle of a way: what they may be off the mean of those at its ends and count as linear along it."""
_LOST: int = _core.SD_LOST
"""Directions one after the other along which no step makes the rows smaller: the next ones do not either."""
MISSED: int = _core.SD_MISSED
"""What `graded` answers where rows that are left miss by more than their round-off."""
_ROUND_OFF = 8.0 * float(np.finfo(float).eps)
_ROUNDINGS = 8.0
"""Times the unit round-off of its terms by their slopes: what evaluating a row of several operations may be off by."""
_BESIDE = tuning.HALF_OF_ITS_DIGITS
"""Scaled rows below which round-off alone can keep them from shrinking."""


@dataclass(frozen=True, slots=True)
class Problem:
    """Rows `use` of residual(x) [number] in the unknowns `free` of x.

    jacobian(x): values at (rows, columns); guess, scale, weight [unknowns]; levels: unknowns [masks] whose moves are
    the least in this order, each with what stands before it held, the others then (of what is too large for full
    matrices weights alone say so); idle: unknowns whose least nobody asks for where rows leave them open; work: what
    all problems of one search draw on; core: the same rows and entries there, at an instant t [s], used where there are
    no levels; check: raises what a callback of them raised; spare: hands back what a solution let go of.
    """

    residual: Callable[[Floats], Floats]
    jacobian: Callable[[Floats], Floats]
    rows: NDArray[np.integer]
    columns: NDArray[np.integer]
    number: int
    use: Mask
    free: Mask
    guess: Floats
    scale: Floats
    weight: Floats
    levels: tuple[Mask, ...] = ()
    idle: Mask | None = None
    work: Work = field(default_factory=Work)
    core: tuple[lib.RowsOfStart, float] | None = None
    check: Callable[[], None] | None = None
    spare: Callable[[], None] = lambda: None

    def distances(self, x: Floats) -> tuple[float, ...]:
        """How far x is from the guess in each level, in units of its moves; those nearest to it first."""
        moved = np.abs(x - self.guess) * self.weight / self.scale
        return tuple(norm_of(moved[level]) for level in self.levels)


@dataclass(frozen=True, slots=True)
class Solution:
    """x, its largest scaled row."""

    x: Floats
    residual: float


@dataclass(frozen=True, slots=True)
class Correction:
    """x [unknowns] after one step in what rows determine, what they do not staying as it is; open_ [unknowns]: what
    round-off leaves open of it, infinite where it has no row of its own; whether rows that are left agree to round-off.
    """

    x: Floats
    open_: Floats
    agrees: bool

    @property
    def whole(self) -> bool:
        """Whether there are rows for all unknowns."""
        return bool(np.isfinite(self.open_).all())


def _numbered(places: Any, used: Mask) -> Any:
    """Places by their numbers among those in use."""
    if used.all():
        return places
    number = np.cumsum(used, dtype=np.int32)
    number -= 1
    return number[places]


def graded(a: Floats, aim: Floats, step: Floats, noise: Floats | None = None, doubt: Floats | None = None) -> int:
    """What core/linear/dense/graded.h answers."""
    failed: int = lib.core.sd_graded(*a.shape, *map(lib.pointer, (a, aim, noise, step, doubt)))
    if failed < 0:
        raise MemoryError
    return failed


class _Linear:
    """The linearised rows at a point: A [used rows, free unknowns] in scaled unknowns and rows."""

    def __init__(self, problem: Problem, x: Floats) -> None:
        self.problem, self._x = problem, x
        self.shape = int(problem.use.sum()), int(problem.free.sum())
        self._values: Floats | None = self._slopes()

    def _slopes(self) -> Floats:
        """The entries at the point, zero where they are not in use."""
        problem = self.problem
        values = problem.jacobian(self._x)
        taken = problem.use[problem.rows]
        taken &= problem.free[problem.columns]
        taken &= np.isfinite(values)
        # every entry counts
        if taken.all():
            return values
        np.logical_not(taken, out=taken)
        values = values if values.flags.writeable else values.copy()
        values[taken] = 0.0
        return values

    @cached_property
    def row_scale(self) -> Floats:
        """One over the size of each row [number]: a row is as large as its terms are, in magnitudes."""
        problem, size = self.problem, np.zeros(self.problem.number)
        values = self._slopes() if self._values is None else self._values
        add_sizes(problem.rows, problem.columns, values, problem.scale, size)
        # rows without terms are as they are
        size[~(size > 0.0)] = 1.0
        return np.divide(1.0, size, out=size)

    def scaled(self, r: Floats) -> Floats:
        """Rows r [number], zero where not in use, by the size of their terms in what is free; where nothing that they
        read is free by that of all.  r is spent.
        """
        problem, scaled = self.problem, np.multiply(r, self.row_scale, out=r)
        scaled[~problem.use] = 0.0
        # rows that read nothing free: by all that they read
        perhaps = (scaled != 0.0) & (self.row_scale == 1.0)
        if perhaps.any():
            at = np.flatnonzero(perhaps[problem.rows])
            rows, columns = problem.rows[at], problem.columns[at]
            terms = np.nan_to_num(np.abs(problem.jacobian(self._x)[at]) * problem.scale[columns], posinf=0.0)
            free, size = (np.bincount(rows, terms * of, r.size) for of in (problem.free[columns], 1.0))
            np.divide(scaled, size, out=scaled, where=perhaps & (free == 0.0) & (size > 0.0))
        return scaled

    @property
    def unit(self) -> Floats:
        """What u counts each free unknown in; made when asked."""
        return self.problem.scale[self.problem.free] / self.problem.weight[self.problem.free]

    def moved(self, x: Floats) -> Floats:
        """How far each free unknown is from the guess, in its unit; made when asked."""
        return (x - self.problem.guess)[self.problem.free] / self.unit

    def _taken(self, *, spent: bool = False) -> tuple[Any, Any, Floats]:
        """Rows, columns and values of the entries in use; factors would fill from zeros too.  spent: at last."""
        assert self._values is not None
        # zeros would fill factors
        take = self._values != 0.0
        values = self._values[take]
        if spent:
            self._values = None
        return self.problem.rows[take], self.problem.columns[take], values

    def entries(self) -> tuple[Any, Any, Floats]:
        """A by its entries, asked for once where a point does not hold: of a large one the room counts."""
        rows, columns, values = self._taken(spent=True)
        problem = self.problem
        # scaled piece by piece, in place
        for here in pieces(values.size):
            values[here] *= problem.scale[columns[here]] / problem.weight[columns[here]]
            values[here] *= self.row_scale[rows[here]]
        if max(self.shape) > SINGULAR_VALUES:  # found again if asked
            self.__dict__.pop("row_scale", None)
        rows = _numbered(rows, problem.use)
        columns = _numbered(columns, problem.free)
        return rows, columns, values

    def determined(self, u: Floats, r: Floats, *, beside: bool) -> Floats | None:
        """The u with A u = A u_now - r where the rows, as they are, determine the step (linear/dense/graded.h); None
        where they do not.
        """
        a, columns = self._full()
        step, stands = np.zeros(u.size), np.zeros(u.size, dtype=bool)
        stands[columns] = True
        # rows that do not determine the step
        if graded(a, -r / self.row_scale[self.problem.use], step):
            return None
        return np.where(stands | beside, u + step / self.unit, 0.0)

    def _full(self) -> tuple[Floats, Any]:
        """The rows as they are [used rows, free unknowns], and the columns of their entries."""
        rows, columns, values = self._taken()
        rows, columns = _numbered(rows, self.problem.use), _numbered(columns, self.problem.free)
        a = np.zeros(self.shape)
        np.add.at(a, (rows, columns), values)
        return a, columns

    def correction(self) -> Correction | None:
        """By how much the rows, as they are, miss what they determine; None where that is nothing."""
        problem, x, step, doubt = self.problem, self._x, np.zeros(self.shape[1]), np.zeros(self.shape[1])
        # noise of each row: round-off of its terms
        noise = np.zeros(problem.number)
        add_sizes(problem.rows, problem.columns, problem.jacobian(x), np.abs(x), noise)
        noise *= _ROUNDINGS * np.finfo(float).eps
        aim = -problem.residual(x)[problem.use]
        failed = graded(self._full()[0], aim, step, noise[problem.use], doubt)
        doubt /= _ROUNDINGS
        # singular, or no numbers
        if failed == 1 or not np.isfinite(step).all():
            return None
        found, open_ = x.copy(), np.zeros(x.size)
        found[problem.free] += step
        open_[problem.free] = doubt
        return Correction(found, open_, not failed)

    def nearest(self, x: Floats, r: Floats, *, beside: bool) -> Floats:
        """The least u with A u = A u_now - r at x; beside it, the least step: its round-off is its own.  r is spent."""
        levels = [level[self.problem.free] for level in self.problem.levels]
        # the order of levels needs full matrices
        ordered = any(level.any() for level in levels) and max(self.shape) <= DENSE
        if not ordered and max(self.shape) <= SINGULAR_VALUES:
            only = self.determined(self.moved(x), r, beside=beside)
            if only is not None:
                return only
        held = [self.entries()]
        u = self.moved(x)
        # what costs nothing stays where it is as far as it may
        stays = u if beside else np.where(np.any(levels, axis=0), 0.0, u) if ordered else 0.0
        aim = add_product(*held[0], u - stays, np.negative(r, out=r))
        del r, u  # of a large one the room counts
        # in order of levels, or least in all
        if ordered:
            return stays + in_order(self.shape, held.pop(), aim, levels)
        idle = None if self.problem.idle is None else self.problem.idle[self.problem.free]
        return stays + least_norm(self.shape, held.pop(), aim, spent=True, idle=idle)


def solve(problem: Problem, x: Floats, most: int = ITERATIONS) -> Solution:
    """From x towards the solution nearest to problem.guess; the best point met in so many iterations."""
    # in the core, unless an order is asked for
    if problem.core is not None and not problem.levels:
        small = max(int(problem.use.sum()), int(problem.free.sum())) <= SMALL
        found = _in_core(problem, problem.core, x, most, measure=not small)
        if small or found.residual <= _ROUND_OFF:  # a large one that holds is not linearised
            return found
        del found
    with np.errstate(all="ignore"):  # what overflows is seen as not finite
        return _solve(problem, x, most)


def _in_core(problem: Problem, core: tuple[lib.RowsOfStart, float], x: Floats, most: int, *, measure: bool) -> Solution:
    """The solution of a small problem by the core (core/start/search.h); measure: x as it is, of any."""
    found, scaled = np.ascontiguousarray(x) if measure else x.copy(), np.zeros(problem.number)
    use, free, work = problem.use.astype(np.int32), problem.free.astype(np.int32), problem.work
    masks = lib.pointer(use), lib.pointer(free)
    numbers = lib.pointer(problem.guess), lib.pointer(problem.scale), lib.pointer(problem.weight)
    spent = work.allowed, work.spent, work.largest
    answers = lib.pointer(found), lib.pointer(scaled)
    search = lib.Search(c.addressof(core[0]), *masks, *numbers, core[1], most, *spent, *answers)
    # no memory in the core
    if (lib.core.sd_search_measure if measure else lib.core.sd_search_solve)(c.byref(search)):
        raise MemoryError
    if problem.check is not None:
        problem.check()
    work.largest = search.largest
    work.count(search.spent - work.spent)
    return Solution(found, search.residual)


def _solve(problem: Problem, x: Floats, most: int) -> Solution:
    """Gauss-Newton from x in Python: linear rows met by the least change, steps halved until rows fall."""
    best = Solution(x, np.inf)
    stale, taken, lost = 0, 0, 0
    # iterations, and a few more where rows shrink fast
    for _ in range(most + _FOLDS):
        if taken == most or lost == _LOST:
            break
        taken += 1
        linear = _Linear(problem, x)
        problem.work.iteration(linear.shape, problem.rows.size, full=bool(problem.levels))

        def measure(z: Floats, linear: _Linear = linear) -> tuple[float, Floats]:
            problem.work.evaluation(problem.rows.size)
            scaled = linear.scaled(problem.residual(z))
            largest = float(np.abs(scaled).max(initial=0.0))
            return (largest if np.isfinite(largest) else np.inf), scaled

        # where it stands; it ends at round-off, or where nothing has become better for long
        size, scaled = measure(x)
        if size < best.residual:
            stale = stale if size > 0.5 * best.residual else 0
            best = Solution(x, size)
        stale += 1
        if size <= _ROUND_OFF or not np.isfinite(size) or stale > (4 if best.residual < 1e-12 else 15):
            break
        if problem.work.done:
            break
        # the nearest point at which the linear rows hold
        norm, rows = norm_of(scaled), [scaled[problem.use]]
        del scaled
        try:
            target = linear.nearest(x, rows.pop(), beside=size < _BESIDE and stale > 1)
        except NotFiniteError:
            break
        problem.spare()
        if not np.isfinite(target).all():
            break
        # on towards it by halves, until the rows are nearer to zero
        step, tried, move = 1.0, x, np.subtract(target, linear.moved(x), out=target)
        move *= linear.unit

        def on(part: float, x: Floats = x, move: Floats = move, measure: Any = measure) -> tuple[Floats, Floats]:
            there = x.copy()
            there[problem.free] += part * move
            return measure(there)[1], there

        ends: list[Floats] = []
        for _ in range(_HALVINGS):
            there, tried = on(step)
            now = norm_of(there)
            if np.isfinite(now) and now <= max((1.0 - 0.1 * step) * norm, 1e-11):
                lost = 0
                break
            # ends of the way, by which it is judged
            if step >= 0.5:
                ends = [*(ends or [measure(x)[1]]), there]
            if step == 0.5 and _ascends(*ends):
                return best
            step *= 0.5
        # no part of the way is better: a flat law, or lost
        else:
            flat = _flat(on, norm)
            lost = 0 if flat[0] < norm else lost + 1
            now, tried = flat if not lost else (now, tried)
        del on, ends, there
        if best.residual >= 1e-12 and now <= 0.5 * norm:
            stale, taken = 0, taken - 1  # rows that shrink as fast as their terms do (a junction far above its voltage)
        del linear, measure, target, move  # of a large one the room counts
        if not np.isfinite(problem.residual(tried)[problem.use]).all():
            break
        x = tried
    return best


def _ascends(begun: Floats, end: Floats, middle: Floats) -> bool:
    """Whether scaled rows are linear along a way on which they do not fall by a tenth: what is nearest to the solution
    of linear rows that contradict is all that there is.
    """
    # not straight: another step may fall
    if norm_of(middle - 0.5 * (begun + end)) > STRAIGHT * norm_of(middle):
        return False
    return bool(np.einsum("i,i->", begun, end - 0.9 * begun) > 0.0)


def _flat(on: Callable[[float], tuple[Floats, Floats]], norm: float) -> tuple[float, Floats]:
    """About where rows stop to shrink on the first of a way that is too long by powers of ten, by bisection of the
    exponent: that of a law that is flat (a junction that blocks, and shall conduct).
    """
    above, below = _HALVINGS, _FLATTEST
    # between two powers of two, by their exponents
    while below - above > 1:
        halvings = (above + below) // 2
        above, below = (above, halvings) if norm_of(on(2.0**-halvings)[0]) <= norm else (halvings, below)
    there, tried = on(2.0**-below)
    return norm_of(there), tried


def stepped(problem: Problem, x: Floats) -> Floats:
    """The point one whole step from x.  NotFiniteError."""
    linear, free = _Linear(problem, x), problem.free
    r = (problem.residual(x) * linear.row_scale)[problem.use]
    found = x.copy()
    found[free] = problem.guess[free] + linear.nearest(x, r, beside=False) * linear.unit
    return found


def corrected(problem: Problem, x: Floats) -> Correction | None:
    """One step from x in what the rows determine; None where that is nothing, or the problem is no small one."""
    linear = _Linear(problem, x)
    return linear.correction() if max(linear.shape) <= CORRECTED else None


def least_residual(problem: Problem, x: Floats) -> Floats:
    """Where the rows cannot vanish: the x near which they are least (Levenberg-Marquardt, rows scaled once, dense)."""
    with np.errstate(all="ignore"):
        problem = replace(problem, weight=np.ones_like(problem.weight))
        linear = _Linear(problem, x)
        scale, damping = linear.row_scale, 1e-3

        def measure(z: Floats) -> Floats:
            problem.work.iteration(linear.shape, problem.rows.size)
            return (problem.residual(z) * scale)[problem.use]

        r = measure(x)
        # damped steps until rows fall
        for _ in range(ITERATIONS):
            linear = _Linear(problem, x)
            i, j, v = linear.entries()
            a = np.zeros(linear.shape)
            np.add.at(a, (i, j), v / linear.row_scale[problem.use][i] * scale[problem.use][i])
            for _ in range(2 * _HALVINGS):
                full = np.vstack([a, np.sqrt(damping) * np.eye(a.shape[1])])
                step = least_squares(full, np.concatenate([-r, np.zeros(a.shape[1])]), 1e-15)
                tried = x.copy()
                tried[problem.free] += step * linear.unit
                now = measure(tried)
                # nearer: less damping from here
                if np.isfinite(now).all() and now @ now < r @ r:
                    break
                damping *= 8.0
            else:
                return x
            gain = 1.0 - (now @ now) / (r @ r)
            x, r, damping = tried, now, damping / 4.0
            if gain < 1e-12 or problem.work.done:
                break
    return x
