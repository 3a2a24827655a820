"""A scene becomes a golden trace: its own error is measured first, and a tolerance too near to it is refused.

The reference runs at rtol/50 (finer where that is not enough: REFERENCE), with more rows where its thinned trace does
not tell them.  Its error is the largest difference, between and at all instants, of that thinned trace from a run at a
hundredth of that tolerance and from a run by another method; a tolerance below ten times that is refused.  Every
formulation that can express the scene then runs as `check` will, by both methods, and has to be inside half the tube.
"""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from sysdyn.cli.compare.diffing import common, differences, sentence
from sysdyn.cli.failures import OF_RUNS
from sysdyn.cli.golden.runs import APART, GoldenRun, Stopped, between, run
from sysdyn.cli.run.many.crew import Lost, each
from sysdyn.cli.run.request.run_request import RunRequest
from sysdyn.runtime.comparison.arrays import Arrays
from sysdyn.runtime.comparison.curve import Curve, Flags, Floats, bernstein, cells_at
from sysdyn.runtime.comparison.thinning import estimated_rates, round_to_step, thin_rows
from sysdyn.runtime.comparison.verdict import SHARE, Tolerance, Verdict
from sysdyn.values import dataclass

REFERENCE = (2e-2, 1e-3, 1e-5)
"""Accuracy of the reference run, of rtol; the next where one is not enough."""
FINER = 1e-2
"""Tolerance of the run that measures it, of the reference's."""
FINEST = 1e-12
CHECKED = 0.1
"""Accuracy of the runs that `check` makes, of rtol; a tenth of that where a formulation leaves half the tube."""
HALF = 0.5
MARGIN = 10.0
"""A tolerance below this many times the measured error is refused."""
INTERPOLATION = 1.0 / 40.0
"""What thinning may add, of the limit."""
DENSER = 4
"""Runs with rows between the kept ones, at most, until those tell kinks and vertical tangents too."""
FEW = 4
"""Parts into which such a run divides the cells that are not told."""
STEEP = (1e-6, 1e-5)
"""Time tolerances, of the span, that are tried where runs differ on a flank that is steep as a jump, by whichever
formulation: the value there is a matter of the last digit of the time.
"""
ROUNDING = 0.25
"""Of that: what is kept has no digits that nobody compares, and packs to a third."""
BOUND = 10.0
"""Bounds of the meters, of the largest that any run showed; of energy at least what the accuracy of checks leaves open
of what went round, of constraints LEAST.
"""
LEAST = 1e-12
"""Smallest bound of constraints (scaled residual): below it is rounding."""
FORMULATIONS = ("lagrangian", "hamiltonian", "co_lagrangian", "co_hamiltonian", "kane")

Say = Callable[[str], None]


class Refused(Exception):  # noqa: N818 (no fault of the program)
    """A golden trace that could not be trusted; the message says why and what would help."""


@dataclass(frozen=True, slots=True)
class GoldenRecord:
    """What a record holds.  error: relative, measured, and by which run; tau [s]; accuracy: of the runs of `check`;
    energy [J], constraints: bounds; structure: by formulation.
    """

    trace: Arrays
    error: float
    tau: float
    accuracy: float
    energy: float
    constraints: float
    structure: dict[str, Any]
    method: str


def record(request: RunRequest, rtol: float, atol: float, say: Say, jobs: int | None = 1) -> GoldenRecord:
    """Measure a scene.  request: file, scene, settings; jobs: processes that run its formulations, None: where it pays.

    Raises Refused, Stopped, UsageError.
    """
    # finer references until the own error is a tenth of the tolerance
    for share in REFERENCE:
        try:
            base, runs, golden = _reference(request, max(rtol * share, FINEST), rtol, atol, say)
        except Stopped as stopped:
            if share == REFERENCE[0] or stopped.finding not in OF_RUNS:
                raise
            break  # finer than can be met: the last reference stands, or falls, by its own error
        first, *wider = _taus(golden, runs)
        try:
            _own_error(golden, runs, Tolerance(rtol, atol, first))
            break
        except Refused:
            continue
    refused: Refused | None = None
    wanted = _every(request, base)
    # wider time tolerances where events move
    for tau in (first, *wider):
        tolerance = Tolerance(rtol, atol, tau)
        if refused is not None:
            say(f"time tolerance {tau:g} s: {refused.args[0].partition(':')[0]}")
        try:
            error = _own_error(golden, runs, tolerance)
            say(f"its own error: {error:.1e}, the tolerance is {rtol / error if error else np.inf:.3g} times that")
            checked, structure, found = _formulations(wanted, base, golden, tolerance, say, jobs)
            break
        except Refused as error_:
            refused = refused or error_
    # none of them would do
    else:
        assert refused is not None
        raise refused
    for claim in base.claims:
        say(f"{claim}; a golden holds what is, right or wrong")
    # bounds of ledgers, from all runs
    meters = [base, *runs, *found, *_others(request, base, checked)]
    return GoldenRecord(
        golden,
        error,
        tau,
        checked,
        max(*(BOUND * r.energy for r in meters), *(checked * r.turnover for r in meters)),
        max(BOUND * max(r.constraints for r in meters), LEAST),
        structure,
        base.method,
    )


