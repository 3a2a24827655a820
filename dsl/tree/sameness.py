"""Whether two syntax trees say the same, their places and comments aside."""

from __future__ import annotations

from dataclasses import fields, is_dataclass
from typing import Any

_PLACES = frozenset({"span", "source", "comments"})


def same_tree(left: Any, right: Any) -> bool:
    """Compare two nodes (or tuples of nodes) by content; iterative, so depth does not matter."""
    return first_difference(left, right) is None


def first_difference(left: Any, right: Any) -> tuple[Any, Any] | None:
    """The first pair of parts that differ, in no particular order; None where there is none."""
    stack = [(left, right)]
    while stack:
        one, other = stack.pop()
        # another kind of node
        if type(one) is not type(other):
            return one, other
        # statements of a body, terms of a sum
        if isinstance(one, tuple):
            if len(one) != len(other):
                return one, other
            stack.extend(zip(one, other, strict=True))
        # fields, places left out
        elif is_dataclass(one):
            kind: type[Any] = type(one)
            stack.extend((getattr(one, name), getattr(other, name)) for name in _contents(kind))
        elif one != other:
            return one, other
    return None


_CONTENTS: dict[type[Any], tuple[str, ...]] = {}


def _contents(kind: type[Any]) -> tuple[str, ...]:
    """The fields of a node that are not places."""
    if kind not in _CONTENTS:
        _CONTENTS[kind] = tuple(field.name for field in fields(kind) if field.name not in _PLACES)
    return _CONTENTS[kind]
