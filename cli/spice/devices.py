"""One card -> one element of the language."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import field

from sysdyn.cli.spice.circuit import Model, pairs
from sysdyn.cli.spice.netlist import Card, Unreadable, number, value
from sysdyn.cli.spice.sources import SHAPES, Asked, Shape, direct
from sysdyn.cli.spice.writing import plain, quantity
from sysdyn.values import dataclass

THERMAL = 0.025864186  # V: k T/q at 27 Celsius, CODATA constants
LOCAL = {
    "nmos": """## Field-effect transistor of n channel, level 1 (Shichman and Hodges), without capacitances.
component nmos {
  ## transconductance times width over length, threshold, modulation of the channel's length
  param beta: A/V^2
  param vto: V
  param lambda: V^-1
  port d, g, s: electrical
  let forward = max(g.e - s.e - vto, 0 V)
  let backward = max(g.e - d.e - vto, 0 V)
  channel: dissipator(f = 1/2*beta*(forward^2 - backward^2)*(1 + lambda*abs(d.e - s.e))) d -> s
}
""",
    "pmos": """## Field-effect transistor of p channel, level 1 (Shichman and Hodges), without capacitances.
component pmos {
  ## transconductance times width over length, threshold (negative), modulation of the channel's length
  param beta: A/V^2
  param vto: V
  param lambda: V^-1
  port d, g, s: electrical
  let forward = max(s.e - g.e + vto, 0 V)
  let backward = max(d.e - g.e + vto, 0 V)
  channel: dissipator(f = 1/2*beta*(forward^2 - backward^2)*(1 + lambda*abs(d.e - s.e))) s -> d
}
""",
    "pnp": """## Bipolar transistor of the other polarity after Ebers and Moll, without junction capacitances.
component pnp {
  param Ies = 1e-14 A
  param Ics = 2e-14 A
  param aF = 0.99
  param aR = 0.495
  param vT = 25.85 mV
  port c, b, e: electrical
  let iF = Ies*(exp((e.e - b.e)/vT) - 1)
  let iR = Ics*(exp((c.e - b.e)/vT) - 1)
  seb: dissipator(f = iF - aR*iR) e -> b
  scb: dissipator(f = iR - aF*iF) c -> b
}
""",
}
"""Components that std.electrical lacks."""


@dataclass(frozen=True, slots=True)
class Element:
    """Lines of the body; uses: components of std.electrical; local: components written beside; initial: lines of init;
    left_out: what the card says that the element does not have.
    """

    lines: tuple[str, ...]
    uses: tuple[str, ...] = ()
    local: tuple[str, ...] = ()
    initial: tuple[str, ...] = ()
    left_out: tuple[str, ...] = ()


@dataclass(slots=True)
class Scope:
    """What cards of one circuit know: nodes and elements in the language's names, parameters, models, coupled coils."""

    node: Callable[[str], str]
    name: Mapping[str, str]
    known: Mapping[str, float]
    models: Mapping[str, Model]
    asked: Asked
    uic: bool
    written: Mapping[str, str] = field(default_factory=dict)
    """Parameters that stay names: by name, their unit."""


def enough(card: Card, least: int) -> tuple[str, ...]:
    """The words of a card, so many at least."""
    if len(card.words) < least:
        raise Unreadable(f"'{card.text[:60]}' ends too early")
    return card.words


def number_of(scope: Scope, text: str, unit: str) -> str:
    """A quantity; the name of a parameter that has this unit stays one."""
    name = text.strip("{}'").strip()
    if scope.written.get(name) == unit:
        return scope.name.get(f"param {name}", name)
    return quantity(value(text, scope.known), unit)


def _more(words: tuple[str, ...], scope: Scope, *, areas: bool) -> tuple[float, dict[str, str], tuple[str, ...]]:
    """How many of a device stand side by side (M; areas: a number alone, AREA), its IC, and what else its card says."""
    plain_ = [w for w in words if w not in ("(", ")", ",", "off")]
    times, given, left = 1.0, dict[str, str](), []
    while plain_:
        if plain_[1:2] == ["="] and len(plain_) > 2:
            name, _, text = plain_[:3]
            given[name] = text
            plain_ = plain_[3:]
            if name in ("area", "m"):
                times *= value(text, scope.known)
            elif name == "ic":  # of a transistor two
                plain_ = plain_[1:] if plain_ and plain_[1:2] != ["="] else plain_
            else:
                left.append(name)
        elif areas and (number(plain_[0]) is not None or plain_[0][0] in "{'"):
            times *= value(plain_[0], scope.known)
            plain_ = plain_[1:]
        else:
            left.append(plain_[0])
            plain_ = plain_[1:]
    if not times > 0.0:
        raise Unreadable(f"{times:g} of a device are none")
    return times, given, tuple(left)


