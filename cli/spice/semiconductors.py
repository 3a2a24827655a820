"""D, Q, M: diodes and transistors at their temperature."""

from __future__ import annotations

from collections.abc import Callable, Mapping

from sysdyn.cli.spice.devices import CircuitScope, Details, DeviceText, ModelValues, details, enough
from sysdyn.cli.spice.netlist import Card, UnreadableCard
from sysdyn.cli.spice.writing import plain, quantity

OXIDE = 3.9 * 8.854214871e-12  # F/m, permittivity
MOBILITY = 600.0  # cm^2/V/s, UO where nothing is said


def _model(scope: CircuitScope, name: str, kinds: tuple[str, ...]) -> ModelValues:
    """A model of these kinds, of level 1: other levels are other devices."""
    found = scope.model(name)
    if found is None:
        raise UnreadableCard(f"there is no .model {name}")
    if found.kind not in kinds:
        raise UnreadableCard(f".model {name} is {found.kind}, wanted is {' or '.join(kinds)}")
    if found.values.get("level", 1.0) != 1.0:
        raise UnreadableCard(f".model {name}: level={found.values['level']:g} is another device; level 1 is known")
    return found


def _beyond(model: ModelValues, read: tuple[str, ...]) -> tuple[str, ...]:
    """What a model says beside what the element reads; zero is SPICE's word for none."""
    return tuple(k for k, v in model.values.items() if k not in (*read, "level") and v != 0.0)


def _diode(card: Card, scope: CircuitScope) -> DeviceText:
    """A diode with its series resistance as an element and a node of its own."""
    words = enough(card, 4)
    name, a, b = scope.name[card.head], scope.node(words[1]), scope.node(words[2])
    model = _model(scope, words[3], ("d",))
    v, said = model.values, details(words[4:], scope, areas=True)
    emission, heat = v.get("n", 1.0), said.heat(scope, v.get("tnom"))
    if not emission > 0.0:
        raise UnreadableCard(f".model {words[3]}: n = {emission:g} is no emission coefficient")
    # the saturation current of this area at this temperature
    current = v.get("is", 1e-14) * said.times * heat.saturation(v.get("eg", 1.11), v.get("xti", 3.0), emission)
    given = f"Is = {quantity(current, 'A')}, vT = {quantity(emission * heat.volt, 'V')}"
    read = ("is", "n", "rs", "eg", "xti", "tnom", "trs1", "trs2", "trs")
    left = (*_beyond(model, read), *said.unread_words())
    ohms = v.get("rs", 0.0) / said.times * heat.resistance(v.get("trs1", v.get("trs", 0.0)), v.get("trs2", 0.0))
    # the junction lies behind a resistor
    if ohms > 0.0:
        inner = f"{name}_in"
        lines = (
            f"node {inner}: electrical",
            f"{name}: diode({given}) {inner} -> {b}",
            f"{name}_series: resistor(R = {quantity(ohms, 'ohm')}) {a} -> {inner}",
        )
        return DeviceText(lines, ("diode", "resistor"), (), (), left)
    return DeviceText((f"{name}: diode({given}) {a} -> {b}",), ("diode",), (), (), left)


