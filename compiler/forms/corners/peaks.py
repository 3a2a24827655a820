"""Laws that are nothing but within a narrow range of what they read: peaks that a step would pass over.

    exp(c - q), 2^(c - q), q >= 0           within q < FADES (a Gaussian)
    cosh(b)^-n, tanh(b)^2                   within b^2 < FLAT
    cos(b)^n, n large                       within n sin(b)^2 < 2 FADES
    (1 + q)^-n                              within q < FEW^(1/n)
    tables: narrow cells                    between the ends of these

Where nothing acts a step is as long as it may be; its ends, its stages and the next finer run know nothing of a peak
between them: a latent heat of 1 K on the way from 280 K to 430 K was left out, told as met.  The function
u = sqrt(1 + FADES) - sqrt(1 + q) is as smooth as the motion however narrow the peak (roots of the degree of q, that it
is about as far as unknowns are), so its zeros are found as those of switching functions are (kinks.py); no branch
changes there, but the steps behind one are parts of its passage.
Received: a descriptor form; returned: its `Surface`s.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from itertools import pairwise
from itertools import product as product_of

from sysdyn.compiler.forms.corners.kinks import JUDGED, Surface
from sysdyn.compiler.forms.corners.turning import rising, turning, turns_in_conditions
from sysdyn.compiler.forms.descriptor import DescriptorForm, LoopKernel
from sysdyn.dsl.model.expression import (
    Node,
    call,
    const,
    linear,
    neg,
    power,
    product,
    scale,
    sub,
    substitute,
    topological,
    topological_unbound,
    variables,
)
from sysdyn.dsl.model.network import Loop, Network, Table
from sysdyn.dsl.model.values import Values, as_constants
from sysdyn.dsl.text.diagnostics import Diagnostic

FADES = 36.0
"""exp(-36) is round-off of exp(0)."""
FLAT = 144.0
"""cosh(12)^-2 is 2e-10 of cosh(0)^-2."""
FEW = 1e6
"""A millionth of what it is at its top: beyond that steps follow its feet."""
MOST = 2000
"""Surfaces: of 1000 hills of an array, watched, a run takes 45 s at 1e-6, of which a tenth looks at them."""
STEEP = 64.0
"""A power of a sine that is a peak."""
TOOTH = 0.05
"""Of the widest cell of a table, or of all of it where this part of its range lies in one cell: narrower ones may hold
what steps would pass over.
"""
AT_ONCE = 1e300
"""What turns or jumps at a zero is passed there: steps behind it may be as long as they will."""
CELLS = 8
"""Narrow cells side by side, at most, that one passage in parts sees."""


def peaks(
    form: DescriptorForm, whole: DescriptorForm, network: Network, known: tuple[Surface, ...]
) -> tuple[tuple[Surface, ...], tuple[Diagnostic, ...]]:
    """The surfaces at which peaks begin and end, of each element of arrays, in rows and in what events watch, and at
    which the latter turn; none, and a note, where they are more than MOST.  whole: the form with its tables of
    straight pieces, which events may watch.
    """
    tables, ends, first = {t.name: t for t in network.tables}, {s.u for s in known}, dict[Node, Surface]()
    values = Values({p.name: p for p in network.parameters}, network.elements)
    blocks = (block for name in JUDGED if (block := form.block(name)) is not None)
    # rows that are integrated, and what events watch
    laws = ((kernel, False) for block in blocks for kernel in block.kernels)
    for kernel, watched in (*laws, *((kernel, True) for kernel in _watching(whole, network))):
        if not any(True for s in kernel.rows for part in _bodies(s.expression) for _ in _hidden(part, tables, watched)):
            continue
        # each element of arrays by itself
        for at, summand in product_of(values.iterations(kernel.nest), kernel.rows):
            root = substitute(summand.expression, as_constants(at))
            for part in _terms(root, values):
                for u, passage in _hidden(part, tables, watched):
                    if _watchable(u) and not {u, neg(u)} & (ends | first.keys()):
                        first[u] = Surface(u, jumps=False, row=summand.row, passage=passage)
            if len(first) > MOST:
                text = f"peaks of laws and moments of conditions are more than {MOST}: steps may pass over them"
                return (), (Diagnostic("N608", text, network.place, "solver auto(longest = ...) in the scene"),)
    return tuple(first.values()), ()


def _hidden(root: Node, tables: Mapping[str, Table], watched: bool) -> Iterator[tuple[Node, float]]:
    """Functions at whose zeros a step ends, and how far each goes while that is passed which begins there."""
    depths = [found for node in topological_unbound([root]) for found in _depths(node, tables)]
    for q, end in (*depths, *(rising(root) if watched else ())):
        degree = 1.0 / _degree(q)
        wide = (1.0 + end) ** degree
        yield sub(const(wide), power(linear(1.0, ((1.0, q),)), const(degree))), 2.0 * wide
    for u in turning(root) if watched else turns_in_conditions(root):
        yield u, AT_ONCE


def _watching(form: DescriptorForm, network: Network) -> Iterator[LoopKernel]:
    """Rows whose signs events watch: one that is a peak is nothing but within it, too."""
    conditions = [e.condition for e in network.events if e.condition is not None]
    names = {v.data[0] for condition in conditions for v in variables(condition)}
    block = form.block("observe") if names else None
    for kernel in block.kernels if block is not None else ():
        rows = tuple(s for s in kernel.rows if form.rows[s.row].owner in names)
        if rows:
            yield LoopKernel(kernel.nest, rows)


def _bodies(root: Node) -> Iterator[Node]:
    """An expression, and what its sums over indices add."""
    yield root
    yield from (node.args[2] for node in topological([root]) if node.op == "reduce")


def _terms(root: Node, values: Values) -> Iterator[Node]:
    """An expression, and each term of its sums over indices."""
    yield root
    for node in topological_unbound([root]):
        if node.op == "reduce":
            for at in values.iterations((Loop(node.data[1], *node.args[:2]),)):
                yield from _terms(substitute(node.args[2], as_constants(at)), values)


def _watchable(q: Node) -> bool:
    """Whether it is a function of unknowns, outside all loops, that can be looked at where a run is."""
    if any(n.op in ("index", "reduce") for n in topological([q])):
        return False
    read = [v for v in variables(q) if v.op == "var"]
    return bool(read) and not any(v.data[1] == "audit" or v.data[2] for v in read)


def _depths(node: Node, tables: Mapping[str, Table]) -> Iterator[tuple[Node, float]]:
    """Functions q >= 0 and the values beyond which an operation is flat."""
    # exp(-q)
    if node.op == "call" and node.data == "exp":
        q = _below(node.args[0])
        if q is not None:
            yield q, FADES
    # 0.5^q
    elif node.op == "pow" and node.args[0].op == "const" and node.args[0].data > 0.0:
        q = _below(scale(math.log(node.args[0].data), node.args[1]))
        if q is not None:
            yield q, FADES
    # tanh^2, 1/cosh, powers of sin and cos, 1/(1 + q)^n
    elif node.op == "mul":
        for exponent, factor in zip(node.data, node.args, strict=True):
            named = factor.data if factor.op == "call" else ""
            if (named, exponent) == ("tanh", 2.0) or (named == "cosh" and exponent < 0.0):
                yield power(factor.args[0], const(2.0)), FLAT
            elif named in ("sin", "cos") and exponent >= STEEP:
                yield linear(exponent / 2.0, ((-exponent / 2.0, power(factor, const(2.0))),)), FADES
            elif factor.op == "sum" and exponent < 0.0 and factor.data[0] > 0.0 and _even(factor):
                yield linear(-1.0, ((1.0 / factor.data[0], factor),)), FEW ** (-1.0 / exponent)
    # a tooth of a table: up and down again
    elif node.op == "table" and len(node.args) == 1 and node.data[0] in tables:
        for low, high in _teeth(tables[node.data[0]]):
            s = linear(-(high + low) / (high - low), ((2.0 / (high - low), node.args[0]),))
            yield scale(FADES, power(s, const(2.0))), FADES


def _below(a: Node) -> Node | None:
    """The function q >= 0 of a = c - q, where c is a number or of parameters; None of other sums."""
    terms = zip(a.data[1], a.args, strict=True) if a.op == "sum" else ((1.0, a),)
    depth: list[tuple[float, Node]] = []
    for c, n in terms:
        if not _moves(n):
            continue
        # -5 sin(w) = 5 - 5 (1 + sin(w)): q takes |c| times the amplitude too; -w^2 is below 0 by itself
        amplitude = _amplitude(n)
        if amplitude is None and not (c < 0.0 and _even(n)):
            return None
        depth.append((-c, n))
        if amplitude is not None:
            depth.append((abs(c), amplitude))
    return linear(0.0, depth) if depth else None


def _degree(q: Node) -> float:
    """How steeply it grows far out, at least 2: its root is about as far as unknowns are."""
    terms = q.args if q.op == "sum" else (q,)
    factors = [(e, n) for term in terms if term.op == "mul" for e, n in zip(term.data, term.args, strict=True)]
    return max([2.0, *(float(e) for e, n in factors if _moves(n))])


def _moves(node: Node) -> bool:
    return any(v.op == "var" for v in variables(node))


def _amplitude(node: Node) -> Node | None:
    """What a sine or cosine, times parameters, is no larger than; None of another term."""
    factors = list(zip(node.data, node.args, strict=True)) if node.op == "mul" else [(1.0, node)]
    moving = [(e, n) for e, n in factors if _moves(n)]
    if len(moving) != 1 or moving[0][0] != 1.0 or moving[0][1].op != "call" or moving[0][1].data not in ("sin", "cos"):
        return None
    return call("abs", product(1.0, [(e, n) for e, n in factors if not _moves(n)]))


def _even(node: Node) -> bool:
    """Whether an expression is of one sign, whatever unknowns are (parameters may turn it)."""
    if not _moves(node):
        return True
    if node.op == "mul":
        return all(e % 2.0 == 0.0 or _even(n) for e, n in zip(node.data, node.args, strict=True))
    if node.op == "sum":
        return node.data[0] >= 0.0 and all(c > 0.0 and _even(n) for c, n in zip(node.data[1], node.args, strict=True))
    return node.op == "call" and node.data == "abs"


def _teeth(table: Table) -> Iterator[tuple[float, float]]:
    """Ends of narrow cells side by side."""
    if len(table.points) > 1:
        return
    points, values = table.points[0], table.values
    cells, changes = ([b - a for a, b in pairwise(each)] for each in (points, values))
    least, wide = TOOTH * (max(values) - min(values)), (TOOTH * max(cells), TOOTH * sum(cells))
    narrow = [cell < wide[abs(change) > least] for cell, change in zip(cells, changes, strict=True)]
    k = 0
    while k < len(cells):
        last = k
        while last < len(cells) and narrow[last]:
            last += 1
        if 0 < last - k <= CELLS:
            yield points[k], points[last]
        k = last + 1
