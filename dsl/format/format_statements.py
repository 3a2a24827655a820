"""Statements as text: for each kind the pieces of its line, or of the head of its block.

A piece is a string; `layout` joins pieces to lines. Nothing here looks at places or comments.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from typing import Any

from sysdyn.dsl.format.format_expressions import format_unit, pieces
from sysdyn.dsl.tree import syntax as s

Pieces = list[str]


def statement_pieces(node: Any) -> Pieces:
    """The pieces of a statement's line; of a statement with a block, those before the `{`."""
    return _PIECES[type(node)](node)


def row_text(row: s.TableRow) -> str:
    """One row of a table."""
    return "(" + ", ".join(number.text for number in row.numbers) + ")"


def _comma_list(parts: Iterable[Pieces]) -> Pieces:
    """Parts with commas between them."""
    out: Pieces = []
    for part in parts:
        if out:
            out.append(", ")
        out.extend(part)
    return out


def _decl(decl: s.Decl) -> Pieces:
    """A declared name with its indices."""
    if not decl.indices:
        return [decl.name]
    return [decl.name + "[", *_comma_list(pieces(index) for index in decl.indices), "]"]


def _decls(decls: Sequence[s.Decl]) -> Pieces:
    """Declared names."""
    return _comma_list(_decl(item) for item in decls)


def _after(text: str, expr: s.Expr | None) -> Pieces:
    """An optional expression behind a sign or word."""
    return [] if expr is None else [text, *pieces(expr)]


def _of_unit(unit: s.UnitExpression | None) -> Pieces:
    """An optional unit behind a colon."""
    return [] if unit is None else [": ", format_unit(unit)]


def _initial(initial: s.InitialValue | None) -> Pieces:
    """An optional initial value."""
    if initial is None:
        return []
    return [" = " if initial.kind == "fixed" else " ~ ", *pieces(initial.value)]


def _args(args: Sequence[s.Arg] | None) -> Pieces:
    """Arguments in parentheses; none at all where None."""
    if args is None:
        return []
    return ["(", *_comma_list(_arg(item) for item in args), ")"]


def _arg(arg: s.Arg) -> Pieces:
    """One argument."""
    return [*(() if arg.name is None else (f"{arg.name} = ",)), *pieces(arg.value)]


def _optional_name(name: s.Word | None) -> str:
    """An optional name behind a space."""
    return "" if name is None else " " + name.name


def _parameters(params: Sequence[s.FormalParameter]) -> Pieces:
    """The head of a function or table."""
    return ["(", *_comma_list(_parameter(item) for item in params), ")"]


def _parameter(item: s.FormalParameter) -> Pieces:
    """One argument of a function or table."""
    size = [] if item.size is None else ["[", *pieces(item.size), "]"]
    return [item.name, *size, ": ", format_unit(item.unit)]


def _import(n: s.Import) -> Pieces:
    return [f"from {'.'.join(n.module.names)} import ", *_comma_list([word.name] for word in n.names)]


def _role(n: s.DomainRole) -> Pieces:
    return [f"{n.kind} {n.name.name}: {format_unit(n.unit)}"]


def _member(n: s.BundleMember) -> Pieces:
    return [*_comma_list([word.name] for word in n.names), ": ", n.domain.name]


def _function(n: s.FunctionDefinition) -> Pieces:
    head = [f"fn {n.name.name}", *_parameters(n.params), " -> ", format_unit(n.result)]
    return [*head, *_after(" = ", n.value)]


def _table(n: s.TableDefinition) -> Pieces:
    """All of a table but its rows."""
    outside = "" if n.extrapolation is None else " " + n.extrapolation
    head = [f"table {n.name.name}", *_parameters(n.params), " -> "]
    source = "" if n.file is None else f' file "{n.file}"'
    return [*head, f"{format_unit(n.result)} {n.interpolation}{outside}{source}"]


