"""What a condition says of relations, what is assigned where it becomes true, and what follows of that at once."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np
from numpy.typing import NDArray
from sysdyn.runtime.events.plan import Assignment, Condition, Relation
from sysdyn.runtime.model.description import Floats
from sysdyn.runtime.model.failures import SolverFailure
from sysdyn.runtime.model.system import System
from sysdyn.runtime.numerics.rank import NotFiniteError, least_squares
from sysdyn.values import dataclass


@dataclass(frozen=True, slots=True)
class Round:
    """One round of assignments, event by event, and the sides [relations] behind it."""

    groups: tuple[tuple[Assignment, ...], ...]
    sides: Floats


def holds(condition: Condition, sides: Floats, relations: Sequence[Relation], crossed: Sequence[int]) -> bool:
    """Whether a condition holds where relations stand on these sides [relations] of zero; crossed: those that are zero
    at this instant alone.
    """
    match condition[0]:
        # of parts: by their own truth
        case "and":
            return all(holds(c, sides, relations, crossed) for c in condition[1:])
        case "or":
            return any(holds(c, sides, relations, crossed) for c in condition[1:])
        case "not":
            return not holds(condition[1], sides, relations, crossed)
    # a relation by its number and operator
    _, k, operator = condition
    side = sides[k]
    if operator in ("==", "!=") and relations[k].moves:
        return bool((k in crossed) == (operator == "=="))  # equal at the instant of a crossing alone
    # equality of what jumps: `mode == 2` holds as long as it does
    if operator in ("==", "!="):
        return bool((side == 0.0) == (operator == "=="))
    strict = {">": side > 0.0, "<": side < 0.0, ">=": side >= 0.0, "<=": side <= 0.0}
    return bool(strict[operator])


class Conditions:
    """The conditions of a plan's events; those are asked again of whose relations one has changed its side."""

    def __init__(self, conditions: Sequence[Condition], relations: Sequence[Relation]) -> None:
        self._conditions, self._relations = conditions, relations
        # conditions by the relations that they read
        self._of: list[list[int]] = [[] for _ in relations]
        for k, condition in enumerate(conditions):
            for relation in _relations_of(condition):
                self._of[relation].append(k)
        self._sides = np.full(len(relations), np.nan)
        self._held = np.array([holds(c, np.zeros(len(relations)), relations, ()) for c in conditions], dtype=bool)

    def hold(self, sides: Floats, crossed: Sequence[int] = ()) -> NDArray[np.bool_]:
        """Which hold [conditions] where relations stand on these sides; crossed: as of `holds`."""
        # asked anew only where a side has changed
        self._ask(np.flatnonzero(sides != self._sides), sides, (), self._held)
        self._sides[:] = sides
        found = self._held.copy()
        # equalities that hold at this instant alone
        if len(crossed):
            self._ask(crossed, sides, crossed, found)
        return found

    def _ask(self, changed: Iterable[int], sides: Floats, crossed: Sequence[int], held: NDArray[np.bool_]) -> None:
        for k in {k for relation in changed for k in self._of[relation]}:
            held[k] = holds(self._conditions[k], sides, self._relations, crossed)


def _relations_of(condition: Condition) -> set[int]:
    """Numbers of the relations that a condition asks."""
    if condition[0] == "relation":
        return {condition[1]}
    return {k for part in condition[1:] for k in _relations_of(part)}


def with_momenta(settled: System, t: float, y: Floats, yd: Floats) -> Floats:
    """Y with the momenta that follow from flows that were assigned: the rows of block momentum, solved for p;
    SolverFailure where that comes to no numbers.
    """
    rows = np.flatnonzero(settled.of_groups("momentum"))
    p = np.flatnonzero(settled.kinds == "p")
    # momenta are linear in flows but for what moves with them: three passes
    for _ in range(3 if rows.size else 0):
        jy, _ = settled.jacobian(t, y, yd)
        matrix = settled.dense(jy)[np.ix_(rows, p)]
        y = y.copy()
        try:
            y[p] -= least_squares(matrix, settled.residual(t, y, yd)[rows])
        except NotFiniteError as error:
            raise SolverFailure("nonfinite", t, 0.0, row=settled.row_label(int(rows[0]))) from error
    return y