def _others(request: RunRequest, base: GoldenRun, accuracy: float) -> list[GoldenRun]:
    """A run by the bdf at the accuracy of checks beside an explicit method, whose meters are far better than those that
    a check may meet.
    """
    if base.method != "dopri" or request.method not in (None, "auto"):
        return []
    try:
        return [run(replace(request, accuracy=accuracy, method="bdf"))]
    except Stopped:
        return []


def _reference(
    request: RunRequest, accuracy: float, rtol: float, atol: float, say: Say
) -> tuple[GoldenRun, list[GoldenRun], Arrays]:
    """(reference, the runs that measure it, its thinned trace)."""
    base = run(replace(request, accuracy=accuracy))
    if not base.trace.values:
        raise Refused("the scene traces nothing: a golden trace needs quantities")
    golden = _thin(base, rtol, atol)
    also = between(golden.time)
    # more instants where the curve between those that are kept is off
    for _ in range(DENSER):
        dense = also
        base = run(replace(request, accuracy=accuracy), dense)
        untold = _untold(golden, base.trace, rtol, atol)
        golden = _thin(base, rtol, atol)
        if not untold.any():
            break
        time = base.trace.time
        # between which instants
        cells = np.flatnonzero((untold[1:] | untold[:-1]) & (np.diff(time) > FEW * APART * (time[-1] - time[0])))
        also = np.concatenate([time, *(np.linspace(time[k], time[k + 1], FEW + 1)[1:-1] for k in cells)])
    rows = f"{golden.time.size} of {base.trace.time.size} instants"
    say(f"reference: {base.formulation}, {base.method}, accuracy {accuracy:.0e}, {rows}")
    # the same at a finer accuracy, and by another method
    runs = [run(replace(request, accuracy=max(accuracy * FINER, FINEST)), dense)]
    other = "bdf" if base.method == "radau" else "radau"
    try:
        runs.append(run(replace(request, accuracy=accuracy, method=other), dense))
    except Stopped as stopped:
        say(f"no second method: {stopped}")
    return base, runs, golden


def _taus(golden: Arrays, runs: Sequence[GoldenRun]) -> tuple[float, ...]:
    """Time tolerances [s] to be tried, the widest last: where runs differ on a steep flank it is time that differs."""
    span = float(golden.time[-1] - golden.time[0])
    least = _tau(golden, [r.trace for r in runs])
    return tuple(dict.fromkeys(max(least, float(f"{share * span:.3g}")) for share in (SHARE, *STEEP)))


def _own_error(golden: Arrays, runs: Sequence[GoldenRun], tolerance: Tolerance) -> float:
    """The error of the reference, relative as rtol is.  Raises Refused."""
    tenth = tolerance.part(1.0 / MARGIN)
    return max(_error(differences(golden, r.trace, tenth), tolerance.rtol, r.method) for r in runs)


def _error(verdict: Verdict, rtol: float, method: str) -> float:
    """The largest difference from the verdict within a MARGIN-th of the tube, relative as rtol is."""
    worst = verdict.worst
    if worst is None:
        return 0.0
    unlike = [c for c in verdict.traces if not c.equal]
    # missing quantities or other events: no error can be told
    if unlike or any(c.status not in ("equal", "differs") for c in verdict.quantities):
        raise Refused(f"two runs of the scene do not agree ({method}): {sentence(worst)}")
    error = max(c.worst.ratio for c in verdict.quantities) * rtol / MARGIN
    # a tolerance of less than MARGIN times the reference's own error
    if MARGIN * error > rtol:
        message = f"the reference itself is off by {error:.1e} ({worst.name} at {worst.worst.time:.6g} s, {method})"
        help_ = f"--rtol {2 * MARGIN * error:.0e}" if error < 0.05 else "a shorter scene: it is chaotic or too stiff"
        raise Refused(f"{message}: a tolerance of {rtol:g} is below ten times that; {help_}")
    return error


def _tau(golden: Arrays, others: Sequence[Arrays]) -> float:
    """Ten times the largest difference of events between the runs [s]."""
    pairs = [
        (a, b)
        for o in others
        if len(golden.events) == len(o.events)
        for a, b in zip(golden.events, o.events, strict=True)
    ]
    return float(f"{MARGIN * max((abs(a.time - b.time) for a, b in pairs), default=0.0):.3g}")


