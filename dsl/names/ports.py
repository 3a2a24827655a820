"""Ports: `M.shaft.e`, `X.p[2].f`, `energy_through(M.shaft)`: what a component takes in there.

Received: a path to a port and its quantity; handed on: an expression of what is inside, made by `effort_into`
(elaborate/instances/port_efforts.py).
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from typing import NamedTuple

from sysdyn.dsl.model import dimensions as dim
from sysdyn.dsl.model import expression as ex
from sysdyn.dsl.model.expression import Node
from sysdyn.dsl.model.units import Dimension, multiply
from sysdyn.dsl.names.context import Value
from sysdyn.dsl.names.quantities import QuantityResolver
from sysdyn.dsl.names.symbols import (
    BundleNode,
    End,
    InstanceSymbol,
    NodeSymbol,
    PortSymbol,
    Space,
    Symbol,
    Typed,
)
from sysdyn.dsl.tree import syntax

_INSIDE = "of one element of it, or of its elements inside: sum(i in 1..n: S[i].R.energy)"


class _Port(NamedTuple):
    """`instance.port`: its name, its end and the loop variables of its array, and what is taken in there."""

    name: str
    end: End
    change: dict[Node, Node]
    taken: Callable[..., Node]


class PortResolver(QuantityResolver):
    """What goes through the ports of instances."""

    def taken_in(self, end: End, e: syntax.Member) -> Value:
        """The effort that a common-flow node exerts on a component at a port, the flow into it from another node."""
        if not self.said:
            message = f"'{self._excerpt(e.base)}' has no member '{e.name}' here: what goes through a port is a result"
            raise self.fail("E102", message, e.span, help="traces and claims of a scene read it, LABEL.PORT." + e.name)
        domain, taken = end.domain, self._port(e.base).taken
        return Typed(taken(rates=True), (domain.effort if domain.common == "flow" else domain.flow).dimension)

    def port_power(self, e: syntax.Expr) -> tuple[str, Callable[[], Node], Dimension]:
        """Name and power of `instance.port`: what is inside absorbs through it."""
        name, end, change, taken = self._port(e)
        at = [ex.substitute(a, change) for a in (*end.at, *change.values())]
        if any(n.op == "index" for n in ex.topological(at)):
            message = "what has gone through the ports of an array of components is not told under a loop yet"
            raise self.fail("N608", message, e.span, help=_INSIDE)
        own = "e" if end.domain.common == "effort" else "f"
        other = ex.substitute(self.node_quantity(end, syntax.Member(e, own, e.span)).node, change)
        power = multiply(end.domain.effort.dimension, end.domain.flow.dimension)
        return f"{name}.energy", lambda: ex.mul(taken(rates=False), other), power

    def of_ports(self, e: syntax.Expr) -> bool:
        """Whether `label.name[i]` is of a port that is an array, which goes by the nodes that it is bound to."""
        inner = e.base if isinstance(e, syntax.Item) else e
        owner = self.locate(inner.base) if isinstance(inner, syntax.Member) else None
        if owner is None or not isinstance(owner.symbol, InstanceSymbol) or not isinstance(inner, syntax.Member):
            return False
        space, _ = self.space_of(owner.symbol, owner, inner.span)
        return _array_of(space, inner.name) is not None

    def _port(self, e: syntax.Expr) -> _Port:
        """`instance.port`, `instance.port[i]`."""
        inner, indices = (e.base, e.indices) if isinstance(e, syntax.Item) else (e, ())
        names, owner, base = list[str](), inner, None
        # the instance, and the names behind it: port, or bundle and member
        while isinstance(owner, syntax.Member) and not (base and isinstance(base.symbol, InstanceSymbol)):
            names, owner = [owner.name, *names], owner.base
            base = self.locate(owner)
        if base is None or not isinstance(base.symbol, InstanceSymbol):
            raise self.fail("E102", f"'{self._excerpt(e)}' is no port of a component", e.span, help="LABEL.PORT")
        space, change = self.space_of(base.symbol, base, owner.span)
        name, port = ".".join(names), space.scope.symbols.get(names[0])
        for member in names[1:]:
            port = port.members.get(member) if isinstance(port, BundleNode) else None
        # several nodes at once
        if isinstance(port, BundleNode):
            each = ", ".join(f"{self._excerpt(e)}.{m}" for m in port.members)
            raise self.fail("E102", f"'{self._excerpt(e)}' is a bundle of ports", e.span, help=f"one of {each}")
        # an array of ports by its index, or a single one
        array, end = _array_of(space, name), None
        if array is not None:
            own = (*array.family.prefix, *self.indices(name, array.family.shape, indices, e.span))
            end = End(array, own, array.domain)
        elif isinstance(port, PortSymbol) and inner is e:
            end = port.end
        if end is None:
            raise self.fail("E407", f"'{self._excerpt(owner)}' has no port '{name}'", e.span)
        # two ports at one node: how the flow divides is not known
        others = [p.name for p in _ports(space.scope.symbols.values()) if p is not port and _meet(p.end, end)]
        arrays = ((n, _array_of(space, n)) for n in space.scope.symbols if n != name)
        others += [n for n, a in arrays if a and end.node and a.family.name == end.node.family.name]
        if others:
            message = f"'{name}' and '{others[0]}' are at one node: what goes through each is not told yet"
            raise self.fail("N608", message, e.span, help="a node for each")
        place, at = self.place(e.span), ", ".join(str(a) for a in (*change.values(), *(end.at if array else ())))

        def effort_inside(*, rates: bool) -> Node:
            return ex.substitute(self.taken(space, end, place, rates=rates), change)

        return _Port(f"{space.path}.{name}[{at}]" if at else f"{space.path}.{name}", end, change, effort_inside)

    def through(self, port: syntax.Expr) -> Typed:
        """The energy that has gone into a component through one of its ports."""
        name, node, power = self.port_power(port)
        return Typed(self.quadrature(name, node, (), power, (), port), multiply(power, dim.TIME))


def _ports(symbols: Iterable[Symbol]) -> Iterator[PortSymbol]:
    """The ports among symbols, those of bundles too."""
    for symbol in symbols:
        if isinstance(symbol, PortSymbol):
            yield symbol
        elif isinstance(symbol, BundleNode):
            yield from _ports(symbol.members.values())


def _array_of(space: Space, name: str) -> NodeSymbol | None:
    """The nodes to which a port that is an array is bound: they are not of the instance."""
    symbol = space.scope.symbols.get(name)
    outside = isinstance(symbol, NodeSymbol) and not symbol.family.name.startswith(f"{space.path}.")
    return symbol if outside and isinstance(symbol, NodeSymbol) else None


def _meet(a: End, b: End) -> bool:
    """Whether two ends are one node, or may be."""
    if a.node is None or b.node is None or a.node.family.name != b.node.family.name:
        return False
    apart = (ex.sub(x, y) for x, y in zip(a.at, b.at, strict=True))
    return not any(d.op == "const" and d.data for d in apart)
