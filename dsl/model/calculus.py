"""Derivatives of expressions: by unknowns, along directions, by time.

Forward over the nodes in topological order, d f(a, b, ...) = f_a da + f_b db + ...; nothing recurses.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from contextvars import ContextVar
from functools import partial

from sysdyn.dsl.model.expression import (
    Node,
    add,
    call,
    calls,
    compare,
    conditional,
    const,
    div,
    linear,
    mul,
    neg,
    ordered_variables,
    param,
    power,
    product,
    rebuild,
    reduction,
    sub,
    substitute,
    table,
    topological,
    var,
    variables,
)
from sysdyn.dsl.model.expression_text import to_text
from sysdyn.dsl.text.diagnostics import Diagnostic, Place

_ONE_ARGUMENT: Mapping[str, Callable[[Node], Node]] = {
    "signal": lambda x: const(1.0),
    "sin": lambda x: call("cos", x),
    "cos": lambda x: neg(call("sin", x)),
    "tan": lambda x: linear(1.0, ((1.0, product(1.0, ((2.0, call("tan", x)),))),)),
    "asin": lambda x: product(1.0, ((-0.5, sub(const(1.0), mul(x, x))),)),
    "acos": lambda x: product(-1.0, ((-0.5, sub(const(1.0), mul(x, x))),)),
    "atan": lambda x: product(1.0, ((-1.0, add(const(1.0), mul(x, x))),)),
    "sinh": lambda x: call("cosh", x),
    "cosh": lambda x: mul(call("cosh", x), call("tanh", x)),  # sinh/cosh^3 is inf/inf far out
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


class NoDerivativeError(ValueError):
    """An operation whose derivative is asked for and cannot be written; place: of the statement, where known."""

    place: Place | None = None

    def diagnostic(self, place: Place) -> Diagnostic:
        """E608, at the statement or at `place`."""
        return Diagnostic("E608", str(self), self.place or place, "its elements written out: w[1]*w[2]*w[3]")


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
    raise AssertionError(name)


def _times(factors: Sequence[tuple[float, Node]]) -> Callable[[Node], Node]:
    """Multiplication by powers of nodes."""
    return lambda node: product(1.0, [*factors, (1.0, node)])


def _power_differential(others: Sequence[tuple[float, Node]], exponent: float, base: Node, dot: Node) -> Node:
    """base^(exponent - 1) dot, and the other factors.

    The differential of 1/(c + w exp(v)) is exp(v)/(c + w exp(v))^2, inf/inf where the value itself is zero: in its
    place stands 1/((c + w exp(v)) (w + c exp(-v))), which is a number wherever that is.
    """
    terms = dict(zip(base.args, base.data[1], strict=True)) if base.op == "sum" and exponent < 0.0 else {}
    found = ((n, f) for n in terms for f in (n.args if n.op == "mul" else (n,)) if f.op == "call" and f.data == "exp")
    for own, steep in found:
        if _divides(steep, own) and _divides(steep, dot):
            rest = linear(base.data[0], [(w, n) for n, w in terms.items() if n is not own])
            scaled = product(terms[own], ((1.0, own), (-1.0, steep)))
            opposite = add(scaled, mul(rest, call("exp", neg(steep.args[0]))))
            return product(1.0, [*others, (exponent, base), (-1.0, opposite), (-1.0, steep), (1.0, dot)])
    return product(1.0, [*others, (exponent - 1.0, base), (1.0, dot)])


def _divides(factor: Node, dot: Node) -> bool:
    """Whether a product has a factor."""
    inner = dot.args[0] if dot.op == "sum" and len(dot.args) == 1 and dot.data[0] == 0.0 else dot
    return inner is factor or (inner.op == "mul" and (1.0, factor) in zip(inner.data, inner.args, strict=True))


def _along(dot: Node, scaled: Callable[[Node], Node]) -> Node:
    """A linear function of a differential; of one that conditions make zero, within these: sqrt(max(x, 0)) is flat
    below 0, and not infinity times zero.
    """
    zero = const(0.0)
    branches, waiting = {dot}, [dot]
    # all branches of nested conditions
    while waiting:
        node = waiting.pop()
        new = [a for a in node.args[1:] if a not in branches] if node.op == "cond" else []
        branches.update(new)
        waiting += new
    # the usual case: no condition makes it zero
    if zero not in branches:
        return scaled(dot)
    done: dict[Node, Node] = {zero: zero}
    waiting = [dot]
    # inside out, each condition once: zero where it was, scaled elsewhere
    while waiting:
        node = waiting[-1]
        inner = node.args[1:] if node.op == "cond" else ()
        first = [a for a in inner if a not in done]
        if not first:
            if node not in done:
                done[node] = conditional(node.args[0], *(done[a] for a in inner)) if inner else scaled(node)
            waiting.pop()
        waiting += first
    return done[dot]


def _sum_differentials(terms: Sequence[tuple[float, Node]]) -> Node:
    """A sum of differentials; of some that one condition makes zero, within it: r - r^2 is flat where max(x, 1) = r
    is, under a root too.
    """
    first = terms[0][1] if len(terms) > 1 else const(0.0)
    if first.op != "cond" or any(d.op != "cond" or d.args[0] is not first.args[0] for _, d in terms):
        return linear(0.0, terms)
    sides = (_sum_differentials([(w, d.args[k]) for w, d in terms]) for k in (1, 2))
    return conditional(first.args[0], *sides)


def _chain(node: Node, dots: Sequence[Node]) -> Node:
    """The differential of a node from those of its arguments (some are zero)."""
    zero = const(0.0)
    match node.op:
        # d(c u + k v) = c du + k dv
        case "sum":
            moving = [(w, d) for w, d in zip(node.data[1], dots, strict=True) if d is not zero]
            if len(moving) == 1:
                return _along(moving[0][1], lambda d: linear(0.0, ((moving[0][0], d),)))
            return _sum_differentials(moving)
        # the product rule, a term for each factor that moves
        case "mul":
            parts: list[tuple[float, Node]] = []
            for k, dot in enumerate(dots):
                if dot is not zero:
                    others = [(e, a) for j, (e, a) in enumerate(zip(node.data, node.args, strict=True)) if j != k]
                    lower = partial(_power_differential, others, node.data[k], node.args[k])
                    parts.append((node.data[k], _along(dot, lower)))
            return _sum_differentials(parts)
        # d(b^e) = e b^(e-1) db + b^e ln(b) de
        case "pow":
            base, exponent = node.args
            slope = mul(exponent, power(base, linear(-1.0, ((1.0, exponent),))))
            return add(
                _along(dots[0], lambda d: mul(slope, d)) if dots[0] is not zero else zero,
                mul(node, call("ln", base), dots[1]) if dots[1] is not zero else zero,
            )
        # of the argument that is taken
        case "call" if node.data in ("min", "max"):
            return conditional(compare("<=" if node.data == "min" else ">=", *node.args), *dots)
        # the chain rule, with the partial derivatives of the function
        case "call":
            moving = [(p, d) for p, d in zip(_call_partials(node), dots, strict=True) if d is not zero]
            return add(*(_along(d, _times([(1.0, p)])) for p, d in moving))
        # the condition itself has no slope
        case "cond":
            return conditional(node.args[0], dots[1], dots[2])
        # a table's derivative is a table of higher order, in one argument or several
        case "table":
            if len(node.args) > 1:
                orders = node.data[1] or (0,) * len(node.args)
                return add(
                    *(
                        mul(table(node.data[0], *node.args, order=_increment_order(orders, k)), d)
                        for k, d in enumerate(dots)
                        if d is not zero
                    )
                )
            return mul(table(node.data[0], *node.args, order=node.data[1] + 1), dots[0])
        # a sum of derivatives; of products and extrema it is not written down
        case "reduce":
            operator, name = node.data
            if operator == "sum":
                return reduction("sum", name, node.args[0], node.args[1], dots[2])
            raise NoDerivativeError(f"the derivative of {operator}(... in ...) is not supported yet")
    raise AssertionError(node.op)


def _increment_order(orders: tuple[int, ...], k: int) -> tuple[int, ...]:
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


_MOVING: ContextVar[frozenset[str]] = ContextVar("moving", default=frozenset())
"""Parameters that a linearisation lets move in time, and their rates."""
_RATE_OF = "rate of "


def rate_name(name: str, order: int = 1) -> str:
    """What the rate of a parameter is called, or its second rate."""
    return _RATE_OF * order + name


@contextmanager
def moving(names: Iterable[str]) -> Iterator[None]:
    """Within, time derivatives of the parameters `names` are parameters `rate of name`, and so on to the second."""
    token = _MOVING.set(frozenset(rate_name(name, order) for name in names for order in (0, 1)))
    try:
        yield
    finally:
        _MOVING.reset(token)


def parameter_rates(root: Node) -> dict[Node, Node]:
    """The parameters of root that move, with their rates."""
    names = _MOVING.get()
    if not names:
        return {}
    found = (n for n in topological([root]) if n.op == "param" and n.data in names)
    return {n: param(rate_name(n.data), *n.args) for n in found}


def time_derivative(root: Node) -> Node:
    """Total derivative by t; ValueError names an unknown whose derivative is not among the variables."""
    seeds = parameter_rates(root)
    for node in ordered_variables(root):
        dot = rate(node)
        if dot is None:
            raise ValueError(to_text(node))
        seeds[node] = dot
    return differential(root, seeds)


def signals_held(root: Node) -> tuple[Node, dict[Node, Node]]:
    """Root with an opaque parameter for each signal, and what puts the signals back."""
    found = calls(root, "signal")
    change = {node: param(f"#signal {k}") for k, node in enumerate(found)}
    return (substitute(root, change), {new: old for old, new in change.items()}) if found else (root, {})


def without_signals(root: Node) -> Node:
    """Root with signals as plain values."""
    done: dict[Node, Node] = {}
    if not calls(root, "signal"):
        return root
    for node in topological([root]):
        marked = node.op == "call" and node.data == "signal"
        done[node] = done[node.args[0]] if marked else rebuild(node, tuple(done[a] for a in node.args))
    return done[root]
