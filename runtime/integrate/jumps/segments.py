"""The smooth pieces of an integration whose text jumps or has kinks at known instants.

A step ends just before such an instant and the next begins just after it, so that every residual sees one side
(language, rule 17).  Instants nearer to each other than CLOSE of the span are passed as one.  Where the text jumps at
the very end the last piece has no length: no step sees what holds from there on, and the row of the end does; nor has
the first where it jumps right behind the start.
"""

from __future__ import annotations

import ctypes as c
from collections.abc import Sequence
from typing import Any

import numpy as np
from sysdyn.runtime import tuning
from sysdyn.runtime.model import core_library as lib
from sysdyn.runtime.model.description import Floats
from sysdyn.values import dataclass

CLOSE = tuning.BY_FACTORS
"""Of the span: what happens within is one event (the same instant by two formulas)."""


@dataclass(frozen=True, slots=True)
class Segment:
    """One smooth piece from begin to end [s]; label [s]: the instant at which its first row is written."""

    begin: float
    end: float
    label: float


def segments(t0: float, t1: float, stops: Floats | None) -> tuple[Segment, ...]:
    """The pieces of t0..t1; stops before and behind are left out, that at t0 is where the text jumps behind it."""
    if stops is None or not np.size(stops):
        return (Segment(t0, t1, t0),)
    inside = np.unique(np.asarray(stops, dtype=np.float64))
    inside = inside[np.isfinite(inside)]
    # stops closer than rounding are one
    least = CLOSE * max(abs(t0), abs(t1), t1 - t0)
    # a jump at t0 is behind the start
    found = [Segment(t0, t0, t0)] if (inside == t0).any() else []
    inside = inside[(inside >= t0) & (inside <= t1)]
    begin, label = t0, t0
    k = 0
    # a group of stops that are one
    while k < inside.size:
        last = k
        while last + 1 < inside.size and inside[last + 1] - inside[last] <= least:
            last += 1
        before, after = float(np.nextafter(inside[k], -np.inf)), float(np.nextafter(inside[last], np.inf))
        first, k = float(inside[last]), last + 1
        # nothing behind the last one
        if after >= t1:
            after = first = t1
        # the piece up to just before it
        if before > begin:
            found.append(Segment(begin, before, label))
        begin, label = after, first
    return (*found, Segment(begin, t1, label))


def core_pieces(pieces: Sequence[Segment]) -> c.Array[Any]:
    """The segments as the core has them (sd_piece)."""
    return (lib.Piece * len(pieces))(*(lib.Piece(s.begin, s.end, s.label) for s in pieces))
