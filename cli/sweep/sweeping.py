"""A sweep: cases to workers, what comes back into the journal and the file.

The file is written anew every REFRESH seconds and at the end, also of a run that was interrupted.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from sysdyn import __version__
from sysdyn.cli.failures import plain
from sysdyn.cli.run.request import lock
from sysdyn.cli.run.request.run_request import RunRequest, instants_of, model_digest
from sysdyn.cli.run.request.targets import Target
from sysdyn.cli.sweep import results
from sysdyn.cli.sweep.axes import CHOICES, Axis, Evaluate, axis
from sysdyn.cli.sweep.journal import SweepJournal
from sysdyn.cli.sweep.one_run import Runner, Task
from sysdyn.cli.sweep.run_records import Done, Item, Kept
from sysdyn.cli.sweep.study import Case, SweepStudy
from sysdyn.cli.sweep.workers import results as worked
from sysdyn.dsl import load
from sysdyn.dsl.model import expression as ex
from sysdyn.dsl.model.units import si_text
from sysdyn.dsl.rules.text_conditions import REFUSED
from sysdyn.dsl.text.diagnostics import ModelError, Report
from sysdyn.runtime.trace.claim import claim_trace
from sysdyn.runtime.trace.opening import destination
from sysdyn.values import dataclass

REFRESH = 10.0
"""Seconds between two versions of the file, at least ten times what writing one takes."""

FORETOLD = 16
"""Runs after the first result after which the time left is said."""

Progress = Callable[[float, float | None], None]


@dataclass(frozen=True, slots=True)
class Swept:
    """What came of a sweep.  cases [runs]; resumed: runs that stood in the journal; alone: why runs were made one by
    one, outside the core ("": they were not).
    """

    output: Path
    cases: tuple[Case, ...]
    done: Done
    units: dict[str, str]
    resumed: int
    alone: str = ""

    @property
    def kept(self) -> tuple[Kept, ...]:
        """Of each run, one by one."""
        return tuple(self.done[k] for k in range(len(self.cases)))

    def unit(self, name: str) -> str:
        """Of a parameter or a traced quantity; "" where it has none."""
        unit = self.units.get(name, "")
        return "" if unit == "1" else unit

    @property
    def exits(self) -> set[int]:
        """Of the runs; those of a block are met."""
        return {k.exit for k in self.done.singles.values()} | ({0} if self.done.blocks else set())

    @property
    def met(self) -> bool:
        """Every run was."""
        return all(k.met for k in self.done.singles.values())

    @property
    def failed(self) -> tuple[Kept, ...]:
        """Runs that did not end as asked, were not met, or whose expectations failed."""
        return tuple(k for _, k in sorted(self.done.singles.items()) if k.exit)


def axes_of(runner: Runner, texts: tuple[str, ...]) -> list[Axis]:
    """The axes of `--over`, values in SI units.  UsageError; ModelError where a value is none of its parameter."""
    return [axis(text, _evaluate(runner)) for text in texts]


def _evaluate(runner: Runner) -> Evaluate:
    """Evaluate texts of axes in the units of the model's parameters."""
    loaded = runner.load_model()
    known = {p.name: p.unit.dimension for p in loaded.first.prepared.network.parameters}

    def value(name: str, text: str) -> float | None:
        plain = name.partition("[")[0]
        if plain not in known:
            return None
        report = Report()
        with ex.fresh():
            found = load.constant(loaded.target.document, text, known[plain], f"--over {name}", report)
        report.raise_if_failed()
        return found

    return value


