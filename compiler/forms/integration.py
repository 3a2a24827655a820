"""Integration of psi rows that touch a tangible displacement (language, section 5, I1-I4; book, section 2.4).

A row B f + b = 0 with B and b of constant parameters alone has the primitive B q + b t.  Where it touches a tangible
coordinate it is replaced by  phi: B q + b t - c = 0,  c = B q0 + b t0  at the initial displacements, a parameter that
the binding computes.  The label keeps its name: its multiplier becomes kappa.
"""

from __future__ import annotations

from dataclasses import replace

from sysdyn.compiler.model.energies import EnergyModel, Offset, Row
from sysdyn.compiler.model.mirror import Mirror
from sysdyn.compiler.model.terms import Nest, Term, local_variables
from sysdyn.dsl.model.calculus import derivative
from sysdyn.dsl.model.expression import (
    Node,
    add,
    const,
    mul,
    neg,
    param,
    reads,
    substitute,
    time,
    var,
    variables,
)
from sysdyn.dsl.model.expression_text import to_text
from sysdyn.dsl.text.diagnostics import Diagnostic


def integrate(model: EnergyModel) -> tuple[EnergyModel, tuple[Diagnostic, ...]]:
    """The model with integrable psi rows as phi, and a note N501 for each."""
    tangible = frozenset(c.name for c in model.coordinates if c.tangible)
    labels: dict[str, list[Row]] = {}
    # rows of one label are integrated together or not at all
    for row in model.of_kind("psi"):
        if row.name in model.switched:
            continue  # a displacement goes on from where its flow was let go
        labels.setdefault(row.name, []).append(row)
    # exact, and tied to what the author calls tangible
    chosen = {n for n, rows in labels.items() if _touches(rows, tangible, model.mirror) and _all_exact(rows, model)}
    if not chosen:
        return model, ()
    offsets: list[Offset] = []
    notes: list[Diagnostic] = []
    rows: list[Row] = []
    # the row becomes a phi with a constant; a term that adds to one has none of its own
    for row in model.rows:
        if row.kind == "psi" and row.name in chosen:
            integrated, offset = _integrate_row(row, model.mirror)
            rows.append(integrated)
            offsets.append(offset)
            if not row.adds:
                notes.append(_note(row, labels[row.name], offset, tangible, model.mirror))
        else:
            rows.append(row)
    return _rename_multipliers(replace(model, rows=tuple(rows), offsets=tuple(offsets)), chosen), tuple(notes)


def _touches(rows: list[Row], tangible: frozenset[str], mirror: Mirror) -> bool:
    found = (n for row in rows for term in row.terms for n in local_variables(term.expression, mirror.rate))
    return any(n.data[0] in tangible for n in found)


def _all_exact(rows: list[Row], model: EnergyModel) -> bool:
    """I1: coefficients and the free part of parameters alone that no event assigns: with b the primitive would jump."""
    terms = [term for row in rows for term in row.terms]
    if any(reads(term.expression, model.discretes) for term in terms):
        return False
    return all(_exact(term, model.mirror) for term in terms)


def _exact(term: Term, mirror: Mirror) -> bool:
    flows = local_variables(term.expression, mirror.rate)
    if any(variables(derivative(term.expression, f)) for f in flows):
        return False
    return not variables(substitute(term.expression, dict.fromkeys(flows, const(0.0))))


def _primitive(expression: Node, mirror: Mirror) -> Node:
    """B q + b t."""
    flows = local_variables(expression, mirror.rate)
    free = substitute(expression, dict.fromkeys(flows, const(0.0)))
    parts = [mul(derivative(expression, f), var(f.data[0], mirror.coordinate, *f.args)) for f in flows]
    return add(*parts, mul(free, time()))


def _integrate_row(row: Row, mirror: Mirror) -> tuple[Row, Offset]:
    name = f"#offset {row.name}"
    terms = tuple(Term(_primitive(t.expression, mirror), t.loops, t.place) for t in row.terms)
    constant = () if row.adds else (Term(neg(param(name, *row.at)), row.nest, row.place),)
    return replace(row, kind="phi", terms=(*terms, *constant)), Offset(name, row.name, row.at, terms, row.nest)


def _note(row: Row, rows: list[Row], offset: Offset, tangible: frozenset[str], mirror: Mirror) -> Diagnostic:
    """N501 of a row; rows: all of its label."""
    if any(r.adds for r in rows):
        message = f"psi {row.name} was integrated because a displacement of it is tangible"
        return Diagnostic("N501", _loops_named(message, row.nest), row.place)
    flows = [n for t in row.terms for n in local_variables(t.expression, mirror.rate)]
    touched = next((n.data[0] for n in flows if n.data[0] in tangible), flows[0].data[0])
    text = to_text(add(*(t.expression for t in offset.terms)))
    start = _at_start(add(*(t.expression for t in offset.terms)), mirror)
    message = f"psi {row.name} was integrated because {touched} is tangible: phi: {text} - ({start}) = 0"
    return Diagnostic("N501", _loops_named(message, row.nest), row.place)


def _loops_named(text: str, nest: Nest) -> str:
    """Canonical loop variables as i, j, k, with their ranges."""
    ranges = []
    for k, loop in enumerate(nest):
        text = text.replace(loop.index, "ijklmn"[k])
        ranges.append(f"{'ijklmn'[k]} in {to_text(loop.first)}..{to_text(loop.last)}")
    return f"{text} for {', '.join(ranges)}" if ranges else text


def _at_start(expression: Node, mirror: Mirror) -> str:
    marks = {
        n: var(f"{n.data[0]}(0)", mirror.coordinate, *n.args) for n in local_variables(expression, mirror.coordinate)
    }
    return to_text(substitute(expression, {**marks, time(): const(0.0)}))


def _rename_multipliers(model: EnergyModel, labels: set[str]) -> EnergyModel:
    """Multipliers mu of the labels written as kappa everywhere."""

    def new(root: Node) -> Node:
        found = [n for n in local_variables(root, "mu", None) if n.data[0] in labels]
        return substitute(root, {n: var(n.data[0], "kappa", *n.args) for n in found}) if found else root

    return model.rewritten(new)
