"""The LALR(1) automaton: tokens in, syntax tree out, in one loop without recursion.

The tables come from `grammar.py`. A reduction calls the rule's function in `build_expressions`,
`build_statements` or `build_scenes`; rules that only hand on their child cost no call, lists grow in place. What is
to be done about a token that does not fit is decided in `recovery`.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import cache
from typing import Any

from sysdyn.dsl.parser import build_expressions, build_scenes, build_statements
from sysdyn.dsl.parser.grammar import load_tables
from sysdyn.dsl.parser.lexing import Scanner
from sysdyn.dsl.parser.notes import MAX_TERMS, Notes
from sysdyn.dsl.text.source import SourceText, Span
from sysdyn.dsl.tree.syntax import ANY, BrokenStatement, Text, Word

Build = Callable[[list[Any], Span, Notes], Any]

_TABLES = load_tables()
_FINAL = int(_TABLES.final)
"""The state that has read a whole file."""

MAX_NESTING = 200
"""Deepest nesting of brackets, signs, exponents and conditionals together (E117)."""

_MAX_PARTS = 2 * MAX_TERMS
"""Terms and signs of a chain (E118); statements of a block and rows of a table are not counted."""

_NESTING = frozenset({"(", "[", "{", "^", "not", "else"})
_BODY = ("statement", "scene_statement", "action", "item", "role", "bundle_member")
_BLOCKS_OF_STATEMENTS = ("for_", "when", "every", "level", "scene")


class _ActionRows(dict[int, dict[str, int]]):
    """For each state the action on each terminal: a state to shift to, or -1 - rule.  Read when a text comes there."""

    def __init__(self) -> None:
        self._sets, self._lines = _TABLES.lookaheads.split("\n"), _TABLES.rows.split("\n")

    def __missing__(self, state: int) -> dict[str, int]:
        row = self[state] = {}
        for entry in self._lines[state].split():
            action, _, number = entry.partition(":")
            row.update(dict.fromkeys(self._sets[int(number)].split(), int(action)))
        return row


class _Gotos(dict[int, dict[str, int]]):
    """For each state the next state behind each left side."""

    def __init__(self) -> None:
        self._lines = _TABLES.gotos.split("\n")

    def __missing__(self, state: int) -> dict[str, int]:
        entries = (entry.rpartition(":") for entry in self._lines[state].split())
        row = self[state] = {left: int(following) for left, _, following in entries}
        return row


def _build(name: str) -> Build:
    """The function of a rule: named as the rule, with `_` behind a name that Python has."""
    for module in (build_expressions, build_statements, build_scenes):
        found = getattr(module, name, None) or getattr(module, name + "_", None)
        if found is not None:
            function: Build = found
            return function
    raise LookupError(name)


def _actions() -> tuple[tuple[str, int, Build | None, bool, tuple[tuple[int, bool], ...]], ...]:
    """For each rule: left side, length, function (None: a list), whether it hands on, children."""
    functions: dict[str, Build | None] = {"[]": None, "=": None}
    actions = []
    for line in _TABLES.rules.split("\n"):
        left, length, name, *children = line.split()
        if name not in functions:
            functions[name] = _build(name)
        places = tuple((-1 if item == "-" else int(item.rstrip("*")), item.endswith("*")) for item in children)
        actions.append((left, int(length), functions[name], name == "=", places))
    return tuple(actions)


_TABLE_ROWS = _ActionRows()
_TABLE_GOTOS = _Gotos()
_TABLE_RULES = _actions()


@cache
def words() -> frozenset[str]:
    """Every word that the language itself has somewhere."""
    return frozenset(word for word in _TABLES.lookaheads.split() if word.isidentifier())


def action_of(state: int, kind: str) -> int | None:
    """A state to shift to, or below 0 a rule, or None where a terminal does not fit."""
    return _TABLE_ROWS[state].get(kind)


def rule_of(action: int) -> tuple[str, int, Build | None, bool, tuple[tuple[int, bool], ...]]:
    """Left side, length, function (None: a list), whether it hands on its child, children of the rule of an action."""
    return _TABLE_RULES[-1 - action]


def goto_of(state: int, left: str) -> int | None:
    """The state behind a left side."""
    return _TABLE_GOTOS[state].get(left)


class Automaton:
    """The stack of one parse: states, and for each its value, span and depth of nesting."""

    def __init__(self, source: SourceText) -> None:
        self.source = source
        self.notes = Notes(source)
        self.scanner = Scanner(source)
        self.notes.docs = self.scanner.docs
        self.states = [0]
        self.values: list[Any] = [None]
        self.starts = [0]
        self.ends = [0]
        self.depths = [0]
        self.overflow = False
        """Whether a chain has grown longer than is read."""
        self.damaged: set[int] = set()
        """Starts of statements whose head was mended so that their block could be read."""

    @property
    def row(self) -> dict[str, int]:
        """The terminals that the present state can take."""
        return _TABLE_ROWS[self.states[-1]]

    def row_at(self, index: int) -> dict[str, int]:
        """The terminals that an earlier state of the stack could take."""
        return _TABLE_ROWS[self.states[index]]

    @property
    def finished(self) -> bool:
        """Whether a whole file has been read."""
        return self.states[-1] == _FINAL

    def advance(self, kind: str) -> bool:
        """Take one terminal; False where it does not fit (the statement's start stays on the stack)."""
        states = self.states
        while True:
            row = _TABLE_ROWS[states[-1]]
            code = row.get(kind)
            if code is None:
                return self.finished
            if code >= 0:
                break
            left, length, build, hands_on, children = _TABLE_RULES[-1 - code]
            if hands_on:
                states[-1] = _TABLE_GOTOS[states[-2]][left]
            else:
                self._reduce(left, length, build, children)
        scanner = self.scanner
        nested = kind in _NESTING or (kind == "-" and "<name>" in row)
        states.append(code)
        self.values.append(self._value(kind))
        self.starts.append(scanner.start)
        self.ends.append(scanner.end)
        self.depths.append(self.depths[-1] + nested)
        return True

    def _value(self, kind: str) -> Any:
        """What a terminal is worth: a word, a number, a text, or its own sign."""
        scanner = self.scanner
        # a sign or a word of the language
        if kind[0] != "<" or len(kind) < 3:
            return kind
        start, end = scanner.start, scanner.end
        text = scanner.text[start:end]
        if kind in ("<name>", "<function>", "<index>"):
            return Word(text, Span(start, end))
        # number and unit
        if kind == "<quantity>" and scanner.unit is not None:
            unit = Span(*scanner.unit)
            number = scanner.text[start : scanner.behind if scanner.behind > start else unit.start].rstrip()
            return self.notes.quantity(number, Span(start, end), unit)
        if kind == "<number>":
            if scanner.unit is not None and scanner.unit[1] == end:
                # a unit grown to a number where no quantity may stand (E114 has been said)
                text = scanner.text[start : scanner.behind if scanner.behind > start else scanner.unit[0]]
            return self.notes.number(text, Span(start, end))
        if kind == "<text>":
            return Text(text[1:-1], Span(start, end))
        return None

    def _reduce(self, left: str, length: int, build: Build | None, children: tuple[tuple[int, bool], ...]) -> None:
        """Replace the topmost `length` entries by what the rule makes of them."""
        states, values, starts, ends, depths = self.states, self.values, self.starts, self.ends, self.depths
        # what the rule takes from the stack, without absent parts, lists spliced in
        if length:
            base = len(values) - length
            span = Span(starts[base], ends[-1])
            # a chain of more parts than anyone writes
            if build is None and children[0] == (0, True):
                parts = values[base]
                rest = children[1:]
            # an empty rule: a body without statements
            else:
                parts = []
                rest = children
            for position, spliced in rest:
                if position < 0:
                    parts.append(None)
                elif spliced:
                    parts.extend(values[base + position])
                else:
                    parts.append(values[base + position])
            if build is None and len(parts) > _MAX_PARTS and "body" not in left and "row" not in left:
                self.overflow = True
            del states[base:], values[base:], starts[base:], ends[base:], depths[base:]
        else:
            span = Span(ends[-1], ends[-1])
            parts = [None] * len(children)
        value = parts if build is None else build(parts, span, self.notes)
        # a block with a statement that could not be read
        if span.start in self.damaged and left in _BLOCKS_OF_STATEMENTS:
            value = self.broken(span)
        self.push(left, value, span)

    def push(self, left: str, value: Any, span: Span) -> None:
        """Put a symbol with its value on the stack."""
        self.states.append(_TABLE_GOTOS[self.states[-1]][left])
        self.values.append(value)
        self.starts.append(span.start)
        self.ends.append(span.end)
        self.depths.append(self.depths[-1])

    def cut(self, size: int) -> None:
        """Take everything above the first `size` entries from the stack."""
        for stack in (self.states, self.values, self.starts, self.ends, self.depths):
            del stack[size:]

    def accepts(self, kind: str) -> bool:
        """Whether the terminal would fit now; the stack stays as it is."""
        states = list(self.states[-MAX_NESTING:])
        while (code := _TABLE_ROWS[states[-1]].get(kind)) is not None:
            if code >= 0:
                return True
            left, length, _, _, _ = _TABLE_RULES[-1 - code]
            if length >= len(states):
                return True
            del states[len(states) - length :]
            states.append(_TABLE_GOTOS[states[-1]][left])
        return states[-1] == _FINAL

    def body(self) -> tuple[int, str]:
        """Size of the stack where the present statement began, and what kind of statement it is."""
        for index in range(len(self.states) - 1, -1, -1):
            goto = _TABLE_GOTOS[self.states[index]]
            for left in _BODY:
                if left in goto:
                    return index + 1, left
        return 1, "item"

    def broken(self, span: Span, *, nameless: bool = False) -> BrokenStatement:
        """A statement that could not be read; nameless: any name may be that which it declares."""
        names = frozenset(_names(self.source.text[span.start : span.end]))
        return BrokenStatement(names | {ANY} if nameless else names, span)


def _names(text: str) -> Iterator[str]:
    """The names in a text, comments left out."""
    import re

    for match in re.finditer(r"#[^\r\n]*|([^\W\d]\w*)", text):
        if match.group(1):
            yield match.group(1)
