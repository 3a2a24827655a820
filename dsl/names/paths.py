"""Paths: `x.f`, `M.La.q`, `X[i].cell.e` are followed from left to right through instances, bundles and ports.

An instance's inside is written with the loop variables of its label; from outside they are replaced by the indices
given.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable

from sysdyn.dsl.model import expression as ex
from sysdyn.dsl.model.expression import Node
from sysdyn.dsl.names.context import Use, Value
from sysdyn.dsl.names.failures import Failed, Part, SeveralError
from sysdyn.dsl.names.names import NameResolver
from sysdyn.dsl.names.symbols import BundleNode, InstanceSymbol, Space, Symbol, Typed, Vector
from sysdyn.dsl.tree import syntax
from sysdyn.values import dataclass


@dataclass(frozen=True, slots=True)
class Located:
    """A symbol at the end of a path.

    indices: own indices as written; change: loop variables of the instances on the way -> the indices given there.
    """

    symbol: Symbol
    indices: tuple[syntax.Index, ...]
    change: dict[Node, Node]


class Paths(NameResolver):
    """What a path leads to, and values of what lies inside instances."""

    def locate(self, e: syntax.Expr) -> Located | None:
        """The symbol that a path leads to; None where it leads to a quantity or is no path."""
        match e:
            case syntax.Name():
                if e.name in self._bound:
                    return None
                symbol = self.scope.find(e.name)
                return None if symbol is None else Located(symbol, (), {})
            case syntax.Item():
                base = self.locate(e.base)
                return None if base is None or base.indices else Located(base.symbol, e.indices, base.change)
            case syntax.Member():
                base = self.locate(e.base)
                return None if base is None else self._inside(base, e)
        return None

    def _inside(self, base: Located, e: syntax.Member) -> Located | None:
        """What `base.name` stands for where base is a bundle or an instance; None where it has no such member."""
        symbol = base.symbol
        if isinstance(symbol, BundleNode):
            member = symbol.members.get(e.name)
            return None if member is None else Located(member, base.indices, base.change)
        if isinstance(symbol, InstanceSymbol):
            space, change = self.space_of(symbol, base, e.base.span)
            inner = space.scope.symbols.get(e.name)
            return None if inner is None else Located(inner, (), change)
        return None

    def space_of(self, symbol: InstanceSymbol, base: Located, span: syntax.Span) -> tuple[Space, dict[Node, Node]]:
        """The space of an instance under the indices given."""
        if not symbol.spaces:
            self.awaken(symbol)
        if not symbol.spaces:
            raise Failed
        count = symbol.spaces[0].own
        if len(base.indices) != count:
            raise self.index_count(symbol.name, count, len(base.indices), span)
        at = tuple(self.index(i) for i in base.indices)
        fitting = [s for s in symbol.spaces if self._holds(s, at) is not False]
        if not fitting:
            raise self.fail("E805", f"'{symbol.name}' has no element [{', '.join(map(str, at))}]", span)
        space = fitting[0] if len(fitting) == 1 else self._one_of(symbol, fitting, at, span)
        self._remember(symbol, space, base, at, count)
        own = space.prefix[len(space.prefix) - count :]
        change = dict(base.change)
        change |= {o: a for o, a in zip(own, at, strict=True) if o.op == "index"}
        return space, change

    def _one_of(self, symbol: InstanceSymbol, spaces: list[Space], at: tuple[Node, ...], span: syntax.Span) -> Space:
        """The statement of a label that an element comes from; SeveralError where a loop runs over several, E805 where
        sizes without a value leave it open.
        """
        # parts of a loop that were chosen around
        for k, a in enumerate(at):
            chosen = self.chosen.get((id(symbol), k, a))
            if chosen is not None:
                self.chosen_read += 1
                spaces = [s for s in spaces if any(s is c for c in chosen)]
        # an index that runs over several statements: R[1..3] and R[4..9] written apart
        for k, a in enumerate(at) if len(spaces) > 1 else ():
            loop = next((n for n in ex.topological([a]) if n.op == "index"), None)
            ranges = tuple(dict.fromkeys(_range(s, k, len(at)) for s in spaces))
            if loop is not None and len(ranges) > 1 and (len(at) == 1 or self._are_disjoint(ranges)):
                offset = ex.sub(a, loop)
                alike = [tuple(s for s in symbol.spaces if _range(s, k, len(at)) == bounds) for bounds in ranges]
                cut = [Part(s, *(ex.sub(b, offset) for b in bounds)) for s, bounds in zip(alike, ranges, strict=True)]
                met = [part for part in cut if self._meets(loop, part, sized=len(at) > 1)]
                raise SeveralError(symbol.name, (id(symbol), k, a), loop.data, tuple(met or cut[:1]))
        # the statement whose range holds the index
        inside = [s for s in spaces if self._holds(s, at)]
        if not inside:
            message = f"which statement of '{symbol.name}' has the element [{', '.join(map(str, at))}] is not known"
            raise self.fail("E805", message, span, help="an index that the bounds of one of them hold")
        return inside[0]

    def _are_disjoint(self, ranges: tuple[tuple[Node, Node], ...]) -> bool:
        """Whether no two ranges share a number, with the sizes given."""
        pairs = itertools.combinations(ranges, 2)
        return not any(self._before(a[1], b[0]) is False and self._before(b[1], a[0]) is False for a, b in pairs)

    def _meets(self, loop: Node, part: Part, *, sized: bool) -> bool:
        """Whether a loop may run over a part, with the sizes given (else with any)."""
        own = next((o for o in self.loops if o.index == loop.data), None)
        if own is None:
            return True
        pairs = (own.last, part.first), (part.last, own.first)
        return not any(self._before(*pair, sized=sized) for pair in pairs)

    def _before(self, a: Node, b: Node, *, sized: bool = True) -> bool | None:
        """Whether a < b; None where the sizes given (or numbers alone) do not say."""
        gap = self.with_sizes(ex.sub(b, a)) if sized else ex.sub(b, a)
        return bool(gap.data > 0) if ex.is_const(gap) else None

    def _holds(self, space: Space, at: tuple[Node, ...]) -> bool | None:
        """Whether fixed indices lie inside a statement's range, with the sizes given; None where these do not say."""
        known = True
        for a, (first, last) in zip(at, space.around[len(space.around) - len(at) :], strict=True):
            if any(n.op == "index" for n in ex.topological([a])):
                continue
            held = self._between(a, first, last)
            if held is False:
                return False
            known &= held is True
        return True if known else None

    def _between(self, index: Node, first: Node, last: Node) -> bool | None:
        """Whether an index lies between bounds, with the sizes given; None where these do not say."""
        gaps = [self.with_sizes(ex.sub(index, first)), self.with_sizes(ex.sub(last, index))]
        if any(ex.is_const(gap) and gap.data < 0 for gap in gaps):
            return False
        return True if all(map(ex.is_const, gaps)) else None

    def _remember(self, symbol: InstanceSymbol, space: Space, base: Located, at: tuple[Node, ...], count: int) -> None:
        shape = space.around[len(space.around) - count :]
        if len(symbol.spaces) == 1:
            for node, bounds, index in zip(at, shape, base.indices, strict=True):
                self.uses.append(Use(bounds, node, self.loops, symbol.name, self.place(index.span)))

    def outside(self, read: Callable[[], Value], change: dict[Node, Node], span: syntax.Span) -> Value:
        """A value from inside instances at the indices given; what it reads of several statements of a label by the
        loop of its own is told by these: by a number, of one of them, by a loop around, in each part of that.
        """
        try:
            return self._substitute(read(), change)
        except SeveralError as several:
            given = change.get(ex.index(several.loop))
            if given is None:
                raise
            loop = next((n for n in ex.topological([given]) if n.op == "index"), None)
            if loop is not None:
                offset = ex.sub(given, loop)
                parts = (Part(p.spaces, ex.sub(p.first, offset), ex.sub(p.last, offset)) for p in several.parts)
                raise SeveralError(several.label, several.key, loop.data, tuple(parts)) from None
            held = [p for p in several.parts if self._between(given, p.first, p.last)]
            if not held:
                raise self.spread(several, span) from None
            with self.choosing(several, held[0]):
                return self.outside(read, change, span)

    def _substitute(self, value: Value, change: dict[Node, Node]) -> Value:
        if not change:
            return value
        if isinstance(value, Vector):
            return Vector(tuple(Typed(ex.substitute(v.node, change), v.dimension) for v in value.items), value.first)
        return Typed(ex.substitute(value.node, change), value.dimension, value.truth)


def _range(space: Space, k: int, count: int) -> tuple[Node, Node]:
    """The bounds of the k-th of `count` indices of a statement."""
    return space.around[len(space.around) - count + k]
