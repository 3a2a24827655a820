"""Sparsity by index arithmetic: kernels of a block -> rows and columns of its entries -> one fixed pattern.

No loop over elements: a kernel of 10^5 iterations costs a few NumPy operations.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray
from sysdyn.runtime.model import core_library as lib
from sysdyn.runtime.model.description import Index, Ints, Kernel, Reference, Shape, count
from sysdyn.runtime.model.failures import ContractError
from sysdyn.values import dataclass

Longs = NDArray[np.int64]
KEPT = 200_000
"""Entries up to which the columns of a pattern are kept: of large ones they are made anew in milliseconds."""
Array = TypeVar("Array", bound=NDArray[Any])


@dataclass(frozen=True, slots=True)
class Places:
    """Entries in the order of the block's list: row, column [entries]."""

    row: NDArray[np.integer]
    column: NDArray[np.integer]


@dataclass(frozen=True)
class Pattern:
    """Compressed columns: column [unknowns + 1], row [entries]; rows ascend within a column."""

    rows: int
    unknowns: int
    column: Ints
    row: Ints

    @property
    def entries(self) -> int:
        """Number of places."""
        return int(self.row.size)

    def columns_of(self) -> Ints:
        """Column of each entry [entries]; read-only."""
        return self._columns if self.entries <= KEPT else self._make()

    @cached_property
    def _columns(self) -> Ints:
        return self._make()

    def _make(self) -> Ints:
        found = np.empty(self.entries, dtype=np.int32)
        lib.core.sd_firsts(self.unknowns, lib.pointer(self.column), lib.pointer(found))
        return read_only(found)


def read_only(array: Array) -> Array:
    """The array, which nobody may change from now on: several hold it."""
    array.flags.writeable = False
    return array


def _value(index: Index, columns: list[Longs], number: int, ix: Ints) -> Longs:
    """Value of an index in each iteration [number]."""
    loop, slot, constant, *table = index
    base = constant + (int(ix[slot]) if slot >= 0 else 0)
    # no loop: one value; else the loop's, moved
    value = np.full(number, base, dtype=np.int64) if loop < 0 else columns[loop] + base
    # tables of indices, one after the other: nodes[i]
    for place in table:
        value = ix[ix[place] + value].astype(np.int64)
    return value


def _iterations(kernel: Kernel, ix: Ints) -> list[Longs]:
    """Value of each loop variable in each iteration, last loop fastest; inner bounds may follow outer loops."""
    columns: list[Longs] = []
    # from the outermost loop inwards
    for first, last in kernel.loops:
        number = columns[0].size if columns else 1
        low = _value(first, columns, number, ix)
        # an empty inner loop has no iterations
        count = np.maximum(_value(last, columns, number, ix) - low + 1, 0)
        start = np.cumsum(count) - count
        inner = np.arange(int(count.sum()), dtype=np.int64) + np.repeat(low - start, count)
        columns = [*(np.repeat(column, count) for column in columns), inner]
    return columns


def iterations(kernel: Kernel, ix: Ints) -> int:
    """How many iterations a kernel has."""
    return int(_iterations(kernel, ix)[0].size) if kernel.loops else 1


def _positions(reference: Reference, shape: Shape, loops: list[Longs], number: int, ix: Ints) -> Longs:
    """Row-major position in its family in each iteration [number]."""
    position: Longs | None = None
    # a manifest that does not fit the binding
    if len(reference.indices) != len(shape):
        raise ContractError(f"a reference with {len(reference.indices)} indices into a family with {len(shape)}")
    for index, (first, last) in zip(reference.indices, shape, strict=True):
        value = _value(index, loops, number, ix)
        # an index out of its family would read elsewhere
        if number and (value.min() < first or value.max() > last):
            raise ContractError(f"an index runs over {value.min()}..{value.max()} outside {first}..{last}")
        value -= first
        position = value if position is None else position * (last - first + 1) + value
    return np.zeros(number, dtype=np.int64) if position is None else position


def _place(reference: Reference, shape: Shape, ix: Ints) -> int:
    """Row-major position in its family where no loop goes round."""
    position = 0
    if len(reference.indices) != len(shape):
        raise ContractError(f"a reference with {len(reference.indices)} indices into a family with {len(shape)}")
    # as `_positions`, with one number
    for index, (first, last) in zip(reference.indices, shape, strict=True):
        _, slot, constant, *table = index
        value = constant + (int(ix[slot]) if slot >= 0 else 0)
        for listed in table:
            value = int(ix[ix[listed] + value])
        if not first <= value <= last:
            raise ContractError(f"an index runs over {value}..{value} outside {first}..{last}")
        position = position * (last - first + 1) + value - first
    return position


