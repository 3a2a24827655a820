"""What a run that fails says: the cause that the core gave, with the unknown and the row that it comes from."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from sysdyn.runtime.model import core_library as lib
from sysdyn.runtime.model.failures import RowLabel, SolverFailure
from sysdyn.runtime.numerics.rank import NotFiniteError
from sysdyn.runtime.structure.structure import DENSE, null_place

if TYPE_CHECKING:
    from sysdyn.runtime.integrate.integrate import Integration

NEWTON = ("newton", "step_too_small", "crawl", "error_test", "singular")
"""Causes behind which the equations themselves may be singular."""


def failure(run: Integration, cause: str) -> SolverFailure:
    """The failure of a run at the last accepted point."""
    method = run.method.contents
    lost = run.driver.ledgers.lost
    # inertia became negative: that is the cause, whatever gave way
    if lost is not None:
        return SolverFailure("inertia", method.t, method.h, None, lost)
    unknown: str | None = None
    row: RowLabel | None = None
    # the row of the last matrix
    if cause in ("singular", "nonfinite") and 0 <= method.bad_row < run.stepped.rows:
        row = run.stepped.row_label(method.bad_row)
    if cause == "singular":
        unknown = run.stepped.name(method.bad_column)
    if cause in NEWTON and run.system.unknowns <= DENSE:
        # where the equations themselves are singular there, say so, with the place
        names, at = _null_place(run)
        if names:
            return SolverFailure("singular", method.t, method.h, ", ".join(names[:3]), run.system.row_label(at))
        cause = "newton" if cause == "singular" else cause
    # which unknown moved most against its weight
    if cause in ("error_test", "step_too_small", "crawl", "newton"):
        unknown = _worst(run)
    return SolverFailure(cause, method.t, method.h, unknown, row, smooth=run.work[1])


def place_failure(run: Integration, cause: str) -> SolverFailure:
    """The failure with the last good point."""
    found = failure(run, cause)
    n, (y, yd) = run.system.form.written, run.method.point()
    found.state = (run.method.contents.t, y[:n].copy(), yd[:n].copy())
    return found


def _null_place(run: Integration) -> tuple[tuple[str, ...], int]:
    """Unknowns and row of a singular pencil at the last accepted point; () where it is regular, or not finite."""
    y, yd = run.method.point()
    jy, jyd = run.system.jacobian(run.method.contents.t, y, yd)
    try:
        with np.errstate(all="ignore"):
            # the null vector of the pencil, by names
            return null_place(run.system, jy, jyd)
    except NotFiniteError:  # nor need slopes be that lie too far apart (a junction far above its voltage)
        return (), -1


def _worst(run: Integration) -> str | None:
    """The unknown with the largest weighted correction in the last step; None of a method that rests."""
    method, n = run.method.contents, run.stepped.unknowns
    if not method.ee:
        return None
    with np.errstate(over="ignore", invalid="ignore"):  # a correction that has no bounds
        change = np.abs(lib.reader(method.ee, n) * lib.reader(method.weight, n))
    change = np.where(np.isfinite(change), change, np.inf)
    # only unknowns that the error test sees
    test = run.told.test
    if (test >= 0).any():
        change[test < 0] = 0.0
    return run.stepped.name(int(np.argmax(change)))
