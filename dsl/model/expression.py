"""Expressions as hash-consed nodes: what every stage after the parser computes with.

A node is an operation, its data and its arguments.  Within one `fresh()` block equal expressions are one object, so
identity is equality and common subexpressions share themselves.  Sums and products are n-ary and canonical:

    sum    data = (constant, coefficients)   value = constant + sum(c_i * a_i)
    mul    data = exponents                  value = prod(a_i ^ e_i), exponents are constants

Other operations: const (data value), param (name; args indices), time, index (name of a loop variable),
var ((family, kind, order); args indices; kind q f p s e kappa mu audit, of networks be bf bq bp (branches), ne nf nq np
(nodes); order 1 is the time derivative),
pow (base, exponent), call (function), cond (test, then, other), cmp (operator), and, or, not,
table ((name, order); order counts derivatives), reduce ((operator, index); args first, last, body).

No pass recurses: nodes are visited in the order of `topological`, so depth costs no stack.
"""

from __future__ import annotations

import itertools
import math
import threading
from collections.abc import Container, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from functools import lru_cache
from typing import Any

from sysdyn.dsl.model import budget
from sysdyn.dsl.model.functions import FUNCTIONS, is_whole, real_power


class _Interned(threading.local):
    """The nodes of the block that a thread is in, by what they are: threads share none."""

    def __init__(self) -> None:
        self.nodes: dict[tuple[Any, ...], Node] = {}


_interned = _Interned()
_numbers = itertools.count()  # never given twice: nodes of two `fresh` blocks may meet in one expression


class Node:
    """One operation on its arguments; compare with `is`."""

    __slots__ = ("args", "data", "number", "op", "variables")

    op: str
    data: Any
    args: tuple[Node, ...]
    number: int
    variables: frozenset[Node] | None

    def __init__(self, op: str, data: Any, args: tuple[Node, ...]) -> None:
        self.op = op
        self.data = data
        self.args = args
        self.number = next(_numbers)
        self.variables = None

    def __repr__(self) -> str:
        from sysdyn.dsl.model.expression_text import to_text  # which reads nodes

        return to_text(self)


@contextmanager
def fresh(nodes: dict[Any, Node] | None = None) -> Iterator[None]:
    """Forget all nodes made before: one block a model, so that results do not depend on what came earlier.

    nodes: those of a block to which one returns.
    """
    before, _interned.nodes = _interned.nodes, {} if nodes is None else nodes
    try:
        yield
    finally:
        _interned.nodes = before


def _make(op: str, data: Any, args: tuple[Node, ...], key: Any = None) -> Node:
    full = (op, data, args) if key is None else (op, key)
    nodes = _interned.nodes
    node = nodes.get(full)
    if node is None:
        budget.unfold(budget.NODE, "its expressions")
        nodes[full] = node = Node(op, data, args)
    return node


# -- leaves ------------------------------------------------------------------------------------------------


def const(value: float) -> Node:
    """A number; -0.0 is 0.0."""
    value = float(value) + 0.0
    return _make("const", value, (), key=value if not math.isnan(value) else "nan")


def param(name: str, *indices: Node) -> Node:
    """A parameter (SI), or an element of a parameter array."""
    return _make("param", name, indices)


def time() -> Node:
    """The independent variable t (s)."""
    return _make("time", None, ())


def index(name: str) -> Node:
    """The loop variable of that name."""
    return _make("index", name, ())


def var(family: str, kind: str, *indices: Node, order: int = 0) -> Node:
    """An unknown: kind q f p s e kappa mu audit; order 1 for its time derivative."""
    return _make("var", (family, kind, order), indices)


# -- arithmetic --------------------------------------------------------------------------------------------


def is_const(node: Node, value: float | None = None) -> bool:
    """Whether the node is a number (that number)."""
    return node.op == "const" and (value is None or node.data == value)


