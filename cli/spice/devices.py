"""One card -> one element of the language: what all devices share, and the plain ones."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping
from dataclasses import field

from sysdyn.cli.spice.circuit import CELSIUS
from sysdyn.cli.spice.netlist import Card, UnreadableCard, number, value
from sysdyn.cli.spice.sources import SHAPES, Asked, Shape, direct
from sysdyn.cli.spice.temperature import Heat
from sysdyn.cli.spice.writing import plain, quantity
from sysdyn.values import dataclass

SHORT = 1e-3  # ohm: SPICE's resistor of zero


@dataclass(frozen=True, slots=True)
class DeviceText:
    """Lines of the body; uses: components of std.electrical; local: components written beside; initial: lines of init;
    left_out: what the card says that the element does not have.
    """

    lines: tuple[str, ...]
    uses: tuple[str, ...] = ()
    local: tuple[str, ...] = ()
    initial: tuple[str, ...] = ()
    left_out: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class ModelValues:
    """A model: its kind, and its numbers by name."""

    kind: str
    values: Mapping[str, float]


@dataclass(slots=True)
class CircuitScope:
    """What cards of one circuit know: nodes and elements in the language's names, parameters, models.

    initial: V by node, of `.ic`; driven: capacitors whose voltage sources alone decide.
    """

    node: Callable[[str], str]
    name: Mapping[str, str]
    known: Mapping[str, float]
    model: Callable[[str], ModelValues | None]
    asked: Asked
    uic: bool
    heat: Heat
    size: tuple[float, float] = (1e-4, 1e-4)
    """Width and length of a transistor that says none, m."""
    written: Mapping[str, str] = field(default_factory=dict)
    """Parameters that stay names: by name, their unit."""
    initial: Mapping[str, float] = field(default_factory=dict)
    driven: Collection[str] = ()


def enough(card: Card, least: int) -> tuple[str, ...]:
    """The words of a card without brackets, so many at least."""
    words = tuple(w for w in card.words if w not in ("(", ")", ","))
    if len(words) < least:
        raise UnreadableCard(f"'{card.text[:60]}' ends too early")
    return words


def number_of(scope: CircuitScope, text: str, unit: str) -> str:
    """A quantity; the name of a parameter that has this unit stays one."""
    name = text.strip("{}'").strip()
    if scope.written.get(name) == unit:
        return scope.name.get(f"param {name}", name)
    return quantity(value(text, scope.known), unit)


PAIRS = ("ic", "tc")
"""Words that two values may follow."""


@dataclass(slots=True)
class Details:
    """What stands behind a device: how many are side by side (M and AREA), NAME=VALUE, and the rest."""

    times: float
    given: dict[str, str]
    rest: tuple[str, ...]

    def unread_words(self, *read: str) -> tuple[str, ...]:
        """What a device does not read."""
        return (*self.rest, *(n for n in self.given if n not in (*read, "area", "m", "ic", "temp", "dtemp")))

    def number(self, name: str, scope: CircuitScope, default: float = 0.0) -> float:
        """A number of the card."""
        return value(self.given[name], scope.known) if name in self.given else default

    def heat(self, scope: CircuitScope, nominal: float | None = None) -> Heat:
        """Temperatures of the device; nominal: TNOM of its model, in Celsius."""
        now = scope.heat.now + self.number("dtemp", scope)
        now = self.number("temp", scope) + CELSIUS if "temp" in self.given else now
        return Heat(now, scope.heat.nominal if nominal is None else nominal + CELSIUS)


def details(words: tuple[str, ...], scope: CircuitScope, *, areas: bool) -> Details:
    """Read what stands behind a device; areas: a number alone is AREA."""
    left_ = [w for w in words if w != "off"]
    times, given, rest = 1.0, dict[str, str](), []
    while left_:
        # NAME = VALUE, some with two values
        if left_[1:2] == ["="] and len(left_) > 2:
            name, _, text = left_[:3]
            given[name] = text
            left_ = left_[3:]
            if name in ("area", "m"):
                times *= value(text, scope.known)
            elif name in PAIRS and left_ and left_[1:2] != ["="] and _is_value(left_[0]):
                given[f"{name} 2"] = left_[0]
                left_ = left_[1:]
        # a number alone is the area
        elif areas and _is_value(left_[0]):
            times *= value(left_[0], scope.known)
            left_ = left_[1:]
        # words that the device may know
        else:
            rest.append(left_[0])
            left_ = left_[1:]
    if not times > 0.0:
        raise UnreadableCard(f"{times:g} of a device are none")
    return Details(times, given, tuple(rest))


def _is_value(word: str) -> bool:
    return number(word) is not None or word[0] in "{'"


def _passive(
    kind: str, letter: str, unit: str, state: str, state_unit: str
) -> Callable[[Card, CircuitScope], DeviceText]:
    """The reader of R, C and L cards: value with temperature and number, and the initial value where it is said."""

    def element(card: Card, scope: CircuitScope) -> DeviceText:
        words = enough(card, 4)
        named = words[3:5] == (letter.lower(), "=")
        words = enough(card, 6) if named else words
        amount, rest = (words[5], words[6:]) if named else (words[3], words[4:])
        name, a, b = scope.name[card.head], scope.node(words[1]), scope.node(words[2])
        said = details(rest, scope, areas=False)
        factor = said.heat(scope).resistance(
            said.number("tc", scope) + said.number("tc1", scope),
            said.number("tc 2", scope) + said.number("tc2", scope),
        )
        factor *= said.times if kind == "capacitor" else 1.0 / said.times
        line = f"{name}: {kind}({letter} = {_amount(scope, amount, unit, factor)}) {a} -> {b}"
        left = tuple(w for w in said.unread_words("tc", "tc 2", "tc1", "tc2", "ic 2", "ac", "noisy") if w != "ac")
        initial: tuple[str, ...] = ()
        if state and card.head not in scope.driven:
            initial = (f"init {name}.{_initial(state, state_unit, words, said, scope)}",)
        return DeviceText((line,), (kind,), (), initial, left)

    return element


def _amount(scope: CircuitScope, text: str, unit: str, factor: float) -> str:
    """The value of an element: a parameter's name with a factor, or a quantity."""
    if not factor > 0.0:
        raise UnreadableCard(f"{plain(factor)} of '{text}' are none")
    if scope.written and scope.written.get(text.strip("{}'").strip()) == unit:
        name = number_of(scope, text, unit)
        return name if factor == 1.0 else f"{plain(factor)}*{name}"
    amount = value(text, scope.known) * factor
    return quantity(SHORT if unit == "ohm" and amount == 0.0 else amount, unit)


