"""A diagnostic as text for a terminal: the sentence, the place, the line with carets, the help.

Columns of the carets follow what a terminal shows: tabs are written as spaces, wide characters
take two cells, combining ones none, and control characters are shown as escapes. A long line is
clipped around what is marked.
"""

from __future__ import annotations

import unicodedata

from sysdyn.dsl.text.diagnostics import Diagnostic
from sysdyn.dsl.text.source import Place

_WIDTH = 100
_TAB = 4
_BOLD, _BLUE, _RESET = "\033[1m", "\033[1;34m", "\033[0m"
_COLORS = {"error": "\033[1;31m", "warning": "\033[1;33m", "note": "\033[1;36m"}


def render(diagnostic: Diagnostic, color: bool = False) -> str:
    """The diagnostic in several lines, without a newline at the end; ANSI colours where `color`."""
    paint = _Painter(color)
    severity = diagnostic.severity
    head = paint(f"{severity} {diagnostic.code}", _COLORS[severity])
    lines = [f"{head}{paint(': ' + printable(diagnostic.message), _BOLD)}"]
    places = [] if diagnostic.place is None else [(diagnostic.place, diagnostic.label or "", "^")]
    places.extend((item.place, item.message, "-") for item in diagnostic.related)
    gutter = max((len(str(place.end[0])) for place, _, _ in places), default=1)
    for place, label, mark in places:
        line, column = place.start
        where = f"{printable(place.file)}:{line}:{column}"
        lines.append(f" {paint('-->', _BLUE)} {where}")
        tint = _COLORS[severity] if mark == "^" else _BLUE
        lines.extend(_snippet(place, printable(label), mark, gutter, (color, tint)))
    if diagnostic.help is not None:
        help_ = printable(diagnostic.help)
        lines.append(f"{paint('help', _BOLD)}: {help_}")
    return "\n".join(lines)


def printable(text: str) -> str:
    """The text with tabs as spaces and control characters as escapes: nothing reaches the terminal."""
    return "".join(_cell(sign, 0)[0] if sign != "\t" else " " for sign in text)


class _Painter:
    """Wraps text into ANSI colours, or leaves it."""

    def __init__(self, color: bool) -> None:
        self.color = color

    def __call__(self, text: str, code: str) -> str:
        return f"{code}{text}{_RESET}" if self.color else text


def _snippet(place: Place, label: str, mark: str, gutter: int, tint: tuple[bool, str]) -> list[str]:
    """The source line (of a longer span the first and the last) with marks under the span."""
    paint = _Painter(tint[0])
    (first, start), (last, end) = place.start, place.end
    if last > first and end == 1:
        # a span that takes in a line end belongs to the line before
        last, end = last - 1, len(place.source.line(last - 1)) + 1
    bar = paint("|", _BLUE)
    rows = [f"{' ' * gutter} {bar}"]
    text = place.source.line(first)
    stop = end if last == first else len(text) + 1
    # the line of the span, or its first and last
    parts = [(first, text, start, max(stop, start + 1))]
    if last > first:
        text = place.source.line(last)
        begin = len(text) - len(text.lstrip()) + 1
        parts.append((last, text, min(begin, end), max(end, begin + 1)))
    # marks under what of each line belongs to the span
    for number, (line, text, left, right) in enumerate(parts):
        if number == 1 and last > first + 1:
            rows.append(f"{' ' * gutter} {paint('...', _BLUE)}")
        shown, blanks, width = _clip(text, left - 1, right - 1)
        said = f" {label}" if label and number == len(parts) - 1 else ""
        rows.append(f"{paint(str(line).rjust(gutter), _BLUE)} {bar} {shown}".rstrip())
        rows.append(f"{' ' * gutter} {bar} {' ' * blanks}{paint(mark * width + said, tint[1])}")
    return rows


def _clip(text: str, start: int, end: int) -> tuple[str, int, int]:
    """The visible line, the cells before the span, and the cells of the span (one at least)."""
    low, high = 0, len(text)
    if len(text) > _WIDTH:
        low = max(0, min(start - 20, len(text) - _WIDTH))
        high = min(len(text), low + _WIDTH)
    cells: list[str] = []
    before = width = column = 0
    for index in range(low, high):
        shown, cell = _cell(text[index], column)
        cells.append(shown)
        if index < start:
            before += cell
        elif index < end:
            width += cell
        column += cell
    left, right = "..." if low else "", "..." if high < len(text) else ""
    return left + "".join(cells) + right, before + len(left), max(width, 1)


def _cell(sign: str, column: int) -> tuple[str, int]:
    """What is shown for a character at a column, and how many cells it takes."""
    if sign == "\t":
        width = _TAB - column % _TAB
        return " " * width, width
    kind = unicodedata.category(sign)
    if kind in ("Mn", "Me"):
        return sign, 0
    if kind[0] == "C" or kind in ("Zl", "Zp"):
        code = ord(sign)
        shown = f"\\x{code:02x}" if code < 256 else f"\\u{code:04x}" if code < 65536 else f"\\U{code:08x}"
        return shown, len(shown)
    return sign, 2 if unicodedata.east_asian_width(sign) in "WF" else 1
