"""Events and inequalities: discrete variables, `when`, `every`, constraints that hold at times.

What an event reads is observed beside the traced quantities, so every arrow of the compiler carries it as it carries
those: a relation a > b is the observation a - b, the value of an action another.  A constraint that holds at times is
an equality among the rows, and a `Switch` that says when (friction: `friction.py`).
"""

from __future__ import annotations

from sysdyn.dsl.elaborate.parts import ElaborationContext
from sysdyn.dsl.model import dimensions as dim
from sysdyn.dsl.model import expression as ex
from sysdyn.dsl.model.expression import Node
from sysdyn.dsl.model.network import (
    Action,
    Constraint,
    Event,
    Loop,
    Observation,
    Parameter,
)
from sysdyn.dsl.model.units import NONE, Dimension, Unit, si
from sysdyn.dsl.names.calls import walk
from sysdyn.dsl.names.symbols import Definition, ParameterSymbol, Typed, Vector
from sysdyn.dsl.text.diagnostics import Place
from sysdyn.dsl.tree import syntax
from sysdyn.values import dataclass


@dataclass(frozen=True, slots=True)
class Draft:
    """A switch of an array of statements: its expressions under loops (see network.Switch)."""

    label: str
    at: tuple[Node, ...]
    loops: tuple[Loop, ...]
    kind: str
    place: Place
    unit: Unit
    value: Node
    multiplier: Node
    element: str = ""
    bound: Node | None = None
    sense: Node | None = None
    guard: Node | None = None
    restitution: Node | None = None
    rate: Node | None = None
    aim: tuple[Node, ...] = ()
    direction: tuple[Node, ...] = ()
    holds: Node | None = None


@dataclass(frozen=True, slots=True)
class Assigned:
    """`target := value` under loops."""

    target: Node
    value: Node
    dimension: Dimension | None
    place: Place


@dataclass(frozen=True, slots=True)
class EventDraft:
    """An event of an array of statements: its expressions under loops, its comparisons as written (network.Event)."""

    name: str
    condition: Node | None
    period: Node | None
    actions: tuple[Assigned, ...]
    loops: tuple[Loop, ...]
    place: Place


# -- discrete variables ------------------------------------------------------------------------------------


def discrete(frame: ElaborationContext, s: syntax.DiscreteStatement) -> None:
    """`discrete g = 1`: a parameter that events assign."""
    decl, resolver = s.decl, frame.resolver
    own = resolver.loops[len(frame.current.loops) :]
    if own and not decl.indices:
        raise resolver.fail("E806", f"'{decl.name}' needs its loop variable: {decl.name}[i]", decl.span)
    found = resolver.resolve(s.value)
    items = found.items if isinstance(found, Vector) else (found,)
    value = next((i for i in items if i.dimension is not None), items[0])
    unit = frame.unit(s.unit) if s.unit else si(value.dimension or NONE)
    # its first value is a constant, or of t
    for item in items:
        if item.dimension is not None and item.dimension != unit.dimension:
            have = dim.show(item.dimension)
            message = f"'{decl.name}' is declared {dim.show(unit.dimension)} but starts at {have}"
            raise resolver.fail("E207", message, s.value.span)
        for inner in ex.variables(item.node) - {ex.time()}:
            message = f"the initial value of '{decl.name}' depends on '{inner}'"
            raise resolver.fail("E807", message, s.value.span, help="parameters, constants and t only")
    # a list has as many values as the array elements
    shape, place = frame.shape(decl), frame.place(decl.span)
    if not frame.fills(found, shape):
        message = f"'{decl.name}' has {len(items)} values, which do not fit its shape"
        raise resolver.fail("E805", message, s.value.span)
    family = frame.current.family(decl.name, shape)
    frame.enter(ParameterSymbol(decl.name, family, unit.dimension, value.truth, place))
    nodes = tuple(_number(i) for i in items)
    around = tuple(n.data if n.op == "index" else f"_{k}" for k, n in enumerate(family.prefix))
    indices = (*around, *(loop.index for loop in own))
    frame.parts.parameters[family.name] = Parameter(family.name, family.whole, unit, nodes, indices, place)
    # a parameter for all that reads it, which events may assign
    frame.parts.discretes.add(family.name)


