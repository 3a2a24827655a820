"""Network -> its reflection on Paynter's diagram: the complementary formulations are the primal ones of the reflection.

Effort and flow, momentum and displacement, kinetic and potential stores, common-effort and common-flow nodes, T* and
V*, T and V, D and G change places (book, chapter 5).  What the primal arrows then call a displacement is a momentum,
and Lagrange's equations of the reflection are the co-Lagrangian equations of the network: one lowering serves both.

Signs carry over: a branch a -> b has e = e(a) - e(b) at common-effort and f = f(a) - f(b) at common-flow nodes.
Energies and contents that are written over nodes and branches become elements first (`stated`).  Displacements
that no potential store holds, and initial positions: see `quadratures`, `positions`.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace

from sysdyn.compiler.network.along import along
from sysdyn.compiler.network.complements import complements
from sysdyn.compiler.network.floating_parts import add_references
from sysdyn.compiler.network.positions import from_stores, with_positions
from sysdyn.compiler.network.primal.reading import KINDS
from sysdyn.compiler.network.quadratures import from_masses, massive, with_quadratures
from sysdyn.compiler.network.sticking import as_relations
from sysdyn.compiler.network.ties import as_transformers
from sysdyn.compiler.network.written_energies import ALL, as_elements
from sysdyn.dsl.model import expression as ex
from sysdyn.dsl.model.expression import Node
from sysdyn.dsl.model.network import (
    Branch,
    Coordinate,
    Coupling,
    Domain,
    Network,
)
from sysdyn.dsl.model.paynter import REFLECTED, REFLECTED_FUNCTIONS
from sysdyn.dsl.model.rewriting import expressions, rewritten
from sysdyn.dsl.text.diagnostics import Diagnostic, Place

_KINDS = {"be": "bf", "bf": "be", "bq": "bp", "bp": "bq", "ne": "nf", "nf": "ne"}
_KINDS |= {f"b{name}": f"b{image}" for name, image in REFLECTED_FUNCTIONS.items()}
_FUNCTIONS = REFLECTED_FUNCTIONS | {"kept kinetic": "kept potential", "kept potential": "kept kinetic"}
_ELEMENTS = {"kinetic": "potential", "potential": "kinetic", "effort": "flow", "flow": "effort"}


def reflect(network: Network) -> Network:
    """The reflected network; written momentum coordinates become displacement coordinates.

    The network must be complementary-expressible (`formulations`): no energy, work or constraint of its text reads a
    displacement or flow of a node or branch.
    """
    bare = from_masses(
        from_stores(add_references(as_elements(as_relations(complements(as_transformers(network))), ALL)))
    )
    network = with_positions(*with_quadratures(bare))
    # quadratures for traces change nothing in the model where a mass on the node tells its flow
    read = frozenset(_read(bare)) | (frozenset(_read(network)) - massive(network))
    return replace(relabel(network), read=read)


def relabel(network: Network) -> Network:
    """Statements with the letters of the other family; twice is the network itself."""
    network = rewritten(network, _node)
    return replace(
        network,
        coordinates=tuple(_coordinate(c) for c in network.coordinates),
        energies=tuple(replace(e, function=_FUNCTIONS[e.function]) for e in network.energies),
        nodes=tuple(replace(n, domain=_domain(n.domain)) for n in network.nodes),
        branches=tuple(_branch(b) for b in network.branches),
        couplings=tuple(_coupling(c) for c in network.couplings),
    )


def _node(root: Node) -> Node:
    """The expression with the quantities of nodes and branches, and the audit's of their stores, reflected."""
    change = {}
    for node in ex.topological([root]):
        if node.op == "var" and node.data[1] in _KINDS:
            family, kind, order = node.data
            change[node] = ex.var(family, _KINDS[kind], *node.args, order=order)
        elif node.op == "var" and node.data[1] == "audit" and node.data[0] in _ELEMENTS:
            change[node] = ex.var(_ELEMENTS[node.data[0]], "audit")
    return ex.substitute(root, change) if change else root


