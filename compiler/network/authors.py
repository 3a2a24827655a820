"""What the author calls elements of families that were gathered (`gathered.py`): names and places in what is said."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from dataclasses import replace

from sysdyn.dsl.text.diagnostics import Diagnostic, Place

Authors = Mapping[str, tuple[tuple[str, Place], ...]]
"""Name and place of each element of a family; a family's name ends in #."""
_PART = r"(?:\.\d+)?"
_ELEMENT = re.compile(rf"([^\s,()*/+-]+#){_PART}(\(0\))?\[(?:(i)(?: ([+-]) (\d+))?|(\d+))\]")
_STRETCH = re.compile(rf"([^\s,()*/+-]+#){_PART}\[(\d+)\.\.(\d+)\]")
_WHOLE = re.compile(rf"([^\s,()*/+-]+#){_PART}(?!\w)")
_OVER = re.compile(r" for i in (\d+)\.\.(\d+)$")


def owner(name: str, authors: Authors) -> str | None:
    """The gathered family that a name begins with."""
    head, mark, _ = name.partition("#")
    return head + mark if mark and head + mark in authors else None


def shown(text: str, authors: Authors, at: int = 0) -> str:
    """A text about families with the author's names; at: the value of its index i."""

    def element(found: re.Match[str]) -> str:
        family, start, index, sign, step, number = found.groups()
        own = authors.get(family)
        if own is None:
            return found[0]
        k = int(number) if index is None else at + (int(step or 0) if sign != "-" else -int(step))
        return own[k][0] + (start or "")

    def stretch(found: re.Match[str]) -> str:
        own = authors.get(found[1])
        return found[0] if own is None else f"{own[int(found[2])][0]} .. {own[int(found[3])][0]}"

    def whole(found: re.Match[str]) -> str:
        own = authors.get(found[1])
        return found[0] if own is None else own[min(at, len(own) - 1)][0]

    if "#" not in text:
        return text
    return _WHOLE.sub(whole, _STRETCH.sub(stretch, _ELEMENT.sub(element, text)))


def told(found: Diagnostic, authors: Authors) -> Iterator[Diagnostic]:
    """A finding about a family as one about each of its elements, at the author's places."""
    head = _WHOLE.search(found.message)
    own = None if head is None else authors.get(head[1])
    if own is None:
        yield found
        return
    over = _OVER.search(found.message)
    first, last = (int(over[1]), int(over[2])) if over else (0, len(own) - 1)
    text = found.message[: over.start()] if over else found.message
    for k in range(first, last + 1):
        yield replace(found, message=shown(text, authors, k), place=own[k][1])
