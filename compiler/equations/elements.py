"""The elements of a network on the edges of Paynter's diagram: law and state functions side by side (Tables 2.4-2.8).

    p-f  kinetic store      p = p(f)   T(p), T*(f)       T + T* = p f
    q-e  potential store    e = e(q)   V(q), V*(e)       V + V* = e q
    e-f  dissipator         e = e(f)   D(f), G(e)        D + G = e f

A Legendre transform is written in its own variable where the law is linear or given that way, else as the difference.
Received: a network with its branches.  Returned: an `Equation` for each law and each function.
"""

from __future__ import annotations

from collections.abc import Iterator

from sysdyn.compiler.equations.algebra import Algebra
from sysdyn.compiler.equations.book import Equation, Summed
from sysdyn.compiler.equations.joining import collect_terms
from sysdyn.compiler.network.primal.choices import ENERGY, OWN, Causality, conjugate, own
from sysdyn.compiler.network.primal.slopes import Slopes
from sysdyn.dsl.model.calculus import derivative
from sysdyn.dsl.model.expression import Node, const, div, is_const, param, substitute, var, variables
from sysdyn.dsl.model.network import Branch, Network

EDGES = {"kinetic": "p-f", "potential": "q-e", "dissipator": "e-f"}


def elements(algebra: Algebra, network: Network) -> Iterator[Equation]:
    """For each store and dissipator its law and what energy or power it has, in its own letters."""
    slopes, letters = Slopes(network), dict(zip("efqp", "efqp", strict=True))
    for branch in network.branches:
        if branch.kind not in EDGES or branch.law is None or branch.side is None:
            continue
        named = {var(branch.name, f"b{k}", *branch.at): _letter(k, branch) for k in "efqp"}
        label = f"{branch.name} ({EDGES[branch.kind]})"
        whole = [(named[own(branch, f"b{branch.side}")], branch.law), *_functions(branch, slopes, network, letters)]
        for left, value in whole:
            terms = collect_terms(algebra, substitute(value, named))
            right = tuple(Summed((), term) for term in terms)
            yield Equation("element", label, branch.place, (Summed((), left),), right, branch.loops)


def _letter(base: str, branch: Branch) -> Node:
    return param(f"{base}_{branch.name}", *branch.at)


def _functions(
    branch: Branch, slopes: Slopes, network: Network, letters: dict[str, str]
) -> Iterator[tuple[Node, Node]]:
    """Each state function with its name, the energy of the diagram's corner first."""
    choice = Causality(branch, slopes, network.tables, False, letters)
    v, w = own(branch, OWN[branch.kind][0]), conjugate(branch)
    for name, value in choice.functions(choice.law()).items():
        wanted = v if name == ENERGY[branch.kind] else w
        other = w if wanted is v else v
        found = _inverse(branch, wanted, other)
        yield _letter(name, branch), substitute(value, {other: found}) if found is not None else value


def _inverse(branch: Branch, wanted: Node, other: Node) -> Node | None:
    """The other variable of the law by the wanted one: as given, or of a linear law."""
    law = branch.law
    assert law is not None
    if own(branch, f"b{branch.side}") is other:
        return law
    slope = derivative(law, other)
    linear = other not in variables(slope) and is_const(substitute(law, {other: const(0.0)}), 0.0)
    return div(wanted, slope) if linear else None