def _param(n: s.ParamStatement) -> Pieces:
    return ["param ", *_decl(n.decl), *_of_unit(n.unit), *_after(" = ", n.value)]


def _node(n: s.NodeStatement) -> Pieces:
    return ["node ", *_decls(n.decls), ": ", n.domain.name, *_initial(n.init)]


def _branch(n: s.BranchStatement) -> Pieces:
    return [*(["branch ", *_decls(n.decls)] if n.decls else ["branch"]), ": ", n.domain.name]


def _coord(n: s.CoordStatement) -> Pieces:
    tangible = {None: "", True: " tangible", False: " intangible"}[n.tangible]
    return [n.kind + " ", *_decls(n.decls), ": ", n.domain.name + tangible, *_initial(n.init)]


def _constraint(n: s.ConstraintStatement) -> Pieces:
    guards = [piece for guard in n.guards for piece in (f" {guard.kind} ", *pieces(guard.expr))]
    sides = [*pieces(n.left), f" {n.relation} ", *pieces(n.right)]
    return [n.kind + " ", *_decl(n.decl), ": ", *sides, *guards]


def _expect(n: s.ExpectStatement) -> Pieces:
    moment = [] if n.moment is None else [n.moment + ": "]
    if n.at is not None:
        moment = ["at ", *pieces(n.at), ": "]
    sides = [*pieces(n.left), f" {n.op} ", *pieces(n.right)]
    return ["expect ", *moment, *sides, *_after(" within ", n.within)]


def _instance(n: s.InstanceStatement) -> Pieces:
    head = [*_decl(n.decl), ": ", ".".join(n.component.names), *_args(n.args)]
    connections = _comma_list(_connection(item) for item in n.connections)
    return [*head, *([" ", *connections] if connections else [])]


def _connection(n: s.Connection) -> Pieces:
    """Text of a connection in pieces, as it is written behind the parentheses of an element."""
    match n:
        case s.Across(plus, minus):
            return [*pieces(plus), " -> ", *pieces(minus)]
        case s.On(expr):
            return ["on ", *pieces(expr)]
        case s.Bind(name, value):
            return [name.name + " = ", *pieces(value)]
        case s.BindAcross(name, plus, minus):
            return [name.name + " = ", *pieces(plus), " -> ", *pieces(minus)]
        case s.Single(node):
            return pieces(node)


def _trace(n: s.TraceStatement) -> Pieces:
    items = (
        [*pieces(i.expr), *([] if i.unit is None else [" in ", format_unit(i.unit)]), *_alias(i.alias)] for i in n.items
    )
    return ["trace ", *_comma_list(items), *_after(" every ", n.every)]


def _alias(alias: s.Word | None) -> Pieces:
    return [] if alias is None else [" as ", alias.name]


def _accuracy(n: s.AccuracyStatement) -> Pieces:
    on = [" on ", *_comma_list(pieces(item) for item in n.on)] if n.on else []
    return ["accuracy ", *pieces(n.value), *on, *([" relative to range"] if n.to_range else [])]


def _level(n: s.LevelStatement) -> Pieces:
    extends = "" if n.extends is None else " extends " + n.extends.name
    return [f"level {n.name.name}{extends}{' default' if n.default else ''}"]


