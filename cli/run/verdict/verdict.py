"""What a run says of itself, as findings.

Where it stopped (E930 to E934), what it did not meet (E920, E921, W920), what cancels in what it traced (N922), a
rest that is not stable (N924).
"""

from __future__ import annotations

import re
from collections.abc import Iterable

import numpy as np
from sysdyn.cli.run.prepare import Prepared, place_at
from sysdyn.cli.run.request.targets import Target
from sysdyn.cli.run.start.author import names_of
from sysdyn.cli.run.start.flat_laws import by_element
from sysdyn.cli.run.start.starting import Started
from sysdyn.cli.run.verdict.culprit import Culprit, culprit
from sysdyn.cli.run.verdict.last_state import LastState
from sysdyn.dsl.model.expression import topological
from sysdyn.dsl.text.diagnostics import Place, Report
from sysdyn.dsl.tree import syntax
from sysdyn.runtime.accuracy.options import Options
from sysdyn.runtime.judgement import Cancelled, Shortfall
from sysdyn.runtime.linear.growth import growth
from sysdyn.runtime.linear.states import moving
from sysdyn.runtime.model.failures import RowLabel, SolverFailure
from sysdyn.runtime.model.held_rows import multiplier_row
from sysdyn.runtime.model.scales import group_maximum
from sysdyn.runtime.model.slopes import WITH_A_SLOPE, no_slope, without_slope
from sysdyn.runtime.simulate import Outcome
from sysdyn.runtime.structure.structure import DENSE

_CAUSES = {
    "newton": ("E930", "Newton's iteration does not converge"),
    "error_test": ("E930", "the local error cannot be brought below the tolerance"),
    "singular": ("E931", "the iteration matrix is singular"),
    "inertia": ("E931", "an inertia became negative: a law was carried past its pole"),
    "nonfinite": ("E933", "an equation is not a number"),
    "stiff": ("E930", "the equations are stiff and hold the method to tiny steps: take radau or bdf"),
    "step_too_small": ("E930", "the step size fell below the resolution of time"),
    "crawl": ("E930", "at such steps the end of the run is out of reach"),
    "max_steps": ("E934", "the limit of steps is reached"),
    "max_wall": ("E934", "the limit of wall time is reached"),
    "max_events": ("E934", "the limit of events is reached"),
    "chatter": ("E930", "events follow each other without end at one instant"),
    "fold": (
        "E930",
        "an algebraic loop folds: at the corner of a law none of its solutions goes on",
    ),
    "outgrown": ("E930", "solutions beside this one leave it faster than any step resolves: it jumps"),
    "zeno": (
        "E930",
        "events follow each other ever sooner and never pass a later instant, of which the text is silent",
    ),
    "complementarity": ("E930", "no set of constraints that hold fits: each one asks for another"),
    "slides": ("E930", "a law jumps there and both its branches drive it back: no motion follows either"),
    "drives": ("E933", "the bound c of dry friction, c*setsign(u) or c*abs(u), falls below zero: it would drive"),
    "unbalanced": ("E930", "what jumps there is not where a fast rise would lead"),
    "overfull": ("E933", "a store can hold nothing there, and holds something: its effort, or its flow, has no bound"),
    "endless": ("E933", "a pulse meets a finite resistance there: the power has no integral"),
    "pulsed": ("E933", "a dynamic variable that the model reads would jump there: its curved rate has a pulse"),
    "overflows": ("E933", "what an event assigns is no number"),
    "conflict": ("E704", "two events assign one variable at one instant"),
    "memory": ("E934", "there is no memory left"),
}
UNKICKED, FOLDS = 60, 100.0
"""Unknowns up to which a rest is asked whether it is stable; powers of e by which what disturbs it would grow over a
run: round-off grows to the size of everything in 37."""
AT_REST = 1e-8
"""Of what there was of its kind at the start: an unknown that has come to rest."""
_OF_EVENTS = (
    "max_events",
    "chatter",
    "fold",
    "zeno",
    "complementarity",
    "conflict",
    "overflows",
    "slides",
    "drives",
    "overfull",
    "endless",
    "pulsed",
)
LOOSER = "a looser --accuracy"
_REMEDIES = {
    "E704": "one event for both, or conditions that do not become true together",
    "E930": f"another --method or --index, {LOOSER}, or a smoother law there",
    "E931": "a range of the law that keeps it positive, or an earlier end: --until",
    "E932": "data that reach further, or 'clamp' or 'extend' in the table",
    "E933": "a law that is defined there, or an earlier end: --until",
    "E934": f"a higher limit, or {LOOSER}",
}

