"""`sysdyn compile`: the residual module and its manifest, or a stage on the way there."""

from __future__ import annotations

import json
from pathlib import Path

import click
from sysdyn.cli.console import Console, with_console
from sysdyn.cli.options import chosen
from sysdyn.cli.page.columns import aligned
from sysdyn.cli.run import targets
from sysdyn.cli.run.prepare import Prepared, prepare
from sysdyn.cli.run.starting import start
from sysdyn.compiler.forms import descriptor
from sysdyn.compiler.model import energies
from sysdyn.compiler.program import program_text
from sysdyn.dsl import load
from sysdyn.dsl.model import expression as ex
from sysdyn.dsl.model import network_text
from sysdyn.dsl.text.diagnostics import Report

STAGES = ("network", "reflected", "coordinates", "energies", "descriptor", "program")


@with_console("compile")
@click.argument("file")
@chosen
@click.option("-o", "folder", metavar="DIR", help="Where residual.c (or .py) and manifest.json go. Default: here.")
@click.option("--dump", type=click.Choice(STAGES), help="Print a stage.")
@click.option("--explain", is_flag=True, help="List what was pruned, integrated and inverted, and why.")
def command(
    console: Console,
    file: str,
    scene: str | None,
    model: str | None,
    formulation: str | None,
    index: str | None,
    backend: str,
    settings: tuple[tuple[str, str], ...],
    levels: tuple[tuple[str, str], ...],
    folder: str | None,
    dump: str | None,
    explain: bool,
) -> int:
    """Compile the model of FILE: write DIR/residual.c (or .py) and DIR/manifest.json."""
    document = targets.read(file, console.report)
    target = targets.one(document, file, model, scene, console.report)
    if target is None:
        return console.finish(1)
    with ex.fresh():
        required, inner = target.scene is not None, Report()
        network = load.network(
            target.document, target.model, target.scene, inner, settings, levels=levels, required=required
        )
        console.report.extend(inner if network else targets.unsupported(inner))
        if network is None:
            return console.finish(1)
        if dump == "network":
            console.data(network_text.show(network))
            return console.finish()
        prepared = prepare(network, console.report, formulation=formulation, backend=backend)
        if prepared is None:
            return console.finish(1)
        if dump:
            made = prepared.compiled
            stages = {
                "reflected": lambda: network_text.show(made.lettered(made.family)),
                "coordinates": lambda: network_text.show(made.lettered(made.network)),
                "energies": lambda: energies.show(prepared.compiled.energies),
                "descriptor": lambda: descriptor.show(prepared.compiled.form),
                "program": lambda: program_text.show(prepared.compiled.program),
            }
            console.data(stages[dump]())
        if (dump is None or folder is not None) and not _write(console, prepared, Path(folder or "."), index):
            return console.finish(1)
    if explain:
        console.say(_account(prepared))
    console.explain = explain
    return console.finish()


def _account(prepared: Prepared) -> str:
    """What became of nodes, branches and coordinates, by which rule."""
    compiled = prepared.compiled
    rows = [(s.rule, s.what, s.became) for s in compiled.steps]
    held = {f.owner for f in compiled.form.families if f.kind == "q"}
    unseen = [c.name for c in compiled.energies.coordinates if c.name not in held]
    rows += [("8.7", f"displacement of {name}", "pruned: nothing reads it; its flow is the unknown") for name in unseen]
    return aligned(rows) if rows else "coordinate style: nothing was merged or pruned"


def _write(console: Console, prepared: Prepared, folder: Path, index: str | None) -> bool:
    """Write module and manifest; False after E607 where another index form than the text's own is asked for."""
    scene = prepared.network.scene
    t0 = prepared.binding.evaluate(scene.start) if scene and scene.start else 0.0
    started = start(prepared, t0, console.report)
    own = None if started is None else started.facts.index
    if index not in (None, "auto") and own is not None and index != str(own):
        place = prepared.network.place
        message = f"compile --index {index}: the module holds the form as written, whose index is {own}"
        help_ = f"--index {own}; simulate --index {index} assembles that form"
        console.report.error("E607", message, place, help=help_)
        return False
    folder.mkdir(parents=True, exist_ok=True)
    manifest = {**prepared.manifest, "index": started.facts.index if started else None}
    text = folder / ("residual.c" if prepared.backend == "c" else "residual.py")
    text.write_text(prepared.compiled.text, encoding="utf-8")
    (folder / "manifest.json").write_text(json.dumps(manifest, indent=1) + "\n", encoding="utf-8")
    console.result = manifest
    lines = prepared.compiled.text.count("\n")
    console.say(f"{text}: {lines} lines; {folder / 'manifest.json'}")
    return True
