"""The consistent start as the author should see it: what was moved, what stands in the way (E903, E505, E510, E519)."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
from sysdyn.cli.run.events import plan
from sysdyn.cli.run.prepare import Prepared, prepare
from sysdyn.cli.run.start.author import names_of
from sysdyn.cli.run.start.contradiction import inconsistent, place_of
from sysdyn.cli.run.verdict.last_state import LastState
from sysdyn.dsl import load
from sysdyn.dsl.model import expression as ex
from sysdyn.dsl.model.evaluation import evaluate
from sysdyn.dsl.model.network import Expectation, Parameter
from sysdyn.dsl.model.units import quantity
from sysdyn.dsl.text.diagnostics import Related, Report
from sysdyn.runtime.events.start import eventful_start
from sysdyn.runtime.model.description import describe
from sysdyn.runtime.model.failures import InconsistentStart, SolverFailure
from sysdyn.runtime.model.system import System
from sysdyn.runtime.numerics.rank import NotFiniteError
from sysdyn.runtime.numerics.work import Budget
from sysdyn.runtime.start.moved import Moved
from sysdyn.runtime.start.start import ConsistentState
from sysdyn.runtime.structure.implicit import undetermined_implicits
from sysdyn.runtime.structure.inertia import negative_inertia
from sysdyn.runtime.structure.order import order_and_manifold
from sysdyn.runtime.structure.structure import Structure, structure
from sysdyn.values import dataclass

SOUGHT = {"homotopy": "by a homotopy: sources rise from nothing, or what the guess misses fades"}
"""What the summary says of a start by its strategy (runtime/start); nothing of the plain one."""


@dataclass(frozen=True, slots=True)
class Started:
    """A model at its start."""

    system: System
    state: ConsistentState
    facts: Structure


def start(
    prepared: Prepared, t0: float, report: Report, redundancy: str | None = None, until: float | None = None
) -> Started | None:
    """The consistent start and the structural facts there; None where the report says what is in the way.

    redundancy: error, drop or minimum_norm; None: the scene's; until: `time.monotonic()` of the limit of wall time.
    """
    found = Report()
    try:
        return _find_start(prepared, t0, found, redundancy, until)
    finally:
        report.extend(load.at_authors(prepared.network, found))


def _find_start(
    prepared: Prepared, t0: float, report: Report, redundancy: str | None, until: float | None
) -> Started | None:
    """Find the consistent start and its structure, report what is wrong of it; None where there is none."""
    scene = prepared.network.scene
    policy = redundancy or (scene.redundancy if scene else None) or "error"
    system = System.from_description(describe(prepared.structure, prepared.arrays), prepared.carrier, "3")
    # the start, then ranks and index there
    try:
        with np.errstate(all="ignore"):  # what overflows is seen as no number
            state = eventful_start(system, t0, plan(prepared, system), Budget(until))
            facts = structure(system, state)
            implicit = undetermined_implicits(system, state, facts)
    # a function that is no number explains more than the residual
    except InconsistentStart as error:
        if error.kind != "nonfinite" or not _report_undefined(prepared, system, t0, report):
            _report_refusal(prepared, t0, error, report, until)
        return None
    # laws that are too steep at the guesses
    except NotFiniteError:
        _steep(prepared, system, t0, report)
        return None
    # the limit of time
    except SolverFailure:
        _late(prepared, "while the start is sought", "a higher limit, or guesses nearer to a start", report)
        return None
    _structural(prepared, system, state, facts if not implicit else replace(facts, undetermined=()), policy, report)
    _inertia(prepared, system, state, report)
    # unknowns that the gammas leave open
    for name in implicit:
        place = next(
            (u.place for u in prepared.network.unknowns if u.name == name.partition("[")[0]), prepared.network.place
        )
        report.error("E505", f"the gammas do not determine {name} at the start: their slope in it vanishes", place)
    _statics(prepared, system, state, facts, report)
    if until is not None and time.monotonic() > until:
        _late(prepared, "before the run begins", "a higher limit", report)
        return None
    return Started(system, state, facts)


def _late(prepared: Prepared, when: str, remedy: str, report: Report) -> None:
    """Report that nothing is left of the wall time."""
    text = f"the limit of wall time is reached {when}: there is no trace"
    report.error("E934", text, prepared.network.place, help=remedy)


def _report_refusal(
    prepared: Prepared, t0: float, error: InconsistentStart, report: Report, until: float | None
) -> None:
    """Report why there is no start; of gathered elements at the lines of the author, as `compile_network` does."""
    if prepared.compiled.written is not None:
        found = Report()
        one_by_one = prepare(
            prepared.network, Report(), formulation=prepared.formulation, backend="numpy", gather=False
        )
        tried = one_by_one is not None and start(one_by_one, t0, found, until=until) is None
        if tried and all(finding.code != "E934" for finding in found.diagnostics):
            report.extend(found)
            return
    inconsistent(prepared, t0, error, report, until)


def as_written(prepared: Prepared, t0: float) -> tuple[Prepared, Started] | None:
    """The model as written at its start, in the same formulation where that can express it; None where it has none."""
    for formulation in (prepared.formulation, "auto"):
        whole = prepare(prepared.whole, Report(), formulation=formulation, backend="numpy")
        if whole is not None:
            break
    else:
        return None
    system = System(whole.structure, whole.arrays, whole.carrier)
    try:
        with np.errstate(all="ignore"):
            state = eventful_start(system, t0, plan(whole, system))
            return whole, Started(system, state, structure(system, state))
    except (InconsistentStart, NotFiniteError):
        return None


def changes_by_start(prepared: Prepared, state: ConsistentState) -> list[Moved]:
    """What the start moved, by the author's names."""
    names = names_of(prepared.network, (name for name, *_ in state.moved))
    return [(name, before, after, why) for name, (_, before, after, why) in zip(names, state.moved, strict=True)]


