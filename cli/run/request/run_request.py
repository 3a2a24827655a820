"""What is asked of a simulation: the request and the scene as the runtime's options, in numbers."""

from __future__ import annotations

import hashlib
import math
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
from sysdyn import __version__
from sysdyn.cli.failures import UsageError
from sysdyn.cli.run.prepare import Prepared
from sysdyn.cli.run.request.scene_numbers import INSTANTS, beyond, wrong_numbers
from sysdyn.cli.run.request.targets import Target
from sysdyn.cli.run.verdict.expectations import watch
from sysdyn.compiler.binding.columns import Read, value_of
from sysdyn.compiler.binding.instants import distinct, instants
from sysdyn.compiler.binding.jumps import jumps
from sysdyn.compiler.binding.pulses import pulses, quickest
from sysdyn.compiler.network.pruning import list_removals
from sysdyn.dsl import load
from sysdyn.dsl.elaborate.scenes.scenes import FINEST_ACCURACY
from sysdyn.dsl.model import dimensions as dim
from sysdyn.dsl.model import expression as ex
from sysdyn.dsl.model.network import Network, Scene
from sysdyn.dsl.model.units import si_text
from sysdyn.dsl.text.diagnostics import Report
from sysdyn.runtime.accuracy.options import Options, Progress
from sysdyn.runtime.events.plan import Plan
from sysdyn.runtime.trace.trace import TraceParameter
from sysdyn.values import dataclass

ACCURACY = 1e-4
FINEST_RTOL = 1e-14
"""What double precision resolves."""
STEPS = 20_000_000
"""Of a run that has no limit of its own: hours of work; a count, so that traces stay equal."""
LISTED = 1000
"""Elements of a parameter array that the trace lists: each is a data set of its own, about 0.5 kB and 60 us."""


@dataclass(frozen=True, slots=True)
class RunRequest:
    """The options of `simulate` as given; None where the scene or the default decides.  Texts are expressions."""

    file: str
    scene: str | None = None
    model: str | None = None
    formulation: str | None = None
    method: str | None = None
    index: str | None = None
    redundancy: str | None = None
    accuracy: float | None = None
    accuracy_check: bool = False
    rtol: float | None = None
    atol: float | None = None
    step: str | None = None
    until: str | None = None
    at: str | None = None
    settings: tuple[tuple[str, str], ...] = ()
    levels: tuple[tuple[str, str], ...] = ()
    backend: str = "c"
    output: str | None = None
    max_steps: int | None = None
    max_wall: str | None = None
    timings: bool = True
    no_prune: bool = False
    no_lock: bool = False
    own: bool = False  # refuse a formulation whose rows are those of another
    extrema: bool = False  # least and largest values of what is traced are kept, within steps too
    text: str | None = None  # what stood on standard input, for processes beside the one that read it


def check_tolerances(request: RunRequest) -> None:
    """UsageError where --accuracy, --rtol, --atol make no sense."""
    # the tool chooses the tolerances, or the author does
    if request.accuracy is not None and (request.rtol is not None or request.atol is not None):
        raise UsageError("--accuracy together with --rtol or --atol: the tool chooses the tolerances, or you do")
    if request.accuracy_check and (request.rtol is not None or request.atol is not None):
        raise UsageError("--accuracy-check with --rtol or --atol: there is no estimate to be checked")
    # what doubles can tell
    if request.rtol is not None and not FINEST_RTOL <= request.rtol < 1.0:
        raise UsageError(f"--rtol {request.rtol:g}: from {FINEST_RTOL:g} to less than 1, what double precision allows")
    if request.accuracy is not None and not FINEST_ACCURACY <= request.accuracy < 1.0:
        raise UsageError(f"--accuracy {request.accuracy:g}: from {FINEST_ACCURACY:g} to less than 1, what can be told")
    if request.max_steps is not None and request.max_steps < 1:
        raise UsageError(f"--max-steps {request.max_steps}: one at least")
    if request.atol is not None and not 0.0 <= request.atol < math.inf:
        raise UsageError(f"--atol {request.atol:g}: it must not be negative")


def _redundancy(request: RunRequest, network: Network) -> str:
    """What shall become of redundant constraints."""
    return request.redundancy or (network.scene.redundancy if network.scene else None) or "error"