def _number(value: Typed) -> Node:
    """A condition as 1 or 0."""
    return ex.conditional(value.node, ex.const(1.0), ex.const(0.0)) if value.truth else value.node


# -- when, every -------------------------------------------------------------------------------------------


def when(frame: ElaborationContext, s: syntax.WhenStatement) -> None:
    """`when condition { target := value }`."""
    resolver = frame.resolver
    condition = resolver.condition(s.condition)
    moving = any(ex.variables(n) or _discretes(frame, n) for n in ex.topological([condition]) if n.op == "cmp")
    if not moving and _reads_input(frame, s.condition):
        return  # what is given to it stands still: it never comes true
    if not moving:
        raise resolver.fail("E701", "'when' condition has no relation that can cross", s.condition.span)
    place = frame.place(s.span)
    name = " ".join(resolver.source.text[s.condition.span.start : s.condition.span.end].split())
    _enter(frame, EventDraft(f"when {name}", condition, None, _actions(frame, s.actions), resolver.loops, place))


def _reads_input(frame: ElaborationContext, condition: syntax.Expr) -> bool:
    """Whether an input stands in a condition, by way of definitions too: what it is given may stand still."""
    seen: set[str] = set()
    stack = [condition]
    while stack:
        names = {node.name for node in walk(stack.pop()) if isinstance(node, syntax.Name)} - seen
        seen |= names
        for name in names:
            symbol = frame.scope.find(name)
            given = isinstance(symbol, ParameterSymbol) and symbol.family.name in frame.parts.inputs
            if given or (isinstance(symbol, Definition) and symbol.kind == "input"):
                return True
            if isinstance(symbol, Definition) and symbol.kind in ("let", "output"):
                stack.append(symbol.expression)
    return False


def every(frame: ElaborationContext, s: syntax.EveryStatement) -> None:
    """`every period { target := value }`."""
    message = "the period of 'every' is in {}, wants s"
    value = frame.resolver.scalar(s.period)
    if value.dimension == dim.quotient(NONE, dim.TIME):
        text = " ".join(frame.resolver.source.text[s.period.span.start : s.period.span.end].split())
        help_ = f"every 1/({text}) {{ ... }}"
        raise frame.resolver.fail("E703", f"{message.format('1/s')}: a frequency", s.period.span, help=help_)
    period = frame.resolver.fitting(value, s.period, dim.TIME, "E703", message)
    if ex.variables(period) or _discretes(frame, period) or (ex.is_const(period) and not period.data > 0.0):
        text = " ".join(frame.resolver.source.text[s.period.span.start : s.period.span.end].split())
        message = f"the period of 'every' must be a positive constant, not {text}"
        raise frame.resolver.fail("E703", message, s.period.span)
    place = frame.place(s.span)
    name = " ".join(frame.resolver.source.text[s.period.span.start : s.period.span.end].split())
    _enter(frame, EventDraft(f"every {name}", None, period, _actions(frame, s.actions), frame.resolver.loops, place))


def _enter(frame: ElaborationContext, draft: EventDraft) -> None:
    """An event; one of an array waits until the sizes are known."""
    if draft.loops:
        frame.parts.event_drafts.append(draft)
    else:
        frame.parts.events.append(event_of(frame, draft, {}))


def event_of(frame: ElaborationContext, draft: EventDraft, change: dict[Node, Node]) -> Event:
    """One element of an event, with its watched values; change: numbers for the loop variables."""

    def in_element(node: Node) -> Node:
        return ex.substitute(node, change) if change else node

    condition = (
        None if draft.condition is None else _compare_observations(frame, in_element(draft.condition), draft.place)
    )
    period = None if draft.period is None else in_element(draft.period)
    actions = [
        (in_element(a.target), watch(frame, in_element(a.value), a.dimension, a.place), a.place) for a in draft.actions
    ]
    return Event(draft.name, condition, period, tuple(Action(*a) for a in actions), draft.place)


