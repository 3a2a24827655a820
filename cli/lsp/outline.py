"""What a text declares: names with their places, kinds and comments, read from the tree alone."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

from sysdyn.cli.lsp.positions import range_of
from sysdyn.dsl.names.laws import ONE_PORTS, TWO_PORTS
from sysdyn.dsl.text.source import Place, SourceText, Span
from sysdyn.dsl.tree import syntax
from sysdyn.values import dataclass

FILE, MODULE, CLASS, METHOD, FIELD, FUNCTION, VARIABLE, CONSTANT = 1, 2, 5, 6, 8, 12, 13, 14
STRING, OBJECT, KEY, STRUCT, EVENT, OPERATOR = 15, 19, 20, 23, 24, 25
SYMBOLS = {
    "model": MODULE,
    "component": CLASS,
    "scene": EVENT,
    "domain": STRUCT,
    "bundle": STRUCT,
    "unit": OPERATOR,
    "const": CONSTANT,
    "function": FUNCTION,
    "table": FUNCTION,
    "parameter": CONSTANT,
    "element": OBJECT,
    "instance": OBJECT,
    "level": METHOD,
    "constraint": KEY,
    "energy": KEY,
    "content": KEY,
    "node": FIELD,
    "port": FIELD,
    "branch": FIELD,
}
"""The protocol's kind of symbol of each kind of name; others are variables."""


@dataclass(frozen=True, slots=True)
class Declared:
    """A name that a text declares.  of: the domain, unit or component that it is declared of; span: its statement."""

    name: str
    kind: str
    place: Place
    span: Span
    doc: str
    of: str = ""
    body: tuple[Any, ...] = ()

    @property
    def text(self) -> str:
        """Its statement; of an item with a body the head."""
        whole = self.place.source.text[self.span.start : self.span.end]
        return whole.partition("{")[0].rstrip() if self.body or self.kind in _BLOCKS else whole


_BLOCKS = ("model", "component", "scene")
_ITEMS: dict[type, str] = {
    syntax.ModelDefinition: "model",
    syntax.ComponentDefinition: "component",
    syntax.SceneDefinition: "scene",
    syntax.DomainDefinition: "domain",
    syntax.BundleDefinition: "bundle",
    syntax.UnitAlias: "unit",
    syntax.UnitBase: "unit",
    syntax.ConstDefinition: "const",
    syntax.FunctionDefinition: "function",
    syntax.TableDefinition: "table",
}
_SINGLE: dict[type, str] = {
    syntax.ParamStatement: "parameter",
    syntax.InputStatement: "input",
    syntax.OutputStatement: "output",
    syntax.QuasiStatement: "quasi-velocity",
    syntax.StateStatement: "state",
    syntax.DiscreteStatement: "discrete",
    syntax.LetStatement: "let",
    syntax.ConstraintStatement: "constraint",
}
_SEVERAL: dict[type, str] = {
    syntax.NodeStatement: "node",
    syntax.PortStatement: "port",
    syntax.BranchStatement: "branch",
    syntax.CoordStatement: "coordinate",
    syntax.ImplicitStatement: "implicit",
}


def items(tree: syntax.File) -> Iterator[Declared]:
    """The names of a file's own items."""
    for item in tree.items:
        kind = _ITEMS.get(type(item))
        if kind is not None:
            body = tuple(getattr(item, "body", ()))
            word: syntax.Word = getattr(item, "name")  # noqa: B009 (of one of the kinds above)
            yield _declaration(tree.source, word.name, kind, word.span, item, body=body)


def body(source: SourceText, statements: Sequence[Any]) -> Iterator[Declared]:
    """The names that statements declare, those of levels and loops too."""
    for s in statements:
        # param k, let x, state s: one name
        if (kind := _SINGLE.get(type(s))) is not None:
            unit = getattr(s, "unit", None)
            yield _declaration(source, s.decl.name, kind, s.decl.span, s, of="" if unit is None else unit.text)
        # node a, b: several
        elif (kind := _SEVERAL.get(type(s))) is not None:
            of = s.unit.text if isinstance(s, syntax.ImplicitStatement) else s.domain.name
            for decl in s.decls:
                yield _declaration(source, decl.name, kind, decl.span, s, of=of)
        # an element or a component
        elif isinstance(s, syntax.InstanceStatement):
            of = ".".join(s.component.names)
            kind = "element" if of in (*ONE_PORTS, *TWO_PORTS) else "instance"
            yield _declaration(source, s.decl.name, kind, s.decl.span, s, of=of)
        elif isinstance(s, (syntax.EnergyStatement, syntax.ContentStatement)) and s.name is not None:
            yield _declaration(
                source, s.name.name, "energy" if isinstance(s, syntax.EnergyStatement) else "content", s.name.span, s
            )
        # a level and all that stands in it
        elif isinstance(s, syntax.LevelStatement):
            yield _declaration(source, s.name.name, "level", s.name.span, s, body=s.body)
            yield from body(source, s.body)
        # the loop variable and the loop's body
        elif isinstance(s, syntax.ForStatement):
            yield _declaration(source, s.index.name, "index", s.index.span, s)
            yield from body(source, s.body)


def _declaration(
    source: SourceText, name: str, kind: str, span: Span, node: Any, of: str = "", body: tuple[Any, ...] = ()
) -> Declared:
    place = source.place(span.start, span.start + len(name))
    return Declared(name, kind, place, node.span, (node.doc or "").strip(), of, body)


def symbols(tree: syntax.File) -> list[dict[str, Any]]:
    """The protocol's document symbols: items, and what models and components declare."""
    return [_symbol(d, _inner(tree.source, d)) for d in items(tree)]


def _inner(source: SourceText, item: Declared) -> list[dict[str, Any]]:
    """Symbols inside of a model or component, those of levels under their level."""
    if item.kind not in ("model", "component"):
        return []
    found, seen = [], set[tuple[str, Span]]()
    levels = [d for d in body(source, item.body) if d.kind == "level"]
    for d in body(source, item.body):
        inside = d.kind != "level" and any(level.span.start < d.place.span.start < level.span.end for level in levels)
        if d.kind == "index" or inside or (d.name, d.place.span) in seen:
            continue
        seen.add((d.name, d.place.span))
        within = [_symbol(i, []) for i in body(source, d.body) if i.kind != "index"] if d.kind == "level" else []
        found.append(_symbol(d, within))
    return found


def _symbol(d: Declared, within: list[dict[str, Any]]) -> dict[str, Any]:
    """The protocol's symbol of a name; of several names in one statement each has its own place alone."""
    source = d.place.source
    return {
        "name": d.name,
        "detail": f"{d.kind} {d.of}".strip(),
        "kind": SYMBOLS.get(d.kind, VARIABLE),
        "range": range_of(source, Span(min(d.span.start, d.place.span.start), max(d.span.end, d.place.span.end))),
        "selectionRange": range_of(source, d.place.span),
        "children": within,
    }
