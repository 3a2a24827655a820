"""Nonlinear laws w = law(v) solved for v, where that is proven and holds in doubles (language, section 6, V2 and V3).

Shells are taken off from outside: sums and products with constants, sinh, asinh, atanh, ln, roots of v, linear tables;
each is strictly monotone and takes every real value.  What then holds v more than once, an algebraic core such as
v/sqrt(1 - v^2/c^2) or c v + k v |v|, is solved by sympy once the sign of its slope is proven by interval arithmetic
over its domain, an interval.

A law that is bounded (tanh, a diode's f(e)) has no inverse here: an iterate leaves its range, and where it flattens,
doubles no longer hold v (1 + f/I0 is exactly 0 from e = -37 VT on).  Nor has one whose slope vanishes (e = k f |f| at
f = 0), for the inverse is infinitely steep there, nor a cubic: Cardano's form subtracts near numbers.  The result is
tried over 19 decades of v and of w, with the parameters of the text and with others of the same signs.

Received: a law that holds one variable and parameters.  Returned: the inverse, and what it rests on.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import field, replace
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray
from sysdyn.compiler.model.interpret import Value, evaluate
from sysdyn.compiler.model.tables import evaluate as evaluate_table
from sysdyn.compiler.network.primal.slopes import Slopes
from sysdyn.dsl.model.calculus import derivative
from sysdyn.dsl.model.expression import (
    Node,
    add,
    call,
    const,
    div,
    is_const,
    linear,
    mul,
    neg,
    param,
    product,
    scale,
    substitute,
    table,
    topological,
    var,
    variables,
)
from sysdyn.dsl.model.network import Branch, Table
from sysdyn.dsl.model.signs import ALL, NEGATIVE, NOT_NEGATIVE, POSITIVE, Reals, reals
from sysdyn.values import dataclass

_SHELLS = {
    "sinh": lambda w: call("asinh", w),
    "asinh": lambda w: call("sinh", w),
    "ln": lambda w: call("exp", w),
    "log10": lambda w: call("exp", scale(math.log(10.0), w)),
    "atanh": lambda w: call("tanh", w),
}
"""Functions that take every real value, strictly monotone on an interval, with their inverses."""

_DECADES = np.concatenate([sign * 10.0 ** np.arange(-9.0, 10.0) for sign in (-1.0, 1.0)])
_CARRIED = 1e-9  # relative error of v after law and inverse: the finest accuracy that is verified
_ROUND = 1e-12  # relative change of v or w that counts as rounding
_SMALL = 1e-6  # of values of size one: what lies nearer to zero is rounding's
_SETS = 3  # sets of parameters besides that of the text


@dataclass(frozen=True, slots=True)
class Inverse:
    """v = expression(w); tables that it reads; rests: expressions of parameters and their sign (0: not zero).

    symbolic: by more than an exchange of columns.
    """

    expression: Node
    tables: tuple[Table, ...]
    rests: tuple[tuple[Node, int], ...]
    symbolic: bool


@dataclass(slots=True)
class _Found:
    """What an inverse rests on, in blanks: divisors, blanks whose sign the proof of monotony uses; tables exchanged."""

    divisors: list[Node] = field(default_factory=list)
    signed: set[Node] = field(default_factory=set)
    tables: dict[str, Table] = field(default_factory=dict)
    symbolic: bool = False


def inverse(branch: Branch, law: Node, v: Node, w: Node, slopes: Slopes, tables: Sequence[Table]) -> Inverse | None:
    """The inverse of w = law(v); None where it is in doubt."""
    x, y = var("#own", "s"), var("#value", "s")  # without indices, which would be parts of the law
    law = substitute(law, {v: x})
    # what does not depend on v becomes blanks, with their signs as the numbers have them
    filled = _blanks(law, x)
    values = {blank: slopes.values(branch, node) for blank, node in filled.items()}
    known = {blank: a for blank, a in values.items() if a is not None and a.size and np.isfinite(a).all()}
    if len(known) != len(filled):
        return None
    plain = substitute(law, {node: blank for blank, node in filled.items()})
    found = _Found()
    signs = {blank: _sign(a) for blank, a in known.items()}
    held = {t.name: t for t in tables}
    solved = _solve_for(plain, x, y, signs, held, found)
    # proven by samples
    if solved is None or not _holds(plain, solved, x, y, known, {**held, **found.tables}):
        return None
    # what is divided by must not be zero
    for node in (substitute(d, filled) for d in found.divisors):
        divided = slopes.values(branch, node)
        if divided is None or not np.isfinite(divided).all() or not divided.all():
            return None
    rests = [(substitute(d, filled), 0) for d in found.divisors]
    rests += [(filled[blank], signs[blank]) for blank in sorted(found.signed, key=lambda n: n.number)]
    return Inverse(
        substitute(substitute(solved, filled), {y: w}), tuple(found.tables.values()), tuple(rests), found.symbolic
    )


def _blanks(law: Node, v: Node) -> dict[Node, Node]:
    """One blank for each largest part without v that is no number."""
    found: dict[Node, Node] = {}
    stack = [law]
    while stack:
        node = stack.pop()
        if v in variables(node):
            stack.extend(reversed(node.args))
        elif node.op != "const" and node not in found.values():
            found[param(f"#blank {len(found)}")] = node
    return found


def _sign(values: NDArray[np.float64]) -> int:
    """The sign that all values have; 0 where they differ or one is zero."""
    return 1 if (values > 0.0).all() else -1 if (values < 0.0).all() else 0


def _solve_for(
    law: Node, v: Node, w: Node, signs: Mapping[Node, int], tables: Mapping[str, Table], found: _Found
) -> Node | None:
    """The inverse, shell by shell; the core by sympy."""
    while law is not v:
        at = [k for k, a in enumerate(law.args) if v in variables(a)]
        root = _root(law, v, w, found)
        if root is not None:
            return root
        # v stands in several arguments
        if len(at) != 1:
            return _core(law, v, w, signs, found)
        inner = law.args[at[0]]
        # a v + b = w
        if law.op == "sum":
            rest = [(-c, a) for k, (c, a) in enumerate(zip(law.data[1], law.args, strict=True)) if k != at[0]]
            w = scale(1.0 / law.data[1][at[0]], linear(-law.data[0], ((1.0, w), *rest)))
        # a v = w
        elif law.op == "mul" and law.data[at[0]] == 1.0:
            factor = product(1.0, ((e, a) for e, a in zip(law.data, law.args, strict=True) if a is not inner))
            found.divisors.append(factor)
            w = div(w, factor)
        # exp(v) = w and its like
        elif law.op == "call" and law.data in _SHELLS:
            found.symbolic = True
            w = _SHELLS[law.data](w)
        # a table read backwards
        elif law.op == "table" and law.data[1] == 0 and (turned := _exchange_columns(tables[law.data[0]])) is not None:
            found.tables[turned.name] = turned
            w = table(turned.name, w)
        else:
            return None
        law = inner
    return w


def _root(law: Node, v: Node, w: Node, found: _Found) -> Node | None:
    """The inverse of  r v^a |v|^b sign(v)^c  odd and of a degree a + b up to 1: its slope is nowhere zero."""
    degree, parity, rest = 0.0, 0.0, []
    factors = [(1.0, law)]
    # degree and parity of all factors that hold v
    while factors:
        e, a = factors.pop()
        if a is v:
            degree, parity = degree + e, parity + e
        elif v not in variables(a):
            rest.append((e, a))
        elif a.op == "call" and a.data in ("abs", "sign") and a.args[0] is v:
            degree, parity = (degree + e, parity) if a.data == "abs" else (degree, parity + e)
        elif a.op == "mul":
            factors += [(e * inner, b) for inner, b in zip(a.data, a.args, strict=True)]
        elif a.op == "sum" and a.data[0] == 0.0 and len(a.args) == 1:
            rest.append((e, const(a.data[1][0])))
            factors.append((e, a.args[0]))
        else:
            return None
    # even, or of a slope that vanishes at zero
    if parity % 2 != 1 or not 0.0 < degree < 1.0:
        return None
    factor = product(1.0, rest)
    found.divisors.append(factor)
    found.symbolic = True
    w = div(w, factor)
    return mul(w, product(1.0, ((1.0 / degree - 1.0, call("abs", w)),)))


def _exchange_columns(given: Table) -> Table | None:
    """The table with its columns exchanged; None where it is not linear and strictly monotone, or not extended."""
    if given.method != "linear" or len(given.points) != 1 or given.outside != "extend":
        return None
    values, points = given.values, given.points[0]
    if values[0] > values[-1]:
        values, points = values[::-1], points[::-1]
    if any(a >= b for a, b in pairwise(values)):
        return None
    return replace(given, name=f"{given.name} inverse", points=(tuple(values),), values=tuple(points))


# -- cores -------------------------------------------------------------------------------------------------


def _core(law: Node, v: Node, w: Node, signs: Mapping[Node, int], found: _Found) -> Node | None:
    """The inverse of an algebraic law that holds v more than once."""
    size, y = call("abs", v), param("#core")
    inside = topological([law])
    used = {n: s for n, s in signs.items() if n in inside}
    if 0 in used.values() or not all(_algebraic(n) or n is size for n in inside) or not _few(inside):
        return None
    # an odd law is solved for v > 0 and continued
    odd = is_const(add(law, substitute(substitute(law, {size: y}), {v: neg(v), y: size})), 0.0)
    if size in inside and not odd:
        return None
    known: dict[Node, Reals] = {n: POSITIVE if s > 0 else NEGATIVE for n, s in used.items()}
    known[v] = NOT_NEGATIVE if odd else ALL
    branch = substitute(law, {size: v})  # an odd law is solved for v > 0
    # defined without gaps
    if not _on_an_interval(branch, v, known):
        return None
    from sysdyn.compiler.network.primal.symbolic import SignedAlgebra

    slope, algebra = derivative(branch, v), SignedAlgebra(v, y, used, positive=odd)
    # monotone: its slope has one sign, perhaps after simplification
    if reals(slope, known).sign == 0:
        simple = algebra.simplify(slope)
        if simple is None or reals(simple, known).sign == 0:
            return None
    found.signed.update(used)
    found.symbolic = True
    rising = math.copysign(1.0, _slope_of(branch, v, used)) if odd else 1.0
    # roots of the equation, the first that holds by samples
    for candidate in algebra.roots(scale(rising, branch), over_value=odd):
        if odd:  # v = w h(|w|): its slope at 0 is that of the law
            inner = y if substitute(candidate, {y: neg(y)}) is candidate else call("abs", y)
            candidate = mul(scale(rising, y), substitute(candidate, {y: inner}))
        if _holds(law, candidate, v, y, {n: np.array([float(s)]) for n, s in used.items()}, {}):
            return substitute(candidate, {y: w})
    return None


def _slope_of(law: Node, v: Node, signs: Mapping[Node, int]) -> float:
    """A value of the sign that the slope of a monotone odd law has, parameters of size one."""
    small = {v: const(0.5), **{n: const(float(s)) for n, s in signs.items()}}
    return float(evaluate([substitute(law, small)], _none)[0])


def _none(node: Node, args: list[Value]) -> Value:
    raise AssertionError(node)


def _algebraic(node: Node) -> bool:
    """Sums, and products of powers that are multiples of a half."""
    if node.op == "const":
        return math.isfinite(node.data)
    return node.op in ("sum", "param", "var") or (node.op == "mul" and all(2 * e == int(2 * e) for e in node.data))


def _few(inside: Sequence[Node]) -> bool:
    """Small enough for sympy's algebra to come back at once."""
    return len(inside) <= 40 and all(abs(e) <= 4 for n in inside if n.op == "mul" for e in n.data)