def change_lines(prepared: Prepared, state: ConsistentState) -> list[str]:
    """What the start moved, a line each."""
    return [
        f"{name}: {before:.6g} -> {after:.6g}, {why}" for name, before, after, why in changes_by_start(prepared, state)
    ]


def strategy_note(state: ConsistentState) -> str:
    """How the start was found, where Newton's method from the guesses was not enough; else nothing."""
    return SOUGHT.get(state.strategy, "") and f"the start was found {SOUGHT[state.strategy]} ({state.strategy})"


def first_lines(lines: list[str]) -> list[str]:
    """The first few of many lines."""
    return lines if len(lines) <= 6 else [*lines[:5], f"... {len(lines) - 5} more of these"]


def _report_undefined(prepared: Prepared, system: System, t0: float, report: Report) -> bool:
    """Whether a function is no number at the start, which is told (E519)."""
    from sysdyn.cli.run.verdict.culprit import undefined_at_start  # of mistakes alone

    found = undefined_at_start(prepared, system, t0)
    if found is not None:
        help_ = "initial values at which it is defined, or a law that is defined there"
        report.error("E519", f"at the start {found[0]}", found[1], help=help_)
    return found is not None


def _steep(prepared: Prepared, system: System, t0: float, report: Report) -> None:
    """E519: the rows at the start, or their slopes, are no numbers."""
    if _report_undefined(prepared, system, t0, report):
        return
    message = "the slopes of the equations are no numbers at the start: values beyond 1e308, or a root at zero?"
    report.error("E519", message, prepared.network.place, help="look at the sizes of parameters and initial values")