def _terms(node: Node) -> tuple[float, Sequence[tuple[float, Node]]]:
    if node.op == "const":
        return node.data, ()
    if node.op == "sum":
        return node.data[0], tuple(zip(node.data[1], node.args, strict=True))
    return 0.0, ((1.0, node),)


def linear(constant: float, terms: Iterable[tuple[float, Node]]) -> Node:
    """Constant + sum of coefficient*node, canonical."""
    total = constant
    found: dict[Node, float] = {}
    # alike terms are added, inner sums opened: 2 (x + 1) + x is one node whatever its order
    for coefficient, node in terms:
        # a term that is no sum
        if node.op not in {"sum", "const"}:  # most terms
            found[node] = found.get(node, 0.0) + coefficient
            continue
        inner, parts = _terms(node)
        # c*(a + b) stays: opened it would double with each differentiation
        if node.op == "sum" and coefficient not in (1.0, -1.0) and len(parts) > 1:
            found[node] = found.get(node, 0.0) + coefficient
            continue
        total += coefficient * inner
        for c, part in parts:
            found[part] = found.get(part, 0.0) + coefficient * c
    kept = [(c, n) for n, c in found.items() if c != 0.0]
    if not kept:
        return const(total)
    # 1*x is x
    if total == 0.0 and len(kept) == 1 and kept[0][0] == 1.0:
        return kept[0][1]
    # the key does not depend on the order in which terms were written
    ordered = tuple(sorted([(n.number, c) for c, n in kept]))
    data = (total + 0.0, tuple([c for c, _ in kept]))
    return _make("sum", data, tuple([n for _, n in kept]), key=(total + 0.0, ordered))


def add(*nodes: Node) -> Node:
    """The sum."""
    return linear(0.0, ((1.0, n) for n in nodes))


def sub(left: Node, right: Node) -> Node:
    """Left - right."""
    return linear(0.0, ((1.0, left), (-1.0, right)))


def neg(node: Node) -> Node:
    """-node."""
    return linear(0.0, ((-1.0, node),))


def scale(factor: float, node: Node) -> Node:
    """factor*node."""
    return linear(0.0, ((factor, node),))


def _factors(node: Node) -> tuple[float, Sequence[tuple[float, Node]]]:
    if node.op == "const":
        return node.data, ()
    if node.op == "sum" and node.data[0] == 0.0 and len(node.args) == 1:
        coefficient, inner = node.data[1][0], node.args[0]
        return coefficient, _factors(inner)[1]
    if node.op == "mul":
        return 1.0, tuple(zip(node.data, node.args, strict=True))
    return 1.0, ((1.0, node),)


_TAKEN_APART = frozenset(("const", "sum", "mul"))
"""Operations that are no factors of a product as they stand."""


WIDE = 24
"""Factors of a product that stays one factor of another: derivatives of n nested calls would take n^2 otherwise."""


def product(constant: float, factors: Iterable[tuple[float, Node]]) -> Node:
    """Constant * prod(node^exponent), canonical."""
    total = constant
    found: dict[Node, float] = {}
    # exponents of alike factors are added, inner products opened
    for exponent, node in factors:
        if node.op not in _TAKEN_APART:  # most factors
            found[node] = found.get(node, 0.0) + exponent
            continue
        inner, parts = _factors(node)
        if exponent == 1.0 and len(parts) > WIDE:
            found[node] = found.get(node, 0.0) + exponent  # the derivative of a chain of calls: shared, not copied
            continue
        # (x^2)^(1/2) is |x| and (x y)^(1/2) may be real where x^(1/2) is not: roots are taken of the whole
        if not is_whole(exponent) and parts and (inner != 1.0 or len(parts) > 1 or parts[0][0] != 1.0):
            found[node] = found.get(node, 0.0) + exponent
            continue
        total *= real_power(inner, exponent)
        for e, part in parts:
            found[part] = found.get(part, 0.0) + exponent * e
    if total == 0.0:
        return const(0.0)
    kept = [(e, n) for n, e in found.items() if e != 0.0]
    if any(not math.isfinite(e) for e, _ in kept):  # exponents that multiply to more than a number: powers of their own
        kept = [(e, n) if math.isfinite(e) else (1.0, _make("pow", None, (n, const(e)))) for e, n in kept]
    # all exponents cancel: x/x is 1
    if not kept:
        return const(total)
    # x^1 is x
    if len(kept) == 1 and kept[0][0] == 1.0:
        node = kept[0][1]
    else:
        ordered = tuple(sorted([(n.number, e) for e, n in kept]))
        node = _make("mul", tuple([e for e, _ in kept]), tuple([n for _, n in kept]), key=ordered)
    return node if total == 1.0 else linear(0.0, ((total, node),))