def sweep(
    request: RunRequest,
    study: SweepStudy,
    output: Path,
    jobs: int,
    progress: Progress,
    *,
    timings: bool,
    keep: str = "traces",
    dask: str | None = None,
    runner: Runner | None = None,
) -> Swept:
    """Runs what the journal does not hold yet.

    keep: end, extrema or traces of each run; dask: address of a scheduler whose workers run them; runner: of the
    request where it is loaded already.
    """
    runner = runner or Runner(request, keep)
    cases = tuple(study.cases())
    _check_first(runner, cases[0])
    target = runner.load_model().target
    texts = lock.hashes(target)
    # a journal of other texts or settings does not count
    digest = study.digest(request=replace(request, output=None), texts=texts, version=__version__, keep=keep)
    units, attributes = _units(runner, cases[0]), _attributes(target, study)
    place = destination(output)
    # one sweep at a time writes a file
    with claim_trace(place), SweepJournal(place, digest) as journal:
        resumed = len(journal.done)
        tasks = ((k, case) for k, case in enumerate(cases) if k not in journal.done)
        left = len(cases) - resumed
        written = time.monotonic()
        first: tuple[float, int] | None = None
        cost = 0.0
        try:
            # kept as they come
            for item in _items(request, tasks, left, min(jobs, max(left, 1)), keep, dask, runner):
                journal.take(item)
                now = time.monotonic()
                number = len(journal.done) - resumed
                first = first or (now, number)  # workers begin slowly: what comes behind the first result tells
                more = number - first[1]
                ahead = (now - first[0]) / more * (left - number) if more > FORETOLD else None
                progress(len(journal.done) / len(cases), ahead)
                # the file is written in between, seldom enough
                if now - written > max(REFRESH, 10.0 * cost):
                    results.write(place, cases, journal.done, units, attributes, timings=timings)
                    written = time.monotonic()
                    cost = written - now
        # whatever happened: what is there
        finally:
            results.write(place, cases, journal.done, units, attributes, timings=timings)
        journal.remove()
    alone = runner.reason_for_single_runs(cases[0]) if journal.done.singles else ""
    return Swept(output, cases, journal.done, units, resumed, alone)


def _items(
    request: RunRequest, tasks: Iterator[Task], left: int, jobs: int, keep: str, dask: str | None, runner: Runner
) -> Iterator[Item]:
    """What is kept of the tasks, by whoever runs them."""
    if dask is None:
        return worked(request, tasks, left, jobs, keep, runner=runner)
    from sysdyn.cli.sweep.on_dask import results as spread

    return spread(request, tasks, left, dask, keep)


def _check_first(runner: Runner, case: Case) -> None:
    """What is wrong with the text, or with instants that are asked for, stops a sweep before its first run."""
    try:
        runner.load_model().bound({n: v for n, v in case.items() if n not in CHOICES and not n.startswith("level ")})
    except ModelError as error:  # numbers that the text refuses are a run's own failure
        if not {d.code for d in error.diagnostics} <= REFUSED:
            raise
    report = Report()
    instants_of(runner.request, runner.load_model().target.document, report)
    report.raise_if_failed()


def _attributes(target: Target, study: SweepStudy) -> dict[str, Any]:
    """Of the file of results: what was run, by what."""
    return {
        "Conventions": "CF-1.11",
        "title": f"sweep of {target.name}",
        "source": f"sysdyn {__version__}",
        "model": target.model.name.name,
        "scene": target.scene.name.name if target.scene else "",
        "model_sha256": model_digest(target),
        "sample": study.sample if study.runs else "product",
        "seed": study.seed,
    }


def _units(runner: Runner, case: Case) -> dict[str, str]:
    """Of parameters, what varies of them and traced quantities by name."""
    prepared = runner.load_model().first.prepared
    known = {p.name: si_text(p.unit.dimension) for p in prepared.network.parameters}
    rows = [row for row in prepared.structure["rows"] if row.get("stored")]
    known |= {name: known[whole] for name in case if (whole := name.partition("[")[0]) in known}
    return known | {str(row["name"]): str(row["unit"]) for row in rows}


def summary(found: Swept) -> dict[str, dict[str, float]]:
    """Least, median and largest end value of each traced quantity, over the runs that are met."""
    good = np.ones(len(found.cases), dtype=bool)
    for k, kept in found.done.singles.items():
        good[k] = kept.exit in (0, 1) and kept.met and bool(kept.end)
    table: dict[str, dict[str, float]] = {}
    for name, column in found.done.columns("end", len(found.cases)):
        values = np.sort(column[good & ~np.isnan(column)])
        if values.size:
            middle = 0.5 * (values[(values.size - 1) // 2] + values[values.size // 2])
            table[name] = {"least": float(values[0]), "median": float(middle), "largest": float(values[-1])}
    return table


def to_json(found: Swept) -> dict[str, Any]:
    """The result of `--json`."""
    return {
        "output": str(found.output),
        "runs": len(found.cases),
        "resumed": found.resumed,
        "over": list(found.cases[0]),
        "in_core": len(found.cases) - len(found.done.singles),
        "alone": found.alone,
        "failed": [
            {
                "run": k.run,
                "exit": k.exit,
                "reason": k.reason,
                "settings": found.cases[k.run],
                "diagnostic": k.finding or plain(k.reason, k.exit),
            }
            for k in found.failed
        ],
        "end": summary(found),
        "units": {name: found.units[name] for name in (*found.cases[0], *found.done.names()) if name in found.units},
    }
