"""`sysdyn compile`: the files of a model that others call, or a stage on the way there."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click
from sysdyn.cli.console import Console, with_console
from sysdyn.cli.export import files
from sysdyn.cli.export.index_form import formed_of, network_of, report_impossible
from sysdyn.cli.options import chosen
from sysdyn.cli.page.columns import align
from sysdyn.cli.run.prepare import Prepared, prepare
from sysdyn.cli.run.request.run_request import RunRequest
from sysdyn.compiler.forms import descriptor
from sysdyn.compiler.model import energies
from sysdyn.compiler.program import program_text
from sysdyn.dsl.model import expression as ex
from sysdyn.dsl.model import network_text
from sysdyn.dsl.model.network import Event, Switch
from sysdyn.runtime.condense.condenser import departures
from sysdyn.runtime.model.system import System

STAGES = ("network", "reflected", "coordinates", "energies", "descriptor", "program")


@with_console("compile")
@click.argument("file")
@chosen
@click.option("-o", "folder", metavar="DIR", help="Where the files go. Default: here.")
@click.option("--dump", type=click.Choice(STAGES), help="Print a stage.")
@click.option("--explain", is_flag=True, help="List what was pruned, integrated and inverted, and why.")
def command(console: Console, folder: str | None, dump: str | None, explain: bool, **options: Any) -> int:
    """Compile the model of FILE, of a scene where one is named, to files that anyone can call.

    DIR/residual.c and binding.c (or residual.py), sysdyn_model.h, binding.json, manifest.json.
    """
    request = RunRequest(**options)
    with ex.fresh():
        network = network_of(request, console.report)
        if network is None:
            return console.finish(1)
        # before anything is compiled
        if dump == "network":
            console.result = {"stage": dump, "text": network_text.show(network)}
            console.data(console.result["text"])
            return console.finish()
        backend, prune = request.backend, not request.no_prune
        prepared = prepare(network, console.report, formulation=request.formulation, backend=backend, prune=prune)
        if prepared is None:
            return console.finish(1)
        # a stage of the compiler as text
        if dump:
            made = prepared.compiled
            stages = {
                "reflected": lambda: network_text.show(made.in_author_letters(made.family)),
                "coordinates": lambda: network_text.show(made.in_author_letters(made.network)),
                "energies": lambda: energies.show(prepared.compiled.energies, prepared.formulation),
                "descriptor": lambda: descriptor.show(prepared.compiled.form),
                "program": lambda: program_text.show(prepared.compiled.program),
            }
            console.result = {"stage": dump, "text": stages[dump]()}
            console.data(console.result["text"])
        # files, beside a dump only where a folder is named
        if dump is None or folder is not None:
            _write(console, prepared, request.index, Path(folder or "."))
    if explain:
        console.say(_account(prepared))
    console.explain = explain
    return console.finish()


def _account(prepared: Prepared) -> str:
    """What became of nodes, branches, coordinates and unknowns, by which rule."""
    compiled = prepared.compiled
    rows = [("8.7", r.what, r.why) for r in prepared.left_out]
    rows += [(s.rule, s.what, s.became) for s in compiled.steps]
    held = {f.owner for f in compiled.form.families if f.kind == "q"}
    unseen = [c.name for c in compiled.energies.coordinates if c.name not in held]
    rows += [("8.7", f"displacement of {name}", "pruned: nothing reads it; its flow is the unknown") for name in unseen]
    if not prepared.network.events and not prepared.network.switches:
        system = System(prepared.structure, prepared.arrays, prepared.carrier)
        rows += [("sum", what, why) for what, why in departures(system)]
    return align(rows) if rows else "coordinate style: nothing was merged or pruned"


def _write(console: Console, prepared: Prepared, index: str | None, folder: Path) -> None:
    """The files of one index form; nothing where the model has no start or no such form."""
    happens: list[Event | Switch] = [*prepared.network.events, *prepared.network.switches]
    if happens:
        text = f"'{happens[0].name}' is not part of an exported residual yet: it is one smooth piece"
        console.report.error("E608", text, happens[0].place, help="sysdyn simulate, or --dump")
        return
    with report_impossible(prepared, console.report):
        formed = formed_of(prepared, index, console.report)
        if formed is None:
            return
        console.result = files.write(formed, folder)
        for text in formed.warnings:
            console.report.note("N608", text, prepared.network.place)
        names = "residual.c, binding.c" if prepared.backend == "c" else "residual.py"
        console.say(f"{folder}: {names}, binding.json, sysdyn_model.h, manifest.json; index {formed.index}")
