"""Tables that stop the run and that a trace, an expectation or an event alone reads: the run must meet where they end.

No equation reads them, so no step would notice.  Each argument is handed to a table that is zero over the same range
and no number beyond, and its integral is a dynamic variable: it stays zero, and the run ends where it has no rate
(language, section 11, 39).
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace

from sysdyn.dsl.elaborate.elaborate import Elaborator
from sysdyn.dsl.model import expression as ex
from sysdyn.dsl.model.network import Dynamic, InitialCondition, Network, Observation, State
from sysdyn.dsl.model.rewriting import everywhere, expressions
from sysdyn.dsl.model.units import NONE, si
from sysdyn.dsl.text.diagnostics import Place

RANGE = " range"
"""Ends the name of the table that is zero over a table's range."""
_PASSED = 1e-12
"""Of the range: what the argument of a table of one argument may pass the end by, and that of a map may not."""


def watch_tables(elaborator: Elaborator, observations: Iterable[Observation]) -> None:
    """Adds the states, and what keeps them from being pruned, to the elaborator's parts."""
    tables, parts = elaborator.files.tables, elaborator.parts
    if all(t.outside != "stop" for t in tables.values()):
        return
    # what is read of tables outside of the equations: a step does not see where their arguments leave the range
    moving = [e for e in parts.expectations if e.moment != "static"]
    asked = [(o.expression, o.place) for o in (*observations, *parts.watched)]
    asked += [(node, e.place) for e in moving for node in (e.left, e.right)]
    equations = expressions(parts, "energies", "constraints", "works", "dynamics", "branches.law", "couplings")
    met = {node for node in ex.topological(equations) if node.op == "table"}
    for root, place in asked:
        for node in ex.topological([root]):
            table = tables.get(node.data[0]) if node.op == "table" and node not in met else None
            met.add(node)
            # each argument of a stopping table that moves gets a state whose rate is a table of the same range
            for k, argument in enumerate(node.args if table is not None and table.outside == "stop" else ()):
                if table is None or not _a_rate(argument):
                    continue
                name = f"{table.name}{RANGE}" + (f" {k + 1}" if k else "")
                first, last = table.points[k][0], table.points[k][-1]
                ends = (first, last if len(node.args) == 1 else last - _PASSED * (last - first))
                tables[name] = replace(table, name=name, method="linear", points=(ends,), values=(0.0, 0.0))
                _add_integral(elaborator, ex.table(name, argument), place)


def drop_measuring_states(network: Network) -> Network:
    """The network without these states, and without other integrals that nothing reads: for whom no time passes."""
    measured = {s.name for s in network.states if s.measured}
    while measured:
        less = replace(
            network,
            states=tuple(s for s in network.states if s.name not in measured),
            dynamics=tuple(d for d in network.dynamics if d.state.data[0] not in measured),
            initials=tuple(i for i in network.initials if not _states(i.target) & measured),
            observations=tuple(o for o in network.observations if o.name not in measured),
        )
        read = _read(less)
        if not measured & read:
            return less
        measured -= read
    return network


def _read(network: Network) -> set[str]:
    """The states that a statement reads."""
    found: set[str] = set()

    def seen(node: ex.Node) -> ex.Node:
        found.update(_states(node))
        return node

    everywhere(network, seen)
    return found


def _states(node: ex.Node) -> set[str]:
    return {n.data[0] for n in ex.variables(node) if n.op == "var" and n.data[1] == "s"}


def _add_integral(elaborator: Elaborator, rate: ex.Node, place: Place) -> None:
    """A state with this rate, zero at the start, that something reads."""
    parts = elaborator.parts
    name = f"{rate.data[0]} {len(parts.watched)}"
    state = ex.var(name, "s")
    parts.states.append(State(name, (), si(NONE), place, measured=True))
    parts.dynamics.append(Dynamic(state, rate, (), place))
    parts.given.add(name)
    parts.initials.append(InitialCondition(state, ex.const(0.0), True, (), place))
    parts.watched.append(Observation(name, state, si(NONE), name, place, stored=False))


def _a_rate(argument: ex.Node) -> bool:
    """Whether a rate may read it: no second derivative, no loop variable of a sum around it."""
    nodes = ex.topological([argument])
    second = any(n.op == "var" and n.data[2] + (n.data[1] == "f") > 1 for n in nodes)
    return not second and all(n.op != "index" for n in nodes)
