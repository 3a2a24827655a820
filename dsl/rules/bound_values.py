"""Rules on the numbers that a text binds: what is required, divisions, sizes, indices, room for arrays.

Received: an elaborator whose parameters are known, their `Values`.  Each finding goes to the report; none raises.
"""

from __future__ import annotations

import itertools
import math
import re
from collections.abc import Iterable, Sequence

from sysdyn.dsl.elaborate.elaborate import Elaborator
from sysdyn.dsl.elaborate.statements.events import Draft
from sysdyn.dsl.format.format import format_expression
from sysdyn.dsl.model import budget
from sysdyn.dsl.model import expression as ex
from sysdyn.dsl.model.expression import Node, nodes_of
from sysdyn.dsl.model.network import (
    Branch,
    Constraint,
    Coordinate,
    Dynamic,
    Loop,
    NodeFamily,
    Observation,
    Shape,
    State,
    Unknown,
    loop_indices,
    loop_ranges,
)
from sysdyn.dsl.model.units import quantity
from sysdyn.dsl.model.values import Values, as_constants
from sysdyn.dsl.rules.checks import looped_expressions_of
from sysdyn.dsl.text.diagnostics import Place, Report

LOOKED_AT = 1000
"""Elements of an array whose divisors are looked at."""


def run(model: Elaborator, known: Values, report: Report, observations: Iterable[Observation] = ()) -> None:
    """E119, E313 of dry friction, E322, E324, E805 with the values bound; observations: what is traced."""
    if not _sizes(model, known, report) or not _elements(model, known, report):
        return  # the others go through every element
    _allowances(model, known, report)
    # `require` of parameters alone: once for each element under its loops
    for r in model.parts.requirements:
        read = min(map(str, ex.variables(r.condition)), default=None)
        if read is not None:
            text = format_expression(r.written)
            message = f"require {text} reads '{read}', which is no parameter: it changes in a run"
            report.error("E322", message, r.place, help=f"expect always: {text}")
            continue
        # the first element for which it fails
        for at in r.failures(known):
            met = {n: known.number(n, at) for n in _parameters(r.condition)}
            if not any(map(math.isnan, met.values())):
                text = format_expression(r.written)
                said = {ex.substitute(n, as_constants(at)): value for n, value in met.items()}
                shown = ", ".join(_assignment_text(n, value, model) for n, value in said.items())
                shown = shown or ", ".join(f"{i} = {v:g}" for i, v in at.items())
                report.error("E322", f"require {text} fails: {shown}", r.place, help=f"values for which {text}")
                break
    traced = [(o.expression, (), o.place) for o in observations]
    # division by zero anywhere, also in what is traced
    for node, loops, place in (*looped_expressions_of(model), *traced):
        if not _report_constants(node, place, report):
            _divisions(model, node, tuple(loops), place, known, report)
    _frictions(model, known, report)
    _dynamics(model, known, report)
    _branches(model, known, report)
    _indices(model, known, report)


def _allowances(model: Elaborator, known: Values, report: Report) -> None:
    """E912: what a claim allows is not negative."""
    allowed = [(e.within, e.place) for e in model.parts.expectations]
    allowed += [(g.within, g.place) for g in model.parts.goldens]
    for within, place in allowed:
        if within is not None and known.number(within) < 0.0:
            report.error("E912", "what 'within' allows is negative: nothing could hold", place, help="within 1e-3")


def friction_bounds(model: Elaborator) -> Iterable[tuple[Node, Draft]]:
    """What dry friction, c*setsign(f) and c*abs(f), is at most: its c, where parameters alone tell it."""
    for draft in model.parts.drafts:
        bound = draft.bound
        if bound is None or not _is_constant(bound):
            continue
        if not {n.data for n in _parameters(bound)} & model.parts.discretes:
            yield bound, draft


