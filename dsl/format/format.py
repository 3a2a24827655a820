"""Canonical layout: `format_text` of a file, `format_expression`, `format_unit`.

One statement a line, two spaces for each block, one blank line at most, the author's order, numbers
and parentheses. Kept as the author has them: comments, a block written on one line (if it fits),
the rows of a table by lines, and a statement with comments inside. Formatting twice changes
nothing, and the tree stays the same.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from sysdyn.dsl.format.format_expressions import format_expression, format_unit
from sysdyn.dsl.format.format_statements import row_text, statement_pieces
from sysdyn.dsl.format.layout import INDENT, WIDTH, fill
from sysdyn.dsl.parser.parse import parse
from sysdyn.dsl.text.diagnostics import ModelError
from sysdyn.dsl.text.source import SourceText
from sysdyn.dsl.tree import syntax as s

__all__ = ["format_expression", "format_text", "format_unit"]

_COMMENT_COLUMN = 39
"""Where a trailing comment begins if the code before it leaves room."""


def format_text(source: s.File | SourceText | str) -> str:
    """The text in canonical layout; raises ModelError where it has errors of syntax."""
    if isinstance(source, str):
        source = SourceText("<text>", source)
    if isinstance(source, SourceText):
        tree, found = parse(source)
        if any(item.severity == "error" for item in found):
            raise ModelError(found)
        source = tree
    lines = _Formatter(source).file()
    return "\n".join(lines) + "\n" if lines else ""


class _Formatter:
    """Writes one file; comments are taken up in the order of the text."""

    def __init__(self, tree: s.File) -> None:
        self.tree = tree
        self.text = tree.source.text
        self.comments = tree.comments
        self.next = 0
        self.lines: list[str] = []

    def file(self) -> list[str]:
        """All lines."""
        self._body(self.tree.items, len(self.text), 0)
        return self.lines

    def _line(self, offset: int) -> int:
        """Number of the line of an offset."""
        return self.tree.source.position(offset)[0]

    def _body(self, nodes: Sequence[Any], end: int, indent: int) -> None:
        """Statements and the comments between them, up to the offset `end`."""
        last: int | None = None
        for number, node in enumerate(nodes):
            last = self._comments(node.span.start, indent, last)
            self._blank(last, node.span.start)
            self._statement(node, indent)
            following = nodes[number + 1].span.start if number + 1 < len(nodes) else end
            self._trailing(node.span.end, following)
            last = self._line(node.span.end)
        self._comments(end, indent, last)

    def _comments(self, end: int, indent: int, last: int | None) -> int | None:
        """Comments before the offset `end`, each on its own line."""
        while self.next < len(self.comments) and self.comments[self.next].span.start < end:
            comment = self.comments[self.next]
            self._blank(last, comment.span.start)
            self.lines.append(" " * indent + comment.text)
            last = self._line(comment.span.start)
            self.next += 1
        return last

    def _blank(self, last: int | None, start: int) -> None:
        """One blank line where the author has any."""
        if last is not None and self._line(start) > last + 1:
            self.lines.append("")

    def _trailing(self, end: int, before: int) -> None:
        """The comment behind what ends at `end`, on the same line and before the offset `before`."""
        if self.next >= len(self.comments):
            return
        comment = self.comments[self.next]
        if end <= comment.span.start < before and self._line(comment.span.start) == self._line(end):
            code = self.lines[-1]
            gap = code.ljust(_COMMENT_COLUMN) if len(code) < _COMMENT_COLUMN - 1 else code + "  "
            self.lines[-1] = gap + comment.text
            self.next += 1

    def _statement(self, node: Any, indent: int) -> None:
        """One statement with everything inside it."""
        body = _body_of(node)
        if body is not None:
            self._block(node, body, indent)
        elif self._has_comments(node.span.end):
            self._verbatim(node.span, indent)
        elif isinstance(node, s.TableDefinition) and node.rows is not None:
            self._table(node, node.rows, indent)
        else:
            self.lines.extend(fill(statement_pieces(node), indent))

    def _has_comments(self, end: int) -> bool:
        """Whether the next comment stands before an offset."""
        return self.next < len(self.comments) and self.comments[self.next].span.start < end

    def _verbatim(self, span: s.Span, indent: int) -> None:
        """A statement with comments inside: the author's lines, moved to the right indentation."""
        start = span.start
        while self._has_comments(span.end):
            self.next += 1
        first, column = self.tree.source.position(start)
        prefix = self.tree.source.line(first)[: column - 1].expandtabs(8)
        source = self.text[start : span.end].replace("\r\n", "\n").replace("\r", "\n").split("\n")
        self.lines.append(" " * indent + source[0].rstrip())
        for line in source[1:]:
            text = line.strip()
            own = len(line.expandtabs(8)) - len(line.expandtabs(8).lstrip())
            self.lines.append(" " * (indent + max(0, own - len(prefix))) + text if text else "")

    def _block(self, node: Any, body: Sequence[Any], indent: int) -> None:
        """A statement with a block."""
        brace = self._brace(node)
        pieces = statement_pieces(node)
        if not self._has_comments(node.span.end):
            single = _on_one_line(node)
            written_so = self._line(brace) == self._line(node.span.end)
            if single is not None and (written_so or not body) and indent + len(single) <= WIDTH:
                self.lines.append(" " * indent + single)
                return
        self._comments(brace, indent, None)
        self.lines.extend(fill([*pieces, " {"], indent))
        self._trailing(brace, body[0].span.start if body else node.span.end - 1)
        self._body(body, node.span.end - 1, indent + INDENT)
        self.lines.append(" " * indent + "}")

    def _brace(self, node: Any) -> int:
        """Offset of the `{` of a statement's block."""
        position = _head_end(node)
        number = self.next
        while True:
            position = self.text.index("{", position)
            while number < len(self.comments) and self.comments[number].span.end <= position:
                number += 1
            if number == len(self.comments) or self.comments[number].span.start > position:
                return position
            position = self.comments[number].span.end

    def _table(self, node: s.TableDefinition, rows: Sequence[s.TableRow], indent: int) -> None:
        """A table with its rows, on one line if the author has it so and it fits."""
        head = statement_pieces(node)
        single = "".join(head) + " [ " + ", ".join(map(row_text, rows)) + " ]"
        if self._line(node.span.start) == self._line(node.span.end) and indent + len(single) <= WIDTH:
            self.lines.append(" " * indent + single)
            return
        self.lines.extend(fill([*head, " ["], indent))
        line = " " * (indent + INDENT)
        empty = line
        previous = self._line(rows[0].span.start)
        for number, row in enumerate(rows):
            text = row_text(row) + ("," if number + 1 < len(rows) else "")
            here = self._line(row.span.start)
            if line != empty and (here != previous or len(line) + 1 + len(text) > WIDTH):
                self.lines.append(line)
                line = empty
            line += text if line == empty else " " + text
            previous = here
        self.lines.extend((line, " " * indent + "]"))


