"""Laws that are nothing but within a narrow range of what they read: peaks that a step would pass over.

    exp(c - q), q >= 0 (a Gaussian)         within q < FADES
    cosh(b)^-n, tanh(b)^2                   within b^2 < FLAT
    pchip, cubic: cells far narrower than   between the ends of these
    the others

Where nothing acts a step is as long as it may be; its ends, its stages and the next finer run know nothing of a peak
between them: a latent heat of 1 K on the way from 280 K to 430 K was left out, told as met.  The function
u = sqrt(1 + FADES) - sqrt(1 + q) is as smooth as the motion however narrow the peak, so its zeros are found as those
of switching functions are (kinks.py); no branch changes there, but the steps behind one are parts of its passage.
Received: a descriptor form; returned: its `Surface`s.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from itertools import pairwise

from sysdyn.compiler.forms.corners.kinks import MOST, Surface, roots
from sysdyn.compiler.forms.descriptor import DescriptorForm
from sysdyn.dsl.model.expression import Node, const, linear, neg, product, sqrt, sub, topological, variables
from sysdyn.dsl.model.network import Table

FADES = 36.0
"""exp(-36) is round-off of exp(0)."""
FLAT = 144.0
"""cosh(12)^-2 is 2e-10 of cosh(0)^-2."""
TOOTH = 0.05
"""Of the widest cell of a table: narrower ones may hold what steps would pass over."""
CELLS = 8
"""Narrow cells side by side, at most, that one passage in parts sees."""


def peaks(form: DescriptorForm, tables: Mapping[str, Table], known: int) -> tuple[Surface, ...]:
    """The surfaces at which peaks begin and end; none where they and the known ones are more than MOST."""
    first: dict[Node, Surface] = {}
    for root, row in roots(form):
        for node in topological([root]):
            for q, end in _depths(node, tables):
                if not _watchable(q):
                    continue
                wide = math.sqrt(1.0 + end)
                u = sub(const(wide), sqrt(linear(1.0, ((1.0, q),))))
                first.setdefault(u, Surface(u, jumps=False, row=row, passage=2.0 * wide))
    return tuple(first.values()) if len(first) + known <= MOST else ()


def _watchable(q: Node) -> bool:
    """Whether it is a function of unknowns, outside all loops, that can be looked at where a run is."""
    if any(n.op in ("index", "reduce") for n in topological([q])):
        return False
    read = [v for v in variables(q) if v.op == "var"]
    return bool(read) and not any(v.data[1] == "audit" or v.data[2] for v in read)


def _depths(node: Node, tables: Mapping[str, Table]) -> Iterator[tuple[Node, float]]:
    """Functions q >= 0 and the values beyond which an operation is flat."""
    if node.op == "call" and node.data == "exp":
        q = _below(node.args[0])
        if q is not None:
            yield q, FADES
    elif node.op == "mul":
        for exponent, factor in zip(node.data, node.args, strict=True):
            bell = factor.op == "call" and (factor.data, exponent) == ("tanh", 2.0)
            if bell or (factor.op == "call" and factor.data == "cosh" and exponent < 0.0):
                yield product(1.0, ((2.0, factor.args[0]),)), FLAT
    elif node.op == "table" and len(node.args) == 1 and node.data[0] in tables:
        for low, high in _teeth(tables[node.data[0]]):
            s = linear(-(high + low) / (high - low), ((2.0 / (high - low), node.args[0]),))
            yield product(FADES, ((2.0, s),)), FADES


def _below(a: Node) -> Node | None:
    """The function q >= 0 of a = c - q, where c is a number or of parameters; None of other sums."""
    terms = zip(a.data[1], a.args, strict=True) if a.op == "sum" else ((1.0, a),)
    moving = [(c, n) for c, n in terms if any(v.op == "var" for v in variables(n))]
    if not moving or not all(c < 0.0 and _even(n) for c, n in moving):
        return None
    return neg(linear(0.0, moving))


def _even(node: Node) -> bool:
    """Whether an expression is of one sign, whatever unknowns are (parameters may turn it)."""
    if not any(v.op == "var" for v in variables(node)):
        return True
    if node.op == "mul":
        return all(e % 2.0 == 0.0 or _even(n) for e, n in zip(node.data, node.args, strict=True))
    if node.op == "sum":
        return node.data[0] >= 0.0 and all(c > 0.0 and _even(n) for c, n in zip(node.data[1], node.args, strict=True))
    return node.op == "call" and node.data == "abs"


def _teeth(table: Table) -> Iterator[tuple[float, float]]:
    """Ends of narrow cells side by side."""
    if table.method not in ("pchip", "cubic") or len(table.points) > 1:
        return
    points = table.points[0]
    cells = [b - a for a, b in pairwise(points)]
    narrow = [cell < TOOTH * max(cells) for cell in cells]
    k = 0
    while k < len(cells):
        last = k
        while last < len(cells) and narrow[last]:
            last += 1
        if 0 < last - k <= CELLS:
            yield points[k], points[last]
        k = last + 1
