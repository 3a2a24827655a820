"""Rules on the resolved network: Paynter's diagram, constraints, closed states, results, smooth laws.

Each rule is one function that looks at resolved statements and reports; none raises.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence

from sysdyn.dsl.elaborate.elaborate import Elaborator
from sysdyn.dsl.model import expression as ex
from sysdyn.dsl.model.calculus import derivative, signals_held
from sysdyn.dsl.model.evaluation import evaluate
from sysdyn.dsl.model.expression import Node
from sysdyn.dsl.model.network import Loop, Observation
from sysdyn.dsl.rules.letters import letter, samples, unknowns_of
from sysdyn.dsl.text.diagnostics import Place, Related, Report


def families(model: Elaborator, report: Report) -> None:
    """E318: coordinates and cocoordinates in one expression."""
    co = {c.name for c in model.parts.coordinates if c.complementary}
    if not co or len(co) == len(model.parts.coordinates):
        return
    primal = {c.name for c in model.parts.coordinates if not c.complementary}
    for node, place in expressions_of(model):
        names = [n.data[0] for n in unknowns_of(node, "q f p")]
        both = [next((n for n in names if n in group), None) for group in (primal, co)]
        if all(both):
            message = f"mixed families in one expression: coordinate {both[0]} and cocoordinate {both[1]}"
            report.error("E318", message, place, help="one system is written in one family")


def constraints(model: Elaborator, report: Report) -> None:
    """E501, E502, E503, E511, E518 on phi and psi."""
    for constraint in model.parts.constraints:
        what = f"{constraint.kind} {constraint.name}"
        expression, _ = signals_held(constraint.expression)
        nodes = unknowns_of(expression)
        accelerations = [n for n in nodes if n.data[2]]
        # phi x'' = 0
        if accelerations:
            message = f"{what} contains {accelerations[0]}: accelerations are results, not data"
            report.error("E518", message, constraint.place)
            continue
        # may read anything but accelerations
        if constraint.kind == "gamma":
            continue
        implicit = [n for n in nodes if letter(n) in ("e", "kappa", "mu")]
        flows = [n for n in nodes if letter(n) == "f"]
        # a phi or psi that reads an implicit unknown or a multiplier
        if implicit:
            report.error(
                "E502", f"{what} contains {_describe_unknown(implicit[0])}", constraint.place, help="it is a gamma"
            )
        # phi x' = 0
        elif constraint.kind == "phi" and flows:
            report.error("E501", f"{what} contains the flow {flows[0]}", constraint.place, help="it is a psi")
        elif constraint.kind == "phi" and not [n for n in nodes if letter(n) == "q"]:
            report.error(
                "E511", f"{what} contains no coordinate", constraint.place, help="'require' checks a parameter"
            )
        # psi x = 0
        elif constraint.kind == "psi" and not flows:
            message = f"{what} contains no flow" + (": it is a phi" if nodes else "")
            report.error("E511", message, constraint.place, help="a relation between displacements is a phi")
        # x'*y' = 0 is not workless
        elif constraint.kind == "psi":
            pair = _nonlinear(expression, flows)
            if pair:
                message = f"{what} is not linear in the flows: {pair[0]}*{pair[1]}"
                help_ = "a nonlinear rate condition is not workless: gamma with an implicit effort"
                report.error("E503", message, constraint.place, help=help_)


def _describe_unknown(node: Node) -> str:
    kind = {"e": "the implicit unknown", "kappa": "the multiplier", "mu": "the multiplier"}[letter(node)]
    return f"{kind} {node}"


def _nonlinear(expression: Node, flows: list[Node]) -> tuple[Node, Node] | None:
    """Two flows whose second derivative does not vanish (judged at sampled points where it is no constant)."""
    for k, a in enumerate(flows):
        slope = derivative(expression, a)
        for b in flows[k:]:
            second = derivative(slope, b)
            if not ex.is_const(second, 0.0) and any(abs(v) > 1e-9 for v in samples(second)):
                return a, b
    return None


def states(model: Elaborator, report: Report) -> None:
    """E507: every state has exactly one dynamic."""
    given: dict[str, list[Place]] = {}
    for dynamic in model.parts.dynamics:
        given.setdefault(dynamic.state.data[0], []).append(dynamic.place)
    told = set[Place]()
    for state in model.parts.states:
        places = given.get(state.name, [])
        # told of the first instance alone
        if not places and state.place in told:  # of another instance of the same component
            continue
        # its dynamic is there, and wrong: told already
        if not places and state.name in model.parts.given:
            continue
        if not places:
            told.add(state.place)
            own = state.name.rpartition(".")[2]
            help_ = f"dynamic {own}' = ...; what forces move is a coord {own}: translation"
            report.error("E507", f"state {state.name} has no dynamic", state.place, help=help_)
        # two dynamics of one state; of arrays the elements are counted elsewhere
        elif len(places) > 1 and not state.shape:
            related = (Related("and here", places[1]),)
            report.error("E507", f"state {state.name} has {len(places)} dynamics", places[0], related=related)


def accelerations(model: Elaborator, report: Report) -> None:
    """E518: second derivatives feed traces and expectations only."""
    statements: list[tuple[Node, Place]] = [(w.effort, w.place) for w in model.parts.works]
    statements += [(d.expression, d.place) for d in model.parts.dynamics]
    statements += [(i.target, i.place) for i in model.parts.initials]
    for node, place in statements:
        second = [n for n in unknowns_of(node) if n.data[2]]
        if second:
            message = f"second derivative {second[0]} outside trace and expect"
            report.error("E518", message, place, help="accelerations are results, not data")


def results(model: Elaborator, report: Report) -> None:
    """E102: what the audit finds, and efforts by their class, feed traces and expectations only."""
    parts = model.parts
    read = [(n, w.place) for w in parts.works for n in (w.effort, w.on)]
    read += [(c.expression, c.place) for c in parts.constraints] + [(d.expression, d.place) for d in parts.dynamics]
    read += [(n, i.place) for i in parts.initials for n in (i.target, i.value)]
    read += [(b.law, b.place) for b in parts.branches if b.law is not None]
    read += [(c.ratio, c.place) for c in parts.couplings] + [(e.expression, e.place) for e in parts.energies]
    for node, place in read:
        if not any(map(_is_result, ex.variables(node))):
            continue
        found = unknowns_of(node, "audit")
        if found:
            name = f"audit.{found[0].data[0]}"
            help_ = "its expression, or a state that integrates the power"
            report.error("E102", f"{name} is a result: no law can read it", place, help=help_)
        classes = [n for n in unknowns_of(node) if ":" in n.data[1]]
        if classes:
            name = f"{classes[0].data[0]}.{classes[0].data[1].partition(':')[2]}"
            report.error("E102", f"{name} is a result: no law can read it", place, help="the expression of that effort")


def _is_result(node: Node) -> bool:
    """Whether an unknown is one of the audit, or an effort by its class."""
    return node.op == "var" and (letter(node) == "audit" or ":" in node.data[1])


def smoothness(model: Elaborator, report: Report) -> None:
    """W301: a law with a corner or a jump where its flow vanishes; a content with a corner there is set-valued."""
    # a signum in a work or gamma is a corner of an ordinary law
    for work in model.parts.works:
        _corner(work.effort, work.place, report)
    for constraint in model.parts.constraints:
        if constraint.kind == "gamma":
            _corner(constraint.expression, constraint.place, report)
    _set_valued(model, report)
    _on_reactions(model, report)
    # of a content it is set-valued friction, which switches resolve where they can
    for energy in model.parts.energies:
        if energy.function != "D":
            continue
        for flow in unknowns_of(energy.expression, "f"):
            slope = derivative(energy.expression, flow)
            if _jumps(slope, flow):
                message = f"content D with a corner at {flow} = 0 is set-valued friction: not supported yet"
                within = any(n.op == "reduce" for n in ex.topological([energy.expression]))
                help_ = "each element's by itself: for i in 1..n { content D = ... }" if within else None
                report.note("N608", f"{message} (planned: events and inequalities)", energy.place, help=help_)
                break


def _set_valued(model: Elaborator, report: Report) -> None:
    """E705: setsign where no relation can say its value; gammas and laws have none left."""
    parts = model.parts
    said = [(c.expression, c.place) for c in parts.constraints]
    said += [(b.law, b.place) for b in parts.branches if b.law is not None]
    said += [(w.effort, w.place) for w in parts.works] + [(d.expression, d.place) for d in parts.dynamics]
    said += [(e.expression, e.place) for e in parts.energies]
    said += [(o.expression, o.place) for o in parts.watched]
    said += [(a.value, a.place) for d in parts.event_drafts for a in d.actions]
    said += [(d.condition, d.place) for d in parts.event_drafts if d.condition is not None]
    for place in dict.fromkeys(place for node, place in said if ex.calls(node, "setsign")):
        _no_set(place, report)


def set_valued_results(model: Elaborator, observations: Iterable[Observation], report: Report) -> None:
    """E705: setsign in what is traced, expected or initial: there is no multiplier that could say its value."""
    said = [(o.place, o.expression) for o in observations]
    said += [(e.place, node) for e in model.parts.expectations for node in (e.left, e.right)]
    said += [(i.place, node) for i in model.parts.initials for node in (i.target, i.value)]
    for place in dict.fromkeys(place for place, node in said if ex.calls(node, "setsign")):
        _no_set(place, report)


def _on_reactions(model: Elaborator, report: Report) -> None:
    """W705: dry friction whose bound a reaction tells (language, section 11, 4)."""
    told: set[Place] = set()
    for draft in model.parts.drafts:
        read = [n for n in unknowns_of(draft.bound) if letter(n) in ("kappa", "mu")] if draft.bound is not None else []
        if read and draft.place not in told:
            told.add(draft.place)
            of = f" of '{draft.element}'" if draft.element else ""
            said = f"the dry friction{of} is bounded by {read[0]}, a reaction that it may change"
            help_ = "a stiff spring and a damper in place of the constraint always have a motion"
            report.warning("W705", f"{said}: a motion need not exist, nor be the only one", draft.place, help=help_)


def _no_set(place: Place, report: Report) -> None:
    text = "setsign outside a gamma and the law of a dissipator or source"
    help_ = "implicit s: 1, closed by gamma set: s = setsign(u); sign for an ordinary function"
    report.error("E705", text, place, help=help_)


def _corner(node: Node, place: Place, report: Report) -> None:
    if not any(n.op == "call" and n.data in ("abs", "sign") for n in ex.topological([node])):
        return
    for flow in unknowns_of(node, "f"):
        if _jumps(node, flow) or _jumps(derivative(node, flow), flow):
            message = f"the law is not differentiable at {flow} = 0 and contains abs or sign"
            report.warning("W301", message, place, help="setsign for set-valued friction, tanh to smooth")
            return


def _jumps(node: Node, at: Node) -> bool:
    """Whether the value differs on the two sides of at = 0, however near (others at a sampled point)."""
    leaves = [n for n in ex.topological([node]) if n.op in ("var", "param", "time", "index", "table")]
    values = {n: 0.3 + ((k + 1) * 0.6180339887) % 1.0 for k, n in enumerate(leaves)}

    def side(x: float) -> float:
        return evaluate([node], lambda n: x if n is at else values.get(n, 0.5))[0]

    sides = [side(x) for x in (-1e-9, 1e-9, -1e-6, 1e-6, 1.0)]
    near, farther = abs(sides[1] - sides[0]), abs(sides[3] - sides[2])
    # a slope's difference shrinks with the distance, a jump's does not
    return all(map(math.isfinite, sides)) and near > max(0.01 * farther, 1e-6 * (abs(sides[4]) + abs(sides[1])))


def parameters(model: Elaborator, report: Report, *, required: bool) -> None:
    """E406, E904: parameters and inputs without a value (required: a scene wants them)."""
    for name, parameter in model.parts.parameters.items():
        if parameter.values or not required:
            continue
        if name in model.parts.inputs:
            report.error("E904", f"input '{name}' of the model is not set", parameter.place, help=f"set {name} = ...")
        else:
            help_ = f"set {name} = ... in the scene, or a default"
            subject = f"value {name}"
            report.error("E406", f"parameter '{name}' has no value", parameter.place, help=help_, subject=subject)


def expressions_of(model: Elaborator) -> Iterable[tuple[Node, Place]]:
    """Every expression that the model's equations are made of."""
    return ((node, place) for node, _, place in looped_expressions_of(model))


def looped_expressions_of(model: Elaborator) -> Iterable[tuple[Node, Sequence[Loop], Place]]:
    """Expressions of a model in which numbers are bound, with the loops under which each stands and its place."""
    for b in model.parts.branches:
        if b.law is not None:
            yield b.law, b.loops, b.place
    for coupling in model.parts.couplings:
        yield coupling.ratio, coupling.loops, coupling.place
    for e in model.parts.energies:
        yield e.expression, e.loops, e.place
    for w in model.parts.works:
        yield ex.add(w.effort, w.on) if w.effort is not w.on else w.on, w.loops, w.place
    for c in model.parts.constraints:
        yield c.expression, c.loops, c.place
    for d in model.parts.dynamics:
        yield d.expression, d.loops, d.place
    for i in model.parts.initials:
        yield i.value, i.loops, i.place
    for p in model.parts.parameters.values():
        loops = [Loop(name, *bounds) for name, bounds in zip(p.indices, p.shape, strict=False)]
        for value in p.values:
            yield value, loops, p.place


def run(model: Elaborator, report: Report, *, required: bool) -> None:
    """All rules that need no values."""
    for rule in (families, constraints, states, accelerations, results, smoothness):
        rule(model, report)
    parameters(model, report, required=required)
