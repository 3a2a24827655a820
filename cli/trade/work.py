"""Counted work of a run: matrix entries touched, the same on every machine.

work = rows of the trace + HISTORY x unknowns x steps + entries x (residuals + Jacobians + FACTOR x factorisations),
with the entries of the Jacobian's pattern in the index form of the run.  Fitted to the CPU time of 60 runs of seed
models at 1e-9 (bdf, radau, dopri; 2 to 50 unknowns): within 35 % of it among the methods of one model.
"""

from __future__ import annotations

from collections.abc import Mapping

HISTORY = 12.0
"""Passes over the unknowns in a step: predicting, correcting, weighing errors."""
PROJECTED = 12.0
"""More of them where a form of index 1 or 0 is brought back to its constraints after each step."""
FACTOR = {"radau": 5.0}
"""A real and a complex matrix; one of the others."""
ROW, ROW_OF = 12.0, {"dopri": 9.0}
"""Passes over the entries for a row of the trace: it is interpolated, settled, observed, its energies are read."""


def counted(statistics: Mapping[str, int], size: tuple[int, int], method: str, *, projected: bool) -> float:
    """Work of the steps of one run.  statistics: as the trace holds them; size: unknowns, entries of the form."""
    unknowns, entries = size
    passes = HISTORY + (PROJECTED if projected and method != "dopri" else 0.0)
    matrices = statistics["residual_evaluations"] + statistics["jacobian_evaluations"]
    factored = FACTOR.get(method, 1.0) * statistics["factorisations"]
    tried = statistics["steps"] + statistics["rejected_steps"]
    return passes * unknowns * tried + entries * (matrices + factored)


def of_rows(number: int, size: tuple[int, int], method: str) -> float:
    """Work of the rows of a trace, whatever the tolerance."""
    return ROW_OF.get(method, ROW) * size[1] * number
