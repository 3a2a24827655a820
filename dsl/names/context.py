"""Where an expression is being resolved: scope, text, loops, report; and the entries that statements use.

The resolver's rules are spread over `names`, `members`, `arithmetic` and `calls`; each builds on this context.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from typing import Any

from sysdyn.dsl.model import dimensions as dim
from sysdyn.dsl.model import expression as ex
from sysdyn.dsl.model.affine import index_text, not_affine
from sysdyn.dsl.model.expression import Node
from sysdyn.dsl.model.network import Branch, Constraint, Loop
from sysdyn.dsl.model.unit_habits import common
from sysdyn.dsl.model.units import NONE, Dimension
from sysdyn.dsl.names import fitting, habits
from sysdyn.dsl.names.failures import Failed, Part, SeveralError
from sysdyn.dsl.names.fitting import Sight
from sysdyn.dsl.names.symbols import (
    Definition,
    InstanceSymbol,
    Scope,
    Space,
    Typed,
    Vector,
)
from sysdyn.dsl.text.diagnostics import Edit, Place, Report, SourceText
from sysdyn.dsl.tree import syntax
from sysdyn.values import dataclass

Value = Typed | Vector


@dataclass(slots=True)
class Use:
    """An index used on a family, to be checked against its shape once the sizes are known.

    given: of a list of values for the elements from shape[0] on, of which the last has index `value`, how many it has.
    """

    shape: tuple[Node, Node]
    value: Node
    loops: tuple[Loop, ...]
    name: str
    place: Place
    given: int | None = None


@dataclass(slots=True)
class Quadrature:
    """The integral of a power since the start (J): a dynamic variable that only reading it brings into being.

    first: the expression whose initial value it starts from; None: zero; power: found once all that is said is known.
    """

    power: Node | Callable[[], Node]
    shape: tuple[tuple[Node, Node], ...]
    dimension: Dimension
    place: Place
    first: Node | None = None


class Entered:
    """Inside a model or an instance: a context by hand, for a netlist enters hundreds of thousands."""

    __slots__ = ("_before", "_context", "_space")

    def __init__(self, context: Context, space: Space) -> None:
        self._context, self._space = context, space

    def __enter__(self) -> None:
        it, space = self._context, self._space
        self._before = it._bound, it._loops, it.file_scope, it.scope, it.source
        it._bound, it._loops, it.file_scope = dict(space.bound), list(space.loops), space.file_scope
        it.scope, it.source = space.scope, space.source

    def __exit__(self, *failed: object) -> None:
        it = self._context
        it._bound, it._loops, it.file_scope, it.scope, it.source = self._before


class Inside:
    """Back where a statement stands, with its loops and what was bound there: a context by hand as well."""

    __slots__ = ("_before", "_bound", "_context", "_loops")

    def __init__(self, context: Context, loops: tuple[Loop, ...], bound: dict[str, Value]) -> None:
        self._context, self._loops, self._bound = context, list(loops), bound

    def __enter__(self) -> None:
        it = self._context
        self._before = it._bound, it._loops
        it._bound, it._loops = self._bound, self._loops

    def __exit__(self, *failed: object) -> None:
        it = self._context
        it._bound, it._loops = self._before


class Context:
    """What is in sight, and what has been learnt on the way."""

    def __init__(self, report: Report) -> None:
        self.report = report
        self.uses: list[Use] = []
        self.whole: set[str] = set()  # parameters used as sizes or indices
        self.inputs: set[str] = set()  # parameters that are inputs: no sizes
        self.derived: dict[Node, tuple[tuple[Loop, ...], Place]] = {}  # differentiated by what is being read
        self.discretes: set[str] = set()  # parameters that events assign
        self.branches: list[Branch] = []  # those found so far
        self.laws: dict[str, Any] = {}  # of branches, by family (laws.LawOf)
        self.quadratures: dict[str, Quadrature] = {}  # integrals that are read: a state each
        self.awaken: Callable[[InstanceSymbol], None] = lambda symbol: None  # elaborates an instance now
        self.given: Callable[[Node], Node] = lambda node: node  # an index with the sizes that are given
        self.sizes_read = False  # numbers of sizes say what something means
        self.taken: Callable[..., Node]  # what an instance takes in at an end (elaborate/instances/port_efforts.py)
        self.constraints: dict[str, list[Constraint]] = {}
        self._quantities: dict[tuple[int, int, str, str], tuple[Scope, Typed]] = {}  # by scope (held), number, unit
        self._values: dict[tuple[Definition, bool], Value | None] = {}
        self._derived: dict[
            tuple[Definition, bool], dict[Node, tuple[tuple[Loop, ...], Place]]
        ] = {}  # in each of these
        self._applied: dict[
            tuple[syntax.FunctionDefinition, tuple[Node, ...]], Node | None
        ] = {}  # functions to arguments
        self._active: list[Definition] = []
        self._loops: list[Loop] = []
        self._bound: dict[str, Value] = {}  # loop variables, function arguments, an element's own variables
        self._names: dict[str, int] = {}
        self.chosen: dict[tuple[int, int, Node], tuple[Space, ...]] = {}  # statements of a label, by its k-th index
        self.chosen_read = 0  # how often it was asked: what was resolved meanwhile holds in this part of a loop alone
        self.scope = Scope()
        self.source = SourceText("", "")
        self.file_scope = self.scope
        self._unknown = ("E101", "unknown name '{}'")
        self.lenient = False  # what the chosen level lacks is a note (language, decision 5)
        self.virtual = False  # outputs and inputs are signals, held by virtual displacements
        self.complete = False  # all elements are known
        self.said = False  # and all that the model says of them
        self.statics = False  # static quantities are in sight (expect static)

    @contextmanager
    def entering_scope(self, scope: Scope, source: SourceText) -> Iterator[None]:
        """Resolve names in that scope and take spans as parts of that text."""
        before = self.scope, self.source
        self.scope, self.source = scope, source
        try:
            yield
        finally:
            self.scope, self.source = before

    def space(self, space: Space) -> Entered:
        """Resolve inside a model or an instance: its names, its text, its loops, nothing else bound."""
        return Entered(self, space)

    @contextmanager
    def bound(self, names: Mapping[str, Value]) -> Iterator[None]:
        """Bring values into sight that hide the scope's names."""
        before = self._bound
        self._bound = {**before, **names}
        try:
            yield
        finally:
            self._bound = before

    @property
    def free(self) -> bool:
        """Whether nothing is in sight but the scope's names."""
        return not self._bound and not self._loops

    def sight(self) -> dict[str, Value]:
        """What is bound here: to be brought into sight again later."""
        return dict(self._bound)

    def inside(self, loops: tuple[Loop, ...], sight: dict[str, Value]) -> Inside:
        """Go back to where a statement stands."""
        return Inside(self, loops, sight)

    @contextmanager
    def unknown_as(self, code: str, message: str) -> Iterator[None]:
        """Report unknown names under another code (message: with {} for the name)."""
        before, self._unknown = self._unknown, (code, message)
        try:
            yield
        finally:
            self._unknown = before

    @contextmanager
    def virtually(self) -> Iterator[None]:
        """Read the law of a modulus or a flow constraint: outputs and inputs stay marked as signals."""
        before, self.virtual = self.virtual, True
        try:
            yield
        finally:
            self.virtual = before

    @contextmanager
    def leniently(self) -> Iterator[None]:
        """What the chosen level of an instance lacks and another has is a note, and the statement is left out."""
        before, self.lenient = self.lenient, True
        try:
            yield
        finally:
            self.lenient = before

    @contextmanager
    def loop(self, name: str, first: Node, last: Node, unique: bool = False) -> Iterator[Loop]:
        """Bring a loop variable into sight; unique: under a name that no other loop has."""
        inner = name
        if unique or any(loop.index == name for loop in self._loops):
            self._names[name] = self._names.get(name, 0) + 1
            inner = f"{name}_{self._names[name]}"
        before = self._bound
        loop = Loop(inner, first, last)
        self._bound = {**before, name: Typed(ex.index(inner), NONE)}
        self._loops.append(loop)
        try:
            yield loop
        finally:
            self._loops.pop()
            self._bound = before

    def with_sizes(self, node: Node) -> Node:
        """An index or a bound with the sizes that are given, which what is resolved then depends on."""
        if not ex.is_const(node):
            self.sizes_read = True
            node = self.given(node)
        return node

    @contextmanager
    def narrowing(self, several: SeveralError, part: Part) -> Iterator[Loop]:
        """Inside one part of a loop that runs over several statements of a label."""
        k = next(k for k, loop in enumerate(self._loops) if loop.index == several.loop)
        loop = self._loops[k]
        inner = Loop(loop.index, later(loop.first, part.first), earlier(loop.last, part.last))
        self._loops[k] = inner
        try:
            with self.choosing(several, part):
                yield inner
        finally:
            self._loops[k] = loop

    @contextmanager
    def choosing(self, several: SeveralError, part: Part) -> Iterator[None]:
        """Where an index of a label means statements of this part."""
        before = self.chosen.get(several.key)
        self.chosen[several.key] = part.spaces
        try:
            yield
        finally:
            if before is None:
                del self.chosen[several.key]
            else:
                self.chosen[several.key] = before

    def spread(self, several: SeveralError, span: syntax.Span) -> Failed:
        """Report that nobody can cut the loop."""
        message = f"'{several.label}' is declared in several places, over which {several.loop.rpartition('.')[2]} runs"
        return self.fail("E806", message, span, help="one statement for each of these places")

    @contextmanager
    def aside(self) -> Iterator[dict[Node, tuple[tuple[Loop, ...], Place]]]:
        """What is differentiated within, of which nobody around knows."""
        before, self.derived = self.derived, {}
        try:
            yield self.derived
        finally:
            self.derived = before

    @property
    def loops(self) -> tuple[Loop, ...]:
        """The loops around the present statement, outermost first."""
        return tuple(self._loops)

    def bound_loops(self) -> list[str]:
        """Names of the loop variables in sight, as written."""
        return [n for n, v in self._bound.items() if isinstance(v, Typed) and v.node.op == "index"]

    def place(self, span: syntax.Span) -> Place:
        """A span of the present text."""
        return Place(self.source, span)

    def fail(self, code: str, message: str, at: syntax.Span | Place, **more: object) -> Failed:
        """Report an error at a span of the present text, or at a place; raise what is returned."""
        place = at if isinstance(at, Place) else self.place(at)
        more.setdefault("subject", habits.unitless_parameter(more.get("help")))
        self.report.error(code, message, place, **more)  # type: ignore[arg-type]
        return Failed()

    def fail_with_remedy(self, code: str, message: str, span: syntax.Span, remedy: habits.Remedy) -> Failed:
        """Report an error whose remedy may be certain; raise what is returned."""
        edit = None
        if remedy.meant is not None:
            edit = Edit(self.source.place(*(remedy.span or span)), remedy.meant)
        return self.fail(code, message, span, help=remedy.said, edit=edit)

    # -- entries -------------------------------------------------------------------------------------------

    def resolve(self, expression: syntax.Expr) -> Value:
        """The value of an expression."""
        raise NotImplementedError

    def through(self, port: syntax.Expr) -> Typed:
        """The energy that has gone into a component through one of its ports."""
        raise NotImplementedError

    def scalar(self, expression: syntax.Expr) -> Typed:
        """A scalar value of any dimension."""
        return self.one_number(self.resolve(expression), expression)

    def scalar_or_truth(self, expression: syntax.Expr) -> Typed:
        """A scalar value or a condition."""
        value = self.resolve(expression)
        if isinstance(value, Vector):
            raise self._no_array(expression)
        return value

    def one_number(self, value: Value, expression: syntax.Expr) -> Typed:
        """A value found before, where one number is wanted; expression: where it was found."""
        if isinstance(value, Vector):
            raise self._no_array(expression)
        self.is_number(value, expression)
        return value

    def _no_array(self, expression: syntax.Expr) -> Failed:
        message = "an array stands where one number is wanted"
        help_ = "an element of it: x[1]; sum(i in 1..n: x[i]), norm(x) and dot(x, y) make one number of all"
        return self.fail("E203", message, expression.span, help=help_)

    def scalar_of(self, expression: syntax.Expr, dimension: Dimension, code: str, message: str) -> Node:
        """A scalar of one dimension; otherwise code with message (its {} is what was found)."""
        return self.fitting(self.scalar(expression), expression, dimension, code, message)

    def fitting(self, value: Typed, expression: syntax.Expr, dimension: Dimension, code: str, message: str) -> Node:
        """The node of a value found before, of one dimension; else code with message (its {} is what was found)."""
        if value.dimension is not None and value.dimension != dimension:
            help_ = self.missing(value.dimension, dimension, expression)
            said = message if value.dimension else message.replace("in {}", "{}")
            raise self.fail(code, said.format(dim.show(value.dimension)), expression.span, help=help_)
        return value.node

    def condition(self, expression: syntax.Expr) -> Node:
        """A condition."""
        value = self.resolve(expression)
        if isinstance(value, Vector) or not value.truth:
            help_ = "compare it"
            if not isinstance(value, Vector) and value.dimension is not None:
                text = " ".join(self.source.text[expression.span.start : expression.span.end].split())
                zero = f"0 {common(value.dimension)}" if value.dimension else "0"
                help_ = f"{text} > {zero}, or another comparison"
            message = "a condition is wanted here: a comparison such as a < b"
            raise self.fail("E203", message, expression.span, help=help_)
        return value.node

    def whole_number(self, expression: syntax.Expr, what: str) -> Node:
        """An index or a bound: made of whole numbers, loop variables and dimensionless parameters."""
        value = self.scalar(expression)
        # x[2 m]
        if value.dimension not in (None, NONE):
            message = f"{what} is in {dim.show(value.dimension)}, not a number"
            text = " ".join(self.source.text[expression.span.start : expression.span.end].split())
            help_ = f"a number without unit: param {text} = 3" if text.isidentifier() else "a number without unit"
            raise self.fail("E805", message, expression.span, help=help_, subject=f"unit of {text}")
        # what varies in a run is no index; parameters that are used as one must be whole
        for node in ex.topological([value.node]):
            if node.op in ("var", "time", "table") or (node.op == "param" and node.data in self.discretes):
                raise self.fail(
                    "E807", f"{what} depends on '{index_text(node)}', which is no constant", expression.span
                )
            if node.op == "param" and node.data in self.inputs:
                raise self.fail(
                    "E807",
                    f"{what} depends on the input '{node.data}', which may vary",
                    expression.span,
                    help="a param",
                )
            if node.op == "param":
                self.whole.add(node.data)
            if node.op == "const" and node.data != node.data:
                raise Failed
        # x[1.5]
        if value.node.op == "const" and not float(value.node.data).is_integer():
            raise self.fail("E805", f"{what} is {value.node.data:g}, no whole number", expression.span)
        return value.node

    def missing(
        self, have: Dimension | None, want: Dimension | None, *within: syntax.Expr, dynamic: bool = False
    ) -> str | None:
        """What would make two dimensions agree (fitting.py); within: expressions of which the first has the dimension
        `have`, the second `want`; dynamic: the first is the rate of a state.
        """
        sight = Sight(self.scope, self.source, self.whole, dynamic)
        upside_down = fitting.divided_default(sight, have, want, within)
        if upside_down is None:
            return fitting.missing(sight, have, want, *within)
        parameter, number, quantity = upside_down
        value, unit = quantity.split(None, 1)
        message = f"'{parameter.name}' is in {dim.show(parameter.dimension)}, and is read as if it were in {unit}"
        help_ = f"'{number}/{quantity}' divides by {quantity}; '({number}/{value})*1 {unit}' is that part of a unit"
        self.report.error("E207", message, parameter.place, help=help_, subject=f"unit of {parameter.name}")
        return f"'{parameter.name}' is the cause, see there"

    def bare(self, expression: syntax.Expr) -> str | None:
        """The name of the one parameter among the factors of an expression that is a bare number."""
        found = fitting.bare(Sight(self.scope, self.source, self.whole), expression)
        return None if found is None else found[0]

    def is_number(self, value: Typed, e: syntax.Expr) -> None:
        """Report a condition in the place of a number."""
        if value.truth:
            text = " ".join(self.source.text[e.span.start : e.span.end].split())
            help_ = f"if {text.removeprefix('(').removesuffix(')')} then 1 else 0"
            raise self.fail("E203", "a condition stands where a number is wanted", e.span, help=help_)

    def add(self, a: Typed, b: Typed, span: syntax.Span) -> Typed:
        """The sum of two values of one dimension."""
        if None not in (a.dimension, b.dimension) and a.dimension != b.dimension:
            raise self.fail("E203", f"the two operands differ: {dim.show(a.dimension)} + {dim.show(b.dimension)}", span)
        return Typed(ex.add(a.node, b.node), a.dimension if a.dimension is not None else b.dimension)

    def index(self, index: syntax.Index) -> Node:
        """An affine index: loop variable + constant."""
        if isinstance(index, syntax.Range):
            raise self.fail("E806", "one element is wanted here, not a slice", index.span)
        node = self.whole_number(index, "an index")
        loops = _loops(node)
        if loops:
            rest = node
            for n in loops[:1]:
                rest = ex.sub(node, n)
            if len(loops) > 1 or _loops(rest):
                said = " in one loop variable: the array would have to be unrolled"
                written = " ".join(self.source.text[index.span.start : index.span.end].split())
                message, help_, _ = not_affine(node, said, written)
                raise self.fail("E806", message, index.span, help=help_)
        return node


def _loops(node: Node) -> list[Node]:
    """Loop variables of an index outside parameters: a size of a component in an array may be one for all of them."""
    found, stack = dict[Node, None](), [node]
    while stack:
        top = stack.pop()
        if top.op == "index":
            found.setdefault(top)
        stack += () if top.op == "param" else top.args
    return [*found]


def later(a: Node, b: Node) -> Node:
    """The larger of two bounds."""
    apart = ex.sub(a, b)
    if ex.is_const(apart):
        return a if apart.data >= 0 else b
    return ex.call("max", a, b)


def earlier(a: Node, b: Node) -> Node:
    """The smaller of two bounds."""
    apart = ex.sub(a, b)
    if ex.is_const(apart):
        return a if apart.data <= 0 else b
    return ex.call("min", a, b)
