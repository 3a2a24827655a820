"""Places of a graph's vertices in a drawing: layers by distance, order by the mean of neighbours (Sugiyama 1981).

Nodes touch elements only and elements nodes only, so distance from a start gives layers between which every edge spans
one.  Components of the graph stand below each other.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Mapping, Sequence
from itertools import pairwise

SWEEPS = 12
GAP = 1.0
"""Of the places of two vertices in one layer, where each takes the room `size`."""


def places(neighbours: Mapping[str, Sequence[str]], size: Mapping[str, float]) -> dict[str, tuple[int, float]]:
    """(layer, position) of each vertex; positions in units of `size`."""
    found: dict[str, tuple[int, float]] = {}
    below = 0.0
    left = dict.fromkeys(neighbours)
    # one connected part below the other
    while left:
        # from an end of a long path: layers are then narrow
        start = _end(neighbours, next(iter(left)))
        layers = _layers(neighbours, start)
        for layer in layers:
            for vertex in layer:
                left.pop(vertex, None)
        _order(layers, neighbours)
        y = _positions(layers, neighbours, size)
        top = min(y[v] - size[v] / 2 for v in y)
        for k, layer in enumerate(layers):
            for vertex in layer:
                found[vertex] = (k, y[vertex] - top + below)
        below = max(found[v][1] + size[v] / 2 for v in y) + GAP / 2
    return found


def _layers(neighbours: Mapping[str, Sequence[str]], start: str) -> list[list[str]]:
    """Vertices by their distance from the start."""
    depth = {start: 0}
    work = deque([start])
    layers = [[start]]
    while work:
        vertex = work.popleft()
        for other in neighbours[vertex]:
            if other not in depth:
                depth[other] = depth[vertex] + 1
                if depth[other] == len(layers):
                    layers.append([])
                layers[depth[other]].append(other)
                work.append(other)
    return layers


def _end(neighbours: Mapping[str, Sequence[str]], vertex: str) -> str:
    """A vertex at an end of the longest way through the component: the first of the farthest layer."""
    for _ in range(2):
        vertex = _layers(neighbours, vertex)[-1][0]
    return vertex


def _order(layers: list[list[str]], neighbours: Mapping[str, Sequence[str]]) -> None:
    """Fewer crossings: each layer in the order of the means of its neighbours, to and fro."""
    place = {v: k for layer in layers for k, v in enumerate(layer)}
    for sweep in range(SWEEPS):
        forward = sweep % 2 == 0
        pairs = range(1, len(layers)) if forward else range(len(layers) - 2, -1, -1)
        for k in pairs:
            fixed = set(layers[k - 1] if forward else layers[k + 1])
            means = {v: _mean([place[u] for u in neighbours[v] if u in fixed], place[v]) for v in layers[k]}
            layers[k].sort(key=means.__getitem__)
            place |= {v: j for j, v in enumerate(layers[k])}


def _positions(
    layers: Sequence[Sequence[str]], neighbours: Mapping[str, Sequence[str]], size: Mapping[str, float]
) -> dict[str, float]:
    """Each vertex near the mean of its neighbours, none over another, the order kept."""
    y: dict[str, float] = {}
    # stacked at first
    for layer in layers:
        at = 0.0
        for vertex in layer:
            y[vertex] = at + size[vertex] / 2
            at += size[vertex]
    # then drawn towards the neighbours, back and forth
    for _ in range(3 * SWEEPS):
        for layer in layers:
            wanted = [_mean([y[u] for u in neighbours[v]], y[v]) for v in layer]
            for vertex, at in zip(layer, _space_out(wanted, [size[v] for v in layer]), strict=True):
                y[vertex] = at
    return y


def _mean(values: Sequence[float], default: float) -> float:
    return sum(values) / len(values) if values else default


def _space_out(wanted: Sequence[float], size: Sequence[float]) -> list[float]:
    """The places nearest to those wanted at which neighbours do not overlap: pool adjacent violators."""
    shift, total = [0.0], 0.0
    for a, b in pairwise(size):
        total += (a + b) / 2
        shift.append(total)
    blocks: list[list[float]] = []  # sum, count
    for w, s in zip(wanted, shift, strict=True):
        blocks.append([w - s, 1.0])
        while len(blocks) > 1 and blocks[-2][0] / blocks[-2][1] > blocks[-1][0] / blocks[-1][1]:
            last = blocks.pop()
            blocks[-1] = [blocks[-1][0] + last[0], blocks[-1][1] + last[1]]
    means = [block[0] / block[1] for block in blocks for _ in range(int(block[1]))]
    return [m + s for m, s in zip(means, shift, strict=True)]