_JUMP = (
    "what it jumps by: a pole in the loop (the output through a resistor onto a capacitor, or as a state that"
    " follows in 1 us), or a discrete variable that a 'when' turns with hysteresis"
)
_REMEDIES_OF_CAUSES = {
    "crawl": f"an earlier end (--until), another --method, or {LOOSER}",
    "drives": "a bound of zero or more: abs(c), max(c, 0); the other sign of a reaction (floor.on(y) is the effort"
    " along y); or an earlier end: --until",
    "unbalanced": "another --formulation, or a ramp in place of the jump",
    "overfull": "a value other than zero there, or a switch or a stop that empties it before",
    "endless": "a ramp in place of the jump, or something that stores between the two",
    "pulsed": "a ramp in place of the jump, or the store's own displacement or momentum in place of the integral",
    "slides": "a law that is continuous there (clip of a steep line), set-valued friction (setsign), or hysteresis",
    "overflows": "bounds of what is assigned: clip(k, lo, hi); or an earlier end: --until",
    "chatter": "a condition and an action that do not undo each other: hysteresis, or an 'every' in place of a 'when'",
    "fold": _JUMP,
    "outgrown": _JUMP,
    "zeno": "a constraint in place of the event, which comes to rest: phi floor: h >= 0 m restitution 0.8; or an"
    " earlier end: --until",
    "complementarity": "constraints that do not ask for opposites: a resistance or a clearance between these elements",
}


_BY_SLOPES = (
    "; rosenbrock takes laws by their slopes where a step begins: they may vanish or jump there (a flow that turns"
    " through a root or a square)"
)
"""Of a step of rosenbrock whose error no shorter one lessens."""


_TWICE = "constraints that hold at one time may say the same twice: leave one out, or put a resistance between them"


_LEFT_OUT = "an order in which another of its group is the last (left out as redundant, and needed there: %s)"
_LEFT_OUT += ", or an earlier end: --until"
_FOLLOWS = "--redundancy minimum_norm, which leaves out others as the motion goes on; or "


_BOUNDED = "a law that keeps it in bounds (an energy with a minimum, a stop), or an earlier end: --until"


_BLOCKED = "where all that meets at a node may block at once, a large resistance (1 Tohm) beside one of them"
"""Of steep laws: their currents there are less than round-off, and nothing else says what the node's potential is."""


_RANK = "an earlier end, or lengths with which the mechanism does not reach its dead centre"


def _knob(options: Options | None, code: str) -> str:
    """What makes a run shorter, or where it cannot step on possible."""
    if options is None or (options.method != "euler" and options.rtol is None and options.atol is None):
        return LOOSER
    if options.method != "euler":
        return "a looser --rtol"
    return "a shorter --step" if code == "E930" else "a longer --step"