def _initial(state: str, unit: str, words: tuple[str, ...], said: Details, scope: CircuitScope) -> str:
    """What a capacitor or a coil holds at the start: IC or `.ic` with UIC, else what it holds at rest."""
    if not scope.uic:
        return "f = 0 A" if state == "e" else "e = 0 V"
    between = scope.initial.get(words[1], 0.0) - scope.initial.get(words[2], 0.0) if state == "e" else 0.0
    return f"{state} = {quantity(said.number('ic', scope, between), unit)}"


def _source(unit: str) -> Callable[[Card, CircuitScope], DeviceText]:
    """The reader of V and I cards."""
    kind, letter = ("voltage", "v") if unit == "V" else ("current", "i")

    def element(card: Card, scope: CircuitScope) -> DeviceText:
        words = enough(card, 3)
        name, a, b = scope.name[card.head], scope.node(words[1]), scope.node(words[2])
        shape = _shape(_words_after(card, 3), scope, unit)
        if shape.component:
            line = f"{name}: {shape.component}({shape.arguments}) {a} -> {b}"
            return DeviceText((line,), () if shape.local else (shape.component,), (shape.component,) * shape.local)
        return DeviceText((f"{name}: {kind}({letter} = {shape.expression}) {a} -> {b}",), (kind,))

    return element


def _words_after(card: Card, count: int) -> list[str]:
    """What stands behind so many words and the brackets among them."""
    words = list(card.words)
    while count and words:
        count -= words.pop(0) not in ("(", ")", ",")
    return words[1:] if words[:1] == [")"] else words


SMALL = {"ac": 2, "distof1": 2, "distof2": 2}
"""What a source is in other analyses: a word and so many numbers at most."""


def _shape(words: list[str], scope: CircuitScope, unit: str) -> Shape:
    """The value over time: a shape where there is one, else DC; both, and what other analyses read, in any order."""
    asked = (unit, *scope.asked[1:])
    found, constant = None, None
    words = [w for w in words if w not in ("=", ",")]
    while words:
        word, words = words[0], words[1:]
        # PULSE, SIN, PWL, ...
        if word in SHAPES and found is None:
            texts, words = _arguments(words)
            found = SHAPES[word]([value(w, scope.known) for w in texts], asked)
        # AC and others: of analyses that are not made
        elif word in SMALL:
            words = words[sum(_is_value(w) for w in words[: SMALL[word]]) :]
        # the constant value
        elif word != "dc" and constant is None and (_is_value(word) or word in scope.known):
            constant = value(word, scope.known)
        elif word != "dc":
            raise UnreadableCard(f"'{word}': DC, AC, {', '.join(s.upper() for s in SHAPES)} are known")
    return found or direct(constant or 0.0, unit)


def _arguments(words: list[str]) -> tuple[list[str], list[str]]:
    """Values of a shape, in brackets or as long as numbers follow; the words behind them."""
    if words[:1] == ["("]:
        depth, end = 0, 0
        while end < len(words):
            depth += (words[end] == "(") - (words[end] == ")")
            end += 1
            if not depth:
                break
        return [w for w in words[:end] if w not in "()"], words[end:]
    end = next((k for k, w in enumerate(words) if w in SMALL or w == "dc"), len(words))
    return words[:end], words[end:]


PLAIN: dict[str, Callable[[Card, CircuitScope], DeviceText]] = {
    "r": _passive("resistor", "R", "ohm", "", ""),
    "c": _passive("capacitor", "C", "F", "e", "V"),
    "l": _passive("inductor", "L", "H", "f", "A"),
    "v": _source("V"),
    "i": _source("A"),
}
"""By the first letter of a name."""