def _structural(
    prepared: Prepared, system: System, state: ConsistentState, facts: Structure, policy: str, report: Report
) -> None:
    """Report a singular configuration (E512), redundant constraints (E509) and what is undetermined (E516)."""
    # a rank that is larger nearby: a dead centre
    if facts.singular:
        near = facts.rank
        message = f"the initial configuration is singular: rank {near - facts.singular}, {near} nearby"
        lost = LastState(prepared, system, state.t, state.y).dependent()
        message += f": {', '.join(c.name for c in lost)} depend on each other there" if lost else ""
        where = lost[-1].place if lost else prepared.network.place
        report.error("E512", message, where, help="move the guess off the dead centre")
    # the author asked to drop or to keep them
    if facts.redundant and policy != "error":
        return
    if facts.redundant:
        # the last one written is the one too many, unless a library has it
        places = [(place_of(prepared, label), label.label) for label, _ in facts.dependent]
        own = [p for p in places if p[0].source is prepared.network.place.source]
        where = max(own or places, key=lambda p: p[0].span.start)[0] if places else prepared.network.place
        beside = [Related(f"{name} belongs to it", p) for p, name in places if p != where]
        group = ", ".join(f"{label.label} ({weight:+.3g})" for label, weight in facts.dependent)
        plural = "s" if facts.redundant > 1 else ""
        message = f"{facts.redundant} redundant constraint{plural}: dependent group {group}"
        report.error("E509", message, where, related=beside)
    # no index: something has neither inertia nor a law
    elif facts.index is None and facts.undetermined and not facts.singular:  # a singular one does not tell multipliers
        names = ", ".join(f"'{n}'" for n in facts.undetermined[:5])
        message, help_ = f"the equations do not determine {names}", "inertia, stiffness, dissipation or a constraint"
        zero = next(iter(_of_inertias(prepared, lambda v: v == 0.0)), None)
        if zero is not None:
            message = f"with {zero.name} = {quantity(0.0, zero.unit)} {message}"
            report.error("E516", message, zero.place, help=f"{zero.name} other than zero, or {help_}")
            return
        report.error("E516", message, prepared.network.place, help=f"{help_} is missing")


def _of_inertias(prepared: Prepared, such: Callable[[float], bool]) -> list[Parameter]:
    """Parameters of such values that kinetic energies read."""
    kinetic = [e.expression for e in prepared.network.energies if e.function in ("T*", "T")]
    read = {n.data for root in kinetic for n in ex.topological([root]) if n.op == "param"}
    values = prepared.binding.values
    return [
        p
        for p in prepared.network.parameters
        if p.name in read and np.ndim(v := values.get(p.name, 1.0)) == 0 and such(float(v))
    ]


def _without_primal_rows(prepared: Prepared) -> bool:
    """Whether rows are other than the balances of the text's coordinates, with a multiplier a constraint."""
    return prepared.formulation.startswith("co_") or prepared.formulation.endswith("kane")


def _inertia(prepared: Prepared, system: System, state: ConsistentState, report: Report) -> None:
    """E321: T* without a minimum leaves the motion undetermined forward in time (springs may be unstable).

    Asked of the balances of coordinates: another formulation of the text has them.
    """
    if _without_primal_rows(prepared):
        return
    found = negative_inertia(system, state)
    if found is None:
        return
    name, value = found
    family = name.partition("[")[0].rstrip("'").removesuffix(".f")
    places = {c.name: c.place for c in prepared.network.coordinates} | {
        b.name: b.place for b in prepared.network.branches
    }
    places |= {n.name: n.place for n in prepared.network.nodes}
    energies = [e.place for e in prepared.network.energies if e.function in ("T*", "T")]
    where = energies[0] if len(energies) == 1 else places.get(family, prepared.network.place)
    guilty = _of_inertias(prepared, lambda v: v < 0.0)
    shown = ", ".join(f"{p.name} = {quantity(prepared.binding.values[p.name], p.unit)}" for p in guilty)
    what = f"the inertia along {name} is negative: {shown or f'{value:g} in SI units'}; T* has no minimum"
    related = tuple(Related("negative", p.place) for p in guilty)
    report.error("E321", what, where, related=related)