def report_stop(
    target: Target,
    prepared: Prepared,
    started: Started,
    error: SolverFailure,
    report: Report,
    options: Options | None = None,
) -> str:
    """Reports where the solver stopped; the sentence of it."""
    # the cause in words, by default
    code, cause = _CAUSES.get(error.cause, ("E930", error.cause))
    asked = ("nonfinite", "newton", "step_too_small", "crawl")
    found = culprit(prepared, started.system, error) if error.cause in asked else None
    # an operation that is no number
    if found is not None:
        code, cause = found.code, found.text
    last = None if error.state is None else LastState(prepared, started.system, *error.state[:2])
    lost = last.dependent(started.state.y) if last is not None and code == "E930" else []
    # constraints that have become dependent
    if lost:
        code, cause = "E931", f"{', '.join(c.name for c in lost)} lose their rank: they depend on each other there"
    flat = _flat(prepared, started, error) if found is None and not lost and code in ("E930", "E931", "E933") else ()
    # a law without slope
    if flat:
        code, cause = "E931", no_slope(flat)
    where = lost[-1].place if lost else _place(target, prepared, error, found, last)
    where = author_place(target, prepared, flat[0]) if flat else where
    text = f"the solver stopped at t = {error.time:.9g} s (step {error.step:.2g} s): {cause}"
    # the row, or the unknown, that did not converge
    if error.row is not None and found is None and not flat:
        text += f", in {_row_name(error.row)}"
    if error.unknown is not None:
        name = re.sub(r" (sticking|set)( \d+)?(?=\[|$)", "", error.unknown)
        text += f", {'of' if error.cause in _OF_EVENTS else 'unknown'} {name}"
    partial = error.partial
    linear = error.cause == "error_test" and isinstance(partial, Outcome) and partial.method == "rosenbrock"
    text += _BY_SLOPES if linear and not flat else ""
    why = None
    # growth beyond all bounds, or an inertia that vanishes
    if last is not None and code == "E930":
        why = last.unbounded_growth(started.state.y) or last.vanishing(started.state.y)
        text += f"; {why}" if why else ""
    if isinstance(partial, Outcome) and partial.reached > error.time:
        text += "; the trace is that of a coarser run to the end, its error is not known"
    # the remedy that fits the cause
    usual = _REMEDIES_OF_CAUSES.get(error.cause, _REMEDIES[code])
    usual = _instead_of(partial.method if isinstance(partial, Outcome) else "") if linear or flat else usual
    usual += f"; {WITH_A_SLOPE}" if flat else ""
    if started.system.form.scales and code in ("E931", "E934"):
        usual = _BLOCKED if error.cause == "singular" else f"{usual}; {_BLOCKED}"
    if error.cause == "singular" and len(started.system.description.switches.places):
        usual = _TWICE
    dropped = options is not None and options.redundancy == "drop"
    fixed = dropped or (options is not None and bool(options.events))
    if error.cause == "singular" and fixed and (names := _left_out(started)):
        usual = dropped * _FOLLOWS + _LEFT_OUT % names
    usual = usual.replace(LOOSER, _knob(options, code))
    remedy = _BOUNDED if why else _RANK if lost else usual
    known = f"last good state at {last.time:.9g} s: {last.some_values()}" if last is not None and last.states() else ""
    help_ = "; ".join(filter(None, (remedy, known)))
    report.error(code, text, where, help=help_)
    return text


def _left_out(started: Started) -> str:
    """Constraints that the start has found redundant, as the text names them."""
    of = started.system.description
    return ", ".join(of.rows[multiplier_row(of, k)].label_at(at).label for k, at in started.facts.left_out)


def _instead_of(method: str) -> str:
    """The methods that pass a law without a slope, but for the one that did not."""
    *others, last = (name for name in ("radau", "bdf", "auto") if name != method)
    return f"--method {', '.join(others)} or {last}"


def _flat(prepared: Prepared, started: Started, error: SolverFailure) -> tuple[RowLabel, ...]:
    """Rows of laws that have no slope at the last good point; none where events are the cause."""
    system = started.system
    if error.state is None or error.cause in (*_OF_EVENTS, "inertia", "memory") or system.unknowns > DENSE:
        return ()
    t, y, yd = error.state
    rest = np.zeros(system.unknowns - y.size)
    y, yd = np.append(y, rest), np.append(np.where(np.isfinite(yd), yd, 0.0), rest)
    rows = without_slope(system, t, y, yd)
    if not rows:  # as near to rest as steps lead
        size = group_maximum(system, np.abs(np.append(started.state.y[: y.size], rest)[: y.size]))
        rows = without_slope(system, t, np.where(np.abs(y) < AT_REST * size, 0.0, y), yd, size)
    return by_element(prepared, rows)


