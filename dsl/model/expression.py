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
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from typing import Any

from sysdyn.dsl.model import budget


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
        budget.charge(budget.NODE, "its expressions")
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
    for coefficient, node in terms:
        if node.op not in {"sum", "const"}:  # most terms
            found[node] = found.get(node, 0.0) + coefficient
            continue
        inner, parts = _terms(node)
        if node.op == "sum" and coefficient not in (1.0, -1.0) and len(parts) > 1:
            found[node] = found.get(node, 0.0) + coefficient
            continue
        total += coefficient * inner
        for c, part in parts:
            found[part] = found.get(part, 0.0) + coefficient * c
    kept = [(c, n) for n, c in found.items() if c != 0.0]
    if not kept:
        return const(total)
    if total == 0.0 and len(kept) == 1 and kept[0][0] == 1.0:
        return kept[0][1]
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


def _whole(value: float) -> bool:
    return value == int(value) if abs(value) < 2**53 else True


WIDE = 24
"""Factors of a product that stays one factor of another: derivatives of n nested calls would take n^2 otherwise."""


def product(constant: float, factors: Iterable[tuple[float, Node]]) -> Node:
    """Constant * prod(node^exponent), canonical."""
    total = constant
    found: dict[Node, float] = {}
    for exponent, node in factors:
        if node.op not in _TAKEN_APART:  # most factors
            found[node] = found.get(node, 0.0) + exponent
            continue
        inner, parts = _factors(node)
        if exponent == 1.0 and len(parts) > WIDE:
            found[node] = found.get(node, 0.0) + exponent  # the derivative of a chain of calls: shared, not copied
            continue
        # (x^2)^(1/2) is |x| and (x y)^(1/2) may be real where x^(1/2) is not: roots are taken of the whole
        if not _whole(exponent) and parts and (inner != 1.0 or len(parts) > 1 or parts[0][0] != 1.0):
            found[node] = found.get(node, 0.0) + exponent
            continue
        total *= _power(inner, exponent)
        for e, part in parts:
            found[part] = found.get(part, 0.0) + exponent * e
    if total == 0.0:
        return const(0.0)
    kept = [(e, n) for n, e in found.items() if e != 0.0]
    if not kept:
        return const(total)
    if len(kept) == 1 and kept[0][0] == 1.0:
        node = kept[0][1]
    else:
        ordered = tuple(sorted([(n.number, e) for e, n in kept]))
        node = _make("mul", tuple([e for e, _ in kept]), tuple([n for _, n in kept]), key=ordered)
    return node if total == 1.0 else linear(0.0, ((total, node),))


def _power(base: float, exponent: float) -> float:
    try:
        value = base**exponent
    except (OverflowError, ZeroDivisionError):
        return math.inf
    return value if isinstance(value, float) else math.nan


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


def _safe(function: Callable[..., float]) -> Callable[..., float]:
    def call(*values: float) -> float:
        try:
            return float(function(*values))
        except OverflowError:
            return math.inf
        except (ValueError, ZeroDivisionError):
            return math.nan

    return call


def _sign(x: float) -> float:
    return math.copysign(1.0, x) if x else 0.0


def _mod(a: float, b: float) -> float:
    return a - b * math.floor(a / b)


# every function of the language with scalar arguments, by its name: the meaning all emitters must meet
FUNCTIONS: Mapping[str, Callable[..., float]] = {
    **{
        n: _safe(getattr(math, n))
        for n in (
            [
                "sin",
                "cos",
                "tan",
                "asin",
                "acos",
                "atan",
                "atan2",
                "sinh",
                "cosh",
                "tanh",
                "asinh",
                "acosh",
                "atanh",
                "exp",
                "log10",
                "sqrt",
                "hypot",
                "floor",
                "ceil",
            ]
        )
    },
    "ln": _safe(math.log),
    "abs": abs,
    "sign": _sign,
    "setsign": _sign,
    "min": min,
    "max": max,
    "mod": _safe(_mod),
    "step": lambda x: 1.0 if x >= 0.0 else 0.0,
}


def call(name: str, *args: Node) -> Node:
    """A function of the language; clip, frac, smoothstep, log and sqrt become simpler nodes."""
    if name == "sqrt":
        return sqrt(args[0])
    if name == "clip":
        return call("min", call("max", args[0], args[1]), args[2])
    if name == "frac":
        return sub(args[0], call("floor", args[0]))
    if name == "smoothstep":
        x = call("min", call("max", args[0], const(0.0)), const(1.0))
        return mul(x, x, linear(3.0, ((-2.0, x),)))
    if name in ("min", "max") and len(args) > 2:
        return call(name, call(name, *args[:-1]), args[-1])
    if name == "signal":
        return signal(args[0])
    if all(a.op == "const" for a in args):
        return const(FUNCTIONS[name](*(a.data for a in args)))
    return _make("call", name, args)


