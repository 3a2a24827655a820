"""Network with nodes and branches -> coordinate-style Network of the primal family (language, section 5, P1 to P3).

Common-flow nodes become displacement coordinates; branches of common-effort domains share one coordinate per series
class, and their other nodes become flow constraints.  Laws become energies, works and constraints (section 6), and what
is said of branches and nodes is said of coordinates, multipliers and implicit unknowns.  Constraints that touch a
tangible coordinate are integrated later (P4, `integration`).  Arrays stay loops throughout (8.5).
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import Any

from sysdyn.compiler.network.primal.account import Step, account
from sysdyn.compiler.network.primal.balances import balances
from sysdyn.compiler.network.primal.bounds import WholeNumbers
from sysdyn.compiler.network.primal.contents import Contents, at_stores
from sysdyn.compiler.network.primal.incidence import BranchElement, Incidence
from sysdyn.compiler.network.primal.laws import Laws, laws
from sysdyn.compiler.network.primal.potentials import Potentials
from sysdyn.compiler.network.primal.precedence import foremost
from sysdyn.compiler.network.primal.reading import EliminationTable, IndexBox, Rewriter
from sysdyn.compiler.network.primal.series import Series, series
from sysdyn.compiler.network.primal.store_guesses import guess_contents
from sysdyn.dsl.model.expression import Node, variables
from sysdyn.dsl.model.network import Constraint, Coordinate, Dynamic, EnergyTerm, Expectation, Network, VirtualWork
from sysdyn.dsl.model.rewriting import EXPRESSIONS, expressions
from sysdyn.dsl.text.diagnostics import Diagnostic, ModelError, Place


def primal(network: Network, *, reflected: bool = False) -> tuple[Network, tuple[Diagnostic, ...], tuple[Step, ...]]:
    """The network in coordinates, notes about inverted laws, and what became of nodes and branches; ModelError where
    that cannot be. reflected: the network is the reflection of the author's.
    """
    if not network.branches and not network.nodes:
        return network, (), ()
    sizes = WholeNumbers(network)
    # which elements end where, and which flows are equal
    incidence = Incidence(network, sizes)
    classes = series(incidence, network.read)
    # balances of effort nodes
    nodes = balances(incidence, classes.merged)
    # each branch's law, solved for what the form wants
    said = laws(network, incidence.elements, sizes, reflected=reflected)
    potentials = Potentials(nodes.efforts)
    pieces = _pieces(incidence.elements, classes)
    book = EliminationTable(pieces, said.efforts, said.momenta, potentials.read, functions=said.functions)
    book.sticking = _sticking(network)
    reader = Rewriter(sizes, book)
    # initial values at stores, the later statement before the earlier
    told = at_stores(network, said, incidence, reader, reflected=reflected)
    initials = foremost(tuple(told), network.branches, sizes)
    read = _charges(network)
    contents = Contents(reader, classes.members, initials, incidence.elements, reflected=reflected, read=read)
    guesses, stores = guess_contents(network, said.constant, initials, sizes, reader, reflected=reflected)
    # the network in coordinates alone
    found = replace(
        network,
        parameters=(*network.parameters, *contents.parameters),
        coordinates=(*network.coordinates, *_node_coordinates(network), *classes.coordinates),
        unknowns=(*network.unknowns, *said.unknowns.values()),
        states=(*network.states, *said.states.values(), *contents.states),
        initials=(*contents.initial_conditions(stores), *said.initials, *guesses),
        nodes=(),
        branches=(),
        couplings=(),
        slopes=(*network.slopes, *said.slopes),
        tables=(*network.tables, *said.tables.values()),
        read=frozenset(),
        **_statements(network, said, nodes.constraints, reader),
    )
    found = replace(found, dynamics=(*found.dynamics, *contents.dynamics))
    return found, tuple(said.notes), account(network, classes, nodes)


def _charges(network: Network) -> frozenset[str]:
    """Branches whose displacement a statement reads."""
    read = expressions(network, *(sort for sort in EXPRESSIONS if sort != "initials"))
    found = (n for root in read for n in variables(root) if n.op == "var")
    return frozenset(n.data[0] for n in found if n.data[1:] == ("bq", 0))


def _sticking(network: Network) -> dict[str, tuple[str, ...]]:
    """Labels of the constraints that hold the branches of a family while they stick."""
    found: dict[str, tuple[str, ...]] = {}
    for s in network.switches:
        if s.element and s.holds is None and s.label not in found.get(s.element, ()):
            found[s.element] = (*found.get(s.element, ()), s.label)
    return found


def _pieces(elements: tuple[BranchElement, ...], classes: Series) -> dict[str, list[IndexBox]]:
    """How each branch family is cut: by its statements, and by the classes these belong to."""
    found: dict[str, list[IndexBox]] = {}
    cut = {m.element.number for m in classes.members}
    for m in classes.members:
        found.setdefault(m.element.name, []).append(IndexBox(m.box, m.element, m))
    for e in elements:
        if e.number not in cut:
            found.setdefault(e.name, []).append(IndexBox(e.named, e))
    return found


def _node_coordinates(network: Network) -> Iterator[Coordinate]:
    """P1: one displacement coordinate per common-flow node."""
    for node in network.nodes:
        d = node.domain
        if d.common == "flow":
            yield Coordinate(
                node.name, node.shape, False, d.displacement, d.flow, d.momentum, d.effort, None, node.place
            )


def _statements(network: Network, said: Laws, nodes: tuple[Constraint, ...], reader: Rewriter) -> dict[str, Any]:
    """All statements in coordinates, those of the text first."""
    return {
        "energies": tuple(r for e in (*network.energies, *said.energies) for r in _energy(e, reader)),
        "works": tuple(r for w in (*network.works, *said.works) for r in _work(w, reader)),
        "constraints": tuple(
            r for c in (*network.constraints, *said.constraints, *nodes) for r in _constraint(c, reader)
        ),
        "dynamics": tuple(r for d in (*network.dynamics, *said.dynamics) for r in _dynamic(d, reader)),
        "observations": tuple(
            replace(o, expression=reader.scalar(o.expression, o.place)) for o in network.observations
        ),
        "speeds": tuple(replace(o, expression=reader.scalar(o.expression, o.place)) for o in network.speeds),
        "expectations": tuple(_expectation(e, reader) for e in network.expectations),
    }


def _energy(e: EnergyTerm, reader: Rewriter) -> Iterator[EnergyTerm]:
    for loops, (expression,) in reader.statement(e.loops, (e.expression,), e.place):
        yield replace(e, expression=_still(expression, e.expression, e.place), loops=loops)


def _work(w: VirtualWork, reader: Rewriter) -> Iterator[VirtualWork]:
    for loops, (effort, on) in reader.statement(w.loops, (w.effort, w.on), w.place):
        yield replace(w, effort=_still(effort, w.effort, w.place), on=on, loops=loops)


def _constraint(c: Constraint, reader: Rewriter) -> Iterator[Constraint]:
    for loops, (expression,) in reader.statement(c.loops, (c.expression,), c.place):
        yield replace(c, expression=_still(expression, c.expression, c.place), loops=loops)


def _dynamic(d: Dynamic, reader: Rewriter) -> Iterator[Dynamic]:
    for loops, (expression,) in reader.statement(d.loops, (d.expression,), d.place):
        yield replace(d, expression=_still(expression, d.expression, d.place), loops=loops)


def _expectation(e: Expectation, reader: Rewriter) -> Expectation:
    within = None if e.within is None else reader.scalar(e.within, e.place)
    return replace(e, left=reader.scalar(e.left, e.place), right=reader.scalar(e.right, e.place), within=within)


def _still(found: Node, root: Node, place: Place) -> Node:
    """E518 where reading brought the rate of a flow into a law."""
    rates = {n for n in variables(found) if n.op == "var" and n.data[2]} - variables(root)
    if rates:
        first = min(rates, key=lambda n: n.number)
        text = f"a law reads an effort that follows from {first!r}: the node's effort is to be read instead"
        raise ModelError([Diagnostic("E518", text, place)])
    return found
