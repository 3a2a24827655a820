"""The linearisation on the constraint manifold, about a state at rest or a moving one.

About a moving state the frozen pencil (dF/dy, dF/dy') of a form of index 2 or 3 has other eigenvalues than the motion
beside it: the constraints' gradients move.  What varies must vary on all rows that hold and on their derivatives.  With
z = (y, the rates that the rows of the start read) and G their Jacobian, variations obey G dz + G_u du = 0, where
dq' = df.  For a set S of differential unknowns that fix all others,

    [G; I_S] dz = [-G_u du; dx]     =>     dx' = A dx + B0 du + B1 du' + B2 du'',  y = C dx + D0 du + D1 du' + D2 du''

(what depends on int du has that for a state of its own), and with dx := dx - B2 du' - (B1 + A B2) du the derivatives of
inputs leave the state equation:
B = B0 + A B1 + A^2 B2,  D = D0 + C B1 + C A B2;  D1 + C B2 and D2 remain where the transfer function is improper.

Receives a System, a consistent state, the slopes by inputs and of outputs.  Hands on a `Reduced`.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray
from sysdyn.runtime import tuning
from sysdyn.runtime.linear import precise
from sysdyn.runtime.linear.states import Mask, candidates_of, chosen_states, pivots, rank_of
from sysdyn.runtime.model.description import Floats
from sysdyn.runtime.model.system import System
from sysdyn.runtime.numerics.equilibrate import factors
from sysdyn.runtime.numerics.rank import (
    CERTAIN,
    TOLERANCE,
    count,
    least_squares,
    singular_decomposition,
    singular_values,
    sure_complement,
    sure_solver,
)
from sysdyn.runtime.start.start import ConsistentState
from sysdyn.runtime.start.starter import Starter
from sysdyn.values import dataclass

LARGEST = 1500
"""Unknowns and rates up to which full matrices are taken."""
WIDEST = 150
"""Unknowns and rates up to which states are chosen in many digits."""
FEW = 200
"""The same from which on rank is told by factors where these leave no doubt, and by singular values where they do."""
NOISE = tuning.BY_FACTORS
"""Of the largest variation, in equilibrated unknowns: what is smaller is round-off of the solution."""
PASSES, MOVES = 2, tuning.BY_FACTORS
"""Of the scaling of unknowns; the part of a unit vector that is no round-off."""
ORDERS = 4
"""Slopes by an input are taken by its integral, itself, its rate and its second rate."""


class NoLinearisation(Exception):  # noqa: N818
    """There is none: too large, or the rows do not determine the rates `names` of the state."""

    def __init__(self, message: str, names: tuple[str, ...] = ()) -> None:
        self.names = names
        super().__init__(message)


@dataclass(frozen=True, slots=True)
class Outputs:
    """Slopes of the outputs: by y [outputs, unknowns], by y' [outputs, unknowns], by inputs, their rates and second
    rates [outputs, inputs].
    """

    by_y: Floats
    by_rate: Floats
    by_input: tuple[Floats, Floats, Floats]


@dataclass(frozen=True, slots=True)
class Reduced:
    """dx' = a dx + b du, dy = c dx + d du + d1 du' + d2 du''; places [states]: of the states in y, names: theirs.

    A state may be a combination where an input or its rate moves it: see the module.  wide: the same where double
    precision loses slow eigenvalues; decomposed: its eigenvalues and eigenvectors.  unsure:
    a with the round-off of the rows changed, where that moves eigenvalues and they are not known better.
    """

    a: Floats
    b: Floats
    c: Floats
    d: Floats
    d1: Floats
    d2: Floats
    places: NDArray[np.int64]
    names: tuple[str, ...]
    wide: Wide | None = None
    decomposed: precise.Decomposed | None = None
    unsure: Floats | None = None


@dataclass(frozen=True, slots=True)
class Wide:
    """a, b, c, d of a reduction in many digits; beside: with the round-off of the rows changed."""

    a: precise.Wide
    b: precise.Wide
    c: precise.Wide
    d: precise.Wide
    beside: Wide | None = None


@dataclass(frozen=True, slots=True)
class LinearisedRows:
    """The rows of the start at a state: jacobian [rows, unknowns and rates], which rows hold, which rates are read."""

    starter: Starter
    jacobian: Floats
    holds: Mask


@dataclass(frozen=True, slots=True)
class Given:
    """What is reduced: rows at a state of a system; by_input: slopes of these rows by the integrals of inputs, inputs,
    their rates, second rates [rows, inputs]; out: of the outputs; names: of the inputs; loose [unknowns]: what nothing
    depends on.
    """

    rows: LinearisedRows
    system: System
    state: ConsistentState
    by_input: tuple[Floats, ...]
    out: Outputs
    names: tuple[str, ...]
    loose: Mask

    def right(self, rows: NDArray[Any]) -> Floats:
        """What these of the rows that hold move by the inputs [rows, integrals, inputs, rates, second rates]."""
        found = -self.rows.starter.with_sums(np.hstack(self.by_input))[self.rows.holds]
        return np.asarray(found[rows])


def rows_at(system: System, state: ConsistentState) -> LinearisedRows:
    """Every row that holds at consistent states, linearised; system: the form as written."""
    starter = Starter(system)
    x = starter.unknowns(state.t, state.y, state.yd)
    # dense matrices beyond this fill the memory
    if max(x.size, starter.settled.rows) > LARGEST:
        text = f"{x.size} unknowns and rates are more than {LARGEST}, up to which full matrices are taken"
        raise NoLinearisation(text)
    # all rows that starts meet, hidden constraints among them
    full = np.zeros((starter.settled.rows, x.size))
    np.add.at(full, (starter.rows, starter.columns), starter.jacobian(state.t, x))
    if not np.isfinite(full).all():
        raise NoLinearisation("the slopes of the equations are no numbers there")
    # rates of displacements are flows: no unknowns of their own
    as_written = np.delete(full, np.s_[system.form.written : starter.n], axis=1)
    return LinearisedRows(starter, as_written, starter.every & ~starter.groups("initial"))


def _tangent(g: Floats, by_column: Floats) -> tuple[Floats, Floats]:
    """The null space of G, orthonormal in units [unknowns] in which those that move at all move alike, and the others
    weigh no more in a row than these; these units.

    Where a farad counts in millionths, charges would pass for at rest beside voltages; the flow of a source, which no
    stiff law weighs, would hide the balance of all others at its node.
    """
    # rows of zeros stay zeros
    by_row = 1.0 / np.where(g.any(axis=1), np.abs(g * by_column).max(axis=1, initial=0.0), 1.0)
    tangent = _null_space(by_row[:, None] * g * by_column)
    # units in which what moves moves alike, by iteration
    for _ in range(PASSES):
        size = np.linalg.norm(tangent, axis=1)
        by_column = _no_heavier(g, by_column * np.where(size > MOVES, size, 1.0), size > MOVES)
        by_row = 1.0 / np.where(g.any(axis=1), np.abs(g * by_column).max(axis=1, initial=0.0), 1.0)
        tangent = _null_space(by_row[:, None] * g * by_column)
    return tangent, by_column


def _no_heavier(g: Floats, units: Floats, moves: Mask) -> Floats:
    """Units in which no entry of what does not move is larger than the largest in its row of what does."""
    size = np.abs(g) * units
    largest = size[:, moves].max(axis=1, initial=0.0)[:, None]
    share = np.divide(largest, size, out=np.ones_like(size), where=(largest > 0.0) & (size > 0.0))
    return np.where(moves, units, units * share.min(axis=0, initial=1.0))


def _null_space(matrix: Floats) -> Floats:
    """Orthonormal columns that a matrix maps to zero, to round-off: a fast mode is no constraint."""
    # many rows: a triangular factor with pivots, where its rank is sure
    sure = sure_complement(matrix, CERTAIN) if matrix.shape[0] > FEW else None
    if sure is not None:
        return sure
    _, sigma, vt = singular_decomposition(matrix)
    return np.asarray(vt[count(sigma, CERTAIN) :].T)


def reduce(given: Given) -> Reduced:
    """The reduction.  Raises NoLinearisation."""
    # rows that hold at consistent states: G dz = 0
    rows, system, loose = given.rows, given.system, given.loose
    starter, n = rows.starter, system.form.written
    g = rows.jacobian[rows.holds]
    tangent, moves = _tangent(g, factors(g)[1])
    candidates = candidates_of(system, given.state, n)
    part = tangent[candidates]
    rank = rank_of(part)
    # which unknowns serve as states
    chosen = chosen_states(system, tangent, moves, candidates, loose)
    rates = _rates(starter, system, chosen)
    _refuse_undetermined(system, tangent, part, chosen, rates, rank)
    # right sides: one column a state, then inputs and their rates
    right = np.zeros((g.shape[0], chosen.size + ORDERS * len(given.names)))
    right[:, chosen.size :] = given.right(np.arange(g.shape[0]))

    def make(moved: NDArray[Any], noise: float = NOISE) -> Reduced:
        return _without_rates_of_inputs(given, moved, rates, chosen, noise)

    # once as given, once with other round-off
    small = make(_variations(g, right, chosen, moves))
    again = precise.shaken(g)
    values, others = (np.linalg.eigvals(part) for part in (small.a, make(_variations(again, right, chosen, moves)).a))
    # double precision holds all modes but zeros
    if precise.steady(values[values != 0.0], others[others != 0.0]):
        return small
    # else many digits, where states are few
    if (
        small.names
        and (found := _reduce_precisely(len(small.names), make, (g, again, right, chosen, moves))) is not None
    ):
        return found
    # neither: handed on with what differs
    return replace(small, unsure=make(_variations(again, right, chosen, moves), NOISE).a)


def widely_reduced(given: Given) -> Reduced | None:
    """The reduction with the states chosen in many digits too; None where it is too large or round-off decides their
    number.

    Raises NoLinearisation.
    """
    # as in `reduce`, with the choice in many digits too
    rows, system, loose = given.rows, given.system, given.loose
    starter = rows.starter
    g = rows.jacobian[rows.holds]
    if g.shape[1] > WIDEST:
        return None
    known = candidates_of(system, given.state, system.form.written)
    shown = system.kinds[known] == "q"
    # the last group is free first: displacements
    groups = (known[loose[known]], known[~shown & ~loose[known]], known[shown & ~loose[known]])
    units = factors(g)[1]
    again = precise.shaken(g)
    with precise.digits():
        left, used = precise.free(g, again, units, groups)
    states = np.isin(left, known)
    chosen, held = left[states], left[~states]
    # rates that move with something that is no state
    if _follow(g[used], left, states, units, _rates(starter, system, chosen)):
        return None
    # what the rows leave open beside the states (redundant multipliers) is held
    still = np.zeros((held.size, g.shape[1]))
    still[np.arange(held.size), held] = 1.0
    g, again = (np.vstack([part[used], still]) for part in (g, again))
    right = np.zeros((g.shape[0], chosen.size + ORDERS * len(given.names)))
    right[: used.size, chosen.size :] = given.right(used)
    rates = _rates(starter, system, chosen)

    def make(moved: NDArray[Any], noise: float) -> Reduced:
        return _without_rates_of_inputs(given, moved, rates, chosen, noise)

    return _reduce_precisely(chosen.size, make, (g, again, right, chosen, units))


def _follow(g: Floats, left: NDArray[np.int64], states: Mask, units: Floats, rates: NDArray[np.int64]) -> bool:
    """Whether the rates of states [k] move with what is free [left] and no state: constraints are hidden deeper."""
    # nothing but states is free
    if states.all():
        return False
    with precise.digits():
        found = _moved_widely(g, np.zeros((g.shape[0], left.size)), left, units)
    # the rows leave something open
    if found is None:
        return True
    # rates by what is free and no state, in units of both
    moved = np.abs(precise.narrow(found)[rates][:, ~states]) * units[left[~states]] / units[rates][:, None]
    return bool((moved > TOLERANCE).any())


def _reduce_precisely(
    states: int,
    made: Callable[[NDArray[Any], float], Reduced],
    given: tuple[Floats, Floats, Floats, NDArray[np.int64], Floats],
) -> Reduced | None:
    """The reduction in many digits, where its states are few and the rows determine all."""
    g, again, right, chosen, moves = given
    # none, or too many for many digits
    if not 0 < states <= precise.MOST:
        return None
    with precise.digits():
        one, other = (_moved_widely(part, right, chosen, moves) for part in (g, again))
        # the rows leave one open
        if one is None or other is None:
            return None
        # both made into matrices without rounding
        found, beside = (made(part, precise.NOTHING) for part in (one, other))
        parts = _wide(found, _wide(beside))
        values = precise.decompose(np.asarray(beside.a, dtype=object)).values
        seen = precise.settle_modes(precise.decompose(parts.a), values, describe_lost)
        matrices = (found.a, found.b, found.c, found.d, found.d1, found.d2)
        a, b, c, d, d1, d2 = map(precise.narrow, matrices)
        return Reduced(a, b, c, d, d1, d2, found.places, found.names, parts, seen)


def _wide(small: Reduced, beside: Wide | None = None) -> Wide:
    a, b, c, d = (np.asarray(part, dtype=object) for part in (small.a, small.b, small.c, small.d))
    return Wide(a, b, c, d, beside)


def describe_lost(value: complex) -> NoLinearisation:
    """What is said of an eigenvalue that round-off hides."""
    return NoLinearisation(f"the eigenvalue near {abs(value):.3g} 1/s is lost in the round-off of the fastest")


def _moved_widely(g: Floats, right: Floats, chosen: NDArray[np.int64], moves: Floats) -> precise.Wide | None:
    """The variations of `_variations` in many digits; None where the rows leave one open."""
    # all but the chosen follow from them
    rest = np.setdiff1d(np.arange(g.shape[1]), chosen)
    aim = precise.wide(right)
    aim[:, : chosen.size] -= precise.wide(g[:, chosen])
    # powers of two change no digit
    scale: Floats = np.exp2(np.round(np.log2(moves[rest]))).astype(np.float64)
    found = precise.wide(np.zeros((g.shape[1], right.shape[1])))
    solved = precise.eliminate_consistent(g[:, rest] * scale, aim)
    if solved is None:
        return None
    found[rest] = precise.wide(scale)[:, None] * solved
    # the chosen move as they are told
    found[chosen, np.arange(chosen.size)] += 1
    return found


def _variations(g: Floats, right: Floats, chosen: NDArray[np.int64], moves: Floats) -> Floats:
    """The variations [z, k] with G dz = right, dz = 1 in the chosen places of the first columns, each in its own.

    With rows and unknowns in units in which what moves moves alike, as many rows as unknowns are taken and eliminated:
    zeros stay zeros.  Where rows leave more open than the chosen (redundant multipliers), the least variation is.
    """
    states, rest = chosen.size, np.setdiff1d(np.arange(moves.size), chosen)
    # units of the unknowns, then rows of size one
    scaled = g * moves
    size = np.abs(scaled).max(axis=1, initial=0.0)
    row = 1.0 / np.where(size > 0.0, size, 1.0)
    scaled, aim = row[:, None] * scaled, row[:, None] * right
    # what the chosen contribute goes to the right
    aim[:, :states] -= scaled[:, chosen] / moves[chosen]
    matrix = scaled[:, rest]
    # as many independent rows as unknowns, where there are
    kept = pivots(matrix, rest.size) if matrix.shape[0] >= rest.size else np.zeros(0, dtype=np.int64)
    found = np.zeros((moves.size, right.shape[1]))
    found[rest] = _solve_consistent(matrix, aim, kept)
    # round-off beside the largest of a column is zero
    found[rest] = np.where(np.abs(found[rest]) > NOISE * np.abs(found[rest]).max(axis=0, initial=0.0), found[rest], 0.0)
    found[chosen, np.arange(states)] = 1.0 / moves[chosen]
    return moves[:, None] * found


def _solve_consistent(matrix: Floats, aim: Floats, kept: NDArray[np.int64]) -> Floats:
    """The solution of consistent equations by rows that determine it, its residual small beside the terms of each row
    (Skeel 1980); by singular values where none do.
    """
    # a square part that is regular: elimination, improved twice
    square = matrix[kept]
    solve = _inverse(square)
    if solve is not None:
        found = solve(aim[kept])
        for _ in range(2):
            found = found + solve(aim[kept] - square @ found)
        return np.asarray(found)
    # no such part: the least solution
    found = least_squares(matrix, aim, 1e-14)
    for _ in range(2):
        found = found + least_squares(matrix, aim - matrix @ found, 1e-14)
    return found


def _inverse(square: Floats) -> Callable[[Floats], Floats] | None:
    """What solves by a square matrix; None where singular values say that it has no inverse."""
    # large: a triangular factor, where its rank is sure
    sure = sure_solver(square, CERTAIN) if square.shape[0] > FEW else None
    if sure is not None:
        return sure
    # singular values say that it has no inverse
    if not square.size or count(singular_values(square), CERTAIN) < square.shape[0]:
        return None
    return lambda aim: np.asarray(np.linalg.solve(square, aim), dtype=np.float64)


def _rates(starter: Starter, system: System, chosen: NDArray[np.int64]) -> NDArray[np.int64]:
    """Place in z of the rate of each state: the flow of a displacement, else the rate itself."""
    at = np.full(system.form.written, -1, dtype=np.int64)
    at[starter.rates] = at.size + np.arange(starter.rates.size)
    at[system.form.k_q] = system.form.k_f
    return at[chosen]


def _refuse_undetermined(
    system: System,
    tangent: Floats,
    part: Floats,
    chosen: NDArray[np.int64],
    rates: NDArray[np.int64],
    rank: int,
) -> None:
    """NoLinearisation where rates of states move though no state does: constraints are hidden deeper than the rows."""
    if part.shape[0] > max(FEW, part.shape[1]):  # the same directions, of a triangle
        part = np.linalg.qr(part)[1]
    # directions in which no state moves
    _, _, vt = singular_decomposition(part) if part.size else (None, None, np.eye(tangent.shape[1]))
    still = tangent @ vt[rank:].T
    # none, or nothing to move
    if not still.size or not rates.size:
        return
    loose = np.abs(still[rates]).max(axis=1) > np.sqrt(TOLERANCE)
    # a rate that moves alone: the rows were not differentiated often enough
    if loose.any():
        names = tuple(system.name(int(k)) for k in chosen[loose])
        raise NoLinearisation(f"the equations do not determine the rate of {', '.join(names[:3])}", names)


def _without_rates_of_inputs(
    given: Given, moved: NDArray[Any], rates: NDArray[np.int64], chosen: NDArray[np.int64], noise: float
) -> Reduced:
    """The matrices of variations `moved` [z, states and inputs and their rates]."""
    starter, system, inputs, out = given.rows.starter, given.system, given.names, given.out
    states, n = chosen.size, system.form.written
    # rates of the states: their own unknowns, or the flows
    yd = np.zeros((n, moved.shape[1]), dtype=moved.dtype)
    yd[starter.rates] = moved[n:]
    yd[system.form.k_q] = moved[system.form.k_f]
    # outputs by unknowns and by rates; cancelled terms are zero
    seen = out.by_y @ moved[:n] + out.by_rate @ yd
    size = np.abs(out.by_y) @ np.abs(moved[:n]) + np.abs(out.by_rate) @ np.abs(yd)
    seen = np.where(np.abs(seen) > noise * size, seen, 0.0)
    slopes = moved[rates]
    # states that nothing depends on drive nothing
    slopes[:, :states][:, given.loose[chosen]] = 0.0
    # columns by states, integrals of inputs, inputs, u', u''
    cut = [0, states, *(states + k * len(inputs) for k in range(1, ORDERS + 1))]
    a, b_, b0, b1, b2 = (slopes[:, i:j] for i, j in pairwise(cut))
    c, d_, d0, d1, d2 = (seen[:, i:j] for i, j in pairwise(cut))
    names = tuple(system.name(int(k)) for k in chosen)
    summed = np.flatnonzero(np.abs(np.vstack([b_, d_])).max(axis=0, initial=0.0) > 0.0)
    if summed.size:  # their integrals are states
        own = np.eye(len(inputs))[summed]
        a = np.block([[a, b_[:, summed]], [np.zeros((summed.size, states + summed.size))]])
        b0, b1, b2 = (np.vstack([part, add]) for part, add in ((b0, own), (b1, 0.0 * own), (b2, 0.0 * own)))
        c = np.hstack([c, d_[:, summed]])
        chosen = np.concatenate([chosen, np.full(summed.size, -1)])
        names = (*names, *(integral(inputs[k]) for k in summed))
    # z = x - b1 u - b2 (u' + ...): a state without rates of inputs
    b = b0 + a @ (b1 + a @ b2)
    d0, d1, d2 = (part + own for part, own in zip((d0, d1, d2), out.by_input, strict=True))
    return Reduced(a, b, c, d0 + c @ (b1 + a @ b2), d1 + c @ b2, d2, chosen, names)


def integral(name: str) -> str:
    """The name of the state that is the integral of an input."""
    return f"integral of {name}"
