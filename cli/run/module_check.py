"""Before the first step: do the rows of the compiled module say what the text says?

The module's blocks are compared with the interpreted nodes at the start and at points nearby (families by sample).  It
is there for faults of the generation, of the C compiler and of a damaged cache: those that conserve energy too.
Received: a prepared model and its start; raises ModuleFault.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from sysdyn.cli.run.prepare import Prepared
from sysdyn.cli.run.start.starting import Started
from sysdyn.compiler.binding.sampled_rows import Points, Sample, SampledRows
from sysdyn.compiler.forms.descriptor import Block
from sysdyn.runtime.model.scales import group_maximum, magnitudes
from sysdyn.runtime.model.system import LARGE, System
from sysdyn.runtime.numerics.points import uniform

Array = NDArray[np.float64]

ROUNDING = 1e-9
"""Difference allowed, of the terms of a row: sums are ordered apart, and functions differ in their last digits."""
FEW_DIGITS = float(np.finfo(float).tiny)
"""Numbers below it have few digits (the kinetic energy behind the tail of a pulse: 6.7e-322 J), and so has what they
are multiplied with (a diode that blocks: 1e-320 S times 1e162 V/s)."""
FARTHEST = 1e150
"""Products of two numbers beyond it, or below its inverse, are no doubles."""
NEARBY = (1e-2, 0.3)
"""Distances of the points from the start, of the unknowns' magnitudes."""

LEAST = 1e-3
"""Least magnitude, of the largest of its kind and unit."""


class ModuleFault(Exception):  # noqa: N818 (a fault in sysdyn, exit 4)
    """The compiled module does not say what the text says; the message names the row."""


def check_module(prepared: Prepared, started: Started, until: float) -> None:
    """Compare every block at the start and nearby, up to `until` [s].  Raises ModuleFault."""
    description = started.system.description
    written = description.p.flags.writeable
    standing = description.p.copy() if written else description.p  # senses of the start; the oracle has what was bound
    description.put(prepared.binding.p)
    try:
        _compare(prepared, started, until)
    finally:
        description.put(standing)


def _compare(prepared: Prepared, started: Started, until: float) -> None:
    """Compare compiled rows with interpreted ones at the start and at points nearby; raise ModuleFault where they
    differ.
    """
    system = started.system
    oracle = SampledRows(prepared.compiled.form, prepared.binding)
    whole = system.of_blocks("start")  # it has all families
    points = _points(system, whole, started, oracle, until)
    for block in prepared.compiled.form.blocks:
        sample = oracle.sample(block, points)
        module = _module_rows(whole, oracle, block, points, sample.rows)
        wrong = _differing_points(module, sample, points)
        # compare with the size of the terms
        if wrong.any():  # perhaps terms of terms cancel: their rounding is no difference
            sample = oracle.sample(block, points, careful=True)
            wrong = _differing_points(module, sample, points) & ~_beyond(points, prepared.binding.p)
        # the first row that differs
        if wrong.any():
            k, row = np.argwhere(wrong)[0]
            place = int(sample.rows[row])
            values = float(module[k, row]), float(sample.value[k, row])
            raise ModuleFault(_difference_text(prepared, oracle, block, place, values))


def _differing_points(found: Array, sample: Sample, points: Points) -> NDArray[np.bool_]:
    """Where both differ by more than rounding [points, rows of the sample]; found: the module's rows there."""
    with np.errstate(invalid="ignore"):
        apart = np.abs(found - sample.value)
    both = ~np.isfinite(found) & ~np.isfinite(sample.value)  # a point outside the range of a root
    # the size of terms in which something overflows (one over cosh) is no number
    size = np.where(np.isfinite(sample.size), sample.size, np.abs(sample.value))
    largest = np.ones((points.t.size, 1))
    for k, point in enumerate(zip(points.y, points.yd, strict=True)):
        largest[k] = np.max([np.abs(x).max(initial=1.0) for x in point])
    wrong: NDArray[np.bool_] = ~both & ~(apart <= ROUNDING * size + FEW_DIGITS * largest)
    return wrong


