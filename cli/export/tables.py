"""The numbers of an exported model: everything that binding.json and binding.c print, as frozen values.

A compiled module holds blocks; which of them stand where is an index form.  The tables of one form are taken from the
runtime's own `System`, so that what is called outside is assembled as it is inside, entry by entry.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from sysdyn.runtime.integrate.underlying import Selection
from sysdyn.runtime.model.description import Floats, Ints
from sysdyn.runtime.model.system import System
from sysdyn.values import dataclass

NOTHING: Ints = np.zeros(0, dtype=np.int32)


@dataclass(frozen=True, slots=True)
class BlockCall:
    """A block with its tables at, to, and the places in the pattern of its entries."""

    block: str
    at: Ints
    to: Ints
    dy: Ints
    dyd: Ints


@dataclass(frozen=True, slots=True)
class Assembled:
    """One index form (core/system/assembly.h): sizes, pattern by compressed columns, calls, rows q' - f, held rows."""

    unknowns: int
    rows: int
    extended: int
    column: Ints
    row: Ints
    calls: tuple[BlockCall, ...]
    k_row: Ints
    k_q: Ints
    k_f: Ints
    k_slot_q: Ints
    k_slot_f: Ints
    held_row: Ints
    held_unknown: Ints
    held_slot: Ints
    cleared: Ints

    @property
    def entries(self) -> int:
        """Places of the pattern."""
        return int(self.row.size)


@dataclass(frozen=True, slots=True)
class Stage:
    """One step of a start: rows that hold, unknowns that may move; tried one after the other until one succeeds.

    guess: the solution is the guess of what follows.
    """

    trials: tuple[tuple[Ints, Ints], ...]
    guess: bool = False


@dataclass(frozen=True, slots=True)
class StartTables:
    """How a consistent start is sought at other parameters: x = (y, yd at `rates`).

    written: unknowns of y, those of the start alone among them; known, scale, weight [x]: x as it was bound; how far it
    moves from its guess is measured by weight/scale; initial: places of y that the text gives; k_q, k_f: q' = f.
    """

    system: Assembled
    written: int
    rates: Ints
    initial: Ints
    k_q: Ints
    k_f: Ints
    known: Floats
    scale: Floats
    weight: Floats
    stages: tuple[Stage, ...]


@dataclass(frozen=True, slots=True)
class StateSelection:
    """Index form 0: the differential unknowns of the full layout, and what is solved for (`underlying.h` of the core).

    column, row: pattern of dF/dy + cj dF/dyd, from the components of the matrix.
    """

    places: Ints
    selection: Selection
    column: Ints
    row: Ints


@dataclass(frozen=True, slots=True)
class TracedOutput:
    """A traced quantity: its name, unit (SI), row of block observe."""

    name: str
    unit: str
    place: int


@dataclass(frozen=True, slots=True)
class FollowingGroup:
    """Values that follow from given parameters (compiler/binding/following.py); target: place in p or y."""

    block: str
    kind: str
    entries: int
    source: NDArray[np.int64]
    target: NDArray[np.int64]


@dataclass(frozen=True, slots=True)
class ExportTables:
    """All of one exported model.

    y0, yd0, scale, differential [unknowns of the form]; full_y, full_yd [unknowns of the layout as assembled]; written:
    unknowns as written, before the multipliers nu; followed: those that initial values may tell; at [families]: where
    they begin; audit_at [7]: places behind y.
    """

    form: str
    t0: float
    p: Floats
    ix: Ints
    following_ix: Ints
    y0: Floats
    yd0: Floats
    full_y: Floats
    full_yd: Floats
    scale: Floats
    differential: Ints
    written: int
    followed: int
    at: Ints
    system: Assembled
    state: StateSelection | None
    start: StartTables | None
    groups: tuple[FollowingGroup, ...]
    structural: Ints
    outputs: tuple[TracedOutput, ...]
    observe: BlockCall | None
    observed: int
    audit: BlockCall | None
    audited: int
    audit_at: Ints


def assembly_tables(system: System) -> Assembled:
    """The tables of a system."""
    form, slots = system.form, system.slots
    calls = tuple(
        BlockCall(planned.block, planned.at, planned.to, slots[2 * k + 2], slots[2 * k + 3])
        for k, planned in enumerate(form.calls)
    )
    # rows that a held unknown replaces
    held_row, held_unknown = system.held
    cleared = np.flatnonzero(np.isin(system.pattern.row, held_row)).astype(np.int32)
    return Assembled(
        form.unknowns,
        form.rows,
        form.extended,
        system.pattern.column,
        system.pattern.row,
        calls,
        form.k_row,
        form.k_q,
        form.k_f,
        slots[0],
        slots[1],
        held_row,
        held_unknown,
        slots[-1],
        cleared,
    )
