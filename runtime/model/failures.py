"""What the runtime raises: one class an audience, each with its data in fields.

`SolverFailure` the integration stopped (exit 3), `InconsistentStart` the initial values (E903, E505, E510, E519),
`TraceError` input or output (exit 5), `ContractError` a compiled model that is none (a fault, exit 4).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from sysdyn.values import dataclass


@dataclass(frozen=True, slots=True)
class RowLabel:
    """Where a row or an initial value stands in the author's text: label, kind, element index, file, line.

    unit: of what the row leaves over; of a row that is a derivative by time, of the row that it is the derivative of.
    slope: what the slope of its law does at a point at which it has none: vanishes, or grows without bound.
    """

    label: str
    kind: str = ""
    file: str = ""
    line: int = 0
    slope: str = ""
    unit: str = ""

    def __str__(self) -> str:
        place = f" ({self.file}:{self.line})" if self.file else ""
        return f"{self.label}{place}"


class ContractError(Exception):
    """A compiled model does not keep the contract of core/system/model.h."""


class TraceError(Exception):
    """The trace cannot be written or read."""


class WrongOption(Exception):  # noqa: N818
    """An option of a simulation that makes no sense; the message says what would."""


class NoSuchForm(Exception):  # noqa: N818
    """The asked index form or method is impossible for the model (E607); the message says what is possible.

    rows: of laws in the way.
    """

    def __init__(self, message: str, rows: tuple[RowLabel, ...] = ()) -> None:
        super().__init__(message)
        self.rows = rows


class SolverFailure(Exception):  # noqa: N818 (a name of the house)
    """The integration stopped at `time` [s] with step `step` [s].

    cause: newton, error_test, singular, inertia, nonfinite, step_too_small, crawl, stiff, strained, max_steps,
    max_wall, memory.
    unknown: name of the unknown in the way, row: its row; None where the cause has no place; smooth: the bdf took
    nearly all steps at its highest order; late: no wall time is left for another run.
    """

    def __init__(
        self,
        cause: str,
        time: float,
        step: float,
        unknown: str | None = None,
        row: RowLabel | None = None,
        *,
        smooth: bool = False,
    ) -> None:
        self.smooth, self.late = smooth, False
        self.cause, self.time, self.step, self.unknown, self.row = cause, time, step, unknown, row
        self.partial: object = None
        self.state: tuple[float, NDArray[np.float64], NDArray[np.float64]] | None = None
        """t [s], y, yd [unknowns as written] at the last good point."""
        # where it is known: the row and the unknown that gave way
        place = "".join(
            [f", row {row}" if row else "", f", unknown {unknown}" if unknown else ""],
        )
        super().__init__(f"{cause} at t = {time:.17g} s, step {step:.3g} s{place}")


class InconsistentStart(Exception):  # noqa: N818
    """No consistent state exists at t0, or none was found.

    kind: "fixed" fixed initial values contradict each other or the rows; "gamma" an effort constraint has no
    solution; "implicit" the effort constraints do not determine an implicit unknown; "nonfinite" the residual is
    not a number; "slope" a law is flat, or infinitely steep, where the equations hold, and no rate follows; "stuck" the
    iteration did not converge.
    rows: labels in the way; residual: smallest residual reached, in the first row's unit ("stuck": as a part of the
    row's terms); candidates: labels of the fixed values to free, best first; names: the unknowns concerned.
    """

    def __init__(
        self,
        kind: str,
        residual: float,
        rows: tuple[RowLabel, ...] = (),
        candidates: tuple[RowLabel, ...] = (),
        names: tuple[str, ...] = (),
    ) -> None:
        self.kind, self.residual = kind, residual
        self.rows, self.candidates, self.names = rows, candidates, names
        # rows if there are any, else the unknowns
        where = ", ".join(map(str, rows)) or ", ".join(names)
        free = f"; fixed values in the way: {', '.join(map(str, candidates))}" if candidates else ""
        super().__init__(f"{kind}: residual {residual:.3g} in {where}{free}")
