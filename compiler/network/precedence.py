"""Initial values of one unknown said at several places: what stands further outside goes before (language, 11, 34).

A scene's statement replaces the model's, the model's that of a component inside, for the elements that it is about.
Two quantities of one store, content and effort or momentum and flow, are one statement.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

from sysdyn.compiler.network.primal.bounds import Sizes
from sysdyn.compiler.network.primal.overlaps import beside, meeting, narrowed, ranges_of
from sysdyn.dsl.model.network import Initial, Network

_SAME = {"be": "bq", "bp": "bf", "p": "f", "np": "nf"}


def outermost(network: Network) -> Network:
    """The network with every initial value that another replaces left out, element by element."""
    said: dict[tuple[str, str], list[Initial]] = {}
    for initial in network.initials:
        if initial.target.op == "var" and not initial.target.data[2]:
            said.setdefault(_key(initial), []).append(initial)
    if all(len({i.depth for i in found}) == 1 for found in said.values()):
        return network
    sizes = Sizes(network)
    kept = [part for i in network.initials for part in _left(i, said, sizes)]
    return replace(network, initials=tuple(kept))


def _key(initial: Initial) -> tuple[str, str]:
    name, kind, _ = initial.target.data
    return name, _SAME.get(kind, kind)


def _left(initial: Initial, said: dict[tuple[str, str], list[Initial]], sizes: Sizes) -> Iterator[Initial]:
    """What no statement further outside is about."""
    others: Sequence[Initial] = ()
    if initial.target.op == "var" and not initial.target.data[2]:
        others = [i for i in said[_key(initial)] if i.depth < initial.depth]
    if not others:
        yield initial
        return
    within = ranges_of(initial.loops, sizes, initial.place)
    holes = [m[0] for other in others if (m := meeting(other, initial.target.args, within, sizes))]
    if not initial.loops:
        yield from () if holes else (initial,)
        return
    for rest in beside(within, holes):
        yield replace(initial, loops=narrowed(initial.loops, rest))