def instants_of(
    request: RunRequest, document: load.ParsedFile, report: Report
) -> tuple[float | None, tuple[float, ...], float | None]:
    """--until, --at and --max-wall in s; None, or left out, where they are not given or the report says why not."""

    def instants(said: str | None, parts: Sequence[str], name: str) -> list[float | None]:
        if said is not None and not all(text.strip() for text in parts):
            raise UsageError(f"{name} '{said}': a value is missing")
        return [load.constant(document, text, dim.TIME, name, report) for text in parts]

    def instant(said: str | None, name: str) -> float | None:
        return None if said is None else instants(said, [said], name)[0]

    until = instant(request.until, "--until")
    at = [] if request.at is None else instants(request.at, separate(request.at), "--at")
    wall = instant(request.max_wall, "--max-wall")
    if wall is not None and not wall > 0.0:
        raise UsageError(f"--max-wall {wall:g} s: it must be positive")
    return until, tuple(t for t in at if t is not None), wall


def options_of(
    request: RunRequest,
    target: Target,
    prepared: Prepared,
    report: Report,
    began: float,
    progress: Progress | None,
    *,
    held: bool = False,
) -> Options | None:
    """The runtime's options; None where the report says why not.  began: `time.monotonic()` of the command; held: in
    memory where the request names no file.
    """
    # a model without a scene: everything by options
    scene = prepared.network.scene or Scene("", prepared.network.place)
    value = prepared.binding.evaluate

    t0 = prepared.begin
    t1 = value(scene.end) if scene.end is not None else None
    if request.until is None and t1 is None and not report.failed:
        raise UsageError(f"{target.name} has no 'time' statement: --until is needed")
    # the command line before the scene
    until, at, wall = instants_of(request, target.document, report)
    t1 = until if request.until is not None else t1
    if prepared.network.scene is not None:
        report.extend(wrong_numbers(target, prepared.network, value, request))
    if t1 is None or report.failed:
        return None
    # parameters may make the span nonsense
    if not math.isfinite(t0) or not math.isfinite(t1):
        raise UsageError(f"the run is from {t0:g} s to {t1:g} s: finite instants are needed")
    if not t1 > t0:
        raise UsageError(f"the run ends at {t1:g} s, but it begins at {t0:g} s")
    if text := beyond(t0, t1):
        raise UsageError(text)
    # jumps of the text that the run cannot take
    report.extend(jumps(prepared.network, prepared.binding.parameters, (t0, t1)))
    if report.failed:
        return None
    every = value(scene.every) if scene.every is not None else None
    if every is not None and (t1 - t0) / every > INSTANTS:
        raise UsageError(f"every {every:g} s from {t0:g} s to {t1:g} s is more than {INSTANTS:.0e} instants")
    # for all, and of some
    accuracy, on = _accuracy(request, scene, prepared)
    solver = {name: value(node) for name, node in scene.solver_options}
    method = request.method or scene.solver or "auto"
    step = _step(request, target, method, solver.get("step"), report)
    steps = request.max_steps or next((round(value(n)) for name, n in scene.limits if name == "steps"), STEPS)
    # expectations at instants are sampled there
    claims = tuple(value(e.at) for e in prepared.network.expectations if e.at is not None)
    return Options(
        output=request.output or (None if held else default_output(request.file, scene.name)),
        t_start=t0,
        t_end=t1,
        every=every,
        at=at,
        sampled_at=tuple(t for t in claims if t0 <= t <= t1),
        accuracy=accuracy,
        accuracy_on=on,
        to_range=_to_range(scene, prepared),
        accuracy_check=request.accuracy_check,
        rtol=request.rtol,
        atol=request.atol,
        method=method,
        index=request.index or scene.index(value) or "auto",
        euler_step=step,
        longest=solver.get("longest"),
        order=int(solver["order"]) if "order" in solver and method == scene.solver else None,
        redundancy=_redundancy(request, prepared.network),
        max_steps=steps,
        max_wall=wall,
        sample_steps=any(e.moment == "always" for e in prepared.network.expectations),
        extrema=request.extrema,
        watch=watch(prepared) if prepared.network.expectations else None,
        timings=request.timings,
        cpu_compile=prepared.cpu_compile_s,
        wall_began=began,
        progress=progress,
        attributes=_attributes(target, prepared),
        parameters=tuple(parameters_of(prepared)),
    )


