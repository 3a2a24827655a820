"""The summands of a row family seen from its row: its loop variables written with the row's indices #0, #1, ..."""

from __future__ import annotations

from sysdyn.compiler.forms.descriptor import HOME, DescriptorForm, Summand
from sysdyn.compiler.model.terms import Nest
from sysdyn.dsl.model.expression import Node, add, index, sub, substitute, topological
from sysdyn.dsl.model.network import Loop
from sysdyn.values import dataclass


@dataclass(frozen=True, slots=True)
class EquationPiece:
    """A summand of the equation at the indices #0, #1, ...: where it holds, what it is summed over."""

    where: Nest
    fixed: tuple[tuple[int, Node], ...]
    over: Nest
    expression: Node


def pieces(form: DescriptorForm, number: int) -> list[EquationPiece]:
    """The summands of one row family as written (its derivatives left out)."""
    found = []
    for block in form.blocks:
        home = HOME.get(block.name, block.name)
        if home != form.rows[number].block or block.name.endswith(("_rate", "_acceleration", "_scale", "_normal")):
            continue
        for kernel in block.kernels:
            found += [_piece(s, kernel.nest) for s in kernel.rows if s.row == number]
    return found


def _piece(summand: Summand, nest: Nest) -> EquationPiece:
    """A summand of a row over the row's own indices: where it holds, which of these are fixed, and the loops it sums
    over.
    """
    change: dict[Node, Node] = {}
    where: list[Loop] = []
    fixed: list[tuple[int, Node]] = []
    own: set[str] = set()
    # an index of the row that is a loop variable but for a shift: the loop becomes that index
    for d, at in enumerate(summand.at):
        found = next((loop for loop in nest if _shift(at, loop.index) is not None and loop.index not in own), None)
        shift = None if found is None else _shift(at, found.index)
        if found is None or shift is None:
            fixed.append((d, at))
            continue
        own.add(found.index)
        change[index(found.index)] = sub(index(f"#{d}"), shift)
        where.append(Loop(f"#{d}", add(found.first, shift), add(found.last, shift)))
    # loops that no index of the row follows are sums
    rest = [loop for loop in nest if loop.index not in own]
    for k, loop in enumerate(rest):
        change[index(loop.index)] = index(f"#{len(summand.at) + k}")
    over = tuple(
        Loop(f"#{len(summand.at) + k}", substitute(loop.first, change), substitute(loop.last, change))
        for k, loop in enumerate(rest)
    )
    bounds = tuple(Loop(w.index, substitute(w.first, change), substitute(w.last, change)) for w in where)
    pairs = tuple((d, substitute(at, change)) for d, at in fixed)
    return EquationPiece(bounds, pairs, over, substitute(summand.expression, change))


def _shift(at: Node, name: str) -> Node | None:
    """C where `at` is the loop variable + c."""
    rest = sub(at, index(name))
    return rest if all(n.op in ("const", "param", "sum", "mul") for n in topological([rest])) else None
