"""What the author calls elements of families that were gathered (`alike_elements.py`): names and places in messages."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping

from sysdyn.dsl.text.diagnostics import Diagnostic, Place

Authors = Mapping[str, tuple[tuple[str, Place], ...]]
"""Name and place of each element of a family; a family's name ends in #."""
_NAME = re.compile(
    r"(?<![^\s,()*/+-])([^\s,()*/+-]+#)(?:\.\d+)?(\(0\))?(?:\[(?:(i)(?: ([+-]) (\d+))?|(\d+)(?:\.\.(\d+))?)\])?"
)
"""A family with what follows: (0), [i], [i - 1], [3], [3..7]; looked for where a word begins, once in each."""
_OVER = re.compile(r" for i in (\d+)\.\.(\d+)$")
IndexBox = tuple[str, tuple[tuple[str, Place], ...], int]
"""A text, or the elements of which the one so far behind i stands there."""


def owner(name: str, authors: Authors) -> str | None:
    """The gathered family that a name begins with."""
    head, mark, _ = name.partition("#")
    return head + mark if mark and head + mark in authors else None


def in_author_names(text: str, authors: Authors) -> str:
    """A text about families with the author's names."""
    return _text_of_element(_pieces(text, authors), 0) if "#" in text else text


def split_finding(found: Diagnostic, authors: Authors) -> Iterator[Diagnostic]:
    """A finding about a family as one about each of its elements, at the author's places."""
    head = _NAME.search(found.message) if "#" in found.message else None
    own = None if head is None else authors.get(head[1])
    if own is None:
        yield found
        return
    over = _OVER.search(found.message)
    first, last = (int(over[1]), int(over[2])) if over else (0, len(own) - 1)
    pieces = _pieces(found.message[: over.start()] if over else found.message, authors)
    for k in range(first, last + 1):
        message = _text_of_element(pieces, k)
        yield Diagnostic(found.code, message, own[k][1], found.help, found.related, found.label, found.edit)


def _pieces(text: str, authors: Authors) -> list[IndexBox]:
    """A text cut at the families in it."""
    found: list[IndexBox] = []
    end, matches = 0, list(_NAME.finditer(text))
    near = {m[1]: int(f"{m[4] or ''}{m[5] or 0}") for m in reversed(matches) if m[3]}
    for match in matches:
        family, start, counter, sign, step, number, last = match.groups()
        own = authors.get(family)
        if own is None:
            continue
        found.append((text[end : match.start()], (), 0))
        if number is None:
            found.append(("", own, int(f"{sign or ''}{step or 0}") if counter else near.get(family, 0)))
        else:
            found.append((own[int(number)][0] + (f" .. {own[int(last)][0]}" if last else ""), (), 0))
        found.append((start or "", (), 0))
        end = match.end()
    return [*found, (text[end:], (), 0)]


def _text_of_element(pieces: list[IndexBox], at: int) -> str:
    """The text where i is `at`."""
    return "".join(own[min(at + step, len(own) - 1)][0] if own else text for text, own, step in pieces)
