"""Events and inequalities: discrete variables, `when`, `every`, constraints that hold at times, set-valued friction.

What an event reads is observed beside the traced quantities, so every arrow of the compiler carries it as it carries
those: a relation a > b is the observation a - b, the value of an action another.  A constraint that holds at times is
an equality among the rows, and a `Switch` that says when; dry friction, `c*setsign(f)` of an element's own flow and
`c*abs(u)` in a content, becomes the effort c*sense with a sense that events set, and psi: u = 0, which holds while the
bodies stick.  In any other relation `setsign(u)` is an unknown, closed by u = 0 or by the sense (`relation`).
"""

from __future__ import annotations

import math

from sysdyn.dsl.elaborate.parts import ElaborationContext
from sysdyn.dsl.model import dimensions as dim
from sysdyn.dsl.model import expression as ex
from sysdyn.dsl.model.calculus import derivative, time_derivative
from sysdyn.dsl.model.expression import Node
from sysdyn.dsl.model.network import (
    Action,
    Constraint,
    Event,
    Loop,
    Observation,
    Parameter,
    Unknown,
    loop_indices,
    loop_ranges,
)
from sysdyn.dsl.model.units import NONE, Dimension, Unit, si
from sysdyn.dsl.names.calls import walk
from sysdyn.dsl.names.failures import Failed
from sysdyn.dsl.names.laws import LawOf
from sysdyn.dsl.names.symbols import Definition, ParameterSymbol, Typed, Vector
from sysdyn.dsl.text.diagnostics import Place
from sysdyn.dsl.tree import syntax
from sysdyn.values import dataclass

BESIDE = 1e-20
"""m/s and the like: a flow in the plane that is no flow yet, and has a direction."""


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


def discrete(frame: ElaborationContext, s: syntax.Discrete) -> None:
    """`discrete g = 1`: a parameter that events assign."""
    decl, resolver = s.decl, frame.resolver
    own = resolver.loops[len(frame.current.loops) :]
    if own and not decl.indices:
        raise resolver.fail("E806", f"'{decl.name}' needs its loop variable: {decl.name}[i]", decl.span)
    found = resolver.resolve(s.value)
    items = found.items if isinstance(found, Vector) else (found,)
    value = next((i for i in items if i.dimension is not None), items[0])
    unit = frame.unit(s.unit) if s.unit else si(value.dimension or NONE)
    for item in items:
        if item.dimension is not None and item.dimension != unit.dimension:
            have = dim.show(item.dimension)
            message = f"'{decl.name}' is declared {dim.show(unit.dimension)} but starts at {have}"
            raise resolver.fail("E207", message, s.value.span)
        for inner in ex.variables(item.node) - {ex.time()}:
            message = f"the initial value of '{decl.name}' depends on '{inner}'"
            raise resolver.fail("E807", message, s.value.span, help="parameters, constants and t only")
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
    frame.parts.discretes.add(family.name)


def _number(value: Typed) -> Node:
    """A condition as 1 or 0."""
    return ex.conditional(value.node, ex.const(1.0), ex.const(0.0)) if value.truth else value.node


# -- when, every -------------------------------------------------------------------------------------------


def when(frame: ElaborationContext, s: syntax.When) -> None:
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


def every(frame: ElaborationContext, s: syntax.Every) -> None:
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

    def of(node: Node) -> Node:
        return ex.substitute(node, change) if change else node

    condition = None if draft.condition is None else _watched(frame, of(draft.condition), draft.place)
    period = None if draft.period is None else of(draft.period)
    actions = [(of(a.target), watch(frame, of(a.value), a.dimension, a.place), a.place) for a in draft.actions]
    return Event(draft.name, condition, period, tuple(Action(*a) for a in actions), draft.place)


def _discretes(frame: ElaborationContext, root: Node) -> bool:
    return any(n.op == "param" and n.data in frame.parts.discretes for n in ex.topological([root]))


def _watched(frame: ElaborationContext, condition: Node, place: Place) -> Node:
    """The condition with every comparison as one of an observation with zero."""
    change: dict[Node, Node] = {}
    for node in ex.topological([condition]):
        if node.op == "cmp":
            left, right = node.args
            moves = "moves" if ex.variables(node) else "rests"
            name = watch(frame, ex.sub(left, right), None, place)
            change[node] = ex.compare(node.data, ex.var(name, moves), ex.const(0.0))
    return ex.substitute(condition, change)


