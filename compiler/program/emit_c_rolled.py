"""What is alike of a program as C: functions that go through tables, and the calls that take the place of routines.

Received: a program, and how statements and routines are printed.  Returned: the functions' texts and, for each routine
that they stand for, the calls; routines that are printed as they are have none.
"""

from __future__ import annotations

from collections.abc import Callable, Container, Iterable, Iterator, Sequence
from itertools import groupby

from sysdyn.compiler.program.program import ROWS_A_ROUTINE, Program, Routine, Statement, StoreInstruction
from sysdyn.compiler.program.rerolling import (
    ALIKE,
    LARGE,
    SHARED,
    TERMS,
    AlikeTexts,
    LongSum,
    as_long_sum,
    group,
    normalize_signs,
    repeated_places,
    skeleton,
    split_outputs,
)

Printed = Callable[[Sequence[Statement]], str]
"""Lines of statements of a routine without loops."""
Printer = Callable[[Routine], Printed]
Numbers = tuple[str, ...]
Split = tuple[str, Numbers]
"""A skeleton and the numbers that stand in it."""
_VOID = "    (void)p; (void)ix; (void)at; (void)to; (void)t; (void)y; (void)yd;"
_KINDS = {"n": "int32_t", "d": "double"}


class Rolled:
    """Functions under way: texts; calls: those that do the work of a routine, by its number.

    arguments, passed: of every function of the text, {out} where its output goes.
    """

    def __init__(self, arguments: str, passed: str) -> None:
        self.arguments, self.passed = arguments, passed
        self.texts: list[str] = []
        self.calls: dict[int, tuple[str, ...]] = {}
        self._tables = 0

    def outputs(self, program: Program, printer: Printer, kept: Container[int]) -> None:
        """Take outputs that are alike of kernels without loops; kept: routines that stay as they are."""
        for _, found in groupby(enumerate(program.routines), _kernel):
            kernel = dict(found)
            # short kernels gain nothing
            if sum(len(r.body) for r in kernel.values()) < LARGE:
                continue
            sums = repeated_places(kernel.values())
            single: dict[int, list[Split]] = {}
            for k, routine in kernel.items():
                outputs = None if k in kept else split_outputs(routine)
                if outputs is None:
                    continue
                printed = printer(routine)
                # several terms into one place: the order of the sum is kept
                if any(isinstance(s, StoreInstruction) and s.place in sums for s in routine.body):
                    self._in_order(k, routine, outputs, printed)
                else:
                    single[k] = [skeleton(printed(output)) for output in outputs]
            self._alike(kernel, single)

    def loops(self, program: Program, texts: dict[int, str]) -> None:
        """Take routines of loops that are one function but for whole numbers; texts: what stands between the braces."""
        alike: dict[tuple[str, str], list[tuple[int, Numbers]]] = {}
        for k, text in texts.items():
            key, numbers = skeleton(text, whole=True)
            alike.setdefault((_out(program.routines[k]), key), []).append((k, numbers))
        for (out, key), found in alike.items():
            if len(found) >= SHARED:
                self._write_shared(program, out, group(key, [numbers for _, numbers in found]), [k for k, _ in found])

    def _write_shared(self, program: Program, out: str, alike: AlikeTexts, numbers: list[int]) -> None:
        """Write one function for loops that are alike but for numbers, and a call with its tables for each of them."""
        name = f"g{len(self.texts)}"
        head, tables = self._table_names(alike)
        kind = "void " if out == "r" else "double *"
        extra = "".join(f", const {_KINDS[letter]} *restrict {letter}" for letter in head)
        first = program.routines[numbers[0]]
        lines = [f"/* {first.block}, {first.part}: {len(numbers)} loops that are alike */", *tables]
        opening = f"static SD_APART {kind}{name}({self.arguments.format(out=out)}{extra})\n{{"
        lines += [opening, _VOID, alike.text, "}", ""]
        self.texts.append("\n".join(lines))
        for row, k in enumerate(numbers):
            own = "".join(f", {table} + {row * width}" for table, width in head.values())
            call = f"{name}({self.passed.format(out=out)}{own});"
            self.calls[k] = (call if out == "r" else f"v = {call}",)

    def _alike(self, kernel: dict[int, Routine], single: dict[int, list[Split]]) -> None:
        """Loops of what is alike of a kernel, and what is left of the routines of which something is."""
        every = _rows(output for found in single.values() for output in found)
        often = {key for key, rows in every.items() if len(rows) >= ALIKE}
        taken = [k for k, found in single.items() if any(key in often for key, _ in found)]
        if not taken:
            return
        routine = kernel[taken[0]]
        outputs = [output for k in taken for output in single[k]]
        loops = _rows(output for output in outputs if output[0] in often)
        texts = [group(key, [numbers]).text for key, numbers in outputs if key not in often]
        signed = [skeleton(normalize_signs(text)) for text in texts]
        more = {key: rows for key, rows in _rows(signed).items() if len(rows) >= ALIKE}
        rest = [_block(text) for text, (key, _) in zip(texts, signed, strict=True) if key not in more]
        found = [self._write_turns(routine, group(key, rows)) for key, rows in (*loops.items(), *more.items())]
        pieces = [rest[k : k + ROWS_A_ROUTINE] for k in range(0, len(rest), ROWS_A_ROUTINE)]
        found += [self._function(routine, "the rest", piece, []) for piece in pieces]
        self.calls |= dict.fromkeys(taken, ())
        self.calls[taken[0]] = tuple(found)

    def _in_order(self, k: int, routine: Routine, outputs: Sequence[Sequence[Statement]], printed: Printed) -> None:
        """A routine whose sums are long: loops over terms that are alike, in the order of the terms."""
        sums = [as_long_sum(output) for output in outputs]
        if not any(sums):
            return
        body, tables = [], []
        for output, found in zip(outputs, sums, strict=True):
            if found is None:
                body.append(_block(printed(output)))
                continue
            lines = ["    double s = 0.0;"]
            for text, more in self._terms(found, printed):
                lines.append(text)
                tables += more
            lines += [f"s += {found.constant!r};"] if found.constant else []
            body.append("\n".join(["    {", *lines, printed([found.store]).replace("a-1", "s"), "    }"]))
        self.calls[k] = (self._function(routine, "long sums", body, tables),)

    def _terms(self, found: LongSum, printed: Printed) -> Iterator[tuple[str, list[str]]]:
        """Terms of a long sum as text: alike neighbours as turns of a loop, others one by one."""
        split = []
        for c, statements in found.terms:
            factor = "" if abs(c) == 1.0 else f"{abs(c)!r}*"
            last = f"s {'-' if c < 0.0 else '+'}= {factor}a{len(statements) - 1};"
            split.append(skeleton("\n".join([printed(statements), last])))
        for key, same in groupby(split, lambda item: item[0]):
            rows = [numbers for _, numbers in same]
            if len(rows) >= TERMS:
                yield self._turns(group(key, rows))
            else:
                yield from ((_block(group(key, [numbers]).text), []) for numbers in rows)

    def _write_turns(self, routine: Routine, alike: AlikeTexts) -> str:
        text, tables = self._turns(alike)
        return self._function(routine, f"{alike.count} that are alike", [text], tables)

    def _turns(self, alike: AlikeTexts) -> tuple[str, list[str]]:
        """A loop through the tables of a group, and these."""
        head, tables = self._table_names(alike)
        lines = [f"    const {_KINDS[letter]} *restrict {letter} = {table};" for letter, (table, _) in head.items()]
        steps = "".join(f", {letter} += {width}" for letter, (_, width) in head.items())
        lines += [f"    for (int turn = 0; turn < {alike.count}; ++turn{steps}) {{", alike.text, "    }"]
        return "\n".join(["    {", *lines, "    }"]), tables

    def _table_names(self, alike: AlikeTexts) -> tuple[dict[str, tuple[str, int]], list[str]]:
        """Names and widths of a group's tables by their letter in its text, and their texts."""
        head, tables = {}, []
        for letter, rows in (("n", alike.whole), ("d", alike.real)):
            if rows:
                name = f"{letter}{self._tables}"
                self._tables += 1
                head[letter] = name, len(rows[0])
                tables.append(_table(_KINDS[letter], name, rows))
        return head, tables

    def _function(self, routine: Routine, what: str, body: Sequence[str], tables: Sequence[str]) -> str:
        """A function of outputs that are no loops; the call of it."""
        name, out = f"g{len(self.texts)}", _out(routine)
        head = f"static SD_APART void {name}({self.arguments.format(out=out)})\n{{"
        lines = [f"/* {routine.block}, {routine.part}: {what} */", *tables, head, _VOID, *body, "}", ""]
        self.texts.append("\n".join(lines))
        return f"{name}({self.passed.format(out=out)});"


def _kernel(numbered: tuple[int, Routine]) -> tuple[str, str, int]:
    routine = numbered[1]
    return routine.block, routine.part, routine.kernel


def _rows(outputs: Iterable[Split]) -> dict[str, list[Numbers]]:
    """Numbers of what has the same skeleton."""
    found: dict[str, list[Numbers]] = {}
    for key, numbers in outputs:
        found.setdefault(key, []).append(numbers)
    return found


def _out(routine: Routine) -> str:
    return "r" if routine.part == "rows" else "v"


def _block(text: str) -> str:
    return "\n".join(["    {", text, "    }"])


def _table(kind: str, name: str, rows: Sequence[Numbers]) -> str:
    lines = ",\n    ".join([", ".join(row) for row in rows])
    return f"static const {kind} {name}[] = {{\n    {lines}}};"
