"""Statements of a routine with less arithmetic: what differs by a sign or a power of two is one value, and a product
that stands in several products is made once.

Signs and powers of two change no digit; products that are joined differently round differently, in the last places.
Statements of folds stay as they are.
"""

from __future__ import annotations

import heapq
import math
from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import replace
from typing import Any

from sysdyn.compiler.program.program import Assign, Fold, Operand, Routine, Statement, StoreInstruction

POWER = 3
"""The largest whole power that is written as products (notation.py)."""
LARGEST = 2.0**16
"""Factors beyond are left where they stand: nothing overflows that did not."""
_READ = frozenset(("y", "yd", "p", "element", "time", "index"))


def share_operations(routine: Routine) -> Routine:
    """A routine of the same values but for round-off, in fewer operations."""
    return replace(routine, body=_drop_unused(_share_factors(_Scaled(routine.body).body)))


def _binary(value: float) -> bool:
    """A power of two, with a sign."""
    return abs(math.frexp(value)[0]) == 0.5 and 1.0 / LARGEST <= abs(value) <= LARGEST


class _Scaled:
    """Each value as a sign and a power of two times one that is made once."""

    def __init__(self, body: Sequence[Statement]) -> None:
        self.body: list[Statement] = []
        self._scale: dict[int, tuple[float, int]] = {}
        """Of a value: factor, value; others are their own."""
        self._made: dict[tuple[Any, ...], int] = {}
        self._next = 1 + max(_targets(body), default=-1)
        for s in body:
            self._take(s)

    def _take(self, s: Statement) -> None:
        """Take over a statement: sums and products scaled, others with whole values."""
        match s:
            case Assign(op="sum"):
                self._sum(s)
            case Assign(op="mul"):
                self._product(s)
            # reads have no arguments
            case Assign() if s.op in _READ:
                self.body.append(s)
            case Assign():
                self.body.append(replace(s, args=tuple(map(self._whole, s.args))))
            case StoreInstruction():
                self.body.append(replace(s, value=self._whole(s.value)))
            # a fold reads values under their own numbers
            case Fold():
                for target in _read(s):
                    self._keep(target)
                self.body.append(s)

    def _scale_of(self, value: Operand) -> tuple[float, Operand]:
        return self._scale.get(value, (1.0, value)) if isinstance(value, int) else (1.0, value)

    def _whole(self, value: Operand) -> Operand:
        """The value itself, made where it is only known by another."""
        scale, own = self._scale_of(value)
        return own if scale == 1.0 else self._make("sum", (0.0, (scale,)), (own,))

    def _keep(self, target: int) -> None:
        """The value under its own number."""
        scale, own = self._scale.pop(target, (1.0, target))
        if own != target:
            self.body.append(Assign(target, "sum", (0.0, (scale,)), (own,)))

    def _make(self, op: str, data: Any, args: tuple[Operand, ...], target: int | None = None) -> int:
        """The number of a value; target: its number where it is new."""
        key = op, data, args
        if key not in self._made:
            if target is None:
                target, self._next = self._next, self._next + 1
            self._made[key] = target
            self.body.append(Assign(target, op, data, args))
        return self._made[key]

    def _is(self, target: int, scale: float, own: int) -> None:
        if (scale, own) != (1.0, target):
            self._scale[target] = scale, own

    def _sum(self, s: Assign) -> None:
        """A sum by its first coefficient: a + b and -2 a - 2 b share one operation."""
        constant, given = s.data
        parts = [self._scale_of(a) for a in s.args]
        coefficients = [c * scale for c, (scale, _) in zip(given, parts, strict=True)]
        args = tuple(own for _, own in parts)
        first = coefficients[0]
        alike = not constant and _binary(first) and len({abs(c) for c in coefficients}) == 1
        scale = first if alike else math.copysign(1.0, first)
        # 2 x is x, scaled
        if len(args) == 1 and alike and isinstance(args[0], int):
            self._is(s.target, first, args[0])
            return
        data = (constant * scale if constant else constant, tuple(c / scale for c in coefficients))
        self._is(s.target, scale, self._make("sum", data, args, s.target))

    def _product(self, s: Assign) -> None:
        """A product without the powers of two in its factors."""
        scale, args = 1.0, []
        for exponent, value in zip(s.data, s.args, strict=True):
            factor, own = self._scale_of(value)
            power = factor**exponent if exponent == int(exponent) else 0.0
            # powers of two are exact: they move into the scale
            if _binary(power) and _binary(scale * power):
                scale *= power
                args.append(own)
            else:
                args.append(self._whole(value))
        self._is(s.target, scale, self._make("mul", tuple(s.data), tuple(args), s.target))