def stops(prepared: Prepared, options: Options, report: Report) -> np.ndarray:
    """Instants at which the text jumps or has kinks in time, and those of pulses that steps would pass over."""
    if _timeless(prepared):
        return np.zeros(0)
    times, note = _stops(prepared, options.t_start, options.t_end)
    if note:
        report.note("N608", note, prepared.network.place)
    return times


def _stops(prepared: Prepared, t0: float, t1: float) -> tuple[np.ndarray, str | None]:
    """The instants, and a note; those of the run before where no parameter that they follow from has changed."""
    binding, kept = prepared.binding, prepared.layouts.setdefault("stops", {})
    before = kept.get((t0, t1))
    if before is not None and all(np.array_equal(value_of(binding, name), v) for name, v in before[1].items()):
        return before[0]  # type: ignore[no-any-return]
    read = Read(binding.parameters)
    text = prepared.compiled.form, replace(binding, parameters=read), t0, t1, prepared.network.tables
    network = prepared.network
    conditions = {n.data[0] for e in network.events if e.condition is not None for n in ex.variables(e.condition)}
    unseen = [o.expression for o in network.observations if not o.stored]
    crossed = [o.expression for o in network.observations if not o.stored and o.name in conditions]
    found = instants(*text, unseen, crossed, _comparisons_at_zero(network))
    answer = distinct(found.times, pulses(*text, crossed, found.times)), found.note
    kept.clear()
    kept[t0, t1] = answer, {name: value_of(binding, name) for name in read.read}
    return answer


def _comparisons_at_zero(network: Network) -> list[ex.Node]:
    """What conditions of events compare with zero, where they hold at the zero itself."""
    asked = {o.name: o.expression for o in network.observations if not o.stored}
    compared = [n for e in network.events if e.condition is not None for n in ex.topological([e.condition])]
    names = {v.data[0] for n in compared if n.op == "cmp" and n.data in ("<=", ">=", "==") for v in ex.variables(n)}
    return [asked[name] for name in asked if name in names]


def _timeless(prepared: Prepared) -> bool:
    """`timeless`, asked once a text."""
    if "timeless" not in prepared.layouts:
        prepared.layouts["timeless"] = {"so": timeless(prepared)}
    return bool(prepared.layouts["timeless"]["so"])


def _step(request: RunRequest, target: Target, method: str, said: float | None, report: Report) -> float | None:
    """Of euler, in s: the request's, else what the scene says."""
    if request.step is None:
        if method == "euler" and said is None:
            raise UsageError("method euler needs a step: --step 1e-3, or 'solver euler(step = 1 ms)' in the scene")
        return said
    if method != "euler":
        raise UsageError(f"--step {request.step}: method {method} chooses its steps; --method euler has one length")
    step = load.constant(target.document, request.step, dim.TIME, "--step", report)
    if step is not None and not 0.0 < step < math.inf:
        raise UsageError(f"--step {step:g} s: it must be positive")
    return step


def turning(events: Plan, prepared: Prepared, options: Options) -> Plan:
    """With the least times (s) in which signals go from one extreme to the next."""
    if _timeless(prepared):
        return events
    read = [o.expression for o in prepared.network.observations if not o.stored]
    asked = prepared.binding, options.t_start, options.t_end
    watched = events.whens or events.contacts or events.kinks
    anywhere = quickest(*asked, (), prepared.compiled.form) if watched else math.inf
    return replace(events, turns=quickest(*asked, read), anywhere=anywhere)


def timeless(prepared: Prepared) -> bool:
    """Nothing that is integrated, or that events read, depends on time of itself."""
    form = prepared.compiled.form
    rows = [row.expression for block in form.blocks for kernel in block.kernels for row in kernel.rows]
    read = [o.expression for o in prepared.network.observations if not o.stored]
    return not any(node.op == "time" for node in ex.topological([*rows, *read]))


