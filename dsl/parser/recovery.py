"""What is done about a token that does not fit: say it in the author's terms, and read on.

A slip that has one obvious meaning is mended in place (`==` for `=`, a reserved word as a name,
`3kg`). Otherwise the statement is given up at its start on the stack, the text is skipped to its
end, and a `BrokenStatement` node takes its place; a statement with a block loses only its head, the block is
read. Indentation is never needed, but where a bracket is missing it tells where.
"""

from __future__ import annotations

import re

from sysdyn.dsl.parser import complaints
from sysdyn.dsl.parser.automaton import MAX_NESTING
from sysdyn.dsl.parser.faults import WORD, Faults
from sysdyn.dsl.parser.lexing import RESERVED, Bracket
from sysdyn.dsl.parser.notes import MAX_TERMS
from sysdyn.dsl.text.source import Span

MAX_SKIPPED = 100_000
"""Tokens that are skipped for one error before the rest of the text is left unread."""

MAX_ERRORS = 100
"""After so many errors of syntax the rest of a text is not read: it is no model."""

_MOST_BRACES = 10
"""Open blocks that are named at the end of a text; more say nothing new."""

_GAP = re.compile(r"\s*+(#[^\n]*+)?")

_SLIPS = RESERVED | {"=", "==", ":="}
_OUTERMOST = frozenset({*complaints.BLOCKS, "from"})
_HEADS = {
    "model": ("model", "<name>"),
    "component": ("component", "<name>"),
    "domain": ("domain", "<name>"),
    "bundle": ("bundle", "<name>"),
    "scene": ("scene", "<name>", "of", "<name>"),
    "level": ("level", "<name>"),
    "for": ("for", "<name>", "in", "<name>", "..", "<name>"),
    "when": ("when", "true"),
    "every": ("every", "<name>"),
}
"""For each statement with a block, a head that can be read in place of a faulty one."""