def _frictions(model: Elaborator, known: Values, report: Report) -> None:
    """E313: dry friction that drives."""
    for bound, draft in friction_bounds(model):
        for at in known.cases(bound, draft.loops):
            value = known.number(bound, at)
            if value < 0.0:
                of = f"'{draft.element}'" if draft.element else draft.label
                names = {n: known.number(n, at) for n in _parameters(bound)}
                shown = ", ".join(_assignment_text(n, v, model) for n, v in names.items())
                told = shown or f"{value:g} in SI units"
                message = f"the dry friction of {of} is negative, it delivers power: {told} (active element)"
                report.error("E313", message, draft.place, help="a bound of zero or more: abs(c), max(c, 0)")
                break


def _parameters(node: Node) -> list[Node]:
    return [n for n in dict.fromkeys(nodes_of(node)) if n.op == "param"]


def _assignment_text(node: Node, value: float, model: Elaborator) -> str:
    """`R = -3 ohm`: a parameter with its value in its own unit."""
    unit = model.parts.parameters[node.data].unit if node.data in model.parts.parameters else None
    return f"{node} = {value:g}" if unit is None else f"{node} = {quantity(value, unit)}"


def _report_constants(root: Node, place: Place, report: Report) -> bool:
    """E324 where a constant of an expression is no number, or infinite as a term of a sum."""
    for node, _ in _always(root, ()):
        constants = (node.data,) if node.op == "const" else (node.data[0], *node.data[1]) if node.op == "sum" else ()
        if any(math.isnan(c) for c in constants):
            message, help_ = "a constant here is no number", "a root, a logarithm or a quotient where it is defined"
        elif node.op == "sum" and any(math.isinf(c) for c in constants):
            message, help_ = "a constant here is too large for a number", "a smaller one"
        else:
            continue
        report.error("E324", message, place, help=help_)
        return True
    return False


def _divisions(
    model: Elaborator, root: Node, loops: tuple[Loop, ...], place: Place, known: Values, report: Report
) -> None:
    """E324 where what is divided by is zero, of an array by the first element where it is."""
    nested = any(a.args for a in root.args)
    for node, within in _always(root, loops) if nested else ((root, loops),):
        if node.op != "mul" or not any(e < 0 for e in node.data):
            continue
        for exponent, factor in zip(node.data, node.args, strict=True):
            if exponent < 0 and _is_constant(factor) and (at := _root(factor, within, known)) is not None:
                names = _parameters(ex.substitute(factor, as_constants(at)))
                told = ex.substitute(node, as_constants(at)) if names else _as_written(node)
                shown = (
                    ", ".join(_assignment_text(n, known.number(n), model) for n in names)
                    or f"{_as_written(factor)} = 0"
                )
                report.error("E324", f"division by zero with the values bound: {told}, {shown}", place)
                return


def _as_written(root: Node) -> Node:
    """With the author's names of loop variables, of which several sums may have one (names/context.py)."""
    inner = [n for n in ex.topological([root]) if n.op == "index"]
    return ex.substitute(root, {n: ex.index(re.sub(r"_\d+$", "", n.data)) for n in inner})


def _root(factor: Node, loops: tuple[Loop, ...], known: Values) -> dict[Node, float] | None:
    """The first values of the loop variables, of LOOKED_AT, with which a constant is zero."""
    read = {n.data for n in ex.topological([factor]) if n.op == "index"}
    if not read:
        return {} if known.number(factor) == 0.0 else None
    deepest = max((k for k, loop in enumerate(loops) if loop.index in read), default=-1)
    cases = known.iterations(loops[: deepest + 1])
    return next((at for at in itertools.islice(cases, LOOKED_AT) if known.number(factor, at) == 0.0), None)


def _always(root: Node, loops: tuple[Loop, ...]) -> Iterable[tuple[Node, tuple[Loop, ...]]]:
    """What is evaluated whatever conditions say, with the loops and the ranges of sums under which it stands."""
    found, left = dict[Node, tuple[Loop, ...]](), [(root, loops)]
    while left:
        node, within = left.pop()
        if node in found:
            continue
        found[node] = within
        if node.op == "reduce":
            left += [(a, within) for a in node.args[:2]]
            left.append((node.args[2], (*within, Loop(node.data[1], *node.args[:2]))))
        else:
            left += [(a, within) for a in (node.args[:1] if node.op == "cond" else node.args)]
    return found.items()