def _accuracy(
    request: RunRequest, scene: Scene, prepared: Prepared
) -> tuple[float | None, tuple[tuple[str, float], ...]]:
    """Accuracy of all traced quantities (None: of those alone that the scene names), and of those that it names."""
    if request.accuracy is not None:
        return request.accuracy, ()
    value = prepared.binding.evaluate
    on = tuple((name, value(wanted)) for name, wanted in scene.accuracy_on)
    rest = None if scene.accuracy is None else value(scene.accuracy)
    return (rest if on or rest is not None else ACCURACY), on


def _to_range(scene: Scene, prepared: Prepared) -> tuple[str, ...]:
    """Quantities whose errors are relative to their range: those that the scene names, and temperatures in units whose
    zero is not that of the quantity (`in degC`).
    """
    offset = [o.name for o in prepared.network.observations if o.unit.offset]
    return tuple(dict.fromkeys((*scene.to_range, *offset)))


def of_these_alone(options: Options, names: Sequence[str]) -> Options:
    """Options that ask of these quantities, each by its name, what they ask of all; of others nothing."""
    if options.accuracy is None or not names:
        return options
    on = dict.fromkeys(names, options.accuracy) | dict(options.accuracy_on)
    return replace(options, accuracy=None, accuracy_on=tuple(on.items()))


def separate(text: str) -> list[str]:
    """The parts between commas outside brackets."""
    parts, depth = [""], 0
    for character in text:
        depth += (character in "([") - (character in ")]")
        if character == "," and depth == 0:
            parts.append("")
        else:
            parts[-1] += character
    return parts


def default_output(file: str, scene: str, end: str = ".h5") -> str:
    """The file where none is named: a trace's, or with another end."""
    stem = "model" if file == "-" else Path(file).stem
    return f"{stem}-{scene}{end}" if scene else f"{stem}{end}"


def _attributes(target: Target, prepared: Prepared) -> dict[str, str]:
    """What the trace says of itself, asked once a text."""
    if "attributes" not in prepared.layouts:
        prepared.layouts["attributes"] = _trace_attributes(target, prepared)
    return prepared.layouts["attributes"]


def _trace_attributes(target: Target, prepared: Prepared) -> dict[str, str]:
    """Attributes of the trace that say what it is of: conventions, model, scene, formulation, digest, what was left
    out.
    """
    left_out = {"pruned": list_removals(prepared.left_out)} if prepared.left_out else {}
    return {
        "Conventions": "CF-1.11",
        "title": target.name,
        "source": f"sysdyn {__version__}",
        "model": prepared.network.model,
        "scene": prepared.network.scene.name if prepared.network.scene else "",
        "formulation": prepared.formulation,
        "model_sha256": model_digest(target),
        **left_out,
    }


def model_digest(target: Target) -> str:
    """SHA-256 of the model's text."""
    return hashlib.sha256(target.document.file.source.text.encode("utf-8", "surrogatepass")).hexdigest()


def parameters_of(prepared: Prepared) -> Iterator[TraceParameter]:
    """Parameters in SI units, arrays element by element (`m[2]`); arrays of more than LISTED elements are left out."""
    evaluate, values = prepared.binding.evaluate, prepared.binding.values
    units = prepared.layouts.setdefault("units of parameters", {})
    # once for a prepared model: runs of sweeps share them
    if not units:
        shown = (p for p in prepared.network.parameters if not p.name.startswith("#"))  # none that the compiler made
        own = (p for p in shown if p.name not in prepared.network.discretes)
        units |= {p.name: (p.shape, si_text(p.unit.dimension)) for p in own}
    for name, (shape, unit) in units.items():
        # a scalar
        if not shape:
            yield TraceParameter(name, float(values[name]), unit)
            continue
        array = np.asarray(values[name])
        first = [round(evaluate(low)) for low, _ in shape]
        if array.size > LISTED:
            continue
        for at, value in np.ndenumerate(array):
            index = ",".join(str(a + b) for a, b in zip(at, first, strict=True))
            yield TraceParameter(f"{name}[{index}]", float(value), unit)


def rest(options: Options) -> float:
    """The part of the fastest impact of a contact below which it is the last."""
    asked = [options.accuracy, options.rtol, *(a for _, a in options.accuracy_on)]
    return 0.1 * min((a for a in asked if a is not None), default=ACCURACY)
