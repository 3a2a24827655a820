"""E, G, F, H: efforts and flows that other voltages and currents control."""

from __future__ import annotations

from collections.abc import Callable
from itertools import combinations_with_replacement

from sysdyn.cli.spice.devices import CircuitScope, DeviceText, enough
from sysdyn.cli.spice.netlist import Card, UnreadableCard, value
from sysdyn.cli.spice.writing import plain, quantity


def controlled_source(
    kind: str, letter: str, unit: str, *, by_current: bool
) -> Callable[[Card, CircuitScope], DeviceText]:
    """E, G, F, H: an effort or a flow that is a gain or a polynomial of voltages or currents."""

    def element(card: Card, scope: CircuitScope) -> DeviceText:
        words = enough(card, 5)
        name, a, b = scope.name[card.head], scope.node(words[1]), scope.node(words[2])
        times, words = _times(words, scope, kind == "flow")
        size = 1 if by_current else 2
        # POLY(n) reads n quantities, a gain one
        count, rest = (_order(words), words[5:]) if words[3:4] == ("poly",) else (1, words[3:])
        controls, numbers = rest[: size * count], rest[size * count :]
        if "=" in words or any("=" in w for w in words) or len(controls) < size * count or not numbers:
            form = "VSOURCE GAIN" if by_current else "NC+ NC- GAIN"
            raise UnreadableCard(f"'{card.text[:60]}': NAME N+ N- {form} or POLY(n); expressions are not known")
        read = [
            _through(scope, controls[k]) if by_current else _between(scope, *controls[2 * k : 2 * k + 2])
            for k in range(count)
        ]
        gains = [times * value(w, scope.known) for w in numbers]
        # a polynomial
        if words[3:4] == ("poly",):
            text = _polynomial(gains, read, "A" if by_current else "V", "V" if kind == "effort" else "A")
        # something behind the gain
        elif len(gains) > 1:
            raise UnreadableCard(f"'{card.text[:60]}': '{numbers[1]}' behind the gain is not known")
        else:
            text = f"{_factor(gains[0], unit)}*{read[0]}"
        return DeviceText((f"{name}: {kind}({letter} = {text}) {a} -> {b}",))

    return element


def _times(words: tuple[str, ...], scope: CircuitScope, parallel: bool) -> tuple[float, tuple[str, ...]]:
    """M of a current source, and the words without it."""
    if parallel and words[-3:-1] == ("m", "="):
        return value(words[-1], scope.known), words[:-3]
    return 1.0, words


def _order(words: tuple[str, ...]) -> int:
    """How many quantities a polynomial reads."""
    if len(words) < 5:
        raise UnreadableCard("POLY without a number of controlling quantities")
    if not words[4].isdecimal() or not 0 < int(words[4][:6]) <= len(words):
        raise UnreadableCard(f"POLY({words[4]}): a number of controlling quantities is wanted")
    return int(words[4])


def _polynomial(gains: list[float], read: list[str], unit: str, result: str) -> str:
    """SPICE2's order: 1, the quantities, products of two of them, of three ..."""
    if len(gains) == 1:
        raise UnreadableCard(
            "POLY with one number: a gain in SPICE2, a constant in ngspice; '0 GAIN' or no POLY is both's"
        )
    terms, degree, at = [plain(gains[0])], 1, 1
    # all products of one degree before those of the next
    while at < len(gains):
        for factors in combinations_with_replacement(read, degree):
            if at < len(gains) and gains[at] != 0.0:
                terms.append(f"({plain(gains[at])})*{'*'.join(f'({f}/(1 {unit}))' for f in factors)}")
            at += 1
            if at >= len(gains):
                break
        degree += 1
    return f"(1 {result})*({' + '.join(terms)})"


def _through(scope: CircuitScope, source: str) -> str:
    """The current of a source."""
    if source not in scope.name:
        raise UnreadableCard(f"there is no source '{source}' here")
    return f"{scope.name[source]}.f"


def _factor(gain: float, unit: str) -> str:
    return plain(gain) if not unit and gain >= 0.0 else f"({quantity(gain, unit)})"


def _between(scope: CircuitScope, plus: str, minus: str) -> str:
    a, b = scope.node(plus), scope.node(minus)
    if b == "ground":
        return f"{a}.e" if a != "ground" else "(0 V)"
    return f"(-{b}.e)" if a == "ground" else f"({a}.e - {b}.e)"


CONTROLLED: dict[str, Callable[[Card, CircuitScope], DeviceText]] = {
    "e": controlled_source("effort", "e", "", by_current=False),
    "g": controlled_source("flow", "f", "S", by_current=False),
    "f": controlled_source("flow", "f", "", by_current=True),
    "h": controlled_source("effort", "e", "ohm", by_current=True),
}
"""By the first letter of a name."""
