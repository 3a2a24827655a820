"""States of rest: every rate is zero but those of displacements that nothing depends on, which may go on steadily.

    0 = U - Phi_q^T kappa - Psi_f^T mu   at f' = 0, p' = 0;   Phi = 0, Psi = 0, Gamma = 0, Lambda = 0, momenta

with f = 0 of every coordinate whose displacement something depends on, time held; where all rows depend on differences
of displacements alone (shafts that turn together), f may lie along the directions V in which none changes:
(1 - V V^T) f = 0.  Newton's method (least change, see
numerics/gauss_newton.py) from the guesses and from seeded random points around them.
Receives a System and what of it is tangible.  Hands on states of rest, each once.
"""

from __future__ import annotations

from collections.abc import Callable
from collections.abc import Set as AbstractSet
from dataclasses import field, replace
from functools import cached_property
from typing import Protocol

import numpy as np
from numpy.typing import NDArray
from sysdyn.runtime import tuning
from sysdyn.runtime.linear.states import quadratures
from sysdyn.runtime.model.description import Floats
from sysdyn.runtime.model.scales import group_maximum
from sysdyn.runtime.model.system import System
from sysdyn.runtime.numerics.equilibrate import factors
from sysdyn.runtime.numerics.gauss_newton import Problem, solve
from sysdyn.runtime.numerics.least_change import DENSE
from sysdyn.runtime.numerics.products import add_product, add_sizes
from sysdyn.runtime.numerics.rank import least_squares, null_space
from sysdyn.runtime.numerics.work import Work
from sysdyn.runtime.start.start import ConsistentState
from sysdyn.runtime.start.starter import Starter
from sysdyn.values import dataclass

Mask = NDArray[np.bool_]
MET = tuning.SAME
"""Largest row, relative to its terms, of a state of rest."""
SAME = tuning.UNSEEN
"""Distance of two states of rest, in magnitudes, below which they are one."""
PIECES, PIECE, SHORTEST = 60, 0.2, tuning.SMALL
"""Steps from one state of rest to another along those between; the longest and the shortest of them in magnitudes."""
NEAR, NOISE = tuning.SAME, tuning.BY_FACTORS
"""Parts of a magnitude, and of the largest of its kind and unit, that are tried as zero."""
FAR = 1e9
"""Times its magnitude: a displacement that is left open and has wandered off."""
SHARE, SOUGHT = 0.05, 5
"""Of the work that a search for a start may take: that of one search for rest; points that may take all of it while no
state is known (a twentieth is two iterations of a large model).
"""
STRAIGHT = tuning.MET
"""Of its terms: by how much a row may miss its tangent at a point that lies on the straight piece of another."""
MANY = 20_000
"""Unknowns up to which random points are tried: far from the guess factors of a line of 80000 took 6 GB."""
NEAREST, FARTHEST = -1.0, 1.5
"""Powers of ten between which random points lie around the guess, in magnitudes."""


@dataclass(frozen=True, slots=True)
class Rest:
    """A state of rest; residual: largest row relative to its terms; free: unknowns that it leaves open, by name, and
    open_: which these are [unknowns]; together: directions in which displacements may move together without changing
    anything; standing: the parameters and the active set of constraints that hold at times, holding: how each of these
    stands.
    """

    state: ConsistentState
    residual: float
    free: tuple[str, ...]
    open_: Mask
    together: int = 0
    standing: tuple[Floats, Mask] | None = None
    holding: dict[str, str] = field(default_factory=dict)

    def stand(self, system: System) -> None:
        """The model with what holds here."""
        if self.standing is not None:
            system.description.p[:] = self.standing[0]
            system.description.switches.set(self.standing[1])