def _domain(domain: Domain) -> Domain:
    return replace(
        domain,
        effort=domain.flow,
        flow=domain.effort,
        momentum=domain.displacement,
        displacement=domain.momentum,
        common="flow" if domain.common == "effort" else "effort",
    )


def _coordinate(c: Coordinate) -> Coordinate:
    """A momentum coordinate's units stand already where the primal arrows look for those of a displacement."""
    return replace(c, complementary=not c.complementary)


def _branch(b: Branch) -> Branch:
    side = None if b.side is None else REFLECTED[b.side]
    kind = _ELEMENTS.get(b.kind, b.kind)
    return replace(b, domain=_domain(b.domain), kind=kind, side=side)


def _coupling(c: Coupling) -> Coupling:
    return replace(c, side=REFLECTED[c.side])


def _read(network: Network) -> Iterable[str]:
    """Common-flow nodes whose flow an equation reads: common-effort nodes of the reflection."""
    roots = expressions(network, "constraints", "dynamics", "branches.law", "couplings", "works")
    return (n.data[0] for n in ex.topological(roots) if n.op == "var" and n.data[1] == "nf")


def unreflectable(network: Network) -> Diagnostic | None:
    """The first statement that reads a displacement or flow where only momenta and efforts may stand (E602)."""
    network = as_elements(along(as_relations(complements(network)), complementary=True), ALL)
    help_ = "formulation lagrangian, hamiltonian"
    # energies, works and constraints may read no displacement or flow
    statements: list[tuple[str, tuple[ex.Node, ...], Place]] = [
        (f"energy {e.function}", (e.expression,), e.place) for e in network.energies if e.function in ALL
    ]
    statements += [("work", (w.effort, w.on), w.place) for w in network.works]
    gammas = [(f"gamma {c.name}", (c.expression,), c.place) for c in network.constraints if c.kind == "gamma"]
    dual = {s.label for s in network.switches if s.dual}
    # constraints that became conditions on efforts are reflected as these
    rest = [c for c in network.constraints if c.kind != "gamma" and c.name not in dual]
    statements += [(f"{c.kind} {c.name}", (c.expression,), c.place) for c in rest]
    # what stores nothing may be modulated by a quadrature
    # laws of stores, ratios and gammas may read no other displacement
    stores = [b for b in network.branches if b.kind in ("kinetic", "potential")]
    laws = [(f"law of {b.name}", (b.law,), b.place) for b in stores if b.law is not None]
    moduli = [(f"ratio of {c.first.partition('#')[0]}", (c.ratio,), c.place) for c in network.couplings]
    lawful, at_times = {b.name for b in network.branches if b.law is not None}, {s.label for s in network.switches}
    # the first that does is named
    for what, roots, place in statements:
        for node in ex.topological(roots):
            if node.op == "var" and node.data[1] in KINDS:
                message = f"{what} is written in {node}: it has no counterpart in the complementary family"
                series = "; or of the flow of an element without a law in series with it (an ideal diode, a switch)"
                beside = node.data[1] == "bf" and node.data[0] in lawful and what.partition(" ")[2] in at_times
                return Diagnostic("E602", message, place, help_ + series if beside else help_)
    stated = {b.name for b in network.branches if b.stated}
    # a law may read its own store, and stores of one stated energy each other
    for what, roots, place in (*laws, *moduli, *gammas):
        own = what.removeprefix("law of ")
        for node in ex.topological(roots):
            if node.op == "var" and node.data[1] in ("nq", "bq") and node.data[0] != own:
                if own in stated and node.data[0] in stated:  # one energy over the displacements of several ports
                    continue
                return Diagnostic("E602", f"{what} depends on displacement {node}", place, help_)
    # an element along an expression that no node stands for
    wrong = next((b for b in network.branches if b.on is not None), None)
    if wrong is not None:
        message = f"'{wrong.name}' acts along an expression of displacements"
        return Diagnostic("E602", message, wrong.place, help_)
    return None
