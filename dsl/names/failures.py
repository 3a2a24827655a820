"""What an expression fails with: reported already, not yet known, or known in parts."""

from __future__ import annotations

from collections.abc import Sequence

from sysdyn.dsl.model.expression import Node
from sysdyn.dsl.names.symbols import Definition, Space
from sysdyn.dsl.tree import syntax
from sysdyn.values import dataclass


class Failed(Exception):  # noqa: N818
    """The expression is wrong and has been reported."""


@dataclass(frozen=True, slots=True)
class Part:
    """A range of a loop variable in which a label has these statements: one, or several that another index tells."""

    spaces: tuple[Space, ...]
    first: Node
    last: Node


class NotYetError(Failed):
    """A constraint is read that has not been resolved: what reads it is tried again when it has."""

    def __init__(self, name: str, span: syntax.Span) -> None:
        super().__init__(name)
        self.name, self.span = name, span


class SeveralError(Failed):
    """A loop runs over several statements of one label: whoever owns the loop cuts it into these parts."""

    def __init__(self, label: str, key: tuple[int, int, Node], loop: str, parts: tuple[Part, ...]) -> None:
        super().__init__(label)
        self.label, self.key, self.loop, self.parts = label, key, loop, parts


def circular(chain: Sequence[Definition]) -> tuple[str, str]:
    """What is said of definitions that need each other, and what to write instead."""
    names = [s.name for s in chain]
    if all(s.at for s in chain):
        said = f"elements of '{names[0]}' are defined by elements of '{names[0]}'"
        through = f", through '{', '.join(names[1:])}'" if names[1:] else ""
        one = f"{names[0]}[{', '.join(chain[0].at)}]"
        help_ = f"sum(j in ...) or prod(j in ...) over what is added up; or 'implicit' and a gamma for each {one}"
        return f"{said}{through}: a let knows no order of its elements", help_
    said, help_ = " -> ".join([*names, names[0]]), "break it with a state or an implicit closed by a gamma"
    if any(s.loops or s.space.prefix for s in chain):
        help_ = f"the elements of an array of components are one definition: {help_}"
    return f"circular definition: {said}", help_