class Resting:
    """The equations of rest of one model, time held at t; first: guess [unknowns] of what they leave open."""

    def __init__(self, system: System, tangible: AbstractSet[str], t: float, first: Floats) -> None:
        self.system, self.tangible, self.t, self.first = system, tangible, t, first
        self.starter, self.share = Starter(system), SHARE
        self.rows = system.another("rated")
        self.n = system.form.written
        # flows of what is tangible stand still; those of cyclic coordinates may not
        families = system.description.families
        owners = np.array([families[int(k)].owner in tangible for k in system.family_of[: self.n]], dtype=bool)
        self.still = (system.kinds[: self.n] == "f") & owners
        self.loose = quadratures(system, tangible)
        self.use = self._use()
        # angles may be found whole turns away
        self.turns = np.array([families[int(k)].unit == "rad" for k in system.family_of[: self.n]], dtype=bool)
        self.turns &= system.kinds[: self.n] == "q"
        self.along = self._together()

    def _together(self) -> Floats:
        """Orthonormal flows [flows of tangible coordinates, k] along which no row changes, wherever the model is.

        Displacement constraints that are linear may move: their rates are rows of their own.
        """
        flows = np.flatnonzero(self.still)
        at = dict(zip(self.system.form.k_f.tolist(), self.system.form.k_q.tolist(), strict=True))
        # a large model, or flows without displacements: no search for such directions
        if not flows.size or self.n > DENSE or any(int(k) not in at for k in flows):
            return np.zeros((flows.size, 0))
        places = np.array([at[int(k)] for k in flows])
        random = np.random.default_rng(11)
        # constant along the directions at three points: constant everywhere, but for chance
        points = [self.first, *(self.first + self._spread() * random.standard_normal(self.n) for _ in range(2))]
        with np.errstate(all="ignore"):
            matrices = [self.rows.dense(self.jacobian(y)) for y in points]
        # beyond the domain of a law
        if not all(np.isfinite(m).all() for m in matrices):
            return np.zeros((flows.size, 0))
        # linear displacement constraints may move, for their rates stand in rows of their own
        linear = np.all([(m == matrices[0]).all(axis=1) for m in matrices], axis=0) & self.rows.of_groups("phi")
        stacked = np.vstack([m[self.use & ~linear][:, places] for m in matrices])
        row, _ = factors(stacked)
        return null_space(row[:, None] * stacked) if stacked.size else np.eye(flows.size)

    def _spread(self) -> Floats:
        """How far points lie from the guess."""
        x = self.starter.unknowns(self.t, self.first, np.zeros(self.n))
        return 0.3 * self.starter.scale(self.t, x)[: self.n]

    def _use(self) -> Mask:
        """Rows of rest: as written, the rates of displacement constraints, multipliers of what does not hold."""
        use = self.rows.of_groups("dynamics", "momentum", "phi", "phi_rate", "psi", "gamma", "lambda").copy()
        # rows of what does not hold say that multipliers vanish
        use[self.rows.held[0]] = True
        grows = self.loose & (self.system.kinds[: self.n] == "s")
        # a dynamic variable that nothing reads may grow: its row is no condition
        for group, family, first in self.rows.form.groups:
            if group == "lambda":
                owner = self.system.description.rows[family].owner
                use[first : first + self.system.description.rows[family].size] = ~grows[self._places("s", owner)]
        return use

    def _places(self, kind: str, owner: str) -> slice:
        families = self.system.description.families
        k = next(k for k, f in enumerate(families) if f.kind == kind and f.owner == owner)
        first = int(self.system.form.at[k])
        return slice(first, first + families[k].size)

    def residual(self, y: Floats) -> Floats:
        """All rows at rest [rows], then those of the flows that may not go on [flows of tangible coordinates]."""
        rows = self.rows.residual(self.t, y, self.rates(y))
        return np.concatenate([rows, self._held @ y[self.still]]) if self.along.size else rows

    @property
    def _held(self) -> Floats:
        """1 - V V^T."""
        return np.eye(self.along.shape[0]) - self.along @ self.along.T

    def rates(self, y: Floats) -> Floats:
        """Rates at rest: displacements go on with their flows."""
        yd = np.zeros(self.n)
        yd[self.system.form.k_q] = y[self.system.form.k_f]
        return yd

    def jacobian(self, y: Floats) -> Floats:
        """Values by y on the pattern of the rows alone."""
        return self.rows.jacobian(self.t, y, self.rates(y))[0]

    def _slopes(self, y: Floats) -> Floats:
        values = self.jacobian(y)
        return np.concatenate([values, self._held.ravel()]) if self.along.size else values

    def problem(self, guess: Floats) -> Problem:
        """Rest nearest to a guess."""
        x = self.starter.unknowns(self.t, guess, np.zeros(self.n))
        scale = self.starter.scale(self.t, x)[: self.n]
        # multipliers and implicit efforts follow: they hardly weigh
        follows = np.isin(self.system.kinds[: self.n], ("kappa", "mu", "e"))
        pattern = self.rows.pattern
        rows, columns = pattern.row.astype(np.int64), pattern.columns_of().astype(np.int64)
        use, free = self.use, ~self.still
        # flows along which all moves together are unknown; the rest of them stays
        if self.along.size:
            flows = np.flatnonzero(self.still)
            rows = np.concatenate([rows, self.rows.rows + np.repeat(np.arange(flows.size), flows.size)])
            columns = np.concatenate([columns, np.tile(flows, flows.size)])
            use, free = np.append(use, np.ones(flows.size, dtype=bool)), np.ones_like(free)
        return Problem(
            residual=self.residual,
            jacobian=self._slopes,
            rows=rows,
            columns=columns,
            number=use.size,
            use=use,
            free=free,
            guess=guess,
            scale=scale,
            weight=np.where(follows, 1e-3, 1.0),
            work=Work(self.share),
        )

    def found(self, guess: Floats, near: Floats | None = None) -> Rest | None:
        """The state of rest that Newton's method comes to from a guess; what it leaves open is as near as can be to
        `near`, by itself to what was first guessed.
        """
        near = self.first if near is None else near
        guess = guess.copy()
        # of the guess's flows what all rows allow
        guess[self.still] = self.along @ (self.along.T @ guess[self.still])
        problem = self.problem(guess)
        best = solve(problem, guess)
        # Newton's method came to no solution
        if not best.residual < MET:
            return None
        y = self._wrap_angles(self._clean(best.x, problem))
        again = self.problem(y)  # in magnitudes of its own: what is near zero in the guess's may be large in these
        own = solve(again, y)
        if not own.residual < MET:
            return None
        y = self._clean(own.x, problem)
        # directions that the rows leave open, and the unknowns that stand in these
        null = self._null(y, again) / again.scale[:, None] if self.n <= DENSE else np.zeros((self.n, 0))
        told = ~np.isin(self.system.kinds[: self.n], ("kappa", "mu"))
        open_ = told & (np.abs(null).max(axis=1, initial=0.0) > SAME)
        y = self._back(y, again, null, open_, near)
        # a root at the edge of floating point is none
        if (np.abs(y) > FAR * problem.scale).any():  # rows hold beside terms that large alone
            return None
        state = ConsistentState(self.t, y, self.rates(y), (), own.residual)
        free = tuple(self.system.name(int(k)) for k in np.flatnonzero(open_))
        return Rest(state, own.residual, free, open_, self.along.shape[1])

    def _is_rest(self, y: Floats) -> bool:
        """Whether y is a state of rest, but for what is near zero in its magnitude."""
        # one iteration at most: y is a root, or hardly moves
        problem = self.problem(y)
        found = solve(replace(problem, guess=y), y, 1)
        # what counts as nothing: by its like, by what is observed, by noise
        noise = NEAR * group_maximum(self.system, problem.scale), self._nothing, NOISE * self._alike(y)
        told = ~np.isin(self.system.kinds[: self.n], ("kappa", "mu"))
        return found.residual < MET and bool((np.abs(found.x - y) <= np.maximum.reduce(noise))[told].all())

    def _sizes(self, one: Floats, other: Floats) -> Floats:
        """In which two states are compared [unknowns]: their magnitudes, none of them nothing beside its like."""
        size = np.maximum(np.abs(one), np.abs(other))
        floors = group_maximum(self.system, self.problem(one).scale), NEAR * self._alike(size), self._nothing
        found: Floats = np.maximum.reduce([size, *floors])
        return found

    def _alike(self, y: Floats) -> Floats:
        """Of each unknown the largest magnitude of its kind and unit."""
        return self.starter.largest_alike(self.starter.unknowns(self.t, y, np.zeros(self.n)))[: self.n]

    @cached_property
    def _nothing(self) -> Floats:
        """What is near zero beside the first guess [unknowns]: a state at rest has no magnitudes of its own."""
        return NEAR * group_maximum(self.system, self.problem(self.first).scale)

    def _clean(self, y: Floats, problem: Problem) -> Floats:
        """Without flows, and what is near zero in its magnitude, where that is as good."""
        noise = np.maximum(NEAR * group_maximum(self.system, problem.scale), NOISE * self._alike(y))
        clean = np.where(np.abs(y) > noise, y, 0.0)
        tried = np.where(self.still, 0.0, clean), clean
        return next((z for z in tried if (z != y).any() and self._is_rest(z)), y)

    def _back(self, y: Floats, problem: Problem, null: Floats, open_: Mask, near: Floats) -> Floats:
        """What the rows leave open as it is in `near`; open_: which of what has a magnitude that is."""
        # of a large model no null space
        if self.n > DENSE:  # what nothing depends on is known without
            back = np.where(self.loose, near, y)
            return back if (back != y).any() and self._is_rest(back) else y
        # the rows determine everything
        if not open_.any():
            return y
        # back along the null space, as near as it leads
        away = (y - near) / problem.scale
        moves = open_ | np.isin(self.system.kinds[: self.n], ("kappa", "mu"))
        back = np.where(moves, y - problem.scale * (null @ least_squares(null, away)), y)
        # straight: the rows hold there
        if self._is_rest(back):
            return back
        found = solve(self.problem(back), back)  # along what bends, or from where its rows hold by round-off alone
        return found.x if found.residual < MET else y

    def _wrap_angles(self, y: Floats) -> Floats:
        """Angles in -pi..pi where the rows cannot tell whole turns; -pi but for round-off is pi."""
        turned = np.where(self.turns, np.pi + SAME - np.mod(np.pi + SAME - y, 2.0 * np.pi), y)
        # an angle that the rows tell apart stays where it was
        near = solve(replace(self.problem(turned), guess=turned), turned, 3)
        return near.x if near.residual < MET else y

    def _null(self, y: Floats, problem: Problem) -> Floats:
        """Directions along which the rows of rest do not change [unknowns, k]."""
        full = self.rows.dense(self.jacobian(y))[self.use]
        # flows that move together are unknowns too
        if self.along.size:
            held = np.zeros((self.along.shape[0], self.n))
            held[:, self.still] = self._held
            full = np.vstack([full, held])
        full = full[:, problem.free]
        # equilibrated: ranks do not depend on units
        row, column = factors(full)
        null = null_space(row[:, None] * full * column)
        found = np.zeros((self.n, null.shape[1]))
        found[problem.free] = column[:, None] * null
        return found

    def alike(self, point: Floats) -> bool:
        """Whether the rows at a point are those of the first guess: of one straight piece, from which Newton's method
        leads to where it led from there.
        """
        # the slopes differ: another piece of some law
        values = self._slopes(self.first)
        if not np.array_equal(values, self._slopes(point)):
            return False
        problem, away = self.problem(self.first), point - self.first
        # by the tangent from the first guess: residuals beyond round-off mean a curve
        tangent, terms = self.residual(self.first), np.zeros(problem.number)
        add_product(problem.rows, problem.columns, values, away, tangent)
        add_sizes(problem.rows, problem.columns, values, np.abs(self.first) + np.abs(away), terms)
        miss = np.abs(self.residual(point) - tangent) <= STRAIGHT * (terms + np.abs(tangent))
        return bool(miss[self.use if not self.along.size else problem.use].all())

    def is_apart(self, one: Rest, other: Rest) -> bool:
        """Whether two states differ by more than what the first leaves open, and no states of rest lie between them."""
        problem = self.problem(one.state.y)
        told = ~np.isin(self.system.kinds[: self.n], ("kappa", "mu")) & ~self.loose
        size = self._sizes(one.state.y, other.state.y)
        move = ((other.state.y - one.state.y) / size)[told]
        # movement along what the first leaves open is no difference
        if one.free:
            null = (self._null(one.state.y, problem) / size[:, None])[told]
            move = move - null @ least_squares(null, move)
        # both open: they may be points of one family
        differ = bool(np.abs(move).max(initial=0.0) > SAME)
        return differ and not (one.free and other.free and self._between(one.state.y, other.state.y, told))

    def _between(self, one: Floats, other: Floats, told: Mask) -> bool:
        """Whether states of rest lead from one to another: by steps along what they leave open, and back onto them."""
        y, turned, piece = one, False, PIECE
        size = self._sizes(one, other)
        # in steps along the null space
        for _ in range(PIECES):
            away = ((other - y) / size)[told]
            if np.abs(away).max(initial=0.0) <= SAME:
                return True
            null = self._null(y, self.problem(y)) / size[:, None]
            along = null @ least_squares(null[told], away) if null.size else np.zeros(y.size)
            longest = float(np.abs(along).max())
            # at a turning point, or apart
            if longest < SAME:  # nothing leads nearer: a way around, once
                if turned or not null.size:
                    return False
                turned, along = True, null[:, 0]
                longest = float(np.abs(along).max())
            begun = y + size * along * min(1.0, piece / longest)
            # back onto the rows; a step that leads far away was too long
            found = solve(replace(self.problem(begun), guess=begun), begun)
            follows = found.residual < MET and np.abs((found.x - begun) / size)[told].max() <= piece
            y, piece = (found.x, min(2.0 * piece, PIECE)) if follows else (y, 0.25 * piece)
            # hardly moves any more: apart
            if piece < SHORTEST:
                return False
        return False