def _on_an_interval(law: Node, v: Node, known: Mapping[Node, Reals]) -> bool:
    """Whether the law is defined on one interval: under its roots stands what is positive, or concave."""
    for node in topological([law]):
        if node.op != "mul":
            continue
        for e, a in zip(node.data, node.args, strict=True):
            if v not in variables(a) or (e > 0 and e == int(e)) or reals(a, known).sign > 0:
                continue
            bent = reals(derivative(derivative(a, v), v), known)
            if e == int(e) or bent.high > 0.0:
                return False
    return True


# -- trial -------------------------------------------------------------------------------------------------


def _holds(
    law: Node, solved: Node, v: Node, w: Node, known: Mapping[Node, NDArray[np.float64]], tables: Mapping[str, Table]
) -> bool:
    """Whether law and inverse undo each other over all decades of v and of w, whatever the parameters."""
    slope = derivative(solved, w)
    for values in _parameters(known):

        def evaluate_on(root: Node, name: Node, x: NDArray[np.float64], values: Mapping[Node, float] = values) -> Value:
            def lookup(node: Node, args: list[Value]) -> Value:
                if node.op == "table":
                    return evaluate_table(tables[node.data[0]], args, (node.data[1],))
                return x if node is name else values[node]

            return np.broadcast_to(np.asarray(evaluate([root], lookup)[0], dtype=float), x.shape)

        if not _forth(law, solved, v, w, evaluate_on) or not _back(law, solved, v, w, evaluate_on):
            return False
        steep = evaluate_on(slope, w, np.append(_DECADES, 0.0))
        if np.isnan(steep).any() or np.isinf(steep[-1]):
            return False
    return True


