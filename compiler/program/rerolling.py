"""Outputs that are made alike as turns of one loop: what is written out by hand costs the C compiler as an array does.

Two texts are alike where only their numbers differ: places, slots, coefficients.  Of such texts one is printed, with
n[column] and d[column] where they differ, and the numbers stand in tables, a row a text.

Received: statements of a routine, printed texts.  Returned: the same, an output apart; texts in groups.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterable, Sequence

from sysdyn.compiler.program.program import Assign, Fold, Operand, Routine, Statement, StoreInstruction
from sysdyn.values import dataclass

LARGE = 256
"""Statements of a kernel in which loops are looked for: fewer are faster one after the other."""
ALIKE = 16
"""Outputs of one loop, at least."""
TERMS = 16
"""Terms of a row's sum of one loop, at least."""
SHARED = 8
"""Loops that share a function, at least."""
_REAL = r"\d+(?:\.\d+)?(?:e[+-]?\d+)?"
_NUMBER = re.compile(rf"(?<![\w.])(?:\(-{_REAL}\)|{_REAL})")
_FIRST = re.compile(r"(?<== )(-?)(?=a\d+ [-+] )")
_LATER = re.compile(rf" ([-+]) (?:({_REAL})\*)?(?=a\d)")
_WHOLE = re.compile(r"(?<![\w.])\d+(?![\w.])")
_CHEAP = frozenset(("y", "yd", "p", "element", "time", "index", "sum", "mul"))


@dataclass(frozen=True, slots=True)
class AlikeTexts:
    """Texts that are alike: text, with n[column] and d[column] for what differs; whole and real: their rows."""

    text: str
    count: int
    whole: tuple[tuple[str, ...], ...]
    real: tuple[tuple[str, ...], ...]


@dataclass(frozen=True, slots=True)
class LongSum:
    """An output that is a long sum: constant, terms with their coefficients (the value of a term is the last that its
    statements make), and where it is stored; value -1 stands for the sum.
    """

    constant: float
    terms: tuple[tuple[float, tuple[Statement, ...]], ...]
    store: StoreInstruction


def skeleton(text: str, *, whole: bool = False) -> tuple[str, tuple[str, ...]]:
    """The text without its numbers (whole: its whole numbers), and these."""
    pattern = _WHOLE if whole else _NUMBER
    return pattern.sub("@", text), tuple(pattern.findall(text))


def normalize_signs(text: str) -> str:
    """The text with sums of products with numbers alone, which differ where terms were added or taken away; the same
    values to the last bit.
    """
    text = _FIRST.sub(lambda found: "(-1.0)*" if found[1] else "1.0*", text)
    return _LATER.sub(lambda found: f" + ({'-' if found[1] == '-' else ''}{found[2] or '1.0'})*", text)


def group(key: str, rows: Sequence[tuple[str, ...]]) -> AlikeTexts:
    """One text for all rows of numbers that stand in this skeleton."""
    columns: dict[tuple[str, ...], str] = {}
    found: dict[str, list[tuple[str, ...]]] = {"n": [], "d": []}
    pieces = key.split("@")
    text = [pieces[0]]
    for piece, column in zip(pieces[1:], zip(*rows, strict=True), strict=True):
        if column not in columns:
            kind = "n" if all(number.isdigit() for number in column) else "d"
            alike = column.count(column[0]) == len(column)
            columns[column] = column[0] if alike else f"{kind}[{len(found[kind])}]"
            if not alike:
                found[kind].append(column)
        text += columns[column], piece
    whole, real = (tuple(zip(*found[kind], strict=True)) for kind in "nd")
    return AlikeTexts("".join(text), len(rows), whole, real)


def split_outputs(routine: Routine) -> list[tuple[Statement, ...]] | None:
    """The statements of each output by itself, its values numbered from 0; None where more than sums and products
    would be computed twice, or where it is loops.
    """
    if routine.loops or any(isinstance(s, Fold) for s in routine.body):
        return None
    made = {s.target: s for s in routine.body if isinstance(s, Assign)}
    outputs = [(s, _needed_assignments([s.value], made)) for s in routine.body if isinstance(s, StoreInstruction)]
    uses = Counter(target for _, needed in outputs for target in needed)
    if any(count > 1 and made[target].op not in _CHEAP for target, count in uses.items()):
        return None
    return [(*_renumber(needed, made), _store(s, needed)) for s, needed in outputs]


def as_long_sum(output: Sequence[Statement]) -> LongSum | None:
    """An output as a long sum; None where it is none, or terms share more than sums and products."""
    store = output[-1]
    made = {s.target: s for s in output if isinstance(s, Assign)}
    assert isinstance(store, StoreInstruction)
    total = made.get(store.value) if isinstance(store.value, int) else None
    if total is None or total.op != "sum" or len(total.args) < TERMS:
        return None
    needs = [_needed_assignments([a], made) for a in total.args]
    uses = Counter(target for needed in needs for target in needed)
    if not all(needs) or any(count > 1 and made[target].op not in _CHEAP for target, count in uses.items()):
        return None
    constant, coefficients = total.data
    terms = tuple((c, _renumber(needed, made)) for c, needed in zip(coefficients, needs, strict=True))
    return LongSum(constant, terms, StoreInstruction(store.place, -1))


def repeated_places(routines: Iterable[Routine]) -> set[object]:
    """Places to which the routines add more than once: the order of these sums is kept."""
    places = Counter(s.place for r in routines for s in r.body if isinstance(s, StoreInstruction))
    return {place for place, count in places.items() if count > 1}


def _needed_assignments(roots: Sequence[Operand], made: dict[int, Assign]) -> dict[int, int]:
    """Numbers of the assignments behind these values: what is needed first comes first; with numbers of their own."""
    found: dict[int, int] = {}
    stack = [(root, False) for root in reversed(roots) if isinstance(root, int)]
    while stack:
        target, ready = stack.pop()
        if target in found:
            continue
        if ready:
            found[target] = len(found)
        else:
            stack.append((target, True))
            stack.extend((a, False) for a in reversed(made[target].args) if isinstance(a, int) and a not in found)
    return found


def _renumber(needed: dict[int, int], made: dict[int, Assign]) -> tuple[Assign, ...]:
    found = []
    for target, own in needed.items():
        s = made[target]
        found.append(Assign(own, s.op, s.data, tuple(needed[a] if isinstance(a, int) else a for a in s.args)))
    return tuple(found)


def _store(s: StoreInstruction, needed: dict[int, int]) -> StoreInstruction:
    return StoreInstruction(s.place, needed[s.value] if isinstance(s.value, int) else s.value)