def watch(frame: ElaborationContext, node: Node, dimension: Dimension | None, place: Place) -> str:
    """The name of an observation of a node."""
    name = f"event {len(frame.parts.watched)}"
    frame.parts.watched.append(Observation(name, node, si(dimension or NONE), name, place, stored=False))
    return name


def _actions(frame: ElaborationContext, actions: tuple[syntax.Action, ...]) -> tuple[Assigned, ...]:
    """Assignments of an event, each to a state, a discrete or a flow, of its kind and dimension."""
    found: list[Assigned] = []
    for action in actions:
        if isinstance(action, syntax.Broken):  # its syntax was complained of
            continue
        target, truth = _target(frame, action)
        value = frame.resolver.scalar_or_truth(action.value)
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
        if any(a.target is target.node for a in found):
            raise frame.resolver.fail("E704", f"the event assigns {target.node} twice", action.span)
        found.append(Assigned(target.node, _number(value), target.dimension, frame.place(action.span)))
    return tuple(found)


def _target(frame: ElaborationContext, action: syntax.Action) -> tuple[Typed, bool]:
    """What an action assigns: the param of a discrete variable, a state, a flow; and whether it is a condition."""
    value = frame.resolver.scalar_or_truth(action.target)
    node = value.node
    if value.truth and node.op == "cmp":  # a discrete condition reads `param != 0`
        node = node.args[0]
    if node.op == "param" and node.data in frame.parts.discretes:
        return Typed(node, value.dimension), value.truth
    if node.op == "var":
        name, kind, order = node.data
        if kind == "s" and order == 0:
            return value, False
        if (kind, order) in (("q", 1), ("f", 0), ("nf", 0), ("nq", 1)):
            return Typed(ex.var(name, "f", *node.args), value.dimension), False
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


def guarded(frame: ElaborationContext, s: syntax.Constraint, constraint: Constraint) -> Constraint:
    """The constraint as a row; where it holds at times only, the switch that says when."""
    guard = restitution = None
    for item in s.guards:
        if item.kind == "while":
            guard = _guard(frame, item)
        else:
            message = f"{s.kind} {s.decl.name}: restitution is in {{}}, wants a ratio"
            restitution = frame.resolver.wanted(item.expr, NONE, "E208", message)
            if ex.variables(restitution) or _discretes(frame, restitution):
                message = f"{s.kind} {s.decl.name}: restitution is one number for the whole run; it reads what moves"
                help_ = "a parameter; of several, a phi each, 'while' a discrete condition holds"
                raise frame.resolver.fail("E807", message, item.expr.span, help=help_)
            if s.relation == "=" or s.kind != "phi":
                what = "an equality" if s.relation == "=" else f"a {s.kind}"
                message = f"{s.kind} {s.decl.name}: restitution on {what}"
                raise frame.resolver.fail("E514", message, item.span, help="phi ... >=")
    if s.relation == "=" and guard is None:
        return constraint
    if s.kind == "gamma":
        what = "an inequality" if s.relation != "=" else "'while'"
        raise frame.resolver.fail("N608", f"gamma {s.decl.name}: {what} of a gamma is not supported yet", s.span)
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


def sticking(
    frame: ElaborationContext, root: Node, label: str, at: tuple[Node, ...], loops: tuple[Loop, ...], place: Place
) -> Node:
    """A law or content with its set-valued terms c*setsign(u), c*abs(u) as c*sense and c*sense*u; the switches that
    say which sense, and psi: u = 0 for sticking.
    """
    again = _said_before(frame, label)
    own = loop_indices(loops)
    for k, node in enumerate(ex.calls(root, "setsign")):
        name = f"{label} sticking" + (f" {k + 1}" if k else "")
        sense = _sense(frame, f"{name} sense" + (f" {again + 1}" if again else ""), own, loops, place)
        inner = node.args[0]
        mark = ex.var("#sign", "s")
        bound = derivative(ex.substitute(root, {node: mark}), mark)
        if mark in ex.variables(bound):
            frame.report.error("E705", "setsign enters this law in another way than c*setsign(f)", place)
            return ex.substitute(root, {node: ex.const(0.0)})
        _stick(frame, name, (at, loops), (inner, bound, sense), place, label)
        root = ex.substitute(root, {node: sense})
    return root


