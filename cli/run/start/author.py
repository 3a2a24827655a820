"""What the author calls an unknown: `shaft.f` of a node or an element, `in_.e` where the runtime has a multiplier."""

from __future__ import annotations

import re

from sysdyn.dsl.model.network import Network


def name_of(network: Network, unknown: str) -> str:
    """The name by which the text reads this unknown; its own where the text has no other."""
    elements = {n.name for n in network.nodes} | {b.name for b in network.branches}
    # the effort of a node is the multiplier of the sum of its flows
    for suffix, kind in ((".multiplier", "e"), ("'", "f")):
        owner = unknown.removesuffix(suffix)
        if owner != unknown and re.sub(r"\[.*", "", owner) in elements:
            return f"{owner}.{kind}"
    return unknown
