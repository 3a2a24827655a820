"""A source text and the places in it.

Offsets count code points from 0; lines and columns count from 1, columns in code points. A line
ends at LF, CRLF or a lone CR.
"""

from __future__ import annotations

import os
import re
from bisect import bisect_right
from dataclasses import field
from pathlib import Path
from typing import NamedTuple

from sysdyn.values import dataclass


def real(path: str | Path) -> Path:
    """The file or folder itself, absolute and without links; a link to itself as it is, where `Path.resolve` fails."""
    return Path(os.path.realpath(path))


UNSAVED: dict[str, str] = {}
"""Texts that stand for their files, by the files' real paths: what an editor holds and has not saved (cli/lsp)."""
_LINE_END = re.compile(r"\r\n|\r|\n")
_OPTION = re.compile("--[a-z]+(-[a-z]+)*( .*)?", re.DOTALL)


class Span(NamedTuple):
    """The half-open range of offsets `start..end` in one text."""

    start: int
    end: int


@dataclass(frozen=True, slots=True)
class SourceText:
    """A named text; `name` is what messages show, usually the path as the user gave it."""

    name: str
    text: str
    line_starts: tuple[int, ...] = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        starts = (0, *(match.end() for match in _LINE_END.finditer(self.text)))
        object.__setattr__(self, "line_starts", starts)

    @property
    def typed(self) -> bool:
        """Whether it is the value of an option of the command line, by whose name it begins."""
        return _OPTION.fullmatch(self.name) is not None

    @classmethod
    def read(cls, path: str | Path, name: str | None = None) -> SourceText:
        """Read a UTF-8 file, with or without a byte-order mark, or what an editor holds of it.

        Raises OSError where the file cannot be read, and ModelError (E116) where it is too long or
        its bytes are no text.
        """
        from sysdyn.dsl.text.decoding import decode

        if UNSAVED and (text := UNSAVED.get(str(real(path)))) is not None:
            return cls(name if name is not None else str(path), text)
        with Path(path).open("rb") as stream:
            return decode(name if name is not None else str(path), stream)

    def position(self, offset: int) -> tuple[int, int]:
        """Line and column of an offset, both from 1."""
        line = bisect_right(self.line_starts, offset)
        return line, offset - self.line_starts[line - 1] + 1

    def line(self, number: int) -> str:
        """The text of line `number` (from 1) without its line end."""
        start = self.line_starts[number - 1]
        end = self.line_starts[number] if number < len(self.line_starts) else len(self.text)
        return self.text[start:end].rstrip("\r\n")

    def place(self, start: int, end: int) -> Place:
        """The place of a range of offsets in this text."""
        return Place(self, Span(start, end))


@dataclass(frozen=True, slots=True)
class Place:
    """A span together with the text that it is a span of; element: of which element of the model it speaks, by its
    path, where a component's text stands for many.
    """

    source: SourceText
    span: Span
    element: str = ""

    @property
    def file(self) -> str:
        """The name of the text."""
        return self.source.name

    @property
    def start(self) -> tuple[int, int]:
        """Line and column of the first code point."""
        return self.source.position(self.span.start)

    @property
    def end(self) -> tuple[int, int]:
        """Line and column just after the last code point."""
        return self.source.position(self.span.end)