def mul(*nodes: Node) -> Node:
    """The product."""
    return product(1.0, ((1.0, n) for n in nodes))


def div(left: Node, right: Node) -> Node:
    """left/right."""
    return product(1.0, ((1.0, left), (-1.0, right)))


def power(base: Node, exponent: Node) -> Node:
    """base^exponent."""
    if exponent.op == "const":
        return product(1.0, ((exponent.data, base),))
    if is_const(base, 1.0):
        return base
    return _make("pow", None, (base, exponent))


def sqrt(node: Node) -> Node:
    """The square root."""
    return product(1.0, ((0.5, node),))


# -- functions and conditions ------------------------------------------------------------------------------


def call(name: str, *args: Node) -> Node:
    """A function of the language; clip, frac, smoothstep, log and sqrt become simpler nodes."""
    # a power of 1/2, which rules of powers simplify
    if name == "sqrt":
        return sqrt(args[0])
    if name == "clip":
        return call("min", call("max", args[0], args[1]), args[2])
    if name == "frac":
        return sub(args[0], call("floor", args[0]))
    if name == "smoothstep":
        x = call("min", call("max", args[0], const(0.0)), const(1.0))
        return mul(x, x, linear(3.0, ((-2.0, x),)))
    # of two arguments each, so that a derivative is a condition
    if name in ("min", "max") and len(args) != 2:
        return call(name, call(name, *args[:-1]), args[-1]) if len(args) > 2 else args[0]
    if name == "signal":
        return signal(args[0])
    # constants are evaluated at once
    if all(a.op == "const" for a in args):
        return const(FUNCTIONS[name](*(a.data for a in args)))
    return _make("call", name, args)


def signal(node: Node) -> Node:
    """A signal's value: differentiated in full, but held by virtual displacements (language, decision 25)."""
    return _make("call", "signal", (node,)) if variables(node) else node


def compare(operator: str, left: Node, right: Node) -> Node:
    """A relation: == != < <= > >=."""
    return _make("cmp", operator, (left, right))


def both(*nodes: Node) -> Node:
    """Conjunction."""
    return nodes[0] if len(nodes) == 1 else _make("and", None, nodes)


def either(*nodes: Node) -> Node:
    """Disjunction."""
    return nodes[0] if len(nodes) == 1 else _make("or", None, nodes)


def negate(node: Node) -> Node:
    """Negation of a condition."""
    return _make("not", None, (node,))


def conditional(test: Node, then: Node, other: Node) -> Node:
    """If test then a else b."""
    return then if then is other else _make("cond", None, (test, then, other))


def table(name: str, *args: Node, order: int | tuple[int, ...] = 0) -> Node:
    """An interpolation table; order counts derivatives (by each argument, where there are several)."""
    return _make("table", (name, order), args)


def reduction(operator: str, name: str, first: Node, last: Node, body: Node) -> Node:
    """Sum, prod, min or max of body over the loop variable `name` from first to last."""
    return _make("reduce", (operator, name), (first, last, body))


def combine_terms(operator: str, parts: Sequence[Node]) -> Node:
    """A reduction written out: sum, prod, min or max of its parts."""
    return add(*parts) if operator == "sum" else mul(*parts) if operator == "prod" else call(operator, *parts)


# -- passes ------------------------------------------------------------------------------------------------