def signal(node: Node) -> Node:
    """A signal's value: differentiated in full, but held by virtual displacements (language, decision 25)."""
    return _make("call", "signal", (node,)) if variables(node) else node


def signals_held(root: Node) -> tuple[Node, dict[Node, Node]]:
    """Root with an opaque parameter for each signal, and what puts the signals back."""
    found = [n for n in topological([root]) if n.op == "call" and n.data == "signal"]
    change = {node: param(f"#signal {k}") for k, node in enumerate(found)}
    return (substitute(root, change), {new: old for old, new in change.items()}) if found else (root, {})


def without_signals(root: Node) -> Node:
    """Root with signals as plain values."""
    done: dict[Node, Node] = {}
    if not any(n.op == "call" and n.data == "signal" for n in topological([root])):
        return root
    for node in topological([root]):
        marked = node.op == "call" and node.data == "signal"
        done[node] = done[node.args[0]] if marked else rebuild(node, tuple(done[a] for a in node.args))
    return done[root]


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


def table(name: str, *args: Node, order: int = 0) -> Node:
    """An interpolation table; order counts derivatives (one argument)."""
    return _make("table", (name, order), args)


def reduction(operator: str, name: str, first: Node, last: Node, body: Node) -> Node:
    """Sum, prod, min or max of body over the loop variable `name` from first to last."""
    return _make("reduce", (operator, name), (first, last, body))


# -- passes ------------------------------------------------------------------------------------------------


def topological(roots: Iterable[Node]) -> list[Node]:
    """All nodes below the roots, arguments before users, in a deterministic order."""
    return _ordered(roots, bodies=True)


def topological_unbound(roots: Iterable[Node]) -> list[Node]:
    """Like `topological`, but does not enter the bodies of reductions (their loop variable is not bound there)."""
    return _ordered(roots, bodies=False)


def _ordered(roots: Iterable[Node], *, bodies: bool) -> list[Node]:
    seen: set[Node] = set()
    order: list[Node] = []
    for root in roots:
        stack: list[Node | None] = [root]
        if root.op != "reduce" and not any(a.args for a in root.args):  # most are no deeper, and need no stack
            order += [node for node in dict.fromkeys((*root.args, root)) if node not in seen]
            seen.update((*root.args, root))
            continue
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
    """The same operation on other arguments, simplified again."""
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
    """The same in the order they were made: for whoever makes nodes of them, so that a text is the same each time."""
    return sorted(variables(root), key=lambda n: n.number)


_ONE_ARGUMENT: Mapping[str, Callable[[Node], Node]] = {
    "signal": lambda x: const(1.0),
    "sin": lambda x: call("cos", x),
    "cos": lambda x: neg(call("sin", x)),
    "tan": lambda x: linear(1.0, ((1.0, product(1.0, ((2.0, call("tan", x)),))),)),
    "asin": lambda x: product(1.0, ((-0.5, sub(const(1.0), mul(x, x))),)),
    "acos": lambda x: product(-1.0, ((-0.5, sub(const(1.0), mul(x, x))),)),
    "atan": lambda x: product(1.0, ((-1.0, add(const(1.0), mul(x, x))),)),
    "sinh": lambda x: call("cosh", x),
    "cosh": lambda x: call("sinh", x),
    "tanh": lambda x: sub(const(1.0), product(1.0, ((2.0, call("tanh", x)),))),
    "asinh": lambda x: product(1.0, ((-0.5, add(const(1.0), mul(x, x))),)),
    "acosh": lambda x: product(1.0, ((-0.5, sub(mul(x, x), const(1.0))),)),
    "atanh": lambda x: product(1.0, ((-1.0, sub(const(1.0), mul(x, x))),)),
    "exp": lambda x: call("exp", x),
    "ln": lambda x: product(1.0, ((-1.0, x),)),
    "log10": lambda x: product(1.0 / math.log(10.0), ((-1.0, x),)),
    "abs": lambda x: call("sign", x),
    "sign": lambda x: const(0.0),
    "setsign": lambda x: const(0.0),
    "floor": lambda x: const(0.0),
    "ceil": lambda x: const(0.0),
    "step": lambda x: const(0.0),
}


