"""N401: stores that a loop or a cut ties to each other and to sources: the order drops, the index rises; legal.

Common-effort nodes: loops of potential stores and effort sources, cuts of kinetic stores and flow sources.  Common-flow
nodes are the reflection: loops of kinetic stores and flow sources, cuts of potential stores and effort sources.
Branches of a `for` are left out: their loops and cuts follow an index.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from sysdyn.dsl.model.expression import Node
from sysdyn.dsl.model.network import Branch, Network, Terminal
from sysdyn.dsl.text.diagnostics import Report

_LOOPS = {"effort": ("potential", "effort"), "flow": ("kinetic", "flow")}
_CUTS = {"effort": ("kinetic", "flow"), "flow": ("potential", "effort")}
_Point = tuple[str, tuple[Node, ...]] | None
"""A node's element; the ground."""


def dependent_stores(network: Network, report: Report) -> None:
    """A note for every loop and every cut of a network's single branches."""
    domains = {b.domain.name: b.domain for b in network.branches}
    for name, domain in domains.items():
        branches = [b for b in network.branches if b.domain.name == name and b.plus is not None and b.minus is not None]
        kinds = _LOOPS[domain.common]
        for loop in _loops([b for b in branches if b.kind in kinds and not b.loops]):
            _note(loop, "loop", kinds, report)
        kinds = _CUTS[domain.common]
        if not any(b.loops for b in branches):
            for cut in _cuts(branches, kinds):
                _note(cut, "cutset", kinds, report)


def _note(branches: Sequence[Branch], what: str, kinds: tuple[str, str], report: Report) -> None:
    stores = [b for b in branches if b.kind == kinds[0]]
    if stores and len(branches) > 1:
        names = ", ".join(b.name.partition("#")[0] for b in branches)
        message = f"{what} of {kinds[0]} stores and {kinds[1]} sources: {names}: the order drops by 1, the index rises"
        report.note("N401", message, stores[-1].place)


def _point(terminal: Terminal | None) -> _Point:
    return None if terminal is None or terminal.node is None else (terminal.node, terminal.at)


def _loops(branches: Sequence[Branch]) -> Iterator[list[Branch]]:
    """The fundamental loops of a spanning forest of these branches."""
    above: dict[_Point, list[tuple[_Point, Branch]]] = {}
    for b in branches:
        one, other = _point(b.plus), _point(b.minus)
        path = _path(above, one, other)
        if path is None:
            above.setdefault(one, []).append((other, b))
            above.setdefault(other, []).append((one, b))
        else:
            yield [*path, b]


def _path(tree: dict[_Point, list[tuple[_Point, Branch]]], start: _Point, end: _Point) -> list[Branch] | None:
    """The branches between two points of a forest."""
    ways: dict[_Point, list[Branch]] = {start: []}
    ahead = [start]
    while ahead:
        here = ahead.pop()
        if here == end:
            return ways[here]
        for there, b in tree.get(here, ()):
            if there not in ways:
                ways[there] = [*ways[here], b]
                ahead.append(there)
    return None


def _cuts(branches: Sequence[Branch], kinds: tuple[str, str]) -> Iterator[list[Branch]]:
    """What joins each part, that the other branches hold together, to the rest; the ground's part is the rest."""
    root: dict[_Point, _Point] = {}

    # union-find over nodes
    def part(point: _Point) -> _Point:
        while (above := root.setdefault(point, point)) != point:
            root[point] = point = root[above]
        return point

    # nodes that anything but these kinds joins are one part
    for b in branches:
        one, other = part(_point(b.plus)), part(_point(b.minus))
        if b.kind not in kinds and one != other:
            root[other if one is None else one] = one if one is None else other
    crossing: dict[_Point, list[Branch]] = {}
    # what crosses from a part to another one; the ground's part is told by the others
    for b in branches:
        ends = {part(_point(b.plus)), part(_point(b.minus))}
        for end in ends if b.kind in kinds and len(ends) > 1 else ():
            crossing.setdefault(end, []).append(b)
    crossing.pop(part(None), None)
    yield from crossing.values()
