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


SETTLED = (293.0, 12.6, 71.0)
"""A row of a method whose points are settled by the least change."""
COSTS = {
    "dopri": Costs(45900.0, 85.0, 38.0, 22.6, 0.0, 230.0, 0.0, 0.0),
    "rosenbrock": Costs(49800.0, *SETTLED, 477.0, 41.1, 0.0, 14.0),
    "radau": Costs(105000.0, *SETTLED, 0.0, 8.8, 3.85, 31.9),
    "bdf": Costs(55900.0, *SETTLED, 369.0, 3.2, 2.58, 0.0),
}
"""Robust least squares of relative differences from the CPU times of 4710 runs: 46 seed and 12 benchmark models in
Lagrange's and Hamilton's form, all index forms, two tolerances, rows of the scene and both ends alone.  Of 447 choices
among what was run of one model the least work cost 1.08 times the least CPU in the mean, 1.31 times at most of nine in
ten, 3.4 times of all."""


def work_of_steps(statistics: Mapping[str, int], size: Size, method: str) -> float:
    """Work of the steps of one run.  statistics: as the trace holds them."""
    cost = COSTS[method]
    steps = statistics["steps"] + statistics["rejected_steps"]
    matrices = statistics["jacobian_evaluations"] + statistics["factorisations"]
    once = size.entries * (cost.evaluation * statistics["residual_evaluations"] + cost.matrix * matrices)
    return steps * (cost.step + cost.step_unknown * size.unknowns) + once


def step(size: Size, method: str) -> float:
    """Work of a step at least: one that evaluates the residual once."""
    cost = COSTS[method]
    return cost.step + cost.step_unknown * size.unknowns + cost.evaluation * size.entries


def work_of_rows(rows: int, size: Size, method: str) -> float:
    """Work of a run and the rows of its trace, whatever the tolerance."""
    cost = COSTS[method]
    return cost.run + rows * (cost.row + (cost.row_bent if size.bent else cost.row_entry) * size.entries)
