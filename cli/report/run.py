"""Counts and index, the consistent start, the solver's statistics, the wall time of each stage."""

from __future__ import annotations

import numpy as np
from sysdyn.cli.page.document import escape, table
from sysdyn.cli.report.report_study import ReportStudy
from sysdyn.cli.run.start.author import names_of
from sysdyn.cli.run.start.starting import changes_by_start
from sysdyn.compiler.binding.certificate import certificate
from sysdyn.runtime.model.description import BESIDE
from sysdyn.runtime.structure.order import freedom

SHOWN = 60
"""Rows of a table of values."""
_INDEX = {"2": "2 (stabilised)"}


def passivity(study: ReportStudy) -> str:
    """The certificate: who may lose or supply energy, and how that is known."""
    found = certificate(study.prepared.network, study.prepared.binding)
    rows = [[study.link(f.place, escape(f.name)), f.role, f.how, escape(f.said)] for f in found.findings]
    said = f"<p>{escape(found.lines()[0])}</p>"
    return said + (table(["element", "role", "known by", ""], rows, left=(0, 1, 2, 3)) if rows else "")


def counts(study: ReportStudy) -> str:
    """Coordinates, constraints, freedom, index as large numbers."""
    facts = study.started.facts
    index = "–" if facts.index is None else str(facts.index)
    solved = []
    # the index that the method integrates, where there was a run
    if study.ran is not None:
        form = study.ran.outcome.index
        solved = [(_INDEX.get(form, form) if facts.index == 3 else form, "index solved")]
    found = [
        (str(facts.dof), "degrees of freedom"),
        (str(facts.coordinates), "coordinates"),
        (str(facts.m1), "displacement constraints"),
        (str(facts.m2), "flow constraints"),
        (str(facts.redundant), "redundant"),
        (str(facts.configuration_dof), "configuration freedoms"),
        (index, "index as written"),
        *solved,
        (str(study.started.system.unknowns), "unknowns"),
    ]
    # in the words of the other family
    if study.complementary:
        words = {"displacement constraints": "momentum constraints", "flow constraints": "effort constraints"}
        found = [(value, words.get(word, word)) for value, word in found]
    cells = "".join(f"<div><b>{escape(value)}</b><span>{word}</span></div>" for value, word in found)
    return f'<div class="facts">{cells}</div>'


def start(study: ReportStudy) -> str:
    """What the start changed, and where it begins."""
    state, system = study.started.state, study.started.system
    parts = []
    moves = changes_by_start(study.prepared, state)
    # guesses are free to move, fixed values are not
    if moves:
        rows = [[escape(n), f"{before:.6g}", f"{after:.6g}", escape(why)] for n, before, after, why in moves]
        more = f'<p class="soft">… {len(rows) - SHOWN} more</p>' if len(rows) > SHOWN else ""
        parts.append(f"<p>{len(moves)} guesses were moved.</p>")
        parts.append(table(("guess", "as written", "at the start", "why"), rows[:SHOWN], left=(0, 3)) + more)
    else:
        parts.append("<p>No written guess was moved.</p>")
    # what the author could fix further
    more_values, guesses = freedom(system, state)
    if more_values > 0:
        names = ", ".join(guesses[:12]) + (" …" if len(guesses) > 12 else "")
        parts.append(f"<p>{more_values} more values could be fixed, among {escape(names)}.</p>")
    parts.append(f'<p class="soft">Largest scaled residual {state.residual:.1e} at t = {state.t:g} s.</p>')
    rows, position = [], 0
    # values and rates of all unknowns, the first of many
    for family in system.description.families:
        for k in range(family.size):
            if family.kind not in BESIDE and position < state.y.size and len(rows) <= SHOWN:
                rate = f"{state.yd[position]:.6g}" if np.isfinite(state.yd[position]) else "–"
                rows.append([family.name_of(k), f"{state.y[position]:.6g}", rate])
            position += 1
    called = names_of(study.network, (name for name, *_ in rows))
    rows = [[escape(name), *numbers] for name, (_, *numbers) in zip(called, rows, strict=True)]
    more = '<p class="soft">…</p>' if len(rows) > SHOWN else ""
    values = table(("unknown", "value", "rate"), rows[:SHOWN], left=(0,)) + more
    parts.append(f"<details><summary>state at the start, SI units</summary>{values}</details>")
    return "".join(parts)


def statistics(study: ReportStudy) -> str:
    """Counters of the run."""
    if study.ran is None or study.trace is None:
        return '<p class="soft">Nothing was run.</p>'
    o, attributes = study.ran.outcome, study.trace.attributes
    rows = [["method", escape(o.method)], ["index form", escape(o.index)], ["backend", study.prepared.backend]]
    rows += [[f"{name} of the solver", f"{attributes[name]:.3g}"] for name in ("rtol", "atol") if name in attributes]
    rows += [[escape(k.replace("_", " ")), _value(v)] for k, v in o.statistics.items()]
    for name, unit in (("energy", " J"), ("constraints", "")):
        values = study.trace[f"audit.{name}"].values
        finite = values[np.isfinite(values)]
        rows.append([f"largest audit.{name}", f"{np.abs(finite).max():.2e}{unit}" if finite.size else "–"])
    for b in o.judgement.conserved if o.judgement else ():
        rows.append([f"conserved: {escape(b.title)}", f"{b.value:.2e} of {b.turnover:.3g} {escape(b.unit)}"])
    rows.append(["reached", f"{o.reached:.9g} s"])
    return table(("", ""), rows, left=(0,))


def _value(value: object) -> str:
    return "–" if value is None else f"{value:.2e}" if isinstance(value, float) else escape(str(value))


def expectations(study: ReportStudy) -> str:
    """What the scene expects, and what was found."""
    claims = study.ran.claims if study.ran is not None else ()
    if not claims:
        return ""
    rows = []
    for c in claims:
        good, text = ("good", "holds") if c.ok else ("bad", "fails")
        word = "not judged" if c.ok is None else f'<span class="{good}">{text}</span>'
        rows.append([escape(c.text), word, "–" if c.value is None else f"{c.value:.6g}"])
    return table(("expect", "verdict", "value"), rows, left=(0, 1))


def stages(study: ReportStudy) -> str:
    """Wall and CPU time of each stage."""
    rows = [[escape(stage), f"{1e3 * wall:.1f}", f"{1e3 * cpu:.1f}"] for stage, wall, cpu in study.stages]
    wall, cpu = sum(s[1] for s in study.stages), sum(s[2] for s in study.stages)
    rows.append(["<b>together</b>", f"<b>{1e3 * wall:.1f}</b>", f"<b>{1e3 * cpu:.1f}</b>"])
    return table(("stage", "wall [ms]", "CPU [ms]"), rows, left=(0,))
