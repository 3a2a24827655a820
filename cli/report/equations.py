"""The formulation's equations and the energy functions, typeset; families of rows once, with their ranges."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from sysdyn.cli.page.document import escape
from sysdyn.cli.report.mathml import LARGEST, Typesetter, math, mi, mo, row
from sysdyn.cli.report.study import Study
from sysdyn.compiler.forms.descriptor import HOME, DescriptorForm, Summand
from sysdyn.compiler.model.terms import Nest, Term
from sysdyn.dsl.model.expression import Node, add, index, is_const, sub, substitute, topological
from sysdyn.dsl.model.network import Loop

MOST = 200
"""Equations that a page typesets."""
BLOCKS = ("dynamics", "momentum", "phi", "psi", "gamma", "lambda")
WORDS = {
    "dynamics": "balance of",
    "momentum": "momentum of",
    "phi": "displacement constraint",
    "psi": "flow constraint",
    "gamma": "effort constraint",
    "lambda": "dynamic of",
}
CO_WORDS = {"momentum": "displacement of", "phi": "momentum constraint", "psi": "effort constraint"}
REFLECTED = {"T*": "V*", "T": "V", "V": "T", "V*": "T*", "D": "G", "G": "D"}
_MINUS = ("<mo>−", "<mrow><mo>−")
_SAID = {
    "T*": "kinetic coenergy",
    "T": "kinetic energy",
    "V": "potential energy",
    "V*": "potential coenergy",
    "D": "content",
    "G": "cocontent",
}


@dataclass(frozen=True, slots=True)
class Piece:
    """A summand of the equation at the indices #0, #1, ...: where it holds, what it is summed over."""

    where: Nest
    fixed: tuple[tuple[int, Node], ...]
    over: Nest
    expression: Node


def section(study: Study) -> str:
    """Every equation of the formulation."""
    form, types = study.prepared.compiled.form, study.typesetter
    words = WORDS | CO_WORDS if study.complementary else WORDS
    lines: list[str] = []
    count = 0
    for number, equations in enumerate(form.rows):
        if equations.block not in BLOCKS:
            continue
        count += 1
        if count > MOST:
            continue
        label = f"{words[equations.block]} {escape(equations.owner)}"
        lines.append(study.link(equations.place, label) if equations.place else f"<span>{label}</span>")
        lines.append(f"<div>{_equation(_pieces(form, number), types)}</div>")
    more = f'<p class="soft">… {count - MOST} more</p>' if count > MOST else ""
    return f'<div class="equations">{"".join(lines)}</div>{more}'


def functions(study: Study) -> str:
    """The state functions and virtual work."""
    model, types = study.prepared.compiled.energies, study.typesetter
    lines = []
    for name in model.functions:
        shown = REFLECTED[name] if study.complementary else name
        pieces = [
            types.summed(loops, (types.held if loops else types.expression)(whole))
            for loops, whole in _gathered(model.function(name))
        ]
        lines.append(f"<span>{_SAID[shown]}</span>")
        lines.append(f"<div>{math(_symbol(shown), mo('='), _plus(pieces))}</div>")
    works = []
    for work in model.works:
        pair = row(types.held(work.effort), mo("δ"), types.held(work.on))
        works.append(types.summed(work.loops, pair))
    if works:
        lines.append("<span>virtual work</span>")
        lines.append(f"<div>{math(mo('δ'), mi('W'), mo('='), _plus(works))}</div>")
    return f'<div class="equations">{"".join(lines)}</div>' if lines else '<p class="soft">none</p>'


def _symbol(name: str) -> str:
    return f"<msup>{mi(name[0])}{mo('*')}</msup>" if name.endswith("*") else mi(name)


def _gathered(found: Sequence[Term]) -> Iterator[tuple[Nest, Node]]:
    """Terms under one nest added, as long as they can be written out."""
    kept: dict[Nest, list[Node]] = {}
    for term in found:
        kept.setdefault(term.loops, []).append(term.expression)
    for loops, expressions in kept.items():
        for whole in _added(expressions):
            yield loops, whole


def _added(expressions: Sequence[Node]) -> list[Node]:
    """One sum, or its summands where it is too large to be written as one expression."""
    small = sum(len(topological([e])) for e in expressions) < LARGEST // 4
    return [add(*expressions)] if small else list(expressions)