def places(
    kernels: Sequence[Kernel],
    which: str,
    ix: Ints,
    shapes: tuple[Sequence[Shape], Sequence[Shape]],
    tables: tuple[Ints, Ints],
) -> Places:
    """Rows and columns of the entries `which` ("dy" or "dyd") of a block.

    shapes: of row families and unknown families; tables: `to` and `at`.
    """
    all_rows: list[Ints] = []
    all_columns: list[Ints] = []
    for kernel in kernels:
        entries = kernel.dy if which == "dy" else kernel.dyd
        # a block without slopes by these
        if not entries:
            continue
        # a scalar: numbers are enough
        if not kernel.loops:
            for side, into in ((0, all_rows), (1, all_columns)):
                at, boxes = tables[side], shapes[side]
                own = [int(at[p[side].family]) + _place(p[side], boxes[p[side].family], ix) for p in entries]
                into.append(np.array(own, dtype=np.int32))
            continue
        # in a loop: arrays, entries of one iteration one behind the other
        loops = _iterations(kernel, ix)
        number = loops[0].size
        for side, into in ((0, all_rows), (1, all_columns)):
            found = [
                int(tables[side][pair[side].family])
                + _positions(pair[side], shapes[side][pair[side].family], loops, number, ix)
                for pair in entries
            ]
            into.append(np.stack(found, axis=1, dtype=np.int32).ravel())
    empty = np.zeros(0, dtype=np.int32)
    return Places(
        np.concatenate(all_rows) if all_rows else empty, np.concatenate(all_columns) if all_columns else empty
    )


def spared_loops(
    kernels: Sequence[Kernel], read: NDArray[np.bool_], ix: Ints, shapes: Sequence[Shape], to: Ints
) -> Ints:
    """1 for each loop of a block [kernels] that adds to none of the rows that are read [rows].  shapes, to: of row
    families.
    """
    found = np.zeros(len(kernels), dtype=np.int32)
    for k, kernel in enumerate(kernels):
        # None: it does not say which rows it adds to
        if kernel.rows:
            sizes = ((row, int(to[row.family]), count(shapes[row.family])) for row in kernel.rows)
            # families of which some row is read
            some = [(row, first) for row, first, size in sizes if read[first : first + size].any()]
            loops = _iterations(kernel, ix) if some else []
            number = loops[0].size if loops else 0
            places = (first + _positions(row, shapes[row.family], loops, number, ix) for row, first in some)
            found[k] = not any(read[place].any() for place in places)
    return found


def join(parts: Sequence[Places]) -> Places:
    """All parts one behind the other (int32)."""
    if len(parts) == 1:
        return Places(*(np.asarray(item, dtype=np.int32) for item in (parts[0].row, parts[0].column)))
    empty = np.zeros(0, dtype=np.int32)
    row, column = (
        np.concatenate([empty, *(np.asarray(getattr(part, side), dtype=np.int32) for part in parts)])
        for side in ("row", "column")
    )
    return Places(row, column)


def compress(rows: int, unknowns: int, parts: Sequence[Places]) -> tuple[Pattern, list[Ints]]:
    """One pattern that holds all parts, and for each part the place of each of its entries (int32)."""
    one = join(parts)
    row, column = one.row, one.column
    # beyond the matrix: a manifest that does not fit
    if row.size and (row.min() < 0 or row.max() >= rows or column.min() < 0 or column.max() >= unknowns):
        raise ContractError("an entry lies outside the matrix")
    # sorted by columns, equal places once
    number, starts, own = number_pairs(column, row, unknowns, rows)
    cuts = np.cumsum([part.row.size for part in parts])[:-1]
    slots = [np.ascontiguousarray(piece) for piece in np.split(number, cuts)]
    return Pattern(rows, unknowns, starts, own), slots


def number_pairs(
    first: NDArray[np.integer], second: NDArray[np.integer], firsts: int, seconds: int
) -> tuple[Ints, Ints, Ints]:
    """The place of each pair [entries] among the distinct ones in ascending order; where those of each first begin
    [firsts + 1]; the second of each distinct pair; first below firsts, second below seconds.
    """
    number, start = np.empty(first.size, dtype=np.int32), np.empty(max(firsts, 1) + 1, dtype=np.int32)
    each = np.empty(first.size, dtype=np.int32)
    pair = tuple(np.ascontiguousarray(item, dtype=np.int32) for item in (first, second))
    arrays = map(lib.pointer, (*pair, number, start, each))
    count = lib.core.sd_pairs(number.size, max(firsts, 1), max(seconds, 1), *arrays)
    # the core found no memory
    if count < 0:
        raise MemoryError
    return number, start[: firsts + 1], each[:count].copy()
