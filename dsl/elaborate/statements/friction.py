"""Set-valued friction, and relations with `setsign`: what holds while bodies stick, and the sense in which they slip.

Dry friction, `c*setsign(f)` of an element's own flow and `c*abs(u)` in a content, becomes the effort c*sense with a
sense that events set, and psi: u = 0, which holds while the bodies stick.  In any other relation `setsign(u)` is an
unknown, closed by u = 0 or by the sense (`relation`).
"""

from __future__ import annotations

import math

from sysdyn.dsl.elaborate.parts import ElaborationContext
from sysdyn.dsl.elaborate.statements.events import Draft
from sysdyn.dsl.model import expression as ex
from sysdyn.dsl.model.calculus import derivative, time_derivative
from sysdyn.dsl.model.expression import Node
from sysdyn.dsl.model.network import (
    Constraint,
    Loop,
    Parameter,
    Unknown,
    loop_indices,
    loop_ranges,
)
from sysdyn.dsl.model.units import NONE, Unit, si
from sysdyn.dsl.names.failures import Failed
from sysdyn.dsl.names.laws import LawOf
from sysdyn.dsl.text.diagnostics import Place

BESIDE = 1e-20
"""m/s and the like: a flow in the plane that is no flow yet, and has a direction."""


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
    frame: ElaborationContext,
    law: LawOf,
    label: str,
    at: tuple[Node, ...],
    loops: tuple[Loop, ...],
    place: Place,
    unit: Unit,
) -> Node:
    """The law of a branch, in its unit: dry friction of its own flow sticks by a reaction, else it is a relation."""
    terms = [n.args[0] for n in ex.calls(law.law, "setsign")]
    if law.kind in ("kinetic", "potential") and not all(map(_steady, terms)):
        return law.law
    flow = ex.var(label, "bf", *at)
    if law.kind == "dissipator" and law.side == "e" and all(_steady(ex.sub(u, flow)) for u in terms):
        return sticking(frame, law.law, label, at, loops, place)
    own = {"e": flow, "f": ex.var(label, "be", *at)}.get(law.side) if law.kind == "dissipator" else None
    return relation(frame, law.law, ex.var(label, f"b{law.side}", *at), label, loops, place, unit, absorbs=own)


def relation(
    frame: ElaborationContext,
    text: Node,
    given: Node,
    label: str,
    loops: tuple[Loop, ...],
    place: Place,
    unit: Unit,
    *,
    absorbs: Node | None = None,
) -> Node:
    """The text of a relation given = text with each term c*setsign(u) as c*sense + w, by the sign of u: w closes  u = 0
    where that holds, and is zero else, so that c may fall to zero meanwhile.  Where terms multiply one another their
    signs are the unknowns.  It holds as long as the term, what the others leave, is within abs(c): a relation may be
    written with either sign of c.  Where u is what a dissipator `absorbs` by, c itself is the bound, which is not
    negative.  A c that a reaction tells is watched (aim).  Where u moves at finite rates alone it is a sign, which may
    slide (forms/corners).
    """
    at = loop_indices(loops)
    text, made = _told_apart(frame, text, label, loops)
    root = ex.sub(given, text)
    factors = {s: derivative(root, s) for s, _ in made}
    read = frozenset().union(*(ex.variables(n) for n in (*factors.values(), *(u for _, u in made))))
    # terms whose unknown can be a force of its own: no factor or argument reads another's sign
    whole = {s for s, _ in made if s not in read and ex.variables(factors[s]).isdisjoint(factors)}
    senses = {s: _sense(frame, f"{s.data[0]} sense", at, loops, place) for s, _ in made}
    # c*sense + w in place of c*s, w being zero while it slips
    slipping = {s: ex.sub(ex.mul(factors[s], senses[s]), s) for s in factors if s in whole}
    # each term sticks as long as what the others leave of the relation is within its bound
    for s, u in made:
        _check(frame, s, u, factors[s], label, at, place)
        frame.parts.unknowns.append(Unknown(s.data[0], loop_ranges(loops), unit if s in whole else si(NONE), place))
        rest = ex.substitute(root, dict.fromkeys((s, *slipping), ex.const(0.0)))
        rest = ex.add(rest, *(term for o, term in slipping.items() if o is not s))
        slips = s if s in whole else ex.sub(s, senses[s])
        _close(frame, (s, u, senses[s]), slips, (factors[s], rest), label, loops, place, absorbs=u is absorbs)
    return ex.add(ex.substitute(text, {s: senses[s] for s in slipping}), *slipping)