def _passive(kind: str, letter: str, unit: str, state: str, state_unit: str) -> Callable[[Card, Scope], Element]:
    def element(card: Card, scope: Scope) -> Element:
        words = enough(card, 4)
        name, a, b = scope.name[card.head], scope.node(words[1]), scope.node(words[2])
        times, given, left = _more(words[4:], scope, areas=False)
        amount = number_of(scope, words[3], unit)
        if times != 1.0:
            amount = f"{plain(times)}*({amount})" if kind == "capacitor" else f"({amount})/{plain(times)}"
        line = f"{name}: {kind}({letter} = {amount}) {a} -> {b}"
        initial: tuple[str, ...] = ()
        if state and scope.uic:
            initial = (f"init {name}.{state} = {quantity(value(given.get('ic', '0'), scope.known), state_unit)}",)
        elif state:
            still = "f" if state == "e" else "e"
            initial = (f"init {name}.{still} = 0 {'A' if still == 'f' else 'V'}",)
        return Element((line,), (kind,), (), initial, left)

    return element


def _source(unit: str) -> Callable[[Card, Scope], Element]:
    kind, letter = ("voltage", "v") if unit == "V" else ("current", "i")

    def element(card: Card, scope: Scope) -> Element:
        words = enough(card, 3)
        name, a, b = scope.name[card.head], scope.node(words[1]), scope.node(words[2])
        shape = _shape(list(words[3:]), scope, unit)
        if shape.component:
            return Element((f"{name}: {shape.component}({shape.arguments}) {a} -> {b}",), (shape.component,))
        return Element((f"{name}: {kind}({letter} = {shape.expression}) {a} -> {b}",), (kind,))

    return element


def _shape(words: list[str], scope: Scope, unit: str) -> Shape:
    """The value over time: a shape where there is one, else DC."""
    asked = (unit, *scope.asked[1:])
    for k, word in enumerate(words):
        if word in SHAPES:
            values = [value(w, scope.known) for w in words[k + 1 :] if w not in ("(", ")", ",")]
            return SHAPES[word](values, asked)
    if "ac" in words:
        words = words[: words.index("ac")]
    words = [w for w in words if w not in ("dc", "=")]
    if len(words) > 1:
        raise Unreadable(f"'{words[0]} {words[1]}': DC, {', '.join(s.upper() for s in SHAPES)} are known")
    return direct(value(words[0], scope.known) if words else 0.0, unit)


def _model(card: Card, scope: Scope, name: str, kinds: tuple[str, ...]) -> Model:
    found = scope.models.get(name)
    if found is None:
        raise Unreadable(f"there is no .model {name}")
    if found.kind not in kinds:
        raise Unreadable(f".model {name} is {found.kind}, wanted is {' or '.join(kinds)}")
    return found


def _beyond(model: Model, said: tuple[str, ...], harmless: tuple[str, ...] = ()) -> tuple[str, ...]:
    """What a model says beside what the element has."""
    return tuple(k for k, v in model.values.items() if k not in said and k not in harmless and v != 0.0)


def _diode(card: Card, scope: Scope) -> Element:
    words = enough(card, 4)
    name, a, b = scope.name[card.head], scope.node(words[1]), scope.node(words[2])
    model = _model(card, scope, words[3], ("d",))
    area, _, more = _more(words[4:], scope, areas=True)
    current, voltage = model.values.get("is", 1e-14) * area, model.values.get("n", 1.0) * THERMAL
    given = f"Is = {quantity(current, 'A')}, vT = {quantity(voltage, 'V')}"
    left = (*_beyond(model, ("is", "n", "rs"), ("level", "eg", "xti", "tnom")), *more)
    ohms = model.values.get("rs", 0.0) / area
    if ohms > 0.0:
        inner = f"{name}_in"
        lines = (
            f"node {inner}: electrical",
            f"{name}: diode({given}) {inner} -> {b}",
            f"{name}_series: resistor(R = {quantity(ohms, 'ohm')}) {a} -> {inner}",
        )
        return Element(lines, ("diode", "resistor"), (), (), left)
    return Element((f"{name}: diode({given}) {a} -> {b}",), ("diode",), (), (), left)


