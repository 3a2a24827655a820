"""Components that no model of their file uses: each judged in a model of its own, which gives it what it asks for.

The model has a node for each port and both ends of each branch, and a parameter or input without a value for each that
the component wants; unit variables are pure numbers there.  What is told is the component's own: its names, units, laws
and connections, nothing of what only a user decides (where its ports lead, what its parameters are).

Received: a parsed file; returned: names of components and findings.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator, Sequence
from dataclasses import replace

from sysdyn.dsl.elaborate.parts import declarations_of
from sysdyn.dsl.load import ParsedFile, network
from sysdyn.dsl.model import budget
from sysdyn.dsl.model.expression import fresh
from sysdyn.dsl.text.diagnostics import Diagnostic, Place, Report
from sysdyn.dsl.text.source import Span
from sysdyn.dsl.tree import syntax
from sysdyn.dsl.tree.walking import children

_ITS_USERS = {"E409", "E411", "E412", "E413", "W705", "E322", "E805", "E807"}
"""What is said of a network, whose other part is missing here, and of numbers, which a user gives."""
_Port = syntax.PortStatement | syntax.BranchStatement | syntax.InputStatement
_SIZE = 3
"""Of arrays whose size a user gives."""


def unused_components(file: syntax.File) -> list[syntax.ComponentDefinition]:
    """The components of a file that no model in it has inside, whichever level is chosen."""
    components = {item.name.name: item for item in file.items if isinstance(item, syntax.ComponentDefinition)}
    used, stack = set[str](), [item for item in file.items if isinstance(item, syntax.ModelDefinition)]
    found: list[object] = list(stack)
    while found:
        node = found.pop()
        if isinstance(node, syntax.InstanceStatement):
            name = node.component.names[0]
            if name in components and name not in used:
                used.add(name)
                found.append(components[name])
        found += children(node)
    return [component for name, component in components.items() if name not in used]


def check_unused_components(document: ParsedFile) -> Iterator[tuple[str, Report]]:
    """Of each such component of a file: its name, and what is wrong with it and with what stands outside of all models
    and components.
    """
    with budget.drawn(document.file.source.text):  # one for all of them: each may have the others inside
        for part in unused_components(document.file):
            report = Report()
            try:
                budget.unfold(budget.NODE * len(document.file.items), "components that no model uses")  # each reads all
                report = _check_component(document, part)
            except budget.SpentError as spent:
                report.add(spent.diagnostic(Place(document.file.source, part.name.span)))
            yield part.name.name, report
            if any(d.code == "E119" for d in report):  # what follows finds nothing left either
                return


def _check_component(document: ParsedFile, component: syntax.ComponentDefinition) -> Report:
    """The findings of a component under each of its levels, those within its own text alone."""
    report, source = Report(), document.file.source
    whole = [
        i
        for i in document.file.items
        if isinstance(i, (syntax.ComponentDefinition, syntax.ModelDefinition, syntax.SceneDefinition))
    ]
    others = [item.span for item in whole if item is not component]
    for model in _models(component):
        inner = Report()
        with fresh():
            network(document, model, None, inner, required=False)
        report.extend(d for d in inner if _own(d, others) and d.place is not None and d.place.source is source)
    return report


def _own(finding: Diagnostic, others: Iterable[Span]) -> bool:
    if finding.severity == "note" or finding.code in _ITS_USERS or finding.place is None:
        return False
    return not any(span.start <= finding.place.span.start < span.end for span in others)


def _models(component: syntax.ComponentDefinition) -> Iterator[syntax.ModelDefinition]:
    """One for each level of a component."""
    levels = [s for s in component.body if isinstance(s, syntax.LevelStatement)]
    base = tuple(s for s in component.body if not isinstance(s, syntax.LevelStatement))
    if not levels:
        yield _model(component, base, ())
    for level in levels:
        yield _model(component, [*base, *_inside(level, levels)], (level.name.name,))


def _inside(level: syntax.LevelStatement, levels: Iterable[syntax.LevelStatement]) -> Iterator[syntax.Statement]:
    """The statements of a level and of those that it extends."""
    known, seen = {one.name.name: one for one in levels}, set[str]()
    at: syntax.LevelStatement | None = level
    while at is not None and at.name.name not in seen:
        yield from at.body
        seen.add(at.name.name)
        at = known.get(at.extends.name) if at.extends else None


def _model(
    component: syntax.ComponentDefinition, said: Sequence[syntax.Statement], level: tuple[str, ...]
) -> syntax.ModelDefinition:
    """A model of one instance of a component."""
    ports = [s for s in said if isinstance(s, (syntax.PortStatement, syntax.BranchStatement, syntax.InputStatement))]
    sizes = {n.name for s in said for n in _below(bound for d in declarations_of(s) for bound in d.indices)}
    if any(d.indices for s in ports for d in declarations_of(s)):  # of a size that the component says
        around, args = _parameters(said, sizes, every=True)
    else:
        around, args = _parameters(said, sizes)
    span, connections = component.span, list[syntax.Connection]()
    for port in ports:
        node, ends = _surroundings(port)
        around.append(node)
        connections += ends
    label, taken = component.name.name, {d.name for s in around for d in declarations_of(s)}
    while label in taken:
        label += "_"
    kind = syntax.Dotted((component.name.name, *level), component.name.span)
    instance = syntax.InstanceStatement(
        syntax.Decl(label, (), component.name.span), kind, tuple(args), tuple(connections), span
    )
    return syntax.ModelDefinition(syntax.Word(f"a user of {component.name.name}", span), (*around, instance), span)


def _parameters(
    said: Iterable[syntax.Statement], sizes: Collection[str], *, every: bool = False
) -> tuple[list[syntax.Statement], list[syntax.Arg]]:
    """Parameters of the model, one for each that must be given, or for every one; how they are given."""
    own = [s for s in said if isinstance(s, syntax.ParamStatement) and (every or s.value is None)]
    found = list[syntax.Statement]()
    for s in own:
        size = s.value is None and s.decl.name in sizes
        value = syntax.Number(float(_SIZE), str(_SIZE), s.span) if size else s.value
        found.append(replace(s, unit=s.unit and _plain(s.unit), value=value))
    return found, [syntax.Arg(s.decl.name, _name(s.decl), s.decl.span) for s in own]


def _surroundings(port: _Port) -> tuple[syntax.Statement, list[syntax.Connection]]:
    """What stands at a port, the branches of a statement, or an input, and how it is connected."""
    match port:
        case syntax.InputStatement():
            inner = replace(port, unit=_plain(port.unit), value=None)
            return inner, [syntax.Bind(syntax.Word(port.decl.name, port.span), _name(port.decl), port.span)]
        case syntax.PortStatement():
            ends = [syntax.Bind(syntax.Word(d.name, d.span), _name(d), d.span) for d in port.decls]
            return syntax.NodeStatement(port.decls, port.domain, None, port.span), [*ends]
    nodes, found = list[syntax.Decl](), list[syntax.Connection]()
    for d in port.decls or (syntax.Decl("", (), port.span),):
        plus, minus = (syntax.Decl(f"{d.name}{end}", d.indices, d.span) for end in ("+", "-"))
        nodes += [plus, minus]
        between = _name(plus), _name(minus), d.span
        found.append(syntax.BindAcross(syntax.Word(d.name, d.span), *between) if d.name else syntax.Across(*between))
    return syntax.NodeStatement(tuple(nodes), port.domain, None, port.span), found


def _below(found: Iterable[object]) -> Iterator[syntax.Name]:
    """The names in some expressions."""
    stack = list(found)
    while stack:
        node = stack.pop()
        if isinstance(node, syntax.Name):
            yield node
        stack += children(node)


def _name(decl: syntax.Decl) -> syntax.Name:
    return syntax.Name(decl.name, decl.span)


def _plain(unit: syntax.UnitExpression) -> syntax.UnitExpression:
    """A unit without its variables."""
    factors = tuple(f for f in unit.factors if not f.name.startswith("$"))
    return replace(unit, factors=factors)