def topological(roots: Iterable[Node]) -> list[Node]:
    """All nodes below the roots, arguments before users, in a deterministic order."""
    return _post_order(roots, bodies=True)


def nodes_of(root: Node) -> Sequence[Node]:
    """All nodes of an expression, arguments before users; most are no deeper than one operation."""
    return topological([root]) if any(a.args for a in root.args) else (*root.args, root)


def calls(root: Node, function: str) -> list[Node]:
    """Where an expression calls a function, arguments before users."""
    return [n for n in nodes_of(root) if n.op == "call" and n.data == function]


def reads(root: Node, parameters: Container[str]) -> bool:
    """Whether an expression reads one of these parameters."""
    return any(n.op == "param" and n.data in parameters for n in topological([root]))


def topological_unbound(roots: Iterable[Node]) -> list[Node]:
    """Like `topological`, but does not enter the bodies of reductions (their loop variable is not bound there)."""
    return _post_order(roots, bodies=False)


@lru_cache(maxsize=128)
def order_of(roots: tuple[Node, ...]) -> tuple[Node, ...]:
    """Post-order of some roots, kept for a while: of what is evaluated again and again (samples of a law, bisections of
    an instant).
    """
    return tuple(_post_order(roots, bodies=False))


def _post_order(roots: Iterable[Node], *, bodies: bool) -> list[Node]:
    """All nodes below some roots, each once, arguments first; bodies: those of reductions too."""
    seen: set[Node] = set()
    order: list[Node] = []
    for root in roots:
        # a leaf
        if not root.args:
            if root not in seen:
                seen.add(root)
                order.append(root)
            continue
        stack: list[Node | None] = [root]
        if root.op != "reduce" and not any(a.args for a in root.args):  # most are no deeper, and need no stack
            order += [node for node in dict.fromkeys((*root.args, root)) if node not in seen]
            seen.update((*root.args, root))
            continue
        # a node, then None as a mark that its arguments lie above, then these
        while stack:
            node = stack.pop()
            if node is None:  # all below what lies under it is done
                order.append(stack.pop())  # type: ignore[arg-type]
            elif node not in seen:
                seen.add(node)
                args = node.args if bodies or node.op != "reduce" else node.args[:2]
                if args:
                    stack += (node, None)
                    stack += args[::-1]
                else:
                    order.append(node)
    return order


def rebuild(node: Node, args: tuple[Node, ...]) -> Node:
    """An operation on other arguments, simplified again."""
    # nothing changed: the node itself, so that identity tells equality
    if args == node.args:
        return node
    match node.op:
        case "sum":
            return linear(node.data[0], zip(node.data[1], args, strict=True))
        case "mul":
            return product(1.0, zip(node.data, args, strict=True))
        case "pow":
            return power(*args)
        case "call":
            return call(node.data, *args)
        case "cond":
            return conditional(*args)
        # leaves and operations without rules of their own
        case _:
            return _make(node.op, node.data, args)


def substitute(root: Node, change: Mapping[Node, Node]) -> Node:
    """Replace nodes (unknowns, parameters, loop variables) wherever they stand."""
    done: dict[Node, Node] = {}
    for node in topological([root]):
        done[node] = change[node] if node in change else rebuild(node, tuple(done[a] for a in node.args))
    return done[root]


def variables(root: Node) -> frozenset[Node]:
    """The unknowns (var nodes) that occur; time counts as one."""
    if root.variables is not None:
        return root.variables
    if not any(a.args for a in root.args):
        root.variables = frozenset(n for n in (*root.args, root) if n.op in ("var", "time"))
        return root.variables
    for node in topological([root]):
        if node.variables is None:
            own = frozenset((node,)) if node.op in ("var", "time") else frozenset()
            node.variables = own.union(*(a.variables or () for a in node.args))
    return root.variables or frozenset()


def ordered_variables(root: Node) -> list[Node]:
    """Variables below a root in the order they were made: for whoever makes nodes of them, so that a text is the same
    each time.
    """
    return sorted(variables(root), key=lambda n: n.number)
