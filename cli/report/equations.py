"""The formulation's equations and the energy functions, typeset; families of rows once, with their ranges."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from itertools import groupby

from sysdyn.cli.page.document import escape
from sysdyn.cli.report.mathml import Typesetter, math, mi, mo, row
from sysdyn.cli.report.study import Study
from sysdyn.compiler.equations.algebra import Algebra
from sysdyn.compiler.equations.book import CO_WORDS, REFLECTED, WORDS, Equation, Summed, equations
from sysdyn.compiler.equations.book import functions as state_functions
from sysdyn.compiler.equations.order import Order
from sysdyn.compiler.model.terms import Nest
from sysdyn.dsl.model.expression import Node, index, is_const

MOST = 200
"""Equations that a page typesets."""
_MINUS = ("<mo>−", "<mrow><mo>−")
_SAID = {
    "T*": "kinetic coenergy",
    "T": "kinetic energy",
    "V": "potential energy",
    "V*": "potential coenergy",
    "D": "content",
    "G": "cocontent",
}


def section(study: Study) -> str:
    """Every equation of the formulation."""
    compiled, types = study.prepared.compiled, study.typesetter
    words = WORDS | CO_WORDS if study.complementary else WORDS
    lines: list[str] = []
    found = (e for e in equations(_algebra(study), compiled.energies, compiled.form, MOST) if e.kind != "kinematic")
    count = sum(r.block in WORDS for r in compiled.form.rows)
    shown = 0
    for _, group in groupby(found, key=lambda e: (e.kind, e.owner)):
        members = list(group)
        shown += 1
        first = members[0]
        label = f"{words[first.kind]} {escape(first.owner)}"
        lines.append(study.link(first.place, label) if first.place else f"<span>{label}</span>")
        lines.append(f"<div>{_equation(members, types)}</div>")
    more = f'<p class="soft">… {count - shown} more</p>' if count > shown else ""
    return f'<div class="equations">{"".join(lines)}</div>{more}'


def _algebra(study: Study) -> Algebra:
    return Algebra(Order([p.name for p in study.prepared.compiled.network.parameters]))


def functions(study: Study) -> str:
    """The state functions and virtual work."""
    model, types = study.prepared.compiled.energies, study.typesetter
    lines = []
    for function in state_functions(_algebra(study), model):
        if function.name == "W":
            works = [_effort(types, e.over, e.terms, e.on) for e in function.efforts]
            lines.append("<span>virtual work</span>")
            lines.append(f"<div>{math(mo('δ'), mi('W'), mo('='), _plus(works))}</div>")
            continue
        shown = REFLECTED[function.name] if study.complementary else function.name
        lines.append(f"<span>{_SAID[shown]}</span>")
        lines.append(f"<div>{math(_symbol(shown), mo('='), _sum(function.terms, types))}</div>")
    return f'<div class="equations">{"".join(lines)}</div>' if lines else '<p class="soft">none</p>'


def _effort(types: Typesetter, over: Nest, terms: Sequence[Node], on: Node) -> str:
    """Q delta q."""
    effort = _plus([types.expression(term) for term in terms])
    held = types.held(terms[0]) if len(terms) == 1 and terms[0].op != "sum" else row(mo("("), effort, mo(")"))
    single = len(terms) == 1 and len(terms[0].args) == 1
    return types.summed(over, row(effort if single else held, mo("δ"), types.held(on)))


def _symbol(name: str) -> str:
    return f"<msup>{mi(name[0])}{mo('*')}</msup>" if name.endswith("*") else mi(name)


def _sum(terms: Iterable[Summed], types: Typesetter) -> str:
    """Terms with their signs."""
    texts = [
        types.summed(t.over, (types.held if t.over else types.expression)(t.expression))
        for t in terms
        if not is_const(t.expression, 0.0)
    ]
    return _plus(texts)


def _plus(pieces: Sequence[str]) -> str:
    found: list[str] = []
    for piece in pieces:
        found += [mo("+")] if found and not piece.startswith(_MINUS) else []
        found.append(piece)
    return row(*found) if found else "<mn>0</mn>"


def _equation(members: Sequence[Equation], types: Typesetter) -> str:
    """Left = right, a line for each range in which terms hold."""
    first = members[0]
    if len(members) == 1 and not first.where and not first.fixed:
        return math(_sum(first.left, types), mo("="), _sum(first.right, types))
    lines: list[str] = []
    for e in members:
        body = _sum(e.right, types)
        sign = "" if body.startswith(_MINUS) else mo("+")
        lead = sign if e.more else row(_sum(e.left, types), mo("="))
        lines.append(
            f"<mtd style='text-align:right'>{lead}</mtd><mtd style='text-align:left'>{body}</mtd>"
            f"{_condition(e.where, e.fixed, types)}"
        )
    return math(f"<mtable>{''.join(f'<mtr>{line}</mtr>' for line in lines)}</mtable>")


def _condition(where: Nest, fixed: Sequence[tuple[int, Node]], types: Typesetter) -> str:
    pieces = [types.bounds([loop]) for loop in where]
    pieces += [row(types.expression(index(f"#{d}")), mo("="), types.expression(at)) for d, at in fixed]
    return f"<mtd style='padding-left:2em;text-align:left'>{_commas(pieces)}</mtd>" if pieces else ""


def _commas(pieces: Sequence[str]) -> str:
    found: list[str] = []
    for piece in pieces:
        found += [mo(","), piece] if found else [piece]
    return row(*found)
