"""Runs against golden traces: structure exactly, meters by bounds, trajectories by the tube; and mutants of parameters.

One golden serves every formulation: each runs at the accuracy that `record` found to be enough.
"""

from __future__ import annotations

import json
import time
from collections.abc import Iterator, Sequence
from dataclasses import asdict, field, replace
from typing import Any

import numpy as np
from sysdyn.cli.compare.diffing import as_json, cases, common, differences, headline
from sysdyn.cli.failures import UsageError
from sysdyn.cli.golden.book import GoldenScene
from sysdyn.cli.golden.runs import GoldenRun, Stopped, between, run
from sysdyn.cli.golden.structures import describe_change
from sysdyn.cli.run.request.run_request import RunRequest
from sysdyn.runtime.comparison.arrays import Arrays
from sysdyn.runtime.comparison.curve import Floats
from sysdyn.runtime.comparison.recorded import Recorded
from sysdyn.runtime.comparison.verdict import Incomparable, Tolerance, Verdict
from sysdyn.runtime.model.failures import TraceError
from sysdyn.values import dataclass

DIFFERENT, SOLVER, INPUT_OUTPUT = 1, 3, 5
SHARE = 0.01
"""By which `--mutate` changes a parameter."""
NO_EFFECT = 0.05
"""Of the limit: what a changed parameter moves by less is the difference of two integrations."""
ELEMENTS = 4
"""Elements of a parameter array that it changes."""


@dataclass(frozen=True, slots=True)
class Case:
    """One run against one golden.  exit: 0 equal, 1 different, else why it could not be compared; message: the first
    line; ratio: largest over the limit; cases: (what, what is wrong or None); page: HTML of its pictures.
    """

    golden: str
    formulation: str
    method: str
    backend: str
    exit: int
    message: str
    ratio: float
    variable: str | None
    time: float | None
    seconds: float
    cases: tuple[tuple[str, str | None], ...]
    result: dict[str, Any] = field(default_factory=dict)
    page: str = ""

    @property
    def label(self) -> str:
        """For a person: pendulum/swing lagrangian c."""
        return f"{self.golden} {self.formulation} {self.backend}" + (f" {self.method}" if self.method else "")


@dataclass(frozen=True, slots=True)
class Mutant:
    """One parameter changed by SHARE.  noticed: None where it could not be changed (reason says why); insensitive: not
    noticed because nothing that is traced depends on it.
    """

    golden: str
    parameter: str
    noticed: bool | None
    ratio: float
    reason: str
    insensitive: bool = False


def request_of(golden: GoldenScene, **options: Any) -> RunRequest:
    """The run that a golden asks for."""
    if not golden.model.is_file():
        raise FileNotFoundError(2, "no such model", str(golden.model))
    known: dict[str, Any] = {"settings": golden.settings, "until": golden.until, "accuracy": golden.accuracy}
    named = {"scene": golden.scene} if golden.scene else {"model": golden.name}
    return RunRequest(str(golden.model), **(known | named | options))


def load_golden(golden: GoldenScene) -> Arrays:
    """The kept trace.  Raises TraceError, Incomparable, OSError."""
    golden.trace.open("rb").close()
    with Recorded(golden.trace) as source:
        read = {name: source.read(name, 0, source.time.size) for name in source.quantities}
        return Arrays(
            source.time,
            {name: values for name, (values, _) in read.items()},
            {name: rates for name, (_, rates) in read.items() if rates is not None},
            list(source.quantities.values()),
            source.events,
            source.time_unit,
        )


def structure_of(golden: GoldenScene, formulation: str) -> dict[str, Any]:
    """The kept structure of one formulation.  Raises TraceError, OSError."""
    text = golden.structure.read_bytes()
    try:
        found = json.loads(text)["formulations"][formulation]
        found["quantities"] = list(map(str, found["quantities"]))
        return dict(found)
    except (ValueError, KeyError, TypeError, AttributeError) as error:
        raise TraceError(f"{golden.structure}: not readable: {type(error).__name__}: {error}") from error