def _call_partials(node: Node) -> tuple[Node, ...]:
    """Partial derivatives of a call by each argument."""
    name, args = node.data, node.args
    if name in _ONE_ARGUMENT:
        return (_ONE_ARGUMENT[name](args[0]),)
    a, b = args
    match name:
        case "atan2":
            square = add(mul(a, a), mul(b, b))
            return div(b, square), neg(div(a, square))
        case "hypot":
            return div(a, node), div(b, node)
        case "mod":
            return const(1.0), neg(call("floor", div(a, b)))
        case "min" | "max":
            first = compare("<=" if name == "min" else ">=", a, b)
            return conditional(first, const(1.0), const(0.0)), conditional(first, const(0.0), const(1.0))
    raise AssertionError(name)


def _chain(node: Node, dots: Sequence[Node]) -> Node:
    """The differential of a node from those of its arguments (some are zero)."""
    zero = const(0.0)
    match node.op:
        case "sum":
            return linear(0.0, zip(node.data[1], dots, strict=True))
        case "mul":
            parts: list[tuple[float, Node]] = []
            for k, dot in enumerate(dots):
                if dot is not zero:
                    factors = [(e - (j == k), a) for j, (e, a) in enumerate(zip(node.data, node.args, strict=True))]
                    parts.append((node.data[k], product(1.0, [*factors, (1.0, dot)])))
            return linear(0.0, parts)
        case "pow":
            base, exponent = node.args
            return add(
                mul(exponent, power(base, linear(-1.0, ((1.0, exponent),))), dots[0]) if dots[0] is not zero else zero,
                mul(node, call("ln", base), dots[1]) if dots[1] is not zero else zero,
            )
        case "call":
            return add(*(mul(p, d) for p, d in zip(_call_partials(node), dots, strict=True) if d is not zero))
        case "cond":
            return conditional(node.args[0], dots[1], dots[2])
        case "table":
            if len(node.args) > 1:
                orders = node.data[1] or (0,) * len(node.args)
                return add(
                    *(
                        mul(_make("table", (node.data[0], _raised(orders, k)), node.args), d)
                        for k, d in enumerate(dots)
                        if d is not zero
                    )
                )
            return mul(table(node.data[0], *node.args, order=node.data[1] + 1), dots[0])
        case "reduce":
            operator, name = node.data
            if operator == "sum":
                return reduction("sum", name, node.args[0], node.args[1], dots[2])
            raise ValueError(f"the derivative of {operator}(... in ...) is not defined")
    raise AssertionError(node.op)


def _raised(orders: tuple[int, ...], k: int) -> tuple[int, ...]:
    return tuple(o + (j == k) for j, o in enumerate(orders))


def differential(root: Node, seeds: Mapping[Node, Node]) -> Node:
    """Directional derivative of root: each key of seeds (a var, param, index or time node) moves at its value."""
    zero = const(0.0)
    wanted = frozenset(seeds)
    dots: dict[Node, Node] = {}
    variables(root)
    for node in topological([root]):
        if node in wanted:
            dots[node] = seeds[node]
        elif not node.args or node.op in ("var", "param", "cmp", "and", "or", "not"):
            dots[node] = zero
        else:
            inner = [dots[a] for a in node.args]
            dots[node] = zero if all(d is zero for d in inner) else _chain(node, inner)
    return dots[root]


def partials(node: Node) -> tuple[Node, ...]:
    """Derivatives of a node by each of its arguments."""
    one, zero = const(1.0), const(0.0)
    return tuple(_chain(node, [one if j == k else zero for j in range(len(node.args))]) for k in range(len(node.args)))


def derivative(root: Node, by: Node) -> Node:
    """Partial derivative of root by one node, all other unknowns held."""
    if by not in variables(root) and by.op in ("var", "time"):
        return const(0.0)
    if root.op == "sum" and by in root.args and not any(a.args for a in root.args):
        return const(root.data[1][root.args.index(by)])
    if root.op == "mul" and by in root.args and not any(a.args for a in root.args):
        return _chain(root, [const(1.0 if a is by else 0.0) for a in root.args])
    return differential(root, {by: const(1.0)})


def gradient(root: Node, by: Sequence[Node]) -> tuple[Node, ...]:
    """Partial derivatives of root by each of the nodes."""
    return tuple(derivative(root, b) for b in by)


def rate(node: Node) -> Node | None:
    """What an unknown's time derivative is called: q' = f, others yd; None where it has none (multipliers)."""
    if node.op == "time":
        return const(1.0)
    family, kind, order = node.data
    if order or kind in ("kappa", "mu", "audit", "ne"):
        return None
    if kind in ("q", "nq", "bq"):  # coordinates, nodes, branches: the rate of a displacement is the flow
        return var(family, kind[:-1] + "f", *node.args)
    return var(family, kind, *node.args, order=1)


