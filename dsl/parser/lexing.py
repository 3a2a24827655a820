"""From characters to tokens, on demand: which tokens are possible is the parser's to say.

The parser hands over the row of its state (a mapping from terminals to actions) and gets the next
terminal; a keyword is one only where the row has it, and a number takes a unit only where a
quantity may stand. A newline is dropped inside `( )` and `[ ]`, after a sign or word that needs more, after `{`,
and after another newline; nothing is ever looked ahead for. Every pattern is linear in the length
of the text: none can backtrack.
"""

from __future__ import annotations

import re
from bisect import bisect_right
from collections.abc import Container

from sysdyn.dsl.text.source import SourceText, Span
from sysdyn.dsl.tree.syntax import Comment
from sysdyn.values import dataclass

RESERVED = frozenset({"if", "then", "else", "and", "or", "not", "true", "false"})
"""Words that are no name anywhere."""

CONTINUES = frozenset(
    {",", "+", "-", "*", "/", "=", "^", ":", "{", "->", ":=", "==", "!=", "<", ">", "<=", ">=", "~", ".."}
    | {"and", "or", "not", "if", "then", "else", "on"}
)
"""Terminals after which a line may end without ending the statement."""

# groups are not possessive: Python up to 3.11.4 loses its place where such a group begins and fails (gh-106052)
_NUMBER = r"[0-9]++(?:\.[0-9]++)?(?:[eE][+-]?[0-9]++)?"
NAME = r"[^\W\d]\w*+"
COMMENT = r"#[^\r\n]*+"
TEXT = r"\"[^\"\r\n]*+\""
BLANK = r"[ \t]"
EXPONENT = r"-?(?:(?:[13579]/[24]|[124578]/3)(?![\w.])|[0-9]++(?:\.[0-9]++)?)"
"""Of a unit: an integer, a decimal, or a fraction in lowest terms, for `4 m^4/2` is half of `4 m^4`.  What stands in
parentheses directly behind the `^` of a unit is taken for one too, and refused (E115).
"""
_FACTOR = rf"{NAME}(?:\^(?:{EXPONENT}|\([^()\r\n]*+\)))?"
_TOKEN = re.compile(
    rf"{BLANK}*+(?:({NAME})|({_NUMBER})|(;|[\r\n][ \t\r\n]*+)|({COMMENT})|({TEXT})"
    r"|(->|:=|==|!=|<=|>=|\.\.|[-+*/^=<>~:,.()\[\]{}'$]))"
)
_UNIT = re.compile(
    r"[ \t]++(?!(?:then|else|and|or|not|in|for|to|at|on|of|as|within|while|restitution|every)\b)"
    rf"({_FACTOR}(?:[./]{_FACTOR})*)"
)
_GLUED = re.compile(rf"{_FACTOR}(?:[./]{_FACTOR})*")
_INDEX = re.compile(r"[0-9]v")
_FUNCTION = re.compile(r"(?:T\*|V\*|T|V|D|G)(?![\w*])")
_BLANK = re.compile(rf"{BLANK}*+")
_WORDS = (
    "param|node|port|branch|input|output|quasi|coord|cocoord|implicit|state|discrete|dynamic|let|law|energy|content"
    "|work|phi|psi|gamma|init|when|every|for|level|require|expect|time|set|trace|accuracy|formulation|solver"
    "|redundancy|limit|from|domain|bundle|unit|const|fn|table|component|model|scene"
)
_STATEMENT = re.compile(rf"(?:{_WORDS})[ \t]++\w")
_PERHAPS = re.compile(rf"(?:{_WORDS})[ \t]++[-(]|lossless[ \t]*+[\r\n]|{NAME}[ \t]*+:|\}}")
"""How a statement begins, for the guess that a line which continues another was not meant to:
two words side by side are one for certain, the rest only where it is not indented further."""
_CLOSING = {")": "(", "]": "[", "}": "{"}


@dataclass(slots=True)
class Bracket:
    """A bracket: where it was opened, and where it was closed (the end of the closing sign)."""

    sign: str
    offset: int
    end: int = -1