def _discretes(frame: ElaborationContext, root: Node) -> bool:
    return ex.reads(root, frame.parts.discretes)


def _compare_observations(frame: ElaborationContext, condition: Node, place: Place) -> Node:
    """The condition with every comparison as one of an observation with zero."""
    change: dict[Node, Node] = {}
    for node in ex.topological([condition]):
        if node.op == "cmp":
            left, right = node.args
            read = {n.op for n in ex.variables(node)}
            kind = "rests" if not read else "ticks" if read == {"time"} else "moves"
            name = watch(frame, ex.sub(left, right), None, place)
            change[node] = ex.compare(node.data, ex.var(name, kind), ex.const(0.0))
    return ex.substitute(condition, change)


def watch(frame: ElaborationContext, node: Node, dimension: Dimension | None, place: Place) -> str:
    """The name of an observation of a node."""
    name = f"event {len(frame.parts.watched)}"
    frame.parts.watched.append(Observation(name, node, si(dimension or NONE), name, place, stored=False))
    return name


def _actions(frame: ElaborationContext, actions: tuple[syntax.ActionStatement, ...]) -> tuple[Assigned, ...]:
    """Assignments of an event, each to a state, a discrete or a flow, of its kind and dimension."""
    found: list[Assigned] = []
    for action in actions:
        if isinstance(action, syntax.BrokenStatement):  # its syntax was complained of
            continue
        target, truth = _target(frame, action)
        value = frame.resolver.scalar_or_truth(action.value)
        # `on := 3`, `n := 2 m`
        if value.truth != truth or (
            not truth and value.dimension is not None and value.dimension != (target.dimension or NONE)
        ):
            have = "a condition" if value.truth else dim.show(value.dimension)
            want = "a condition" if truth else dim.show(target.dimension)
            help_ = "true, false or a comparison" if truth else None
            if not truth and not value.truth:
                help_ = frame.resolver.missing(value.dimension, target.dimension or NONE, action.value)
            message = f"{target.node} := ...: {want} expected, {have} found"
            raise frame.resolver.fail("E208", message, action.value.span, help=help_)
        # two assignments to one variable at one instant have no order
        if any(a.target is target.node for a in found):
            raise frame.resolver.fail("E704", f"the event assigns {target.node} twice", action.span)
        found.append(Assigned(target.node, _number(value), target.dimension, frame.place(action.span)))
    return tuple(found)


def _target(frame: ElaborationContext, action: syntax.ActionStatement) -> tuple[Typed, bool]:
    """What an action assigns: the param of a discrete variable, a state, a flow; and whether it is a condition."""
    value = frame.resolver.scalar_or_truth(action.target)
    node = value.node
    # a discrete condition is read as `param != 0`: the param is assigned
    if value.truth and node.op == "cmp":  # a discrete condition reads `param != 0`
        node = node.args[0]
    # `n := n + 1`
    if node.op == "param" and node.data in frame.parts.discretes:
        return Typed(node, value.dimension), value.truth
    # `s := 0` of a state, `x' := -e*x'` of a flow: the coordinate itself does not jump
    if node.op == "var":
        name, kind, order = node.data
        if kind == "s" and order == 0:
            return value, False
        if (kind, order) in (("q", 1), ("f", 0), ("nf", 0), ("nq", 1)):
            return Typed(ex.var(name, "f", *node.args), value.dimension), False
    # anything else; of a parameter, a displacement and a branch the help says what may be assigned
    text = " ".join(frame.resolver.source.text[action.target.span.start : action.target.span.end].split())
    message = f"event assigns {text} (only discrete variables, states and x' of a coordinate may jump)"
    help_ = f"discrete {text} = ... in place of its declaration" if node.op == "param" else None
    if node.op == "var" and node.data[1:] == ("q", 0):
        help_ = f"{text}' := ..., its rate"
    elif node.op == "var" and node.data[1] in ("be", "bf", "bq", "bp"):
        help_ = _instead(frame, node)
    raise frame.resolver.fail("E702", message, action.target.span, help=help_)


