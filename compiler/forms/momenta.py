"""Momenta and kinetic stores: which coordinates carry a momentum, and what `x.p` means where it is no unknown.

A coordinate carries a momentum as unknown where the author gave T(p) for it, where dT*/df may jump at given flows (a
discrete mass, `if t < 1 s`): no impulse acts there, so p stays and the flow jumps; and in the Hamiltonian form where T*
has a structurally nonzero second derivative by its flow.  Elsewhere its momentum is the expression dT*/df.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

from sysdyn.compiler.model.energies import EnergyModel, Virtual
from sysdyn.compiler.model.terms import Nest, Term, local_variables, split, without_nested
from sysdyn.dsl.model.calculus import derivative, time_derivative
from sysdyn.dsl.model.expression import (
    Node,
    add,
    both,
    compare,
    conditional,
    const,
    index,
    is_const,
    reduction,
    substitute,
    topological,
    variables,
)

JUMPING = ("step", "sign", "setsign", "floor", "ceil", "mod", "frac")
"""Functions whose values jump."""


def coordinates_by_energy(model: EnergyModel) -> frozenset[str]:
    """Coordinates whose store the author gave by its energy T(p)."""
    kind = model.mirror.conjugate
    pieces = model.function(model.mirror.energy)
    return frozenset(n.data[0] for t in pieces for n in local_variables(t.expression, kind))


def coordinates_with_inertia(model: EnergyModel) -> frozenset[str]:
    """Coordinates that some kinetic store moves with."""
    rate = model.mirror.rate
    pieces = model.function(model.mirror.coenergy)
    return coordinates_by_energy(model) | frozenset(
        n.data[0] for t in pieces for n in local_variables(t.expression, rate)
    )


def _inertia(model: EnergyModel) -> Iterator[tuple[Node, Node, list[Node]]]:
    """Each flow of each term of T*: the term's slope by it, and the flows by which that has one, by its structure."""
    for term in model.function(model.mirror.coenergy):
        rates = local_variables(term.expression, model.mirror.rate)
        for a in rates:
            slope = derivative(term.expression, a)
            yield a, slope, [b for b in rates if not is_const(derivative(slope, b), 0.0)]


def inertial(model: EnergyModel) -> frozenset[str]:
    """Coordinates by whose flow T* has a second derivative that is not zero by its structure."""
    return frozenset(a.data[0] for a, _, others in _inertia(model) if others)


def coordinates_of_shared_inertia(model: EnergyModel) -> frozenset[str]:
    """Coordinates whose momentum dT*/df other flows make too."""
    return frozenset(a.data[0] for a, _, others in _inertia(model) if any(b is not a for b in others))


def jumping(model: EnergyModel) -> frozenset[str]:
    """Coordinates whose momentum dT*/df may jump at given flows, and those whose inertia is theirs too: momenta keep
    their values there, flows do not, so these carry their momentum in every form.
    """
    pairs: list[tuple[str, str]] = []
    found = set[str]()
    for a, slope, others in _inertia(model):
        pairs += [(a.data[0], b.data[0]) for b in others]
        if others and any(_jumps(model, n) for n in topological([slope])):
            found.add(a.data[0])
    while more := {a for a, b in pairs if b in found} - found:
        found |= more
    return frozenset(found)


def _jumps(model: EnergyModel, node: Node) -> bool:
    """Whether an operation may change its value at one instant where coordinates and flows do not: it reads what events
    assign, or steps with time, dynamic variables or implicit unknowns.
    """
    if node.op == "param":
        return node.data in model.discretes
    if node.op == "var":
        return node.data[1] == "s" and node.data[0] in model.assigned
    if node.op in ("cmp", "table") or (node.op == "call" and node.data in JUMPING):
        return any(n.op == "time" or (n.op == "var" and n.data[1] in ("s", "e")) for n in variables(node))
    return False


def momentum(model: EnergyModel, node: Node) -> Node:
    """dT*/df of the coordinate of a momentum node, at that node's indices; 0 where no kinetic store moves with it."""
    pieces = []
    for term in model.function(model.mirror.coenergy):
        for rate in local_variables(term.expression, model.mirror.rate):
            if rate.data[0] == node.data[0]:
                pieces.append(at_indices(term.loops, rate.args, derivative(term.expression, rate), node.args))
    return add(*pieces)


def at_indices(loops: Nest, own: tuple[Node, ...], value: Node, at: tuple[Node, ...]) -> Node:
    """A value under a nest, summed over the iterations in which the indices `own` are those of `at`."""
    change = {index(loop.index): index(f"#rm{loop.index}") for loop in loops}
    inner = substitute(value, change)
    pairs = [(substitute(mine, change), wanted) for mine, wanted in zip(own, at, strict=True)]
    tests = [compare("==", mine, wanted) for mine, wanted in pairs if mine is not wanted]
    result = conditional(both(*tests), inner, const(0.0)) if tests else inner
    for loop in reversed(loops):
        first, last = (substitute(bound, change) for bound in (loop.first, loop.last))
        result = reduction("sum", f"#rm{loop.index}", first, last, result)
    return result


def resolve(model: EnergyModel, carriers: frozenset[str], root: Node) -> Node:
    """The expression with every momentum that is no unknown replaced; its derivative as far as it exists."""
    change: dict[Node, Node] = {}
    for node in local_variables(root, model.mirror.conjugate, None):
        if node.data[0] not in carriers:
            value = momentum(model, node)
            change[node] = time_derivative(value) if node.data[2] else value
    return substitute(root, change) if change else root


def resolve_momenta(model: EnergyModel, carriers: frozenset[str]) -> EnergyModel:
    """The model with momenta that are no unknowns replaced in works and rows, whose terms are split again."""

    def terms(found: tuple[Term, ...], what: str) -> tuple[Term, ...]:
        result: list[Term] = []
        for term in found:
            expression = resolve(model, carriers, term.expression)
            same = expression is term.expression
            result += (term,) if same else without_nested(split(expression, term.loops, term.place), what)
        return tuple(result)

    works: list[Virtual] = []
    for work in model.works:
        for term in terms((Term(work.effort, work.loops, work.place),), "an effort"):
            works.append(replace(work, effort=term.expression, loops=term.loops))
    rows = tuple(replace(row, terms=terms(row.terms, f"{row.kind} '{row.name}'")) for row in model.rows)
    return replace(model, works=tuple(works), rows=rows)


def undefined_momenta(model: EnergyModel, carriers: frozenset[str], root: Node) -> Iterator[str]:
    """Coordinates whose momentum is asked for although no kinetic store moves with them (E606)."""
    for node in local_variables(root, model.mirror.conjugate, None):
        if node.data[0] not in carriers and is_const(momentum(model, node), 0.0):
            yield node.data[0]
