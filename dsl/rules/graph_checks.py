"""Rules on the network graph and on the laws of its elements (E306, E313, E321, E325, E409, E411, E412)."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import replace

from sysdyn.dsl.elaborate.elaborate import Elaborator
from sysdyn.dsl.model import expression as ex
from sysdyn.dsl.model.calculus import derivative
from sysdyn.dsl.model.connected_components import Joined
from sysdyn.dsl.model.expression import Node
from sysdyn.dsl.model.network import Branch, NodeFamily, Terminal
from sysdyn.dsl.model.rewriting import expressions
from sysdyn.dsl.model.signs import Reals, reals
from sysdyn.dsl.model.values import Values, as_constants
from sysdyn.dsl.parser.notes import PREDEFINED
from sysdyn.dsl.rules import lossless
from sysdyn.dsl.rules.untouched_elements import Box, box_text, first_gap
from sysdyn.dsl.text.diagnostics import Report

NEAR = 3
"""Names that a finding shows beside a node's."""
EMPTY = (-math.inf, math.inf)
"""Bounds of an index of a loop that has no element, in order (Values.bounds)."""
_End = tuple[str, str | None, tuple[Node, ...]]
"""Domain, node and indices; None for the ground."""


def run(model: Elaborator, known: Values, read: frozenset[str], report: Report) -> None:
    """All rules."""
    _lonely_nodes(model, known, read, report)
    _loops_of_sources(model, report)
    _idle_branches(model, report)
    lossless.run(model, known, report)
    for branch in model.parts.branches:
        _sign(branch, known, report)


def _count(branch: Branch, known: Values) -> float:
    """How many elements a branch statement makes."""
    return _size(((loop.first, loop.last) for loop in branch.loops), known)


def _size(ranges: Iterable[tuple[Node, Node]], known: Values) -> float:
    """How many elements ranges span: none, where one ends before it begins (2..n of n = 0)."""
    return math.prod(max(known.number(last) - known.number(first) + 1, 0.0) for first, last in ranges)


def _ends(branches: Iterable[Branch]) -> Iterable[tuple[Branch, Terminal]]:
    for branch in branches:
        for terminal in (branch.plus, branch.minus):
            if terminal is not None and terminal.node is not None:
                yield branch, terminal


def _lonely_nodes(model: Elaborator, known: Values, read: frozenset[str], report: Report) -> None:
    """E409: a node that fewer than two elements touch (common flow, or one of a family: none) and nothing reads."""
    touched: dict[str, float] = {}
    empty: dict[str, list[str]] = {}
    boxes: dict[str, list[Box]] = {}
    # how many elements end at each node; of arrays the boxes of indices
    for branch, terminal in _ends(model.parts.branches):
        assert terminal.node is not None
        count = _count(branch, known)
        touched[terminal.node] = touched.get(terminal.node, 0.0) + count
        if count == 0.0:
            empty.setdefault(terminal.node, []).append(branch.name)
        if terminal.at:
            found = tuple(known.bounds(at, branch.loops) for at in terminal.at)
            boxes.setdefault(terminal.node, []).append(tuple((min(b), max(b)) for b in found))
    mentioned = read | _read_nodes(model)
    alike: dict[str, list[str]] = {}
    # an electrical node needs two ends, a mechanical one, of a family each element some
    for node in model.parts.nodes:
        alike.setdefault(_beginning(node), []).append(node.name)
    for node in model.parts.nodes:
        size = _size(node.shape, known)
        wanted = (2.0 if node.domain.common == "effort" else 1.0) * (size if not node.shape else 1.0)
        count = touched.get(node.name, 0.0)
        if node.name in mentioned or node.name in PREDEFINED or not size > 0 or math.isnan(count):
            continue
        near = alike[_beginning(node)][: NEAR + 1]
        # too few altogether
        if count < wanted:
            _lonely(node, count, near, empty.get(node.name, []), report)
        # elements of the family that none touches
        elif node.shape and (left := _first_untouched(node, boxes.get(node.name, []), known)) is not None:
            message = f"node '{node.name}[{box_text(left)}]' touches no element"
            report.error("E409", message, node.place, help="connect it to an element, or declare fewer nodes")


def _first_untouched(node: NodeFamily, boxes: Sequence[Box], known: Values) -> Box | None:
    """The first elements of a family that nothing touches."""
    whole = tuple((known.number(first), known.number(last)) for first, last in node.shape)
    if not all(math.isfinite(a + b) for box in (whole, *boxes) for a, b in box if (a, b) != EMPTY):
        return None
    return first_gap(whole, [box for box in boxes if EMPTY not in box])


