"""Bundles: several nodes, or bundles of them, handled as one."""

from __future__ import annotations

from collections.abc import Callable, Iterator

from sysdyn.dsl.model import expression as ex
from sysdyn.dsl.model.expression import Node
from sysdyn.dsl.names.symbols import (
    BundleNode,
    BundleSymbol,
    DomainSymbol,
    End,
    NodeSymbol,
    PortSymbol,
    Scope,
    Symbol,
    nearest,
)
from sysdyn.dsl.text.diagnostics import Place, Related, Report
from sysdyn.dsl.tree import syntax


class Bundles:
    """The bundles that a file declares, in any order; one that cannot be read counts as broken."""

    def __init__(self, file: syntax.File, scope: Scope, report: Report) -> None:
        self._items = [i for i in file.items if isinstance(i, syntax.BundleDefinition)]
        self._by_name = {i.name.name: i for i in reversed(self._items)}
        self._read: dict[syntax.BundleDefinition, BundleSymbol | None] = {}
        self._open: list[syntax.BundleDefinition] = []
        self._source, self._scope, self._report = file.source, scope, report

    def declare(self, enter: Callable[[Symbol, Scope], None]) -> None:
        """Bring each bundle into scope; E106, E202, E801."""
        for item in self._items:
            symbol = self._symbol(item)
            if symbol is None:
                self._scope.broken.add(item.name.name)
            else:
                enter(symbol, self._scope)

    def _symbol(self, item: syntax.BundleDefinition) -> BundleSymbol | None:
        if item not in self._read:
            self._open.append(item)
            members = list(self._members(item))
            self._open.pop()
            place = Place(self._source, item.name.span)
            found = tuple((w.name, kind) for w, kind in members if kind is not None)
            self._read[item] = BundleSymbol(item.name.name, found, place) if len(found) == len(members) else None
        return self._read[item]

    def _members(
        self, item: syntax.BundleDefinition
    ) -> Iterator[tuple[syntax.Word, DomainSymbol | BundleSymbol | None]]:
        """Words of a bundle's members with their kinds: a domain, another bundle, None where that could not be read."""
        before: dict[str, syntax.Word] = {}
        for member in item.members:
            # a member that could not be read leaves the bundle incomplete: the caller learns it by a None
            if isinstance(member, syntax.BrokenStatement):
                yield item.name, None
                continue
            kind = self._kind(member.domain)
            for word in member.names:
                first = before.setdefault(word.name, word)
                # `a: electrical, a: rotation`: reported once; the first one counts
                if first is not word:
                    related = (Related("first declared here", Place(self._source, first.span)),)
                    message = f"'{word.name}' is declared twice"
                    self._report.error("E106", message, Place(self._source, word.span), related=related)
                yield word, kind if first is word else None

    def _kind(self, word: syntax.Word) -> DomainSymbol | BundleSymbol | None:
        """What a member is; None after a report."""
        inner, place = self._by_name.get(word.name), Place(self._source, word.span)
        if inner in self._open:
            chain = [i.name.name for i in self._open[self._open.index(inner) :]]
            message = f"bundle '{word.name}' contains itself: {' -> '.join([*chain, word.name])}"
            self._report.error("E801", message, place, help="a bundle lists nodes: x, y: translation")
            return None
        kind = self._scope.find(word.name) if inner is None else self._symbol(inner)
        if isinstance(kind, (DomainSymbol, BundleSymbol)):
            return kind
        if inner is None and not self._scope.is_broken(word.name):
            known = [n for n in self._scope.names() if isinstance(self._scope.find(n), (DomainSymbol, BundleSymbol))]
            near = nearest(word.name, known)
            help_ = f"'{near}'" if near else f"one of {', '.join(known)}"
            self._report.error("E202", f"'{word.name}' is not a domain", place, help=help_)
        return None


def fits(wanted: BundleSymbol, found: BundleNode) -> bool:
    """Whether a bundle of nodes has the members that a port of several asks for, and no others."""
    kinds = dict(wanted.members)
    if kinds.keys() != found.members.keys():
        return False
    for name, member in found.members.items():
        kind = kinds[name]
        if isinstance(member, BundleNode) or isinstance(kind, BundleSymbol):
            if not (isinstance(member, BundleNode) and isinstance(kind, BundleSymbol) and fits(kind, member)):
                return False
        elif kind.name != (member.domain if isinstance(member, NodeSymbol) else member.end.domain).name:
            return False
    return True


def nodes(bundle: BundleNode) -> Iterator[tuple[str, NodeSymbol]]:
    """The nodes of a bundle, each with its path within it: `.x`, `.a.x`."""
    for name, member in bundle.members.items():
        if isinstance(member, NodeSymbol):
            yield f".{name}", member
        elif isinstance(member, BundleNode):
            yield from ((f".{name}{path}", node) for path, node in nodes(member))


def ground_bundle(name: str, wanted: BundleSymbol, place: Place) -> BundleNode:
    """A port of several nodes, each of them bound to its domain's ground."""
    members: dict[str, NodeSymbol | PortSymbol | BundleNode] = {}
    for member, kind in wanted.members:
        if isinstance(kind, BundleSymbol):
            members[member] = ground_bundle(member, kind, place)
        else:
            members[member] = PortSymbol(member, End(None, (), kind), place)
    return BundleNode(name, members, place)


def bound(
    name: str, found: BundleNode, change: dict[Node, Node], end: Callable[[NodeSymbol], End], place: Place
) -> BundleNode:
    """A port of several nodes bound to a bundle; end: of a node of it, change: of the instance's indices."""
    members: dict[str, NodeSymbol | PortSymbol | BundleNode] = {}
    for member, inner in found.members.items():
        if isinstance(inner, BundleNode):
            members[member] = bound(member, inner, change, end, place)
        elif isinstance(inner, PortSymbol):
            at = tuple(ex.substitute(a, change) for a in inner.end.at)
            members[member] = PortSymbol(member, End(inner.end.node, at, inner.end.domain), place)
        else:
            members[member] = PortSymbol(member, end(inner), place)
    return BundleNode(name, members, place)
