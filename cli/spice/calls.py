"""Which subcircuits a netlist uses: what they read of the parameters around them, which shared nodes they reach."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import field

from sysdyn.cli.spice.circuit import GROUND, Circuit, Netlist
from sysdyn.cli.spice.netlist import Card, UnreadableCard
from sysdyn.cli.spice.parameters import read
from sysdyn.values import dataclass

DEEPEST = 200
"""Subcircuits within each other, as deep as brackets of the language."""
UNITS = {"r": "ohm", "c": "F", "l": "H"}
"""Units of parameters that stand alone as the value of an element."""


@dataclass(slots=True)
class CircuitUse:
    """What a circuit is for those that call it.

    reads: names of parameters that its text and what it calls read; named: by parameter that stays one, its unit;
    ports: nodes that a call gives, and shared ones that it reaches; height: levels of subcircuits below it.
    """

    nodes: tuple[str, ...]
    calls: tuple[tuple[Card, Circuit], ...]
    reads: set[str] = field(default_factory=set)
    named: dict[str, str] = field(default_factory=dict)
    ports: tuple[str, ...] = ()
    height: int = 0


class CircuitCalls:
    """All circuits that the top reaches, each behind those that it calls.  Unreadable, with its card."""

    def __init__(self, netlist: Netlist) -> None:
        self.shared = netlist.shared
        self.uses: dict[Circuit, CircuitUse] = {}
        names = _parameters(netlist.top)
        way, on = [netlist.top], {netlist.top}
        opened: dict[Circuit, tuple[CircuitUse, Iterator[tuple[Card, Circuit]]]] = {}
        # depth first: a circuit after those that it calls
        while way:
            circuit = way[-1]
            if circuit not in opened:
                use = CircuitUse(
                    tuple(dict.fromkeys(n for c in circuit.elements.values() for n in nodes(c))), _calls(circuit)
                )
                opened[circuit] = use, iter(use.calls)
            use, rest = opened[circuit]
            call = next(rest, None)
            if call is None:
                self._finish(circuit, use, names)
                on.discard(way.pop())
            # a subcircuit that contains itself
            elif call[1] in on:
                raise _unreadable(call[0], f"'{call[1].name}' is inside itself")
            elif call[1] not in self.uses:
                way.append(call[1])
                on.add(call[1])

    def _finish(self, circuit: Circuit, use: CircuitUse, names: set[str]) -> None:
        """What a circuit is when all that it calls is known."""
        inner = [self.uses[c] for c in dict.fromkeys(c for _, c in use.calls)]
        use.height = 1 + max((u.height for u in inner), default=0)
        if use.height > DEEPEST:
            raise _unreadable(use.calls[0][0], f"subcircuits are within each other more than {DEEPEST} deep")
        elsewhere, alone = _readings(circuit, names)
        elsewhere = elsewhere.union(*(u.reads for u in inner))
        use.reads = elsewhere | alone.keys()
        use.named = {n: u for n, u in alone.items() if u and n in circuit.parameters and n not in elsewhere}
        reached = dict.fromkeys(n for n in use.nodes if n in self.shared and n not in GROUND)
        reached |= dict.fromkeys(n for u in inner for n in u.ports if n in self.shared)
        own = (p for p in circuit.ports if p not in GROUND and p not in self.shared)
        use.ports = (*own, *reached) if circuit.parent is not None else ()
        use.nodes = tuple(dict.fromkeys((*use.nodes, *reached)))
        self.uses[circuit] = use


def call(card: Card) -> tuple[str, list[str], list[str]]:
    """`X1 a b NAME p=1`: the subcircuit, the nodes, the words of what is given."""
    words = [w for w in card.words if w not in ("params", "params:", ":", "(", ")", ",")]
    first = next((k - 1 for k, w in enumerate(words) if w == "="), len(words))
    return words[first - 1], words[1 : first - 1], words[first:]


def nodes(card: Card) -> list[str]:
    """Nodes of a card."""
    letter = card.head[0]
    if letter == "x":
        return call(card)[1]
    words = [w for w in card.words if w not in ("(", ")", ",")]
    count = {"e": 4, "g": 4, "q": 3, "m": 3, "k": 0}.get(letter, 2)
    if letter in "eg" and words[3:4] == ["poly"]:
        count = int(words[4][:6]) if len(words) > 4 and words[4].isdecimal() else 0
        return [*words[1:3], *words[5 : 5 + 2 * count]]
    return words[1 : 1 + count]


def _calls(circuit: Circuit) -> tuple[tuple[Card, Circuit], ...]:
    """The calls of a circuit whose subcircuit there is."""
    cards = (c for c in circuit.elements.values() if c.head.startswith("x"))
    return tuple((c, found) for c in cards if (found := circuit.find(call(c)[0])) is not None)


def _parameters(top: Circuit) -> set[str]:
    """Names of all parameters of a netlist."""
    found, left = set[str](), [top]
    while left:
        circuit = left.pop()
        found.update(circuit.parameters)
        left += circuit.inner.values()
    return found


def _readings(circuit: Circuit, names: set[str]) -> tuple[set[str], dict[str, str]]:
    """Parameters that the text of a circuit reads, and those that are the whole value of elements of one unit ('':
    of several).
    """
    elsewhere = {n for p in circuit.parameters.values() for n in read(p.text)}
    for around in circuit.enclosing:
        if around.parent is not None or around is circuit:
            elsewhere.update(n for m in around.models.values() for text in m.values.values() for n in read(text))
    alone = dict[str, str]()
    for card in circuit.elements.values():
        words, unit = card.words[2:], UNITS.get(card.head[0])
        whole = card.words[3].strip("{}'").strip() if unit and len(card.words) > 3 else ""
        if unit and whole in names:
            alone[whole] = unit if alone.get(whole, unit) == unit else ""
            words = card.words[4:]
        elsewhere.update(n for w in words for n in read(w))
    return elsewhere & names, {n: u for n, u in alone.items() if n in names}


def _unreadable(card: Card, reason: str) -> UnreadableCard:
    error = UnreadableCard(reason)
    error.card = card
    return error
