"""K cards -> the coils of a core as one element: mutual inductances k sqrt(Li Lj) beside what each coil has alone."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from itertools import combinations

from sysdyn.cli.spice.devices import CircuitScope, DeviceText, details, enough, number_of
from sysdyn.cli.spice.netlist import Card, UnreadableCard, value
from sysdyn.cli.spice.writing import plain, quantity

Factors = dict[tuple[str, str], str]
"""Coupling factors by two coils."""


def _coils_and_factor(card: Card, coils: Mapping[str, Card]) -> tuple[tuple[str, ...], str]:
    """`K1 L1 L2 ... k`: coils and the factor of any two of them."""
    words = enough(card, 4)
    names, factor = words[1:-1], words[-1]
    if any(w not in coils for w in names) or len(set(names)) < len(names):
        raise UnreadableCard(f"'{card.text[:60]}': two coils of this circuit or more and a factor are wanted")
    return names, factor


def _twos(coils: Sequence[str]) -> list[tuple[str, str]]:
    """All that are two of them."""
    return list(combinations(sorted(coils), 2))


class Cores:
    """The cores of a circuit: cards that share coils, directly or by others, and what they couple.

    branches: by coil on a core, the name of the first of its cards, which writes it, and the coil's branch there.
    """

    def __init__(self, cards: Sequence[Card], coils: Mapping[str, Card]) -> None:
        self.coils, self._said = coils, dict[str, tuple[tuple[str, ...], str]]()
        self._again: dict[str, tuple[str, str]] = {}
        self._core: dict[str, tuple[str, list[str], Factors]] = {}
        self.branches: dict[str, tuple[str, str]] = {}
        before, on = set[tuple[str, str]](), dict[str, list[str]]()
        # coils that each card couples; two that are coupled twice are an error of the second
        for card in (c for c in cards if c.head.startswith("k")):
            try:
                self._said[card.head] = _coils_and_factor(card, coils)
            except UnreadableCard:
                continue  # told where the card is read
            twos = _twos(self._said[card.head][0])
            if again := before.intersection(twos):
                self._again[card.head] = min(again)
            before.update(twos)
            for coil in self._said[card.head][0]:
                on.setdefault(coil, []).append(card.head)
        place = {head: k for k, head in enumerate(self._said)}
        # cards that share a coil are one core
        for first in self._said:
            if first not in self._core:
                self._gather(first, on, place)

    def _gather(self, first: str, on: Mapping[str, list[str]], place: Mapping[str, int]) -> None:
        """The core of this card, from it by what shares coils with what is there."""
        factors, found, new = Factors(), dict[str, None](), list(self._said[first][0])
        core = first, list[str](), factors
        while new:
            found |= dict.fromkeys(new)
            heads = sorted({h for coil in new for h in on[coil] if h not in self._core}, key=place.__getitem__)
            for head in heads:
                joined, factor = self._said[head]
                self._core[head] = core
                factors |= dict.fromkeys(_twos(joined), factor)
            new = [c for c in dict.fromkeys(c for h in heads for c in self._said[h][0]) if c not in found]
        core[1].extend(found)
        self.branches |= {coil: (first, _branch(k, len(found))) for k, coil in enumerate(found)}

    def core_of(self, card: Card) -> tuple[str, list[str], Factors]:
        """The first card of the core that a card tells of, its coils, their factors.  Unreadable."""
        if card.head not in self._said:
            _coils_and_factor(card, self.coils)
        if again := self._again.get(card.head):
            raise UnreadableCard(f"'{card.head}': {' and '.join(again)} are coupled already")
        return self._core[card.head]


def _branch(k: int, coils: int) -> str:
    return ("one", "two")[k] if coils == 2 else f"c{k + 1}"


def coupled_coils(card: Card, scope: CircuitScope, cores: Cores) -> DeviceText:
    """The coils of a core as one element, at the first of its cards."""
    first, names, factors = cores.core_of(card)
    # the core stands at the first of its cards
    if first != card.head:
        return DeviceText(())
    name, size = scope.name[card.head], len(names)
    strength = {two: value(factor, scope.known) for two, factor in factors.items()}
    if not all(abs(k) <= 1.0 for k in strength.values()):
        raise UnreadableCard(f"'{card.head}': a factor beyond 1")
    whole = any(abs(k) == 1.0 for k in strength.values())  # what two coils carry is one flux: no current is given
    # two coils that are not perfectly coupled: a component of the library
    pair = size == 2 and not whole
    cards_of = [enough(cores.coils[w], 4) for w in names]
    given = [f"L{k} = {number_of(scope, words[3], 'H')}" for k, words in enumerate(cards_of, 1)]
    place = {coil: k for k, coil in enumerate(names, 1)}
    for (i, j), k in sorted((sorted(place[coil] for coil in two), k) for two, k in strength.items()):
        given.append(f"{'k' if pair else f'k{i}_{j}'} = {plain(k)}")
    ends, initial, currents, left = [], [], [], list[str]()
    # each coil as a branch with its initial current
    for k, words in enumerate(cards_of):
        branch = _branch(k, size)
        ends.append(f"{branch} = {scope.node(words[1])} -> {scope.node(words[2])}")
        said = details(words[4:], scope, areas=False)
        left += [*said.unread_words(), *(n for n in ("m", "temp", "dtemp") if n in said.given)]
        currents.append(said.number("ic", scope))
        at = f"f {'~' if whole else '='} {quantity(currents[-1], 'A')}" if scope.uic else "e = 0 V"
        initial.append(f"init {name}.{branch}.{at}")
    # perfectly coupled: the flux is what is given
    if scope.uic and whole and size == 2:
        sizes = [value(words[3], scope.known) for words in cards_of]
        mutual = next(iter(strength.values())) * math.sqrt(math.prod(sizes))
        flux = sizes[0] * currents[0] + mutual * currents[1]
        initial = [f"init {name}.one.p = {quantity(flux, 'Wb')}"]
    kind = "coupled_inductors" if pair else f"coils_{size}"
    line = f"{name}: {kind}({', '.join(given)}) {', '.join(ends)}"
    uses, local = ((kind,), ()) if pair else ((), (kind,))
    return DeviceText((line,), uses, local, tuple(initial), tuple(dict.fromkeys(left)))


def component(size: int) -> str:
    """Coils on one core, any two of them coupled by a factor of their own."""
    numbers = range(1, size + 1)
    of = {i: _branch(i - 1, size) for i in numbers}
    two = [(i, j) for i in numbers for j in range(i + 1, size + 1)]
    return "\n".join([
        "## Coils on one core; k1_2 couples the first and the second.",
        f"component coils_{size} {{",
        *(f"  param L{i}: H" for i in numbers),
        *(f"  param k{i}_{j} = 0" for i, j in two),
        f"  branch {', '.join(of.values())}: electrical",
        *(f"  energy T* = 1/2*L{i}*{of[i]}.f^2" for i in numbers),
        *(f"  energy T* = k{i}_{j}*sqrt(L{i}*L{j})*{of[i]}.f*{of[j]}.f" for i, j in two),
        "}",
        "",
    ])  # fmt: skip
