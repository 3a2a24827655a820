"""EnergyModel -> EnergyModel: kinetic energy T(p, q) in the place of T*(f, q), block by block (book, chapter 4).

    T* = f^T M f/2 + b^T f + c        M, b, c of displacements, dynamic variables and time
    T  = (p - b)^T M^-1 (p - b)/2 - c                       T + T* = p^T f,  dT/dp = f,  dT/dq = -dT*/dq

A block is a set of flows that the terms of T* join.  It is transformed where its M is regular at the values of the
parameters and at some points, small, and no family over a range; elsewhere T* stays, and 0 = p - dT*/df with it.
"""

from __future__ import annotations

import random
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace

from sysdyn.compiler.forms.minors import determinant, inverse
from sysdyn.compiler.model.energies import EnergyModel
from sysdyn.compiler.model.terms import Term, local_variables
from sysdyn.dsl.model.expression import (
    Node,
    add,
    const,
    derivative,
    evaluate,
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

LARGEST = 12
"""Coordinates of a block that is looked at."""
COUPLED = 2
"""Coordinates that M may join for its inverse to be written out; only where it does not move."""
LONGEST = 400
"""Nodes of the terms of such a block."""
DRAWN = 3
"""Points at which M is looked at."""
SINGULAR = 1e-9
"""Of a determinant, relative to the product of the rows' largest entries."""
Values = Callable[[str], float]


@dataclass(frozen=True, slots=True)
class _Block:
    """Flows that terms join, by coordinate, and these terms by their number."""

    flows: tuple[Node, ...]
    terms: tuple[int, ...]


def transformed(model: EnergyModel, parameters: Sequence[Parameter]) -> tuple[EnergyModel, tuple[Slope, ...]]:
    """The model with T(p, q) for the blocks of T* that allow it; the determinants that must not become zero."""
    m = model.mirror
    terms = model.function(m.coenergy)
    gone: set[int] = set()
    found: list[Term] = []
    rests: list[Slope] = []
    for block in _blocks(terms, m.rate):
        whole = add(*(terms[k].expression for k in block.terms))
        energy = _energy(whole, block.flows, m.conjugate, _known(parameters))
        if energy is not None:
            place = terms[block.terms[0]].place
            gone |= set(block.terms)
            found += [Term(part, (), place) for part in energy]
            rests += [Slope(f.data[0], size, (), False, place) for f, size in _rest_on(whole, block.flows)]
    if not found:
        return model, ()
    kept = tuple(t for k, t in enumerate(terms) if k not in gone)
    functions = {**model.functions, m.coenergy: kept, m.energy: (*model.function(m.energy), *found)}
    return replace(model, functions=functions), tuple(rests)


def _rest_on(whole: Node, flows: Sequence[Node]) -> Iterator[tuple[Node, Node]]:
    """A flow and what of parameters must not be zero, for M to have an inverse."""
    inertia = [[derivative(derivative(whole, f), g) for g in flows] for f in flows]
    sizes = [row[k] for k, row in enumerate(inertia)] if _apart(inertia) else [determinant(inertia)]
    for f, size in zip(flows, sizes, strict=False):
        if not is_const(size) and not any(n.op in ("var", "time") for n in topological([size])):
            yield f, size


def _blocks(terms: Sequence[Term], rate: str) -> Iterator[_Block]:
    """Sets of flows without a common term; those that a loop or an index touches are left out."""
    parts: list[tuple[dict[Node, None], list[int]]] = []
    lost: set[str] = set()
    for k, term in enumerate(terms):
        flows = dict.fromkeys(local_variables(term.expression, rate))
        if term.loops or any(n.args for n in flows):
            lost |= {n.data[0] for n in flows}
            continue
        if not flows:
            continue
        own, numbers, apart = flows, [k], []
        for part in parts:
            if part[0].keys() & own.keys():
                own, numbers = {**part[0], **own}, part[1] + numbers
            else:
                apart.append(part)
        parts = [*apart, (own, numbers)]
    for flows, numbers in parts:
        if not any(n.data[0] in lost for n in flows):
            yield _Block(tuple(flows), tuple(numbers))


def _energy(whole: Node, flows: Sequence[Node], conjugate: str, known: Values) -> list[Node] | None:
    """The summands of T of a block, None where it has none."""
    if len(flows) > LARGEST or len(topological([whole])) > LONGEST:
        return None
    still = dict.fromkeys(flows, const(0.0))
    slopes = [derivative(whole, f) for f in flows]
    inertia = [[derivative(slope, f) for f in flows] for slope in slopes]
    rates = set(flows)
    for entry in (e for row in inertia for e in row):
        if any(n in rates or (n.op == "var" and n.data[1] not in ("q", "p", "s")) for n in variables(entry)):
            return None
    if not _small(inertia) or not _regular(inertia, known):
        return None
    momenta = [
        sub(var(f.data[0], conjugate), substitute(slope, still)) for f, slope in zip(flows, slopes, strict=True)
    ]
    over = _inverse(inertia)
    found = []
    for j, row in enumerate(over):
        for k in range(j, len(row)):
            if not is_const(row[k], 0.0):
                found.append(mul(const(0.5 if j == k else 1.0), row[k], momenta[j], momenta[k]))
    rest = neg(substitute(whole, still))
    return found if is_const(rest, 0.0) else [*found, rest]


def _inverse(inertia: Sequence[Sequence[Node]]) -> list[list[Node]]:
    if len(inertia) <= COUPLED:
        return inverse(inertia)
    zero = const(0.0)
    return [[power(e, const(-1.0)) if j == k else zero for k, e in enumerate(row)] for j, row in enumerate(inertia)]


def _apart(inertia: Sequence[Sequence[Node]]) -> bool:
    """Whether M is diagonal."""
    return all(is_const(e, 0.0) for j, row in enumerate(inertia) for k, e in enumerate(row) if j != k)


def _small(inertia: Sequence[Sequence[Node]]) -> bool:
    """Whether M is diagonal, or small and at rest."""
    still = not any(n.op in ("var", "time") for row in inertia for e in row for n in topological([e]))
    return _apart(inertia) or (still and len(inertia) <= COUPLED)


def _regular(inertia: Sequence[Sequence[Node]], known: Values) -> bool:
    entries = [e for row in inertia for e in row]
    n = len(inertia)
    whole = determinant(inertia) if n <= COUPLED else mul(*(row[k] for k, row in enumerate(inertia)))
    for seed in range(DRAWN):
        drawn = random.Random(seed)
        values: dict[Node, float] = {}

        def look(node: Node, drawn: random.Random = drawn, values: dict[Node, float] = values) -> float:
            if node not in values:
                values[node] = known(node.data) if node.op == "param" and not node.args else drawn.uniform(0.2, 1.0)
            return values[node]

        try:
            size, *found = evaluate([whole, *entries], look)
        except (ArithmeticError, ValueError):
            return False
        bound = 1.0
        for k in range(n):
            bound *= max(abs(v) for v in found[k * n : (k + 1) * n])
        if not abs(size) > SINGULAR * bound > 0.0:
            return False
    return True


def _known(parameters: Sequence[Parameter]) -> Values:
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
