"""Names in the order of their dependence: what others are written in stands before these."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator


def in_order(names: Iterable[str], uses: Callable[[str], Iterable[str]]) -> tuple[list[str], list[tuple[str, ...]]]:
    """All names and what they use, each behind what it uses and else as they come; circles: a name, what it uses and so
    on, back to the name.
    """
    order: list[str] = []
    circles: list[tuple[str, ...]] = []
    done: set[str] = set()
    for name in names:
        way: dict[str, Iterator[str]] = {} if name in done else {name: iter(uses(name))}
        # depth first, without recursion: chains of definitions may be long
        while way:
            last = next(reversed(way))
            following = next(way[last], None)
            # all that it uses is done
            if following is None:
                del way[last]
                done.add(last)
                order.append(last)
            # it is being done: a circle
            elif following in way:
                around = list(way)
                circles.append((*around[around.index(following) :], following))
            elif following not in done:
                way[following] = iter(uses(following))
    return order, circles
