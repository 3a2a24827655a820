"""Labels that are constant while a text is smooth in time, and the doubles at which they change.

Received: an operation of time alone, and iterations of its loops; returned: its label at any time, and of brackets in
which it changes the first double of the new one.  Round-off turns a label to and fro about there, where its argument is
a difference of two that move: a step ends before the first of these doubles and begins behind the last.  A restart
between them found the old label, and a whole step of an explicit method was of that (an inductance behind a comparator
of a sine and a saw in the complementary forms: one in ten was off by up to 6 %, told as met).
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray
from sysdyn.compiler.model.interpret import Value, evaluate
from sysdyn.compiler.model.terms import Nest
from sysdyn.dsl.model.expression import Node, topological
from sysdyn.values import dataclass

Array = NDArray[np.float64]
Whole = NDArray[np.int64]
Label = Callable[[list[Array]], Array]

JUMP = 1e-9
"""Of a value: what it differs by less right behind an instant is no jump."""
AROUND = np.concatenate([np.arange(1.0, 17.0), np.rint(np.geomspace(20.0, 2.0**24, 60))])[:, None]
"""Distances from a flip, in doubles, at which it is asked whether round-off turns the label to and fro there."""
EXACT = frozenset(("abs", "sign", "step", "floor", "ceil", "min", "max", "mod", "sqrt"))
"""Functions that every library takes alike."""
OTHERS = 4.0
"""Of these distances: what another function differs by in the library that generated code calls."""
_HALVINGS = 1100


@dataclass(frozen=True, slots=True)
class TimedOperation:
    """An operation that changes in time alone: its arguments, its label, and where the label of an affine argument
    changes: levels of the argument (None: at whole numbers).
    """

    node: Node
    arguments: tuple[Node, ...]
    label: Label
    levels: Array | None
    nest: Nest


class Labels:
    """The label of one operation at any iteration and time."""

    def __init__(self, watched: TimedOperation, columns: dict[str, Array], lookup: Callable[..., Value]) -> None:
        self._watched, self._columns, self._lookup = watched, columns, lookup

    def _values(self, index: Whole, t: Array, nodes: tuple[Node, ...] | None = None) -> list[Array]:
        """Of the arguments, or of other nodes."""

        def look(node: Node, args: list[Value]) -> Value:
            if node.op == "time":
                return t
            if node.op == "index" and node.data in self._columns:
                return self._columns[node.data][index]
            return self._lookup(node, args)

        found = evaluate(nodes or self._watched.arguments, look)
        return [np.broadcast_to(np.asarray(v, dtype=float), t.shape) for v in found]

    def labels_at(self, index: Whole, t: Array) -> Array:
        """Labels [k] in iterations index [k] at t [k]."""
        with np.errstate(all="ignore"):
            return np.nan_to_num(self._watched.label(self._values(index, t)))

    def jumps(self, index: Whole, t: float, later: float) -> bool:
        """Whether the operation has another value right behind t (s), in any of the iterations; beside its value at
        `later` (s).
        """
        if self._watched.node.op == "table":  # of those that jump, what holds behind an instant holds at it
            return False
        times = (np.full(index.size, instant) for instant in (t, np.nextafter(t, np.inf), later))
        at, behind, beyond = (self._values(index, instants, (self._watched.node,))[0] for instants in times)
        return bool((np.abs(behind - at) > JUMP * np.maximum(np.abs(at), np.abs(beyond))).any())

    def measure(self, index: Whole, t: Array, *, quotient: bool) -> Array:
        """What crosses the levels: the argument, the difference or the quotient of the two."""
        values = self._values(index, t)
        with np.errstate(all="ignore"):
            if len(values) == 1:
                return values[0].copy()
            return values[0] / values[1] if quotient else values[0] - values[1]

    def bisect(self, index: Whole, low: Array, high: Array, early: float) -> Array:
        """The first double of the new label in each bracket; where a zero lies between, the last of it too.  Up to
        `early` any will do.
        """
        start, end = self.labels_at(index, low), self.labels_at(index, high)
        take = start != end
        index, low, high, start, end = index[take], low[take], high[take], start[take], end[take]
        first = self._flip(index, low, high, start, early)
        middle = self.labels_at(index, first)
        again = middle != end
        last = self._flip(index[again], first[again], high[again], middle[again], early)
        # a zero on a single double: the far side begins behind it, which the restart knows
        last = np.where(np.nextafter(first[again], np.inf) == last, first[again], np.nextafter(last, -np.inf))
        return np.concatenate([first, last, *self._chatter(index, first, low, high, (start, end))])

    def _chatter(self, index: Whole, first: Array, low: Array, high: Array, sides: tuple[Array, Array]) -> list[Array]:
        """Doubles around each flip between which round-off turns the label to and fro: before the first of another
        label than that of before, behind the last of another than that of behind.
        """
        nodes = topological(self._watched.arguments)
        exact = all(n.op != "call" or n.data in EXACT for n in nodes)
        found: list[Array] = []
        for way, side in zip((-1.0, 1.0), sides, strict=True):
            t = np.clip(first + way * AROUND * np.spacing(first), low, high)
            label = self.labels_at(np.tile(index, len(AROUND)), t.ravel()).reshape(t.shape)
            astray = np.where(label != side, AROUND, 0.0 if exact else OTHERS).max(axis=0)
            found.append(np.clip(first + 2.0 * way * astray * np.spacing(first), low, high))  # some may lie between
        return found

    def _flip(self, index: Whole, low: Array, high: Array, start: Array, early: float) -> Array:
        """The first double whose label is not `start` any more."""
        low, high = low.copy(), high.copy()
        for _ in range(_HALVINGS):
            middle = low + 0.5 * (high - low)
            open_ = np.flatnonzero((middle > low) & (middle < high) & (high > early))
            if not open_.size:
                break
            same = self.labels_at(index[open_], middle[open_]) == start[open_]
            low[open_[same]] = middle[open_[same]]
            high[open_[~same]] = middle[open_[~same]]
        return high
