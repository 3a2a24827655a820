"""Random nets of ideal switches, resistors, a source and at times a capacitor, whose parts float and whose switches
stand in series and side by side; what is exact of them: nodal analysis with leaks of 1e-13 S.
"""

from __future__ import annotations

import random
from dataclasses import dataclass

import numpy as np

PERIOD = 20.0
"""ms: gates repeat."""


@dataclass(frozen=True)
class Part:
    """kind: V, R, C or S, from one node to another; value: V, ohm, F, or begin and end of conduction (ms)."""

    kind: str
    begin: str
    end: str
    value: float | tuple[int, int]

    def conducts(self, at: float) -> bool:
        """Whether the gate of a switch is on, `at` ms within a period."""
        on, off = self.value
        return on < at < off if on < off else at > on or at < off

    def text(self) -> str:
        """The element as a model has it."""
        if self.kind != "S":
            head = {"V": "voltage(v = {:g} V)", "R": "resistor(R = {:g} ohm)", "C": "capacitor(C = {:g} F)"}[self.kind]
            return f"{head.format(self.value)} {self.begin} -> {self.end}"
        on, off = self.value
        word, within = "and" if on < off else "or", f"mod(t, {PERIOD:g} ms)"
        gate = f"if {within} > {on} ms {word} {within} < {off} ms then 1 else 0"
        return f"switch(gate = {gate}) {self.begin} -> {self.end}"


def net(seed: int) -> list[Part]:
    """The parts of one, each node of which touches two."""
    r = random.Random(seed)
    nodes = [f"n{k}" for k in range(r.randint(3, 5))]
    every = [*nodes, "ground"]

    def between(kind: str, value: float | tuple[int, int]) -> Part:
        return Part(kind, *r.sample(every, 2), value)

    def some(low: float, high: float) -> float:
        return float(f"{10.0 ** r.uniform(low, high):.3g}")

    parts = [Part("V", "src", "ground", some(0.7, 1.7)), Part("R", "src", nodes[0], 2.0)]
    for _ in range(r.randint(3, 6)):
        on = r.randint(1, 18)
        parts.append(between("S", (on, (on + r.randint(1, 18)) % 20 or 19)))
    parts += [between("R", some(0.0, 3.0)) for _ in range(r.randint(2, 4))]
    parts += [between("C", some(-5.0, -3.0)) for _ in range(r.randint(0, 1))]
    for node in nodes:
        while sum(node in (p.begin, p.end) for p in parts) < 2:
            parts.append(Part("R", node, r.choice([n for n in every if n != node]), some(0.0, 3.0)))
    return parts


def traced(parts: list[Part]) -> list[int]:
    """Numbers of the parts whose current (of a capacitor: voltage) is traced."""
    return [k for k, p in enumerate(parts) if p.kind in "RC"]


def text(parts: list[Part]) -> str:
    """The model and its scene `go`."""
    nodes = sorted({n for p in parts for n in (p.begin, p.end)} - {"ground"})
    lines = [f"  E{k}: {p.text()}" for k, p in enumerate(parts)]
    seen = ", ".join(f"E{k}.{'e' if parts[k].kind == 'C' else 'f'} as E{k}" for k in traced(parts))
    return "\n".join([
        "from std.electrical import resistor, capacitor, voltage, switch",
        "model net {",
        f"  node {', '.join(nodes)}: electrical",
        *lines,
        "}",
        f"scene go of net {{ time 0 s to 60 ms; trace {seen} every 0.5 ms; accuracy 1e-5 }}",
    ])  # fmt: skip


def currents(parts: list[Part], at: float) -> dict[int, float]:
    """Of the resistors of a net without a capacitor (A), `at` ms within a period."""
    place = {n: k for k, n in enumerate(sorted({n for p in parts for n in (p.begin, p.end)} - {"ground"}))}
    held = [p for p in parts if p.kind == "V" or (p.kind == "S" and p.conducts(at))]
    n = len(place)
    matrix, right = np.diag(np.r_[np.full(n, 1e-13), np.full(len(held), -1e-9)]), np.zeros(n + len(held))

    def ends(part: Part) -> list[tuple[int, float]]:
        return [(place[node], sign) for node, sign in ((part.begin, 1.0), (part.end, -1.0)) if node != "ground"]

    for part in parts:
        if part.kind == "R":
            for i, s in ends(part):
                for j, q in ends(part):
                    matrix[i, j] += s * q / part.value
    for k, part in enumerate(held):
        for i, s in ends(part):
            matrix[i, n + k] += s
            matrix[n + k, i] += s
        right[n + k] = part.value if part.kind == "V" else 0.0
    found = np.linalg.solve(matrix, right)
    return {k: sum(s * found[i] for i, s in ends(p)) / p.value for k, p in enumerate(parts) if p.kind == "R"}
