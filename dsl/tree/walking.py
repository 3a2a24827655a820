"""The nodes of a tree, one level at a time."""

from __future__ import annotations

from collections.abc import Iterator

_SYNTAX = "sysdyn.dsl.tree.syntax"


def children(node: object) -> Iterator[object]:
    """The syntax nodes directly below one; pairs as those of sums and products are opened."""
    for name in getattr(type(node), "__slots__", ()):
        child = getattr(node, name)
        for part in child if isinstance(child, tuple) else (child,):
            for item in part if isinstance(part, tuple) else (part,):
                if _is_syntax(type(item)):
                    yield item


_KNOWN: dict[type, bool] = {}


def _is_syntax(kind: type) -> bool:
    if kind not in _KNOWN:
        _KNOWN[kind] = kind.__module__.startswith(_SYNTAX)
    return _KNOWN[kind]
