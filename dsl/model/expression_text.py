"""Expressions in the language's own notation, for dumps and messages."""

from __future__ import annotations

from typing import Any

from sysdyn.dsl.model.expression import Node, topological
from sysdyn.dsl.model.functions import is_whole

LONGEST = 10_000
"""Characters of an expression that are written: one whose parts are shared doubles its text with each level (f(f(x)) of
`x + x^2`, forty deep, is a terabyte)."""


def to_text(root: Node) -> str:
    """The expression in the language's own notation, for dumps and messages (f is x', its derivative x''); what is
    longer than LONGEST ends in an ellipsis.
    """
    text: dict[Node, str] = {}
    for node in topological([root]):
        said = _show(node, [text[a] for a in node.args])
        text[node] = said if len(said) <= LONGEST else said[:LONGEST] + "..."
    return text[root]


def number_text(value: float) -> str:
    """The shortest decimal that reads back as the same double."""
    return repr(int(value)) if is_whole(value) and abs(value) < 1e15 else repr(value)


def _wrap(node: Node, text: str) -> str:
    simple = node.op in ("param", "time", "index", "var", "call", "table", "reduce")
    return text if simple or (node.op == "const" and node.data >= 0) else f"({text})"


_PRIMES = {("q", 1): "'", ("f", 0): "'", ("f", 1): "''"}


def _show(node: Node, args: list[str]) -> str:
    """Text of a node from the texts of its arguments, in the syntax of the language."""
    data: Any = node.data
    match node.op:
        case "const":
            return number_text(node.data)
        case "param" | "index":
            return str(data) + (f"[{', '.join(args)}]" if args else "")
        case "time":
            return "t"
        # x, x', x''; of nodes and elements R1.e; multipliers by their label
        case "var":
            family, kind, order = data
            base = str(family) + (f"[{', '.join(args)}]" if args else "")
            primes = "'" * int(order)
            if kind in ("q", "f"):
                return f"{base}{_PRIMES.get((kind, order), '')}"
            if kind[0] in "nb":  # of a node or branch
                return f"{base}.{kind[1]}{primes}"
            suffix = {"p": ".p", "kappa": ".multiplier", "mu": ".multiplier"}.get(kind, "")
            return f"{base}{suffix}{primes}"
        case "sum":
            return _show_sum(node, args)
        case "mul":
            return _show_product(node, args)
        case "pow":
            return f"{_wrap(node.args[0], args[0])}^{_wrap(node.args[1], args[1])}"
        case "cond":
            return f"(if {args[0]} then {args[1]} else {args[2]})"
        case "cmp":
            return f"{args[0]} {node.data} {args[1]}"
        case "and" | "or":
            return f" {node.op} ".join(f"({a})" for a in args)
        case "not":
            return f"not ({args[0]})"
        case "table":
            return f"{node.data[0]}{_orders(node.data[1])}({', '.join(args)})"
        case "reduce":
            return f"{node.data[0]}({node.data[1]} in {args[0]}..{args[1]}: {args[2]})"
        # a function
        case _:
            return f"{node.data}({', '.join(args)})"


def _orders(orders: int | tuple[int, ...]) -> str:
    return "'" * orders if isinstance(orders, int) else str(orders).replace(" ", "")


def _show_sum(node: Node, args: list[str]) -> str:
    """Text of a sum; a sign stands before each term but a first positive one."""
    constant, coefficients = node.data
    parts = []
    for c, a, n in zip(coefficients, args, node.args, strict=True):
        body = f"({a})" if n.op == "sum" else a
        size = abs(c)
        parts.append(("-" if c < 0 else "+", body if size == 1.0 else f"{number_text(size)}*{body}"))
    if constant:
        parts.append(("-" if constant < 0 else "+", number_text(abs(constant))))
    head = ("-" if parts[0][0] == "-" else "") + parts[0][1]
    return head + "".join(f" {s} {p}" for s, p in parts[1:])


def _show_product(node: Node, args: list[str]) -> str:
    above: list[str] = []
    below: list[str] = []
    for e, a, n in zip(node.data, args, node.args, strict=True):
        base = _wrap(n, a)
        size = abs(e)
        text = f"sqrt({a})" if size == 0.5 else base if size == 1.0 else f"{base}^{number_text(size)}"
        (above if e > 0 else below).append(text)
    return "*".join(above or ["1"]) + "".join(f"/{b}" for b in below)