class Recovery(Faults):
    """The way on after a token that does not fit."""

    # --- slips that are mended ---

    def correct_terminal(self, kind: str) -> str:
        """The terminal that was read, or the one that is obviously meant."""
        scanner, automaton = self.scanner, self.automaton
        # 3kg
        if kind == "<quantity>" and scanner.glued:
            kind = self._split_quantity()
        # a head whose brace is on the next line
        elif kind == "<newline>" and automaton.accepts("{") and not automaton.accepts(kind):
            return self._supply_brace(kind)
        # a parameter that was named `true`
        elif kind in self.reserved and kind in ("true", "false"):
            return "<name>" if automaton.accepts("<name>") else kind
        elif kind not in automaton.row or kind in _SLIPS:
            if automaton.accepts(kind):
                return kind
            # param k == 3
            if kind == "==" and automaton.accepts("="):
                self._error(("E111", f"'==' compares; {self._hint_of_equals()}", "="), self._token(), "=")
                kind = "="
            # let x := 3
            elif kind == ":=" and automaton.accepts("="):
                self._error(("E113", f"':=' assigns at an event; {self._hint_of_equals()}", "="), self._token(), "=")
                kind = "="
            # n = 3 in an event
            elif kind == "=" and automaton.accepts(":="):
                self._error(("E113", "an action assigns with ':='", ":="), self._token(), ":=")
                kind = ":="
            elif kind == "if" and automaton.body()[0] == len(automaton.states):
                return kind  # a statement of other languages
            # param in = 3: read as a name from here on
            elif kind in RESERVED and automaton.accepts("<name>") and not automaton.accepts("("):
                if kind not in self.reserved:
                    self._error(("E115", f"'{kind}' is reserved and cannot be a name", f"{kind}_"), self._token())
                self.reserved.add(kind)
                kind = "<name>"
            # x => 0
            elif kind == "=" and automaton.accepts(">=") and self.scanner.text[self.scanner.end :][:1] in (">", "<"):
                scanner = self.scanner
                meant = f"{scanner.text[scanner.end]}="
                scanner.end += 1
                said = f"'={meant[0]}' is no comparison: its sign comes first"
                self._error(("E113", said, meant), self._token(), meant)
                kind = meant
            # when x = 0
            elif kind == "=" and automaton.accepts("=="):
                self._error(("E113", "'=' defines; a comparison is written with '=='", "=="), self._token(), "==")
                kind = "=="
        return kind

    def _supply_brace(self, kind: str) -> str:
        """A head without its brace, which stands on the next line or is missing before a block further right."""
        scanner, automaton = self.scanner, self.automaton
        start = self._statement_start()
        ahead = _GAP.match(scanner.text, scanner.end)
        while ahead is not None and ahead[1]:
            ahead = _GAP.match(scanner.text, ahead.end())
        first = len(scanner.text) if ahead is None else ahead.end()
        if scanner.text[first : first + 1] == "{":
            self._error(complaints.first_token("{", "{", ""), Span(first, first + 1))
            return scanner.read(automaton.row)
        word, _ = self._first_word(start)
        if word not in _HEADS or scanner.column(first) <= scanner.column(start):
            return kind
        accepted = [terminal for terminal in automaton.row if automaton.accepts(terminal)]
        line = scanner.text[start : scanner.start].rstrip()
        self._error(complaints.unexpected_token(accepted, kind, "\n", line, word), self._token())
        scanner.open_block()
        return "{"

    def _split_quantity(self) -> str:
        """A number with its unit grown to it: read as a quantity."""
        scanner = self.scanner
        scanner.glued = False
        unit = scanner.unit or (scanner.end, scanner.end)
        text = scanner.text
        word = complaints.quote_token(text[scanner.start : scanner.end])
        from sysdyn.dsl.parser import foreign

        help_, meant = foreign.explain_suffix(text[scanner.start : unit[0]], text[unit[0] : unit[1]])
        self._error(("E114", f"{word}: a number and its unit are separated by a space", help_), self._token(), meant)
        if meant is None:  # what is grown to it is no unit: one may follow
            scanner.unit_behind()
        return "<quantity>" if self.automaton.accepts("<quantity>") else "<number>"

    def _hint_of_equals(self) -> str:
        """What the author writes where '=' is wanted."""
        word, _ = self._first_word(self.scanner.statement)
        if word in ("phi", "psi", "gamma"):
            return "a constraint is written with '='"
        return f"'{word}' defines with '='" if word else "a value is given with '='"

    # --- faults that end a statement ---

    def too_deep(self) -> None:
        """E117: more brackets, signs, exponents and conditionals in each other than are read."""
        message = f"brackets, signs and conditionals are nested deeper than {MAX_NESTING}"
        self._error(("E117", message, "name a part of it: let x = ..."), self._token())
        self._give_up("<name>")

    def too_long(self) -> None:
        """E118: a chain of more terms than are read."""
        self.automaton.overflow = False
        message = f"an expression of more than {MAX_TERMS} terms"
        self._error(("E118", message, "sum(i in 1..n: ...)"), self._token())
        self._give_up("<name>")

    def recover(self, kind: str) -> None:
        """Report a terminal that does not fit and bring the automaton to where it can go on."""
        automaton, scanner = self.automaton, self.scanner
        if self.errors >= MAX_ERRORS:
            self._stop(f"more than {MAX_ERRORS} errors of syntax: the rest of the file is not read")
            return
        size, body = automaton.body()
        first = size == len(automaton.states)
        # one brace too many
        if kind == "}" and body == "item" and (first or automaton.accepts("<newline>")):
            self._error(("E112", "'}' closes nothing that is open", None), self._token())
            if first:
                scanner.restart(scanner.end, fresh=True)
            return
        # the file ends inside of a block
        if kind == "<end>" and automaton.accepts("}"):
            self._close_all()
            return
        # a block that was not closed, before the next item
        if body != "item" and self._brace_is_missing():
            return
        if body == "item" and first and self._head_is_missing():
            return
        self._complain(kind)
        # a head that cannot be read, with a block: its statements can
        if kind != "{" and automaton.accepts("{"):
            from sysdyn.dsl.parser import headless

            if headless.has_a_block(scanner):
                headless.open_block(automaton, scanner.start)
                return
        self._give_up(kind)

    # --- brackets ---

    def _brace_is_missing(self) -> bool:
        """E112 where an item of the file begins inside a block that indentation has left."""
        scanner, automaton = self.scanner, self.automaton
        start = self._statement_start()
        word, _ = self._first_word(start)
        size, _ = automaton.body()
        if word not in _OUTERMOST or word in self._words_here(size):
            return False
        braces = [item for item in scanner.brackets if item.offset < start and item.sign == "{"]
        if not braces or scanner.column(start) > scanner.column(scanner.first_on_line(braces[0].offset)):
            return False
        automaton.cut(size)
        self._close(braces)
        scanner.restart(start, fresh=True)
        scanner.pending = True
        return True

    def _head_is_missing(self) -> bool:
        """E107 where statements stand at the top of the file and behind them a '}': their head is read as meant."""
        from sysdyn.dsl.parser import headless

        head = headless.missing_head(self.scanner.text, self.scanner.start)
        if head is None:
            return False
        said = f"statements of a {head.word} at the top of the file: the line that begins it is missing"
        self._error(("E107", said, head.line), self._token())
        headless.begin(self.automaton, head, _HEADS[head.word])
        return True

    def _close_all(self) -> None:
        """E112 for each block that is open at the end of the text."""
        self._close([item for item in self.scanner.brackets if item.sign == "{"])

    def _close(self, braces: list[Bracket]) -> None:
        """Report open blocks and close them; one whose '}' was taken for another's is named first."""
        scanner = self.scanner
        reported = list(braces)
        if scanner.mismatched is not None and reported:
            reported[-1] = scanner.mismatched
            scanner.mismatched = None
        for bracket in reported[-_MOST_BRACES:]:
            self._not_closed(bracket)
        while self.automaton.body()[1] != "item" and self.automaton.advance("}"):
            pass
        scanner.brackets.clear()

    # --- going on ---

    def _give_up(self, kind: str) -> None:
        """Skip to the end of the statement and put a Broken node in its place."""
        automaton, scanner = self.automaton, self.scanner
        size, body = automaton.body()
        start = self._statement_start()
        base = sum(1 for item in scanner.brackets if item.offset < start)
        if kind == "}" and scanner.closed is not None and scanner.closed.offset < start:
            base += 1
        automaton.cut(size)
        if not self._skip(kind, start, base, body):
            span = Span(start, max(start, scanner.start))
            automaton.push(body, automaton.broken(span, nameless=self.nameless), span)
        self.nameless = False

    def _skip(self, kind: str, start: int, base: int, body: str) -> bool:
        """Read to the end of the statement; True where a block was found whose head is mended."""
        scanner = self.scanner
        brackets = scanner.brackets
        for _ in range(MAX_SKIPPED):
            # the next line begins a statement
            if scanner.suspect is not None:
                del brackets[base:]
                scanner.restart(scanner.suspect, fresh=True)
                scanner.pending = True
                return False
            if kind == "<end>":
                del brackets[base:]
                return False
            # the end of this statement
            if kind == "<newline>" and not any(item.sign == "{" for item in brackets[base:]):
                del brackets[base:]
                scanner.pending = True
                return False
            # the end of the block around it
            if kind == "}" and self._leaves_block(base, body):
                return False
            # a block inside of what could not be read
            if kind == "{" and len(brackets) == base + 1 and self._mend_head(start):
                return True
            kind = scanner.read(())
        self._stop("the end of this statement cannot be found: the rest of the file is not read")
        return True

    def _leaves_block(self, base: int, body: str) -> bool:
        """Whether the '}' just read ends the block that the statement stands in; it is read again."""
        scanner = self.scanner
        brackets = scanner.brackets
        if len(brackets) < base and scanner.closed is not None:
            brackets.append(scanner.closed)
        elif body == "item" or self._closed_now() or any(item.sign == "{" for item in brackets[base:]):
            return False
        del brackets[base:]
        scanner.restart(scanner.start, fresh=False)
        return True

    def _closed_now(self) -> bool:
        """Whether the token just read closed a bracket."""
        return self.scanner.closed is not None and self.scanner.closed.end == self.scanner.end

    def _mend_head(self, start: int) -> bool:
        """Read a head in place of the faulty one before a '{', so that the block can be read."""
        automaton, scanner = self.automaton, self.scanner
        word, after = self._first_word(start)
        if word not in _HEADS or word not in automaton.row:
            return False
        brace = (scanner.start, scanner.end)
        name = WORD.match(after)
        first = scanner.text.index(after, start + len(word)) if after else start
        named = (first, first + len(name.group())) if name else (start, start)
        size = len(automaton.states)
        fits = True
        for number, terminal in enumerate(_HEADS[word]):
            scanner.start, scanner.end = (start, start + len(word)) if number == 0 else named
            fits = fits and automaton.advance(terminal)
        scanner.start, scanner.end = brace
        if fits and automaton.advance("{"):
            automaton.damaged.add(start)
            return True
        automaton.cut(size)
        return False

    def _stop(self, message: str) -> None:
        """Leave the rest of the text unread."""
        automaton, scanner = self.automaton, self.scanner
        self._error(("E113", message, None), self._token())
        automaton.cut(1)
        scanner.brackets.clear()
        scanner.restart(len(scanner.text), fresh=True)
