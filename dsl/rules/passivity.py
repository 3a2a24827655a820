"""E313: the law of a dissipator with power e f below zero somewhere: an active element.

Judged with the values bound: by the sign of its slope where it goes through the origin and has no pole or jump, else at
both signs over the decades; a linear law is judged by its slope (E325), one that reads other unknowns not at all.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

from sysdyn.dsl.model import expression as ex
from sysdyn.dsl.model.calculus import derivative
from sysdyn.dsl.model.evaluation import evaluate_along
from sysdyn.dsl.model.expression import Node
from sysdyn.dsl.model.network import Branch, Network
from sysdyn.dsl.model.signs import ALL, Reals, reals
from sysdyn.dsl.model.values import Values
from sysdyn.dsl.text.diagnostics import Report
from sysdyn.values import dataclass

DECADES = tuple(s * m * 10.0**k for k in range(-9, 4) for m in (1.0, 3.0) for s in (1.0, -1.0))
"""Where laws are looked at, in SI units: a polynomial beyond any sensible range is the author's."""
UNBROKEN = ("exp", "sinh", "cosh", "tanh", "asinh", "atan", "abs", "sin", "cos")
"""Functions without poles and jumps."""
ROUND_OFF = 1e-9
"""Of the largest value so far: what a difference of exponentials loses next to zero."""


@dataclass(frozen=True, slots=True)
class _Law:
    """A law of its own variable; params: its parameters, as met; slope: its derivative; through: it is zero at zero."""

    node: Node
    own: Node
    params: tuple[Node, ...]
    slope: Node
    through: bool


_Laws = dict[tuple[object, ...], _Law]
"""By what they are but for the names in them: a netlist has few."""


def passivity(network: Network, known: Values, report: Report) -> None:
    """Dissipators whose law is a function of their own variable alone; e f of a pseudo domain is no power."""
    laws: _Laws = {}
    for branch in network.branches:
        if branch.kind == "dissipator" and branch.law is not None and not branch.domain.pseudo:
            _judge(branch, branch.law, known, laws, report)


def active(branch: Branch, known: Values) -> bool:
    """Whether the rule refuses one dissipator."""
    report = Report()
    if branch.law is not None:
        _judge(branch, branch.law, known, {}, report)
    return report.failed


MEANT = {
    letter: f"where it is meant to deliver power: its content, in a component with a branch: content {word} = ... {of}"
    for letter, word, of in (("f", "D", "(int e df)"), ("e", "G", "(int f de)"))
}
"""By its own variable: how an active element is written, of which nothing is asked."""


def _judge(branch: Branch, law: Node, known: Values, laws: _Laws, report: Report) -> None:
    """E313: a dissipator that delivers power at some value of its own variable, found by samples of its law."""
    if law.op == "sum" and law.data[0] == 0.0 and len(law.args) == 1 and law.args[0].op == "var":
        return  # 5 ohm*f
    factors = zip(law.data, law.args, strict=True) if law.op == "mul" else ()
    if law.op == "mul" and all(e == 1.0 if a.op == "var" else a.op == "param" for e, a in factors):
        return  # R*f, and what reads other unknowns
    # a law of one own variable and parameters: others are not judged alone
    nodes = ex.topological([law])
    own = [n for n in nodes if n.op == "var"]
    if len(own) != 1 or own[0].data[0] != branch.name or any(n.op in ("time", "table") for n in nodes):
        return
    params, like = [n for n in nodes if n.op == "param"], _like(nodes, own[0], laws)
    # each element with its numbers, up to the first that delivers
    for at in known.cases(law, branch.loops):
        values = (known.number(n, at) for n in params)
        found = _delivers(like, dict(zip(like.params, values, strict=True)) | at)
        if found is None:
            continue
        x, value = found
        domain, letter = branch.domain, own[0].data[1][1]
        unit = domain.flow if letter == "f" else domain.effort
        name = branch.name.partition("#")[0]
        message = f"dissipator '{name}': e*f = {x * value:.3g} W < 0 at {letter} = {x:g} {unit.text}"
        report.error("E313", f"{message} (active element)", branch.place, help=MEANT[letter])
        return


def _like(nodes: Sequence[Node], own: Node, laws: _Laws) -> _Law:
    """The first law that differs in names alone; nodes: arguments before users."""
    place = {node: k for k, node in enumerate(nodes)}
    names = {"param": None, "var": None}
    shape = tuple((n.op, names.get(n.op, n.data), *[place[a] for a in n.args]) for n in nodes)
    if shape not in laws:
        law, params = nodes[-1], tuple(n for n in nodes if n.op == "param")
        through = ex.is_const(ex.substitute(law, {own: ex.const(0.0)}), 0.0)
        laws[shape] = _Law(law, own, params, derivative(law, own), through)
    return laws[shape]


def _delivers(law: _Law, held: Mapping[Node, float]) -> tuple[float, float] | None:
    """An own variable at which the law delivers power, and the law there; None where there is none."""
    if law.through and not ex.variables(law.slope):
        return None
    where = {n: Reals(v, v, v != 0.0) for n, v in held.items()} | {law.own: ALL}
    if law.through and _unbroken(law.node, where) and reals(law.slope, where).low >= 0.0:
        return None  # it rises from the origin
    return _active(law.node, law.own, held)


def _unbroken(law: Node, where: Mapping[Node, Reals]) -> bool:
    """Without a pole or a jump, as far as can be told."""
    for node in ex.topological([law]):
        if node.op == "call" and node.data not in UNBROKEN:
            return False
        if node.op not in ("const", "param", "index", "var", "sum", "mul", "call"):
            return False
        below = (a for e, a in zip(node.data, node.args, strict=True) if e < 0) if node.op == "mul" else ()
        if any(reals(a, where).sign == 0 for a in below):
            return False
    return True


def _active(law: Node, own: Node, held: Mapping[Node, float]) -> tuple[float, float] | None:
    """The smallest own variable at which the law delivers power, and the law there."""
    if any(math.isnan(v) for v in held.values()):
        return None
    largest: Sequence[float] = (0.0, 0.0)
    for x, value in zip(DECADES, evaluate_along(law, own, DECADES, lambda n: held.get(n, math.nan)), strict=True):
        if not math.isfinite(value):
            continue
        if x * value < 0.0 and abs(value) > ROUND_OFF * largest[0]:
            return x, value
        largest = (max(largest[0], abs(value)), x)
    return None