def _statics(prepared: Prepared, system: System, state: ConsistentState, facts: Structure, report: Report) -> None:
    """`expect static`: claims about counts (E909).

    Claims of a model hold in each of its scenes: where there is a Lagrangian formulation, that is counted.
    """
    # claims are of the whole model, with what the scene left out
    if prepared.left_out and prepared.network.statics:
        written = as_written(prepared, state.t)
        if written is None:
            text = "claims about counts are of the whole model, a part of which has no start: 'check' says why"
            report.note("N608", text, prepared.network.statics[0].place)
            return
        prepared, (system, state, facts) = written[0], (written[1].system, written[1].state, written[1].facts)
    index = facts.index
    # counted in Lagrange's form where there is one
    primal = _primal(prepared, state.t) if prepared.network.statics and _without_primal_rows(prepared) else None
    if primal is not None:
        prepared, (system, state, facts) = primal[0], (primal[1].system, primal[1].state, primal[1].facts)
    known = facts.counts | {"index": index}
    # order and manifold are computed where somebody asks
    if any(n.data in ("static order", "static manifold") for c in prepared.network.statics for n in _names(c)):
        model = prepared.compiled.energies
        idle = {c.name for c in model.coordinates if not c.tangible} | {s.name for s in model.states if s.measured}
        counted = order_and_manifold(system, state, idle)
        known |= {"order": counted[0], "manifold": counted[1]} if counted else {}
    for claim in prepared.network.statics:
        _static(prepared, claim, known, report)


def counted_as(prepared: Prepared, t0: float, facts: Structure) -> Structure:
    """The facts with the counts of the Lagrangian formulation, where the present one leaves rows out (Kane's)."""
    primal = _primal(prepared, t0) if _without_primal_rows(prepared) else None
    return facts if primal is None else replace(primal[1].facts, index=facts.index)


def _primal(prepared: Prepared, t0: float) -> tuple[Prepared, Started] | None:
    """The model in the Lagrangian formulation, at its start; None where there is none."""
    silent = Report()
    primal = prepare(prepared.network, silent, formulation="lagrangian", backend=prepared.backend)
    if primal is None:
        return None
    system = System(primal.structure, primal.arrays, primal.carrier)
    try:
        state = eventful_start(system, t0, plan(primal, system))
        return primal, Started(system, state, structure(system, state))
    except InconsistentStart:
        return None


def _names(claim: Expectation) -> list[ex.Node]:
    return [n for n in ex.topological([claim.left, claim.right]) if n.op == "param"]


def _static(prepared: Prepared, claim: Expectation, known: dict[str, int | None], report: Report) -> None:
    """Judge one claim about counts: E909 where it fails, N608 where the count is not known."""
    missing = []

    def lookup(node: ex.Node) -> float:
        name = node.data if node.op == "param" and not node.args else ""
        if name.startswith("static "):
            value = known.get(name.removeprefix("static "))
            if value is None:
                missing.append(name.removeprefix("static "))
            return float("nan") if value is None else float(value)
        return prepared.binding.evaluate(node)

    left, right, within = evaluate([claim.left, claim.right, claim.within or ex.const(0.0)], lookup)
    # a claim on a count that nobody knows is neither met nor missed
    if missing:
        message = f"static quantity '{missing[0]}' is not known for this model (too large, or undetermined)"
        report.note("N608", message, claim.place)
    elif not holds(claim.operator, left, right, within):
        unit = "" if claim.unit.text == "1" else f" {claim.unit.text}"
        # both sides, or the left alone where the right is a number of the text
        told = (left, right) if ex.variables(claim.right) or claim.right.op != "const" else (left,)
        found = "found " + " and ".join(f"{value:.9g}{unit}" for value in told)
        report.error("E909", f"expect failed: {claim.text.removeprefix('expect ')}, {found}", claim.place)


def holds(operator: str, left: float, right: float, within: float) -> bool:
    """Whether left op right, a tolerance granted to the author's side."""
    return bool(where_holds(operator, np.float64(left), np.float64(right), np.float64(within)))


def where_holds(operator: str, left: Any, right: Any, within: Any) -> Any:
    """Where relations of arrays hold, sample by sample."""
    match operator:
        case "==":
            return np.abs(left - right) <= within
        case "!=":
            return np.abs(left - right) > within
        # `a < b within r` grants r, and equality with it
        case "<" | "<=":
            loose = (operator == "<=") | (within != 0.0)
            return np.where(loose, left <= right + within, left < right)
        case _:
            loose = (operator == ">=") | (within != 0.0)
            return np.where(loose, left >= right - within, left > right)
