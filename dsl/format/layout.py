"""Pieces of text to lines: filled up to the width, broken only where the language lets a line break."""

from __future__ import annotations

from collections.abc import Sequence

from sysdyn.dsl.parser.lexing import CONTINUES

WIDTH = 100
"""Longest line that is written where a break can avoid it."""

INDENT = 2
CONTINUATION = 4


def fill(pieces: Sequence[str], indent: int) -> list[str]:
    """The lines of one statement; those after the first are indented further.

    A break goes after the last comma, spaced operator or word that fits, and only where there is
    none after a `=`, `*`, `/` or an opening bracket.
    """
    # most statements fit
    if sum(map(len, pieces)) + indent <= WIDTH:
        return [" " * indent + "".join(pieces).rstrip()]
    lines: list[str] = []
    start = position = 0
    width = indent
    good: int | None = None
    poor: int | None = None
    depth = 0
    # greedy: at the last good place before the line is full, else at the last poor one
    while position < len(pieces):
        piece = pieces[position]
        width += len(piece)
        at = good if good is not None else poor
        if width - piece.endswith(" ") > WIDTH and at is not None:
            lines.append(_line(pieces[start:at], indent, bool(lines)))
            start, good, poor = at, None, None
            width = indent + CONTINUATION + sum(map(len, pieces[start : position + 1]))
            # breaks between the one taken and here are open again
            depth_there = _depth(pieces[at:position], depth)
            good, poor = _breaks(pieces, at, position, depth_there)
        depth += _open_brackets(piece)
        rank = _rank(piece, depth)
        position += 1
        if rank == 2:
            good = position
        elif rank == 1:
            poor = position
    lines.append(_line(pieces[start:], indent, bool(lines)))
    return lines


def _line(pieces: Sequence[str], indent: int, continued: bool) -> str:
    """One line of a statement."""
    return " " * (indent + CONTINUATION * continued) + "".join(pieces).rstrip()


def _open_brackets(piece: str) -> int:
    """How many brackets a piece leaves open; brackets in texts do not count."""
    if '"' in piece:
        return 0
    return piece.count("(") + piece.count("[") - piece.count(")") - piece.count("]")


def _depth(pieces: Sequence[str], depth: int) -> int:
    """Depth before some pieces that end at a depth."""
    return depth - sum(map(_open_brackets, pieces))


def _breaks(pieces: Sequence[str], start: int, end: int, depth: int) -> tuple[int | None, int | None]:
    """The last good and the last poor break after pieces start..end - 1."""
    good: int | None = None
    poor: int | None = None
    for position in range(start, end):
        depth += _open_brackets(pieces[position])
        rank = _rank(pieces[position], depth)
        if rank == 2:
            good = position + 1
        elif rank == 1:
            poor = position + 1
    return good, poor


def _rank(piece: str, depth: int) -> int:
    """How well a line breaks after a piece at that bracket depth: 2 well, 1 if need be, 0 not."""
    if piece in ("*", "/"):
        return 1
    words = piece.split()
    if not words or piece[0] == '"':
        return 0
    if words[-1] == "=":
        return 1
    if piece.endswith(" "):
        return 2 if depth or words[-1] in CONTINUES or words[-1][-1] in ",:" else 0
    return 1 if piece[-1] in "([" else 0
