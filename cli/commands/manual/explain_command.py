"""`sysdyn explain`: what a diagnostic code means."""

from __future__ import annotations

import difflib

import click
from sysdyn.cli.console import Console, with_console
from sysdyn.cli.failures import UsageError
from sysdyn.cli.options import complete_for_shell
from sysdyn.dsl.text import codes


@with_console("explain")
@click.argument("code", required=False, shell_complete=complete_for_shell)
def command(console: Console, code: str | None) -> int:
    """Explain CODE: the rule, its reason, a text that breaks it and one that keeps it. Without CODE: the index."""
    if code is None:
        console.result = {"codes": [{"code": c.code, "title": c.title} for c in codes.codes().values()]}
        console.data(codes.index())
        return console.finish()
    name = code.strip().upper()
    known = list(codes.codes())
    if name not in known:
        near = difflib.get_close_matches(name, known, 3, 0.5)
        hint = f"; near: {', '.join(near)}" if near else ""
        raise UsageError(f"there is no code '{code[:40]}'{hint}")
    console.result = {"code": name, "text": codes.explain(name)}
    console.data(codes.explain(name))
    return console.finish()