def _plus(pieces: Sequence[str]) -> str:
    found: list[str] = []
    for piece in pieces:
        found += [mo("+")] if found and not piece.startswith(_MINUS) else []
        found.append(piece)
    return row(*found) if found else "<mn>0</mn>"


def _pieces(form: DescriptorForm, number: int) -> list[Piece]:
    found = []
    for block in form.blocks:
        home = HOME.get(block.name, block.name)
        if home != form.rows[number].block or block.name.endswith(("_rate", "_acceleration")):
            continue
        for kernel in block.kernels:
            found += [_piece(s, kernel.nest) for s in kernel.rows if s.row == number]
    return found


def _piece(summand: Summand, nest: Nest) -> Piece:
    """A summand seen from its row: its loop variables written with the row's indices."""
    change: dict[Node, Node] = {}
    where: list[Loop] = []
    fixed: list[tuple[int, Node]] = []
    own: set[str] = set()
    for d, at in enumerate(summand.at):
        found = next((loop for loop in nest if _shift(at, loop.index) is not None and loop.index not in own), None)
        shift = None if found is None else _shift(at, found.index)
        if found is None or shift is None:
            fixed.append((d, at))
            continue
        own.add(found.index)
        change[index(found.index)] = sub(index(f"#{d}"), shift)
        where.append(Loop(f"#{d}", add(found.first, shift), add(found.last, shift)))
    rest = [loop for loop in nest if loop.index not in own]
    for k, loop in enumerate(rest):
        change[index(loop.index)] = index(f"#{len(summand.at) + k}")
    over = tuple(
        Loop(f"#{len(summand.at) + k}", substitute(loop.first, change), substitute(loop.last, change))
        for k, loop in enumerate(rest)
    )
    bounds = tuple(Loop(w.index, substitute(w.first, change), substitute(w.last, change)) for w in where)
    pairs = tuple((d, substitute(at, change)) for d, at in fixed)
    return Piece(bounds, pairs, over, substitute(summand.expression, change))


def _shift(at: Node, name: str) -> Node | None:
    """C where `at` is the loop variable + c."""
    rest = sub(at, index(name))
    return rest if all(n.op in ("const", "param", "sum", "mul") for n in topological([rest])) else None


def _equation(pieces: Sequence[Piece], types: Typesetter) -> str:
    """0 = the sum of the pieces, a line for each range in which pieces hold."""
    groups: dict[tuple[Nest, tuple[tuple[int, Node], ...]], list[Piece]] = {}
    for piece in pieces:
        groups.setdefault((piece.where, piece.fixed), []).append(piece)
    bodies = [_body(members, types) for members in groups.values()]
    if len(groups) <= 1 and not any(piece.where or piece.fixed for piece in pieces):
        return math("<mn>0</mn>", mo("="), *(bodies or ["<mn>0</mn>"]))
    lines: list[str] = []
    for (where, fixed), body in zip(groups, bodies, strict=True):
        lead = _lead(later=bool(lines), signed=body.startswith(_MINUS))
        lines.append(f"{lead}<mtd style='text-align:left'>{body}</mtd>{_condition(where, fixed, types)}")
    return math(f"<mtable>{''.join(f'<mtr>{line}</mtr>' for line in lines)}</mtable>")


def _body(pieces: Sequence[Piece], types: Typesetter) -> str:
    """The sum of pieces that hold in one range."""
    nests: dict[Nest, list[Node]] = {}
    for piece in pieces:
        nests.setdefault(piece.over, []).append(piece.expression)
    texts = []
    for over, expressions in nests.items():
        for whole in _added(expressions):
            if not is_const(whole, 0.0):
                texts.append(types.summed(over, (types.held if over else types.expression)(whole)))
    return _plus(texts)


def _lead(*, later: bool, signed: bool) -> str:
    sign = "" if signed else mo("+")
    return f"<mtd style='text-align:right'>{sign if later else '<mn>0</mn>' + mo('=')}</mtd>"


def _condition(where: Nest, fixed: Sequence[tuple[int, Node]], types: Typesetter) -> str:
    pieces = [types.bounds([loop]) for loop in where]
    pieces += [row(types.expression(index(f"#{d}")), mo("="), types.expression(at)) for d, at in fixed]
    return f"<mtd style='padding-left:2em;text-align:left'>{_commas(pieces)}</mtd>" if pieces else ""


def _commas(pieces: Sequence[str]) -> str:
    found: list[str] = []
    for piece in pieces:
        found += [mo(","), piece] if found else [piece]
    return row(*found)
