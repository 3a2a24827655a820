"""Which function of which row is no number, where a run cannot go on: the rows evaluated node by node.

The rows of the form are evaluated by the interpreter at the last good point and at points ahead along its rates; the
first operation whose arguments are numbers and whose value is none is named with its argument.
"""

from __future__ import annotations

import re

import numpy as np
from sysdyn.cli.run.prepare import Prepared
from sysdyn.cli.run.verdict.last_state import LastState
from sysdyn.compiler.binding.oracle import Oracle
from sysdyn.compiler.forms.descriptor import WITHOUT_ENTRIES
from sysdyn.dsl.elaborate.scenes.stopping import RANGE
from sysdyn.dsl.model.expression import Node, topological
from sysdyn.dsl.model.expression_text import to_text
from sysdyn.dsl.text.diagnostics import Place
from sysdyn.runtime.model.failures import RowLabel, SolverFailure
from sysdyn.runtime.model.system import System
from sysdyn.runtime.start.starter import Starter
from sysdyn.values import dataclass

AHEAD = (0.0, 1e-9, 1e-6, 1e-3, 1e-2, 1e-1)
"""Times ahead at which rows are evaluated, of the time passed so far (and multiples of the step)."""
STEPS = (1.0, 10.0, 100.0)
BESIDE = (-1e-9, 1e-9, -1e-6, 1e-6, -1e-3, 1e-3)
"""Of the unknowns, and of one: how far beside the last good point rows are evaluated at last."""


@dataclass(frozen=True, slots=True)
class Culprit:
    """code: E932 (a table) or E933; text: the sentence; row: that holds the function."""

    code: str
    text: str
    row: RowLabel


def culprit(prepared: Prepared, system: System, error: SolverFailure) -> Culprit | None:
    """The operation that is no number at the failure, or just ahead of the last good point; None where all are."""
    if error.state is None:
        return None
    t, y, yd = error.state
    last = LastState(prepared, system, t, y)
    oracle = Oracle(prepared.compiled.form, prepared.binding)
    blocks = [b for b in prepared.compiled.form.blocks if b.name not in (*WITHOUT_ENTRIES, "initial")]
    rates = np.where(np.isfinite(yd), yd, 0.0)
    # a little ahead along the rates, by parts of the step and by some roundings
    times = (*(s * error.step for s in STEPS), *(a * max(abs(t), error.step) for a in AHEAD))
    with np.errstate(over="ignore"):  # a last state at the end of all numbers
        points = [(t + ahead, y + ahead * rates, yd) for ahead in times]
    # beside the state, as an iterate may have been
    if error.cause == "nonfinite":  # it has been met: by an iterate, if no rate leads there
        points += [(t, y + side * np.maximum(np.abs(y), 1.0), yd) for side in BESIDE]
    # the nearest point first
    for point in points:
        for block in blocks:
            found = oracle.find_undefined(block.name, *point, infinite=error.cause == "nonfinite")
            if found is not None:
                last.time, last.y = point[0], point[1]
                return _describe(prepared, *found, last)
    return None


def undefined_at_start(prepared: Prepared, system: System, t: float) -> tuple[str, Place] | None:
    """The operation that is no number at the guesses of the start, and its statement; None where all are."""
    y = Starter(system).guess[: system.unknowns]
    oracle = Oracle(prepared.compiled.form, prepared.binding)
    for block in prepared.compiled.form.blocks:
        if block.name in (*WITHOUT_ENTRIES, "initial"):
            continue
        with np.errstate(all="ignore"):
            found = oracle.find_undefined(block.name, t, y, np.zeros_like(y))
        if found is not None:
            told = _describe(prepared, *found, LastState(prepared, system, t, y))
            place = _statement(prepared, found[1]) or prepared.compiled.form.rows[found[0]].place
            return told.text, place or prepared.network.place
    return None


def _describe(prepared: Prepared, row: int, node: Node, arguments: list[float], last: LastState) -> Culprit:
    """The finding on an operation that is no number, with the values that it read."""
    place = _statement(prepared, node) or prepared.compiled.form.rows[row].place
    label = RowLabel(place.element if place else "", "law", place.file if place else "", place.start[0] if place else 0)
    listed = ", ".join(f"{a:.9g}" for a in arguments)
    read = ", ".join(last.values_read(node)[:3])
    # beyond the range of a table that stops
    if node.op == "table":
        name = str(node.data[0]).partition(RANGE)[0]
        said = f"the argument of table {name} left its range: it is {read or listed}"
        return Culprit("E932", said, label)
    text = to_text(node)
    function = re.match(r"\w+(?=\()", text)
    # a function as it is written, with its argument
    if function is not None and len(arguments) <= 2:
        written = _written(place, function[0])
        values = f"its argument is {arguments[0]:.3g}" + (f", {read}" if read else "")
        return Culprit("E933", f"{written or text[:60]} is no number: {values}", label)
    shown = text if len(text) <= 60 else text[:57] + "..."
    name = {"call": str(node.data), "pow": "a power", "mul": "a quotient or power", "sum": "a sum"}[node.op]
    return Culprit("E933", f"{name} is outside its domain: {shown} with {listed}", label)


def _written(place: Place | None, function: str) -> str | None:
    """The function's call as the author wrote it, where the statement has one of them: `sqrt(2*g0*h)`."""
    if place is None:
        return None
    text = place.source.text[place.span.start : place.span.end]
    starts = [m.start() for m in re.finditer(rf"(?<!\w){function}\(", text)]
    # of two calls nobody knows which one failed
    if len(starts) != 1:
        return None
    depth = 0
    # up to the parenthesis that closes it
    for k in range(starts[0], len(text)):
        depth += (text[k] == "(") - (text[k] == ")")
        if text[k] == ")" and not depth:
            return " ".join(text[starts[0] : k + 1].split())
    return None


def _statement(prepared: Prepared, node: Node) -> Place | None:
    """The statement that holds a node, or one of its function (a derivative's own node stands in no text)."""
    network = prepared.compiled.network
    said = [(e.expression, e.place) for e in network.energies]
    said += [(w.effort, w.place) for w in network.works]
    said += [(c.expression, c.place) for c in network.constraints]
    said += [(d.expression, d.place) for d in network.dynamics]
    names = {"table": lambda n: n.op == "table" and n.data[0] == node.data[0]}
    alike = names.get(node.op, lambda n: n.op == node.op and n.data == node.data)
    for matches in (lambda n: n is node, alike):
        for expression, place in said:
            if any(matches(n) for n in topological([expression])):
                return place
    return None