class RestEquations(Protocol):
    """What states of rest are found of: Resting, or with constraints that hold at times contact_rest.ContactRest."""

    first: Floats
    share: float

    @property
    def turns(self) -> Mask:
        """Displacements that are angles [unknowns]."""

    def problem(self, guess: Floats) -> Problem:
        """Rest nearest to a guess."""

    def found(self, guess: Floats) -> Rest | None:
        """The state of rest that is come to from a guess."""

    def alike(self, point: Floats) -> bool:
        """Whether Newton's method leads from a point to where it led from the first guess, for certain."""

    def is_apart(self, one: Rest, other: Rest) -> bool:
        """Whether two states differ by more than what the first leaves open."""


def rests(
    resting: RestEquations, tries: int, most: int | None = None, advance: Callable[[int], None] | None = None
) -> tuple[Rest, ...]:
    """States of rest from the first guess and from random points (up to MANY unknowns), in the order found; most: how
    many are wanted; advance: told how many points were tried.
    """
    kept: list[Rest] = []
    guess, begun = resting.first, False
    random = np.random.default_rng(7)
    scale = resting.problem(guess).scale
    # angles spread over whole turns even where the guess is small
    scale = np.where(resting.turns, np.maximum(scale, 1.0), scale)
    mirrored: list[Floats] = []  # springs and pendulums are often symmetrical
    # large models: the first guess alone
    for k in range(tries + 1 if guess.size <= MANY else 1):
        if most is not None and len(kept) >= most:
            break
        if advance is not None:
            advance(k)
        # from next to the guess to far away, in decades
        shaken = 10.0 ** random.uniform(NEAREST, FARTHEST) * scale * random.standard_normal(guess.size)
        point = guess if k == 0 else mirrored.pop() if mirrored else guess + shaken
        # on the same straight piece Newton's method leads to the same state
        if begun and resting.alike(point):
            continue
        # while nothing is found more work is allowed
        resting.share = 1.0 if k < SOUGHT and not kept else SHARE
        found = resting.found(point)
        begun = begun or (k == 0 and found is not None)
        # one of its own, not of a family found before
        if found is not None and all(resting.is_apart(other, found) for other in kept):
            kept.append(found)
            mirrored.append(-found.state.y)
            # what is left open says nothing of how far others lie, and would wander off
            scale = np.maximum(scale, np.where(found.open_, 0.0, np.abs(found.state.y - guess)))
    return tuple(kept)
