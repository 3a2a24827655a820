"""Laws of elements: which edge of Paynter's diagram a law lies on, and what is wrong where it lies on none."""

from __future__ import annotations

from sysdyn.dsl.model import dimensions as dim
from sysdyn.dsl.model import expression as ex
from sysdyn.dsl.model.calculus import derivative, signals_held
from sysdyn.dsl.model.expression import Node
from sysdyn.dsl.model.paynter import REFLECTED
from sysdyn.dsl.names.calls import walk
from sysdyn.dsl.names.context import Context
from sysdyn.dsl.names.failures import Failed
from sysdyn.dsl.names.quantities import branch_dimension
from sysdyn.dsl.names.symbols import BranchSymbol, Definition, Typed
from sysdyn.dsl.tree import syntax
from sysdyn.values import dataclass

ONE_PORTS = ("kinetic", "potential", "dissipator", "effort", "flow")
TWO_PORTS = ("transformer", "gyrator")
_EDGES = {frozenset("pf"): "kinetic", frozenset("qe"): "potential", frozenset("ef"): "dissipator"}
_OTHER = {"kinetic": "pf", "potential": "qe", "dissipator": "ef"}


@dataclass(frozen=True, slots=True)
class LawOf:
    """side = law of a branch, and the kind of element that it makes."""

    kind: str
    side: str
    law: Node


def own_variables(branch: BranchSymbol, at: tuple[Node, ...], suffix: str = "") -> dict[str, Typed]:
    """Variables e f q p of a branch under the names that its law uses."""
    name, d = branch.family.name, branch.domain
    return {
        f"e{suffix}": Typed(ex.var(name, "be", *at), d.effort.dimension),
        f"f{suffix}": Typed(ex.var(name, "bf", *at), d.flow.dimension),
        f"q{suffix}": Typed(ex.var(name, "bq", *at), d.displacement.dimension),
        f"p{suffix}": Typed(ex.var(name, "bp", *at), d.momentum.dimension),
    }


def law_of(
    context: Context,
    branch: BranchSymbol,
    at: tuple[Node, ...],
    side: str,
    value: syntax.Expr,
    wanted: str | None,
    span: syntax.Span,
) -> LawOf:
    """Classify `side = value`; wanted: the kind that the author named (None in a component's law)."""
    node = _in_dimension(context, branch, side, value, wanted)
    own = {n.data[1][1]: n for n in ex.variables(node) if n.op == "var" and n.data[0] == branch.family.name}
    others = sorted(set(own) - {side})
    # e = R(q) f: q and f against e is a dissipator all the same
    if wanted in (None, "dissipator") and _memristive(side, own, node):
        return LawOf("dissipator", side, node)
    # one variable against one other of its edge
    if side in own or len(others) > 1:
        names = ", ".join((side, *others))
        raise context.fail(
            "E303", f"the law must be solved for one port variable of its edge; it relates {names}", span
        )
    # e = 5 V
    if not others:
        return _source(context, branch, side, node, wanted, span)
    # e against q is potential, f against p kinetic, e against f a dissipator
    kind = _EDGES.get(frozenset((side, others[0])))
    if kind is None:
        raise _off_diagram(context, side, others[0], span)
    # a controlled source may read its own other variable
    if wanted in ("effort", "flow") and _is_controlled(context, branch, value, node):
        if side != wanted[0]:
            raise context.fail("E303", f"the law of {wanted} source '{branch.name}' gives {side}", span)
        return LawOf(wanted, side, node)
    # `effort(e = R*f)` is a resistor
    if wanted in ("effort", "flow"):
        help_ = f"that is a {kind}: '{kind}({side} = ...)'"
        raise context.fail(
            "E315", f"source '{branch.name}': its law is a function of its own {others[0]}", span, help=help_
        )
    # `potential(e = R*f)`
    if wanted is not None and kind != wanted:
        message = f"'{branch.name}' is a {wanted}, but its law relates {side} to its own {others[0]}"
        raise context.fail("E323", message, span, help=f"{kind}({side} = ...)")
    return LawOf(kind, side, node)


def _memristive(side: str, own: dict[str, Node], law: Node) -> bool:
    """Whether a law of effort and flow is modulated by its own displacement or momentum, and stores nothing: one is
    zero where the other is, wherever these stand.
    """
    (other,) = {*"ef"} - {side} if side in "ef" else ("",)
    memory = {own[letter] for letter in "qp" if letter in own}
    if not memory or other not in own or side in own:
        return False
    return not memory & ex.variables(ex.substitute(law, {own[other]: ex.const(0.0)}))


def _in_dimension(context: Context, branch: BranchSymbol, side: str, value: syntax.Expr, wanted: str | None) -> Node:
    """The law as a node; E208 where its dimension is not that of its side."""
    dimension = branch_dimension(branch.domain, side)
    read = context.scalar(value)
    found = read.dimension
    if found is None or found == dimension:
        return read.node
    message = f"law of '{branch.name}': {side} is in {dim.show(dimension)}, the law in {{}}"
    other = [s for s in "efqp" if found and found == branch_dimension(branch.domain, s) and s != side]
    meant = wanted[0] if wanted in ("effort", "flow") else None if wanted else next(iter(other), None)
    if meant in other and context.bare(value) is None:
        said = message.format(dim.show(found))
        raise context.fail("E208", said, value.span, help=f"{meant} = ..., which is in {dim.show(found)}")
    lacking = None if found is None else dim.quotient(dimension, found)
    for own in "efqp":
        if lacking and own != side and lacking == branch_dimension(branch.domain, own) and found != dimension:
            said = message.format(dim.show(found))
            raise context.fail("E208", said, value.span, help=f"a factor in {dim.show(lacking)} is missing: ...*{own}")
    return context.fitting(read, value, dimension, "E208", message)