def _beginning(node: NodeFamily) -> str:
    """What names that are near to a node's have in common with it."""
    return node.name.lower()[:2]


def _lonely(node: NodeFamily, count: float, alike: list[str], empty: list[str], report: Report) -> None:
    how = "no element" if not count else "one element only" if node.domain.common == "effort" else "no element"
    near = [n for n in alike if n != node.name]
    help_ = f"near names: {', '.join(near[:NEAR])}; " if near else ""
    help_ += "connect it to an element, or delete it; ground it if that is meant"
    if empty:
        help_ = f"a range that is not empty: no element of '{empty[0]}' exists"
    report.error("E409", f"node '{node.name}' touches {how}", node.place, help=help_)


def _read_nodes(model: Elaborator) -> frozenset[str]:
    """Nodes whose quantities stand in energies, works and constraints, and those that components hang on."""
    roots = expressions(model.parts, "energies", "constraints", "works", "branches.on")
    return frozenset(
        n.data[0] for n in ex.topological(roots) if n.op == "var" and n.data[1] in ("ne", "nq", "nf", "np")
    )


def _loops_of_sources(model: Elaborator, report: Report) -> None:
    """E411: sources that fix one quantity twice: effort sources between common-effort nodes, flow sources dually."""
    found: list[tuple[_End, _End, str]] = []
    joined = Joined[_End]()
    blocked = _constrained_at_times(model)
    for branch in model.parts.branches:
        # sources of the common quantity between two nodes: effort sources of an electrical network
        if branch.kind != branch.domain.common or branch.loops or branch.plus is None or branch.minus is None:
            continue
        if (branch.name, "bf" if branch.kind == "effort" else "be") in blocked:  # then it fixes nothing
            continue
        plus, minus = ((branch.domain.name, t.node, t.at) for t in (branch.plus, branch.minus))
        # a tree as yet: kept for its paths
        if joined.join(plus, minus):
            found.append((plus, minus, branch.name))
            continue
        # closes a loop: the sources around it
        names = ", ".join((*_between(found, plus, minus), branch.name))
        message = f"loop of {branch.kind} sources: {names} fix the {branch.kind} between two nodes twice"
        if plus == minus:
            message = (
                f"both ends of the {branch.kind} source {branch.name} are one node: its {branch.kind} is zero there"
            )
        report.error("E411", message, replace(branch.place, element=branch.name))
    _cutsets(model, report)


def _constrained_at_times(model: Elaborator) -> set[tuple[str, str]]:
    """Branches and their variables that constraints hold at times: a body diode lets no current back."""
    held = (draft.value for draft in model.parts.drafts if draft.kind in ("psi", "guarded"))
    return {v.data[:2] for value in held for v in ex.variables(value) if v.op == "var"}


def _between(tree: list[tuple[_End, _End, str]], start: _End, goal: _End) -> list[str]:
    """Names of the sources of a tree on the way between two of its ends, in the order of the text."""
    touching: dict[_End, list[int]] = {}
    # which sources touch each end
    for k, (plus, minus, _) in enumerate(tree):
        touching.setdefault(plus, []).append(k)
        touching.setdefault(minus, []).append(k)
    came: dict[_End, tuple[_End, int] | None] = {start: None}
    left = [start]
    # depth first from the start, remembering whence
    while goal not in came:
        here = left.pop()
        for k in touching[here]:
            plus, minus, _ = tree[k]
            other = minus if plus == here else plus
            if other not in came:
                came[other] = here, k
                left.append(other)
    way = []
    # back from the goal
    while (step := came[goal]) is not None:
        goal = step[0]
        way.append(step[1])
    return [tree[k][2] for k in sorted(way)]


def _cutsets(model: Elaborator, report: Report) -> None:
    """E412: a node that only sources of its balanced quantity touch."""
    at: dict[tuple[str, tuple[Node, ...]], list[Branch]] = {}
    for branch, terminal in _ends(model.parts.branches):
        assert terminal.node is not None
        at.setdefault((terminal.node, terminal.at), []).append(branch)
    for node in model.parts.nodes:
        balanced = "flow" if node.domain.common == "effort" else "effort"
        touching = at.get((node.name, ()), [])
        alone = all(b.kind == balanced and not b.loops for b in touching)
        if alone and not node.shape and len(touching) > 1 and node.domain.common == "effort":
            names = ", ".join(b.name for b in touching)
            message = f"cutset of {balanced} sources: the {balanced}s of {names} at node {node.name} must vanish in sum"
            report.error("E412", message, node.place, help="an element that can take the difference")


