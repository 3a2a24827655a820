"""Initial values of one unknown said at several places: each element keeps the statement that goes before the others.

What stands further outside goes before (language, 11, 34): a scene's statement replaces the model's, the model's that
of a component inside.  At one depth a fixed value goes before a guess, a later guess before an earlier one; two fixed
values both stay, since they may contradict each other.  Content and effort of one potential store are one statement,
momentum and flow of one kinetic store or coordinate too.
"""

from __future__ import annotations

import math
from bisect import bisect_left, bisect_right
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace

from sysdyn.compiler.network.primal.bounds import WholeNumbers
from sysdyn.compiler.network.primal.overlaps import ranges_of, restrict_loops, untold
from sysdyn.dsl.model.network import Branch, InitialCondition, Network
from sysdyn.dsl.text.diagnostics import ModelError

_SAME = {"p": "f", "np": "nf"}
_OF_STORE = {("potential", "be"): "bq", ("kinetic", "bp"): "bf"}

_Key = tuple[str, str]
_Ranked = tuple[int, InitialCondition]
"""A statement with its place in the order of the text."""


def outermost(network: Network) -> Network:
    """The network with every initial value that another replaces left out, element by element."""
    return replace(network, initials=foremost(network.initials, network.branches, WholeNumbers(network)))


def foremost(
    initials: Sequence[InitialCondition], branches: Sequence[Branch], sizes: WholeNumbers
) -> tuple[InitialCondition, ...]:
    """The initial values that no other replaces, cut where others are about a part of their elements."""
    kinds = {b.name: b.kind for b in branches}
    said: dict[_Key, list[_Ranked]] = {}
    for k, initial in enumerate(initials):
        if _of_an_unknown(initial):
            said.setdefault(_key(initial, kinds), []).append((k, initial))
    if all(len(found) == 1 for found in said.values()):
        return tuple(initials)
    books = {key: _Statements(found, sizes) for key, found in said.items()}
    kept: list[InitialCondition] = []
    for k, initial in enumerate(initials):
        book = books[_key(initial, kinds)] if _of_an_unknown(initial) else None
        kept += [initial] if book is None else _remaining_parts(initial, book.before((k, initial)), sizes)
    return tuple(kept)


def _of_an_unknown(initial: InitialCondition) -> bool:
    return initial.target.op == "var" and not initial.target.data[2]


def _key(initial: InitialCondition, kinds: Mapping[str, str]) -> _Key:
    name, kind, _ = initial.target.data
    return name, _SAME.get(kind) or _OF_STORE.get((kinds.get(name, ""), kind), kind)


class _Statements:
    """Those of one family; what names one element by itself is found by its indices."""

    def __init__(self, found: Sequence[_Ranked], sizes: WholeNumbers) -> None:
        self.sizes = sizes
        self.running = [item for item in found if item[1].loops]
        single = [(self._reach(item[1])[0], item) for item in found if not item[1].loops]
        single.sort(key=lambda pair: pair[0])
        self.single = [item for _, item in single]
        self.at = [at for at, _ in single]

    def _reach(self, initial: InitialCondition) -> tuple[tuple[float, ...], tuple[float, ...]]:
        """The least and the greatest of each index; all there is where a range follows another index."""
        try:
            within = ranges_of(initial.loops, self.sizes, initial.place)
            box = self.sizes.reach(initial.target.args, within, initial.place)
        except ModelError:
            return (), (math.inf,)
        return tuple(i.first.value for i in box), tuple(i.last.value for i in box)

    def before(self, one: _Ranked) -> list[InitialCondition]:
        """The statements that go before one and may be about its elements."""
        low, high = self._reach(one[1])
        near = self.single[bisect_left(self.at, low) : bisect_right(self.at, high)]
        above = [other for k, other in (*self.running, *near) if _rank(k, other) < _rank(*one)]
        return [other for other in above if not one[1].fixed or other.depth < one[1].depth]


def _rank(k: int, initial: InitialCondition) -> tuple[int, bool, int]:
    return initial.depth, not initial.fixed, -k


def _remaining_parts(
    initial: InitialCondition, others: Sequence[InitialCondition], sizes: WholeNumbers
) -> Iterator[InitialCondition]:
    """What no statement that goes before is about."""
    within = ranges_of(initial.loops, sizes, initial.place)
    for rest in untold(others, initial.target.args, within, sizes):
        yield replace(initial, loops=restrict_loops(initial.loops, rest))
