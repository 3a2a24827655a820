"""E314: `lossless` claims that the powers into a component's ports add up to zero at every instant.

Couplings and constraints that hold for ever pass on what they take; what else is inside must add up to nothing: the
powers e*f of dissipators and sources, f*dD/df of a content, -E*d(x)/dt of a work E on x.  Their sum is judged at random
values of everything that it reads, with the values of parameters bound; a sum that cannot be told is not zero.  What
stores gives back later, not at once.
"""

from __future__ import annotations

import random
from collections.abc import Iterator

from sysdyn.dsl.elaborate.elaborate import Elaborator
from sysdyn.dsl.model import expression as ex
from sysdyn.dsl.model.calculus import derivative
from sysdyn.dsl.model.expression import Node
from sysdyn.dsl.model.network import Branch, Constraint, EnergyTerm, Loop, Terminal, VirtualWork
from sysdyn.dsl.model.values import Values
from sysdyn.dsl.text.diagnostics import Place, Report
from sysdyn.dsl.tree import syntax

FLOW_OF = {"nq": "nf", "bq": "bf", "q": "f"}
"""The kind of variable that is the rate of a displacement."""
POINTS = 4
"""Random points at which a sum must vanish."""
ZERO = 1e-9
"""Of the largest term."""
WHAT = {"dissipator": "a dissipator", "effort": "an effort source", "flow": "a flow source"}
_Part = tuple[str, tuple[Loop, ...], Node]
"""What absorbs, the loops in which it stands, and the power."""


def run(model: Elaborator, known: Values, report: Report) -> None:
    """The rule for every component that claims it."""
    for space, body in model.instances.bodies:
        claims = body.statements_of(syntax.LosslessStatement)
        if not claims:
            continue
        place = Place(space.source, claims[0][0].span)
        stores = next(_stores(model, space.path), None)
        parts = list(_powers(model, space.path))
        if stores is not None:
            report.error("E314", f"'lossless' fails: {stores} stores energy", place)
        elif parts and not _vanishes(parts, known):
            report.error("E314", f"'lossless' fails: {parts[0][0]}", place)


def _inside(name: str, path: str) -> bool:
    return name.startswith(f"{path}.")


def _statements_of(model: Elaborator, path: str) -> Iterator[EnergyTerm | VirtualWork | Constraint]:
    for owner, statements in model.parts.owned.items():
        if owner == path or _inside(owner, path):
            yield from statements


def _stores(model: Elaborator, path: str) -> Iterator[str]:
    """Elements and state functions of a component that hold energy."""
    yield from (
        f"'{b.name}'" for b in model.parts.branches if b.kind in ("kinetic", "potential") and _inside(b.name, path)
    )
    yield from (
        f"an energy {s.function}"
        for s in _statements_of(model, path)
        if isinstance(s, EnergyTerm) and s.function not in ("D", "G") and not s.function.startswith("kept")
    )


def _powers(model: Elaborator, path: str) -> Iterator[_Part]:
    """What absorbs power inside a component."""
    # dissipators and sources inside
    for b in model.parts.branches:
        if b.kind in WHAT and _inside(b.name, path) and b.law is not None:
            yield f"'{b.name}' is {WHAT[b.kind]}", b.loops, _power(b, b.law)
    # works, contents, and constraints that move with time
    for s in _statements_of(model, path):
        if isinstance(s, VirtualWork):
            yield "a work", s.loops, ex.neg(ex.mul(s.effort, _rate(s.on)))
        elif isinstance(s, EnergyTerm) and s.function in ("D", "G"):
            kinds = (*FLOW_OF.values(), "ne", "be")
            own = [n for n in ex.variables(s.expression) if n.op == "var" and n.data[1] in kinds]
            yield "a content", s.loops, ex.add(*(ex.mul(n, derivative(s.expression, n)) for n in own))
        elif isinstance(s, Constraint) and any(n.op == "time" for n in ex.variables(s.expression)):
            yield f"'{s.name}' moves with time", s.loops, ex.var(s.name, "moves")


def _power(branch: Branch, law: Node) -> Node:
    """The power e*f that a branch absorbs, in the variables of its ends."""
    e, f = (ex.var(branch.name, f"b{letter}", *branch.at) for letter in "ef")
    ends = {"effort": ("e", "ne"), "flow": ("f", "nf")}
    letter, kind = ends[branch.domain.common]
    if branch.on is not None:
        known = {f: _rate(branch.on)}
    else:
        known = {
            e if letter == "e" else f: ex.sub(
                _quantity_of_node(branch.plus, kind), _quantity_of_node(branch.minus, kind)
            )
        }
    other = f if branch.side == "e" else e
    return ex.mul(ex.substitute(law, known), known.get(other, other))


def _quantity_of_node(end: Terminal | None, kind: str) -> Node:
    """The effort or flow of a node; zero of ground."""
    return ex.const(0.0) if end is None or end.node is None else ex.var(end.node, kind, *end.at)


def _rate(on: Node) -> Node:
    """The rate of a displacement expression, in flows."""
    terms = []
    for n in ex.variables(on):
        if n.op == "var" and n.data[1] in FLOW_OF:
            terms.append(ex.mul(derivative(on, n), ex.var(n.data[0], FLOW_OF[n.data[1]], *n.args)))
        elif n.op == "time":
            terms.append(derivative(on, n))
    return ex.add(*terms)


def _vanishes(parts: list[_Part], known: Values) -> bool:
    """Whether powers add up to zero at random values of what they read."""
    powers = [power for _, _, power in parts]
    if ex.add(*powers) is ex.const(0.0):
        return True
    read = sorted(frozenset[Node]().union(*map(ex.variables, powers)), key=str)
    first = {ex.index(loop.index): known.number(loop.first) for _, loops, _ in parts for loop in loops}
    chance = random.Random(1)
    for _ in range(POINTS):
        bound = {n: chance.uniform(0.5, 1.5) for n in read} | first
        found = [known.number(power, bound) for power in powers]
        if not abs(sum(found)) <= ZERO * max(map(abs, found)):
            return False
    return True
