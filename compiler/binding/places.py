"""Where the rows and entries of a pattern lie, for one binding: index arithmetic over whole loops at once."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from sysdyn.compiler.binding.binding import Binding
from sysdyn.compiler.model.integers import FamilyReference, Index
from sysdyn.compiler.model.parameters import Extents, extents, positions
from sysdyn.compiler.program.program import KernelPattern, Program

Whole = NDArray[np.int64]


def starts(shapes: tuple[Extents, ...]) -> NDArray[np.int32]:
    """Where each family begins: `at` (or `to`), and the total at the end."""
    sizes = [int(np.prod(extents(box), dtype=np.int64)) for box in shapes]
    return np.concatenate(([0], np.cumsum(sizes))).astype(np.int32)


def iterations(pattern: KernelPattern, ix: NDArray[np.int32]) -> list[Whole]:
    """Values of each loop variable, last loop fastest; without loops an empty list."""
    columns: list[Whole] = []
    for first, last in pattern.loops:
        size = len(columns[0]) if columns else 1
        low = np.broadcast_to(_value(first, columns, ix), size)
        count = np.maximum(np.broadcast_to(_value(last, columns, ix), size) - low + 1, 0)
        start = np.cumsum(count) - count
        inner = np.arange(int(count.sum())) - np.repeat(start, count) + np.repeat(low, count)
        columns = [*(np.repeat(c, count) for c in columns), inner]
    return columns


def _value(index: Index, columns: list[Whole], ix: NDArray[np.int32]) -> Whole:
    still = index.constant + (int(ix[index.slot]) if index.slot >= 0 else 0)
    value = (columns[index.loop] if index.loop >= 0 else np.zeros(1, dtype=np.int64)) + still
    return value if index.table < 0 else ix[ix[index.table] + value].astype(np.int64)


def where(place: FamilyReference, box: Extents, columns: list[Whole], ix: NDArray[np.int32]) -> Whole:
    """Positions of a reference in its family, one an iteration."""
    size = len(columns[0]) if columns else 1
    if not place.indices:
        return np.zeros(size, dtype=np.int64)
    return np.broadcast_to(positions(box, [_value(i, columns, ix) for i in place.indices]), size)


def entries(program: Program, binding: Binding, block: str, part: str) -> list[tuple[int, Whole, int, Whole]]:
    """(row family, positions, column family, positions) of each entry of a block's dy or dyd."""
    found = []
    for pattern in dict(program.patterns).get(block, ()):
        columns = iterations(pattern, binding.ix)
        for row, column in getattr(pattern, part):
            a = where(row, binding.row_shapes[row.family], columns, binding.ix)
            b = where(column, binding.shapes[column.family], columns, binding.ix)
            found.append((row.family, a, column.family, b))
    return found
