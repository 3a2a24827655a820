"""Random converters (sources, coils, ideal diodes, switches, thyristors, field-effect transistors) and their motion by
backward Euler (converters.c).
"""

from __future__ import annotations

import ctypes as c
from dataclasses import dataclass

import numpy as np
from compiled import library

SPAN, ROWS, STEPS = 0.06, 60, (120_000, 480_000)
KINDS = ("diode", "switch", "thyristor", "mosfet")
MOST = 8


class _Branch(c.Structure):
    _fields_ = [("a", c.c_int32), ("b", c.c_int32), ("r", c.c_double), ("l", c.c_double)]


class _Source(c.Structure):
    _fields_ = [("node", c.c_int32), *((k, c.c_double) for k in ("r", "amplitude", "f", "phase"))]


class _Valve(c.Structure):
    _fields_ = [
        *((k, c.c_int32) for k in ("kind", "a", "b")),
        *((k, c.c_double) for k in ("r", "delay", "period", "width")),
    ]


class _Net(c.Structure):
    _fields_ = [
        *((k, c.c_int32) for k in ("nodes", "branches", "sources", "valves")),
        ("c", c.c_double * MOST),
        ("branch", _Branch * MOST),
        ("source", _Source * MOST),
        ("valve", _Valve * MOST),
    ]


@dataclass(frozen=True)
class Converter:
    """capacitors [nodes] to ground (F); branches: (a, b, ohm, henry); sources: (node, ohm, volt, rad/s, phase); valves:
    (kind, a, b, ohm in series, delay, period and width of the gate in s).  Node len(capacitors) is the ground.
    """

    capacitors: list[float]
    branches: list[tuple[int, int, float, float]]
    sources: list[tuple[int, float, float, float, float]]
    valves: list[tuple[str, int, int, float, float, float, float]]

    @property
    def traced(self) -> list[str]:
        """Names of the voltages of the nodes, of the currents of the coils."""
        coils = [k for k, branch in enumerate(self.branches) if branch[3]]
        return [*(f"v{k}" for k in range(len(self.capacitors))), *(f"i{k}" for k in coils)]

    @property
    def text(self) -> str:
        """The model and its scene."""
        ends = [*(f"n{k}" for k in range(len(self.capacitors))), "ground"]
        nodes, said = ends[:-1], list[str]()
        for k, value in enumerate(self.capacitors):
            said += [f"  C{k}: capacitor(C = {value} F) n{k} -> ground", f"  init C{k}.e = 0 V"]
        for k, (node, r, volt, w, phase) in enumerate(self.sources):
            nodes.append(f"s{k}")
            said.append(f"  V{k}: voltage(v = {volt} V*sin({w} rad/s*t + {phase} rad)) s{k} -> ground")
            said.append(f"  Rs{k}: resistor(R = {r} ohm) s{k} -> n{node}")
        for k, (a, b, r, henry) in enumerate(self.branches):
            start = ends[a]
            if henry:
                start = f"m{k}"
                nodes.append(start)
                said += [f"  L{k}: inductor(L = {henry} H) {ends[a]} -> {start}", f"  init L{k}.f = 0 A"]
            said.append(f"  R{k}: resistor(R = {r} ohm) {start} -> {ends[b]}")
        for k, (kind, a, b, r, delay, period, width) in enumerate(self.valves):
            gate = f"if mod(t - {delay} s, {period} s) < {width} s then 1 else 0"
            end = ends[b]
            if kind == "mosfet":
                said.append(f"  D{k}: mosfet(Ron = {r} ohm) gate = ({gate}), d = {ends[a]}, s = {end}")
                continue
            if r:
                end = f"e{k}"
                nodes.append(end)
                said.append(f"  Re{k}: resistor(R = {r} ohm) {end} -> {ends[b]}")
            word = "diode.complementary()" if kind == "diode" else kind
            said.append(f"  D{k}: {word} {ends[a]} -> {end}" + ("" if kind == "diode" else f", gate = ({gate})"))
        rows = [f"{name.replace('v', 'n')}.e" if name[0] == "v" else f"L{name[1:]}.f" for name in self.traced]
        traced = ", ".join(f"{row} as {name}" for row, name in zip(rows, self.traced, strict=True))
        return "\n".join(
            [
                "from std.electrical import capacitor, diode, inductor, mosfet, resistor, switch, thyristor, voltage",
                "model net {",
                f"  node {', '.join(nodes)}: electrical",
                *said,
                "}",
                "scene s of net {",
                f"  time 0 s to {SPAN} s",
                f"  trace {traced} every {SPAN / ROWS} s",
                "  accuracy 1e-5",
                "}\n",
            ]
        )

    def moved(self) -> tuple[np.ndarray, np.ndarray]:
        """Voltages and currents [ROWS + 1, traced] at equal times from the start on, and what they may be off by."""
        net = _Net(len(self.capacitors), len(self.branches), len(self.sources), len(self.valves))
        net.c[: len(self.capacitors)] = self.capacitors
        for k, branch in enumerate(self.branches):
            net.branch[k] = _Branch(*branch)
        for k, (node, *rest) in enumerate(self.sources):
            net.source[k] = _Source(node, *rest)
        for k, (kind, a, b, *rest) in enumerate(self.valves):
            net.valve[k] = _Valve(KINDS.index(kind), a, b, *rest)
        found = np.zeros((2, ROWS + 1, len(self.traced)))
        for steps, rows in zip(STEPS, found, strict=True):
            into = c.c_void_p(rows.ctypes.data)
            assert library("converters").converter(c.byref(net), c.c_double(SPAN), c.c_int64(steps), ROWS, into) == 0
        apart = found[1] - found[0]
        return found[1] + apart / 3.0, np.abs(apart).max(axis=0)


def drawn(number: int) -> Converter:
    """The same for ever.  Gates change at steps of the reference."""
    r = np.random.default_rng(number)

    def size(low: float, high: float) -> float:
        return float(f"{10 ** r.uniform(low, high):.3g}")

    def ends() -> tuple[int, int]:
        a, b = r.choice(n + 1, 2, replace=False)
        return int(a), int(b)

    n = int(r.integers(2, 5))
    branches = [(*ends(), size(0, 2), 0.0) for _ in range(int(r.integers(1, 4)))]
    branches += [(*ends(), size(-1, 0.5), size(-3, -1.5)) for _ in range(int(r.integers(0, 3)))]
    sources = [
        (int(r.integers(n)), size(-0.5, 0.7), size(1, 2.3), 314.159, round(float(r.uniform(0, 6)), 2))
        for _ in range(int(r.integers(1, 3)))
    ]
    touched = {end for a, b, *_ in branches for end in (a, b)} | {node for node, *_ in sources}
    branches += [(k, n, size(0, 2), 0.0) for k in range(n) if k not in touched]
    valves = []
    for _ in range(int(r.integers(1, 5))):
        kind = str(r.choice(KINDS, p=[0.4, 0.15, 0.3, 0.15]))
        period = float(r.choice([0.02, 0.01, 0.005, 0.007]))
        gate = round(float(r.uniform(0, 0.02)), 5), period, round(period * float(r.uniform(0.1, 0.8)), 5)
        bare = r.random() < 0.3 and kind in ("diode", "thyristor")
        valves.append((kind, *ends(), 0.0 if bare else size(-0.5, 1), *gate))
    return Converter([size(-5, -3) for _ in range(n)], branches, sources, valves)
