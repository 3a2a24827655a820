"""Statements that make equations: energies, works, constraints, dynamics, initial values, expectations."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import ExitStack, nullcontext

from sysdyn.dsl.elaborate.parts import ElaborationContext, Requirement
from sysdyn.dsl.elaborate.statements import events, friction
from sysdyn.dsl.elaborate.statements.declarations import Declarations
from sysdyn.dsl.model import dimensions as dim
from sysdyn.dsl.model import expression as ex
from sysdyn.dsl.model.expression import Node
from sysdyn.dsl.model.network import (
    Constraint,
    Dynamic,
    EnergyTerm,
    Expectation,
    Golden,
    InitialCondition,
    Loop,
    VirtualWork,
)
from sysdyn.dsl.model.quasi import NotLinearError, virtual
from sysdyn.dsl.model.units import NONE, Dimension, multiply, si
from sysdyn.dsl.names.failures import Failed
from sysdyn.dsl.names.symbols import BranchSymbol, InstanceSymbol, Typed, UnknownSymbol
from sysdyn.dsl.text.diagnostics import Related
from sysdyn.dsl.tree import syntax


class Statements:
    """Resolves statements of a space."""

    def __init__(self, context: ElaborationContext, declarations: Declarations) -> None:
        self.context, self.resolver, self.parts = context, context.resolver, context.parts
        self.declarations = declarations

    def constraint(self, s: syntax.ConstraintStatement) -> None:
        """phi, psi, gamma."""
        place = self.context.place(s.span)
        # a psi constrains flows: dx/dt there may be a quasi-velocity
        with self.resolver.virtually() if s.kind == "psi" else nullcontext():
            left, right = self.resolver.scalar(s.left), self.resolver.scalar(s.right)
        dimension = self._sides(f"{s.kind} {s.decl.name}", left, right, s.right, s.left, s.right)
        own = tuple(
            self.resolver.whole_number(i, "an index") for i in s.decl.indices if not isinstance(i, syntax.Range)
        )
        family = self.context.current.family(s.decl.name)
        at = (*family.prefix, *own)
        loops = {ex.index(loop.index) for loop in self.resolver.loops}
        used = {n for a in at for n in ex.topological([a]) if n.op == "index"}
        # `for i in 1..n { phi link: ... }` would declare one label n times
        if loops - used:
            message = f"'{s.decl.name}' stands in a 'for': its label needs the loop variable"
            raise self.resolver.fail("E106", message, s.decl.span, help=f"{s.decl.name}[i]")
        # `phi rod: ...` twice; of rod[1], rod[i] the binding compares the elements
        before = self.resolver.constraints.get(family.name, [])
        if before and not at:  # of elements that are given twice the binding knows
            related = (Related("first declared here", before[0].place),)
            self.context.report.error(
                "E106", f"'{s.decl.name}' is declared twice", self.context.place(s.decl.span), related=related
            )
            raise Failed
        node = ex.sub(left.node, right.node)
        # c*setsign(u) in a gamma is friction with switches of its own
        if s.kind == "gamma":
            node = friction.relation(
                self.context, node, ex.const(0.0), family.name, self.resolver.loops, place, si(dimension)
            )
        constraint = Constraint(s.kind, family.name, at, node, self.resolver.loops, si(dimension), place)
        constraint = events.guard_constraint(self.context, s, constraint)
        self.context.add_statement(constraint)
        self.resolver.constraints.setdefault(family.name, []).append(constraint)

    def _sides(self, what: str, left: Typed, right: Typed, where: syntax.Expr, *within: syntax.Expr) -> Dimension:
        if left.dimension is None or right.dimension is None or left.dimension == right.dimension:
            return (left.dimension if left.dimension is not None else right.dimension) or NONE
        message = f"{what}: the two sides differ: {dim.show(left.dimension)} and {dim.show(right.dimension)}"
        help_ = self.resolver.missing(left.dimension, right.dimension, *within)
        raise self.resolver.fail("E208", message, where.span, help=help_)

    def _wants(self, what: str, expression: syntax.Expr, dimension: Dimension, *, dynamic: bool = False) -> Node:
        """The value of an expression in its dimension, E208; dynamic: the rate of a state."""
        value = self.resolver.scalar(expression)
        if value.dimension is not None and value.dimension != dimension:
            want, have = dim.show(dimension), dim.show(value.dimension)
            factor = dim.show(dim.quotient(dimension, value.dimension))
            message = f"{what}: {want} expected, {have} found (factor: {factor})"
            help_ = self.resolver.missing(value.dimension, dimension, expression, dynamic=dynamic)
            raise self.resolver.fail("E208", message, expression.span, help=help_)
        return value.node

    def _energy(self, s: syntax.EnergyStatement) -> None:
        node = self._wants(f"energy {s.function}", s.value, dim.ENERGY)
        self.context.add_statement(EnergyTerm(s.function, node, self.resolver.loops, self.context.place(s.span)))

    def _content(self, s: syntax.ContentStatement) -> None:
        node = self._wants(f"content {s.function}", s.value, dim.POWER)
        loops, place = self.resolver.loops, self.context.place(s.span)
        if s.function != "D":
            self.context.add_statement(EnergyTerm(s.function, node, loops, place))
            return
        for part, inside in _parts(node, loops):
            self.context.add_statement(
                EnergyTerm("D", friction.set_valued(self.context, part, inside, place), inside, place)
            )

    def _work(self, s: syntax.WorkStatement) -> None:
        """Add `work F on x`: F delta x is energy (E208); along a quasi-coordinate its part on each displacement."""
        effort = self.resolver.scalar(s.effort)
        quasi = isinstance(s.on, syntax.FunctionCall) and s.on.name == "quasi"
        # `work M on quasi(w)`: on what has a rate and no displacement
        if isinstance(s.on, syntax.FunctionCall) and quasi:
            on = self._quasi(s.on)
        else:
            on = self.resolver.scalar(s.on)
            self.require_displacement(on.node, s.on)
        # N on m; a factor that is missing is named
        if effort.dimension is not None and on.dimension is not None:
            found = multiply(effort.dimension, on.dimension)
            if found != dim.ENERGY:
                factor = dim.show(dim.quotient(dim.ENERGY, found))
                message = f"work: effort*displacement is {dim.show(found)}, not J (factor: {factor})"
                wanted = dim.quotient(dim.ENERGY, on.dimension)
                help_ = self.resolver.missing(effort.dimension, wanted, s.effort)
                raise self.resolver.fail("E208", message, s.effort.span, help=help_)
        along = self.virtual(on.node, "quasi(w): w", s.on.span) if quasi else ((ex.const(1.0), on.node),)
        for coefficient, node in along:
            self.context.add_statement(
                VirtualWork(ex.mul(effort.node, coefficient), node, self.resolver.loops, self.context.place(s.span))
            )

    def _quasi(self, on: syntax.FunctionCall) -> Typed:
        """The quasi-velocity w of quasi(w), in the dimension of the displacement along it."""
        if len(on.args) != 1 or on.args[0].name is not None:
            raise self.resolver.fail("E206", f"quasi takes one argument, {len(on.args)} given", on.span)
        speed = self.resolver.scalar(on.args[0].value)
        return Typed(speed.node, None if speed.dimension is None else multiply(speed.dimension, dim.TIME))

    def virtual(self, speed: Node, what: str, span: syntax.Span) -> tuple[tuple[Node, Node], ...]:
        """The virtual displacement along a quasi-velocity, term by term; E319."""
        try:
            return virtual(speed)
        except NotLinearError as error:
            help_ = "w = a*x' + b*y' with a, b of displacements"
            raise self.resolver.fail("E319", f"{what} {error}", span, help=help_) from None

    def require_displacement(self, node: Node, where: syntax.Expr, element: str = "") -> None:
        """E319: a work, or an element, acts on an expression of displacements."""
        acts, remedy = (f"'{element}' acts", "between nodes: a -> b") if element else ("work", "work E on q")
        others = [n for n in ex.variables(node) if n.op == "var" and n.data[1] not in ("q", "nq", "bq", "s")]
        others.sort(key=lambda n: n.number)
        if others:
            flow = others[0].data[1] in ("f", "nf", "bf")
            what = f"the flow {others[0]}" if flow else f"{others[0]}, which is no displacement"
            message = f"{acts} on an expression that contains {what}"
            text = self.context.source_text(where.span)
            kept = "... on " if element else "work ... on "
            along = f"on x - y, of displacements; or {remedy}" if element else f"{remedy}, or work E on quasi(w)"
            help_ = f"{kept}{text.replace(chr(39), '')}" if "'" in text else along
            raise self.resolver.fail("E319", message, where.span, help=help_)
        read = ex.variables(node) - {ex.time()}
        if read and all(n.op == "var" and n.data[1] == "s" for n in read):
            states = ", ".join(sorted(map(str, read)))
            message, help_ = f"{acts} on {states}, which no effort moves", "a coord, or a term in the state's dynamic"
            raise self.resolver.fail("E319", message, where.span, help=help_)

    def _dynamic(self, s: syntax.DynamicStatement) -> None:
        """Add `dynamic s' = ...`, the rate of a state; E508 where it is not the first derivative of one, or reads other
        rates.
        """
        target = s.target.base if isinstance(s.target, syntax.Prime) else s.target
        value = self.resolver.scalar(target)
        # `dynamic s = ...` or of something that is no state
        if not isinstance(s.target, syntax.Prime) or value.node.op != "var" or value.node.data[1] != "s":
            help_ = "dynamic s' = ..."
            if value.node.op == "var" and value.node.data[1] == "s":
                self.parts.given.add(value.node.data[0])  # what is meant
                help_ = f"dynamic {self.context.source_text(target.span)}' = ..."
            raise self.resolver.fail("E508", "a dynamic gives the rate of a state", s.target.span, help=help_)
        self.parts.given.add(value.node.data[0])
        # `dynamic s'' = ...`
        if value.node.data[2]:
            name = value.node.data[0]
            help_ = f"a state for the rate, v = {name}': dynamic {name}' = v, dynamic v' = ...; or coord and energy T*"
            said = f"a dynamic gives the first derivative of a state, not {value.node}'"
            raise self.resolver.fail("E508", said, s.target.span, help=help_)
        rate = dim.quotient(value.dimension or NONE, dim.TIME)
        node = self._wants(f"dynamic {value.node}'", s.value, rate, dynamic=True)
        # s' = r' would be a system of rates: it is written as a gamma
        for inner in sorted(ex.variables(node), key=lambda n: n.number):
            if inner.op == "var" and inner.data[2]:
                message = f"dynamic {value.node}' = ... contains {inner}"
                help_ = f"define {inner.data[0]} first, or use a gamma"
                raise self.resolver.fail("E508", message, s.value.span, help=help_)
        self.parts.dynamics.append(Dynamic(value.node, node, self.resolver.loops, self.context.place(s.span)))

    def initial(self, s: syntax.InitStatement, override: bool = False) -> None:
        """`init ref = value`, in a model or (override) in a scene."""
        outer = len(self.resolver.loops)
        with ExitStack() as stack:
            target = self._loop_over_slice(s.target, stack)
            self.context.in_parts(lambda: self._initial(s, target, override, outer), s.span)

    def _initial(self, s: syntax.InitStatement, target_syntax: syntax.Expr, override: bool, outer: int) -> None:
        """Add an `init` of what a target means, each element with its value; override: by the scene, in place of the
        model's.
        """
        with self.resolver.leniently():
            target = self.resolver.scalar(target_syntax)
        # `init n = 3` of a discrete variable
        if target.node.op == "param" and target.node.data in self.parts.discretes:
            name = target.node.data
            message = f"'{name}' is a discrete variable: it begins with the value of its declaration"
            help_ = f"discrete {name} = ... there; a param as its value can be set in a scene"
            raise self.resolver.fail("E903", message, s.span, help=help_)
        message = f"'{target.node}' is in {dim.show(target.dimension)} but starts at {{}}"
        dimension = target.dimension or NONE
        given = self.declarations.values_at_start(target.node, s.initial.value, dimension, message, outer)
        # the value is one of parameters and constants: nothing moves yet
        for one, value, loops in given:
            for inner in ex.variables(value):
                message = f"the initial value of '{one}' depends on '{inner}'"
                raise self.resolver.fail("E807", message, s.initial.value.span, help="parameters and constants only")
            fixed = s.initial.kind == "fixed"
            begun = InitialCondition(one, value, fixed, loops, self.context.place(s.span), unit=si(dimension).text)
            self.declarations.add_initial(begun, override)

    def _loop_over_slice(self, target: syntax.Expr, stack: ExitStack) -> syntax.Expr:
        """`x[1..n].f` becomes a loop over x[i].f."""
        # the range may stand further in: cell[1..n].R.f
        if isinstance(target, syntax.Member):
            return syntax.Member(self._loop_over_slice(target.base, stack), target.name, target.span)
        if isinstance(target, syntax.Prime):
            return syntax.Prime(self._loop_over_slice(target.base, stack), target.span)
        # one loop for each index that is a range
        if isinstance(target, syntax.Item) and any(isinstance(i, syntax.Range) for i in target.indices):
            at: list[syntax.Index] = []
            for k, index in enumerate(target.indices):
                if isinstance(index, syntax.Range):
                    name = f"i{k + 1}"
                    first, last = self.context.bounds(index)
                    stack.enter_context(self.resolver.loop(name, first, last))
                    at.append(syntax.Name(name, index.span))
                else:
                    at.append(index)
            return syntax.Item(target.base, tuple(at), target.span)
        # a whole array by its name: a loop over each of its dimensions
        if isinstance(target, syntax.Name):
            symbol = self.context.scope.find(target.name)
            shape = symbol.family.shape if isinstance(symbol, (UnknownSymbol, BranchSymbol)) else ()
            if isinstance(symbol, InstanceSymbol) and len(symbol.spaces) == 1:
                shape = symbol.spaces[0].around[len(self.context.current.around) :]
            if shape:
                names = []
                for k, (first, last) in enumerate(shape):
                    stack.enter_context(self.resolver.loop(f"i{k + 1}", first, last))
                    names.append(syntax.Name(f"i{k + 1}", target.span))
                return syntax.Item(target, tuple(names), target.span)
        return target

    def require(self, s: syntax.RequireStatement) -> None:
        """`require condition`."""
        node = self.resolver.condition(s.condition)
        self.parts.requirements.append(Requirement(node, self.resolver.loops, self.context.place(s.span), s.condition))

    def expect(self, s: syntax.ExpectStatement) -> None:
        """`expect`, in a model or in a scene."""
        moment = s.moment or "always"
        at = None
        if s.at is not None:
            at = self.resolver.scalar_of(s.at, dim.TIME, "E208", "expect at: an instant is wanted, {} found")
        self.resolver.statics = moment == "static"
        try:
            left, right = self.resolver.scalar(s.left), self.resolver.scalar(s.right)
            what = f"expect {self.context.source_text(s.left.span)[:40]}"
            dimension = self._sides(what, left, right, s.right, s.left, s.right)
            message = f"expect: within is in {{}}, wants {dim.show(dimension)}"
            within = None if s.within is None else self.resolver.scalar_of(s.within, dimension, "E208", message)
        finally:
            self.resolver.statics = False
        for side, node in ((s.left, left.node), (s.right, right.node)) if moment == "static" else ():
            if any(n.op in ("var", "time") for n in ex.topological([node])):
                message = f"'{self.context.source_text(side.span)}' is no static quantity: only a run knows it"
                raise self.resolver.fail("E908", message, side.span, help="expect always: ..., finally: or at 1 s: ...")
        text = self.context.source_text(s.span)
        self.parts.expectations.append(
            Expectation(
                moment, at, s.op, left.node, right.node, within, si(dimension), text, self.context.place(s.span)
            )
        )

    def _when(self, s: syntax.WhenStatement) -> None:
        """`when`: an event where its condition becomes true."""
        events.when(self.context, s)

    def _every(self, s: syntax.EveryStatement) -> None:
        """`every`: an event in each period."""
        events.every(self.context, s)

    def golden(self, s: syntax.GoldenStatement) -> None:
        """`expect golden`, in a model or in a scene."""
        within = self.resolver.scalar_of(s.within, NONE, "E208", "expect golden: within is a ratio, {} found")
        self.parts.goldens.append(Golden(s.file, within, self.context.place(s.span)))


STATEMENTS: dict[type, Callable[..., None]] = {
    syntax.EnergyStatement: Statements._energy,
    syntax.ContentStatement: Statements._content,
    syntax.WorkStatement: Statements._work,
    syntax.DynamicStatement: Statements._dynamic,
    syntax.InitStatement: Statements.initial,
    syntax.RequireStatement: Statements.require,
    syntax.ExpectStatement: Statements.expect,
    syntax.GoldenStatement: Statements.golden,
    syntax.WhenStatement: Statements._when,
    syntax.EveryStatement: Statements._every,
}


def _parts(node: Node, loops: tuple[Loop, ...]) -> list[tuple[Node, tuple[Loop, ...]]]:
    """A content as contents that add up to it: of its sums over friction each element is a content of its own."""
    sums = [n for n in ex.topological([node]) if n.op == "reduce" and n.data[0] == "sum"]
    if not any(friction.has_friction(n.args[2]) for n in sums):
        return [(node, loops)]
    if node.op == "sum":
        of_terms = [(c, part) for c, n in zip(node.data[1], node.args, strict=True) for part in _parts(n, loops)]
        constant = [(ex.const(node.data[0]), loops)] if node.data[0] else []
        return [*constant, *((ex.scale(c, n), inside) for c, (n, inside) in of_terms)]
    factors = zip(node.args, node.data, strict=True) if node.op == "mul" else [(node, 1.0)]
    sums = [n for n, power in factors if n.op == "reduce" and n.data[0] == "sum" and power == 1.0]
    if len(sums) != 1:
        return [(node, loops)]
    first, last, body = sums[0].args
    return _parts(ex.substitute(node, {sums[0]: body}), (*loops, Loop(sums[0].data[1], first, last)))
