"""`sysdyn std`: the standard library's reference."""

from __future__ import annotations

import click
from sysdyn.cli.console import Console, with_console
from sysdyn.cli.failures import UsageError
from sysdyn.cli.options import complete_for_shell


@with_console("std")
@click.argument("name", required=False, shell_complete=complete_for_shell)
def command(console: Console, name: str | None) -> int:
    """Show the standard library: the index, a module, or the ports, parameters, laws and an example of NAME."""
    from sysdyn.cli.manual import library

    module = (name or "").removeprefix("std.")
    # `std` has the index, `std thermal` a module, `std Wall` or `std thermal.Wall` an entry
    entry = None if name is None or (name.startswith("std.") and "." not in module) else library.find(name)
    if entry is None and name is not None and module not in library.modules():
        raise UsageError(_no_such_entry(name, [e.name for e in library.entries()], [*library.modules()]))
    if entry is not None:
        console.result = library.account(entry)
        console.data(library.page(entry))
    if module in ("", *library.modules()):  # some modules have the name of a domain
        chosen = [e for e in library.entries() if module in ("", e.module)]
        listed = [{"name": e.name, "module": e.module, "kind": e.kind, "doc": e.line} for e in chosen]
        console.result |= {"entries": listed}
        console.data(("\n" if entry else "") + library.index(module or None))
    if name is None:
        console.say("sysdyn std NAME shows one; kinetic, potential, dissipator, ...: sysdyn help elements")
    return console.finish()


def _no_such_entry(name: str, names: list[str], modules: list[str]) -> str:
    from sysdyn.dsl.names.laws import ONE_PORTS, TWO_PORTS
    from sysdyn.dsl.names.symbols import nearest

    if name in (*ONE_PORTS, *TWO_PORTS):
        return f"'{name}' is part of the language, not of its library: sysdyn help elements"
    near = nearest(name.rpartition(".")[2], [*names, *modules])
    hint = f"nearest: '{near}'" if near else "sysdyn std lists it"
    return f"the standard library has no '{name[:60]}'; {hint}"