def _parameters(known: Mapping[Node, NDArray[np.float64]]) -> Iterator[dict[Node, float]]:
    """Values of the first, middle and last element of the text, and others of the same signs."""
    longest = max((x.size for x in known.values()), default=1)
    for k in sorted({0, longest // 2, longest - 1}):
        yield {n: float(x[min(k, x.size - 1)]) for n, x in known.items()}
    random = np.random.default_rng(1)
    for _ in range(_SETS):
        yield {n: float(np.sign(x[0]) * random.uniform(0.5, 2.0)) for n, x in known.items()}


def _forth(law: Node, solved: Node, v: Node, w: Node, at: Any) -> bool:
    """Inverse after law, wherever the law is defined."""
    values = at(law, v, _DECADES)
    defined = np.isfinite(values)
    error = np.abs(at(solved, w, values[defined]) - _DECADES[defined])
    small = np.abs(_DECADES[defined]) <= _SMALL  # next to zero an error may be absolute: 1 + f/I0 holds f to 1e-16 I0
    allowed = np.minimum(10.0 * error[small].max(initial=0.0), _CARRIED)
    within = error <= _CARRIED * np.abs(_DECADES[defined]) + allowed
    return bool(defined.any() and within.all())


def _back(law: Node, solved: Node, v: Node, w: Node, at: Any) -> bool:
    """Law after inverse, for all w: it lies between the law's values beside v, or v at an edge of the domain."""
    values = at(solved, w, _DECADES)
    if np.isnan(values).any():
        return False
    with np.errstate(invalid="ignore"):
        change = _ROUND * np.abs(values) + np.finfo(float).tiny
        ends = at(law, v, values - change), at(law, v, values + change)
    edge = ~(np.isfinite(ends[0]) & np.isfinite(ends[1]))
    low, high = np.fmin(*ends), np.fmax(*ends)
    zero = at(law, v, np.zeros(1))[0]
    margin = _ROUND * (np.abs(_DECADES) + (abs(zero) if np.isfinite(zero) else 0.0)) + _ROUND
    return bool((edge | ((low - margin <= _DECADES) & (high + margin >= _DECADES))).all())