def _told_apart(
    frame: ElaborationContext, text: Node, label: str, loops: tuple[Loop, ...]
) -> tuple[Node, list[tuple[Node, Node]]]:
    """The text with an unknown in place of each setsign(u), and these unknowns with their u; signs of what is known."""
    change: dict[Node, Node] = {}
    made: list[tuple[Node, Node]] = []
    again = _said_before(frame, label)
    for node in ex.calls(text, "setsign"):
        u = ex.substitute(node.args[0], change)
        if _steady(u):
            change[node] = ex.call("sign", u)
            continue
        name = f"{label} set" + (f" {again + len(made) + 1}" if again + len(made) else "")
        change[node] = ex.var(name, "e", *loop_indices(loops))
        made.append((change[node], u))
    return ex.substitute(text, change), made


def _check(
    frame: ElaborationContext, s: Node, u: Node, factor: Node, label: str, at: tuple[Node, ...], place: Place
) -> None:
    """Whether s enters as factor*s alone, by no sum of its own indices."""
    inside = {n for n in ex.topological([u, factor]) if n.op == "index"} - set(at)
    if s in ex.variables(factor) or ex.is_const(factor, 0.0) or inside:
        why = f"setsign enters {label} in another way than c*setsign(u)"
        frame.report.error("E705", why, place, help="implicit s: 1, closed by gamma set: s = setsign(u)")
        raise Failed


def _close(
    frame: ElaborationContext,
    unknown: tuple[Node, Node, Node],
    slips: Node,
    terms: tuple[Node, Node],
    label: str,
    loops: tuple[Loop, ...],
    place: Place,
    *,
    absorbs: bool,
) -> None:
    """The gamma of an unknown s, of its u and sense: u = 0 while it holds, else `slips` = 0; and the draft of its
    switches, of a row factor*s + rest.
    """
    (s, u, sense), (factor, rest) = unknown, terms
    name, at = s.data[0], loop_indices(loops)
    holds = _sense(frame, f"{name} holds", at, loops, place)
    # sticking: u = 0; slipping: the unknown follows its sign
    row = ex.conditional(ex.compare("!=", holds, ex.const(0.0)), u, slips)
    frame.add_statement(Constraint("gamma", name, at, row, loops, si(NONE), place))
    # the sign of c may be either: the force that is left is counted along c
    left = ex.conditional(ex.compare(">=", factor, ex.const(0.0)), ex.neg(rest), rest)
    bound = ex.neg(factor) if absorbs else ex.call("abs", factor)
    # c is itself a reaction (Coulomb's law with a normal force): its values are watched
    aimed = not absorbs and any(n.data[1] in ("kappa", "mu") for n in ex.variables(factor) if n.op == "var")
    aim = (factor,) if aimed else ()
    draft = Draft(name, at, loops, "relation", place, si(NONE), u, left, label, bound, sense, aim=aim, holds=holds)
    frame.parts.drafts.append(draft)


def _said_before(frame: ElaborationContext, label: str) -> int:
    """Switches of the elements of one label so far, which may be said one by one."""
    return sum(draft.element == label for draft in frame.parts.drafts)


def _steady(u: Node) -> bool:
    """Whether a value moves at finite rates alone: of displacements, states and time."""
    return all(n.op == "time" or (n.data[1] in ("q", "nq", "bq", "s") and not n.data[2]) for n in ex.variables(u))


def has_friction(root: Node) -> bool:
    """Whether a size of flows stands in it."""
    named = ("abs", "hypot", "max", "min")
    return any(n.op == "call" and n.data in named and any(map(_rates, n.args)) for n in ex.topological([root]))


