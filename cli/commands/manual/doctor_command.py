"""`sysdyn doctor`: is this machine as sysdyn needs it?"""

from __future__ import annotations

from dataclasses import asdict

from sysdyn.cli.console import Console, with_console


@with_console("doctor")
def command(console: Console) -> int:
    """Look at versions, C compiler, cache, trace files, and run a small model by both backends.

    Exit 1 where something is wrong; what is only slower or left out is a warning.
    """
    from sysdyn.cli.page.columns import align
    from sysdyn.cli.project.health import examine

    found = list(examine())
    wrong = [f for f in found if f.state == "error"]
    console.result = {"findings": [asdict(f) for f in found]}
    rows = []
    for f in found:
        if f.state != "ok" or not console.quiet:
            rows.append((f.state, f.name, f.said))
            rows += [("", "", f"help: {f.help}")] if f.help else []
    if rows:
        console.data(align(rows))
    return console.finish(1 if wrong else 0)
