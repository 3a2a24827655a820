"""`expect` statements judged on the samples of a run (E907, E909)."""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from sysdyn.cli.run.prepare import Prepared
from sysdyn.cli.run.start.starting import holds, where_holds
from sysdyn.dsl.model.expression import variables
from sysdyn.dsl.model.network import Expectation, Golden
from sysdyn.dsl.text.diagnostics import Diagnostic, Report
from sysdyn.runtime.accuracy.options import Watch
from sysdyn.runtime.model.description import Floats
from sysdyn.runtime.model.failures import TraceError
from sysdyn.runtime.simulate import Outcome
from sysdyn.values import dataclass

OPEN = 1e-12
"""Of the largest terms of the sides of a claim, in the run: what no run resolves (round-off; rows that hold)."""
LOOSE = ("<=", ">=")
METERS = ("energy", "constraints", "drift")
"""Members of audit that are zero of an exact solution."""
WORSE = 1.1
"""Times the worst sample so far: the next one that breaks a claim and is kept, for sizes are known at the end."""


@dataclass(frozen=True, slots=True)
class JudgedClaim:
    """One expectation: ok None where it could not be judged; value and time where it was judged (worst or first)."""

    text: str
    ok: bool | None
    value: float | None
    time: float | None


def watch(prepared: Prepared) -> Watch:
    """What the claims need of a run, whatever its length: the first sample that breaks each, worse ones behind it, and
    those at instants.
    """
    claims = list(enumerate(prepared.network.expectations))

    def of_run(names: tuple[str, ...]) -> Callable[[Floats, Floats], NDArray[np.bool_]]:
        column = {name: j for j, name in enumerate(names)}
        judged = [(k, e) for k, e in claims if f"expect {k} left" in column]
        worst = {k: -1.0 for k, e in judged if e.moment == "always"}

        # rows at the instants of claims, and those that break an `always` worse than before
        def rows_to_keep(time: Floats, values: Floats) -> NDArray[np.bool_]:
            kept = np.zeros(time.size, dtype=bool)
            for k, e in judged:
                if e.at is not None:
                    kept |= _near(time, prepared.binding.evaluate(e.at))
                elif k in worst:
                    left, right, within = _columns(values, column, k, e)
                    off = np.abs(left - right)
                    for row in np.flatnonzero(~where_holds(e.operator, left, right, within)):
                        if not off[row] <= WORSE * worst[k]:
                            kept[row], worst[k] = True, float(off[row]) if e.operator in LOOSE else np.inf
            return kept

        return rows_to_keep

    return of_run


def _near(time: Floats, at: float) -> NDArray[np.bool_]:
    return np.asarray(np.abs(time - at) <= 1e-12 * abs(at))


def judge(prepared: Prepared, outcome: Outcome, report: Report, *, finished: bool) -> tuple[JudgedClaim, ...]:
    """All expectations of the scene; those that fail are reported as E909."""
    claims = [_claim(prepared, outcome, k, e, report, finished) for k, e in enumerate(prepared.network.expectations)]
    claims += [_golden(prepared, outcome, g, report, finished) for g in prepared.network.goldens]
    return tuple(claims)


def _claim(prepared: Prepared, outcome: Outcome, k: int, e: Expectation, report: Report, finished: bool) -> JudgedClaim:
    """Judge one claim on the rows that were kept; not known where the run did not come that far."""
    text = e.text.removeprefix("expect ")
    time, left, right, within = _sides(outcome, k, e)
    # at the last row
    if e.moment == "finally":
        if not finished:
            return JudgedClaim(text, None, None, None)
        time, left, right, within = time[-1:], left[-1:], right[-1:], within[-1:]
    # at its instant
    elif e.at is not None:
        at = prepared.binding.evaluate(e.at)
        here = np.flatnonzero(_near(time, at))
        if not here.size and not finished:
            return JudgedClaim(text, None, None, None)
        if not here.size:
            report.error("E909", f"expect failed: the run does not reach {at:g} s", e.place)
            return JudgedClaim(text, False, None, at)
        time, left, right, within = time[here[:1]], left[here[:1]], right[here[:1]], within[here[:1]]
    open_ = _open(outcome, k, e)
    # always: the first row that breaks it
    for t, a, b, w in zip(time, left, right, within, strict=True):
        if not holds(e.operator, a, b, w + open_):
            _report(outcome, e, (t, a, b, w), report)
            return JudgedClaim(text, False, float(a), float(t))
    if not time.size:
        return JudgedClaim(text, None, None, None)
    return JudgedClaim(text, True, float(left[-1]), float(time[-1]))


def _place_of(golden: Golden) -> Path:
    return Path(golden.place.file).parent / golden.file