def check(
    golden: GoldenScene,
    formulations: Sequence[str],
    methods: Sequence[str],
    backends: Sequence[str],
    with_page: bool = False,
) -> Iterator[Case]:
    """Every combination that is asked for; no formulation named: all that the golden was recorded with."""
    missing = [f for f in formulations if f not in golden.formulations]
    if missing:
        raise UsageError(f"{golden.label} has no formulation {missing[0]}: it has {', '.join(golden.formulations)}")
    for formulation in formulations or golden.formulations:
        for method in methods or ("",):
            for backend in backends:
                yield _case(golden, formulation, method, backend, with_page)


def _case(golden: GoldenScene, formulation: str, method: str, backend: str, with_page: bool) -> Case:
    """Run one formulation, method and backend of a golden and compare; what stops it is the case's message and exit
    code.
    """
    began = time.monotonic()

    def stopped_case(code: int, message: str) -> Case:
        seconds = time.monotonic() - began
        wrong = (("run", message),)
        return Case(golden.label, formulation, method, backend, code, message, np.inf, None, None, seconds, wrong)

    # what is kept
    try:
        kept = load_golden(golden)
        structure = structure_of(golden, formulation)
    except (Incomparable, TraceError) as error:
        return stopped_case(INPUT_OUTPUT, str(error))
    except OSError as error:
        return stopped_case(INPUT_OUTPUT, f"{error.filename}: {error.strerror}")
    # the run
    try:
        options = {"formulation": formulation, "backend": backend, "method": method or None}
        one = run(request_of(golden, **options), between(kept.time))
        verdict = _verdict(golden, kept, one, structure)
    except Stopped as error:
        return stopped_case(error.code, str(error))
    except UsageError as error:  # the golden asks, nobody typed it: its scene is gone
        return stopped_case(DIFFERENT, error.message)
    except OSError as error:
        return stopped_case(INPUT_OUTPUT, f"{error.filename}: {error.strerror}")
    except TraceError as error:
        return stopped_case(INPUT_OUTPUT, str(error))
    except Incomparable as error:
        return stopped_case(SOLVER, f"the traces cannot be compared: {error}")
    # structure and ledgers before traces: they say more
    wrong = [*_structural(structure, one.structure), *_meters(golden, one)]
    judged = (*wrong, *cases(verdict))
    failed = next((text for _, text in wrong if text is not None), None)
    message = headline(verdict) if failed is None or not verdict.equal else f"differs: {failed}"
    worst = verdict.worst
    different = not verdict.equal or failed is not None
    page = ""
    # a page with pictures of what differs
    if with_page and different:
        from sysdyn.cli.compare.comparison_page import section

        page = section(common(kept, set(structure["quantities"])), one.trace, verdict)
    return Case(
        golden.label,
        formulation,
        method,
        backend,
        DIFFERENT if different else 0,
        message,
        worst.worst.ratio if worst else 0.0,
        worst.name if worst else None,
        worst.worst.time if worst else None,
        time.monotonic() - began,
        judged,
        as_json(verdict),
        page,
    )


def _verdict(golden: GoldenScene, kept: Arrays, one: GoldenRun, structure: dict[str, Any]) -> Verdict:
    """A formulation is compared on the quantities that it had when it was recorded."""
    return differences(common(kept, set(structure["quantities"])), one.trace, tolerance_of(golden))


def tolerance_of(golden: GoldenScene) -> Tolerance:
    """The tube of a golden."""
    return Tolerance(golden.rtol, golden.atol, golden.tau)


def _structural(kept: dict[str, Any], found: dict[str, Any]) -> list[tuple[str, str | None]]:
    """(fact, what differs) of each fact of the structure."""
    found = json.loads(json.dumps(found))
    facts = [(name, kept.get(name), found.get(name)) for name in dict.fromkeys((*kept, *found))]
    return [(f"structure: {name}", None if a == b else describe_change(name, a, b)) for name, a, b in facts]


