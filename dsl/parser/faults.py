"""Why a statement cannot be read, in the author's terms."""

from __future__ import annotations

import re

from sysdyn.dsl.parser import complaints
from sysdyn.dsl.parser.automaton import Automaton
from sysdyn.dsl.parser.complaints import Complaint
from sysdyn.dsl.parser.lexing import BLANK, NAME, RESERVED, Bracket
from sysdyn.dsl.parser.shapes import SHAPES
from sysdyn.dsl.text.diagnostics import Related
from sysdyn.dsl.text.source import Span
from sysdyn.dsl.tree.syntax import BrokenStatement

WORD = re.compile(NAME)
_TARGET = re.compile(r"[\w.]+(?:\[[^\]\n]*\])?'?[ \t]*+")
"""What stands before the sign of an assignment."""
_BLANK = re.compile(rf"{BLANK}*+")
_UNLABELLED = frozenset({"law", "energy", "content", "work", "init", "let", "dynamic", "require", "expect"})
_ELEMENT = re.compile(r":[ \t]*+[\w.]+[ \t]*+\(")
_BEHIND = frozenset({"on", "within", "every", "while", "restitution", "to", "as", "->", "{", ":="})
"""Terminals that stand in no bracket, but may stand behind one."""


class Faults:
    """Says what is wrong; nothing is skipped or mended here."""

    def __init__(self, automaton: Automaton) -> None:
        self.automaton = automaton
        self.scanner = automaton.scanner
        self.errors = 0
        self.nameless = False  # the statement lacks its label: any name may be its own
        self.reserved: set[str] = set()  # reserved words that were told to be none of the author's names

    def _complain(self, kind: str) -> None:
        """Report why the statement cannot be read."""
        from sysdyn.dsl.parser import foreign

        automaton, scanner = self.automaton, self.scanner
        ends_with = scanner.suspect is not None and scanner.text[scanner.dangling.start : scanner.dangling.end]
        if kind in self.reserved or ends_with in self.reserved:
            return  # a place where the word is read by its name
        size, body = automaton.body()
        text = scanner.text[scanner.start : scanner.end]
        start = self._statement_start()
        word, after = self._first_word(start)
        bracket = self._open_bracket(kind)
        # `n := 3` outside of when and every
        if kind == ":=" and _TARGET.fullmatch(scanner.text, start, scanner.start):
            meant = scanner.text[start : scanner.line_end()].partition(";")[0].rstrip(" \t}")
            said = "':=' assigns at an event, and this stands in none"
            self._error(("E113", said, f"when CONDITION {{ {meant} }}, or every 10 ms {{ {meant} }}"), self._token())
        # "text without an end
        elif kind == "<fault>" and scanner.fault == "text":
            self._error(("E112", "the text that begins with this '\"' is not closed on its line", '"'), self._token())
        # a row of one number
        elif word == "table" and text == ")" and automaton.accepts(","):
            row = "a row of a table holds its arguments and the value: one number is no row"
            self._error(("E113", row, "(0, 0), (1, 2)"), self._token())
        # a bracket that is open since the lines above
        elif bracket is not None:
            self._not_closed(bracket)
        # habits of other languages: 1,5 and x**2 and 0x10
        elif (slip := foreign.find_slip(scanner.text, scanner.start, scanner.end, kind)) is not None:
            self._error(slip.complaint, self._token(), slip.meant, slip.span)
        elif kind == "<fault>":
            self._error(self._character(text, body, start), self._token())
        # an operator at the end of the line, and what follows begins a statement
        elif scanner.suspect is not None:
            sign = scanner.text[scanner.dangling.start : scanner.dangling.end]
            self._error(("E113", f"the statement ends with '{sign}': something is missing", None), scanner.dangling)
        # the first token of a statement
        elif size == len(automaton.states) and kind != "<name>" and kind not in RESERVED:
            remark = scanner.text[scanner.start : scanner.start + 2]
            text = remark if remark in ("//", "/*") else text
            self._error(complaints.first_token(text, kind, body), self._token())
        elif kind == "if" and automaton.accepts("("):
            self._error(complaints.conditional(scanner.text[scanner.end :].partition("\n")[0]), self._token())
        # `level` of a scene in a component
        elif self._other_level(word, kind, body):
            where = "a scene" if body == "statement" else "a component"
            here = "a model" if body == "statement" else "a scene"
            what = "level x = name" if body == "statement" else "level name { }"
            self._error(("E107", f"'{what}' belongs in {where}, not in {here}", None), Span(start, start + 5))
        # a word that begins no statement here
        elif word and word not in self._words_here(size) and after[:1] not in (":", "["):
            self._report_statement(word, after, body, start)
        # a word of the language as a label
        elif kind == ":" and after.startswith((":", "[")) and word in self._words_here(size):
            self._no_label(word, after, start)
        # a token in the middle of a statement: what would have been accepted
        else:
            accepted = [terminal for terminal in automaton.row if automaton.accepts(terminal)]
            before = scanner.text[: scanner.start].rstrip()
            line = before[before.rfind("\n") + 1 :]
            complaint = complaints.unexpected_token(accepted, kind, text, line, word)
            self.nameless = "has a label" in complaint[1]
            self._error(complaint, self._token())

    def _character(self, text: str, body: str, start: int) -> complaints.Complaint:
        """Why a character that begins no token cannot stand there."""
        before = self.scanner.text[start : self.scanner.start]
        first = text in "%!" and not before.strip() and start == self.scanner.start
        complaint = complaints.first_token(text, "<fault>", body) if first else complaints.character(text)
        number = re.search(r"[0-9.]+$", before)
        return (*complaint[:2], f"{number[0]} percent") if text == "%" and number is not None else complaint

    def _report_statement(self, word: str, after: str, body: str, start: int) -> None:
        """A word that begins no statement: a slip of one, another language's, or what goes on from the line above."""
        from sysdyn.dsl.parser import foreign

        complaint = complaints.unknown_statement(word, after, body, self.scanner.text)
        netlist = foreign.spice(word, after) if body == "statement" and complaint[::2] == ("E113", None) else None
        if netlist is not None:
            complaint = (complaint[0], "an element is written with its label, its parameters named", netlist)
        continues = after[:1] in ("=", ",") or not after.strip()
        if after.startswith("->") or (complaint[0] == "E113" and continues and self._is_indented(start)):
            complaint = complaints.connection()
            if self._told_above(start):
                return
        self.nameless = "has a label" in complaint[1]
        self._error(complaint, Span(start, start + len(word)))

    def _no_label(self, word: str, after: str, start: int) -> None:
        """A word that begins a statement stands where the label of one does."""
        message, help_ = f"'{word}' begins a statement here and cannot be the label of an element", f"{word}_: ..."
        element = _ELEMENT.match(after) is not None
        if not element and word in _UNLABELLED:
            help_ = f"{SHAPES.get(word, word + ' ...')}, without ':'"
        if not element and word in ("phi", "psi", "gamma"):
            message, help_ = f"a {word} has a label, by which its multiplier is read", f"{word} name: ... = ..."
        self.nameless = True
        self._error(("E113", message, help_), Span(start, start + len(word)))

    def _words_here(self, size: int) -> dict[str, int]:
        """The terminals with which a statement may begin here."""
        return self.automaton.row_at(size - 1)

    def _other_level(self, word: str, kind: str, body: str) -> bool:
        """Whether this is the scene's `level` in a model, or the model's in a scene."""
        if word != "level":
            return False
        if body == "statement":
            return kind == "="
        return body == "scene_statement" and kind in ("{", "extends", "<name>")

    def _told_above(self, start: int) -> bool:
        """Whether the line above, as far to the right, was told to continue a statement already."""
        size, _ = self.automaton.body()
        said = self.automaton.notes.report.diagnostics
        value = self.automaton.values[size - 2] if 3 <= size <= len(self.automaton.values) else None
        last = value[-1] if isinstance(value, list) and value else None
        return (
            isinstance(last, BrokenStatement)
            and bool(said)
            and said[-1].code == "E109"
            and self.scanner.column(start) == self.scanner.column(last.span.start)
        )

    def _is_indented(self, start: int) -> bool:
        """Whether the statement stands further right than the one before it, those that continue it left out."""
        states, starts = self.automaton.states, self.automaton.starts
        size, _ = self.automaton.body()
        if size < 3 or size > len(states):
            return False
        before = starts[size - 2]
        if self.automaton.values[size - 2] == "{":
            return False
        value = self.automaton.values[size - 2]
        if isinstance(value, list) and value:
            whole = [item for item in value if not isinstance(item, BrokenStatement)]
            before = (whole or value)[-1].span.start
        return self.scanner.column(start) > self.scanner.column(before)

    # --- brackets ---

    def _open_bracket(self, kind: str) -> Bracket | None:
        """The bracket of this statement that is missing its partner, if that is the fault."""
        scanner = self.scanner
        start = self._statement_start()
        mine = [item for item in scanner.brackets if item.offset >= start and item.sign != "{"]
        if not mine or mine[-1].offset >= scanner.start:
            return None
        text = scanner.text[scanner.start : scanner.end]
        if scanner.suspect is not None or kind in ("<end>", "}") or text in (")", "]", ";"):
            return mine[-1]
        closing = ")" if mine[-1].sign == "(" else "]"
        return mine[-1] if kind in _BEHIND and self.automaton.accepts(closing) else None

    def _not_closed(self, bracket: Bracket) -> None:
        """E112 with the place where indentation says that the bracket ends."""
        scanner, source = self.scanner, self.automaton.source
        line, _ = source.position(bracket.offset)
        column = scanner.column(scanner.first_on_line(bracket.offset))
        related = []
        for number in range(line + 1, len(source.line_starts) + 1):
            text = source.line(number)
            if text.strip() and len(text) - len(text.lstrip(" \t")) <= column:
                start = source.line_starts[number - 1] + len(text) - len(text.lstrip(" \t"))
                message = "by its indentation it ends before this line"
                related.append(Related(message, source.place(start, start + len(text.strip()))))
                break
        self.errors += 1
        self.automaton.notes.report.error(
            "E112",
            f"'{bracket.sign}' opened at line {line} is not closed",
            source.place(bracket.offset, bracket.offset + 1),
            help={"(": ")", "[": "]", "{": "}"}[bracket.sign],
            related=related,
        )

    # --- places ---

    def _statement_start(self) -> int:
        """Offset at which the present statement began."""
        size, _ = self.automaton.body()
        starts = self.automaton.starts
        return starts[size] if size < len(starts) else self.scanner.start

    def _first_word(self, start: int) -> tuple[str, str]:
        """The word at an offset ('' where there is none) and the rest of its line."""
        text = self.scanner.text
        word = WORD.match(text, start)
        if word is None:
            return "", ""
        blank = _BLANK.match(text, word.end())
        first = word.end() if blank is None else blank.end()
        line, _ = self.automaton.source.position(start)
        starts = self.automaton.source.line_starts
        return word.group(), text[first : starts[line] if line < len(starts) else len(text)]

    def _token(self) -> Span:
        """The span of the present token; at least one character where there is one."""
        scanner = self.scanner
        return Span(scanner.start, scanner.end)

    def _error(self, complaint: Complaint, span: Span, meant: str | None = None, where: Span | None = None) -> None:
        """Report a complaint; meant: what certainly belongs at the span (or where) instead."""
        self.errors += 1
        code, message, help_ = complaint
        edit = None if meant is None else (where or span, meant)
        self.automaton.notes.error(code, message, span, help_, edit)
