"""Where a tree has names and units: what is a name is told by the grammar, not by how it looks."""

from __future__ import annotations

import re
from collections.abc import Iterator

from sysdyn.dsl.text.source import Span
from sysdyn.dsl.tree import syntax
from sysdyn.dsl.tree.walking import children
from sysdyn.values import dataclass

_DOTS = re.compile(r"[^\W\d]\w*")


@dataclass(frozen=True, slots=True)
class Marks:
    """Offsets at which names begin, and the spans of units."""

    names: frozenset[int]
    units: tuple[Span, ...]
    domains: frozenset[int]
    """Offsets of names that can only be those of domains."""
    levels: dict[int, syntax.Expr | None]
    """Offsets of names that can only be those of levels, with what a scene sets to the level."""

    def unit(self, offset: int) -> bool:
        """Whether a place is in a unit."""
        return any(span.start <= offset < span.end for span in self.units)


def marks(tree: syntax.File) -> Marks:
    """All names and units of a tree."""
    names, units = set[int](), list[Span]()
    domains, levels = set[int](), dict[int, syntax.Expr | None]()
    stack: list[object] = list(tree.items)
    while stack:
        node = stack.pop()
        if isinstance(node, syntax.UnitExpression):
            units.append(node.span)
            continue
        # what stands behind a colon is a domain there
        if isinstance(
            node,
            (
                syntax.NodeStatement,
                syntax.PortStatement,
                syntax.BranchStatement,
                syntax.CoordStatement,
                syntax.BundleMember,
            ),
        ):
            domains.add(node.domain.span.start)
        # level names are looked up in the component
        elif isinstance(node, syntax.SceneLevelStatement):
            levels[node.level.span.start] = node.target
        elif isinstance(node, syntax.LevelStatement):
            levels |= {w.span.start: None for w in (node.name, node.extends) if w is not None}
        names.update(_names(node, tree.source.text))
        stack += children(node)
    return Marks(frozenset(names), tuple(units), frozenset(domains), levels)


def _names(node: object, text: str) -> Iterator[int]:
    """Offsets of the names of a node: where the cursor may ask for their meaning."""
    match node:
        case syntax.Name() | syntax.Word() | syntax.Decl() | syntax.FunctionCall() | syntax.FormalParameter():
            yield node.span.start
        # x.power: the last word
        case syntax.Member():
            yield node.span.end - len(node.name)
        # x.derivative(...): the word behind the dot
        case syntax.MethodCall():
            found = _DOTS.search(text, node.base.span.end)
            yield node.span.start if found is None else found.start()
        # std.thermal: each word
        case syntax.Dotted():
            yield from (m.start() for m in _DOTS.finditer(text, node.span.start, node.span.end))
        case syntax.Arg(name=str()):
            yield node.span.start
