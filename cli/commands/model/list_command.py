"""`sysdyn list`: the names of a model, with units and values."""

from __future__ import annotations

import click
from sysdyn.cli.console import Console, with_console
from sysdyn.cli.options import Setting, complete_for_shell
from sysdyn.cli.run.request import targets
from sysdyn.dsl import load
from sysdyn.dsl.model import expression as ex


@with_console("list")
@click.argument("file")
@click.option(
    "--scene", metavar="NAME", shell_complete=complete_for_shell, help="With the settings and levels of a scene."
)
@click.option("--model", metavar="NAME", shell_complete=complete_for_shell, help="This model alone.")
@click.option(
    "--level", "levels", type=Setting(), multiple=True, shell_complete=complete_for_shell, help="PATH=NAME; repeatable."
)
def command(
    console: Console, file: str, scene: str | None, model: str | None, levels: tuple[tuple[str, str], ...]
) -> int:
    """List the names in FILE: parameters with units and values, what can be traced, scenes, components and levels."""
    from sysdyn.cli.manual import model_names

    document = targets.read(file, console.report)
    # the model that is named, or all of the file
    chosen = [targets.whole(document, file, model, scene, console.report)] if scene or model else _models(document)
    accounts = []
    for target in chosen:
        if target is None:
            continue
        with ex.fresh():
            found = load.listing(document, target.model, target.scene, console.report, levels)
            if found is not None:
                accounts.append(model_names.account(document, target.model, found))
    console.result = {"file": file, "models": accounts}
    if accounts:
        console.data(model_names.table(accounts))
    elif not console.report.failed:
        console.say(f"{file}: no model")
    return console.finish()


def _models(document: load.ParsedFile) -> list[targets.Target]:
    return [targets.Target(document, m, None) for m in document.models.values()]
