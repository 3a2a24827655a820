"""Everything that can be said of a model and scene without time integration."""

from __future__ import annotations

from typing import Any

from sysdyn.cli.failures import classify
from sysdyn.cli.run.request import targets
from sysdyn.dsl import load, unused_components
from sysdyn.dsl.model import expression as ex
from sysdyn.dsl.model.network import Network
from sysdyn.dsl.text.diagnostics import Diagnostic, ModelError, Report
from sysdyn.values import dataclass


@dataclass(frozen=True, slots=True)
class Checked:
    """What came of a file.  said: ("say" or "data", text) in order; unread: why it could not be read."""

    found: tuple[Diagnostic, ...] = ()
    said: tuple[tuple[str, str], ...] = ()
    result: dict[str, Any] | None = None
    unread: str | None = None


def file_checked(asked: tuple[str, bool, bool]) -> Checked:
    """Every model and scene of a file.  asked: path, whether what cannot be run yet is an error, whether the passivity
    of each is told.
    """
    path, refused, explain = asked
    report, said, found = Report(), list[tuple[str, str]](), list[dict[str, object]]()
    try:
        document = targets.read(path, report)
        wrong = [d.place.span for d in report if d.severity == "error" and d.place and d.place.file == path]
        # each scene, and models that have none
        for target in targets.all_targets(document, report):
            with ex.fresh():
                summary = check_target(target, report, refused)
            items = [item.span for item in (target.model, target.scene) if item is not None]
            # an error inside of this model or scene, which was mended to read on
            if any(i.start <= span.start < i.end for span in wrong for i in items):
                summary["ok"] = False  # a slip that was read as it was meant is still to be mended
            found.append(summary)
            if summary["ok"]:
                said.append(("say", f"{path}: {target.name}: {_line(summary)}"))
                if explain:
                    said.append(("data", f"{path}: {target.name}: " + _passivity(summary)))
        parts = dict[str, bool]()
        # components that no model uses are checked by themselves
        for name, own in unused_components.check_unused_components(document):
            report.extend(own)
            parts[name] = not own.failed and not wrong
            if parts[name]:
                said.append(("say", f"{path}: component {name}: ok"))
    except OSError as error:
        return Checked(tuple(report), tuple(said), unread=classify(error)[1])
    except ModelError as error:  # a file that is no text does not hide the others
        return Checked((*report, *error.diagnostics), tuple(said))
    # a file without anything to be run
    if not document.models and not document.scenes and not parts and not report.failed:
        said.append(("say", f"{path}: no model"))
    result = {"file": path, "models": list(document.models), "targets": found}
    result["components"] = [{"name": name, "ok": ok} for name, ok in parts.items()]
    return Checked(tuple(report), tuple(said), result)


def check_target(target: targets.Target, report: Report, refused: bool = False) -> dict[str, object]:
    """Findings go to the report; the counts come back.  refused: what cannot be run yet is an error."""
    names = {"scene": target.scene.name.name if target.scene else None, "model": target.model.name.name}
    inner = Report()
    network = load.network(target.document, target.model, target.scene, inner, required=target.scene is not None)
    summary: dict[str, object] = {**names, "ok": network is not None}
    if network is not None and all(p.values for p in network.parameters):
        summary |= _check_start(target, network, inner)
    incomplete = refused and not summary["ok"]
    report.extend(targets.refuse_unsupported(inner) if incomplete else inner)
    return summary


def _check_start(target: targets.Target, network: Network, report: Report) -> dict[str, object]:
    try:
        return _check_prepared(target, network, report)
    except ModelError as error:  # of numbers that make no model
        report.extend(error.diagnostics)
        return {"ok": False}


def _check_prepared(target: targets.Target, network: Network, report: Report) -> dict[str, object]:
    """Check numbers, instants, start and passivity of a network; the counts that `check` shows."""
    from sysdyn.cli.run.prepare import prepare  # lowering and arrays: not needed where the text has errors
    from sysdyn.cli.run.request.run_request import RunRequest
    from sysdyn.cli.run.request.scene_numbers import wrong_numbers
    from sysdyn.cli.run.start.starting import change_lines, counted_as, start
    from sysdyn.cli.run.verdict.expectations import missing_goldens
    from sysdyn.compiler.binding.certificate import certificate
    from sysdyn.compiler.binding.jumps import jumps
    from sysdyn.runtime.accuracy.options import HIGHEST, above_highest

    prepared = prepare(network, report, backend="numpy")
    if prepared is None:
        return {"ok": False}
    scene = network.scene
    # numbers of the scene, before anything is computed with them
    if scene is not None:
        bare = RunRequest(target.document.file.source.name)
        report.extend(wrong_numbers(target, prepared.network, prepared.binding.evaluate, bare))
        if report.failed:
            return {"ok": False}
    value = prepared.binding.evaluate
    report.extend(missing_goldens(network.goldens, "N907"))
    t0 = prepared.begin
    t1 = value(scene.end) if scene and scene.end else t0
    report.extend(jumps(prepared.network, prepared.binding.parameters, (t0, t1)))
    if report.failed:
        return {"ok": False}
    # the consistent start, as a run has it
    started = start(prepared, t0, report)
    if started is None:
        return {"ok": False}
    facts = started.facts
    if prepared.formulation == "kane":  # it leaves out the rows of flow constraints
        facts = counted_as(prepared, t0, facts)
    runs = True
    # a run would be refused: noted
    if facts.index is not None and facts.index > HIGHEST:
        runs = False
        report.note("N608", above_highest(facts.index), prepared.network.place)
    judged = certificate(prepared.network, prepared.binding)
    return {
        "ok": runs and not report.failed,
        "formulation": prepared.formulation,
        **facts.counts,
        "moved": change_lines(prepared, started.state),
        "passivity": {
            "verdict": judged.verdict,
            "proven": judged.proven,
            "elements": [{"name": f.name, "role": f.role, "how": f.how, "said": f.said} for f in judged.findings],
            "lines": judged.lines(),
        },
    }


def _passivity(summary: dict[str, object]) -> str:
    found = summary.get("passivity")
    return "not compiled" if not isinstance(found, dict) else "\n".join(found["lines"])


def _line(summary: dict[str, object]) -> str:
    """The counts of a target in a line, and what the start moved."""
    if "index" not in summary:
        return "ok"
    counts = "coordinates {coordinates}, m1 {m1}, m2 {m2}, dof {dof}".format(**summary)
    counts += f", index {summary['index']}" if summary["index"] is not None else ""
    counts += f", {summary['redundant']} redundant" if summary["redundant"] else ""
    moved = summary["moved"]
    assert isinstance(moved, list)
    from sysdyn.cli.run.start.starting import first_lines

    return "; ".join([f"ok: {counts}", *first_lines(moved)])