class Scanner:
    """The reading position in one text, with everything that the newline rule has to remember."""

    __slots__ = (
        "_doc",
        "_doc_end",
        "_fresh",
        "_lines",
        "_own_line",
        "behind",
        "brackets",
        "closed",
        "comments",
        "dangling",
        "docs",
        "end",
        "fault",
        "glued",
        "last",
        "mismatched",
        "pending",
        "start",
        "statement",
        "suspect",
        "text",
        "unit",
    )

    def __init__(self, source: SourceText) -> None:
        self.text = source.text
        self._lines = source.line_starts
        self.start = self.end = 0
        """Span of the token read last."""
        self.last = "<newline>"
        """The token read last, newlines that were dropped left out."""
        self.unit: tuple[int, int] | None = None
        """Span of the unit of the quantity read last."""
        self.behind = 0  # where a number ends that something is grown to, before its unit
        self.glued = False
        """Whether the quantity read last lacks the space before its unit."""
        self.fault = ""
        """Why the token read last is `<fault>`: `character` or `text`."""
        self.brackets: list[Bracket] = []
        self.closed: Bracket | None = None
        """The bracket closed last."""
        self.mismatched: Bracket | None = None
        """A `{` whose `}` stands further left than the line of the `{`."""
        self.statement = 0
        """Offset of the first token of the present statement."""
        self.suspect: int | None = None
        """First token of a continuation line that looks like a statement of its own."""
        self.dangling = Span(0, 0)
        """The sign before the suspect line."""
        self.pending = False
        """Whether a newline is to be read that is not in the text (recovery)."""
        self.comments: list[Comment] = []
        self.docs: dict[int, str] = {}
        """Documentation by the offset of the statement it stands above."""
        self._doc: list[str] = []
        self._doc_end = -1
        self._fresh = True
        self._own_line = True

    def read(self, row: Container[str]) -> str:
        """The next terminal in a state that can take the terminals of `row`."""
        # a newline that recovery puts in
        if self.pending:
            self.pending = False
            self.start = self.end
            return self._newline()
        text = self.text
        match = _TOKEN.match(text, self.end)
        # over blanks, remarks, and newlines that end nothing (inside brackets, behind an operator)
        while match is not None:
            group = match.lastindex
            start, end = match.span(group)  # type: ignore[arg-type]
            # a remark
            if group == 4:
                self._comment(start, end)
                self._own_line = False
            elif group != 3:
                break
            else:
                self._own_line = text[start] != ";"
                if self._ends_statement(text[start]):
                    self.start, self.end = start, end
                    return self._newline()
                self._continue_line(end)
            self.end = end
            match = _TOKEN.match(text, end)
        else:
            return self._fault_or_end()
        if self._fresh:
            self._begin(start)
        self._own_line = False
        self.start, self.end = start, end
        word = text[start:end]
        # a word: a function where one may be called, a word of the language, or a name
        if group == 1:
            if "<function>" in row and (function := _FUNCTION.match(text, start)) is not None:
                self.end = function.end()
                kind = "<function>"
            elif word in row or word in RESERVED:
                kind = word
            else:
                kind = "<name>"
        # a sign
        elif group == 6:
            kind = word if word not in "()[]{}" else self._bracket(word)
        # a number, with its unit where a quantity may stand
        elif group == 2:
            kind = self._number(row, end)
        else:
            kind = "<text>"
        self.last = kind
        return kind

    def _number(self, row: Container[str], end: int) -> str:
        """A bare number, or a quantity where one may stand and a unit follows."""
        text = self.text
        glued = _GLUED.match(text, end)
        if glued is not None:
            if "<index>" in row and _INDEX.fullmatch(text, self.start, glued.end()):
                self.end = glued.end()
                return "<index>"
            self.glued = True
            self.unit = glued.span()
            self.end = glued.end()
            return "<quantity>"
        if "<quantity>" not in row:
            return "<number>"
        unit = _UNIT.match(text, end)
        if unit is None:
            return "<number>"
        self.glued = False
        self.unit = unit.span(1)
        self.end = unit.end()
        return "<quantity>"

    def unit_behind(self) -> None:
        """Let the unit that follows the present number, if one does, be its own."""
        unit = _UNIT.match(self.text, self.end)
        if unit is not None and self.unit is not None:
            self.behind, self.unit, self.end = self.unit[0], unit.span(1), unit.end()

    def line_end(self) -> int:
        """Where the present line ends."""
        found = self.text.find("\n", self.start)
        return len(self.text) if found < 0 else found

    def _newline(self) -> str:
        """A newline that ends a statement."""
        self.last = "<newline>"
        self._fresh = True
        return "<newline>"

    def _ends_statement(self, sign: str) -> bool:
        """Whether a newline (or `;`) ends the statement here."""
        if self.last in ("<newline>", "{"):
            return False
        if sign == ";":
            return True
        if self.brackets and self.brackets[-1].sign != "{":
            return False
        return self.last not in CONTINUES

    def _continue_line(self, end: int) -> None:
        """Note whether the line after a dropped newline looks like a statement of its own."""
        if self._fresh or self.suspect is not None:
            return
        first = _BLANK.match(self.text, end).end()  # type: ignore[union-attr]
        if _STATEMENT.match(self.text, first) or (
            self.column(first) <= self.column(self.statement) and _PERHAPS.match(self.text, first)
        ):
            self.suspect = first
            self.dangling = Span(self.start, self.start + len(self.last))

    def _begin(self, start: int) -> None:
        """The first token of a statement."""
        self._fresh = False
        self.statement = start
        self.suspect = None
        if self._doc:
            if self._follows(start):
                self.docs[start] = "\n".join(self._doc)
            self._doc = []

    def open_block(self) -> None:
        """A `{` that is missing where the token just read stands."""
        self.brackets.append(Bracket("{", self.start))
        self.last = "{"
        self._fresh = True

    def _bracket(self, sign: str) -> str:
        """Keep the stack of open brackets."""
        brackets = self.brackets
        if sign in "([{":
            brackets.append(Bracket(sign, self.start))
            if sign == "{":
                self._fresh = True
        elif brackets and brackets[-1].sign == _CLOSING[sign]:
            self.closed = brackets.pop()
            self.closed.end = self.end
            if sign == "}":
                self._compare_indentation(self.closed)
        return sign

    def _compare_indentation(self, closed: Bracket) -> None:
        """Remember the innermost `{` whose `}` is indented less than the line that opened it."""
        first = self.first_on_line(self.start)
        opened = self.column(self.first_on_line(closed.offset))
        if first == self.start and self.column(first) < opened and self.mismatched is None:
            self.mismatched = closed

    def _comment(self, start: int, end: int) -> None:
        """Keep a comment; `##` lines directly above a statement are its documentation."""
        text = self.text[start:end]
        self.comments.append(Comment(text.rstrip(), Span(start, end), self._own_line))
        if text.startswith("##") and self._own_line:
            if not self._follows(start):
                self._doc = []
            self._doc.append(text[2:].strip())
            self._doc_end = end

    def _follows(self, start: int) -> bool:
        """Whether the line of `start` follows the last line of documentation."""
        lines = bisect_right(self._lines, start) - bisect_right(self._lines, self._doc_end)
        return lines == 1 and not self.text[self._doc_end : start].strip()

    def _fault_or_end(self) -> str:
        """The end of the text, or a character that begins no token."""
        text = self.text
        start = _BLANK.match(text, self.end).end()  # type: ignore[union-attr]
        if start >= len(text):
            self.start = self.end = len(text)
            return "<end>"
        if self._fresh:
            self._begin(start)
        self.start, self.end = start, start + 1
        self.fault = "text" if text[start] == '"' else "character"
        self.last = "<fault>"
        return "<fault>"

    def restart(self, offset: int, fresh: bool) -> None:
        """Go on reading at an offset; `fresh` where a statement begins there."""
        self.start = self.end = offset
        self.suspect = None
        if fresh:
            self.last = "<newline>"
            self._fresh = True
        while self.comments and self.comments[-1].span.start >= offset:
            self.comments.pop()

    def line_start(self, offset: int) -> int:
        """Offset of the first character of the line of `offset`."""
        return self._lines[bisect_right(self._lines, offset) - 1]

    def first_on_line(self, offset: int) -> int:
        """Offset of the first character of the line of `offset` that is no blank."""
        return _BLANK.match(self.text, self.line_start(offset)).end()  # type: ignore[union-attr]

    def column(self, offset: int) -> int:
        """Column of an offset, from 0."""
        return offset - self.line_start(offset)
