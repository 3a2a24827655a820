"""`sysdyn report`: one self-contained page about a model under a scene."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click
from sysdyn.cli import whole_files
from sysdyn.cli.console import Console
from sysdyn.cli.failures import UsageError
from sysdyn.cli.options import scene_command


@scene_command("report", "run", "the traces hold")
@click.option("-o", "output", metavar="FILE.html", help="Default: <stem>-<scene>.html here.")
def command(console: Console, progress: str, output: str | None, **options: Any) -> int:
    """Write one page about a scene of FILE: text, network, laws, equations, run, energy balance.

    The page loads nothing and works offline. Without a time span in the scene nothing is run.
    """
    if output == "-" and console.as_json:
        raise UsageError("-o - and --json both want standard output")
    if output not in (None, "-") and Path(str(output)).suffix.lower() not in (".html", ".htm"):
        raise UsageError(f"'{output}': a report is an .html")
    from sysdyn.cli.report.collect import collect
    from sysdyn.cli.report.page import page
    from sysdyn.cli.run.request.run_request import RunRequest, default_output
    from sysdyn.dsl.model import expression as ex

    request = RunRequest(**options)
    with ex.fresh():
        with console.progress(progress) as line:
            # everything that the page shows, collected once
            study = collect(request, console.report, line)
        if study is None:
            return console.unable()
        text = page(study)
    target = output or default_output(request.file, study.network.scene.name if study.network.scene else "", ".html")
    whole_files.write(target, text)
    console.say(f"{target}: {study.target.name}, {len(text) / 1e3:.0f} kB")
    console.result = {
        "report": target,
        "formulation": study.prepared.formulation,
        "dof": study.started.facts.dof,
        "index": study.started.facts.index,
        "final": None if study.ran is None else study.ran.outcome.final,
        "met": None if study.ran is None else study.ran.outcome.met,
        "failure": None if study.ran is None else study.ran.failure,
    }
    return console.finish(0 if study.ran is None else study.ran.exit)
