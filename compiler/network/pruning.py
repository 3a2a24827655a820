"""Network -> the network that a scene needs: what cannot influence what it traces and expects is left out (8.7).

The graph goes from quantity to quantity.  A statement *joins* quantities that determine each other (an energy, the
displacements of a work, a constraint with its multiplier, a branch with its nodes, a two-port), and *reads* others,
which influence them and are not influenced: efforts of works, laws of controlled sources and modulated elements,
signals in constraints and ratios (language, section 11, 25), right sides of dynamics and gammas.  What the traced
quantities reach in this graph is kept; an island, and what only reads the rest, is not.

    island        nothing joins it to what is kept
    downstream    it reads what is kept, and nothing that is kept reads it
    dead branch   nothing else joins what is behind it, and nothing reads that: its flow (effort) is zero

Received: a Network as the front end made it, before any formulation.  Returned: the same without these, as if they
had not been written, and what was left out; the network itself where the scene traces nothing (it then traces all
coordinates) or reads the audit of the whole.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from typing import Any

from sysdyn.compiler.network.dead_branches import dead_branches
from sysdyn.compiler.network.influence import (
    EVERYTHING,
    InfluenceLink,
    Quantity,
    influences_on,
    links,
    quantities,
    read_by,
)
from sysdyn.dsl.model.expression import add, variables
from sysdyn.dsl.model.network import EnergyTerm, Network, Observation
from sysdyn.dsl.model.rewriting import nodes_read
from sysdyn.values import dataclass

KINDS = {"x": "coordinate", "n": "node", "b": "branch", "u": "implicit", "s": "state", "c": "constraint"}
"""What a quantity's letter stands for, in the order in which a listing names them."""


@dataclass(frozen=True, slots=True)
class Removal:
    """A part that was left out.  rule: island, downstream, dead branch; names by kind; reads: what of the kept."""

    rule: str
    names: tuple[tuple[str, str], ...]
    reads: tuple[str, ...] = ()

    @property
    def what(self) -> str:
        """'node x, branch K'."""
        return ", ".join(f"{kind} {name}" for kind, name in self.names)

    @property
    def why(self) -> str:
        """Why nothing is lost."""
        if self.rule == "dead branch":
            return "pruned, dead branch: nothing else joins what is behind it, so nothing passes it"
        if self.rule == "island":
            return "pruned, island: nothing joins it to what the scene asks for"
        return f"pruned, downstream: it reads {', '.join(self.reads)}, and nothing that the scene asks for reads it"


def prune_network(network: Network) -> tuple[Network, tuple[Removal, ...]]:
    """What the scene needs of a network, and what was left out."""
    asked = _requested_quantities(network)
    if not asked:
        return network, ()
    removals: list[Removal] = []
    for _ in range(len(network.branches) + 1):  # a round takes a branch away
        found = links(network)
        kept = influences_on(found, asked)
        gone = frozenset(quantities(network)) - kept
        if gone:
            removals += _parts(network, found, kept, gone)
            network = _remove(network, found, gone)
            found = links(network)
        dead = dead_branches(network, found, asked)
        if not dead:
            break
        removals += [Removal("dead branch", _names_of(network, part)) for part in dead]
        network = _remove(network, found, frozenset().union(*dead))
    return network, tuple(removals)


def list_removals(removals: Iterable[Removal], most: int = 8000) -> str:
    """Names of all that was left out, with commas; of very many the first, and how many more."""
    names = list(dict.fromkeys(name for r in removals for _, name in r.names))
    taken: list[str] = []
    length = 0
    for name in names:
        length += len(name) + 2
        if length > most:
            return f"{', '.join(taken)}, ... {len(names) - len(taken)} more"
        taken.append(name)
    return ", ".join(taken)


def _requested_quantities(network: Network) -> frozenset[Quantity]:
    """The quantities that the scene reads; none where everything is to be kept."""
    scene, roots = network.scene, [o.expression for o in network.observations]
    if scene is None or not network.traced or any(name.startswith("audit.") for name, _ in scene.accuracy_on):
        return frozenset()
    roots += [n for e in network.expectations for n in (e.left, e.right, e.within, e.at) if n is not None]
    roots += [a.target for e in network.events for a in e.actions]
    found = read_by(network, roots)
    return frozenset() if EVERYTHING in found else found