def _beyond(points: Points, p: Array) -> NDArray[np.bool_]:
    """Points [points, 1] at which products of two numbers are no doubles, or of few digits: which ones depends on the
    order of the factors, and that is not the same in both.
    """
    return np.array([[any(map(_extreme, (*point, p)))] for point in zip(points.y, points.yd, strict=True)])


def _extreme(numbers: Array) -> bool:
    sizes = np.abs(numbers[numbers != 0.0])
    return not ((sizes > 1.0 / FARTHEST) & (sizes < FARTHEST)).all()


def _points(system: System, whole: System, started: Started, oracle: SampledRows, until: float) -> Points:
    """The start, and points at which nothing vanishes by chance; whole: with all families."""
    t0 = started.state.t
    y, yd = started.state.for_form(system)
    scale, time = magnitudes(system, t0, until, y, yd)
    # the magnitude of what begins at zero is a guess: one far too small would hide its terms behind rounding
    scale = np.maximum(scale, LEAST * group_maximum(system, scale))
    order = _order(whole)
    number = 1 + len(NEARBY)
    points = Points(np.full(number, t0), np.zeros((number, order.size)), np.zeros((number, order.size)))
    # large models give back what they do not need now
    if system.unknowns > LARGE:  # the room counts
        system.spare()
        system.put_away(whole=True)
    later = 0.5 + 0.5 * uniform(number)
    points.t[:] += np.array([0.0, *NEARBY]) * (until - t0) * later
    # unknowns and rates, each moved by a part of its magnitude
    for which, (target, x) in enumerate(((points.y, y), (points.yd, yd))):
        beside = order.size - x.size
        x = np.concatenate([x, np.zeros(beside)])
        with np.errstate(over="ignore"):  # such a point is beyond what is compared
            size = np.concatenate([scale / max(time, 1e-300) if which else scale, np.ones(beside)])
        target[0] = x[order]
        for k, distance in enumerate(NEARBY):
            way = _way(2 * k + which, order.size)
            way *= distance * size
            way += x
            target[k + 1] = way[order]
    return points


def _way(k: int, size: int) -> Array:
    """Numbers [size] from -1.5 to -0.5 and from 0.5 to 1.5 that know nothing of those of another k."""
    found = uniform(size, behind=k * size)
    found += 0.5
    found[uniform(size, 1, k * size) < 0.5] *= -1.0
    return found


def _order(system: System) -> NDArray[np.intp]:
    """Places in the system's y of the unknowns in the order of the form's families."""
    families = system.description.families
    parts = [system.form.at[k] + np.arange(f.size) for k, f in enumerate(families)]
    return np.concatenate([*parts, np.zeros(0, dtype=np.intp)]).astype(np.intp)


def _module_rows(system: System, oracle: SampledRows, block: Block, points: Points, rows: NDArray[np.integer]) -> Array:
    """These rows of the block [points, rows] by the carrier; rows: in the order of the form's row families."""
    room, found = np.zeros(max(int(oracle.to[-1]), 1)), np.zeros((points.t.size, rows.size))
    for k, point in enumerate(zip(points.t, points.y, points.yd, strict=True)):
        room[rows] = 0.0  # what is left in others nobody reads
        found[k] = system.rows_at(block.name, oracle.at[:-1], oracle.to[:-1], point, room)[rows]
    return found


def _difference_text(
    prepared: Prepared, oracle: SampledRows, block: Block, place: int, values: tuple[float, float]
) -> str:
    """The message of a row that differs, with its statement and both values."""
    family = int(np.searchsorted(oracle.to, place, side="right")) - 1
    row = prepared.compiled.form.rows[family]
    where = f", {row.place.file}:{row.place.start[0]}" if row.place else ""
    other = "numpy" if prepared.backend == "c" else "c"
    return (
        f"the compiled module ({prepared.backend}) does not say what the text says: {block.name} of {row.label}{where} "
        f"is {values[0]:.9g}, interpreted {values[1]:.9g}; --backend {other}, and an empty cache"
    )