def of_law(
    frame: ElaborationContext, law: LawOf, label: str, at: tuple[Node, ...], loops: tuple[Loop, ...], place: Place
) -> Node:
    """The law of a branch: dry friction of its own flow sticks by a reaction, else it is a relation."""
    terms = [n.args[0] for n in ex.calls(law.law, "setsign")]
    if law.kind in ("kinetic", "potential") and not all(map(_steady, terms)):
        return law.law
    flow = ex.var(label, "bf", *at)
    if law.kind == "dissipator" and law.side == "e" and all(_steady(ex.sub(u, flow)) for u in terms):
        return sticking(frame, law.law, label, at, loops, place)
    own = {"e": flow, "f": ex.var(label, "be", *at)}.get(law.side) if law.kind == "dissipator" else None
    return relation(frame, law.law, ex.var(label, f"b{law.side}", *at), label, loops, place, absorbs=own)


def relation(
    frame: ElaborationContext,
    text: Node,
    given: Node,
    label: str,
    loops: tuple[Loop, ...],
    place: Place,
    *,
    absorbs: Node | None = None,
) -> Node:
    """The text of a relation given = text with each term c*setsign(u) as c*s: s closes  u = 0  where that holds, else
    s = sense, the sign of u.  It holds as long as c*s, what the others leave, is within abs(c): a relation may be
    written with either sign of c.  Where u is what a dissipator `absorbs` by, c itself is the bound, which is not
    negative.  A c that a reaction tells is watched (aim).  Where u moves at finite rates alone it is a sign, which may
    slide (forms/corners).
    """
    at, shape = loop_indices(loops), loop_ranges(loops)
    change: dict[Node, Node] = {}
    made: list[tuple[Node, Node]] = []
    again = _said_before(frame, label)
    for node in ex.calls(text, "setsign"):
        u = ex.substitute(node.args[0], change)
        if _steady(u):
            change[node] = ex.call("sign", u)
            continue
        name = f"{label} set" + (f" {again + len(made) + 1}" if again + len(made) else "")
        change[node] = ex.var(name, "e", *at)
        frame.parts.unknowns.append(Unknown(name, shape, si(NONE), place))
        made.append((change[node], u))
    text = ex.substitute(text, change)
    root = ex.sub(given, text)
    for s, u in made:
        factor, name = derivative(root, s), s.data[0]
        inside = {n for n in ex.topological([u, factor]) if n.op == "index"} - set(at)
        if s in ex.variables(factor) or ex.is_const(factor, 0.0) or inside:
            said = f"setsign enters {label} in another way than c*setsign(u)"
            frame.report.error("E705", said, place, help="implicit s: 1, closed by gamma set: s = setsign(u)")
            raise Failed
        sense, holds = (_sense(frame, f"{name} {what}", at, loops, place) for what in ("sense", "holds"))
        row = ex.conditional(ex.compare("!=", holds, ex.const(0.0)), u, ex.sub(s, sense))
        frame.said(Constraint("gamma", name, at, row, loops, si(NONE), place))
        rest = ex.substitute(root, {s: ex.const(0.0)})
        left = ex.conditional(ex.compare(">=", factor, ex.const(0.0)), ex.neg(rest), rest)
        bound = ex.neg(factor) if u is absorbs else ex.call("abs", factor)
        told = u is not absorbs and any(n.data[1] in ("kappa", "mu") for n in ex.variables(factor) if n.op == "var")
        aim = (factor,) if told else ()
        draft = Draft(name, at, loops, "relation", place, si(NONE), u, left, label, bound, sense, aim=aim, holds=holds)
        frame.parts.drafts.append(draft)
    return text


def _said_before(frame: ElaborationContext, label: str) -> int:
    """Switches of the elements of one label so far, which may be said one by one."""
    return sum(draft.element == label for draft in frame.parts.drafts)


def _steady(u: Node) -> bool:
    """Whether a value moves at finite rates alone: of displacements, states and time."""
    return all(n.op == "time" or (n.data[1] in ("q", "nq", "bq", "s") and not n.data[2]) for n in ex.variables(u))


def has_friction(root: Node) -> bool:
    """Whether a size of flows stands in it."""
    return any(
        n.op == "call" and n.data in ("abs", "hypot") and any(map(_rates, n.args)) for n in ex.topological([root])
    )