def _remove(network: Network, found: Sequence[InfluenceLink], gone: frozenset[Quantity]) -> Network:
    """The network as if these quantities, and the statements that are theirs, had not been written."""
    away = {id(link.item) for link in found if link.piece is None and link.goes(gone)}

    def stay(letter: str, items: Iterable[Any]) -> tuple[Any, ...]:
        return tuple(item for item in items if (letter, item.name) not in gone)

    def remaining(items: Iterable[Any]) -> tuple[Any, ...]:
        return tuple(item for item in items if id(item) not in away)

    left = replace(
        network,
        coordinates=stay("x", network.coordinates),
        unknowns=stay("u", network.unknowns),
        states=stay("s", network.states),
        nodes=stay("n", network.nodes),
        branches=remaining(network.branches),
        energies=tuple(_energies(found, gone)),
        works=remaining(network.works),
        constraints=remaining(network.constraints),
        dynamics=remaining(network.dynamics),
        initials=remaining(network.initials),
        couplings=remaining(network.couplings),
    )
    speeds = tuple(o for o in network.speeds if not _read(o) & (_families(network) - _families(left)))
    return replace(left, read=nodes_read(left), speeds=speeds)


def _families(network: Network) -> set[str]:
    """Names of what holds a value."""
    families = (network.coordinates, network.unknowns, network.states, network.nodes, network.branches)
    return {item.name for family in families for item in family}


def _read(speed: Observation) -> set[str]:
    """A quasi-velocity, and what it is written in."""
    return {speed.name} | {str(n.data[0]) for n in variables(speed.expression) if n.op == "var"}


def _energies(found: Sequence[InfluenceLink], gone: frozenset[Quantity]) -> Iterator[EnergyTerm]:
    """Each state function with the summands that are left of it."""
    pieces: dict[int, list[InfluenceLink]] = {}
    for link in found:
        if link.piece is not None:
            pieces.setdefault(id(link.item), []).append(link)
    for own in pieces.values():
        left = [link.piece for link in own if link.piece is not None and not link.goes(gone)]
        if len(left) == len(own):
            yield own[0].item
        elif left:
            yield replace(own[0].item, expression=add(*left))


# -- what was left out, part by part -----------------------------------------------------------------------


def _parts(
    network: Network, found: Sequence[InfluenceLink], kept: frozenset[Quantity], gone: frozenset[Quantity]
) -> Iterator[Removal]:
    """The connected parts of what goes, in the order of the text."""
    head = {q: q for q in gone}

    # union-find over what goes
    def first(q: Quantity) -> Quantity:
        while head[q] != q:
            head[q] = head[head[q]]
            q = head[q]
        return q

    # which of what stays each part reads
    for link in found:
        own = sorted((link.joined | link.reads) & gone)
        for q in own[1:]:
            head[first(q)] = first(own[0])
    reads: dict[Quantity, set[str]] = {}
    for link in found:
        if link.joined & gone:
            reads.setdefault(first(next(iter(link.joined & gone))), set()).update(n for _, n in link.reads & kept)
    members: dict[Quantity, set[Quantity]] = {}
    for q in gone:
        members.setdefault(first(q), set()).add(q)
    named = [(_names_of(network, own), tuple(sorted(reads.get(q, ())))) for q, own in members.items()]
    order = {name: k for k, (_, name) in enumerate(quantities(network))}
    # reads something: downstream; nothing: an island
    for names, read in sorted(named, key=lambda pair: min(order[name] for _, name in pair[0])):
        yield Removal("downstream" if read else "island", names, read)


def _names_of(network: Network, part: Iterable[Quantity]) -> tuple[tuple[str, str], ...]:
    """Kind and name of each, by kind and in the order of the text; multipliers only where nothing else has the name."""
    wanted = set(part)
    return tuple((KINDS[letter], name) for letter, name in quantities(network) if (letter, name) in wanted)