def differences(prepared: Prepared, cancelled: Iterable[Cancelled], report: Report) -> None:
    """N922 for each quantity that is less well known than its accuracy and its rows seem to say: a difference of larger
    terms, what rides on an offset, or what was larger between the rows.
    """
    observed = {o.name: o for o in prepared.network.observations}
    for lost in cancelled:
        said = observed.get(lost.quantity)
        unit, place = (f" {said.unit.text}", said.place) if said else ("", prepared.network.place)
        text = f"{lost.quantity} is known to {lost.known:.1g}{unit}: it or its terms reach {lost.terms:.1g}{unit}"
        help_ = "a coordinate for a difference, or an origin nearby; where its rows alone are small, accuracy on it"
        if lost.moves:
            share = f"its accuracy is a part of {lost.terms:.1g}{unit}"
            text = f"{lost.quantity} moves by {lost.moves:.2g}{unit}, and {share}"
            help_ = f"accuracy 1e-4 on {lost.quantity} relative to range, or an origin nearby"
        report.note("N922", text, place, help=help_)


def note_rest(prepared: Prepared, started: Started, outcome: Outcome, report: Report) -> None:
    """N924 of a run in which nothing has moved, though what disturbs it would have grown by FOLDS powers of e."""
    system, state = started.system, started.state
    # too large to look at, in motion at the start, or without a trace
    if system.unknowns > UNKICKED or moving(system, state) or (trace := outcome.traced) is None:
        return
    # something moved
    if any(
        (trace[name].values != trace[name].values[0]).any() for name in trace.names if not name.startswith("audit.")
    ):
        return
    rate, name = growth(system, state)
    # a pendulum upright: at rest, yet a disturbance grows by e^folds
    folds = rate * (outcome.reached - state.t)
    if folds > FOLDS:
        (shown,) = names_of(prepared.network, [name])
        text = (
            f"nothing moves: the run stays at a rest that is not stable, beside which {shown} grows at {rate:.3g} 1/s"
        )
        help_ = (
            f"that is by e^{folds:.3g} over the run: an initial value beside the rest, however near, begins the motion"
        )
        report.note("N924", text, prepared.network.place, help=help_)


def verdict(target: Target, prepared: Prepared, started: Started, outcome: Outcome, report: Report) -> None:
    """Reports what a run that ended did not meet; W920 where nothing judges it."""
    judgement = outcome.judgement
    assert judgement is not None
    scene = prepared.network.scene
    place = scene.place if scene else prepared.network.place
    if not judgement.judged:
        help_ = "without --rtol and --atol, and by another method than euler, the run estimates its own error"
        report.warning("W920", "nothing judges this run", place, help=help_)
    for missed in judgement.not_met:
        if missed.what == "accuracy":
            flat = _flat_start(prepared, started) if outcome.method == "rosenbrock" else ()
            _inaccurate(prepared, missed, place, flat, report)
        else:
            _report_ledger(target, prepared, missed, report)


def _flat_start(prepared: Prepared, started: Started) -> tuple[RowLabel, ...]:
    """Laws that have no slope at the start."""
    system, state = started.system, started.state
    if system.unknowns > DENSE:
        return ()
    return by_element(prepared, without_slope(system, state.t, *state.for_form(system)))


def _inaccurate(
    prepared: Prepared, missed: Shortfall, place: Place, flat: tuple[RowLabel, ...], report: Report
) -> None:
    """E920; flat: laws by whose slopes the method steps, and that have none at the start."""
    where = next((o.place for o in prepared.network.observations if o.name == missed.element), place)
    stops = _stops(prepared, missed.element) if missed.undefined else None
    # a table that was left
    if stops is not None:
        text = f"the argument of table {stops}, which {missed.element} reads, left its range at t = {missed.time:.9g} s"
        report.error("E932", text, where, help=_REMEDIES["E932"])
        return
    # no number from some instant on
    if missed.undefined:
        text = f"{missed.element} is no number from t = {missed.time:.9g} s on: a function is outside its domain"
        report.error("E920", text, where, help=_REMEDIES["E933"])
        return
    # below round-off
    if missed.blurred:
        text = f"round-off of the unknowns that tell {missed.element} is {missed.value:.1e} of it"
        text += f", asked {missed.limit:.1e}"
        help_ = "elements that are not as small beside the others, or a formulation that has it as an unknown"
        report.error("E920", text, where, help=help_)
        return
    # an error above what was asked
    estimate = "nothing estimates its error" if missed.value is None else f"estimated error {missed.value:.1e}"
    since = "" if missed.time is None else f", beyond it from t = {missed.time:.9g} s on"
    text = f"the accuracy asked was not reached: {missed.element}, {estimate}, asked {missed.limit:.1e}{since}"
    help_ = "a looser accuracy, a shorter span, or what stands at the place"
    if flat:
        text += f"; {no_slope(flat, 'the start')}, by which rosenbrock steps"
        help_ = f"{_instead_of('rosenbrock')}; {WITH_A_SLOPE}"
    report.error("E920", text, where, help=help_)