def _bipolar(card: Card, scope: CircuitScope) -> DeviceText:
    """Ebers and Moll from the transport form: aF Ies = aR Ics = IS, aF = BF/(1 + BF)."""
    words = enough(card, 5)
    # the substrate node is optional
    at = next((k for k in (4, 5) if k < len(words) and scope.model(words[k]) is not None), 4)
    model = _model(scope, words[at], ("npn", "pnp"))
    v, said = model.values, details(words[at + 1 :], scope, areas=True)
    heat = said.heat(scope, v.get("tnom"))
    saturation = v.get("is", 1e-16) * said.times * heat.saturation(v.get("eg", 1.11), v.get("xti", 3.0))
    gain = heat.ratio ** v.get("xtb", 0.0)
    forward, backward = v.get("bf", 100.0) * gain, v.get("br", 1.0) * gain
    if not (forward > 0.0 and backward > 0.0):
        raise UnreadableCard(f".model {words[at]}: bf and br above 0 are wanted")
    # gains of the common base circuit
    ahead, behind = forward / (1.0 + forward), backward / (1.0 + backward)
    volt = quantity(heat.volt * v.get("nf", 1.0), "V")
    given = (
        f"Ies = {quantity(saturation / ahead, 'A')}, Ics = {quantity(saturation / behind, 'A')}, aF = {plain(ahead)}, "
        f"aR = {plain(behind)}, vT = {volt}"
    )
    c, b, e = (scope.node(w) for w in words[1:4])
    name = scope.name[card.head]
    left = (*_beyond(model, ("is", "bf", "br", "nf", "nr", "eg", "xti", "xtb", "tnom")), *said.unread_words("ic 2"))
    # one emission coefficient for both junctions
    if v.get("nr", 1.0) != v.get("nf", 1.0):
        left = ("nr", *left)
    if b in (c, e) and c != e:  # one junction is short: the other is a diode
        current, other = (saturation / ahead, e) if b == c else (saturation / behind, c)
        ends = f"{b} -> {other}" if model.kind == "npn" else f"{other} -> {b}"
        law = f"Is = {quantity(current, 'A')}, vT = {volt}"
        return DeviceText((f"{name}: diode({law}) {ends}",), ("diode",), (), (), left)
    # the library has npn; pnp is written into the model
    uses, local = (("npn",), ()) if model.kind == "npn" else ((), ("pnp",))
    return DeviceText((f"{name}: {model.kind}({given}) c = {c}, b = {b}, e = {e}",), uses, local, (), left)


JUNCTIONS = {"ad", "as", "pd", "ps"}
"""Sizes of a transistor's diffusions, which the parameters of CAPACITIES read."""
CAPACITIES = {"cj", "cjsw", "js", "jssw"}


def _mos(card: Card, scope: CircuitScope) -> DeviceText:
    """Shichman and Hodges: beta = KP W/L, KP from UO and TOX where it is not said."""
    words = enough(card, 6)
    model = _model(scope, words[5], ("nmos", "pmos"))
    v, said = model.values, details(words[6:], scope, areas=False)
    heat, sign = said.heat(scope, v.get("tnom")), 1.0 if model.kind == "nmos" else -1.0
    width, length = said.number("w", scope, scope.size[0]), said.number("l", scope, scope.size[1])
    length -= 2.0 * v.get("ld", 0.0)
    if not (width > 0.0 and length > 0.0):
        raise UnreadableCard(
            f"'{card.head}': {plain(width)} m of width and {plain(length)} m of length are no transistor"
        )
    beta = _transconductance(v) * width / length * said.times * heat.ratio**-1.5
    volts = heat.threshold(v.get("vto", v.get("vt0", 0.0)), v.get("phi", 0.6), sign)
    given = f"beta = {plain(beta)} A/V^2, vto = {quantity(volts, 'V')}, lambda = {plain(v.get('lambda', 0.0))} V^-1"
    d, g, s = (scope.node(w) for w in words[1:4])
    line = f"{scope.name[card.head]}: {model.kind}({given}) d = {d}, g = {g}, s = {s}"
    left = (*_beyond(model, ("kp", "vto", "vt0", "lambda", "tnom", "phi", "uo", "u0", "ld")), *_sizes(said, v))
    return DeviceText((line,), (), (model.kind,), (), left)


def _transconductance(v: Mapping[str, float]) -> float:
    """KP, A/V^2."""
    oxide = v.get("tox", 0.0)
    if "kp" in v or not oxide > 0.0:
        return v.get("kp", 2e-5)
    return v.get("uo", v.get("u0", MOBILITY)) * 1e-4 * OXIDE / oxide


def _sizes(said: Details, v: Mapping[str, float]) -> tuple[str, ...]:
    """What a card says beside width and length, where its model reads it."""
    unread = JUNCTIONS if not CAPACITIES & v.keys() else set()
    unread = unread if "rsh" in v else unread | {"nrd", "nrs"}
    return tuple(w for w in said.unread_words("w", "l", "ic 2") if w not in unread)


SEMICONDUCTORS: dict[str, Callable[[Card, CircuitScope], DeviceText]] = {"d": _diode, "q": _bipolar, "m": _mos}
"""By the first letter of a name."""
