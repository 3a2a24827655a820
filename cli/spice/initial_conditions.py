"""What capacitors hold at the start of a run: where sources decide it, and where `.ic` does."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

from sysdyn.cli.spice.circuit import GROUND
from sysdyn.cli.spice.netlist import Card

SOURCES = "veh"
"""Letters of elements that decide a voltage."""


def _ends(card: Card) -> tuple[str, ...]:
    """The two nodes of a card, with one name for ground."""
    words = [w for w in card.words[1:] if w not in ("(", ")", ",")][:2]
    return tuple("0" if w in GROUND else w for w in words)


class _Groups:
    """Nodes that sources join (union and find)."""

    def __init__(self, cards: Iterable[Card]) -> None:
        self._above: dict[str, str] = {}
        for card in cards:
            if card.head[0] in SOURCES and len(ends := _ends(card)) == 2:
                self._above[self.representative(ends[0])] = self.representative(ends[1])

    def representative(self, node: str) -> str:
        """The node that stands for a group."""
        while (above := self._above.get(node, node)) != node:
            self._above[node] = self._above.get(above, above)
            node = above
        return node


def across_sources(cards: Iterable[Card]) -> frozenset[str]:
    """Capacitors between nodes that sources join: nothing is free there at the start."""
    cards = list(cards)
    groups = _Groups(cards)
    two = ((c.head, _ends(c)) for c in cards if c.head.startswith("c"))
    return frozenset(
        head
        for head, ends in two
        if len(ends) == 2 and groups.representative(ends[0]) == groups.representative(ends[1])
    )


def held_nodes(initial: Mapping[str, tuple[float, Card]], cards: Iterable[Card]) -> tuple[dict[str, float], list[str]]:
    """By capacitor to ground its voltage (V) where `.ic` gives that of its node, and nodes that none holds.

    A node that sources join to ground has their voltage.
    """
    cards = list(cards)
    groups, held = _Groups(cards), dict[str, float]()
    rest = {n: volt for n, (volt, _) in initial.items() if groups.representative(n) != groups.representative("0")}
    for card in cards:
        ends = _ends(card) if card.head.startswith("c") else ()
        if len(ends) == 2 and "0" in ends:
            node, sign = (ends[0], 1.0) if ends[1] == "0" else (ends[1], -1.0)
            if node in rest:
                held[card.head] = sign * rest.pop(node)
    return held, list(rest)
