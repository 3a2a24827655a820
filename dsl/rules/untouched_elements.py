"""Which elements of a family no statement touches, by boxes of indices: no element is visited."""

from __future__ import annotations

from collections.abc import Sequence

Box = tuple[tuple[float, float], ...]
"""First and last of each index, both ends included."""


def first_gap(whole: Box, boxes: Sequence[Box]) -> Box | None:
    """The first box of elements of the whole that are in none of the boxes; None where each is in one."""
    # no dimension left: one element
    if not whole:
        return None if boxes else ()
    first, last = whole[0]
    here = [box for box in boxes if box[0][0] <= last and box[0][1] >= first]
    # between two cuts of the first dimension the same boxes lie open
    cuts = {first, *(max(box[0][0], first) for box in here), *(box[0][1] + 1.0 for box in here if box[0][1] < last)}
    begins = sorted(cuts)
    opened, waiting = list[Box](), sorted(here, key=lambda box: -box[0][0])
    known: tuple[list[Box], Box | None] = [], None
    # a sweep over the slabs; each is a problem of one dimension less
    for begin, end in zip(begins, [*(b - 1.0 for b in begins[1:]), last], strict=True):
        while waiting and waiting[-1][0][0] <= begin:
            opened.append(waiting.pop())
        opened = [box for box in opened if box[0][1] >= begin]
        inner = [box[1:] for box in opened]
        # alike slabs have one answer
        if inner != known[0] or not inner:
            known = inner, first_gap(whole[1:], inner)
        if known[1] is not None:
            return ((begin, end), *known[1])
    return None


def box_text(box: Box) -> str:
    """A box as the author writes its elements."""
    return ", ".join(f"{first:g}" if first == last else f"{first:g}..{last:g}" for first, last in box)