def time_derivative(root: Node) -> Node:
    """Total derivative by t; ValueError names an unknown whose derivative is not among the variables."""
    seeds: dict[Node, Node] = {}
    for node in ordered_variables(root):
        dot = rate(node)
        if dot is None:
            raise ValueError(to_text(node))
        seeds[node] = dot
    return differential(root, seeds)


def evaluate(roots: Sequence[Node], lookup: Callable[[Node], float]) -> list[float]:
    """Values of scalar nodes; lookup gives those of param, time, index, var and table nodes."""
    values: dict[Node, Any] = {}
    for node in topological_unbound(roots):
        values[node] = _value(node, values, lookup)
    return [values[r] for r in roots]


def evaluate_along(
    root: Node, leaf: Node, points: Iterable[float], lookup: Callable[[Node], float]
) -> Iterator[float]:
    """Values of a scalar node where one leaf takes the values of points; what does not read it is evaluated once."""
    values: dict[Node, Any] = {}
    moving: list[Node] = []

    def here(node: Node) -> float:
        return float(values[leaf]) if node is leaf else lookup(node)

    for node in topological_unbound([root]):
        if leaf in variables(node):
            moving.append(node)
        else:
            values[node] = _value(node, values, lookup)
    for x in points:
        for node in moving:
            values[node] = x if node is leaf else _value(node, values, here)
        yield values[root]


_COMPARE: Mapping[str, Callable[[float, float], bool]] = {
    "==": lambda a, b: a == b,
    "!=": lambda a, b: a != b,
    "<": lambda a, b: a < b,
    "<=": lambda a, b: a <= b,
    ">": lambda a, b: a > b,
    ">=": lambda a, b: a >= b,
}


def _value(node: Node, values: Mapping[Node, Any], lookup: Callable[[Node], float]) -> Any:
    args = [values[a] for a in node.args if a in values]
    match node.op:
        case "const":
            return node.data
        case "sum":
            return math.fsum((node.data[0], *(c * a for c, a in zip(node.data[1], args, strict=True))))
        case "mul":
            total = 1.0
            for e, a in zip(node.data, args, strict=True):
                total *= _power(a, e)
            return total
        case "pow":
            return _power(args[0], args[1])
        case "call":
            return FUNCTIONS[node.data](*args)
        case "cond":
            return args[1] if args[0] else args[2]
        case "cmp":
            return _COMPARE[node.data](args[0], args[1])
        case "and":
            return all(args)
        case "or":
            return any(args)
        case "not":
            return not args[0]
        case "reduce":
            return _reduce(node, round(args[0]), round(args[1]), lookup)
        case _:
            return lookup(node)


def _reduce(node: Node, first: int, last: int, lookup: Callable[[Node], float]) -> float:
    operator, name = node.data
    me = index(name)

    def at(i: int) -> float:
        return evaluate([node.args[2]], lambda n: float(i) if n is me else lookup(n))[0]

    items = [at(i) for i in range(first, last + 1)]
    match operator:
        case "sum":
            return math.fsum(items)
        case "prod":
            return math.prod(items)
        case "min":
            return min(items, default=math.inf)
        case _:
            return max(items, default=-math.inf)


# -- text --------------------------------------------------------------------------------------------------


def to_text(root: Node) -> str:
    """The expression in the language's own notation, for dumps and messages (f is x', its derivative x'')."""
    text: dict[Node, str] = {}
    for node in topological([root]):
        text[node] = _show(node, [text[a] for a in node.args])
    return text[root]


def number_text(value: float) -> str:
    """The shortest decimal that reads back as the same double."""
    return repr(int(value)) if _whole(value) and abs(value) < 1e15 else repr(value)


def _wrap(node: Node, text: str) -> str:
    simple = node.op in ("param", "time", "index", "var", "call", "table", "reduce")
    return text if simple or (node.op == "const" and node.data >= 0) else f"({text})"


_PRIMES = {("q", 1): "'", ("f", 0): "'", ("f", 1): "''"}


def _show(node: Node, args: list[str]) -> str:
    data: Any = node.data
    match node.op:
        case "const":
            return number_text(node.data)
        case "param" | "index":
            return str(data) + (f"[{', '.join(args)}]" if args else "")
        case "time":
            return "t"
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
        case _:
            return f"{node.data}({', '.join(args)})"


def _orders(orders: int | tuple[int, ...]) -> str:
    return "'" * orders if isinstance(orders, int) else str(orders).replace(" ", "")


def _show_sum(node: Node, args: list[str]) -> str:
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
