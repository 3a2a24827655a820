"""Levels of a component: which variant of its interior an instance has (E802, E803, E808)."""

from __future__ import annotations

from typing import TYPE_CHECKING

from sysdyn.dsl.elaborate.instances.level_ports import level_ports
from sysdyn.dsl.model.network import LevelChoice
from sysdyn.dsl.names.failures import Failed
from sysdyn.dsl.names.laws import ONE_PORTS, TWO_PORTS
from sysdyn.dsl.names.symbols import ComponentSymbol, nearest
from sysdyn.dsl.text.diagnostics import Place
from sysdyn.dsl.tree import syntax

if TYPE_CHECKING:
    from sysdyn.dsl.elaborate.instances.instances import Instances


def choose_level(
    frame: Instances, component: ComponentSymbol, s: syntax.InstanceStatement, path: str
) -> tuple[str | None, tuple[syntax.Statement, ...]]:
    """Name of the level and the statements of base and level: the scene's choice, the instance's, the default."""
    levels = {b.name.name: b for b in component.body if isinstance(b, syntax.LevelStatement)}
    base = tuple(b for b in component.body if not isinstance(b, syntax.LevelStatement))
    # by the scene (`level motor = thermal`) or the command line
    chosen, place = frame.levels.get(path, (None, None))
    # by the instance: `M: motor.thermal(...)`
    if chosen is None and len(s.component.names) > 1:
        chosen, place = s.component.names[1], frame.context.place(s.component.span)
    free = chosen is None
    # by the component: `level simple default { ... }`
    if chosen is None:
        chosen = next((n for n, level in levels.items() if level.default), None)
    # none is marked: a component without levels, or one of which the instance must say its choice
    if chosen is None:
        if levels:
            message = f"'{component.name}' has levels {', '.join(levels)} but no default"
            help_ = f"{component.name}.{next(iter(levels))}(...)"
            raise frame.resolver.fail("E803", message, s.component.span, help=help_)
        return None, base
    # a choice that the component does not have
    if chosen not in levels:
        message = f"no level '{chosen}'; '{component.name}' has {', '.join(levels) or 'none'}"
        near = nearest(chosen, levels)
        remedy = f"nearest: '{near}'" if near else None if levels else "leave the level out"
        frame.context.report.error("E802", message, place or frame.context.place(s.component.span), help=remedy)
        raise Failed
    if len(levels) > 1:
        frame.choices[path] = LevelChoice(path, chosen, tuple(levels), free)
    bodies = {name: _inherit_statements(frame, component, levels, level, ()) for name, level in levels.items()}
    described = {name: (level, bodies[name]) for name, level in levels.items()}
    level_ports(component.name, described, component.source, frame.context.report)
    return chosen, (*base, *bodies[chosen])


def elsewhere(component: ComponentSymbol, chosen: str | None) -> dict[str, str]:
    """Names that other levels than the chosen one declare, with the first of these levels."""
    found: dict[str, str] = {}
    for level in component.body:
        if isinstance(level, syntax.LevelStatement) and level.name.name != chosen:
            for statement in level.body:
                for decl in getattr(statement, "decls", (getattr(statement, "decl", None),)):
                    if decl is not None:
                        found.setdefault(decl.name, level.name.name)
    return found


def _inherit_statements(
    frame: Instances,
    component: ComponentSymbol,
    levels: dict[str, syntax.LevelStatement],
    level: syntax.LevelStatement,
    chain: tuple[str, ...],
) -> tuple[syntax.Statement, ...]:
    """A level's statements; those of the level that it extends where it has no statement of the same label."""
    if level.extends is None:
        return level.body
    name = level.extends.name
    parent = levels.get(name)
    # `level a extends b`, where b is missing, is a itself, or extends a
    if parent is None or name in chain or name == level.name.name:
        message = f"level '{level.name.name}' extends '{name}', which is no other level of '{component.name}'"
        frame.context.report.error("E802", message, Place(component.source, level.extends.span))
        raise Failed
    inherited = _inherit_statements(frame, component, levels, parent, (*chain, level.name.name))
    own = {key: b for b in level.body if (key := _label(b)) is not None}
    kept = []
    # a statement of the parent stays, unless this level has one of the same label
    for statement in inherited:
        key = _label(statement)
        if key is None or key not in own:
            kept.append(statement)
        # a replacement fits where the old one did: a resistor by another one-port, not by a let
        elif type(own[key]) is not type(statement) or not _alike(component, own[key], statement):
            ports = isinstance(own[key], syntax.InstanceStatement) and isinstance(statement, syntax.InstanceStatement)
            what = "an element of other ports" if ports else "a statement of another kind"
            message = f"'{key}' of level '{level.name.name}' replaces {what}"
            frame.context.report.error("E808", message, Place(component.source, own[key].span), help="a new label")
            raise Failed
    return (*kept, *level.body)


def _alike(component: ComponentSymbol, one: syntax.Statement, other: syntax.Statement) -> bool:
    """Whether two statements are no elements, or elements with the same ports and domains."""
    if not isinstance(one, syntax.InstanceStatement) or not isinstance(other, syntax.InstanceStatement):
        return True
    first, second = (_ports(component, s) for s in (one, other))
    if isinstance(first, int) or isinstance(second, int):  # built in: of any domain
        numbers = [p if isinstance(p, int) else p and (len(p) if p.keys() == {""} else 0) for p in (first, second)]
        return None in numbers or numbers[0] == numbers[1]
    return first is None or second is None or first == second


def _ports(component: ComponentSymbol, s: syntax.InstanceStatement) -> dict[str, str] | int | None:
    """Domains of an element's ports and branches by their names, "" the one that has none; how many branches a built-in
    element has; None of what nobody declares.
    """
    name = s.component.names[0]
    symbol = component.file_scope.find(name)
    if symbol is None:
        return 1 if name in ONE_PORTS else 2 if name in TWO_PORTS else None
    if not isinstance(symbol, ComponentSymbol):
        return None
    found: dict[str, str] = {}
    for b in symbol.body:
        if isinstance(b, (syntax.PortStatement, syntax.BranchStatement)):
            found |= {decl.name: b.domain.name for decl in b.decls} or {"": b.domain.name}
    return found


def _label(statement: syntax.Statement) -> str | None:
    """The label under which a statement can be replaced."""
    if isinstance(
        statement,
        (
            syntax.InstanceStatement,
            syntax.ParamStatement,
            syntax.LetStatement,
            syntax.OutputStatement,
            syntax.QuasiStatement,
            syntax.ConstraintStatement,
            syntax.InputStatement,
        ),
    ):
        return statement.decl.name
    return None