def _stops(prepared: Prepared, quantity: str) -> str | None:
    """A table that stops runs and that a traced quantity reads."""
    stopping = {table.name for table in prepared.network.tables if table.outside == "stop"}
    read = topological([o.expression for o in prepared.network.observations if o.name == quantity])
    return next((str(n.data[0]) for n in read if n.op == "table" and n.data[0] in stopping), None)


def _report_ledger(target: Target, prepared: Prepared, missed: Shortfall, report: Report) -> None:
    assert missed.row is not None
    what = "the energy ledger" if missed.what == "energy" else "an invariant of dynamic variables"
    time = "" if missed.time is None else f" at t = {missed.time:.9g} s"
    beyond = f"its balance passes {missed.limit:.3g} {missed.unit}{time} and reaches {missed.value:.3g} {missed.unit}"
    text = f"{what} is off: {beyond}, most at {missed.element}"
    where = author_place(target, prepared, missed.row)
    report.error("E921", text, where, help="a smaller accuracy, another --method, or what stands at the place")


def author_place(target: Target, prepared: Prepared, row: RowLabel) -> Place:
    """The author's own statement for a row: where that is a component's, the line that places the component."""
    own = target.document.file.source
    if row.file == own.name:
        return place_at(prepared.network, row.file, row.line)
    return _declaration_place(target, prepared, re.split(r"[^\w]", row.label, maxsplit=1)[0])


def _declaration_place(target: Target, prepared: Prepared, name: str) -> Place:
    """Where the model declares a name; the model's own place where it does not."""
    for statement in _statements(target.model.body):
        decls = (*getattr(statement, "decls", ()), getattr(statement, "decl", None))
        if any(d is not None and d.name == name for d in decls):
            return Place(target.document.file.source, statement.span)
    return prepared.network.place


def _statements(body: Iterable[syntax.Statement]) -> Iterable[syntax.Statement]:
    """Statements, those under loops included."""
    for statement in body:
        yield statement
        yield from _statements(getattr(statement, "body", ()))


def _place(
    target: Target, prepared: Prepared, error: SolverFailure, found: Culprit | None, last: LastState | None
) -> Place:
    """Where a stop is reported: the law that failed, the row, what drives the unknown, its declaration, the limit."""
    if found is not None:
        return author_place(target, prepared, found.row)
    if error.row is not None:
        return author_place(target, prepared, error.row)
    own = target.document.file.source
    driven = last.statement(error.unknown) if last is not None and error.unknown is not None else None
    # the statement that moves it the most
    if driven is not None and driven.source is own and error.cause not in _OF_EVENTS:
        return driven
    if error.unknown is not None and error.cause not in _OF_EVENTS:
        return _declaration_place(target, prepared, re.split(r"[^\w]", error.unknown, maxsplit=1)[0])
    said = [s.place for s in prepared.network.switches if s.name == error.unknown]
    said += [e.place for e in prepared.network.events if f"'{e.name}'" in (error.unknown or "")]
    # an event or a contact
    if said and error.cause in _OF_EVENTS:
        label = re.split(r"[^\w]", str(error.unknown), maxsplit=1)[0]
        return said[0] if said[0].source is own else _declaration_place(target, prepared, label)
    # a limit of the scene
    if error.cause in ("max_steps", "max_wall", "max_events") and target.scene is not None:
        limits = [
            s for s in target.scene.body if isinstance(s, syntax.LimitStatement) and error.cause == f"max_{s.name.name}"
        ]
        return Place(own, limits[0].span if limits else target.scene.name.span)
    return prepared.network.place


def _row_name(row: RowLabel) -> str:
    """The row, or the element, by its name."""
    kind = "" if row.kind[:1].isdigit() else f"{row.kind} "
    return f"{kind}{row.label}"
