"""E310 and E304: laws of several branches that no energy stands behind, and laws that lose the effort along a variable.

Efforts of a store are the slopes of one function, so mixed derivatives agree: d e1/d q2 = d e2/d q1, and likewise for
p(f), f(p) and q(e).
"""

from __future__ import annotations

from collections.abc import Iterator

from sysdyn.dsl.model import expression as ex
from sysdyn.dsl.model.calculus import derivative
from sysdyn.dsl.model.expression import Node
from sysdyn.dsl.model.network import Branch, Network
from sysdyn.dsl.model.values import Values
from sysdyn.dsl.rules.letters import letter, samples, unknowns_of
from sysdyn.dsl.text.diagnostics import Related, Report

_CONJUGATE = {("kinetic", "p"): "f", ("kinetic", "f"): "p", ("potential", "e"): "q", ("potential", "q"): "e"}


def reciprocity(network: Network, known: Values, report: Report) -> None:
    """Stores of one component whose laws read each other's variable, and those that read another q or p."""
    stores: dict[str, list[Branch]] = {}
    for b in network.branches:
        if b.law is not None and (b.kind, b.side) in _CONJUGATE:
            stores.setdefault(b.name, []).append(b)
    several: set[str] = set()
    # de1/dq2 = de2/dq1: an energy has one mixed derivative
    for one, other, difference in _pairs(stores):
        held = {n: known.number(n) for n in ex.topological([difference]) if n.op == "param" and not n.args}
        if any(abs(value) > 1e-9 for value in samples(difference, held)):
            own = _CONJUGATE[one.kind, str(one.side)]
            names = one.name.rpartition(".")[2], other.name.rpartition(".")[2]
            cross = " - ".join(f"d {x}.{one.side}/d {y}.{own}" for x, y in (names, names[::-1])) + f" = {difference}"
            message = f"the laws of '{one.name}' and '{other.name}' are not reciprocal: {cross}; no energy has them"
            related = (Related("the other law", other.place),)
            help_ = "write it as gamma or transactor (not a store), or correct it"
            report.error("E310", message, one.place, related=related, help=help_)
            several |= {one.name, other.name}
    # a store that reads another q or p, with no store that reads its own
    for branches in stores.values():
        for branch in branches:
            if branch.name not in several:
                _check_store_law(branch, report)


def _pairs(stores: dict[str, list[Branch]]) -> Iterator[tuple[Branch, Branch, Node]]:
    """Pairs of stores of one place and edge, one of which reads the other's variable; the difference of slopes."""
    done: set[frozenset[str]] = set()
    for one in (b for branches in stores.values() for b in branches):
        assert one.law is not None
        for node in unknowns_of(one.law):
            name = node.data[0]
            other = next((b for b in stores.get(name, ()) if b.at == node.args), None)
            pair = frozenset((one.name, name))
            # another store of the same element index, edge and component
            if other is None or name == one.name or pair in done or (one.kind, one.side) != (other.kind, other.side):
                continue
            if letter(node) != _CONJUGATE[one.kind, str(one.side)] or node.data[1][0] != "b":
                continue
            if one.name.rpartition(".")[0] != name.rpartition(".")[0]:
                continue
            done.add(pair)
            assert other.law is not None
            mine = ex.var(one.name, node.data[1], *one.at)
            yield one, other, ex.sub(derivative(one.law, node), derivative(other.law, mine))


def _check_store_law(branch: Branch, report: Report) -> None:
    """E304: the law of a store may not depend on another displacement or momentum."""
    assert branch.law is not None
    for other in unknowns_of(branch.law, "q p"):
        if other.data[0] != branch.name:
            what = "displacement" if letter(other) == "q" else "momentum"
            name = branch.name.partition("#")[0]
            message = f"{branch.kind} law of '{name}' depends on {what} {other}: the store works there too"
            function = "T*" if branch.kind == "kinetic" else "V"
            report.error("E304", message, branch.place, help=f"energy {function} = ... with ports for both")
            return