_PIECES: dict[type[Any], Callable[[Any], Pieces]] = {
    s.Import: _import,
    s.DomainDefinition: lambda n: [f"domain {n.name.name}"],
    s.DomainRole: _role,
    s.DomainNode: lambda n: [f"node common {n.common}"],
    s.DomainGround: lambda n: [f'ground "{n.text}"'],
    s.DomainPseudo: lambda n: ["pseudo: ", format_unit(n.unit)],
    s.BundleDefinition: lambda n: [f"bundle {n.name.name}"],
    s.BundleMember: _member,
    s.UnitAlias: lambda n: [f"unit {n.name.name}", *_after(" = ", n.value)],
    s.UnitBase: lambda n: [f"unit {n.name.name} base"],
    s.ConstDefinition: lambda n: [f"const {n.name.name}", *_after(" = ", n.value)],
    s.FunctionDefinition: _function,
    s.TableDefinition: _table,
    s.ComponentDefinition: lambda n: [f"component {n.name.name}"],
    s.ModelDefinition: lambda n: [f"model {n.name.name}"],
    s.SceneDefinition: lambda n: [f"scene {n.name.name} of {'.'.join(n.model.names)}"],
    s.ParamStatement: _param,
    s.NodeStatement: _node,
    s.PortStatement: lambda n: ["port ", *_decls(n.decls), ": ", n.domain.name],
    s.BranchStatement: _branch,
    s.InputStatement: lambda n: ["input ", *_decl(n.decl), *_of_unit(n.unit), *_after(" = ", n.value)],
    s.OutputStatement: lambda n: ["output ", *_decl(n.decl), *_after(" = ", n.value)],
    s.QuasiStatement: lambda n: ["quasi ", *_decl(n.decl), *_of_unit(n.unit), *_after(" = ", n.value)],
    s.CoordStatement: _coord,
    s.ImplicitStatement: lambda n: ["implicit ", *_decls(n.decls), *_of_unit(n.unit), *_initial(n.init)],
    s.StateStatement: lambda n: ["state ", *_decl(n.decl), *_of_unit(n.unit), *_after(" = ", n.value)],
    s.DiscreteStatement: lambda n: ["discrete ", *_decl(n.decl), *_of_unit(n.unit), *_after(" = ", n.value)],
    s.DynamicStatement: lambda n: ["dynamic ", *pieces(n.target), *_after(" = ", n.value)],
    s.LetStatement: lambda n: ["let ", *_decl(n.decl), *_after(" = ", n.value)],
    s.LawStatement: lambda n: ["law ", *pieces(n.left), *_after(" = ", n.right)],
    s.EnergyStatement: lambda n: [f"energy {n.function}{_optional_name(n.name)}", *_after(" = ", n.value)],
    s.ContentStatement: lambda n: [f"content {n.function}{_optional_name(n.name)}", *_after(" = ", n.value)],
    s.WorkStatement: lambda n: ["work ", *pieces(n.effort), *_after(" on ", n.on)],
    s.ConstraintStatement: _constraint,
    s.InitStatement: lambda n: ["init ", *pieces(n.target), *_initial(n.initial)],
    s.WhenStatement: lambda n: ["when ", *pieces(n.condition)],
    s.EveryStatement: lambda n: ["every ", *pieces(n.period)],
    s.ActionStatement: lambda n: [*pieces(n.target), *_after(" := ", n.value)],
    s.ForStatement: lambda n: [f"for {n.index.name} in ", *pieces(n.lower), "..", *pieces(n.upper)],
    s.LevelStatement: _level,
    s.RequireStatement: lambda n: ["require ", *pieces(n.condition)],
    s.ExpectStatement: _expect,
    s.GoldenStatement: lambda n: [f'expect golden "{n.file}"', *_after(" within ", n.within)],
    s.LosslessStatement: lambda n: ["lossless"],
    s.InstanceStatement: _instance,
    s.TimeStatement: lambda n: ["time ", *pieces(n.start), *_after(" to ", n.stop)],
    s.SetStatement: lambda n: ["set ", *pieces(n.target), *_after(" = ", n.value)],
    s.SceneLevelStatement: lambda n: ["level ", *pieces(n.target), f" = {n.level.name}"],
    s.TraceStatement: _trace,
    s.AccuracyStatement: _accuracy,
    s.FormulationStatement: lambda n: [f"formulation {n.name.name}"],
    s.SolverStatement: lambda n: [f"solver {n.name.name}", *_args(n.args)],
    s.RedundancyStatement: lambda n: [f"redundancy {n.name.name}"],
    s.LimitStatement: lambda n: [f"limit {n.name.name} ", *pieces(n.value)],
}
