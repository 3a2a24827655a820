"""Counted work of a run, the same on every machine: what its counters cost in ns of one.

work = run + rows (row + row_entry x entries) + steps (step + step_unknown x unknowns)
           + entries (evaluation x residuals + matrix x (Jacobians + factorisations))

with the size of the index form of the run; row_bent in the place of row_entry where slopes of constraints change: each
row of the trace is then settled by factors of its own.  Steps that were refused count.
"""

from __future__ import annotations

from collections.abc import Mapping

from sysdyn.values import dataclass


@dataclass(frozen=True, slots=True)
class Size:
    """Of an index form: unknowns, entries of the Jacobian's pattern; bent: slopes of its constraints change."""

    unknowns: int
    entries: int
    bent: bool


@dataclass(frozen=True, slots=True)
class Costs:
    """ns of a two-core cloud machine.  run: the start of one, with code that is read for the first time."""

    run: float
    row: float
    row_entry: float
    row_bent: float
    step: float
    step_unknown: float
    evaluation: float
    matrix: float


COSTS = {
    "dopri": Costs(39200.0, 271.0, 20.6, 14.0, 283.0, 218.0, 0.0, 0.0),
    "rosenbrock": Costs(49000.0, 191.0, 16.3, 101.0, 771.0, 0.0, 0.0, 14.9),
    "radau": Costs(83300.0, 302.0, 15.2, 100.0, 0.0, 151.0, 4.5, 9.5),
    "bdf": Costs(55000.0, 236.0, 14.4, 105.0, 317.0, 13.2, 2.8, 7.3),
}
"""Least squares of the relative difference from the CPU time of NNNN runs (PPPP)."""


COUNTED = ("steps", "rejected_steps", "residual_evaluations", "jacobian_evaluations", "factorisations")


def counted(statistics: Mapping[str, int], size: Size, method: str) -> float:
    """Work of the steps of one run.  statistics: as the trace holds them."""
    cost = COSTS[method]
    steps = statistics["steps"] + statistics["rejected_steps"]
    matrices = statistics["jacobian_evaluations"] + statistics["factorisations"]
    once = size.entries * (cost.evaluation * statistics["residual_evaluations"] + cost.matrix * matrices)
    return steps * (cost.step + cost.step_unknown * size.unknowns) + once


def step(size: Size, method: str) -> float:
    """Work of a step at least: one that evaluates the residual once."""
    return counted({**dict.fromkeys(COUNTED, 0), "steps": 1, "residual_evaluations": 1}, size, method)


def fixed(rows: int, size: Size, method: str) -> float:
    """Work of a run and the rows of its trace, whatever the tolerance."""
    cost = COSTS[method]
    return cost.run + rows * (cost.row + (cost.row_bent if size.bent else cost.row_entry) * size.entries)
