"""Everything that can be said of a model and scene without time integration."""

from __future__ import annotations

from sysdyn.cli.run import targets
from sysdyn.dsl import load
from sysdyn.dsl.model.network import Network
from sysdyn.dsl.text.diagnostics import ModelError, Report


def checked(target: targets.Target, report: Report, refused: bool = False) -> dict[str, object]:
    """Findings go to the report; the counts come back.  refused: what cannot be run yet is an error."""
    names = {"scene": target.scene.name.name if target.scene else None, "model": target.model.name.name}
    inner = Report()
    network = load.network(target.document, target.model, target.scene, inner, required=target.scene is not None)
    summary: dict[str, object] = {**names, "ok": network is not None}
    if network is not None and all(p.values for p in network.parameters):
        summary |= _started(network, inner)
    incomplete = refused and not summary["ok"]
    report.extend(targets.unsupported(inner) if incomplete else inner)
    return summary


def _started(network: Network, report: Report) -> dict[str, object]:
    try:
        return _judged(network, report)
    except ModelError as error:  # of numbers that make no model
        report.extend(error.diagnostics)
        return {"ok": False}


def _judged(network: Network, report: Report) -> dict[str, object]:
    from sysdyn.cli.run.prepare import prepare  # lowering and arrays: not needed where the text has errors
    from sysdyn.cli.run.starting import described, start
    from sysdyn.compiler.binding.certificate import certificate

    prepared = prepare(network, report, backend="numpy")
    if prepared is None:
        return {"ok": False}
    scene = network.scene
    t0 = prepared.binding.evaluate(scene.start) if scene and scene.start else 0.0
    started = start(prepared, t0, report)
    if started is None:
        return {"ok": False}
    facts = started.facts
    judged = certificate(prepared.network, prepared.binding)
    return {
        "ok": not report.failed,
        "formulation": prepared.formulation,
        "coordinates": facts.coordinates,
        "m1": facts.m1,
        "m2": facts.m2,
        "dof": facts.dof,
        "configuration_dof": facts.configuration_dof,
        "redundant": facts.redundant,
        "index": facts.index,
        "moved": described(started.state),
        "passivity": {
            "verdict": judged.verdict,
            "proven": judged.proven,
            "elements": [{"name": f.name, "role": f.role, "how": f.how, "said": f.said} for f in judged.findings],
            "lines": judged.lines(),
        },
    }