def _bipolar(card: Card, scope: Scope) -> Element:
    """Ebers and Moll from the transport form: aF Ies = aR Ics = IS, aF = BF/(1 + BF)."""
    words = enough(card, 5)
    at = next((k for k in (4, 5) if k < len(words) and words[k] in scope.models), 4)
    model = _model(card, scope, words[at], ("npn", "pnp"))
    v = model.values
    area, _, more = _more(words[at + 1 :], scope, areas=True)
    saturation, forward, backward = v.get("is", 1e-16) * area, v.get("bf", 100.0), v.get("br", 1.0)
    ahead, behind = forward / (1.0 + forward), backward / (1.0 + backward)
    given = (
        f"Ies = {quantity(saturation / ahead, 'A')}, Ics = {quantity(saturation / behind, 'A')}, aF = {plain(ahead)}, "
        f"aR = {plain(behind)}, vT = {quantity(THERMAL * v.get('nf', 1.0), 'V')}"
    )
    c, b, e = (scope.node(w) for w in words[1:4])
    name = scope.name[card.head]
    line = f"{name}: {model.kind}({given}) c = {c}, b = {b}, e = {e}"
    same = ("nr",) if v.get("nr") == v.get("nf", 1.0) else ()
    left = (*_beyond(model, ("is", "bf", "br", "nf"), ("level", "eg", "xti", "xtb", "tnom", *same)), *more)
    if b in (c, e) and c != e:  # one junction is short: the other is a diode
        current, other = (saturation / ahead, e) if b == c else (saturation / behind, c)
        ends = f"{b} -> {other}" if model.kind == "npn" else f"{other} -> {b}"
        law = f"Is = {quantity(current, 'A')}, vT = {quantity(THERMAL * v.get('nf', 1.0), 'V')}"
        return Element((f"{name}: diode({law}) {ends}",), ("diode",), (), (), left)
    uses, local = (("npn",), ()) if model.kind == "npn" else ((), ("pnp",))
    return Element((line,), uses, local, (), left)


def _mos(card: Card, scope: Scope) -> Element:
    words = enough(card, 6)
    model = _model(card, scope, words[5], ("nmos", "pmos"))
    v = model.values
    if v.get("level", 1.0) != 1.0:
        raise Unreadable(f".model {words[5]}: level {v['level']:g}; level 1 is known")
    sizes = {k: value(text, scope.known) for k, text in pairs(words[6:])}
    ratio = sizes.get("w", 1e-4) / sizes.get("l", 1e-4) * sizes.get("m", 1.0)
    given = (
        f"beta = {plain(v.get('kp', 2e-5) * ratio)} A/V^2, vto = {quantity(v.get('vto', v.get('vt0', 0.0)), 'V')}, "
        f"lambda = {plain(v.get('lambda', 0.0))} V^-1"
    )
    d, g, s = (scope.node(w) for w in words[1:4])
    line = f"{scope.name[card.head]}: {model.kind}({given}) d = {d}, g = {g}, s = {s}"
    left = _beyond(model, ("kp", "vto", "vt0", "lambda", "level"), ("tnom", "phi"))
    return Element((line,), (), (model.kind,), (), left)


def _controlled(kind: str, letter: str, unit: str, *, by_current: bool) -> Callable[[Card, Scope], Element]:
    def element(card: Card, scope: Scope) -> Element:
        words = tuple(w for w in enough(card, 5) if w not in ("(", ")", ","))
        name, a, b = scope.name[card.head], scope.node(words[1]), scope.node(words[2])
        if by_current:
            if words[3] not in scope.name:
                raise Unreadable(f"there is no source '{words[3]}' here")
            read, gain = f"{scope.name[words[3]]}.f", value(words[4], scope.known)
        else:
            if len(words) < 6 or "=" in words:
                raise Unreadable(f"'{card.text[:60]}': NAME N+ N- NC+ NC- GAIN; expressions are not known")
            read, gain = _between(scope, words[3], words[4]), value(words[5], scope.known)
        text = f"{_factor(gain, unit)}*{read}"
        return Element((f"{name}: {kind}({letter} = {text}) {a} -> {b}",))

    return element


def _factor(gain: float, unit: str) -> str:
    return plain(gain) if not unit and gain >= 0.0 else f"({quantity(gain, unit)})"


def _between(scope: Scope, plus: str, minus: str) -> str:
    a, b = scope.node(plus), scope.node(minus)
    if b == "ground":
        return f"{a}.e" if a != "ground" else "(0 V)"
    return f"(-{b}.e)" if a == "ground" else f"({a}.e - {b}.e)"


DEVICES: dict[str, Callable[[Card, Scope], Element]] = {
    "r": _passive("resistor", "R", "ohm", "", ""),
    "c": _passive("capacitor", "C", "F", "e", "V"),
    "l": _passive("inductor", "L", "H", "f", "A"),
    "v": _source("V"),
    "i": _source("A"),
    "d": _diode,
    "q": _bipolar,
    "m": _mos,
    "e": _controlled("effort", "e", "", by_current=False),
    "g": _controlled("flow", "f", "S", by_current=False),
    "f": _controlled("flow", "f", "", by_current=True),
    "h": _controlled("effort", "e", "ohm", by_current=True),
}
"""By the first letter of a name; X and K are the circuit's."""
