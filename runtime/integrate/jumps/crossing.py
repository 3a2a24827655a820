"""What happens where the text jumps or an event has changed what holds: a consistent point, and on from it."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from sysdyn.runtime import tuning
from sysdyn.runtime.integrate.causes import failure
from sysdyn.runtime.integrate.jumps.segments import Segment
from sysdyn.runtime.integrate.request import TRACE
from sysdyn.runtime.model import core_library as lib
from sysdyn.runtime.model.description import Floats

if TYPE_CHECKING:
    from sysdyn.runtime.integrate.integrate import Integration

JUMP = tuning.SAME
"""Of the largest value of a quantity: what it differs by less across an instant is no jump."""


def cross(run: Integration, segment: Segment) -> None:
    """Restarts behind the instant at which the segment before this one ended."""
    n, method = run.system.form.written, run.method.contents
    if run.pieces is None:  # nobody asks for what the last step made
        run.method.rest()
    y, yd = run.method.point()
    run.sizes.share(y)
    # the point before the jump, settled to round-off
    with run.settler.exactly():
        y, yd, _ = run.settler.settle(method.t, y[:n], yd[:n])
        # a row before it only where the trace wants one
        starts = segment.label == run.start.t
        asked = run.driver.asks(segment.label) or starts
        before = run.system.observe(method.t, y, yd) if asked else None
        # events at the same instant happen first
        if run.pieces is not None:
            found: tuple[Floats, Floats] | None = run.pieces.jump(segment, y, yd)
        else:
            found = run.settlers.across(segment.begin, y, yd)
    if found is None:
        raise failure(run, "newton")
    # what is observed jumps: rows on both sides
    if before is not None and _jumps(run, before, run.system.observe(segment.begin, *found)):
        if starts:
            run.driver.run.start_kind = TRACE
        else:
            _row_before(run)
    (run.pieces or run.driver).leave(y, yd)
    run.settlers.rest()
    method.t_end = segment.end
    point = [*found]
    del y, yd, found  # of a large run the room counts
    go_on(run, segment.begin, segment.label, point)
    run.driver.run.start_kind = 0


def _jumps(run: Integration, before: Floats, behind: Floats) -> bool:
    """Whether observed values [observed] differ by more than the run's tolerance of their largest."""
    size = np.maximum(run.driver.largest()[: before.size], np.maximum(np.abs(before), np.abs(behind)))
    return bool((np.abs(behind - before) > max(run.request.rtol, JUMP) * size).any())


def _row_before(run: Integration) -> None:
    """The row of the end of the last step; events that happen where the text jumps have written theirs."""
    # without events the core writes it
    if run.pieces is None:
        lib.core.sd_run_row(run.driver.core, TRACE)
    elif not run.driver.run.start_kind:
        run.pieces.row_before()


def go_on(run: Integration, t: float, label: float, point: list[Floats]) -> None:
    """Restarts at t (s) from a point [unknowns as written], which is taken out, with the row of the instant `label`;
    the point before it was left (`Driver.leave`).
    """
    n = run.system.form.written
    # rates go to an array of their own
    if run.pieces is None:  # nobody else has its address
        run.start_rate = np.zeros(run.system.unknowns)
        run.driver.run.start_rate = lib.pointer(run.start_rate)
    y, run.start_rate[:] = np.zeros(run.system.unknowns), 0.0
    run.start_rate[:n] = point.pop()
    y[:n] = run.driver.arrive(t, point.pop(), run.start_rate[:n], run.sizes.magnitude)
    # the method's step is over; sizes may have grown
    run.method.rest()
    run.sizes.begin_to_move(t, run.method.contents.t_end, y, run.start_rate)
    with run.room_left():
        run.sizes.resolve(t, y, run.start_rate, run.roles)
        run.sizes.hand_down()
    yd = np.where(run.roles.differential, run.start_rate, 0.0)
    run.method.begin(y, yd)
    lib.core.sd_run_restart(run.driver.core, t, label, lib.pointer(y), lib.pointer(yd))
    if run.pieces is None:  # the next restart has its own
        run.start_rate, run.driver.run.start_rate = np.zeros(0), None