def missing_goldens(goldens: Iterable[Golden], code: str) -> list[Diagnostic]:
    """A finding for each golden file that is not there."""
    return [
        Diagnostic(code, f"the golden file '{g.file}' is missing", g.place, "sysdyn golden record")
        for g in goldens
        if not _place_of(g).is_file()
    ]


def _golden(prepared: Prepared, outcome: Outcome, golden: Golden, report: Report, finished: bool) -> JudgedClaim:
    """`expect golden "F" within r`: the quantities that F also has, by the comparison of `sysdyn diff`."""
    text = f'golden "{golden.file}"'
    path = _place_of(golden)
    # a file that is not there
    if missing := missing_goldens((golden,), "E907"):
        report.extend(missing)
        return JudgedClaim(text, None, None, None)
    if not finished:
        return JudgedClaim(text, None, None, None)
    from sysdyn.cli.compare.diffing import common, differences, sentence
    from sysdyn.runtime.comparison.recorded import Recorded
    from sysdyn.runtime.comparison.verdict import Incomparable, Tolerance

    within = prepared.binding.evaluate(golden.within)
    try:
        # quantities of both
        with Recorded(path) as reference, _file(outcome) as file, Recorded(file) as trace:
            names = set(reference.quantities) & set(trace.quantities)
            tube = Tolerance(rtol=within, tau=reference.tau)
            verdict = differences(common(reference, names), common(trace, names), tube)
    except (Incomparable, TraceError) as error:
        report.error("E909", f"expect failed: {text} cannot be compared: {error}", golden.place)
        return JudgedClaim(text, False, None, None)
    worst = verdict.worst
    found = (worst.worst.test, worst.worst.time) if worst else (None, None)
    if worst is not None and not verdict.equal:
        report.error("E909", f"expect failed: {text} within {within:g}: {sentence(worst)}", golden.place)
    return JudgedClaim(text, verdict.equal, *found)


@contextlib.contextmanager
def _file(outcome: Outcome) -> Iterator[Path]:
    """The trace's file; of one that is held in memory, a file for as long as it is read."""
    import tempfile

    if outcome.trace is not None:
        yield outcome.trace
        return
    with tempfile.TemporaryDirectory(prefix="sysdyn-") as folder:
        path = Path(folder) / "trace.h5"
        outcome.traced.save(path)
        yield path


def _sides(outcome: Outcome, k: int, e: Expectation) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    samples = outcome.samples
    column = {name: j for j, name in enumerate(samples.names)}
    return samples.time, *_columns(samples.values, column, k, e)


def _open(outcome: Outcome, k: int, e: Expectation) -> float:
    """What a run leaves open of an inequality that may be an equality."""
    if e.operator not in LOOSE:
        return 0.0
    sizes = dict(zip(outcome.samples.names, outcome.samples.largest, strict=True))
    return OPEN * float(max(sizes[f"expect {k} left"], sizes[f"expect {k} right"]))


def _columns(
    values: Floats, column: dict[str, int], k: int, e: Expectation
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Left, right and tolerance of a claim at each sample."""
    left, right = (values[:, column[f"expect {k} {name}"]] for name in ("left", "right"))
    within = np.zeros(len(values)) if e.within is None else values[:, column[f"expect {k} within"]]
    return left, right, within


def _meters(e: Expectation) -> str:
    """The meters of numerical error that a claim reads, where it reads nothing else; "" of others."""
    read = [n for n in variables(e.left) | variables(e.right) if n.op == "var"]
    own = all(n.data[1] == "audit" and n.data[0] in METERS for n in read)
    return " and ".join(sorted(f"audit.{n.data[0]}" for n in read)) if own else ""


def _report(outcome: Outcome, e: Expectation, worst: tuple[float, float, float, float], report: Report) -> None:
    """E909 of a claim that failed, with the tolerance or accuracy that would decide it."""
    t, a, b, w = worst
    unit = "" if e.unit.text == "1" else f" {e.unit.text}"
    off = abs(a - b)
    sign = "" if e.operator == "==" else f" {e.operator}"
    message = f"expect failed: {a:.9g}{unit} at {t:.9g} s, expected{sign} {b:.9g}{unit}"
    if w:
        message += f" within {w:g}{unit} (off by {off / w:.3g} times)"
    estimate = outcome.error_estimate
    help_ = None
    size = max(abs(a), abs(b))
    # equality to the last bit
    if e.operator == "==" and e.within is None:
        help_ = f"'==' without 'within' asks for the last bit: within {off:.1g}{unit} would hold"
    # off by less than the error of the run
    elif estimate and size > 0.0 and off - w < estimate * size:
        wanted = max((off - w) / size / 10.0, 1e-13)
        less = f"this is less than the estimated error of the run ({estimate:.1g})"
        help_ = f"{less}: --accuracy {wanted:.0e} would decide it"
    elif read := _meters(e):
        help_ = f"{read} measures the error of the run: a smaller --accuracy, or the claim"
    report.error("E909", message, e.place, help=help_)