def _is_constant(node: Node) -> bool:
    return all(n.op not in ("var", "time", "table") for n in ex.topological([node]))


def _sizes(model: Elaborator, known: Values, report: Report) -> bool:
    """Whether each size is a whole number, else E805."""
    whole = True
    for name in sorted(model.resolver.whole):
        parameter = model.parts.parameters.get(name)
        if parameter is None or parameter.shape or not parameter.values:
            continue
        value = known.number(ex.param(name))
        if math.isnan(value):
            continue  # of a parameter without a value
        if abs(value) > 2**31 - 2 or value != math.floor(value):
            message = f"'{name}' is a size or an index, so it must be a whole number: {value:g}"
            help_ = "a smaller number" if abs(value) >= 2**31 else f"{math.floor(value):g} or {math.ceil(value):g}"
            report.error("E805", message, parameter.place, help=help_, subject="sizes")
            whole = False
    return whole


def _dynamics(model: Elaborator, known: Values, report: Report) -> None:
    """E507: every element of a state has exactly one dynamic; that some state has none at all is told before."""
    given: dict[str, list[Dynamic]] = {}
    for dynamic in model.parts.dynamics:
        given.setdefault(dynamic.state.data[0], []).append(dynamic)
    for state in model.parts.states:
        said = given.get(state.name, [])
        if not state.shape or not said or (len(said) == 1 and _whole(said[0], state)):
            continue
        counts = _count_elements([(dynamic.state.args, dynamic.loops) for dynamic in said], known)
        twice = next((element for element, number in counts.items() if number > 1), None)
        box = [
            range(round(known.number(a)), round(known.number(b)) + 1)
            for a, b in state.shape
            if _has_finite_bounds(a, b, known)
        ]
        every = itertools.product(*box) if len(box) == len(state.shape) else ()
        wrong = next((element for element in every if element not in counts), None) if twice is None else twice
        if wrong is not None and (twice is not None or not report.failed):  # else a statement was refused
            name = _element_name(state.name, wrong)
            what = "has no dynamic" if twice is None else f"has {counts[wrong]} dynamics"
            report.error("E507", f"state {name} {what}", said[-1].place, help="each element once")


OVERLAP = "bounds that do not overlap with these sizes"


def _branches(model: Elaborator, known: Values, report: Report) -> None:
    """E106: an element of an array that several statements make."""
    pieces: dict[str, list[Branch]] = {}
    # pieces of one array: R[1..3] and R[3..5]
    for branch in model.parts.branches:
        if branch.at:
            pieces.setdefault(re.sub(r"\[[^]]*\]", "", branch.name), []).append(branch)  # `X[2].R` is a piece of X.R
    told: set[str] = set()
    for name, made in pieces.items():
        inside = [branch.name.rpartition("[")[0] for branch in made if "[" in branch.name]
        label = (inside or [name])[0].partition("#")[0]  # what bears the index: a component, or the element itself
        if len(made) < 2 or label in told:
            continue
        # an element that two of them make
        counts = _count_elements([(branch.at, branch.loops) for branch in made], known)
        for element in (element for element, number in counts.items() if number > 1):
            told.add(label)
            report.error("E106", f"'{_element_name(label, element)}' is declared twice", made[-1].place, help=OVERLAP)
            break


def _count_elements(
    places: Iterable[tuple[Sequence[Node], Sequence[Loop]]], known: Values
) -> dict[tuple[float, ...], int]:
    """How often each element is meant by indices under loops."""
    counts: dict[tuple[float, ...], int] = {}
    for indices, loops in places:
        for at in known.iterations(loops):
            element = tuple(known.number(n, at) for n in indices)
            counts[element] = counts.get(element, 0) + 1
    return counts


