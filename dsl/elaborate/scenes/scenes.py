"""What a scene asks: span, settings, traces, accuracy, formulation, and what it expects."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import TypeVar

from sysdyn.dsl.elaborate.elaborate import Elaborator
from sysdyn.dsl.elaborate.scenes.settings import Settings
from sysdyn.dsl.elaborate.scenes.slices import each_of
from sysdyn.dsl.elaborate.statements import events
from sysdyn.dsl.format.format import format_expression
from sysdyn.dsl.model import dimensions as dim
from sysdyn.dsl.model import expression as ex
from sysdyn.dsl.model.evaluation import evaluate
from sysdyn.dsl.model.expression import Node
from sysdyn.dsl.model.network import ElementSetting, Observation, Scene
from sysdyn.dsl.model.unit_habits import common
from sysdyn.dsl.model.units import NONE, Dimension, Unit, si
from sysdyn.dsl.names.failures import Failed, SeveralError
from sysdyn.dsl.names.habits import unitless_parameter
from sysdyn.dsl.names.symbols import Typed, Vector, nearest
from sysdyn.dsl.names.unit_reading import read_unit
from sysdyn.dsl.text.diagnostics import Place, Report, SourceText
from sysdyn.dsl.tree import syntax
from sysdyn.names import trace_name

_Said = TypeVar("_Said", syntax.SetStatement, syntax.TraceStatement)
RESERVED = ("time", "audit", "parameters", "events", "derivatives")
FORMULATIONS = ("lagrangian", "hamiltonian", "co_lagrangian", "co_hamiltonian", "kane", "co_kane", "auto")
SOLVERS = ("auto", "bdf", "radau", "rosenbrock", "dopri", "energy", "euler")
REDUNDANCY = ("error", "drop", "minimum_norm")
FINEST_ACCURACY = 1e-13
"""Relative; what doubles resolve, and the estimate must be seen too."""
_SOLVER_OPTIONS = ("order", "index", "step", "longest", "keep_implicit", "keep_flow")


class SceneReader:
    """Reads one scene of an elaborated model."""

    def __init__(self, elaborator: Elaborator) -> None:
        self.model = elaborator
        self.resolver = elaborator.resolver
        self.report = elaborator.context.report
        self.observations: list[Observation] = []
        self.given = Settings(elaborator)
        self._raw: dict[Node, str] = {}  # traced expression before its unit -> name
        self._lost = False  # whether the scene has lost a statement, or what it traces
        self._found: dict[str, object] = {}
        self._accuracies: dict[str, Node] = {}
        self._ranged: list[str] = []
        self._targets: set[tuple[str, str]] = set()

    def levels(self, scene: syntax.SceneDefinition) -> None:
        """The `level` statements and those that set inputs and sizes: before the model's instances are elaborated."""
        self._each(scene, {syntax.SceneLevelStatement: SceneReader.level, syntax.SetStatement: SceneReader.set_input})

    def settings(self, scene: syntax.SceneDefinition) -> None:
        """The `set` statements on parameters: when those of instances are known."""
        self._each(scene, {syntax.SetStatement: SceneReader.set_parameter})

    def set_input(self, s: syntax.SetStatement) -> None:
        """A `set` of an input of the model, or of what may be a size; others wait."""
        self.given.input(s)
        self.given.size(s)

    def set_parameter(self, s: syntax.SetStatement) -> None:
        """A `set` of a parameter or elements of one."""
        if self.resolver.source is self.model.source:  # of the command line the last one counts
            self._one("set", s.target)
        self.given.parameter(s)

    @property
    def elements(self) -> list[ElementSetting]:
        """Elements of parameters that were set."""
        return self.given.elements

    def read(self, scene: syntax.SceneDefinition, place: Place) -> Scene:
        """Everything else of the scene."""
        self._each(scene, _STATEMENTS)
        self._each(
            scene, {syntax.AccuracyStatement: SceneReader._accuracy}
        )  # names of traced quantities are known by now
        return Scene(scene.name.name, place, **self._found)  # type: ignore[arg-type]

    def _each(self, scene: syntax.SceneDefinition, table: dict[type, Callable[..., None]]) -> None:
        with self.model.context.entering(self.model.space):
            for statement in scene.body:
                if isinstance(statement, syntax.BrokenStatement):
                    self.model.space.scope.broken |= statement.names
                    self._lost = True
                elif type(statement) in table:
                    self.carry_out(lambda s: table[type(s)](self, s), statement)

    def command(self, source: SourceText, s: _Said, do: Callable[[SceneReader, _Said], None]) -> None:
        """A `--set` or `--outputs` of the command line."""
        with (
            self.model.context.entering(self.model.space),
            self.resolver.entering_scope(self.model.space.scope, source),
        ):
            self.carry_out(lambda statement: do(self, statement), s)

    def carry_out(self, do: Callable[..., None], statement: syntax.SceneStatement | syntax.TraceItem) -> None:
        """Carry out one statement; what fails has been reported."""
        try:
            do(statement)
        except SeveralError as several:
            self.resolver.spread(several, statement.span)
        except Failed:
            self._lost |= isinstance(statement, syntax.TraceStatement | syntax.TraceItem)

    def _one(self, word: str, target: syntax.Expr) -> None:
        """What a scene gives to one target once."""
        said = word, "".join(self.resolver.source.text[target.span.start : target.span.end].split())
        if said in self._targets:
            raise self.resolver.fail("E106", f"the scene gives '{said[1]}' twice", target.span, help="one of the two")
        self._targets.add(said)

    def _once(
        self, key: str, value: object, span: syntax.Span, word: str | None = None, help: str | None = None
    ) -> None:
        """What the scene may say once; word: the author's, where it is not the key."""
        if key in self._found:
            raise self.resolver.fail("E106", f"the scene says '{word or key}' twice", span, help=help)
        self._found[key] = value

    # -- span and numbers ----------------------------------------------------------------------------------

    def _constant(self, expression: syntax.Expr, dimension: Dimension, what: str) -> Node:
        node = self.resolver.scalar_of(expression, dimension, "E208", f"{what} is in {{}}, wants {dim.show(dimension)}")
        for inner in ex.topological([node]):
            if inner.op in ("var", "time"):
                raise self.resolver.fail("E807", f"{what} depends on '{inner}': it must be a constant", expression.span)
        return node

    def _time(self, s: syntax.TimeStatement) -> None:
        """Read `time START to STOP`: both finite instants [s], the end after the start (E912)."""
        start = self._constant(s.start, dim.TIME, f"the start '{self._text(s.start)}'")
        end = self._constant(s.stop, dim.TIME, f"the end '{self._text(s.stop)}'")
        self._once("start", start, s.span, "time")
        # `time 0 s to inf`
        for node, text in ((start, self._text(s.start)), (end, self._text(s.stop))):
            if node.op == "const" and not math.isfinite(node.data):
                message = f"'{text}' is no instant: a run begins and ends"
                raise self.resolver.fail("E912", message, s.span, help="time 0 s to 10 s")
        # an order that can be told now: parameters have no values yet
        if start.op == end.op == "const" and end.data < start.data:
            message = f"the time ends before it starts: {self._text(s.start)} to {self._text(s.stop)}"
            help_ = f"time {self._text(s.stop)} to {self._text(s.start)}"
            raise self.resolver.fail("E912", message, s.span, help=help_)
        if start.op == end.op == "const" and end.data == start.data:
            message = f"the time ends where it starts: {self._text(s.start)} to {self._text(s.stop)}"
            raise self.resolver.fail("E912", message, s.span, help=f"time {self._text(s.start)} to 10 s")
        self._found["end"] = end

    def _text(self, e: syntax.Expr) -> str:
        return " ".join(self.resolver.source.text[e.span.start : e.span.end].split())[:40]

    def _limit(self, s: syntax.LimitStatement) -> None:
        if s.name.name not in ("steps", "events"):
            raise self.resolver.fail(
                "E113", f"there is no limit '{s.name.name}'", s.name.span, help="limit steps, limit events"
            )
        before = self._found.get("limits", ())
        assert isinstance(before, tuple)
        if s.name.name in dict(before):
            raise self.resolver.fail("E106", f"the scene says 'limit {s.name.name}' twice", s.span)
        self._found["limits"] = (*before, (s.name.name, self._constant(s.value, NONE, "a limit")))

    def _formulation(self, s: syntax.FormulationStatement) -> None:
        self._choice(s.name, FORMULATIONS, "formulation")
        self._once("formulation", s.name.name, s.span)
        self._found["formulation_place"] = self.resolver.place(s.span)

    def _redundancy(self, s: syntax.RedundancyStatement) -> None:
        self._choice(s.name, REDUNDANCY, "redundancy")
        self._once("redundancy", s.name.name, s.span)

    def _solver(self, s: syntax.SolverStatement) -> None:
        """The method and its options."""
        self._choice(s.name, SOLVERS, "solver")
        self._once("solver", s.name.name, s.span)
        options: list[tuple[str, Node]] = []
        # `solver bdf(step = 1 ms, index = 2)`
        for arg in s.args or ():
            if arg.name is None or arg.name not in _SOLVER_OPTIONS:
                message = f"the solver has no option '{arg.name or format_expression(arg.value)}'"
                raise self.resolver.fail(
                    "E405", message, arg.span, help=", ".join(f"{n} = .." for n in _SOLVER_OPTIONS)
                )
            if arg.name in dict(options):
                raise self.resolver.fail("E106", f"'{arg.name}' of the solver is given twice", arg.span)
            # 2v is no number: the stabilised index 2 with projected velocities
            if isinstance(arg.value, syntax.Name) and arg.value.name[0].isdigit():
                if (arg.name, arg.value.name) != ("index", "2v"):
                    message = f"{arg.name} = {arg.value.name} of the solver"
                    raise self.resolver.fail("E607", message, arg.value.span, help="index = 0, 1, 2, 2v, 3")
                node, self._found["velocities"] = ex.const(2.0), True
            # options that are true or false
            elif arg.name in ("keep_implicit", "keep_flow"):
                node = self._yes(arg.value, arg.name)
            else:
                node = self._constant(arg.value, dim.TIME if arg.name in ("step", "longest") else NONE, arg.name)
            options.append((arg.name, node))
        self._found["solver_options"] = tuple(options)

    def _yes(self, value: syntax.Expr, what: str) -> ex.Node:
        """1 for true, 0 for false: said in the text, since it changes which unknowns there are."""
        node = self.resolver.condition(value)
        if any(n.op in ("param", "var", "time") for n in ex.topological([node])):
            message = f"{what} changes which unknowns there are: it does not depend on values"
            raise self.resolver.fail("E405", message, value.span, help="true or false")
        return ex.const(1.0 if evaluate([node], dict[ex.Node, float]().__getitem__)[0] else 0.0)

    def _choice(self, word: syntax.Word, choices: tuple[str, ...], what: str) -> None:
        if word.name not in choices:
            near = nearest(word.name, choices)
            help_ = f"'{near}'" if near else f"one of {', '.join(choices)}"
            raise self.resolver.fail("E607", f"there is no {what} '{word.name}'", word.span, help=help_)

    # -- traces --------------------------------------------------------------------------------------------

    def only(
        self, wanted: Sequence[str], read: Callable[[str], tuple[SourceText, syntax.TraceStatement] | None]
    ) -> list[tuple[SourceText, syntax.TraceStatement]]:
        """Forget what is traced but for the wanted names; statements for those that are not traced yet."""
        known = {o.name: o for o in self.observations}
        self.observations = [known[name] for name in wanted if name in known]
        return [found for name in wanted if name not in known and (found := read(name)) is not None]

    def trace(self, s: syntax.TraceStatement) -> None:
        """`trace`: quantities by name, and how often."""
        if s.every is not None:
            what = f"the interval '{self._text(s.every)}' of a trace"
            frequency = s.every if isinstance(s.every, syntax.QuantityLiteral) and s.every.value > 0.0 else None
            if frequency is not None and frequency.unit.text in ("Hz", "kHz", "MHz", "1/s", "s^-1"):
                help_ = f"every 1/({self._text(s.every)}): the time between two rows"
                raise self.resolver.fail("E208", f"{what} is a frequency, wants s", s.every.span, help=help_)
            every = self._constant(s.every, dim.TIME, what)
            if every.op == "const" and not every.data > 0.0:
                message = f"the interval '{self._text(s.every)}' of a trace is not positive"
                raise self.resolver.fail("E912", message, s.every.span, help="every 10 ms")
            self._once("every", every, s.every.span)
        for item in s.items:
            self.carry_out(self._items, item)

    def _items(self, item: syntax.TraceItem) -> None:
        """A traced expression; of `x[1..n].e` each element."""
        for expr, at in each_of(self.model, item.expr):
            name = f"{item.alias.name}[{', '.join(map(str, at))}]" if item.alias and at else ""
            alias = replace(item.alias, name=name) if item.alias and at else item.alias
            self._item(replace(item, expr=expr, alias=alias) if at else item)

    def _item(self, item: syntax.TraceItem) -> None:
        """One traced expression under its name; E905 where it does not exist or is an array."""
        with self.resolver.leniently(), self.resolver.unknown_as("E905", "trace '{}' does not exist"):
            value = self.resolver.resolve(item.expr)
        if isinstance(value, Vector):
            raise self.resolver.fail(
                "E905", f"'{format_expression(item.expr)}' is an array: trace its elements", item.span
            )
        name = item.alias.name if item.alias else trace_name(format_expression(item.expr))
        where = item.alias.span if item.alias else item.span
        # `trace x as time`
        if name in RESERVED:
            raise self.resolver.fail(
                "E911", f"trace name '{name}' belongs to the trace itself", where, help="another name with 'as'"
            )
        if any(o.name == name for o in self.observations):
            raise self.resolver.fail("E106", f"'{name}' is traced twice", where, help="another name with 'as'")
        # a condition is traced as 1 and 0
        node = ex.conditional(value.node, ex.const(1.0), ex.const(0.0)) if value.truth else value.node
        unit = self._traced_unit(item, value)
        scaled = node
        # `in degC`, `in mm`: the trace holds the numbers of that unit
        if unit.scale != 1 or unit.offset:
            scaled = ex.scale(float(1 / unit.scale), ex.sub(node, ex.const(float(unit.offset))))
        self._raw.setdefault(node, name)
        text = format_expression(item.expr)
        self.observations.append(Observation(name, scaled, unit, text, self.resolver.place(item.span)))

    def _traced_unit(self, item: syntax.TraceItem, value: Typed) -> Unit:
        """The unit in which a quantity is recorded; E208 where it is of another dimension."""
        if item.unit is None:
            return si(value.dimension or NONE)
        unit = read_unit(item.unit, self.model.space.scope, self.resolver.source, self.report)
        if unit is None:
            raise Failed
        if value.dimension is not None and unit.dimension != value.dimension:
            message = f"'{format_expression(item.expr)}' is in {dim.show(value.dimension)}, not {unit.text}"
            missing = self.resolver.missing(value.dimension, unit.dimension, item.expr)
            help_ = missing if unitless_parameter(missing) else f"in {common(value.dimension)}"
            help_ = "in rad or deg of an angle, in percent, or without 'in'" if value.dimension == NONE else help_
            help_ = "in rad/s, deg/s or rpm of a speed of rotation, in Hz" if help_ == "in s^-1" else help_
            help_ = "in degC" if unit.text == "C" and help_ == "in K" else help_
            raise self.resolver.fail("E208", message, item.unit.span, help=help_)
        return unit

    def _accuracy(self, s: syntax.AccuracyStatement) -> None:
        """What a run promises, and of which quantities."""
        value = self._constant(s.value, NONE, "the accuracy")
        # for all that is traced
        if not s.on:
            self._once("accuracy", value, s.span, help="accuracy 1e-6 on x: another for what is named")
        if value.op == "const" and not FINEST_ACCURACY <= value.data < 1.0:
            text = f"accuracy {value.data:g}: from {FINEST_ACCURACY:g} to less than 1, what doubles can tell"
            raise self.resolver.fail("E906", text, s.value.span, help="accuracy 1e-6")
        # for what is named: by its name in the trace, or by the expression that is traced
        names: list[str] = []
        for target in (element for written in s.on for element, _ in each_of(self.model, written)):
            if (named := self._traced_as(target)) is not None:
                names.append(named)
                continue
            try:
                with self.resolver.leniently():
                    node = self.resolver.scalar(target).node
            except Failed:
                continue  # it has been said
            # `audit.energy` needs no trace item
            if node not in self._raw and node.op == "var" and node.data[1] == "audit":
                names.append(f"audit.{node.data[0]}")  # in every trace
                continue
            # a trace item failed: perhaps the one that is meant
            if node not in self._raw and self._lost:
                raise Failed  # it may stand there
            if node not in self._raw:
                text = format_expression(target)
                raise self.resolver.fail(
                    "E906",
                    f"the accuracy of '{text}' is asked for, but it is not traced",
                    target.span,
                    help=f"trace {text}",
                )
            names.append(self._raw[node])
        said = self._accuracies
        if twice := [name for k, name in enumerate(names) if name in said or name in names[:k]]:
            raise self.resolver.fail("E106", f"the accuracy of '{twice[0]}' is asked for twice", s.span)
        said |= dict.fromkeys(names, value)
        if s.to_range:
            self._ranged += names
            self._found["to_range"] = tuple(self._ranged)
        self._found["accuracy_on"] = tuple(said.items())

    def _traced_as(self, target: syntax.Expr) -> str | None:
        """The name that `as` gave to a quantity, where what it says in the model itself is not traced."""
        name, kept = format_expression(target), self.resolver.report
        if name not in self._raw.values():
            return None
        self.resolver.report = Report()
        try:
            with self.resolver.leniently():
                return None if self.resolver.scalar(target).node in self._raw else name
        except Failed:
            return name
        finally:
            self.resolver.report = kept

    # -- the rest ------------------------------------------------------------------------------------------

    def _init(self, s: syntax.InitStatement) -> None:
        self.model.equations.initial(s, override=True)

    def _expect(self, s: syntax.ExpectStatement) -> None:
        self.model.equations.expect(s)

    def _golden(self, s: syntax.GoldenStatement) -> None:
        self.model.equations.golden(s)

    def level(self, s: syntax.SceneLevelStatement) -> None:
        """`level ref = name`: before the model's instances are elaborated."""
        self._one("level", s.target)
        text = " ".join(self.resolver.source.text[s.target.span.start : s.target.span.end].split())
        self.model.instances.levels[text.replace(" ", "")] = (s.level.name, self.resolver.place(s.span))

    def _when(self, s: syntax.WhenStatement) -> None:
        events.when(self.model.context, s)


_STATEMENTS: dict[type, Callable[..., None]] = {
    syntax.TimeStatement: SceneReader._time,
    syntax.TraceStatement: SceneReader.trace,
    syntax.FormulationStatement: SceneReader._formulation,
    syntax.SolverStatement: SceneReader._solver,
    syntax.RedundancyStatement: SceneReader._redundancy,
    syntax.LimitStatement: SceneReader._limit,
    syntax.InitStatement: SceneReader._init,
    syntax.ExpectStatement: SceneReader._expect,
    syntax.GoldenStatement: SceneReader._golden,
    syntax.WhenStatement: SceneReader._when,
}