def _share_factors(body: Sequence[Statement]) -> list[Statement]:
    """The pairs of factors that most products share are made once, and the pairs of what is left then."""
    products = [s for s in body if isinstance(s, Assign) and s.op == "mul"]
    factors = {s.target: _factors(s) for s in products}
    new = _pairs(factors, 1 + max(_targets(body), default=-1))
    made: set[int] = set()
    found: list[Statement] = []
    for s in body:
        if isinstance(s, Assign) and s.op == "mul":
            own = factors[s.target]
            for value in own:
                found += _making(value, new, made)
            rest = [(e, a) for e, a in zip(s.data, s.args, strict=True) if not _plain(e, a)]
            counted = Counter(own)
            exponents = (*(float(k) for k in counted.values()), *(e for e, _ in rest))
            s = replace(s, data=exponents, args=(*counted, *(a for _, a in rest)))
        found.append(s)
    return found


def _factors(s: Assign) -> list[int]:
    """What a product is multiplied by, as often as it is."""
    plain = [(_plain(e, a), a) for e, a in zip(s.data, s.args, strict=True)]
    return [a for times, a in plain if isinstance(a, int) for _ in range(times)]


def _plain(exponent: float, value: Operand) -> int:
    """How many times a value is multiplied by; 0: in another way."""
    return int(exponent) if isinstance(value, int) and exponent in range(1, POWER + 1) else 0


def _pairs(factors: dict[int, list[int]], number: int) -> dict[int, tuple[int, int]]:
    """Takes shared pairs out of `factors`, most frequent first; the pairs by their new numbers, from `number` on."""
    where: dict[tuple[int, int], dict[int, int]] = {}
    for target, own in factors.items():
        _note(where, target, own)
    heap = [(-sum(at.values()), pair) for pair, at in where.items()]
    heapq.heapify(heap)
    new: dict[int, tuple[int, int]] = {}
    # a heap with stale counts: an entry that is not up to date goes back
    while heap:
        count, pair = heapq.heappop(heap)
        now = sum(where[pair].values())
        if now < 2:
            continue
        if now != -count:
            heapq.heappush(heap, (-now, pair))
            continue
        touched: set[tuple[int, int]] = set()
        # each product that holds the pair gets the new number in its place
        for target, times in list(where[pair].items()):
            own = factors[target]
            touched |= _note(where, target, own, remove=True)
            for _ in range(times):
                place = min(own.index(pair[0]), own.index(pair[1]))
                own.remove(pair[0])
                own.remove(pair[1])
                own.insert(place, number)
            touched |= _note(where, target, own)
        for other in touched:
            heapq.heappush(heap, (-sum(where[other].values()), other))
        new[number] = pair
        number += 1
    return new


def _note(
    where: dict[tuple[int, int], dict[int, int]], target: int, own: Sequence[int], *, remove: bool = False
) -> set[tuple[int, int]]:
    """Counts the pairs of one product in, or out; these pairs."""
    times = Counter(own)
    values = sorted(times)
    pairs = {(a, b): min(times[a], times[b]) for k, a in enumerate(values) for b in values[k + 1 :]}
    pairs |= {(a, a): n // 2 for a, n in times.items() if n > 1}
    for pair, n in pairs.items():
        if remove:
            del where[pair][target]
        else:
            where.setdefault(pair, {})[target] = n
    return set(pairs)


def _making(value: int, new: dict[int, tuple[int, int]], made: set[int]) -> list[Statement]:
    """The products of pairs that a value is made of, those that are not there yet."""
    if value not in new or value in made:
        return []
    made.add(value)
    a, b = new[value]
    before = [*_making(a, new, made), *_making(b, new, made)]
    data, args = ((2.0,), (a,)) if a == b else ((1.0, 1.0), (a, b))
    return [*before, Assign(value, "mul", data, args)]


def _read(s: Statement) -> set[int]:
    """Numbers of the values that a statement reads, of its own ones too."""
    match s:
        case Assign():
            read: Iterable[Operand] = s.args
        case Fold():
            read = (s.value, *(a for inner in s.body for a in _read(inner)))
        case StoreInstruction():
            read = (s.value,)
    return {a for a in read if isinstance(a, int)}


def _targets(body: Sequence[Statement]) -> Iterable[int]:
    for s in body:
        if isinstance(s, Assign | Fold):
            yield s.target
        if isinstance(s, Fold):
            yield from _targets(s.body)


def _drop_unused(body: Sequence[Statement]) -> tuple[Statement, ...]:
    """The statements without those whose value nobody reads."""
    found: list[Statement] = []
    used: set[int] = set()
    for s in reversed(body):
        if isinstance(s, StoreInstruction) or s.target in used:
            used |= _read(s)
            found.append(s)
    return tuple(reversed(found))
