"""Momenta and kinetic stores: which coordinates carry a momentum, and what `x.p` means where it is no unknown.

A coordinate carries a momentum as unknown where the author gave T(p) for it, and in the Hamiltonian form where T* has a
structurally nonzero second derivative by its flow.  Elsewhere its momentum is the expression dT*/df.
"""

from __future__ import annotations

from collections.abc import Iterator

from sysdyn.compiler.energies import EnergyModel
from sysdyn.compiler.terms import Term, local_variables
from sysdyn.dsl.expression import (
    Node,
    add,
    both,
    compare,
    conditional,
    const,
    derivative,
    index,
    is_const,
    reduction,
    sub,
    substitute,
    time_derivative,
    topological,
)


def given(model: EnergyModel) -> frozenset[str]:
    """Coordinates whose store the author gave by its energy T(p)."""
    kind = model.mirror.conjugate
    pieces = model.function(model.mirror.energy)
    return frozenset(n.data[0] for t in pieces for n in local_variables(t.expression, kind))


def inertial(model: EnergyModel) -> frozenset[str]:
    """Coordinates by whose flow T* has a second derivative that is not zero by its structure."""
    found = set()
    for term in model.function(model.mirror.coenergy):
        rates = local_variables(term.expression, model.mirror.rate)
        for a in rates:
            slope = derivative(term.expression, a)
            if any(not is_const(derivative(slope, b), 0.0) for b in rates):
                found.add(a.data[0])
    return frozenset(found)


def momentum(model: EnergyModel, node: Node) -> Node:
    """dT*/df of the coordinate of a momentum node, at that node's indices; 0 where no kinetic store moves with it."""
    pieces = []
    for term in model.function(model.mirror.coenergy):
        for rate in local_variables(term.expression, model.mirror.rate):
            if rate.data[0] == node.data[0]:
                pieces.append(_at(term, rate, node.args))
    return add(*pieces)


def _at(term: Term, rate: Node, at: tuple[Node, ...]) -> Node:
    """The slope of a term by `rate`, summed over the iterations in which `rate` stands at the indices `at`."""
    body = derivative(term.expression, rate)
    change: dict[Node, Node] = {}
    tests: list[Node] = []
    for own, wanted in zip(rate.args, at, strict=True):
        counters = [n for n in topological([own]) if n.op == "index" and n not in change]
        if counters:
            change[counters[0]] = add(counters[0], sub(wanted, own))
        elif own is not wanted:
            tests.append(compare("==", own, wanted))
    for loop in reversed(term.loops):
        name = index(loop.index)
        if name in change:
            tests += [compare("<=", loop.first, name), compare("<=", name, loop.last)]
        else:
            body = reduction("sum", f"#rm{len(change)}{loop.index}", loop.first, loop.last, body)
            body = substitute(body, {name: index(f"#rm{len(change)}{loop.index}")})
    result = conditional(both(*tests), body, const(0.0)) if tests else body
    return substitute(result, change)


def resolve(model: EnergyModel, carriers: frozenset[str], root: Node) -> Node:
    """The expression with every momentum that is no unknown replaced; its derivative as far as it exists."""
    change: dict[Node, Node] = {}
    for node in local_variables(root, model.mirror.conjugate, None):
        if node.data[0] not in carriers:
            value = momentum(model, node)
            change[node] = time_derivative(value) if node.data[2] else value
    return substitute(root, change) if change else root


def undefined(model: EnergyModel, carriers: frozenset[str], root: Node) -> Iterator[str]:
    """Coordinates whose momentum is asked for although no kinetic store moves with them (E606)."""
    for node in local_variables(root, model.mirror.conjugate, None):
        if node.data[0] not in carriers and is_const(momentum(model, node), 0.0):
            yield node.data[0]