def set_valued(frame: ElaborationContext, root: Node, loops: tuple[Loop, ...], place: Place) -> Node:
    """A content D with its terms c*abs(u) of flows as those of set-valued friction (decision 7 of the language), and
    c*max(u, v), which is c*(u + v + abs(u - v))/2.
    """
    at = loop_indices(loops)
    root = _by_sizes(root)
    # abs(f) and hypot(f, g) of flows are set-valued; of anything else they are functions
    for node in ex.topological([root]):
        if node.op != "call" or node.data not in ("abs", "hypot") or not any(map(_rates, node.args)):
            continue
        # inside of a sum over elements each has its own: the loop is unrolled first
        if any(n.op == "reduce" and node in ex.topological([n.args[2]]) for n in ex.topological([root])):
            continue
        bound = _factor(root, node)
        if bound is None:
            continue
        name = f"content of line {place.start[0]}" + (f" ({len(frame.parts.drafts)})" if frame.parts.drafts else "")
        sense = _sense(frame, f"{name} sense", at, loops, place)
        # c*abs(f) becomes c*sense*f: the sense is 1 or -1 while it slips
        if node.data == "abs":
            _stick(frame, name, (at, loops), (node.args[0], bound, sense), place)
            root = ex.substitute(root, {node: ex.mul(sense, node.args[0])})
        # c*hypot(f, g): a direction in the plane
        else:
            speed = _stick_in_plane(frame, name, (at, loops), (node, bound, sense), place)
            root = ex.substitute(root, {node: ex.mul(sense, speed)})
    return root


def _factor(root: Node, node: Node) -> Node | None:
    """What the size of a flow is multiplied by at rest; None where there is no corner: abs(f)^3 is smooth."""
    mark = ex.var("#abs", "s")
    found = ex.substitute(derivative(ex.substitute(root, {node: mark}), mark), {mark: ex.const(0.0)})
    return None if found.op == "const" and (found.data == 0.0 or not math.isfinite(found.data)) else found


def _by_sizes(root: Node) -> Node:
    """A content with max and min of flows, where they have a corner, by abs of the difference."""
    for node in ex.topological([root]):
        named = node.op == "call" and node.data in ("max", "min") and any(map(_rates, node.args))
        if named and _factor(root, node) is not None:
            a, b = node.args
            size = ex.call("abs", ex.sub(a, b))
            total = ex.add(a, b, size) if node.data == "max" else ex.sub(ex.add(a, b), size)
            root = ex.substitute(root, {node: ex.scale(0.5, total)})
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
    # two constraints hold the body while it sticks, one along and one across
    labels = (name, f"{name} across")
    for label, flow in zip(labels, flows, strict=True):
        frame.add_statement(Constraint("psi", label, at, flow, loops, unit, place))
    # the reaction of both is compared with the bound
    multipliers = tuple(ex.var(label, "mu", *at) for label in labels)
    beside = [ex.add(f, d) for f, d in zip(flows, n, strict=True)]
    forward = ex.add(*(ex.mul(d, b) for d, b in zip(n, beside, strict=True)))
    along = ex.div(forward, ex.call("hypot", *n))
    value = ex.sub(along, ex.scale(0.5, ex.call("hypot", *beside)))
    # the switch watches the speed along the direction, less half the speed, both beside n: positive while it slips so
    draft = Draft(
        name, at, loops, "planar", place, unit, value, ex.call("hypot", *multipliers), bound=bound, sense=sense,
        rate=time_derivative(along), aim=(*flows, *multipliers, node), direction=n,
    )  # fmt: skip
    frame.parts.drafts.append(draft)
    frame.parts.drafts.append(Draft(labels[1], at, loops, "follows", place, unit, flows[1], multipliers[1]))
    return ex.mul(ex.call("sign", forward), ex.call("hypot", *beside))


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
    frame.add_statement(Constraint("psi", name, at, value, loops, unit, place))
    multiplier = ex.var(name, "mu", *at)
    frame.parts.drafts.append(Draft(name, at, loops, "friction", place, unit, value, multiplier, element, bound, sense))
