"""Paynter's diagram of a model: which law sits on which edge, and which variables the formulation uses."""

from __future__ import annotations

from sysdyn.cli.equations.mathml import Typesetter, math, mi, mo, row
from sysdyn.cli.page.document import escape, table
from sysdyn.cli.report.balance import author_name
from sysdyn.cli.report.report_study import ReportStudy
from sysdyn.dsl.model.expression import var
from sysdyn.dsl.model.network import Branch
from sysdyn.runtime.model.description import BESIDE, count

EDGES = ("p-f", "q-e", "e-f", "p'", "q'")
"""Kinetic, potential, dissipative; what is the rate of p (efforts), what is the rate of q (flows)."""
_EDGE = {"kinetic": "p-f", "potential": "q-e", "dissipator": "e-f", "effort": "p'", "flow": "q'"}
_FUNCTIONS = {"T*": "p-f", "T": "p-f", "V": "q-e", "V*": "q-e", "D": "e-f", "G": "e-f"}
USED = {
    "lagrangian": "qf",
    "hamiltonian": "qfp",
    "kane": "qf",
    "co_lagrangian": "pe",
    "co_hamiltonian": "peq",
    "co_kane": "pe",
}
"""Of the diagram's four variables, those that the unknowns of a formulation are (language, section 6)."""
_KINDS = {
    "q": "displacement",
    "f": "flow",
    "p": "momentum",
    "s": "dynamic variable",
    "e": "implicit effort",
    "kappa": "multiplier of a displacement constraint",
    "mu": "multiplier of a flow constraint",
}
_CO_KINDS = {
    "q": "momentum",
    "f": "effort",
    "p": "displacement",
    "e": "implicit flow",
    "kappa": "multiplier of a momentum constraint",
    "mu": "multiplier of an effort constraint",
}
MOST = 400


def section(study: ReportStudy) -> str:
    """The diagram, the table of laws, the table of unknowns."""
    rows = [*_of_branches(study), *_of_statements(study)]
    heads = ("element or statement", "domain", *(_head(edge) for edge in EDGES))
    more = f'<p class="soft">… {len(rows) - MOST} more</p>' if len(rows) > MOST else ""
    return _diagram(study.prepared.formulation) + table(heads, rows[:MOST], left=range(7)) + more


def _head(edge: str) -> str:
    one, _, two = edge.partition("-")
    text = f"{escape(one.replace(chr(39), ''))}{'′' if one.endswith(chr(39)) else ''}"
    return f"<i>{text}</i>" + (f"–<i>{two}</i>" if two else "")


def _of_branches(study: ReportStudy) -> list[list[str]]:
    """Rows of Paynter's diagram for branches and couplings: the law at its edge."""
    types = study.typesetter_of_text
    rows = []
    for branch in study.network.branches:
        if branch.kind == "port":
            continue
        name = study.link(branch.place, escape(author_name(branch.name))) + _where(branch, types)
        cells = dict.fromkeys(EDGES, "")
        # a law: at the edge of its kind
        if branch.law is not None and branch.side is not None and branch.kind in _EDGE:
            left = types.expression(var(branch.name, f"b{branch.side}", *branch.at))
            cells[_EDGE[branch.kind]] = math(left, mo("="), types.expression(branch.law))
        # its laws are derivatives of a stated energy
        elif branch.kind == "field":
            cells["p-f"] = '<span class="soft">in the energies</span>'
        rows.append([name, escape(branch.domain.name), *cells.values()])
    # a coupling relates efforts or flows of two branches
    for c in study.network.couplings:
        one = types.expression(var(c.first, f"b{c.side}", *c.at))
        two = types.expression(var(c.second, f"b{c.read}", *c.at))
        law = math(one, mo("="), types.parenthesize(c.ratio), "<mspace width='.14em'/>", two)
        domains = [b.domain.name for name in (c.first, c.second) for b in study.network.branches if b.name == name]
        label = study.link(c.place, escape(c.first.partition("#")[0])) + f' <span class="soft">{c.kind}</span>'
        cells = dict.fromkeys(EDGES, "")
        cells["p'" if c.side == "e" else "q'"] = law
        rows.append([label, escape(", ".join(dict.fromkeys(domains))), *cells.values()])
    return rows


