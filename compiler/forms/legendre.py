"""EnergyModel -> EnergyModel: kinetic energy T(p, q) in the place of T*(f, q), block by block (book, chapter 4).

    T* = f^T M f/2 + b^T f + c        M, b, c of displacements, dynamic variables and time
    T  = (p - b)^T M^-1 (p - b)/2 - c                       T + T* = p^T f,  dT/dp = f,  dT/dq = -dT*/dq

A block is a set of flows that the terms of T* join.  It is transformed where its M is regular at the values of the
parameters and at some points, and no family over a range; elsewhere T* stays, and 0 = p - dT*/df with it.  M^-1 is
written by minors up to WRITTEN coordinates.  Above, the residual solves for the flows:

    M = L D L^T,  L y = p - b,  D L^T f = y    dT/dp = f, and dT*/dq at these flows in the place of -dT/dq

each pivot and each y a shared expression, none multiplied out.
"""

from __future__ import annotations

import math
import random
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace

from sysdyn.compiler.forms.minors import Square, inverse
from sysdyn.compiler.model.energies import EnergyModel
from sysdyn.compiler.model.terms import Term, local_variables
from sysdyn.dsl.model.calculus import derivative, time_derivative
from sysdyn.dsl.model.evaluation import evaluate
from sysdyn.dsl.model.expression import (
    Node,
    add,
    const,
    is_const,
    mul,
    neg,
    power,
    sub,
    substitute,
    topological,
    var,
    variables,
)
from sysdyn.dsl.model.network import Parameter, Slope
from sysdyn.values import dataclass

LARGEST = 12
"""Coordinates of a block that is looked at."""
WRITTEN = 2
"""Coordinates that M may join for its inverse to be written out."""
COUPLED = 5
"""Coordinates that M may join; of more the rows stay 0 = p - dT*/df, for the Jacobian of M^-1 p grows too fast."""
LONGEST = 400
"""Nodes of the terms of such a block."""
DRAWN = 8
"""Points at which M is looked at."""
NEAR = (0.2, 1.0)
WIDE = 3.0
"""Displacements there, of every other point: about a turn of an angle."""
SINGULAR = 1e-9
"""Of a pivot, relative to its row's largest entry."""
Values = Callable[[str], float]
Ends = tuple[float, float]


@dataclass(frozen=True, slots=True)
class _JoinedFlows:
    """Flows that terms join, by coordinate, and these terms by their number."""

    flows: tuple[Node, ...]
    terms: tuple[int, ...]


def legendre_transform(model: EnergyModel, parameters: Sequence[Parameter]) -> tuple[EnergyModel, tuple[Slope, ...]]:
    """The model with T(p, q) for the blocks of T* that allow it; the determinants that must not become zero."""
    m = model.mirror
    terms = model.function(m.coenergy)
    gone: set[int] = set()
    found: list[Term] = []
    rests: list[Slope] = []
    solved: dict[str, tuple[Node, Node]] = {}
    # blocks of T* that share no flow are transformed one by one
    for block in _blocks(terms, m.rate):
        whole = add(*(terms[k].expression for k in block.terms))
        inertia = _inertia(whole, block.flows, _scalar_values(parameters))
        # not a regular quadratic form of numbers and displacements
        if inertia is None:
            continue
        place = terms[block.terms[0]].place
        momenta = _momenta(whole, block.flows, m.conjugate)
        # a full matrix: flows by relations in place of an inverse
        if len(inertia) > WRITTEN and not _is_diagonal(inertia):
            solved |= _flow_relations(whole, block.flows, inertia, momenta, m.conjugate)
        else:
            gone |= set(block.terms)
            found += [Term(part, (), place) for part in _energy(whole, block.flows, inertia, momenta)]
        rests += [Slope(f.data[0], size, (), False, place) for f, size in _rest_on(inertia, block.flows)]
    if not found and not solved:
        return model, ()
    kept = tuple(t for k, t in enumerate(terms) if k not in gone)
    functions = {**model.functions, m.coenergy: kept, m.energy: (*model.function(m.energy), *found)}
    return replace(model, functions=functions, solved=solved), tuple(rests)


