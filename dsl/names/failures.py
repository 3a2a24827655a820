"""What an expression fails with: reported already, not yet known, or known in parts."""

from __future__ import annotations

from sysdyn.dsl.model.expression import Node
from sysdyn.dsl.names.symbols import Space
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
