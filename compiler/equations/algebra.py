"""Expressions as sympy objects and back, node by node; no text is ever parsed.

Numbers are taken as the decimals they were written as, so that factors stay readable; what sympy has no word for
(tables, conditions, sums over ranges) is a symbol.  sympy takes half a second to import, and only here.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

from sysdyn.compiler.equations.order import FactorOrder
from sysdyn.dsl.model.expression import Node, add, call, const, power, product, topological

_NAMES = {
    "sin": "sin", "cos": "cos", "tan": "tan", "asin": "asin", "acos": "acos", "atan": "atan", "sinh": "sinh",
    "cosh": "cosh", "tanh": "tanh", "exp": "exp", "ln": "log", "abs": "Abs", "sign": "sign", "atan2": "atan2",
}  # fmt: skip

PLAIN = 1000
"""Largest denominator of a number that is reckoned with."""


class Algebra:
    """A pair of dictionaries: leaves of ours and symbols of sympy's, which sort as `leaves` (then as they are met):
    signs of factors follow that order.
    """

    def __init__(self, order: FactorOrder, leaves: Iterable[Node] = ()) -> None:
        import sympy

        self.sympy: Any = sympy
        self.order = order
        self.spent = 0  # operations for which shorter forms were looked for
        self._symbols: dict[Node, Any] = {}
        self._nodes: dict[Any, Node] = {}
        for leaf in leaves:
            self.symbol(leaf)

    def symbol(self, node: Node) -> Any:
        """The symbol that stands for a node."""
        if node not in self._symbols:
            found = self.sympy.Symbol(f"x{len(self._symbols):06d}", real=True)
            self._symbols[node], self._nodes[found] = found, node
        return self._symbols[node]

    def number(self, value: float) -> Any:
        """A number as the decimal that it is written as."""
        return self.sympy.Rational(repr(value)) if abs(value) < 1e300 else self.sympy.Float(value)

    def factor(self, value: float) -> Any:
        """A number that stands in a sum or before a product: one of many digits (9.80665) as a symbol of its own, which
        no common denominator is made of.
        """
        exact = self.number(value)
        if not exact.is_Rational or exact.p in (-1, 1) or exact.q <= PLAIN:
            return exact
        size = const(abs(value))
        if size not in self._symbols:
            found = self.sympy.Symbol(f"x{len(self._symbols):06d}", positive=True)
            self._symbols[size], self._nodes[found] = found, size
        return self._symbols[size] if value > 0.0 else -self._symbols[size]

    def object(self, root: Node) -> Any:
        """The sympy object of an expression."""
        sympy = self.sympy
        done: dict[Node, Any] = {}
        for node in topological([root]):
            args = [done[a] for a in node.args if a in done]
            match node.op:
                case "const":
                    done[node] = self.factor(node.data)
                case "sum":
                    terms = (self.factor(c) * a for c, a in zip(node.data[1], args, strict=True))
                    done[node] = sympy.Add(self.factor(node.data[0]), *terms)
                case "mul":
                    done[node] = sympy.Mul(*(a ** self.number(e) for e, a in zip(node.data, args, strict=True)))
                case "pow":
                    done[node] = args[0] ** args[1]
                case "call" if node.data in _NAMES:
                    done[node] = getattr(sympy, _NAMES[node.data])(*args)
                # a signal is its value: signs of virtual work do not matter here
                case "call" if node.data == "signal":
                    done[node] = args[0]
                # leaves, and what sympy does not know, as symbols
                case _:
                    done[node] = self.symbol(node)
        return done[root]

    def node(self, root: Any) -> Node:
        """The expression of a sympy object made of such symbols."""
        done: dict[Any, Node] = {}
        for part in self.sympy.postorder_traversal(root):
            if part not in done:
                done[part] = self._one(part, [done[a] for a in part.args])
        return done[root]

    def _one(self, part: Any, args: list[Node]) -> Node:
        """Node of a sympy object from those of its arguments."""
        sympy = self.sympy
        # a symbol that stands for a node sympy did not look into
        if part in self._nodes:
            return self._nodes[part]
        if part.is_Number or part is sympy.pi:
            return const(float(part))
        if part.is_Add:
            return add(*args)
        if part.is_Mul:
            return product(1.0, ((1.0, a) for a in args))
        # x^2 keeps its number as an exponent, a^b is a call
        if part.is_Pow:
            return product(1.0, ((float(part.exp), args[0]),)) if part.exp.is_Number else power(*args)
        if isinstance(part, sympy.exp):
            return call("exp", *args)
        # sin, cos, ...: the functions that both know
        for ours, theirs in _NAMES.items():
            if isinstance(part, getattr(sympy, theirs)):
                return call(ours, *args)
        raise AssertionError(part)
