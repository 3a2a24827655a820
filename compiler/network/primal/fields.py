"""Efforts and momenta of branches without a law: what the statements over them absorb (language, section 11, 37).

    e = dV/dq + dT/dq + dD/df + d/dt(dT*/df) - dT*/dq - E du/dq + kappa dphi/dq + mu dpsi/df        p = dT*/df

for a branch over whose q and f stand V, T, D, T*, works E delta u and constraints: so that e delta q is all of their
virtual work.  A statement in a loop counts with every iteration that reads the branch's element.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from sysdyn.compiler.model.terms import counter, terms
from sysdyn.compiler.network.primal.incidence import BranchElement
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
    mul,
    neg,
    reduction,
    substitute,
    var,
    variables,
)
from sysdyn.dsl.model.network import Loop, Network
from sysdyn.dsl.text.diagnostics import Place
from sysdyn.values import dataclass


@dataclass(frozen=True, slots=True)
class _ElementSlope:
    """The derivative of a statement by one element of a branch family, over the statement's loops."""

    at: tuple[Node, ...]
    slope: Node
    loops: tuple[Loop, ...]


def field_quantities(network: Network, elements: Sequence[BranchElement]) -> tuple[dict[int, Node], dict[int, Node]]:
    """Efforts and momenta by element number, over the element's loops."""
    fields = [e for e in elements if e.branch.kind == "field"]
    efforts: dict[int, Node] = {}
    momenta: dict[int, Node] = {}
    slopes = {name: _slopes(network, name) for name in {e.name for e in fields}} if fields else {}
    for e in fields:
        given, momentum = slopes[e.name]
        held = [_slope_of_element(s, e.branch.at, e.branch.loops) for s in momentum]
        found = [_slope_of_element(s, e.branch.at, e.branch.loops) for s in given]
        if held:
            momenta[e.number] = add(*held)
            found.append(time_derivative(momenta[e.number]))
        if found:
            efforts[e.number] = add(*found)
    return efforts, momenta


def _slopes(network: Network, name: str) -> tuple[list[_ElementSlope], list[_ElementSlope]]:
    """What makes the effort, and what makes the momentum, of the branches of a family."""
    efforts: list[_ElementSlope] = []
    momenta: list[_ElementSlope] = []
    # e = dV/dq - dT*/dq + dD/df, p = dT*/df
    for energy in network.energies:
        sign = {"V": 1.0, "T": 1.0, "T*": -1.0}.get(energy.function)
        if sign is not None:
            efforts += _slopes_by(energy.expression, energy.loops, energy.place, (name, "bq"), const(sign))
        if energy.function == "D":
            efforts += _slopes_by(energy.expression, energy.loops, energy.place, (name, "bf"), const(1.0))
        if energy.function == "T*":
            momenta += _slopes_by(energy.expression, energy.loops, energy.place, (name, "bf"), const(1.0))
    # minus what works supply
    for work in network.works:
        efforts += _slopes_by(work.on, work.loops, work.place, (name, "bq"), neg(work.effort))
    # and reactions
    for c in network.constraints:
        if c.kind in ("phi", "psi"):
            multiplier = var(c.name, "kappa" if c.kind == "phi" else "mu", *c.at)
            kind = "bq" if c.kind == "phi" else "bf"
            efforts += _slopes_by(c.expression, c.loops, c.place, (name, kind), multiplier)
    return efforts, momenta


def _slopes_by(
    root: Node, loops: tuple[Loop, ...], place: Place, wanted: tuple[str, str], factor: Node
) -> Iterator[_ElementSlope]:
    """Factor times the derivative of a statement by each reference to the branch that it holds."""
    if not any(n.op == "var" and n.data == (*wanted, 0) for n in variables(root)):
        return
    change = {index(loop.index): counter(k) for k, loop in enumerate(loops)}
    for term in terms(root, loops, place):
        for node in sorted((n for n in variables(term.expression) if n.op == "var"), key=lambda n: n.number):
            slope = derivative(term.expression, node) if node.data == (*wanted, 0) else const(0.0)
            if not is_const(slope, 0.0):
                yield _ElementSlope(node.args, mul(substitute(factor, change), slope), term.loops)


def _slope_of_element(found: _ElementSlope, wanted: tuple[Node, ...], own: tuple[Loop, ...]) -> Node:
    """The slope for one element: an index that is a loop variable over the branch's own range takes its place."""
    change: dict[Node, Node] = {}
    ranges = {index(loop.index): (loop.first, loop.last) for loop in own}
    left = {index(loop.index): loop for loop in found.loops}
    for a, w in zip(found.at, wanted, strict=True):
        loop = left.get(a)
        if loop is not None and ranges.get(w) == (loop.first, loop.last):
            change[a] = w
            del left[a]
    fresh = {a: index(f"#f{loop.index}") for a, loop in left.items()}
    slope = substitute(found.slope, {**change, **fresh})
    pairs = [(substitute(a, {**change, **fresh}), w) for a, w in zip(found.at, wanted, strict=True)]
    tests = [compare("==", a, w) for a, w in pairs if a is not w]
    slope = conditional(both(*tests), slope, const(0.0)) if tests else slope
    for a, loop in reversed(left.items()):
        first, last = (substitute(bound, {**change, **fresh}) for bound in (loop.first, loop.last))
        slope = reduction("sum", fresh[a].data, first, last, slope)
    return slope
