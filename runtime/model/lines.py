"""Lists that repeat along families: lines of entries, of which each place is one step further than in the line before.

Of a large model such a list is told by its stretches, not by its entries.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np
from numpy.typing import NDArray
from sysdyn.runtime.model.description import Floats, Ints, Kernel
from sysdyn.runtime.model.patterns import iterations

FEW = 16
"""Lines of a stretch in the mean, from which stretches take less room than entries."""

Stretch = tuple[int, int, int]
"""Its first entry, how many lines it has, of how many entries each."""


def shapes_of(kernels: Iterable[Kernel], which: str, ix: Ints) -> list[tuple[int, int]]:
    """Of the list `which` ("dy" or "dyd") of a block: iterations of each kernel, entries in each."""
    found = ((kernel, len(kernel.dy if which == "dy" else kernel.dyd)) for kernel in kernels)
    return [(iterations(kernel, ix), width) for kernel, width in found if width]


def stretches_of(
    places: Sequence[Ints], shapes: Sequence[tuple[int, int]], same: Floats | None = None
) -> list[Stretch] | None:
    """Stretches of a list in which all places [entries] ascend by steps, and `same` [entries] is the same from line to
    line, bit for bit; shapes: numbers of lines one behind the other, and their widths.  None where they are many.
    """
    found: list[Stretch] = []
    at = 0
    for number, width in shapes:
        ends = _ends(places, same, at, number, width)
        # hardly longer than lines by themselves: not worth it
        if FEW * len(ends) > number + FEW:
            return None
        for low, high in zip([0, *ends[:-1]], ends, strict=True):
            found.append((at + low * width, high - low, width))
        at += number * width
    return found


def _ends(places: Sequence[Ints], same: Floats | None, at: int, number: int, width: int) -> list[int]:
    """Behind which lines the stretches end."""
    part = slice(at, at + number * width)
    # a stretch ends where the step changes, or where values do
    other, apart = np.zeros((2, max(number - 1, 0)), dtype=bool)  # between each line and the next
    for place in places:
        steps = np.diff(place[part].reshape(number, width), axis=0)
        other[1:] |= (steps[1:] != steps[:-1]).any(axis=1)
    # bit for bit: -0.0 is not 0.0
    if same is not None:
        bits = same[part].view(np.int64).reshape(number, width)
        apart |= (bits[1:] != bits[:-1]).any(axis=1)
    found, begin = [], 0
    for mark in np.flatnonzero(other | apart).tolist():
        if apart[mark] or mark > begin:  # the step behind the first line of a stretch is its own
            begin = mark + 1
            found.append(begin)
            # too many: nobody asks for the rest
            if FEW * len(found) > number + FEW:
                break
    return [*found, number] if number else []


def table(place: Ints, stretch: Stretch) -> tuple[NDArray[np.int32], NDArray[np.int32]]:
    """Places of the first line of a stretch and the step to the next [width]."""
    at, number, width = stretch
    first = np.array(place[at : at + width], dtype=np.int32)
    # one line has no step
    step = place[at + width : at + 2 * width] - first if number > 1 else np.zeros(width)
    return first, np.asarray(step, dtype=np.int32)
