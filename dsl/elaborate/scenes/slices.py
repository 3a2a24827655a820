"""Slices in what a scene traces and sets: `trace x[1..n], x[1..n]', cell[1..3].c.e` is each element by its name."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator
from dataclasses import replace

from sysdyn.dsl.elaborate.elaborate import Elaborator
from sysdyn.dsl.model import budget
from sysdyn.dsl.model import expression as ex
from sysdyn.dsl.tree import syntax

_ON_A_PATH = (syntax.Item, syntax.Member, syntax.Prime)


def ranges_of(path: syntax.Expr) -> tuple[syntax.Range, ...]:
    """The ranges among the indices of a path, from left to right; none where it is no path."""
    found: list[syntax.Range] = []
    while isinstance(path, _ON_A_PATH):
        if isinstance(path, syntax.Item):
            found[:0] = [i for i in path.indices if isinstance(i, syntax.Range)]
        path = path.base
    return tuple(found) if isinstance(path, syntax.Name) else ()


def element_of(path: syntax.Expr, at: dict[syntax.Range, int]) -> syntax.Expr:
    """The path with numbers in the places of its ranges."""
    if not isinstance(path, _ON_A_PATH):
        return path
    base = element_of(path.base, at)
    if not isinstance(path, syntax.Item):
        return replace(path, base=base)
    indices = (
        syntax.Number(float(at[i]), str(at[i]), i.span) if isinstance(i, syntax.Range) else i for i in path.indices
    )
    return replace(path, base=base, indices=tuple(indices))


def each_of(model: Elaborator, written: syntax.Expr) -> Iterator[tuple[syntax.Expr, tuple[int, ...]]]:
    """Each element of `x[1..n].e` with its indices; any other expression itself, with none."""
    ranges = ranges_of(written)
    numbers = [range(bound_of(model, r.lower), bound_of(model, r.upper) + 1) for r in ranges]
    if ranges:
        text = " ".join(model.resolver.source.text[written.span.start : written.span.end].split())[:40]
        budget.charge(budget.NODE * math.prod(map(len, numbers)), f"each element of '{text}'")
    for at in itertools.product(*numbers):
        yield (element_of(written, dict(zip(ranges, at, strict=True))) if at else written), at


def bound_of(model: Elaborator, bound: syntax.Expr) -> int:
    """A bound of a slice, with the sizes that the scene and the command give."""
    node = model.resolver.with_sizes(model.resolver.whole_number(bound, "a bound"))
    if not ex.is_const(node):
        raise model.resolver.fail("E807", "the bound of a slice depends on something without a value", bound.span)
    return int(node.data)
