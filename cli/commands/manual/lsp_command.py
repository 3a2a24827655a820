"""`sysdyn lsp`: the language server of editors."""

from __future__ import annotations

import click
from sysdyn.cli.console import Console, with_console
from sysdyn.cli.failures import UsageError


@with_console("lsp")
@click.option("--stdio", is_flag=True, help="Over standard input and output: the only way there is.")
def command(console: Console, stdio: bool) -> int:
    """Serve an editor over standard input and output by the Language Server Protocol 3.17.

    Findings of unsaved texts as 'check' has them, layout, safe changes, hover, definitions, references, symbols,
    completion. How an editor is told of it: sysdyn help editors.
    """
    if console.as_json:
        raise UsageError("--json: standard output belongs to the protocol")
    from sysdyn.cli.lsp.loop import serve_standard_streams

    return serve_standard_streams()
