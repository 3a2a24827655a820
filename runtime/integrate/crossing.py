"""What happens where the text jumps or an event has changed what holds: a consistent point, and on from it."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from sysdyn.runtime.integrate.causes import failure
from sysdyn.runtime.integrate.segments import Segment
from sysdyn.runtime.model import core_library as lib
from sysdyn.runtime.model.description import Floats
from sysdyn.runtime.start.restart import still

if TYPE_CHECKING:
    from sysdyn.runtime.integrate.integrate import Integration


def cross(run: Integration, segment: Segment) -> None:
    """Restarts behind the instant at which the segment before this one ended."""
    n, method = run.system.form.written, run.method.contents
    if run.pieces is None:  # nobody asks for what the last step made
        run.method.rest()
    y, yd = run.method.point()
    run.sizes.share(y)
    y, yd, _ = run.settler.settle(method.t, y[:n], yd[:n])
    if run.pieces is not None:
        found: tuple[Floats, Floats] | None = run.pieces.jump(segment, y, yd)
    else:
        found = _across(run, segment.begin, y, yd)
    if found is None:
        raise failure(run, "newton")
    run.driver.leave(y, yd)
    run.settlers.rest()
    method.t_end = segment.end
    point = [*found]
    del y, yd, found  # of a large run the room counts
    go_on(run, segment.begin, segment.label, point)
    run.driver.run.start_kind = 0


def _across(run: Integration, t: float, y: Floats, yd: Floats) -> tuple[Floats, Floats] | None:
    """The point behind a jump of the text at t (s); where no state jumps, what is left of the unknowns tells."""
    settlers, forms = run.settlers, run.forms
    if forms is not None and settlers.whole_form == "settled":
        n = run.system.form.written
        found = still(run.settler, t, (y, yd), settlers.keeps, run.sizes.magnitude[:n])
        if found is not None:
            return found
    return settlers.restart.across(t, y if forms is None else forms.completed(t, y), yd)


def go_on(run: Integration, t: float, label: float, point: list[Floats]) -> None:
    """Restarts at t (s) from a point [unknowns as written], which is taken out, with the row of the instant `label`;
    the point before it was left (`Driver.leave`).
    """
    n = run.system.form.written
    if run.pieces is None:  # nobody else has its address
        run.start_rate = np.zeros(run.system.unknowns)
        run.driver.run.start_rate = lib.pointer(run.start_rate)
    y, run.start_rate[:] = np.zeros(run.system.unknowns), 0.0
    run.start_rate[:n] = point.pop()
    y[:n] = point.pop()
    run.method.rest()
    yd = np.where(run.roles.differential, run.start_rate, 0.0)
    run.sizes.begin_to_move(t, y, run.start_rate)
    run.sizes.resolve(t, y, yd, run.roles.state)
    run.sizes.hand_down()
    run.method.begin(y, yd)
    lib.core.sd_run_restart(run.driver.core, t, label, lib.pointer(y), lib.pointer(yd))
    if run.pieces is None:  # the next restart has its own
        run.start_rate, run.driver.run.start_rate = np.zeros(0), None
