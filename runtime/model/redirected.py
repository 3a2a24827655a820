"""A system whose blocks write the entries of its Jacobian elsewhere: where who reads them wants them.

Received: a `System` and the places that stand for those of its pattern; handed on: the core's structure.
"""

from __future__ import annotations

import ctypes as c
from typing import Any

from sysdyn.runtime.model import core_library as lib
from sysdyn.runtime.model.description import Ints
from sysdyn.runtime.model.lines import shapes_of, stretches_of, table
from sysdyn.runtime.model.system import LARGE, System
from sysdyn.values import dataclass


@dataclass(frozen=True, slots=True)
class Redirected:
    """The core's structure, its calls, and what both point to."""

    core: lib.System
    calls: Any
    keep: list[Any]

    @property
    def address(self) -> int:
        """Of the core's structure."""
        return c.addressof(self.core)


def redirect_entries(system: System, dy: Ints, dyd: Ints, entries: int) -> Redirected:
    """With the entries of dF/dy, dF/dyd in other places, so many in all: dy, dyd [entries of the pattern]."""
    # the core's structure, copied; calls of its own
    made = lib.System.from_buffer_copy(system.core)
    calls = (lib.Call * max(len(system.form.calls), 1))()
    keep: list[Any] = [calls, system.work]
    for k, planned in enumerate(system.form.calls):
        calls[k] = system.calls[k]
        # slots of this call: behind those of q' - f, two a call
        for which, number, slots in (("dy", dy, system.slots[2 * k + 2]), ("dyd", dyd, system.slots[2 * k + 3])):
            keep.append(_redirect_call(system, calls[k], planned.block, which, number[slots]))
    made.call, made.entries, made.column, made.row = c.addressof(calls), entries, None, None
    return Redirected(made, calls, keep)


def _redirect_call(system: System, call: lib.Call, block: str, which: str, slots: Ints) -> Any:
    """Tells a call where the entries of its list dy or dyd stand; of a large system by stretches, where these are few.
    What has to be kept for it.
    """
    # of a large system lines that repeat are shorter than places
    found = None
    if system.unknowns > LARGE:
        found = stretches_of([slots], shapes_of(system.description.blocks[block], which, system.description.ix))
    # places one by one
    if found is None:
        setattr(call, f"slot_{which}", lib.pointer(slots))
        return slots
    # first line and step of each stretch
    tables = [table(slots, stretch) for stretch in found]
    lines = (lib.Lines * max(len(found), 1))()
    for k, ((_, number, width), (first, step)) in enumerate(zip(found, tables, strict=True)):
        lines[k] = lib.Lines(number, width, lib.pointer(first), lib.pointer(step))
    setattr(call, f"slot_{which}", None)
    setattr(call, f"stretches_{which}", len(found))
    setattr(call, f"lines_{which}", c.addressof(lines))
    return tables, lines
