"""Where the entries of an index form's Jacobian stand: its pattern, and the place in it of what each block gives."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from sysdyn.runtime.model.description import Description, Ints
from sysdyn.runtime.model.forms import Form, Planned
from sysdyn.runtime.model.held_rows import LeftOut, held_rows, switch_rows
from sysdyn.runtime.model.patterns import Pattern, Places, compress, join, places
from sysdyn.values import dataclass


@dataclass(frozen=True, slots=True)
class JacobianLayout:
    """What of a form depends on the structure alone.  slots: of each part of the matrix in the pattern; entries: of the
    largest part; may_hold: rows, unknowns, slots, switches (-1: always) of the rows that may read "multiplier = 0",
    reads_rate: which of them read its rate.
    """

    pattern: Pattern
    slots: tuple[Ints, ...]
    entries: int
    may_hold: tuple[Ints, Ints, Ints, NDArray[np.int64]]
    reads_rate: Ints


def laid_out(description: Description, form: Form, left_out: LeftOut) -> JacobianLayout:
    """Pattern and slots of a form without these constraints."""
    # rows q' - f, then the entries of each block
    parts = [Places(form.k_row, form.k_q), Places(form.k_row, form.k_f)]
    for call in form.calls:
        parts += entries_of(description, call)
    # rows of multipliers that are left out, or may not hold
    held = held_rows(description, form, left_out)
    times = switch_rows(description, form)
    parts.append(Places(np.concatenate([held[0], times[0]]), np.concatenate([held[1], times[1]])))
    last, sizes = parts[-1], [part.row.size for part in parts]
    parts = [join(parts)]  # of a large one the room counts
    pattern, (number,) = compress(form.rows, form.unknowns, parts)
    slots = [np.ascontiguousarray(piece) for piece in np.split(number, np.cumsum(sizes)[:-1])]
    # -1: left out for good; else the number of its switch
    place = np.concatenate([np.full(held[0].size, -1), times[2]])
    reads_rate = np.concatenate([np.zeros(held[0].size), times[3]]).astype(np.int32)
    at_times = last.row.astype(np.int32), last.column.astype(np.int32), slots[-1].copy(), place
    return JacobianLayout(pattern, tuple(slots), max([*sizes, 1]), at_times, reads_rate)


def entries_of(description: Description, call: Planned) -> tuple[Places, Places]:
    """Where the entries of one call stand: dy, dyd."""
    kernels = description.blocks[call.block]
    shapes = (
        [row.shape for row in description.rows],
        [item.shape for item in description.families],
    )
    dy, dyd = (places(kernels, which, description.ix, shapes, (call.to, call.at)) for which in ("dy", "dyd"))
    return dy, dyd
