"""Branches of one law side by side: nodes that equal branch ends touch, and the runs of branches along them.

Nodes of a connected part with equal neighbourhoods are one family, in the order of the text; branches of one law whose
ends go along such families by one, or stay, are one run.

Received: a Network and the shapes of its laws.  Returned: where nodes stand, and runs.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence
from operator import itemgetter

from sysdyn.compiler.network.skeleton import Shaped, shape_of
from sysdyn.dsl.model.connected_components import Joined
from sysdyn.dsl.model.network import Branch, Network, Terminal
from sysdyn.values import dataclass

RUN = 8
"""Branches of a statement in a loop, at least."""
SHORT = 2
"""Nodes between two places where the neighbourhood changes, at least on the average."""
ROUNDS = 8
"""Times that families are left out before all are: one that goes may tear others."""
MARK = "#"
"""Behind the first element's name: a family's own."""
Site = tuple[str, int]
"""A family's key and a place in it; of a node by itself its name and -1, of ground "" and -1."""


@dataclass(frozen=True, slots=True)
class BranchSequence:
    """Branches one after the other; moves: whether each end goes on by one; picked: whether it goes anywhere."""

    members: tuple[tuple[Branch, Shaped], ...]
    ends: tuple[Site, Site]
    moves: tuple[bool, bool]
    picked: tuple[bool, bool] = (False, False)


@dataclass(frozen=True, slots=True)
class FamilyLaws:
    """By the names of branches that may stand in families: shapes of their laws, and a number that those share which
    are of one domain, kind, side and shape.
    """

    shapes: dict[str, Shaped]
    numbers: dict[str, int]


Found = tuple[dict[str, Site], list[BranchSequence]]
"""Nodes and branches of families."""


def laws_of(network: Network) -> FamilyLaws:
    """What each branch that may stand in a family has for a law, and its number among those that differ."""
    free, numbers, found = _free(network), dict[object, int](), FamilyLaws({}, {})
    for b in network.branches:
        shape = shape_of(b.law, b.name) if b.name in free else None
        if shape is not None:
            found.shapes[b.name] = shape
            key = b.domain.name, b.kind, b.side, shape.key
            found.numbers[b.name] = numbers.setdefault(key, len(numbers))
    return found


def _free(network: Network) -> set[str]:
    """Scalar branches between nodes that nothing but expressions names."""
    held = {name for c in network.couplings for name in (c.first, c.second)} | {s.element for s in network.switches}
    held |= {n for n, count in Counter(b.name for b in network.branches).items() if count > 1}
    return {
        b.name
        for b in network.branches
        if b.name not in held and not (b.loops or b.at or b.stated or MARK in b.name)
        if None is b.on is b.energy and None is not b.law
        if b.plus is not None and b.minus is not None and not (b.plus.at or b.minus.at)
    }


def side_by_side(network: Network, laws: FamilyLaws) -> Found:
    """Families of nodes that runs of branches go along, and these runs."""
    sites, runs = _whole(network, laws, _sites(network, laws))
    used = {site[0] for run in runs for site in run.ends if site[1] >= 0}
    return {n: s for n, s in sites.items() if s[0] in used}, runs


def _sites(network: Network, laws: FamilyLaws) -> dict[str, Site]:
    """Where each node stands: among those of its connected part that ends of the same branches touch."""
    parts = Joined[str]()
    touched: dict[str, list[int]] = {}
    kinds: dict[tuple[object, ...], int] = {}
    # ends of which branches touch each node
    for b in network.branches:
        names = [end.node for end in (b.plus, b.minus) if end is not None and end.node is not None]
        if len(names) == 2:
            parts.join(*names)
        kind = kinds.setdefault((laws.numbers.get(b.name, b.name), len(names)), 2 * len(kinds))
        for k, end in enumerate((b.plus, b.minus)):
            if end is not None and end.node is not None:
                touched.setdefault(end.node, []).append(kind + k)
    found: dict[str, Site] = {}
    size: dict[str, int] = {}
    # nodes touched alike are one family, numbered in the order of the text
    for node in network.nodes:
        if node.shape or node.name in network.read or MARK in node.name or node.name not in touched:
            continue
        family = f"{parts.first(node.name)} {node.domain.name} {sorted(touched[node.name])}"
        found[node.name] = family, size.get(family, 0)
        size[family] = size.get(family, 0) + 1
    return {name: site for name, site in found.items() if size[site[0]] >= RUN}


def _whole(network: Network, laws: FamilyLaws, sites: dict[str, Site]) -> Found:
    """Sites and runs without the families that single branches tear to pieces: these stay as they are written."""
    for _ in range(ROUNDS):
        runs = list(_runs(network, laws, sites))
        torn = _fragmented_families(network, sites, runs)
        if not torn:
            return sites, runs
        sites = {name: site for name, site in sites.items() if site[0] not in torn}
    return {}, []


def _fragmented_families(network: Network, sites: dict[str, Site], runs: Sequence[BranchSequence]) -> set[str]:
    """Families of which alike neighbours are fewer than SHORT on the average."""
    cuts: dict[str, set[int]] = {}
    # where a run begins or ends a family is cut
    for run in runs:
        for (family, first), moves in zip(run.ends, run.moves, strict=True):
            cuts.setdefault(family, set()).update((first, first + (len(run.members) if moves else 1)))
    held = {b.name for run in runs for b, _ in run.members}
    # so does a branch of no run
    for b in network.branches:
        for end in (b.plus, b.minus) if b.name not in held else ():
            if end is not None and end.node in sites:
                family, k = sites[end.node]
                cuts.setdefault(family, set()).update((k, k + 1))
    size = Counter(family for family, _ in sites.values())
    return {family for family, number in size.items() if SHORT * len(cuts.get(family, ())) > number + SHORT}


def _runs(network: Network, laws: FamilyLaws, sites: dict[str, Site]) -> Iterator[BranchSequence]:
    """Branches of one law whose ends go along their families by one, or stay."""

    def site(end: Terminal | None) -> Site:
        assert end is not None
        return ("", -1) if end.node is None else sites.get(end.node, (end.node, -1))

    groups: dict[tuple[object, ...], list[tuple[int, int, Branch, tuple[Site, Site]]]] = {}
    # branches of one law between the same families, at one distance
    for b in network.branches:
        if b.name in laws.numbers:
            ends = site(b.plus), site(b.minus)
            if ends[0][1] >= 0 or ends[1][1] >= 0:
                apart = ends[1][1] - ends[0][1] if min(ends[0][1], ends[1][1]) >= 0 else 0
                key = laws.numbers[b.name], ends[0][0], ends[1][0], apart
                groups.setdefault(key, []).append((ends[0][1], ends[1][1], b, ends))
    # neighbours whose ends move on by one or stay
    for found in groups.values():
        found.sort(key=itemgetter(0, 1))
        first = 0
        for k in range(1, len(found) + 1):
            if k < len(found) and _next(found[k - 1][3], found[k][3]):
                continue
            if k - first >= RUN:
                own = found[first:k]
                members = tuple((b, laws.shapes[b.name]) for _, _, b, _ in own)
                yield BranchSequence(members, own[0][3], (own[0][0] >= 0, own[0][1] >= 0))
            first = k


def _next(before: tuple[Site, Site], here: tuple[Site, Site]) -> bool:
    """Whether each end that stands in a family goes on by one."""
    return all(b[1] == (a[1] + 1 if a[1] >= 0 else -1) for a, b in zip(before, here, strict=True))