def set_valued(frame: ElaborationContext, root: Node, loops: tuple[Loop, ...], place: Place) -> Node:
    """A content D with its terms c*abs(u) of flows as those of set-valued friction (decision 7 of the language)."""
    at = loop_indices(loops)
    for node in ex.topological([root]):
        if node.op != "call" or node.data not in ("abs", "hypot") or not any(map(_rates, node.args)):
            continue
        if any(n.op == "reduce" and node in ex.topological([n.args[2]]) for n in ex.topological([root])):
            continue
        mark = ex.var("#abs", "s")
        bound = ex.substitute(derivative(ex.substitute(root, {node: mark}), mark), {mark: ex.const(0.0)})
        if bound.op == "const" and (bound.data == 0.0 or not math.isfinite(bound.data)):
            continue  # no corner at rest: abs(f)^3 is smooth
        name = f"content of line {place.start[0]}" + (f" ({len(frame.parts.drafts)})" if frame.parts.drafts else "")
        sense = _sense(frame, f"{name} sense", at, loops, place)
        if node.data == "abs":
            _stick(frame, name, (at, loops), (node.args[0], bound, sense), place)
            root = ex.substitute(root, {node: ex.mul(sense, node.args[0])})
        else:
            speed = _stick_in_plane(frame, name, (at, loops), (node, bound, sense), place)
            root = ex.substitute(root, {node: ex.mul(sense, speed)})
    return root


def _stick_in_plane(
    frame: ElaborationContext,
    name: str,
    where: tuple[tuple[Node, ...], tuple[Loop, ...]],
    what: tuple[Node, Node, Node],
    place: Place,
) -> Node:
    """The speed abs(f) of friction in the plane, continued through zero along the direction of a flow n in which it
    slips: sign((f + n) n) abs(f + n), whose gradient is the direction of f, and that of n where f is less than n.
    """
    (at, loops), (node, bound, sense) = where, what
    unit, flows = si(NONE), node.args
    n = tuple(  # any at first: at rest there is none
        _sense(frame, f"{name} direction {k}", at, loops, place, begins) for k, begins in ((1, BESIDE), (2, 0.0))
    )
    labels = (name, f"{name} across")
    for label, flow in zip(labels, flows, strict=True):
        frame.said(Constraint("psi", label, at, flow, loops, unit, place))
    multipliers = tuple(ex.var(label, "mu", *at) for label in labels)
    along = ex.div(ex.add(*(ex.mul(a, b) for a, b in zip(n, flows, strict=True))), ex.call("hypot", *n))
    value = ex.sub(along, ex.scale(0.5, node))
    draft = Draft(
        name, at, loops, "planar", place, unit, value, ex.call("hypot", *multipliers), bound=bound, sense=sense,
        rate=time_derivative(along), aim=(*flows, *multipliers, node), direction=n,
    )  # fmt: skip
    frame.parts.drafts.append(draft)
    frame.parts.drafts.append(Draft(labels[1], at, loops, "follows", place, unit, flows[1], multipliers[1]))
    beside = [ex.add(f, d) for f, d in zip(flows, n, strict=True)]
    forward = ex.call("sign", ex.add(*(ex.mul(d, b) for d, b in zip(n, beside, strict=True))))
    return ex.mul(forward, ex.call("hypot", *beside))


def _rates(root: Node) -> bool:
    return any(n.op == "var" and (n.data[1] in ("f", "nf", "bf") or n.data[2] == 1) for n in ex.variables(root))


def _sense(
    frame: ElaborationContext,
    name: str,
    at: tuple[Node, ...],
    loops: tuple[Loop, ...],
    place: Place,
    begins: float = 0.0,
) -> Node:
    """A parameter that holds the sense of a slip: 1, -1, or 0 while it sticks; or a part of its direction."""
    shape = loop_ranges(loops) if at else ()
    indices = tuple(loop.index for loop in loops) if at else ()
    parameter = Parameter(name, shape, si(NONE), (ex.const(begins),), indices, place)
    frame.parts.parameters[parameter.name] = parameter
    frame.parts.discretes.add(parameter.name)
    return ex.param(parameter.name, *at)


def _stick(
    frame: ElaborationContext,
    name: str,
    where: tuple[tuple[Node, ...], tuple[Loop, ...]],
    what: tuple[Node, Node, Node],
    place: Place,
    element: str = "",
) -> None:
    """Dry friction: a set-valued effort with its bound and the sense of the motion."""
    (at, loops), (value, bound, sense) = where, what
    unit = si(NONE)
    frame.said(Constraint("psi", name, at, value, loops, unit, place))
    multiplier = ex.var(name, "mu", *at)
    frame.parts.drafts.append(Draft(name, at, loops, "friction", place, unit, value, multiplier, element, bound, sense))