def _rest_on(inertia: Square, flows: Sequence[Node]) -> Iterator[tuple[Node, Node]]:
    """A flow and what of parameters must not be zero, for M to have an inverse; at one point where M moves."""
    apart = _is_diagonal(inertia)
    sizes = [row[k] for k, row in enumerate(inertia)] if apart else _factor_inertia(inertia)[1]
    drawn = random.Random(0)
    at: dict[Node, Node] = {}
    for node in topological(sizes):
        if node.op in ("var", "time"):
            at[node] = const(drawn.uniform(-WIDE, WIDE))
    for f, size in zip(flows, sizes, strict=True):
        fixed = substitute(size, at) if at else size
        if not is_const(fixed) and (not at or not apart):
            yield f, fixed


def _blocks(terms: Sequence[Term], rate: str) -> Iterator[_JoinedFlows]:
    """Sets of flows without a common term; those that a loop or an index touches are left out."""
    parts: list[tuple[dict[Node, None], list[int]]] = []
    lost: set[str] = set()
    for k, term in enumerate(terms):
        flows = dict.fromkeys(local_variables(term.expression, rate))
        # arrays keep their coenergy
        if term.loops or any(n.args for n in flows):
            lost |= {n.data[0] for n in flows}
            continue
        if not flows:
            continue
        own, numbers, apart = flows, [k], []
        # union of the parts that the term joins
        for part in parts:
            if part[0].keys() & own.keys():
                own, numbers = {**part[0], **own}, part[1] + numbers
            else:
                apart.append(part)
        parts = [*apart, (own, numbers)]
    for flows, numbers in parts:
        if not any(n.data[0] in lost for n in flows):
            yield _JoinedFlows(tuple(flows), tuple(numbers))


def _inertia(whole: Node, flows: Sequence[Node], known: Values) -> list[list[Node]] | None:
    """M of a block, None where it is not transformed."""
    if len(flows) > LARGEST or len(topological([whole])) > LONGEST:
        return None
    inertia = [[derivative(derivative(whole, f), g) for g in flows] for f in flows]
    rates = set(flows)
    for entry in (e for row in inertia for e in row):
        if any(n in rates or (n.op == "var" and n.data[1] not in ("q", "p", "s")) for n in variables(entry)):
            return None
    if not _is_diagonal(inertia) and len(flows) > COUPLED:
        return None
    return inertia if _regular(inertia, known) else None


def _momenta(whole: Node, flows: Sequence[Node], conjugate: str) -> list[Node]:
    """P - b of a block."""
    still = dict.fromkeys(flows, const(0.0))
    return [sub(var(f.data[0], conjugate), substitute(derivative(whole, f), still)) for f in flows]


def _energy(whole: Node, flows: Sequence[Node], inertia: Square, momenta: Sequence[Node]) -> list[Node]:
    """The summands of T of a block."""
    found = _form(inertia, momenta)
    rest = neg(substitute(whole, dict.fromkeys(flows, const(0.0))))
    return found if is_const(rest, 0.0) else [*found, rest]


def _form(inertia: Square, momenta: Sequence[Node]) -> list[Node]:
    """The terms of z^T M^-1 z/2."""
    over = _inverse(inertia)
    found = []
    for j, row in enumerate(over):
        for k in range(j, len(row)):
            if not is_const(row[k], 0.0):
                found.append(mul(const(0.5 if j == k else 1.0), row[k], momenta[j], momenta[k]))
    return found


def _flow_relations(
    whole: Node, flows: Sequence[Node], inertia: Square, momenta: Sequence[Node], conjugate: str
) -> dict[str, tuple[Node, Node]]:
    """By coordinate 0 = dT/dp - f, and the rate of this where it holds: M^-1 (p' - (dT*/df)')."""
    lost = [sub(var(f.data[0], conjugate, order=1), time_derivative(derivative(whole, f))) for f in flows]
    pairs = zip(flows, _flows(inertia, momenta), _flows(inertia, lost), strict=True)
    return {f.data[0]: (sub(value, f), rate) for f, value, rate in pairs}