def _where(branch: Branch, types: Typesetter) -> str:
    if branch.loops:
        return f" {math(types.bounds(branch.loops))}"
    return f" {math(mo('['), *(types.expression(a) for a in branch.at), mo(']'))}" if branch.at else ""


def _of_statements(study: ReportStudy) -> list[list[str]]:
    """Rows of Paynter's diagram for energies, works and constraints."""
    rows = []
    n = study.network
    for energy in n.energies:
        cells = dict.fromkeys(EDGES, "")
        symbol = f"<msup>{mi(energy.function[0])}{mo('*')}</msup>" if energy.function[1:] else mi(energy.function)
        cells[_FUNCTIONS[energy.function]] = math(symbol)
        label = f"{'content' if energy.function in 'DG' else 'energy'} {energy.function}"
        rows.append([study.link(energy.place, escape(label)), "", *cells.values()])
    types = study.typesetter_of_text
    for work in n.works:
        cells = dict.fromkeys(EDGES, "")
        on = types.sum_over(work.loops, row(types.parenthesize(work.effort), mo("δ"), types.parenthesize(work.on)))
        cells["p'"] = math(on)
        rows.append([study.link(work.place, "work"), "", *cells.values()])
    for c in n.constraints:
        cells = dict.fromkeys(EDGES, "")
        cells[{"phi": "q'", "psi": "q'", "gamma": "e-f"}[c.kind]] = f'<span class="soft">{c.kind}</span>'
        rows.append([study.link(c.place, f"{c.kind} {escape(c.name)}"), "", *cells.values()])
    return rows


def _diagram(formulation: str) -> str:
    """Effort above, flow below, momentum left, displacement right."""
    used = USED.get(formulation, "")
    places = {"e": (120, 24), "f": (120, 176), "p": (24, 100), "q": (216, 100)}
    parts = []
    for a, b, label, dx, dy in (
        ("p", "f", "kinetic", -34, 12),
        ("q", "e", "potential", 34, -6),
        ("e", "f", "dissipative", 30, 0),
        ("e", "p", "∫dt", -20, -8),
        ("f", "q", "∫dt", 22, 16),
    ):
        (x1, y1), (x2, y2) = places[a], places[b]
        dash = ' stroke-dasharray="4 4"' if label == "∫dt" else ""
        parts.append(f'<line x1="{x1}" y1="{y1}" x2="{x2}" y2="{y2}"{dash}/>')
        parts.append(f'<text class="law" x="{(x1 + x2) / 2 + dx}" y="{(y1 + y2) / 2 + dy}">{label}</text>')
    for name, (x, y) in places.items():
        mark = ' class="used"' if name in used else ""
        parts.append(f'<g{mark}><circle cx="{x}" cy="{y}" r="15"/><text x="{x}" y="{y + 5}">{name}</text></g>')
    words = ", ".join(used)
    svg = '<svg class="paynter" viewBox="0 0 240 200" width="240" role="img" aria-label="Paynter\'s diagram">'
    return f'{svg}{"".join(parts)}</svg><p class="soft">{escape(formulation)} is written in {words} (filled).</p>'


def unknowns(study: ReportStudy) -> str:
    """The unknowns of the formulation: name, kind, unit, how many."""
    kinds = _KINDS | _CO_KINDS if study.complementary else _KINDS
    types = study.typesetter
    description = study.started.system.description
    rows = []
    for family, known in zip(study.prepared.compiled.form.families, description.families, strict=False):
        if family.kind in BESIDE:
            continue
        symbol = math(types.typeset_unknown(family.owner, family.kind, 0))
        name = study.link(family.place, escape(family.owner))
        rows.append([symbol, name, kinds[family.kind], escape(family.unit), str(count(known.shape))])
    more = f'<p class="soft">… {len(rows) - MOST} more</p>' if len(rows) > MOST else ""
    return table(("unknown", "of", "kind", "unit", "number"), rows[:MOST], left=(0, 1, 2, 3)) + more