def _meters(golden: GoldenScene, one: GoldenRun) -> list[tuple[str, str | None]]:
    """The meters against their bounds."""
    found: list[tuple[str, str | None]] = []
    for name, value, bound, unit in (
        ("energy", one.energy, golden.energy, " J"),
        ("constraints", one.constraints, golden.constraints, ""),
    ):
        inside = value <= bound
        text = f"audit.{name} reaches {value:.3g}{unit}, its bound is {bound:.3g}{unit}"
        found.append((f"meter: {name}", None if inside else text))
    return found


def mutate(golden: GoldenScene) -> Iterator[Mutant]:
    """Each parameter of the scene changed by SHARE: does the golden notice?  Raises Stopped where no run succeeds."""
    kept = load_golden(golden)
    formulation = golden.formulations[0]
    structure = structure_of(golden, formulation)
    base = run(request_of(golden, formulation=formulation), between(kept.time))
    # some of the parameters where there are many
    for name in _some(base.parameters):
        value = base.parameters[name]
        # no share of zero
        if value == 0.0 or not np.isfinite(value):
            yield Mutant(golden.label, name, None, 0.0, f"it is {value:g}: a share of it changes nothing")
            continue
        settings = (*golden.settings, (name, repr(value * (1.0 + SHARE))))
        try:
            one = run(request_of(golden, formulation=formulation, settings=settings), between(kept.time))
            verdict = _verdict(golden, kept, one, structure)
        # refused: noticed too
        except (Stopped, UsageError, Incomparable) as error:
            message = error.message if isinstance(error, UsageError) else str(error)
            yield Mutant(golden.label, name, True, np.inf, f"the model refuses it: {message}")
            continue
        worst = verdict.worst
        ratio = worst.worst.ratio if worst else 0.0
        # noticed
        if not verdict.equal:
            yield Mutant(golden.label, name, True, ratio, "")
            continue
        # not noticed: because nothing traced depends on it, or because the tolerance is wide
        effect = _effect(base, one, tolerance_of(golden))
        insensitive = effect < NO_EFFECT
        reason = f"it moves no traced quantity by more than {effect:.2g} of its limit: " + (
            "none depends on it"
            if insensitive
            else "trace one that depends more on it, or record with a smaller --rtol"
        )
        yield Mutant(golden.label, name, False, ratio, reason, insensitive)


def _some(parameters: dict[str, float]) -> list[str]:
    """Names of parameters; of an array at most ELEMENTS elements, its ends among them."""
    families: dict[str, list[str]] = {}
    for name in parameters:
        families.setdefault(name.partition("[")[0], []).append(name)
    picked = []
    for names in families.values():
        count = min(len(names), ELEMENTS)
        picked += [names[round(k * (len(names) - 1) / max(count - 1, 1))] for k in range(count)]
    return picked


def _effect(base: GoldenRun, mutant: GoldenRun, tolerance: Tolerance) -> float:
    """How far the change moves the traces at the instants that both hold, in limits."""
    instants = np.intersect1d(base.trace.time, mutant.trace.time)
    one, two = (_rows_at(r.trace, instants) for r in (base, mutant))
    worst = differences(one, two, tolerance.part(NO_EFFECT)).worst
    return NO_EFFECT * worst.worst.ratio if worst else 0.0


def _rows_at(trace: Arrays, instants: Floats) -> Arrays:
    rows = np.searchsorted(trace.time, instants)
    values, rates = ({n: v[rows] for n, v in of.items()} for of in (trace.values, trace.rates))
    return Arrays(instants, values, rates, list(trace.quantities.values()), trace.events, trace.time_unit)


def checkable(case: Case) -> dict[str, Any]:
    """A case as JSON."""
    return asdict(replace(case, page="")) | {"ok": case.exit == 0}
