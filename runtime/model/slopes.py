"""Laws without a slope at a point: a flow, or an effort, that has no inertia has no rate there either.

A law e = r f abs(f) is flat where f = 0, f = sqrt(e) infinitely steep where e = 0: the rate of what the law determines
follows from its slope, which has no size at that point alone.  Told by the Jacobian at distances that shrink to it: the
slope of a power falls, or grows, with each of them, that of a law which is but steep comes to a value.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from sysdyn.runtime.model.description import Floats, Ints
from sysdyn.runtime.model.failures import RowLabel
from sysdyn.runtime.model.scales import group_maximum
from sysdyn.runtime.model.system import System

LADDER = tuple(10.0**-k for k in range(4, 28, 4))
"""Of the largest unknown of its kind and unit: how far beside the point slopes are looked at."""
FALLS = 0.1
"""Of the slope at one of these distances: what is left of it at the next, at most (of the power 1.25)."""
NONE = 1e-30
"""Of any unit: an unknown that is no size."""

_FALLS, _RISES = "vanishes", "grows without bound"
"""What a slope does."""

WITH_A_SLOPE = "a law with a slope at rest, as of a laminar part (f*hypot(f, f0) for f*abs(f)), or a start in motion"
"""What would help."""


def no_slope(rows: Sequence[RowLabel], where: str = "this state") -> str:
    """That these laws have no slope there, for a reader."""
    # at most three are named
    names = list(dict.fromkeys(row.label.removesuffix(".law") for row in rows))
    laws = f"the law at {names[0]} has" if len(names) == 1 else f"the laws at {', '.join(names[:3])} have"
    # what all of them do, if they do the same
    does = {row.slope for row in rows}
    what = does.pop() if len(does) == 1 and "" not in does else "vanishes, or grows without bound,"
    return f"{laws} no slope at {where} (it {what} where nothing flows): no rate follows"


def without_slope(system: System, t: float, y: Floats, yd: Floats, size: Floats | None = None) -> tuple[RowLabel, ...]:
    """Labels of `rows_without_slope`, with what each slope does."""
    falls, rises = _bent(system, t, y, yd, size)
    # a slope that vanishes: q = sqrt(dp) read backwards
    found = {row: replace(system.row_label(row), slope=_FALLS) for row in falls.tolist()}
    for row in rises.tolist():
        # one that does both is called neither
        found[row] = replace(system.row_label(row), slope="" if row in found else _RISES)
    return tuple(dict.fromkeys(found[row] for row in sorted(found)))


def labels(system: System, rows: Ints) -> tuple[RowLabel, ...]:
    """Labels of rows, each once."""
    return tuple(dict.fromkeys(system.row_label(int(k)) for k in rows))


def rows_without_slope(
    system: System, t: float, y: Floats, yd: Floats, size: Floats | None = None, *, steep: bool = False
) -> Ints:
    """Rows in which the slope by an unknown of which no rate occurs vanishes, or grows without bound, at the point;
    steep: by any flow or effort grows.

    y, yd, size [unknowns] of the system; size: of each (the largest of its group).
    """
    return np.union1d(*_bent(system, t, y, yd, size, steep=steep))


def _bent(
    system: System, t: float, y: Floats, yd: Floats, size: Floats | None, *, steep: bool = False
) -> tuple[Ints, Ints]:
    """Rows in which a slope vanishes, and in which one grows, steep: of any unknown; size [unknowns]: of each (its
    group).
    """
    row, column = system.pattern.row, system.pattern.columns_of()
    algebraic = np.isin(system.kinds, ("f", "e"))
    # unknowns without inertia: flows and efforts whose rates occur nowhere
    told = algebraic.copy()
    algebraic[column[system.structural()[1]]] = False
    size = group_maximum(system, np.abs(y)) if size is None else size
    # no two unknowns move alike, so that differences do not cancel
    size = np.where(size > NONE, size, 1.0) * (1.0 + 0.1 * (np.arange(y.size) % 7))
    seen = np.zeros(row.size, dtype=np.int64)
    falls, rises = algebraic[column], (told if steep else algebraic)[column]
    with np.errstate(all="ignore"):
        before: Floats | None = None
        # ever smaller steps from zero: a slope that keeps falling, or rising, has no limit
        for part in LADDER:
            slope = np.abs(system.jacobian(t, y + part * size, yd)[0])
            beyond = (part * size > np.abs(y))[column]
            # between two steps, both far beyond the value itself
            if before is not None:
                falls = falls & (~beyond | (slope < FALLS * before))
                rises = rises & (~beyond | ((slope > before / FALLS) & (before > 0.0)))
            seen += beyond
            before = slope
    return np.unique(row[falls & (seen > 1)]), np.unique(row[rises & (seen > 1)])
