"""N611: the effort of a node without reference is read.

Efforts of a part of a network that nothing joins to ground are known up to one number that they share. A difference of
them does not contain it; whatever else reads them gets a number that nothing decides (a forgotten ground). What a
constraint says of an effort is a reference too.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence

from sysdyn.dsl.elaborate.elaborate import Elaborator
from sysdyn.dsl.model import expression as ex
from sysdyn.dsl.model.calculus import derivative
from sysdyn.dsl.model.connected_components import Joined
from sysdyn.dsl.model.evaluation import evaluate
from sysdyn.dsl.model.expression import Node
from sysdyn.dsl.model.network import Branch, Expectation, Observation
from sysdyn.dsl.model.rewriting import expressions
from sysdyn.dsl.text.diagnostics import Place, Report

SHARED = 1e-9
"""What a shift of all efforts may change of the sum of what each changes: round-off."""


def floating(model: Elaborator, observations: Sequence[Observation], report: Report) -> None:
    """A note at each trace and expectation that reads an effort without reference."""
    loose = _loose(model)
    if not loose:
        return
    read: list[tuple[Node, Place]] = [(o.expression, o.place) for o in observations]
    read += [(ex.sub(e.left, e.right), e.place) for e in _moving(model.parts.expectations)]
    read += [(b.law, b.place) for b in model.parts.branches if b.law is not None]
    for expression, place in read:
        for names in loose:
            read_here = [n for n in ex.variables(expression) if _effort(n) in names]
            if read_here and not _of_differences(expression, read_here):
                first = read_here[0].data[0]
                message = f"the effort of '{first}' has no reference: nothing joins {_quote_names(names)} to ground"
                help_ = f"an element from one of them to ground, or {first}.e less that of another"
                report.note("N611", message, place, help=help_)
                break


def _moving(expectations: Iterable[Expectation]) -> Iterable[Expectation]:
    return (e for e in expectations if e.moment != "static")


def _quote_names(names: Sequence[str]) -> str:
    return ", ".join(f"'{n}'" for n in names[:5]) + (", ..." if len(names) > 5 else "")


def _effort(node: Node) -> str | None:
    """The family of a node whose effort this is."""
    return node.data[0] if node.op == "var" and node.data[1] == "ne" else None


def _loose(model: Elaborator) -> list[tuple[str, ...]]:
    """Families of nodes of common effort, by parts of the network that nothing joins to ground."""
    parts = model.parts
    names = dict.fromkeys([*(n.name for n in parts.nodes if n.domain.common == "effort"), ""])
    joined = Joined[str]()
    # branches join their ends
    for branch in parts.branches:
        ends = _ends(branch)
        if all(e in names for e in ends):
            joined.join(*ends)
    # a potential that an equation reads is tied to something
    for node in ex.topological(expressions(parts, "constraints", "energies", "works")):
        family = _effort(node)
        if family in names and family is not None:
            joined.join(family, "")
    groups: dict[str, list[str]] = {}
    for name in names:
        groups.setdefault(joined.first(name), []).append(name)
    return [tuple(part) for part in groups.values() if "" not in part]


def _ends(branch: Branch) -> tuple[str, str]:
    """The families of a branch's ends; ground is ''."""
    plus, minus = ("" if t is None or t.node is None else t.node for t in (branch.plus, branch.minus))
    return plus, minus


def _of_differences(expression: Node, efforts: Sequence[Node]) -> bool:
    """Whether a shift of all these efforts changes nothing: looked at where all that is read has some value."""
    leaves = [n for n in ex.topological([expression]) if n.op in ("var", "param", "time", "index", "table")]
    values = {n: 0.3 + ((k + 1) * 0.6180339887) % 1.0 for k, n in enumerate(leaves)}
    slopes = evaluate([derivative(expression, n) for n in efforts], lambda n: values.get(n, 0.5))
    total = math.fsum(slopes)
    return not math.isfinite(total) or abs(total) <= SHARED * math.fsum(map(abs, slopes))
