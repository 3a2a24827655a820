"""A Program checked and printed."""

from __future__ import annotations

from sysdyn.compiler.model.integers import ArrayElement, FamilyReference, Index
from sysdyn.compiler.program.program import Assign, Fold, Operand, Program, Statement, StoreInstruction


def verify_program(program: Program) -> None:
    """AssertionError where a value is used before it is assigned, assigned twice, or an entry is not written once."""
    patterns = dict(program.patterns)
    written: dict[tuple[str, str, int], list[int]] = {}
    for routine in program.routines:
        depth = len(routine.loops)
        _verify_body(routine.body, set(), set(), depth, len(program.slots))
        stores = [s.place for s in routine.body if isinstance(s, StoreInstruction)]
        pattern = patterns[routine.block][routine.kernel]
        assert pattern.loops == routine.loops, "loops of a routine and of its pattern"
        if routine.part == "rows":
            assert all(isinstance(place, FamilyReference) for place in stores)
            continue
        key = (routine.block, routine.part, routine.kernel)
        written.setdefault(key, []).extend(place for place in stores if isinstance(place, int))
    for (block, part, kernel), places in written.items():
        count = len(getattr(patterns[block][kernel], part))
        assert places == list(range(count)), f"{block} {part}: entries {places} of {count}"


def _verify_body(body: tuple[Statement, ...], known: set[int], taken: set[int], depth: int, slots: int) -> None:
    """`known`: values in scope; `taken`: every target so far; `depth`: number of loop variables in scope."""
    for statement in body:
        match statement:
            # stores a value in scope; assigns none
            case StoreInstruction():
                _verify_operands((statement.value,), known)
                if isinstance(statement.place, FamilyReference):
                    _verify_indices(statement.place.indices, depth, slots)
                continue
            # its body sees what is outside, and hides what it assigns
            case Fold():
                inner = set(known)
                _verify_indices((statement.first, statement.last), depth, slots)
                _verify_body(statement.body, inner, taken, depth + 1, slots)
                _verify_operands((statement.value,), inner)
            case Assign():
                _verify_operands(statement.args, known)
                if isinstance(statement.data, FamilyReference | ArrayElement):
                    _verify_indices(statement.data.indices, depth, slots)
        assert statement.target not in taken, f"value {statement.target} is assigned twice"
        taken.add(statement.target)
        known.add(statement.target)


def _verify_operands(operands: tuple[Operand, ...], known: set[int]) -> None:
    late = [a for a in operands if isinstance(a, int) and a not in known]
    assert not late, f"values {late} are used before they are assigned"


def _verify_indices(indices: tuple[Index, ...], depth: int, slots: int) -> None:
    for index in indices:
        assert -1 <= index.loop < depth, f"{index}: no such loop"
        assert -1 <= index.slot < slots, f"{index}: no such slot"
        assert -1 <= index.table < slots, f"{index}: no such slot"


def show(program: Program) -> str:
    """The program as text, for --dump program."""
    lines = [f"ix[{k}] = {' '.join(map(str, slot))}" for k, slot in enumerate(program.slots)]
    lines += [f"p[{k}] = {name}" for k, name in enumerate(program.scalars)]
    for routine in program.routines:
        loops = "".join(f" for {_text(a)}..{_text(b)}" for a, b in routine.loops)
        lines.append(f"{routine.block} {routine.part} kernel {routine.kernel}{loops}")
        lines += _show_body(routine.body, "  ")
    return "\n".join(lines) + "\n"


def _show_body(body: tuple[Statement, ...], indent: str) -> list[str]:
    """Lines of statements, folds with their bodies indented."""
    lines = []
    for s in body:
        match s:
            case StoreInstruction():
                lines.append(f"{indent}{_place('out', s.place)} <- {_operand(s.value)}")
            case Fold():
                lines.append(f"{indent}%{s.target} = {s.operator} for i{s.loop} in {_text(s.first)}..{_text(s.last)}")
                lines += [*_show_body(s.body, indent + "  "), f"{indent}  {_operand(s.value)}"]
            case Assign():
                data = _place("", s.data) if isinstance(s.data, FamilyReference | ArrayElement) else str(s.data or "")
                args = ", ".join(map(_operand, s.args))
                lines.append(f"{indent}%{s.target} = {s.op} {data} {args}".rstrip())
    return lines


def _operand(value: Operand) -> str:
    return f"%{value}" if isinstance(value, int) else repr(value)


def _text(index: Index) -> str:
    parts = [f"i{index.loop}"] if index.loop >= 0 else []
    parts += [f"ix[{index.slot}]"] if index.slot >= 0 else []
    text = " + ".join([*parts, str(index.constant)] if index.constant or not parts else parts)
    return text if index.table < 0 else f"ix[ix[{index.table}] + {text}]"


def _place(head: str, place: FamilyReference | ArrayElement | int) -> str:
    if isinstance(place, int):
        return f"{head}[{place}]"
    family = place.family if isinstance(place, FamilyReference) else f"ix[{place.origin}]"
    return f"{head}{family}[{', '.join(_text(i) for i in place.indices)}]"
