"""Rules that count elements, once parameters are bound (E504, E517).

E504 compares implicit unknowns with gamma rows; which of them no other fits is found by a matching.  E517 matches
displacement and flow constraints with coordinates: a row without a partner lies in a block with more constraints than
coordinates (the overdetermined part of Dulmage & Mendelsohn 1958).
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from sysdyn.compiler.binding.binding import Binding
from sysdyn.compiler.binding.places import entries
from sysdyn.compiler.forms.descriptor import DescriptorForm
from sysdyn.compiler.model.parameters import extents
from sysdyn.compiler.program.program import Program
from sysdyn.dsl.text.diagnostics import Diagnostic

LARGEST = 2_000  # rows: beyond, the matching in Python would take longer than the binding it is part of

Element = tuple[int, int]  # family, position


def check_counts(
    form: DescriptorForm, program: Program, binding: Binding, at_times: frozenset[str] = frozenset()
) -> tuple[Diagnostic, ...]:
    """All findings; none where a model is too large to match.  at_times: labels of constraints that hold at times."""
    return (*_implicit(form, program, binding), *_constraints(form, program, binding, at_times))


def _size(box: tuple[tuple[int, int], ...]) -> int:
    return int(np.prod(extents(box), dtype=np.int64))


def _implicit(form: DescriptorForm, program: Program, binding: Binding) -> list[Diagnostic]:
    """E504: as many gammas as implicit unknowns."""
    unknowns = [k for k, f in enumerate(form.families) if f.kind == "e"]
    gammas = [k for k, r in enumerate(form.rows) if r.block == "gamma"]
    n = sum(_size(binding.shapes[k]) for k in unknowns)
    m = sum(_size(binding.row_shapes[k]) for k in gammas)
    if n == m:
        return []
    pairs = _pairs(program, binding, ("gamma",), {k: k for k in unknowns})
    left = [(k, i) for k in gammas for i in range(_size(binding.row_shapes[k]))]
    matched = match(left, pairs)
    taken = set(matched.values())
    message = f"{n} implicit unknowns and {m} gamma equations"
    if n > m:
        free = [(k, i) for k in unknowns for i in range(_size(binding.shapes[k])) if (k, i) not in taken]
        names = [_name(form.families[k].name, binding.shapes[k], i) for k, i in free[:5]]
        return [Diagnostic("E504", f"{message}: nothing closes {', '.join(names)}", form.families[free[0][0]].place)]
    free = [row for row in left if row not in matched]
    names = [_name(form.rows[k].label, binding.row_shapes[k], i) for k, i in free[:5]]
    return [Diagnostic("E504", f"{message}: no unknown is left for {', '.join(names)}", form.rows[free[0][0]].place)]


def _constraints(
    form: DescriptorForm, program: Program, binding: Binding, at_times: frozenset[str]
) -> list[Diagnostic]:
    """E511, E517: no block of constraints larger than its set of coordinates."""
    sizes = {
        k: _size(binding.row_shapes[k])
        for k, r in enumerate(form.rows)
        if r.block in ("phi", "psi") and r.owner not in at_times
    }
    # a matching of very many rows takes too long
    if sum(sizes.values()) > LARGEST:
        return []
    left = [(k, i) for k, size in sizes.items() for i in range(size)]
    owners = {f.owner: k for k, f in enumerate(form.families) if f.kind == "f"}
    pairs: dict[Element, list[Element]] = {}
    # which coordinates each row reads
    for block, kind in (("phi", "q"), ("psi", "f")):  # a displacement and its flow are one coordinate
        families = {k: owners[f.owner] for k, f in enumerate(form.families) if f.kind == kind and f.owner in owners}
        pairs |= _pairs(program, binding, (block,), families)
    # Hall's condition: a row that cannot be matched lies in an overdetermined block
    matched = match(left, pairs)
    alone = next((row for row in left if row not in matched), None)
    if alone is None:
        return []
    rows, coordinates = _overdetermined_block(alone, matched, pairs)
    of = sorted({form.families[k].owner for k, _ in coordinates})
    labels = sorted({form.rows[k].label for k, _ in rows})
    # no coordinate at all: what it read cancels
    if not of:
        message = f"{', '.join(labels)} contains no coordinate: what it names is one, or is given, and cancels"
        return [Diagnostic("E511", message, form.rows[alone[0]].place, "delete it")]
    message = (
        f"more constraints than coordinates in block {{{', '.join(of)}}}: "
        f"{len(coordinates)} freedoms, {len(rows)} constraints ({', '.join(labels)})"
    )
    return [Diagnostic("E517", message, form.rows[alone[0]].place)]


def _pairs(
    program: Program, binding: Binding, blocks: Sequence[str], columns: dict[int, int]
) -> dict[Element, list[Element]]:
    """For each row element the column elements that occur in it; columns: family -> family that stands for it."""
    found: dict[Element, dict[Element, None]] = {}
    for block in blocks:
        for row, at, column, to in entries(program, binding, block, "dy"):
            if column in columns:
                for i, j in zip(at.tolist(), to.tolist(), strict=True):
                    found.setdefault((row, i), {})[columns[column], j] = None
    return {row: list(partners) for row, partners in found.items()}


def match(left: Sequence[Element], pairs: dict[Element, list[Element]]) -> dict[Element, Element]:
    """A largest matching of left elements with partners, by augmenting paths."""
    partner: dict[Element, Element] = {}
    owner: dict[Element, Element] = {}
    for root in left:
        before: dict[Element, Element] = {}
        stack, seen, end = [root], set(), None
        # an alternating path from the root to a column without owner
        while stack and end is None:
            row = stack.pop()
            for column in pairs.get(row, ()):
                if column in seen:
                    continue
                seen.add(column)
                before[column] = row
                if column not in owner:
                    end = column
                    break
                stack.append(owner[column])
        # along it each row takes the next column
        while end is not None:
            row = before[end]
            owner[end], previous = row, partner.get(row)
            partner[row] = end
            end = previous
    return partner


def _overdetermined_block(
    root: Element, matched: dict[Element, Element], pairs: dict[Element, list[Element]]
) -> tuple[list[Element], list[Element]]:
    """Rows and columns on alternating paths from an unmatched row: the overdetermined block."""
    owner = {column: row for row, column in matched.items()}
    rows, columns, stack = {root: None}, dict[Element, None](), [root]
    while stack:
        for column in pairs.get(stack.pop(), ()):
            if column not in columns:
                columns[column] = None
                row = owner[column]
                rows[row] = None
                stack.append(row)
    return list(rows), list(columns)


def _name(name: str, box: tuple[tuple[int, int], ...], position: int) -> str:
    """The element at a position of a family."""
    if not box:
        return name
    at = np.unravel_index(position, extents(box))
    return f"{name}[{', '.join(str(int(k) + first) for k, (first, _) in zip(at, box, strict=True))}]"
