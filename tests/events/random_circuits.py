"""Random circuits of the library (diodes, transistors, amplifiers, transformers, tables, machines that heat up) and
their motion by Radau IIA of order 5 on modified nodal equations, E x' + A x + f(x) = b(t), from rest.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
from scipy.interpolate import PchipInterpolator

SPAN, ROWS, STEPS = 20e-3, 20, 4000
TICK = SPAN / STEPS
"""Sources bend and jump at multiples of it (s)."""
AMBIENT, ALPHA, R_TH = 293.15, 0.02, 40.0
VT, EMITTER, COLLECTOR, FORWARD, REVERSE = 25.85e-3, 1e-14, 2e-14, 0.99, 0.495
ROOT = np.sqrt(6.0)
STAGES = np.array(
    [
        [(88 - 7 * ROOT) / 360, (296 - 169 * ROOT) / 1800, (-2 + 3 * ROOT) / 225],
        [(296 + 169 * ROOT) / 1800, (88 + 7 * ROOT) / 360, (-2 - 3 * ROOT) / 225],
        [(16 - ROOT) / 36, (16 + ROOT) / 36, 1 / 9],
    ]
)
NODES = np.array([(4 - ROOT) / 10, (4 + ROOT) / 10, 1.0])
Law = Callable[[np.ndarray], tuple[np.ndarray, np.ndarray]]


@dataclass
class Circuit:
    """lines of the text; places of the reference's unknowns by name; E, A by (row, column, value); laws: places, and
    what their values add to those rows, with slopes; sources: row, value of time; traced: name, value of x
    [.., unknowns].
    """

    random: np.random.Generator
    lines: list[str] = field(default_factory=list)
    tables: list[str] = field(default_factory=list)
    nodes: list[str] = field(default_factory=list)
    shafts: list[str] = field(default_factory=list)
    places: dict[str, int] = field(default_factory=dict)
    moving: list[tuple[int, int, float]] = field(default_factory=list)
    linear: list[tuple[int, int, float]] = field(default_factory=list)
    laws: list[tuple[list[int], Law]] = field(default_factory=list)
    sources: list[tuple[int, Callable[[float], float]]] = field(default_factory=list)
    traced: dict[str, Callable[[np.ndarray], np.ndarray]] = field(default_factory=dict)

    def named(self, letter: str) -> str:
        return f"{letter}{len(self.lines)}"

    def node(self) -> str:
        self.nodes.append(f"n{len(self.nodes)}")
        self.at(self.nodes[-1])
        return self.nodes[-1]

    def at(self, name: str) -> int:
        """The place of an unknown; -1 of the ground."""
        return -1 if name == "ground" else self.places.setdefault(name, len(self.places))

    def value(self, low: float, high: float) -> float:
        """Between powers of ten."""
        return float(f"{10 ** self.random.uniform(low, high):.3g}")

    def two(self) -> tuple[str, str]:
        a, b = self.random.choice([*self.nodes[:OPEN], "ground"], 2, replace=False)
        return str(a), str(b)

    def branch(self, name: str, a: str, b: str) -> int:
        """The place of a current from a to b; its row begins with e(b) - e(a)."""
        k = self.at(name)
        for node, sign in ((a, 1.0), (b, -1.0)):
            self.linear += [(self.at(node), k, sign), (k, self.at(node), -sign)]
        return k

    def across(self, where: list[tuple[int, int, float]], a: str, b: str, value: float) -> None:
        places = ((self.at(a), 1.0), (self.at(b), -1.0))
        where += [(i, j, value * p * q) for i, p in places for j, q in places]

    def volts(self, a: str, b: str) -> Callable[[np.ndarray], np.ndarray]:
        i, j = self.at(a), self.at(b)
        return lambda x: (x[..., i] if i >= 0 else 0.0) - (x[..., j] if j >= 0 else 0.0)

    def through(self, a: str, b: str, law: Callable[[float], tuple[float, float]]) -> None:
        """A current of the voltage from a to b."""

        def added(u: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
            current, slope = law(u[0] - u[1])
            return current * np.array([1.0, -1.0]), slope * np.array([[1.0, -1.0], [-1.0, 1.0]])

        self.laws.append(([self.at(a), self.at(b)], added))

    def resistor(self, a: str, b: str, low: float = 1.0, high: float = 4.0) -> None:
        ohm, name = self.value(low, high), self.named("R")
        self.lines.append(f"{name}: resistor(R = {ohm} ohm) {a} -> {b}")
        self.across(self.linear, a, b, 1.0 / ohm)

    def capacitor(self, a: str, b: str) -> None:
        farad, name = self.value(-7, -5), self.named("C")
        self.lines.append(f"{name}: capacitor(C = {farad} F) {a} -> {b}; init {name}.e = 0 V")
        self.across(self.moving, a, b, farad)

    def inductor(self, a: str, b: str) -> None:
        henry, name = self.value(-3, -1), self.named("L")
        self.lines.append(f"{name}: inductor(L = {henry} H) {a} -> {b}; init {name}.f = 0 A")
        k = self.branch(name, a, b)
        self.moving.append((k, k, henry))
        self.traced[f"{name}.f"] = lambda x: x[..., k]

    def coupled(self, a: str, b: str) -> None:
        (c, d), name = self.two(), self.named("M")
        one, two, part = self.value(-3, -1), self.value(-3, -1), round(float(self.random.uniform(-0.99, 0.99)), 3)
        ends = f"one = {a} -> {b}, two = {c} -> {d}"
        self.lines.append(f"{name}: coupled_inductors(L1 = {one} H, L2 = {two} H, k = {part}) {ends}")
        self.lines += [f"init {name}.one.f = 0 A", f"init {name}.two.f = 0 A"]
        i, j = self.branch(name + "1", a, b), self.branch(name + "2", c, d)
        mutual = part * np.sqrt(one * two)
        self.moving += [(i, i, one), (i, j, mutual), (j, i, mutual), (j, j, two)]
        self.traced[f"{name}.one.f"] = lambda x: x[..., i]

    def diode(self, a: str, b: str) -> None:
        inner, least = self.node(), self.value(-12, -9)
        self.resistor(a, inner, 0, 2)
        self.lines.append(f"{self.named('D')}: diode(Is = {least} A) {inner} -> {b}")

        def law(u: float) -> tuple[float, float]:
            e = np.exp(min(u / VT, 60.0))
            return least * (e - 1.0), least * e / VT

        self.through(inner, b, law)

    def npn(self, a: str, b: str) -> None:
        base, emitter = self.node(), self.node()
        self.resistor(a, base, 3, 5)
        self.resistor(str(self.random.choice([n for n in ("n0", "n1", "ground") if n not in (a, b)])), emitter, 1, 3)
        self.lines.append(f"{self.named('Q')}: npn() c = {b}, b = {base}, e = {emitter}")

        def law(u: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
            e, c = (np.exp(min((u[0] - other) / VT, 80.0)) for other in u[1:])
            forth, back = EMITTER * (e - 1.0), COLLECTOR * (c - 1.0)
            slopes = np.array([[1.0, -1.0, 0.0], [1.0, 0.0, -1.0]]) * np.array([[EMITTER * e], [COLLECTOR * c]]) / VT
            mixed = np.array([[1.0, -REVERSE], [-FORWARD, 1.0]])  # through the emitter's junction, the collector's
            ends = np.array([[1.0, 1.0], [-1.0, 0.0], [0.0, -1.0]])
            return ends @ mixed @ np.array([forth, back]), ends @ mixed @ slopes

        self.laws.append(([self.at(k) for k in (base, emitter, b)], law))

    def table(self, a: str, b: str) -> None:
        at, name = np.array([-8.0, -3.0, -1.0, 0.0, 1.0, 3.0, 8.0]), self.named("N")
        rise = self.random.uniform(0.2, 3.0, 6)
        values = np.round(np.concatenate((-np.cumsum(rise[:3])[::-1], [0.0], np.cumsum(rise[3:]))), 3)
        points = ", ".join(f"({x}, {y})" for x, y in zip(at, values, strict=True))
        self.tables.append(f"table t{name}(x: V) -> mA pchip extend [ {points} ]")
        self.lines.append(f"{name}: dissipator(f = t{name}(e)) {a} -> {b}")
        curve = PchipInterpolator(at, 1e-3 * values)
        slope = curve.derivative()

        def law(u: float) -> tuple[float, float]:
            inside = min(max(u, at[0]), at[-1])
            return float(curve(inside) + slope(inside) * (u - inside)), float(slope(inside))

        self.through(a, b, law)

    def amplifier(self, a: str, b: str) -> None:
        inner, out = self.node(), self.node()
        self.resistor(a, inner)
        self.resistor(inner, out)
        if self.random.random() < 0.5:
            self.capacitor(inner, out)
        name = self.named("A")
        self.lines.append(f"{name}: opamp(gain = 100000) inp = ground, inm = {inner}, out = {out}")
        k = self.at(name)
        self.linear += [(self.at(out), k, 1.0), (k, self.at(out), 1.0), (k, self.at(inner), 1e5)]
        self.resistor(out, b)

    def transformer(self) -> None:
        turns, name = round(float(self.random.uniform(0.3, 3.0)), 3), self.named("T")
        self.lines.append(f"{name}: ideal_transformer(n = {turns}) a = n0, b = ground, c = n1, d = ground")
        k = self.at(name)
        self.linear += [(0, k, 1.0), (1, k, -turns), (k, 0, 1.0), (k, 1, -turns)]

    def machine(self, a: str, b: str) -> None:
        name, warm = self.named("G"), self.random.random() < 0.5
        ohm, henry, inertia, drag = self.value(0, 2), self.value(-3, -2), self.value(-7, -5), self.value(-7, -5)
        torque, fan, heat, spring = self.value(-2.3, -1.3), self.value(-9, -7), self.value(-4, -2), self.value(-3, -1)
        shaft = f"w{name}"
        self.shafts.append(shaft)
        warmth = f", Cth = {heat} J/K, alpha = {ALPHA} K^-1, Rth = {R_TH} K/W" if warm else ""
        turns = f"J = {inertia} kg.m^2, b = {drag} N.m.s/rad, K = {torque} V.s/rad"
        given = f"R = {ohm} ohm, L = {henry} H, {turns}{warmth}"
        kind = "dc_motor.thermal" if warm else "dc_motor"
        self.lines += [
            f"{name}: {kind}({given}) p = {a}, n = {b}, shaft = {shaft}",
            f"init {name}.La.f = 0 A; init {shaft}.f = 0 rad/s",
            f"F{name}: dissipator(e = {fan} N.m.s^2/rad^2*f*abs(f)) {shaft} -> ground",
            f"S{name}: potential(e = {spring} N.m/rad*q) {shaft} -> ground; init S{name}.q = 0 rad",
        ]
        k = self.branch(name, a, b)
        w, turned, hot = (self.at(name + letter) for letter in "wqT")
        self.moving += [(k, k, henry), (w, w, inertia), (turned, turned, 1.0), (hot, hot, heat)]
        self.linear += [(k, w, torque), (w, k, -torque), (w, w, drag), (w, turned, spring), (turned, w, -1.0)]
        self.linear += [(hot, hot, 1.0 / R_TH)]
        alpha = ALPHA if warm else 0.0

        def law(u: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
            i, speed, above = u
            r, loss = ohm * (1.0 + alpha * above), fan * speed * abs(speed)
            more = ohm * alpha * i
            slopes = [[r, 0.0, more], [0.0, 2 * fan * abs(speed), 0.0], [-2 * r * i, 0.0, -more * i]]
            return np.array([r * i, loss, -r * i**2]), np.array(slopes)

        self.laws.append(([k, w, hot], law))
        self.traced[f"{shaft}.f"] = lambda x: x[..., w]
        if warm:
            self.traced[f"{name}.hot.e"] = lambda x: AMBIENT + x[..., hot]

    def source(self, kind: str) -> None:
        """From n0 to the ground."""
        volt, name = round(float(self.random.uniform(2.0, 12.0)), 2), self.named("V")
        k = self.branch(name, "ground", "n0")
        ticks = sorted(int(tick) for tick in self.random.choice(np.arange(11, STEPS, 2), 3, replace=False))
        us = [f"{5 * tick} us" for tick in ticks]
        if kind == "sine":
            self.lines.append(f"{name}: voltage(v = {volt} V*sin(2*pi*170 Hz*t)^3) n0 -> ground")
            self.sources.append((k, lambda t: volt * np.sin(2 * np.pi * 170 * t) ** 3))
        elif kind == "lines":
            second = round(float(self.random.uniform(-9.0, 9.0)), 2)
            corners = f"at = [{', '.join(us)}], v = [0 V, {volt} V, {second} V]"
            self.lines.append(f"{name}: piecewise_voltage(n = 3, {corners}) n0")
            self.sources.append((k, lambda t: float(np.interp(t / TICK, ticks, [0.0, volt, second]))))
        else:
            behind = f"(if t < {us[2]} then -4 V else 7 V)"
            self.lines.append(f"{name}: voltage(v = if t < {us[0]} then {volt} V*sin(2*pi*50 Hz*t) else {behind}) n0")

            def jumping(t: float) -> float:
                tick = t / TICK - 1e-7  # at the end of a step: of before
                return volt * np.sin(100 * np.pi * t) if tick < ticks[0] else -4.0 if tick < ticks[2] else 7.0

            self.sources.append((k, jumping))

    @property
    def text(self) -> str:
        electrical = "capacitor, coupled_inductors, diode, ideal_transformer, inductor, npn, opamp, piecewise_voltage"
        lines = [f"from std.electrical import {electrical}, resistor, voltage", "from std.transduce import dc_motor"]
        lines += [*self.tables, "model net {", f"node {', '.join(self.nodes)}: electrical"]
        lines += [f"node {shaft}: rotation = 0 rad" for shaft in self.shafts]
        traced = ", ".join(self.traced)
        scene = [f"time 0 s to {1e3 * SPAN} ms", f"trace {traced} every {1e3 * SPAN / ROWS} ms", "accuracy 1e-6"]
        return "\n".join([*lines, *self.lines, "}", "scene run of net {", *scene, "}"])

    def moved(self) -> tuple[np.ndarray, np.ndarray]:
        """X [ROWS + 1, unknowns] at equal instants, and what steps of half the length change of it."""
        once, twice = self._moved(1), self._moved(2)
        return twice, np.abs(twice - once)

    def _moved(self, parts: int) -> np.ndarray:
        """The same by so many steps a tick."""
        n, h, steps = len(self.places), TICK / parts, STEPS * parts
        e, a = np.zeros((n + 1, n + 1)), np.zeros((n + 1, n + 1))  # the last one is the ground
        for matrix, entries in ((e, self.moving), (a, self.linear)):
            for i, j, value in entries:
                matrix[i, j] += value
        e, a = e[:n, :n], a[:n, :n]
        inverse = np.linalg.inv(STAGES) / h
        mass, x, z, rows = np.kron(inverse, e), np.zeros(n), np.zeros((3, n)), [np.zeros(n)]
        for step in range(steps):
            b = np.zeros((3, n))
            for row, value in self.sources:
                b[:, row] += [value(h * (step + c)) for c in NODES]
            z = self._newton(x, z, (a, e, b, mass, inverse))
            x, z = x + z[2], NODES[:, None] * z[2]
            if (step + 1) % (steps // ROWS) == 0:
                rows.append(x)
        return np.array(rows)

    def _newton(self, x: np.ndarray, guess: np.ndarray, matrices: tuple[np.ndarray, ...]) -> np.ndarray:
        """Stages from a guess; where that fails from nothing, no correction beyond 50 mV."""
        a, e, b, mass, inverse = matrices
        n = x.size
        for z, most, times in ((guess, np.inf, 12), (np.zeros_like(guess), 0.05, 500)):
            for _ in range(times):
                miss, slopes = (inverse @ z) @ e.T + (x + z) @ a.T - b, mass.copy()
                for s in range(3):
                    own = slopes[s * n : (s + 1) * n, s * n : (s + 1) * n]
                    own += a
                    values = np.append(x + z[s], 0.0)
                    for at, law in self.laws:
                        added, slope = law(values[at])
                        live = [k for k, place in enumerate(at) if place >= 0]
                        where = [at[k] for k in live]
                        miss[s, where] += added[live]
                        own[np.ix_(where, where)] += slope[np.ix_(live, live)]
                move = np.linalg.solve(slopes, -miss.ravel()).reshape(3, n)
                largest = np.abs(move).max()
                z = z + move * min(1.0, most / max(largest, 1e-300))
                if largest <= 1e-10 * (1e-3 + min(np.abs(x + z).max(), 1e3)):
                    return z
        raise ArithmeticError


OPEN = 4
"""Nodes that elements are drawn between."""
SOURCES = ("sine", "lines", "step")
STORES = ("capacitor", "capacitor", "inductor", "coupled", "machine")
OTHERS = ("resistor", "diode", "npn", "table", "amplifier")


def drawn(number: int) -> Circuit:
    """Of a number always the same: a chain of resistors, a source, five to nine elements."""
    made = Circuit(np.random.default_rng(number))
    for _ in range(OPEN):
        made.resistor(made.node(), "ground", 2.5, 4.0)
    made.source(SOURCES[number % 3])
    for kind in made.random.choice(STORES + OTHERS, int(made.random.integers(5, 10))):
        getattr(made, kind)(*made.two())
    if made.random.random() < 0.3:
        made.transformer()
    for a, b in zip(made.nodes[: OPEN - 1], made.nodes[1:OPEN], strict=True):
        made.resistor(a, b)
    made.traced |= {f"{name}.e": made.volts(name, "ground") for name in made.nodes}
    return made
