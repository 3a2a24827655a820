"""Equations, energy functions and matrices as MathML, and a page of them."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from itertools import groupby

from sysdyn.cli.equations.forms import FormContent
from sysdyn.cli.equations.mathml import Typesetter, math, mi, mo, row
from sysdyn.cli.page.document import document, escape
from sysdyn.compiler.equations.book import CO_WORDS, REFLECTED, WORDS, Equation, Function, Summed
from sysdyn.compiler.equations.matrices import Matrix
from sysdyn.compiler.model.terms import Nest
from sysdyn.compiler.pipeline import CompiledModel
from sysdyn.dsl.model.expression import Node, index, is_const
from sysdyn.dsl.text.diagnostics import Place

Link = Callable[[Place | None, str], str]
"""A label (HTML) as a link to the line of a place."""
_MINUS = ("<mo>−", "<mrow><mo>−")
_SAID = {
    "T*": "kinetic coenergy",
    "T": "kinetic energy",
    "V": "potential energy",
    "V*": "potential coenergy",
    "D": "content",
    "G": "cocontent",
    "H": "Hamiltonian",
}


def rows(found: Iterable[Equation], types: Typesetter, link: Link, *, complementary: bool) -> Iterator[str]:
    """A label and an equation for each row family; rates of displacements, which are dotted, are left out."""
    words = WORDS | CO_WORDS if complementary else WORDS
    shown = (e for e in found if e.kind != "kinematic" or not _is_flow(e))
    for _, group in groupby(shown, key=lambda e: (e.kind, e.owner)):
        members = list(group)
        first = members[0]
        label = f"{words.get(first.kind, 'rate of')} {escape(first.owner)}"
        yield link(first.place, label) if first.place else f"<span>{label}</span>"
        yield f"<div>{equation(members, types)}</div>"


def _is_flow(e: Equation) -> bool:
    """Whether it says that a rate is a flow."""
    return len(e.right) == 1 and e.right[0].expression.op == "var" and e.right[0].expression.data[1] == "f"


def functions(found: Iterable[Function], types: Typesetter, *, complementary: bool) -> Iterator[str]:
    """A label and a formula for each state function and for virtual work."""
    for function in found:
        if function.efforts:
            works = [_effort(types, e.over, e.terms, e.on) for e in function.efforts]
            said = "virtual work" if function.name == "W" else "virtual displacements and momenta"
            yield f"<span>{said}</span>"
            yield f"<div>{math(mo('δ'), mi(function.name), mo('='), _plus(works))}</div>"
            continue
        shown = REFLECTED[function.name] if complementary else function.name
        yield f"<span>{_SAID[shown]}</span>"
        yield f"<div>{math(_symbol(shown), mo('='), terms(function.terms, types))}</div>"


def matrix(found: Matrix, types: Typesetter) -> str:
    """A matrix with its name."""
    base, _, below = found.name.partition("_")
    name = f"<msub>{mi(base)}{mi(below)}</msub>" if below else mi(base)
    lines = (
        "<mtr>" + "".join(f"<mtd>{terms([Summed((), t) for t in entry], types)}</mtd>" for entry in line) + "</mtr>"
        for line in found.rows
    )
    return math(name, mo("="), mo("["), f"<mtable>{''.join(lines)}</mtable>", mo("]"))


def page(title: str, content: FormContent, compiled: CompiledModel) -> str:
    """A page of its own."""
    complementary = compiled.form.formulation.startswith("co_")
    names, switches = (c.name for c in compiled.energies.coordinates), compiled.network.switches
    elements = (b.name for b in compiled.network.branches)
    types = Typesetter(names, switches, elements, complementary=complementary)
    parts = (
        functions(content.functions, types, complementary=complementary),
        (f"<span></span><div>{matrix(m, types)}</div>" for m in content.matrices),
        rows(content.equations, types, _plain_label, complementary=complementary),
    )
    body = "".join(f'<div class="equations">{"".join(part)}</div>' for part in parts)
    return document(title, f"<h1>{escape(title)}</h1>{body}")


def _plain_label(place: Place | None, label: str) -> str:
    return f"<span>{label}</span>"


def _effort(types: Typesetter, over: Nest, found: Sequence[Node], on: Node) -> str:
    """Q delta q."""
    effort = _plus([types.expression(term) for term in found])
    held = types.parenthesize(found[0]) if len(found) == 1 and found[0].op != "sum" else row(mo("("), effort, mo(")"))
    single = len(found) == 1 and len(found[0].args) == 1
    return types.sum_over(over, row(effort if single else held, mo("δ"), types.parenthesize(on)))


def _symbol(name: str) -> str:
    return f"<msup>{mi(name[0])}{mo('*')}</msup>" if name.endswith("*") else mi(name)


def terms(found: Iterable[Summed], types: Typesetter) -> str:
    """Terms with their signs."""
    texts = [
        types.sum_over(t.over, (types.parenthesize if t.over else types.expression)(t.expression))
        for t in found
        if not is_const(t.expression, 0.0)
    ]
    return _plus(texts)


def _plus(pieces: Sequence[str]) -> str:
    found: list[str] = []
    for piece in pieces:
        found += [mo("+")] if found and not piece.startswith(_MINUS) else []
        found.append(piece)
    return row(*found) if found else "<mn>0</mn>"


def equation(members: Sequence[Equation], types: Typesetter) -> str:
    """Left = right, a line for each range in which terms hold."""
    first = members[0]
    if len(members) == 1 and not first.where and not first.fixed:
        return math(terms(first.left, types), mo("="), terms(first.right, types))
    lines: list[str] = []
    for e in members:
        body = terms(e.right, types)
        sign = "" if body.startswith(_MINUS) else mo("+")
        lead = sign if e.more else row(terms(e.left, types), mo("="))
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