def _body_of(node: Any) -> Sequence[Any] | None:
    """The statements of a node's block; None where it has no block."""
    if isinstance(node, s.WhenStatement | s.EveryStatement):
        return node.actions
    if isinstance(node, s.BundleDefinition):
        return node.members
    if isinstance(
        node,
        s.DomainDefinition
        | s.ComponentDefinition
        | s.ModelDefinition
        | s.SceneDefinition
        | s.ForStatement
        | s.LevelStatement,
    ):
        return node.body
    return None


def _head_end(node: Any) -> int:
    """An offset between the parts of a statement's head and its `{`."""
    # the last part of the head: `for i in 1..n {`, `when x > 0 {`, `every 10 ms {`, `scene s of m {`
    match node:
        case s.ForStatement():
            return node.upper.span.end
        case s.WhenStatement():
            return node.condition.span.end
        case s.EveryStatement():
            return node.period.span.end
        case s.SceneDefinition():
            return node.model.span.end
        # component, model, level, ...: their names
        case _:
            end: int = node.name.span.end
            return end


def _on_one_line(node: Any) -> str | None:
    """A statement with its block on one line; None where that cannot be."""
    body = _body_of(node)
    if body is None:
        if isinstance(node, s.TableDefinition):
            return None
        text = "".join(statement_pieces(node))
        return text if len(text) <= WIDTH else None
    parts = [_on_one_line(item) for item in body[:WIDTH]]
    if len(body) > WIDTH or None in parts:
        return None
    inside = "; ".join(part for part in parts if part is not None)
    head = "".join(statement_pieces(node))
    return f"{head} {{ {inside} }}" if inside else f"{head} {{ }}"
