"""Lines that differ in the digits of their names and numbers alone are read by one recipe.

Such lines have the same tokens at the same offsets, since no terminal has a digit in it; so they have the same tree but
for names, numbers and places. Where a line of a pattern has been read before in the same state without a finding, the
functions of its rules are called in their order, and the automaton and the scanner are set to where they would have
come. The first token of a line, with the documentation above it, is read as ever; a line with a comment, a block or
more than one statement too.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import Any, NamedTuple

from sysdyn.dsl.parser.automaton import MAX_NESTING, Automaton, Build, action_of, goto_of, rule_of
from sysdyn.dsl.parser.lexing import Bracket
from sysdyn.dsl.text.source import Span
from sysdyn.dsl.tree.syntax import Text, Word

_DIGITS = str.maketrans("123456789", "0" * 9)
_UNLIKE = re.compile(r"[#;{}\r]")
_SHALLOW = MAX_NESTING // 2
"""Nesting of a line, and around it, to which a recipe is used: depths need not be counted then."""


class Token(NamedTuple):
    """A terminal with its span and the span of its unit, from the start of the line."""

    kind: str
    start: int
    end: int
    unit: tuple[int, int] | None


class _Entry(NamedTuple):
    """A symbol on the stack: its state, its value (a slot, or slots of a list that grows), its span."""

    state: int
    value: int | list[int]
    start: int
    end: int


class Recipe(NamedTuple):
    """What to call for a line: leaves, then rules, each of which fills a slot; slot 0 is None, slot 1 the first token.

    leaf: kind, start, end, start and end of the unit; rule: function (None: a list), slots, start, end; left: what
    stands on the stack in the end; closed: the bracket that was closed last; last: the last token before the newline.
    """

    leaves: tuple[tuple[str, int, int, int, int], ...]
    rules: tuple[tuple[Build | None, tuple[int, ...], int, int], ...]
    left: tuple[_Entry, ...]
    closed: tuple[str, int, int] | None
    last: tuple[str, int, int]


class Patterns:
    """The recipes of one parse, and the line that is being read for one."""

    def __init__(self, automaton: Automaton) -> None:
        self._automaton = automaton
        self._recipes: dict[tuple[int, int, str], Recipe | int | None] = {}
        """By the states below and of the first token, and the pattern: how often it was met; None: it has no recipe."""
        self._key: tuple[int, int, str] | None = None
        self._tokens: list[Token] = []
        self._begin = self._end = self._findings = 0
        self.replayed = 0
        """Lines that were read by a recipe."""

    def follow(self, kind: str) -> None:
        """Behind a token that was taken: read the rest of its line where it begins one that is known; else note it."""
        automaton = self._automaton
        scanner = automaton.scanner
        start = scanner.start
        if start == scanner.statement and kind != "<newline>":
            self._begin_line(start)
        elif self._key is not None:
            unit = scanner.unit if kind == "<quantity>" else None
            begin = self._begin
            near = None if unit is None else (unit[0] - begin, unit[1] - begin)
            self._tokens.append(Token(kind, start - begin, scanner.end - begin, near))
            if start >= self._end:
                self._learn(kind)

    def _begin_line(self, start: int) -> None:
        """A line begins here."""
        automaton = self._automaton
        text = automaton.source.text
        self._key = None
        end = text.find("\n", start)
        end -= end > 0 and text[end - 1] == "\r"
        line = text[start:end]
        if end < 0 or automaton.damaged or automaton.depths[-1] > _SHALLOW or _UNLIKE.search(line):
            return
        states = automaton.states
        key = (states[-2], states[-1], line.translate(_DIGITS))
        found = self._recipes.get(key, 0)
        if isinstance(found, Recipe):
            self._replay(found, start)
        elif found == 0:
            self._recipes[key] = 1
        elif found is not None:
            self._key, self._tokens, self._begin, self._end = key, [], start, end
            self._findings = len(automaton.notes.report.diagnostics)

    def _learn(self, kind: str) -> None:
        """The line that was noted has been read: its recipe, where it has one."""
        automaton, key = self._automaton, self._key
        assert key is not None
        self._key = None
        clean = self._findings == len(automaton.notes.report.diagnostics) and not automaton.damaged
        ends_here = kind == "<newline>" and automaton.scanner.start == self._end
        recipe = None
        if clean and ends_here and 1 < len(self._tokens) < _SHALLOW:
            recipe = _recipe(key[0], key[1], self._tokens)
        self._recipes[key] = recipe

    def _replay(self, recipe: Recipe, at: int) -> None:
        """Read the line at an offset by its recipe; its newline is the next token."""
        automaton = self._automaton
        text, notes, scanner = automaton.source.text, automaton.notes, automaton.scanner
        slots: list[Any] = [None, automaton.values[-1]]
        add, take, new = slots.append, slots.__getitem__, tuple.__new__
        # leaves of the tree, at the place of this line
        for kind, a, b, c, d in recipe.leaves:
            a += at
            b += at
            span = new(Span, (a, b))  # without the function that a named tuple has around it
            if kind == "<name>":
                add(Word(text[a:b], span))
            elif kind == "<quantity>":
                c += at
                add(notes.quantity(text[a:c].rstrip(), span, new(Span, (c, d + at))))
            elif kind == "<number>":
                add(notes.number(text[a:b], span))
            elif kind == "<text>":
                add(Text(text[a + 1 : b - 1], span))
            else:
                add(Word(text[a:b], span) if kind in ("<function>", "<index>") else kind)
        # nodes, by the functions of the grammar in the recorded order
        for build, parts, a, b in recipe.rules:
            values = list(map(take, parts))
            add(values if build is None else build(values, new(Span, (at + a, at + b)), notes))
        automaton.cut(len(automaton.states) - 1)
        # the automaton as it stands behind the line
        for state, value, a, b in recipe.left:
            automaton.states.append(state)
            automaton.values.append([slots[k] for k in value] if isinstance(value, list) else slots[value])
            automaton.starts.append(at + a)
            automaton.ends.append(at + b)
            automaton.depths.append(automaton.depths[-1])
        if recipe.closed is not None:
            sign, a, b = recipe.closed
            scanner.closed = Bracket(sign, at + a, at + b)
        scanner.last, a, b = recipe.last
        scanner.start, scanner.end = at + a, at + b
        self.replayed += 1


def _recipe(below: int, first: int, tokens: Sequence[Token]) -> Recipe | None:
    """What the automaton does between the first token of a line and its newline; None where it would reach below.

    below, first: the states under and of the first token; tokens: those behind it, a newline the last.
    """
    stack = [_Entry(first, 1, 0, tokens[0].start)]
    rules: list[tuple[Build | None, tuple[int, ...], int, int]] = []
    opened: list[Token] = []
    closed = None
    firsts = 2 + len(tokens)

    def slot_of(value: int | list[int]) -> int:
        """The slot of a value; a list gets one."""
        if isinstance(value, int):
            return value
        rules.append((None, tuple(value), 0, 0))
        return firsts + len(rules) - 1

    # as the automaton: reduce as long as the token says so, then shift
    for number, token in enumerate(tokens):
        while (action := action_of(stack[-1].state, token.kind)) is not None and action < 0:
            left, length, build, hands_on, children = rule_of(action)
            base = len(stack) - length
            # reaches below the line: at its newline the recipe is complete
            if base < 0:
                if token.kind == "<newline>":
                    return _pack_recipe(tokens, rules, stack, closed)
                return None
            start, end = (stack[base].start, stack[-1].end) if length else (stack[-1].end, stack[-1].end)
            value = stack[-1].value
            # the children of the rule become one node or list
            if not hands_on:
                parts: list[int] = []
                for place, spliced in children:
                    part = 0 if place < 0 or not length else stack[base + place].value
                    if spliced and not isinstance(part, list):
                        return None
                    parts.extend(part if spliced and isinstance(part, list) else [slot_of(part)])
                value = parts
                if build is not None:
                    rules.append((build, tuple(parts), start, end))
                    value = firsts + len(rules) - 1
            del stack[base:]
            following = goto_of(stack[-1].state if stack else below, left)
            if following is None:
                return None
            stack.append(_Entry(following, value, start, end))
        if token.kind == "<newline>":
            break
        # the line does not parse: no recipe
        if action is None:
            return None
        stack.append(_Entry(action, number + 2, token.start, token.end))
        if token.kind in "([":
            opened.append(token)
        elif token.kind in ")]":
            closed = opened[-1].kind, opened.pop().start, token.end
    return _pack_recipe(tokens, rules, stack, closed)


def _pack_recipe(
    tokens: Sequence[Token],
    rules: Sequence[tuple[Build | None, tuple[int, ...], int, int]],
    stack: Sequence[_Entry],
    closed: tuple[str, int, int] | None,
) -> Recipe:
    """The recipe without leaves that nothing asks for."""
    # leaves and nodes that some rule or the stack reads
    asked = {0, 1, *(k for rule in rules for k in rule[1])}
    for entry in stack:
        asked.update(entry.value if isinstance(entry.value, list) else (entry.value,))
    kept = [k for k in range(len(tokens) + 2) if k in asked]
    kept += range(len(tokens) + 2, len(tokens) + 2 + len(rules))
    place = {k: at for at, k in enumerate(kept)}
    # numbered anew without the others
    leaves = tuple(
        (token.kind, token.start, token.end, *(token.unit or (0, 0)))
        for number, token in enumerate(tokens)
        if number + 2 in place
    )
    left = tuple(
        entry._replace(value=[place[k] for k in entry.value] if isinstance(entry.value, list) else place[entry.value])
        for entry in stack
    )
    return Recipe(
        leaves, tuple((b, tuple(place[k] for k in p), x, y) for b, p, x, y in rules), left, closed, tokens[-2][:3]
    )
