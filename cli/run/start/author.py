"""What the author calls an unknown: `shaft.f` of a node or an element, `in_.e` where the runtime has a multiplier."""

from __future__ import annotations

import re
from collections.abc import Iterable

from sysdyn.dsl.model.network import Network


def names_of(network: Network, unknowns: Iterable[str]) -> list[str]:
    """The names by which the text reads these unknowns; their own where the text has no others."""
    elements = {n.name for n in network.nodes} | {b.name for b in network.branches}
    return [_name(elements, unknown) for unknown in unknowns]


def _name(elements: set[str], unknown: str) -> str:
    # the effort of a node is the multiplier of the sum of its flows
    for suffix, kind in ((".multiplier", "e"), ("'", "f")):
        owner = unknown.removesuffix(suffix)
        if owner != unknown and re.sub(r"\[.*", "", owner) in elements:
            return f"{owner}.{kind}"
    return unknown