def _thin(base: GoldenRun, rtol: float, atol: float) -> Arrays:
    """The reference on as few rows as tell it; quantities without a stored rate get one where they are smooth."""
    trace = base.trace
    names = list(trace.values)
    limits = np.array([(atol + rtol * (trace.quantities[n].nominal or 0.0)) * INTERPOLATION for n in names])
    rates = {}
    for name, limit in zip(names, limits, strict=True):
        known = trace.rates.get(name)
        rates[name] = estimated_rates(trace.time, trace.values[name], limit / 2) if known is None else known
    full = [Curve(trace.time, trace.values[n], trace.rates.get(n)) for n in names]
    wanted = [Curve(trace.time, trace.values[n], rates[n]) for n in names]
    rows = thin_rows(full, limits, wanted)
    steps = dict(zip(names, limits * ROUNDING, strict=True))
    longest = float(np.max(np.diff(trace.time[rows]), initial=0.0)) or 1.0
    return Arrays(
        trace.time[rows],
        {n: round_to_step(trace.values[n][rows], steps[n]) for n in names},
        {n: round_to_step(r[rows], steps[n] / longest) for n, r in rates.items() if np.isfinite(r[rows]).any()},
        list(trace.quantities.values()),
        trace.events,
        trace.time_unit,
    )


def _untold(golden: Arrays, trace: Arrays, rtol: float, atol: float) -> Flags:
    """Rows [n] of a trace that the thinned one does not tell: kinks, vertical tangents."""
    cell = cells_at(golden.time, trace.time)
    off = np.zeros(trace.time.size, dtype=bool)
    for name, values in trace.values.items():
        limit = 2.0 * INTERPOLATION * (atol + rtol * (trace.quantities[name].nominal or 0.0))
        curve = Curve(golden.time, golden.values[name], golden.rates.get(name))
        told = bernstein(curve, cell, trace.time, trace.time)[0]
        off |= np.abs(told - values) > limit
    return off


def _every(request: RunRequest, base: GoldenRun) -> list[RunRequest]:
    """Every formulation by both methods; the reference's first."""
    others = (f for f in FORMULATIONS if f != base.formulation and request.formulation is None)
    method = "bdf" if base.method == "radau" else "radau"
    return [
        replace(request, formulation=name, method=how, own=name != base.formulation)
        for name in (base.formulation, *others)
        for how in (None, method)
    ]


def _formulations(
    every: Sequence[RunRequest], base: GoldenRun, golden: Arrays, tolerance: Tolerance, say: Say, jobs: int | None
) -> tuple[float, dict[str, Any], list[GoldenRun]]:
    """(accuracy of checks, structure by formulation, the runs) of every formulation that can express the scene."""
    first = accuracy = max(tolerance.rtol * CHECKED, FINEST)
    structure: dict[str, Any] = {}
    found = []
    made = each(_one, [(wanted, first, golden.time) for wanted in every], jobs)
    with contextlib.closing(made):
        for wanted in every:
            name = wanted.formulation or ""
            ran = next(made) if accuracy == first else _one((wanted, accuracy, golden.time))
            # its process died
            if isinstance(ran, Lost):
                raise RuntimeError(f"the process of {name} died ({ran.how})")
            # not run: inexpressible ones are left out, others refuse the record
            if isinstance(ran, tuple):
                code, message, finding = ran
                if wanted.method or finding.startswith("E60") or finding == "N608":
                    continue  # not expressible
                text = f"{name}: {message}; --formulation {base.formulation} leaves it out"
                raise Refused(text) from Stopped(code, message, finding)
            verdict = _differences_from(ran, golden, tolerance)
            # finer, until it is well within
            while verdict.worst is not None and _margin(verdict) > HALF and accuracy > tolerance.rtol * CHECKED / 50.0:
                accuracy /= 10.0
                ran = run(replace(wanted, accuracy=accuracy), between(golden.time))
                verdict = _differences_from(ran, golden, tolerance)
            if _margin(verdict) > HALF:
                assert verdict.worst is not None
                raise Refused(f"{name} differs from {base.formulation}: {sentence(verdict.worst)}")
            say(f"{name}, {ran.method}: {_margin(verdict):.2g} of the limit at accuracy {accuracy:.0e}")
            structure[name] = ran.structure
            found.append(ran)
    return accuracy, structure, found


def _one(asked: tuple[RunRequest, float, Floats]) -> GoldenRun | tuple[int, str, str]:
    """A run at an accuracy with rows between the kept instants [n] s; exit code, message and code where it stopped."""
    request, accuracy, time = asked
    try:
        return run(replace(request, accuracy=accuracy), between(time))
    except Stopped as stopped:
        return stopped.code, str(stopped), stopped.finding


def _differences_from(one: GoldenRun, golden: Arrays, tolerance: Tolerance) -> Verdict:
    return differences(common(golden, set(one.trace.values)), one.trace, tolerance.part(HALF))


def _margin(verdict: Verdict) -> float:
    """Share of the limit that is used, from the verdict within HALF of it."""
    found = (*(c for c in verdict.traces if not c.equal), *verdict.quantities)
    return HALF * max((c.worst.ratio for c in found), default=0.0)