def _idle_branches(model: Elaborator, report: Report) -> None:
    """E306: a branch without a law that stands in nothing."""
    roots = expressions(model.parts, "energies", "constraints", "works", "branches.on")
    used = {n.data[0] for n in ex.topological(roots) if n.op == "var" and n.data[1] in ("be", "bf", "bq", "bp")}
    for branch in model.parts.branches:
        if branch.kind == "field" and branch.name not in used:
            message = f"branch '{branch.name}' has no law and occurs in no energy, content, work or constraint"
            report.error("E306", message, branch.place, help="law e = ...")


def _rises(law: Node, own: Node, known: Values) -> bool:
    """Whether a law is its own variable times and over positive parameters, as most are."""
    if law.op != "mul":
        return False
    factors = zip(law.data, law.args, strict=True)
    return all(e == 1.0 if a is own else a.op == "param" and not a.args and known.number(a) > 0.0 for e, a in factors)


def _own(branch: Branch) -> Node | None:
    """The variable that the law of an element with a sign is over; None where it has none, or several."""
    if branch.law is None or branch.kind not in ("kinetic", "potential", "dissipator"):
        return None
    own = [n for n in ex.variables(branch.law) if n.op == "var" and n.data[0] == branch.name and n.data[1][0] == "b"]
    return own[0] if len(own) == 1 else None


def modulus(branch: Branch) -> Node | None:
    """The slope of a linear law that must not be negative, a function of parameters; None where it is none."""
    own = _own(branch)
    slope = None if own is None or branch.law is None else derivative(branch.law, own)
    if slope is None or (slope.op == "const" and not slope.data < 0.0):
        return None
    moves = slope.op != "param" and any(n.op in ("var", "time", "table") for n in ex.topological([slope]))
    return None if moves else slope


def negative(branch: Branch, known: Values) -> bool:
    """Whether the modulus of a linear law is negative."""
    report = Report()
    _sign(branch, known, report)
    return report.failed


def _sign(branch: Branch, known: Values, report: Report) -> None:
    """E321, E325: the modulus of a linear law, judged with the values bound."""
    own = _own(branch)
    if own is None or branch.law is None or _rises(branch.law, own, known):
        return
    slope = modulus(branch)
    if slope is None:
        _check_modulus(branch, derivative(branch.law, own), own, known, report)
        return
    found = ((at, known.number(slope, at)) for at in known.cases(slope, branch.loops))
    at, value = next((case for case in found if case[1] < 0.0), ({}, 0.0))
    if not value < 0.0:
        return
    slope = ex.substitute(slope, as_constants(at))
    _negative(branch, f"{value:g}" if slope.op == "const" else f"{slope} = {value:g}", report)


def _check_modulus(branch: Branch, slope: Node | None, own: Node, known: Values, report: Report) -> None:
    """E321, E325 of a linear law whose modulus moves: where it is negative whatever time and other unknowns are."""
    nodes = () if slope is None else ex.topological([slope])
    if slope is None or own in nodes:
        return
    params = [n for n in nodes if n.op == "param"]
    for at in known.cases(slope, branch.loops):
        numbers = {n: known.number(n, at) for n in params} | at
        if not all(map(math.isfinite, numbers.values())):
            continue
        found = reals(slope, {n: Reals(v, v, v != 0.0) for n, v in numbers.items()})
        if found.sign < 0:
            _negative(branch, f"{found.low:g} to {found.high:g}", report)
            return


def _negative(branch: Branch, shown: str, report: Report) -> None:
    """Report a modulus below zero: E321 of an inertia, E325 of a stiffness, capacitance, resistance or damping."""
    name = branch.name.rpartition("#")[0] or branch.name
    if branch.kind == "kinetic":
        message = f"'{name}': the inertia is negative ({shown}): the motion is not determined forward in time"
        report.error("E321", message, branch.place)
        return
    what = {"potential": "stiffness or capacitance", "dissipator": "resistance or damping"}[branch.kind]
    function = "V = 1/2*k*x.q^2" if branch.kind == "potential" else "D = 1/2*b*x.f^2"
    keyword = "energy" if branch.kind == "potential" else "content"
    help_ = f"an unstable element that is meant is written as '{keyword} {function}'"
    report.error("E325", f"'{name}': negative {what} ({shown})", branch.place, help=help_)