def _instead(frame: ElaborationContext, node: Node) -> str:
    """What an event may assign in place of a quantity of a branch."""
    branch = next((b for b in frame.parts.branches if b.name == node.data[0]), None)
    ends = [e.node for e in (branch.plus, branch.minus) if e is not None and e.node] if branch is not None else []
    if node.data[1] in ("bf", "bp") and branch is not None and branch.domain.common == "flow" and ends:
        return (
            " or ".join(f"{name}.f := ..." for name in ends)
            + f", the flow of {'its node' if len(ends) == 1 else 'a node'}"
        )
    return "a source that acts for a short time; or a state with 'dynamic' in place of the element"


# -- constraints that hold at times --------------------------------------------------------------------------


def guard_constraint(frame: ElaborationContext, s: syntax.ConstraintStatement, constraint: Constraint) -> Constraint:
    """The constraint as a row; where it holds at times only, the switch that says when."""
    guard = restitution = None
    # `while c` says when it holds, `restitution e` how it bounces
    for item in s.guards:
        if item.kind == "while":
            guard = _guard(frame, item)
        else:
            message = f"{s.kind} {s.decl.name}: restitution is in {{}}, wants a ratio"
            restitution = frame.resolver.scalar_of(item.expr, NONE, "E208", message)
            if ex.variables(restitution) or _discretes(frame, restitution):
                message = f"{s.kind} {s.decl.name}: restitution is one number for the whole run; it reads what moves"
                help_ = "a parameter; of several, a phi each, 'while' a discrete condition holds"
                raise frame.resolver.fail("E807", message, item.expr.span, help=help_)
            # bouncing needs an inequality of displacements, `phi x >= 0`
            if s.relation == "=" or s.kind != "phi":
                what = "an equality" if s.relation == "=" else f"a {s.kind}"
                message = f"{s.kind} {s.decl.name}: restitution on {what}"
                raise frame.resolver.fail("E514", message, item.span, help="phi ... >=")
    # holds always: an ordinary row
    if s.relation == "=" and guard is None:
        return constraint
    if s.kind == "gamma":
        what = "an inequality" if s.relation != "=" else "'while'"
        raise frame.resolver.fail("N608", f"gamma {s.decl.name}: {what} of a gamma is not supported yet", s.span)
    # an equality that holds at times, or an inequality
    kind = "guarded" if s.relation == "=" else s.kind
    # a >= b is the row b - a: so its multiplier pushes a up and is positive
    node = ex.neg(constraint.expression) if s.relation == ">=" else constraint.expression
    value = constraint.expression if s.relation != "<=" else ex.neg(constraint.expression)
    multiplier = ex.var(constraint.name, "kappa" if s.kind == "phi" else "mu", *constraint.at)
    draft = Draft(
        constraint.name, constraint.at, constraint.loops, kind, constraint.place, constraint.unit, value, multiplier,
        guard=guard, restitution=restitution,
    )  # fmt: skip
    frame.parts.drafts.append(draft)
    return Constraint(
        constraint.kind, constraint.name, constraint.at, node, constraint.loops, constraint.unit, constraint.place
    )


def _guard(frame: ElaborationContext, guard: syntax.Guard) -> Node:
    node = frame.resolver.condition(guard.expr)
    if ex.variables(node) or not _discretes(frame, node):
        raise frame.resolver.fail(
            "E515", "'while' needs a discrete condition", guard.span, help="discrete locked = false, and a 'when'"
        )
    return node
