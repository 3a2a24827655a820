"""What a component asks of its user."""

from __future__ import annotations

from collections.abc import Sequence

from sysdyn.dsl.elaborate.parts import Nested
from sysdyn.dsl.tree import syntax


class Interface:
    """What a component asks of its user: parameters, inputs, ports, branches."""

    def __init__(self, body: Sequence[Nested]) -> None:
        self.parameters: dict[str, syntax.Param] = {}
        self.inputs: dict[str, syntax.Input] = {}
        self.ports: dict[str, syntax.Port] = {}
        self.branches: dict[str, syntax.Branch] = {}
        self.given: dict[str, syntax.Expr] = {}  # inputs among the arguments
        for statement, _ in body:
            match statement:
                case syntax.Param():
                    self.parameters[statement.decl.name] = statement
                case syntax.Input():
                    self.inputs[statement.decl.name] = statement
                case syntax.Port():
                    self.ports |= dict.fromkeys((d.name for d in statement.decls), statement)
                case syntax.Branch():
                    self.branches |= dict.fromkeys(
                        (d.name for d in statement.decls) if statement.decls else ("",), statement
                    )
