"""Slices in what a scene traces: `trace x[1..n], x[1..n]', cell[1..3].c.e` is each element by its name."""

from __future__ import annotations

from dataclasses import replace

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