def _is_controlled(context: Context, branch: BranchSymbol, value: syntax.Expr, law: Node) -> bool:
    """Whether a law reads an input, time or another element: that of a controlled source, whatever else it reads."""
    for name in walk(value):
        symbol = context.scope.find(name.name) if isinstance(name, syntax.Name) else None
        if isinstance(symbol, Definition) and symbol.kind == "input":
            return True
    for node in ex.topological([law]):
        if node.op == "time" or (node.op == "param" and node.data in context.inputs):
            return True
        if node.op == "var" and node.data[0] != branch.family.name:
            return True
    return False


def _source(
    context: Context, branch: BranchSymbol, side: str, node: Node, wanted: str | None, span: syntax.Span
) -> LawOf:
    """A law without a variable of its own branch: a source, or a store or dissipator that it degenerates to."""
    if wanted in _OTHER:
        if side not in _OTHER[wanted]:
            raise context.fail("E323", f"'{branch.name}' is a {wanted}, but its law gives {side}", span)
        return LawOf(wanted, side, node)
    if side not in "ef" or (wanted is not None and wanted[0] != side):
        raise context.fail(
            "E303", f"a source gives its effort or its flow, not {side}", span, help="'e = ...' or 'f = ...'"
        )
    return LawOf("effort" if side == "e" else "flow", side, node)


def _off_diagram(context: Context, side: str, other: str, span: syntax.Span) -> Failed:
    """E302: the two variables are no edge of the diagram; what to write instead."""
    pair = frozenset((side, other))
    if pair == frozenset("pq"):
        help_ = "write it as a dissipator, e = M(q)*f with M = dp/dq or f = W(p)*e with W = dq/dp"
        return context.fail("E302", "p-q is the diagonal of the diagram: a memristive law", span, help=help_)
    requirement = "p' = e" if pair == frozenset("pe") else "q' = f"
    message = (
        f"a law must relate p-f, q-e or e-f; this one relates {side} and {other}, which {requirement} already fixes"
    )
    return context.fail("E301", message, span)


@dataclass(frozen=True, slots=True)
class RatioOf:
    """A two-port: side e or f of branch 1 = ratio * that of branch 2 (gyrator: e1 = ratio*f2 or f1 = ratio*e2)."""

    kind: str
    side: str
    ratio: Node


def ratio_of(
    context: Context,
    branches: tuple[BranchSymbol, BranchSymbol],
    at: tuple[Node, ...],
    kind: str,
    side: str,
    value: syntax.Expr,
    span: syntax.Span,
) -> RatioOf:
    """The ratio of a transformer or gyrator from its one law (e1, f1, e2 or f2 = ...)."""
    letter, number = side[0], int(side[1])
    me, partner = branches[number - 1], branches[2 - number]
    dimension = branch_dimension(me.domain, letter)
    name = me.name.partition("#")[0]
    message = f"law of '{name}': {side} is in {dim.show(dimension)}, the law in {{}}"
    with context.virtually():
        node, signals = signals_held(context.scalar_of(value, dimension, "E208", message))
    # what the law reads of the other side, and of its own
    far = {n.data[1][1]: n for n in ex.variables(node) if n.op == "var" and n.data[0] == partner.family.name}
    near = [
        n for n in ex.variables(node) if n.op == "var" and n.data[0] == me.family.name and n.data[1] in ("be", "bf")
    ]
    # a transformer relates alike variables, a gyrator effort with flow
    expected = letter if kind == "transformer" else REFLECTED[letter]
    wrong = REFLECTED[expected]
    # the wrong variable of the other side, or none of it
    if expected not in far:
        if wrong in far:
            other = "gyrator" if kind == "transformer" else "transformer"
            message = f"{kind} '{name}' given as {side} against {wrong}{3 - number}: that is a {other}"
            raise context.fail("E316", message, span, help=f"'{other}({side} = ...)'")
        needed = f"{expected}{3 - number}"
        message = f"the law of {kind} '{name}' gives {side} without {needed}: its two sides would not act on each other"
        raise context.fail("E303", message, span, help=f"{side} = n*{needed}, with a ratio n other than 0")
    # linear in the far variable: the slope, and nothing else
    ratio = derivative(node, far[expected])
    rest = ex.substitute(node, {far[expected]: ex.const(0.0)})
    own = [n for n in ex.variables(ratio) if n.op == "var" and n.data[0] in (me.family.name, partner.family.name)]
    flows = [n for n in own if n.data[1] in ("be", "bf")]
    if near or flows or not ex.is_const(rest, 0.0):
        shown = (near or flows or [far[expected]])[0]
        message = f"{kind} ratio of '{name}' depends on {shown}, a flow or effort of its own ports"
        raise context.fail("E317", message, span, help="ratios may depend on displacements and signals")
    return _normal(kind, letter, number, ex.substitute(ratio, signals) if signals else ratio)


def _normal(kind: str, letter: str, number: int, ratio: Node) -> RatioOf:
    """Written for branch 1: e1 f1 + e2 f2 = 0 turns the law of one side into that of the other."""
    if kind == "transformer":
        # e2 = r e1 gives f1 = -r f2; f2 = r f1 gives e1 = -r e2
        if number == 2:
            return RatioOf(kind, "f" if letter == "e" else "e", ex.neg(ratio))
        return RatioOf(kind, letter, ratio)
    # gyrator: e2 = r f1 gives e1 = -r f2; f2 = g e1 gives f1 = -g e2
    return RatioOf(kind, letter, ratio if number == 1 else ex.neg(ratio))