def _flows(inertia: Square, momenta: Sequence[Node]) -> list[Node]:
    """M^-1 z, by elimination."""
    lower, pivots = _factor_inertia(inertia)
    y: list[Node] = []
    for k, z in enumerate(momenta):
        y.append(sub(z, add(*(mul(lower[k][j], y[j]) for j in range(k)))))
    found: list[Node] = []  # from the last
    for k in reversed(range(len(y))):
        later = (mul(lower[j][k], found[len(y) - 1 - j]) for j in range(k + 1, len(y)))
        found.append(sub(mul(y[k], power(pivots[k], const(-1.0))), add(*later)))
    return found[::-1]


def _factor_inertia(inertia: Square) -> tuple[list[list[Node]], list[Node]]:
    """The rows of L and the pivots of M = L D L^T."""
    lower: list[list[Node]] = []
    pivots: list[Node] = []
    for k, row in enumerate(inertia):
        line: list[Node] = []
        for j in range(k):
            held = add(*(mul(line[i], lower[j][i], pivots[i]) for i in range(j)))
            line.append(mul(sub(row[j], held), power(pivots[j], const(-1.0))))
        pivots.append(sub(row[k], add(*(mul(line[i], line[i], pivots[i]) for i in range(k)))))
        lower.append(line)
    return lower, pivots


def _inverse(inertia: Square) -> list[list[Node]]:
    if not _is_diagonal(inertia):
        return inverse(inertia)
    zero = const(0.0)
    return [[power(e, const(-1.0)) if j == k else zero for k, e in enumerate(row)] for j, row in enumerate(inertia)]


def _is_diagonal(inertia: Square) -> bool:
    """Whether M is diagonal."""
    return all(is_const(e, 0.0) for j, row in enumerate(inertia) for k, e in enumerate(row) if j != k)


def _regular(inertia: Square, known: Values) -> bool:
    """Whether no pivot of M is nearly zero at some points; of those far out, only where M has values there."""
    entries = [e for row in inertia for e in row]
    pivots = [row[k] for k, row in enumerate(inertia)] if _is_diagonal(inertia) else _factor_inertia(inertia)[1]
    n = len(pivots)
    # by samples: half of them near, half far out
    for seed in range(DRAWN):
        drawn = random.Random(seed)
        ends = NEAR if seed % 2 == 0 else (-WIDE, WIDE)
        values: dict[Node, float] = {}

        def look(
            node: Node, drawn: random.Random = drawn, values: dict[Node, float] = values, ends: Ends = ends
        ) -> float:
            if node not in values:
                values[node] = known(node.data) if node.op == "param" and not node.args else drawn.uniform(*ends)
            return values[node]

        try:
            found = evaluate([*pivots, *entries], look)
        except (ArithmeticError, ValueError):
            found = [math.nan] * (n + n * n)
        if ends is not NEAR and any(math.isnan(v) for v in found[n:]):
            continue
        # each pivot against the largest entry of its row
        rows = [max(abs(v) for v in found[(k + 1) * n : (k + 2) * n]) for k in range(n)]
        if not all(abs(d) > SINGULAR * row > 0.0 for d, row in zip(found, rows, strict=False)):
            return False
    return True


def _scalar_values(parameters: Sequence[Parameter]) -> Values:
    """Values of scalar parameters by name; of others 1."""
    said = {p.name: p.values[0] for p in parameters if not p.shape and len(p.values) == 1}
    found: dict[str, float] = {}

    def value(name: str) -> float:
        if name not in found:
            found[name] = 1.0
            if name in said:
                look = lambda n: value(n.data) if n.op == "param" and not n.args else 1.0  # noqa: E731
                found[name] = evaluate([said[name]], look)[0]
        return found[name]

    return value
