"""What elaboration collects, and the frame that its rooms share: spaces, loops, names that are entered."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import field
from functools import partial
from typing import Any

from sysdyn.dsl.elaborate.instances.casts import Cast
from sysdyn.dsl.model import budget
from sysdyn.dsl.model import expression as ex
from sysdyn.dsl.model.expression import Node
from sysdyn.dsl.model.network import (
    Branch,
    Constraint,
    Coordinate,
    Coupling,
    Derived,
    Dynamic,
    EnergyTerm,
    Event,
    Expectation,
    Golden,
    InitialCondition,
    Loop,
    NodeFamily,
    Observation,
    Parameter,
    Shape,
    State,
    Switch,
    Unknown,
    VirtualWork,
)
from sysdyn.dsl.model.units import Unit
from sysdyn.dsl.model.values import Values
from sysdyn.dsl.names.failures import Failed, NotYetError, SeveralError
from sysdyn.dsl.names.resolve import Resolver
from sysdyn.dsl.names.symbols import ConstraintSymbol, Scope, Space, Symbol, Vector
from sysdyn.dsl.names.unit_reading import read_unit
from sysdyn.dsl.text.diagnostics import Place, Related, Report
from sysdyn.dsl.tree import syntax
from sysdyn.values import dataclass

Nested = tuple[syntax.Statement, tuple[syntax.ForStatement, ...]]


@dataclass(slots=True)
class Requirement:
    """A `require` to be judged with the values bound."""

    condition: Node
    loops: tuple[Loop, ...]
    place: Place
    written: syntax.Expr

    def failures(self, known: Values) -> Iterator[Mapping[Node, float]]:
        """The values of its loop variables for which the condition does not hold."""
        return (at for at in known.cases(self.condition, self.loops) if not known.truth(self.condition, at))


@dataclass(slots=True)
class CastRequirement:
    """A requirement of an instance that was cast: its node is made where somebody reads it."""

    cast: Cast
    path: str
    place: Place
    written: syntax.Expr
    loops: tuple[Loop, ...] = ()

    @property
    def condition(self) -> Node:
        """In the names of the instance."""
        return self.cast.under(self.path)

    def failures(self, known: Values) -> Iterator[Mapping[Node, float]]:
        """One, without loop variables, if the condition does not hold."""
        return iter(() if self.cast.truth(self.path, known) else ({},))


@dataclass(slots=True)
class NetworkBuilder:
    """The statements of a network as they are found."""

    parameters: dict[str, Parameter] = field(default_factory=dict)
    coordinates: list[Coordinate] = field(default_factory=list)
    unknowns: list[Unknown] = field(default_factory=list)
    states: list[State] = field(default_factory=list)
    energies: list[EnergyTerm] = field(default_factory=list)
    works: list[VirtualWork] = field(default_factory=list)
    constraints: list[Constraint] = field(default_factory=list)
    dynamics: list[Dynamic] = field(default_factory=list)
    initials: list[InitialCondition] = field(default_factory=list)
    expectations: list[Expectation] = field(default_factory=list)
    goldens: list[Golden] = field(default_factory=list)
    quasis: list[str] = field(default_factory=list)
    speeds: list[Observation] = field(default_factory=list)
    discretes: set[str] = field(default_factory=set)
    events: list[Event] = field(default_factory=list)
    switches: list[Switch] = field(default_factory=list)
    drafts: list[Any] = field(default_factory=list)  # of switches (elaborate/statements/events.py)
    event_drafts: list[Any] = field(default_factory=list)  # of events in a `for`
    watched: list[Observation] = field(default_factory=list)  # what events and switches read
    requirements: list[Requirement | CastRequirement] = field(default_factory=list)
    nodes: list[NodeFamily] = field(default_factory=list)
    branches: list[Branch] = field(default_factory=list)
    couplings: list[Coupling] = field(default_factory=list)
    inputs: dict[str, tuple[Unit, Place]] = field(default_factory=dict)  # of the model, which a scene may set
    given: set[str] = field(default_factory=set)  # states that have a dynamic, sound or not
    derived: list[Derived] = field(default_factory=list)  # what is differentiated by time
    owned: dict[str, list[EnergyTerm | VirtualWork | Constraint]] = field(
        default_factory=dict
    )  # by the path of their instance


class _Entered:
    """Inside a space, with its names in sight."""

    __slots__ = ("_before", "_elaboration", "_resolving", "_space")

    def __init__(self, elaboration: ElaborationContext, space: Space) -> None:
        self._elaboration, self._space = elaboration, space

    def __enter__(self) -> None:
        it = self._elaboration
        self._before = it.scope, it.current
        self._resolving = it.resolver.space(self._space)
        it.scope, it.current = self._space.scope, self._space
        self._resolving.__enter__()

    def __exit__(self, *failed: object) -> None:
        self._resolving.__exit__(*failed)
        self._elaboration.scope, self._elaboration.current = self._before


class ElaborationContext:
    """Shared by the rooms of elaboration: where we are, and how statements are walked through."""

    def __init__(self, report: Report) -> None:
        self.report = report
        self.resolver = Resolver(report)
        self.parts = NetworkBuilder()
        self.resolver.branches, self.resolver.given = self.parts.branches, self.with_instance_parameters
        self.scope = Scope()
        self.current = Space("", self.scope, self.scope, self.resolver.source)
        self._postponed: list[tuple[Space, NotYetError, Callable[[], None]]] = []

    def entering(self, space: Space) -> _Entered:
        """Work inside a space."""
        return _Entered(self, space)

    def each(self, statements: Sequence[Nested], do: Callable[..., None]) -> None:
        """Carry out statements in their loops; what fails has been reported."""
        for statement, loops in statements:
            try:
                if loops:
                    with self.inside(loops):
                        self.in_parts(partial(do, statement), statement.span)
                else:
                    self.in_parts(partial(do, statement), statement.span)
            except NotYetError as early:
                self.postpone(early, partial(self.each, [(statement, loops)], do))
            except Failed:  # what it would have declared is not reported again where it is used
                for decl in declarations_of(statement):
                    if decl.name not in self.scope.symbols:
                        self.scope.broken.add(decl.name)
            except budget.SpentError as spent:
                spent.place = spent.place or self.place(statement.span)
                raise

    def postpone(self, early: NotYetError, do: Callable[[], None]) -> None:
        """To be carried out in the present space, once the constraint that it reads is there."""
        self._postponed.append((self.current, early, do))

    @property
    def waiting(self) -> int:
        """Statements that were postponed."""
        return len(self._postponed)

    def run_postponed(self) -> None:
        """Carry out what had to wait; E105 where one waits for itself."""
        waiting = 0
        while self._postponed and len(self._postponed) != waiting:
            now, self._postponed = self._postponed, []
            waiting = len(now)
            for space, _, do in now:
                with self.entering(space):
                    do()
        for space, early, _ in self._postponed if not self.report.failed else ():
            place = Place(space.source, early.span)
            self.report.error("E105", f"'{early.name}' is read by what it reads itself", place)

    def in_parts(self, do: Callable[[], None], span: syntax.Span) -> None:
        """Carry out a statement; for each part of a loop that runs over several statements of one label."""
        try:
            do()
        except SeveralError as several:
            if all(loop.index != several.loop for loop in self.resolver.loops):
                raise self.resolver.spread(several, span) from None
            for part in several.parts:
                with self.resolver.narrowing(several, part):
                    self.in_parts(do, span)

    @contextmanager
    def inside(self, loops: tuple[syntax.ForStatement, ...]) -> Iterator[None]:
        """Bring the variables of `for` statements into sight."""
        with ExitStack() as stack:
            for loop in loops:
                first = self.resolver.whole_number(loop.lower, "a bound")
                last = self.resolver.whole_number(loop.upper, "a bound")
                stack.enter_context(self.resolver.loop(loop.index.name, first, last))
            yield

    def place(self, span: syntax.Span) -> Place:
        """A span of the present text."""
        return Place(self.resolver.source, span)

    def source_text(self, span: syntax.Span) -> str:
        """The author's text of a span on one line."""
        return " ".join(self.resolver.source.text[span.start : span.end].split())

    def add_statement(self, statement: EnergyTerm | VirtualWork | Constraint) -> None:
        """Takes in what the present model or instance says."""
        kinds: dict[type, list[Any]] = {EnergyTerm: self.parts.energies, VirtualWork: self.parts.works}
        kinds.get(type(statement), self.parts.constraints).append(statement)
        if self.current.path:
            self.parts.owned.setdefault(self.current.path, []).append(statement)

    def enter(self, symbol: Symbol) -> None:
        """Bring a name into scope; E106 where it is there already."""
        before = self.scope.symbols.get(symbol.name)
        same = isinstance(before, ConstraintSymbol) and isinstance(symbol, ConstraintSymbol)
        if before is None:
            self.scope.symbols[symbol.name] = symbol
        elif not (same and before.kind == symbol.kind):  # type: ignore[union-attr]
            related = (Related("first declared here", before.place),)
            self.report.error("E106", f"'{symbol.name}' is declared twice", symbol.place, related=related)
            raise Failed

    def unit(self, unit: syntax.UnitExpression) -> Unit:
        """The value of a unit as written."""
        found = read_unit(unit, self.scope, self.resolver.source, self.report)
        if found is None:
            raise Failed
        return found

    def shape(self, decl: syntax.Decl) -> Shape:
        """First and last of each index of a declared family."""
        return tuple(self.bounds(i) for i in decl.indices)

    def bounds(self, index: syntax.Index) -> tuple[Node, Node]:
        """`1..n`, `3` (for 1..3), or a loop variable, whose range it takes."""
        if isinstance(index, syntax.Range):
            return self.resolver.whole_number(index.lower, "a bound"), self.resolver.whole_number(
                index.upper, "a bound"
            )
        node = self.resolver.whole_number(index, "an index")
        used = self._loops_of(node)
        if not used:
            return ex.const(1), node
        lows = {n: loop.first for n, loop in used.items()}
        highs = {n: loop.last for n, loop in used.items()}
        return ex.substitute(node, lows), ex.substitute(node, highs)

    def fills(self, value: object, shape: Shape) -> bool:
        """Whether a value fills a shape: a list that of as many in a row, another any."""
        if not isinstance(value, Vector):
            return True
        if len(shape) != 1:
            return False
        first, last = (self.with_instance_parameters(node) for node in shape[0])
        if not (ex.is_const(first) and ex.is_const(last)):
            return False
        return int(last.data) - int(first.data) + 1 == len(value.items)

    def with_instance_parameters(self, node: Node) -> Node:
        """A bound with the parameters that the instance gives."""
        parameters = self.parts.parameters
        while True:
            known = {n: parameters[n.data] for n in ex.topological([node]) if n.op == "param" and n.data in parameters}
            single = {n: p.values[0] for n, p in known.items() if len(p.values) == 1}
            values = {  # of arrays: what is alike in all elements
                n: v for n, v in single.items() if not n.args or all(m.op != "index" for m in ex.topological([v]))
            }
            if not values:
                return node
            node = ex.substitute(node, values)

    def loop_index(self, index: syntax.Index) -> Node | None:
        """An index that varies with the loops around; None of `1..n` and `3`, which declare all elements at once."""
        node = None if isinstance(index, syntax.Range) else self.resolver.whole_number(index, "an index")
        return node if node is not None and self._loops_of(node) else None

    def _loops_of(self, node: Node) -> dict[Node, Loop]:
        """The loops around whose variables occur, by these."""
        inside = {ex.index(loop.index): loop for loop in self.resolver.loops}
        return {n: inside[n] for n in ex.topological([node]) if n in inside}


def flatten(body: Sequence[syntax.Statement], loops: tuple[syntax.ForStatement, ...] = ()) -> Iterator[Nested]:
    """The statements of a body with the `for` statements around each."""
    for statement in body:
        if isinstance(statement, syntax.ForStatement):
            yield from flatten(statement.body, (*loops, statement))
        else:
            yield statement, loops


def declarations_of(statement: syntax.Statement) -> tuple[syntax.Decl, ...]:
    """The names that a statement declares."""
    decls: tuple[syntax.Decl, ...] = getattr(statement, "decls", ())
    own = getattr(statement, "decl", None)
    return decls if own is None else (*decls, own)
