"""Blocks whose head, or whose '{', is missing: the statements and the '}' stand there, and say what was left out.

One slip is told once: the head is read as it was meant (its name is what another line asks for in vain), and what
stands in the block is read as ever.
"""

from __future__ import annotations

import re

from sysdyn.dsl.parser.automaton import Automaton
from sysdyn.dsl.parser.complaints import BLOCKS, MODEL_WORDS, SCENE_WORDS
from sysdyn.dsl.parser.lexing import BLANK, COMMENT, NAME, TEXT, Bracket, Scanner
from sysdyn.values import dataclass

_BEGIN = rf"^{BLANK}*+"
_MARKS = re.compile(rf"{COMMENT}|{TEXT}|([{{}}])|{_BEGIN}(?:({'|'.join(BLOCKS)}){BLANK}++\w|({NAME}))", re.M)
"""What counts braces: these outside comments and texts, heads of items, first words of lines."""
_MODEL = re.compile(rf"{_BEGIN}model{BLANK}++({NAME})", re.M)
_OF = re.compile(rf"{_BEGIN}scene{BLANK}++{NAME}{BLANK}++of{BLANK}++({NAME})", re.M)
_COMPONENT = re.compile(rf"{_BEGIN}component{BLANK}++({NAME})", re.M)
_IMPORTED = re.compile(
    rf"{_BEGIN}from{BLANK}++[\w.]++{BLANK}++import{BLANK}++((?:\s*+{NAME}{BLANK}*+,)*\s*+{NAME})", re.M
)
_ELEMENT = re.compile(
    rf"(?:^|[{{;]){BLANK}*+{NAME}(?:\[[^\]\r\n]*+\])?{BLANK}*+:{BLANK}*+({NAME})(?:\.{NAME})?{BLANK}*+\(", re.M
)
BUILTINS = frozenset({"kinetic", "potential", "dissipator", "effort", "flow", "transformer", "gyrator"})
_OF_COMPONENTS = frozenset({"port", "branch", "law", "level", "lossless"})
_OF_SCENES = SCENE_WORDS - MODEL_WORDS


@dataclass(frozen=True, slots=True)
class Head:
    """A head that is missing: its word, where its name stands in the text, and the line as it should be."""

    word: str
    name: tuple[int, int]
    line: str


def surplus(text: str, start: int) -> tuple[int, frozenset[str]]:
    """How many '}' from an offset to the next item of the file close nothing behind it; the words that begin lines."""
    depth, unmatched, words = 0, 0, set[str]()
    for mark in _MARKS.finditer(text, start):
        brace, head, word = mark.groups()
        # the next item begins
        if head and depth == 0 and mark.start() > start:
            break
        # braces in pairs, and those that close too many
        if brace == "{":
            depth += 1
        elif brace == "}":
            unmatched, depth = (unmatched + 1, 0) if depth == 0 else (unmatched, depth - 1)
        elif word and depth == 0 and not unmatched:
            words.add(word)
    return unmatched, frozenset(words)


def missing_head(text: str, start: int) -> Head | None:
    """The head that the block from an offset on has lost; None where it has none, or its name is not known."""
    unmatched, words = surplus(text, start)
    if unmatched != 1:
        return None
    models, asked = {m[1] for m in _MODEL.finditer(text)}, list(_OF.finditer(text))
    if words & _OF_SCENES:
        alone = list(_MODEL.finditer(text))
        return Head("scene", alone[0].span(1), f"scene NAME of {alone[0][1]} {{") if len(alone) == 1 else None
    lost = [m for m in asked if m[1] not in models]
    if lost and not words & _OF_COMPONENTS:
        return Head("model", lost[0].span(1), f"model {lost[0][1]} {{")
    known = {m[1] for m in _COMPONENT.finditer(text)} | BUILTINS
    known |= {name for m in _IMPORTED.finditer(text) for name in re.findall(NAME, m[1])}
    used = [m for m in _ELEMENT.finditer(text) if m[1] not in known]
    return Head("component", used[0].span(1), f"component {used[0][1]} {{") if used else None


def begin(automaton: Automaton, head: Head, terminals: tuple[str, ...]) -> None:
    """Read a head, and its '{', before the statement at the present place."""
    scanner = automaton.scanner
    at = scanner.start
    for terminal in terminals:
        scanner.start, scanner.end = (at, at) if terminal == head.word else head.name
        automaton.advance(terminal)
    open_block(automaton, at)


def has_a_block(scanner: Scanner) -> bool:
    """Whether a '}' behind the present place closes a block that was not opened."""
    inside = sum(bracket.sign == "{" for bracket in scanner.brackets)
    return surplus(scanner.text, scanner.start)[0] == inside + 1


def open_block(automaton: Automaton, at: int) -> None:
    """Read a '{' that is not there."""
    scanner = automaton.scanner
    scanner.start = scanner.end = at
    automaton.advance("{")
    scanner.brackets.append(Bracket("{", at))
    scanner.restart(at, fresh=True)
