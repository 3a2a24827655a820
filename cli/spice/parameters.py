"""Parameters of circuits: texts whose values depend on each other, in any order."""

from __future__ import annotations

import re
from collections import ChainMap
from collections.abc import Collection, Mapping

from sysdyn.cli.spice.netlist import Card, UnreadableCard, value
from sysdyn.values import dataclass

_NAME = re.compile(r"(?<![\w.])[a-z_]\w*")


@dataclass(frozen=True, slots=True)
class ParameterText:
    """The text of a value and the card that gives it."""

    text: str
    card: Card


def read(text: str) -> list[str]:
    """Names that stand in a text."""
    return _NAME.findall(text)


def evaluate(
    said: Mapping[str, ParameterText], outer: Mapping[str, float], given: Mapping[str, float] | None = None
) -> dict[str, float]:
    """Values by name; outer: what is known around; given: values that replace texts.  Unreadable, with its card.

    A name in its own text is the one around, as in `r={r}`.
    """
    found = dict(given or {})
    around = ChainMap(found, dict(outer))
    for first in said:
        way, on = [first], {first}
        # depth first: a parameter after those that its text needs
        while way:
            name = way[-1]
            needed = () if name in found else _missing(said, found, name)
            # not known yet: itself on the way there is a circle
            if needed:
                if needed[0] in on:
                    raise _unreadable(said[name].card, f"the parameter '{needed[0]}' depends on itself")
                way.append(needed[0])
                on.add(needed[0])
                continue
            if name not in found:
                found[name] = _value(said[name], around)
            on.discard(way.pop())
    return found


def _missing(said: Mapping[str, ParameterText], found: Collection[str], name: str) -> list[str]:
    """What a parameter reads of its own circuit that has no value yet."""
    return [n for n in read(said[name].text) if n in said and n not in found and n != name]


def _value(parameter: ParameterText, known: Mapping[str, float]) -> float:
    try:
        return value(parameter.text, known)
    except UnreadableCard as error:
        raise _unreadable(parameter.card, str(error)) from None


def _unreadable(card: Card, reason: str) -> UnreadableCard:
    error = UnreadableCard(reason)
    error.card = card
    return error
