"""Two traces into a verdict: units, names, span and events; their quantities by quantities.py.

Limits stand on the reference's nominal magnitudes in both directions, so the verdict is symmetric but for those.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
from sysdyn.runtime.comparison.curve import Floats
from sysdyn.runtime.comparison.quantities import Pair, compare_quantities, lonely, ratio_of
from sysdyn.runtime.comparison.verdict import (
    SHARE,
    Compared,
    Incomparable,
    Source,
    Tolerance,
    TraceEvent,
    Verdict,
    Worst,
    rank,
)

LONELY = 10_000
"""Rows that share their instant with both neighbours: more of them are no trace."""
PAIRS = 64
"""Pairs of a missing and an extra quantity that are tried as a renaming."""

Convert = Callable[[str, str], "tuple[float, float] | None"]
"""(scale, offset) with value in the second unit = scale*value in the first + offset; None: other dimensions."""


def same_units(of: str, to: str) -> tuple[float, float] | None:
    """The conversion that knows no units: equal texts alone."""
    return (1.0, 0.0) if of == to else None


def compare(ref: Source, test: Source, tolerance: Tolerance, convert: Convert = same_units) -> Verdict:
    """The verdict on a test against a reference.  Raises Incomparable."""
    # units of time must convert
    rescaled = convert(test.time_unit, ref.time_unit)
    if rescaled is None:
        raise Incomparable(f"time is in '{ref.time_unit}' and in '{test.time_unit}'")
    for which, source in (("reference", ref), ("test", test)):
        _sound(which, source.time)
    # the test's instants in the reference's unit
    times = (ref.time, test.time if rescaled == (1.0, 0.0) else test.time * rescaled[0] + rescaled[1])
    span = float(times[0][0]), float(times[0][-1])
    # tau: asked for, or a share of the span
    tau = SHARE * (span[1] - span[0]) if tolerance.tau is None else tolerance.tau
    asked = replace(tolerance, tau=tau)
    pairs, unmatched, notes = _match_quantities(ref, test, convert)
    # nothing to compare is an error; a unit that does not convert is an answer
    if not pairs and not any(c.status == "unit" for c in unmatched):
        raise Incomparable(_nothing_common(ref, test))
    found = compare_quantities(ref, test, times, pairs, asked, rescaled[0])
    missing = [c.name for c in unmatched if c.status == "missing"]
    extra = [c.name for c in unmatched if c.status == "extra"]
    # missing in one, extra in the other, equal values: renamed
    renamed = _renamed_pairs(ref, test, times, missing, extra, asked, rescaled[0], convert)
    gone = {name for pair in renamed for name in pair}
    others = [c for c in unmatched if c.name not in gone]
    others += [
        Compared(old, "renamed", Worst(math.inf), ref.quantities[old].unit, note=f"the test calls it '{new}'")
        for old, new in renamed
    ]
    # span and events are compared as quantities are
    traces = (*_coverage(times, tau), *_events(ref, test, rescaled, tau))
    quantities = tuple(sorted([*found, *others], key=rank))
    points = (times[0].size, times[1].size)
    return Verdict(quantities, traces, span, tolerance.rtol, tolerance.atol, tau, points, notes)


def _sound(which: str, time: Floats) -> None:
    """Raises Incomparable where instants are none: no rows, no numbers, not ascending, too many at one."""
    if not time.size:
        raise Incomparable(f"the {which} has no rows")
    # instants that are NaN or infinite
    bad = np.flatnonzero(~np.isfinite(time))
    if bad.size:
        raise Incomparable(f"time of the {which} is not a number in row {bad[0] + 1}")
    # a trace that goes back in time
    back = np.flatnonzero(np.diff(time) < 0.0)
    if back.size:
        k = int(back[0])
        raise Incomparable(f"time of the {which} goes back from {time[k]:.9g} to {time[k + 1]:.9g} in row {k + 2}")
    # rows between two others of the same instant belong to no cell
    if np.count_nonzero(lonely(time)) > LONELY and time.size > 1:
        raise Incomparable(f"the {which} has more than {LONELY} rows at instants that others share")


def _match_quantities(
    ref: Source, test: Source, convert: Convert
) -> tuple[list[Pair], list[Compared], tuple[str, ...]]:
    """Quantities of the same name in both with their conversion; those without a partner; notes on conversions."""
    pairs, unmatched, notes = [], [], []
    for name, about in ref.quantities.items():
        # the reference alone has it
        if name not in test.quantities:
            unmatched.append(Compared(name, "missing", Worst(math.inf), about.unit, note="the test lacks it"))
            continue
        other = test.quantities[name]
        conversion = convert(other.unit, about.unit)
        # units that do not convert: m against V
        if conversion is None:
            note = f"the test has it in '{other.unit}', the reference in '{about.unit}'"
            unmatched.append(Compared(name, "unit", Worst(math.inf), about.unit, note=note))
            continue
        # units that convert: mm against m
        if other.unit != about.unit:
            notes.append(f"{name}: the test's '{other.unit}' is converted to '{about.unit}'")
        pairs.append(Pair(about, other, *conversion))
    for name, about in test.quantities.items():
        if name not in ref.quantities:
            unmatched.append(Compared(name, "extra", Worst(math.inf), about.unit, note="the reference lacks it"))
    return pairs, unmatched, tuple(notes)


def _nothing_common(ref: Source, test: Source) -> str:
    # one of them is empty
    if not ref.quantities or not test.quantities:
        return f"the {'test' if ref.quantities else 'reference'} has no quantities"
    first, second = (", ".join(sorted(s.quantities)[:4]) for s in (ref, test))
    return f"the traces have no quantity in common: {first} and {second}"


def _renamed_pairs(
    ref: Source,
    test: Source,
    times: tuple[Floats, Floats],
    missing: Sequence[str],
    extra: Sequence[str],
    tolerance: Tolerance,
    time_scale: float,
    convert: Convert,
) -> list[tuple[str, str]]:
    """(old, new) names of quantities that are equal but for their name."""
    found: list[tuple[str, str]] = []
    tried = 0
    for old in missing:
        for new in extra:
            conversion = convert(test.quantities[new].unit, ref.quantities[old].unit)
            # another unit, a name that is taken, or too many tries
            if conversion is None or any(new == taken for _, taken in found) or tried == PAIRS:
                continue
            tried += 1
            pair = Pair(ref.quantities[old], test.quantities[new], *conversion)
            if compare_quantities(ref, test, times, [pair], tolerance, time_scale)[0].equal:
                found.append((old, new))
                break
    return found


def _coverage(times: tuple[Floats, Floats], tau: float) -> list[Compared]:
    """Whether both begin and end at the same instants."""
    ref, test = times
    # instants agree to tau, or to round-off of their size
    least = max(tau, 4.0 * float(np.spacing(max(abs(ref[0]), abs(ref[-1])))))
    found = []
    for what, a, b in (("start", float(ref[0]), float(test[0])), ("end", float(ref[-1]), float(test[-1]))):
        gap = abs(b - a)
        verb = "begins" if what == "start" else "ends"
        note = "" if gap <= least else f"the test {verb} at {b:.9g}, the reference at {a:.9g}"
        status = "coverage" if note else "equal"
        found.append(Compared(f"time ({what})", status, Worst(gap / least, b, a, b), "s", math.nan, least, note))
    return found


def _order_events(one: Sequence[TraceEvent], two: list[TraceEvent], tau: float) -> list[TraceEvent]:
    """The second events, those within tau of each other in the order of the first ones."""
    for k, wanted in enumerate(one[: len(two)]):
        # look ahead while events lie within tau of the one in question
        ends = (at for at in range(k, len(two)) if two[at].name == wanted.name or two[at].time - two[k].time > tau)
        at = next(ends, k)
        if two[at].time - two[k].time <= tau:
            two.insert(k, two.pop(at))
    return two


def _events(ref: Source, test: Source, rescaled: tuple[float, float], tau: float) -> list[Compared]:
    """Whether the same events happen in the same order, each within tau; None of both: nothing to say.

    Events of one instant have no order.
    """
    one = ref.events
    # the test's events in the reference's time
    two = _order_events(one, [TraceEvent(e.time * rescaled[0] + rescaled[1], e.name) for e in test.events], tau)
    if not one and not two:
        return []
    worst = Worst(0.0, one[0].time if one else two[0].time)
    # event by event: the name, then the instant
    for k, (a, b) in enumerate(zip(one, two, strict=False)):
        if a.name != b.name:
            note = f"event {k + 1} is '{b.name}' at {b.time:.9g}, in the reference '{a.name}' at {a.time:.9g}"
            return [Compared("events", "events", Worst(math.inf, a.time, a.time, b.time), "s", note=note)]
        gap = abs(b.time - a.time)
        # beyond floating point is beyond any tau
        ratio = ratio_of(gap, tau) if math.isfinite(gap) else math.inf
        if ratio >= worst.ratio:
            worst = Worst(ratio, a.time, a.time, b.time)
    # one of them has more events
    if len(one) != len(two):
        k = min(len(one), len(two))
        more, which = (one, "the reference") if len(one) > len(two) else (two, "the test")
        alone = f"{which} alone has '{more[k].name}' at {more[k].time:.9g}"
        note = f"{len(two)} events, in the reference {len(one)}: {alone}"
        return [Compared("events", "events", Worst(math.inf, more[k].time), "s", note=note)]
    note = "" if worst.ratio <= 1.0 else f"an event is {abs(worst.test - worst.reference):.3g} off"
    return [Compared("events", "events" if note else "equal", worst, "s", math.nan, tau, note)]
