"""E804: what is visible from outside a component belongs to its base, or to all its levels with the same type.

Ports, branches and inputs; a parameter that a level has no use for is left out where another level is chosen (N905).
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence

from sysdyn.dsl.text.diagnostics import Place, Report, SourceText
from sysdyn.dsl.tree import syntax

Visible = dict[tuple[str, str], str]
"""Kind and name of what a level shows, and its type as written."""


def level_ports(
    name: str,
    levels: Mapping[str, tuple[syntax.LevelStatement, Sequence[syntax.Statement]]],
    source: SourceText,
    report: Report,
) -> None:
    """Compare the levels of a component; each is given with all its statements, inherited ones included."""
    shown = {level: _visible(body) for level, (_, body) in levels.items()}
    first: Visible = {}
    owner: dict[tuple[str, str], str] = {}
    # the first level that has a port tells what it is
    for level, visible in shown.items():
        for key, kind in visible.items():
            first.setdefault(key, kind)
            owner.setdefault(key, level)
    # each other level needs the same, or an instance could not change its level
    for level, visible in shown.items():
        for key, kind in first.items():
            if visible.get(key) == kind:
                continue
            what = f"{key[0]} '{key[1]}'" if key[1] else f"the {key[0]}"
            message = f"level '{level}' of '{name}' lacks {what}, which level '{owner[key]}' has"
            # there, but of another domain or unit
            if key in visible:
                message = f"{what} of '{name}' is {visible[key]} at level '{level}', {kind} at level '{owner[key]}'"
            help_ = f"{key[0]}s belong to the base, above the levels"
            report.error("E804", message, Place(source, levels[level][0].name.span), help=help_)
            # one finding a level: the rest mostly follows from it
            break


def _visible(body: Iterable[syntax.Statement]) -> Visible:
    """What is visible of a body from outside: domain of each port and branch, unit of each input, by kind and name."""
    found: Visible = {}
    for statement in body:
        match statement:
            case syntax.PortStatement():
                found |= {("port", d.name): statement.domain.name for d in statement.decls}
            case syntax.BranchStatement():
                names = [d.name for d in statement.decls] or [""]
                found |= {("branch", name): statement.domain.name for name in names}
            case syntax.InputStatement():
                found["input", statement.decl.name] = statement.unit.text
    return found
