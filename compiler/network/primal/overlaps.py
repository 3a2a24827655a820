"""Where a statement about a family meets elements that run over loops of their own, exactly: with the network's sizes.

Bounds stay symbolic; values decide which of two is the narrower (as everywhere in `primal`).
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from sysdyn.compiler.network.primal.bounds import Interval, WholeNumbers, box_difference
from sysdyn.dsl.model.expression import Node, both, compare, conditional, const, index, sub, substitute
from sysdyn.dsl.model.network import InitialCondition, Loop
from sysdyn.dsl.text.diagnostics import ModelError, Place

Ranges = dict[str, Interval]


def ranges_of(loops: Sequence[Loop], sizes: WholeNumbers, place: Place) -> Ranges:
    """The values of loop variables."""
    return {loop.index: sizes.interval(loop.first, loop.last, place) for loop in loops}


def restrict_loops(loops: Sequence[Loop], within: Ranges) -> tuple[Loop, ...]:
    """The loops over these ranges."""
    pairs = [(loop.index, within[loop.index]) for loop in loops]
    return tuple(Loop(name, i.first.node, i.last.node) for name, i in pairs)


def meeting(
    initial: InitialCondition, at: Sequence[Node], within: Ranges, sizes: WholeNumbers
) -> tuple[Ranges, Node] | None:
    """The part of the ranges in which elements `at` are those that the statement is about, and its value there.

    None where there is no such part, or where indices do not tell it (no i + c).
    """
    found = dict(within)
    change: dict[Node, Node] = {}
    try:
        own = ranges_of(initial.loops, sizes, initial.place)
        # index by index: both numbers or loop variables with a shift
        for said, asked in zip(initial.target.args, at, strict=True):
            a, b = sizes.affine(said, own, initial.place), sizes.affine(asked, within, initial.place)
            reach = Interval(a.offset, a.offset) if a.loop is None else own[a.loop].plus(a.offset)
            if a.loop is not None:
                if index(a.loop) in change:
                    return None
                change[index(a.loop)] = sub(asked, a.offset.node)
            # a number must lie in the statement's range
            if b.loop is None:
                if not reach.holds(Interval(b.offset, b.offset)):
                    return None
                continue
            # ranges must meet
            shared = found[b.loop].common(reach.minus(b.offset))
            if not shared.size:
                return None
            found[b.loop] = shared
    except ModelError:
        return None
    for name, values in own.items():  # of a loop over one element alone, which the statement names by its number
        if values.size != 1 and index(name) not in change:
            return None
        change.setdefault(index(name), values.first.node)
    return found, substitute(initial.value, change)


def untold(
    initials: Sequence[InitialCondition], at: Sequence[Node], within: Ranges, sizes: WholeNumbers
) -> Iterator[Ranges]:
    """The parts of the ranges in which no statement is about elements `at`."""
    found = (meeting(initial, at, within, sizes) for initial in initials)
    holes = (tuple(m[0].values()) for m in found if m is not None)
    yield from (dict(zip(within, box, strict=True)) for box in box_difference(tuple(within.values()), *holes))


def initially(
    initials: Sequence[InitialCondition], at: Sequence[Node], within: Ranges, sizes: WholeNumbers
) -> Node | None:
    """What statements of one family, of which no two are about one element (`precedence`), say of its elements `at`:
    the value over the ranges, zero where nothing is said; None where nothing is.
    """
    value: Node | None = None
    for initial in initials:
        found = meeting(initial, at, within, sizes)
        if found is not None:
            value = inside(found[0], within, found[1], value or const(0.0))
    return value


def inside(part: Ranges, within: Ranges, value: Node, other: Node) -> Node:
    """The value in that part of the ranges, the other elsewhere."""
    named = [(index(name), i) for name, i in part.items() if not i.holds(within[name])]
    low = [compare("<=", i.first.node, k) for k, i in named]
    high = [compare("<=", k, i.last.node) for k, i in named]
    return conditional(both(*low, *high), value, other) if named else value
