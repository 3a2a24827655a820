"""What a component asks of its user, and what it says inside: read once for all of its instances."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

from sysdyn.dsl.elaborate.parts import Nested
from sysdyn.dsl.tree import syntax

Kinds = type | tuple[type, ...]


class Body:
    """Statements of a component or a model with the loops around each; `of` picks kinds, once for all instances.

    order: the parameters in the order of their dependence, once an instance found it sound (statements/parameters.py).
    """

    __slots__ = ("_around", "_head", "_kinds", "order", "statements")

    def __init__(self, statements: Iterable[Nested]) -> None:
        self.statements = tuple(statements)
        self.order: tuple[tuple[syntax.ParamStatement, tuple[syntax.ForStatement, ...]], ...] | None = None
        self._head: Interface | None = None
        self._kinds: dict[Kinds, tuple[Nested, ...]] = {}
        self._around: dict[Kinds, tuple[Nested, ...]] = {}

    def __iter__(self) -> Iterator[Nested]:
        return iter(self.statements)

    def statements_of(self, kinds: Kinds) -> tuple[Nested, ...]:
        """The statements of these kinds, in their order."""
        found = self._kinds.get(kinds)
        if found is None:
            found = self._kinds[kinds] = tuple(s for s in self.statements if isinstance(s[0], kinds))
        return found

    def with_loops(self, kinds: Kinds) -> tuple[Nested, ...]:
        """Statements of these kinds, and all that stand in loops, whose bounds are read."""
        found = self._around.get(kinds)
        if found is None:
            found = self._around[kinds] = tuple(s for s in self.statements if s[1] or isinstance(s[0], kinds))
        return found

    @property
    def head(self) -> Interface:
        """What it asks of its user."""
        if self._head is None:
            self._head = Interface(self)
        return self._head


class Interface:
    """What a component asks of its user: parameters, inputs, ports, branches; generic: whether units have variables."""

    def __init__(self, body: Body) -> None:
        self.parameters: dict[str, syntax.ParamStatement] = {}
        self.inputs: dict[str, syntax.InputStatement] = {}
        self.ports: dict[str, syntax.PortStatement] = {}
        self.branches: dict[str, syntax.BranchStatement] = {}
        # what an instance may give or connect, by name
        for statement, _ in body.statements_of(
            (syntax.ParamStatement, syntax.InputStatement, syntax.PortStatement, syntax.BranchStatement)
        ):
            match statement:
                case syntax.ParamStatement():
                    self.parameters[statement.decl.name] = statement
                case syntax.InputStatement():
                    self.inputs[statement.decl.name] = statement
                # `port a, b: electrical` declares several
                case syntax.PortStatement():
                    self.ports |= dict.fromkeys((d.name for d in statement.decls), statement)
                # a branch without a name is that of the component itself
                case syntax.BranchStatement():
                    self.branches |= dict.fromkeys(
                        (d.name for d in statement.decls) if statement.decls else ("",), statement
                    )
        # `param k: $u/m` is generic: each instance finds its own units
        units = [p.unit for p in self.parameters.values() if p.unit] + [i.unit for i in self.inputs.values()]
        self.generic = any(f.name.startswith("$") for unit in units for f in unit.factors)