def _element_name(name: str, element: Sequence[float]) -> str:
    return f"{name}[{', '.join(f'{k:g}' for k in element)}]"


def _whole(dynamic: Dynamic, state: State) -> bool:
    """Whether a dynamic is plainly that of every element once: its loops are the bounds of the state."""
    own = loop_indices(dynamic.loops)
    return dynamic.state.args == own and loop_ranges(dynamic.loops) == state.shape


def _has_finite_bounds(first: Node, last: Node, known: Values) -> bool:
    return math.isfinite(known.number(first) + known.number(last))


def _elements(model: Elaborator, known: Values, report: Report) -> bool:
    """Whether there is memory for the elements of arrays and loops, else E119."""
    parts = model.parts
    unknowns: list[Coordinate | Unknown | State | NodeFamily] = [*parts.coordinates, *parts.unknowns]
    unknowns += [*parts.states, *parts.nodes]
    counted = [(p.name, _volume(p.shape, known), p.place, budget.NUMBER) for p in parts.parameters.values()]
    counted += [(u.name, _volume(u.shape, known), u.place, budget.UNKNOWN) for u in unknowns]
    rows: list[Branch | Constraint] = [*parts.branches, *parts.constraints]
    counted += [(r.name, _count(r.loops, known), r.place, budget.UNKNOWN) for r in rows]
    counted += [(d.state.data[0], _count(d.loops, known), d.place, budget.UNKNOWN) for d in parts.dynamics if d.loops]
    counted += [("require", _count(r.loops, known), r.place, budget.TERM) for r in parts.requirements if r.loops]
    left = float(budget.memory_limit())
    for name, count, place, price in counted:
        left -= count * price
        if left < 0.0:
            message = f"the {count:.10g} elements of '{name}' need {budget.format_bytes(count * price)}"
            granted = budget.format_bytes(budget.memory_limit())
            report.error("E119", f"{message}; one model may take {granted} in all", place, help="fewer elements")
            return False
    return True


def _volume(shape: Shape, known: Values) -> float:
    """Number of elements of a box; 0 where that is not known."""
    if not shape:
        return 1.0
    lengths = [known.number(last) - known.number(first) + 1.0 for first, last in shape]
    return math.prod(lengths) if all(n > 0.0 for n in lengths) else 0.0


def _count(loops: Sequence[Loop], known: Values) -> float:
    """Number of elements of the box around nested loops; 0 where that is not known."""
    if not loops:
        return 1.0
    spans = [(known.bounds(ex.index(loop.index), loops[: k + 1])) for k, loop in enumerate(loops)]
    lengths = [high - low + 1.0 for low, high in spans]
    return math.prod(lengths) if all(n > 0.0 for n in lengths) else 0.0


def _indices(model: Elaborator, known: Values, report: Report) -> None:
    """E805: indices outside of their array, lists of another length, indices that are no whole numbers."""
    for use in model.resolver.uses:
        low, high = known.bounds(use.value, use.loops)
        first, last = (known.number(b) for b in use.shape)
        if any(math.isnan(v) for v in (low, high, first, last)) or low > high:
            continue
        wrong = low if low < first else high if high > last else None
        # x[1..n] = [a, b]: as many values as elements
        if use.given is not None:
            if low != first + use.given - 1.0:
                message = f"'{use.name}' has {low - first + 1.0:g} elements there, {use.given} are given"
                report.error("E805", message, use.place, help="a value for each element, or one for all")
        # x[n+1] of x[1..n]
        elif wrong is not None:
            span = use.place.span
            written = " ".join(use.place.source.text[span.start : span.end].split())
            message = f"index {wrong:g} of '{use.name}' is outside {first:g}..{last:g}: {use.name}[{written}]"
            report.error("E805", message, use.place, help=f"{use.name} runs over {first:g}..{last:g}")
        elif low != math.floor(low):
            report.error("E805", f"index {low:g} of '{use.name}' is not a whole number", use.place, subject="sizes")
