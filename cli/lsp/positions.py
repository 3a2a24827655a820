"""Places of the house (code points) and positions of the protocol (lines from 0, units of UTF-16 from 0)."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any
from urllib.parse import unquote, urlsplit

from sysdyn.dsl.elaborate.files import LIBRARY
from sysdyn.dsl.text.source import Place, SourceText, Span

ASTRAL = "\uffff"
"""Code points beyond it are two units of UTF-16."""
START = {"start": {"line": 0, "character": 0}, "end": {"line": 0, "character": 0}}


def units(text: str) -> int:
    """The length of a text in units of UTF-16."""
    return len(text) + sum(sign > ASTRAL for sign in text)


def position(source: SourceText, offset: int) -> dict[str, int]:
    """The protocol's position of an offset."""
    line, column = source.position(offset)
    start = source.line_starts[line - 1]
    return {"line": line - 1, "character": units(source.text[start : start + column - 1])}


def range_of(source: SourceText, span: Span) -> dict[str, dict[str, int]]:
    """The protocol's range of a span."""
    return {"start": position(source, span.start), "end": position(source, span.end)}


def offset(source: SourceText, at: dict[str, Any]) -> int:
    """The offset of a position; beyond the end of its line or of the text that end, inside a pair its start."""
    line, character = int(at["line"]), int(at["character"])
    if line < 0:
        return 0
    if line >= len(source.line_starts):
        return len(source.text)
    start, text = source.line_starts[line], source.line(line + 1)
    # characters of the protocol are units of UTF-16: two beyond the first plane
    if not text.isascii():
        for k, sign in enumerate(text):
            character -= 1 + (sign > ASTRAL)
            if character < 0:
                return start + k
        return start + len(text)
    return start + min(max(character, 0), len(text))


def name_of(uri: str) -> str:
    """The name of a document's text: the path of a file, else the URI itself."""
    parts = urlsplit(uri)
    if parts.scheme != "file":
        return uri
    path = unquote(parts.path)
    return path[1:] if os.name == "nt" and path.startswith("/") else path


def uri_of(name: str) -> str:
    """The URI of a text by its name; `std/x.sd` is a file of the library."""
    path = Path(name)
    if not path.is_absolute() and path.parts[:1] == ("std",):
        path = LIBRARY.joinpath(*path.parts[1:])
    return path.as_uri() if path.is_absolute() else name


def location(place: Place) -> dict[str, Any]:
    """The protocol's location of a place."""
    return {"uri": uri_of(place.file), "range": range_of(place.source, place.span)}
