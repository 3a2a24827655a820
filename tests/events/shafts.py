"""Random shafts with dry friction, ratchets, walls, latches and a blow, and their motion by Moreau's time stepping."""

from __future__ import annotations

import ctypes as c
from dataclasses import dataclass

import numpy as np
from compiled import library

SPAN, ROWS, STEPS = 2.0, 200, 400_000
KINDS = ("friction", "ratchet", "wall", "latch")
WALL = """\
component wall {
  param lo: rad
  param bounce = 0
  branch: rotation
  phi lower: q >= lo restitution bounce
}
"""


class _Contact(c.Structure):
    _fields_ = [("kind", c.c_int32), ("along", c.c_double * 8), *((name, c.c_double) for name in "abc")]


@dataclass(frozen=True)
class Shafts:
    """inertia [n]; springs, dampers: (a, b, value) between shafts, n being the ground; contacts: (kind, a, b, three
    numbers as in moreau.c); loads: (shaft, amplitude, frequency, phase); blow: (shaft, speed, instant).
    """

    inertia: list[float]
    springs: list[tuple[int, int, float]]
    dampers: list[tuple[int, int, float]]
    contacts: list[tuple[str, int, int, float, float, float]]
    loads: list[tuple[int, float, float, float]]
    blow: tuple[int, float, float]

    @property
    def text(self) -> str:
        """The model and its scene."""
        names = [f"s{k}" for k in range(len(self.inertia))]
        ends = [*names, "ground"]
        said = [
            "from std.mechanical import inertia, torsion, rotary_damper, torque, brake, ratchet",
            WALL + "model shafts {",
        ]
        said += [f"  node {', '.join(names)}: rotation"]
        for name, value in zip(names, self.inertia, strict=True):
            said += [f"  J_{name}: inertia(J = {value} kg.m^2) {name}", f"  init {name}.q = 0 rad"]
            said += [f"  init {name}.f = 0 rad/s"]
        for kind, unit, found in (
            ("torsion(k", "N.m/rad", self.springs),
            ("rotary_damper(b", "N.m.s/rad", self.dampers),
        ):
            said += [
                f"  {kind[0]}{k}: {kind} = {v} {unit}) {ends[a]} -> {ends[b]}" for k, (a, b, v) in enumerate(found)
            ]
        for k, (kind, a, b, x, y, z) in enumerate(self.contacts):
            between = f"{ends[a]} -> {ends[b]}"
            said += {
                "friction": [
                    f"  F{k}: brake(r = 1 m, mu = 1, faces = 1, clamp = {x} N*(1 + {y}*sin({z} rad/s*t))) {between}"
                ],
                "ratchet": [f"  F{k}: ratchet {between}"],
                "wall": [f"  F{k}: wall(lo = {x} rad, bounce = {y}) {between}"],
                "latch": [
                    f"  discrete on{k} = false",
                    f"  psi F{k}: {ends[a]}.f = {f'{ends[b]}.f' if b < len(names) else '0 rad/s'} while on{k}",
                    f"  when t >= {x} s {{ on{k} := true }}",
                ],
            }[kind]
        for k, (a, size, frequency, phase) in enumerate(self.loads):
            said += [f"  T{k}: torque(M = {size} N.m*sin({frequency} rad/s*t + {phase} rad)) ground -> {names[a]}"]
        shaft, speed, instant = self.blow
        said += [f"  when t >= {instant} s {{ {names[shaft]}.f := {speed} rad/s }}", "}", "scene turn of shafts {"]
        traced = ", ".join(f"{name}.q, {name}.f" for name in names)
        return "\n".join(
            [*said, f"  time 0 s to {SPAN} s", f"  trace {traced} every 10 ms", "  accuracy 1e-6", "}", ""]
        )

    def moved(self) -> tuple[np.ndarray, np.ndarray]:
        """Angles and speeds [ROWS, n] at equal times behind the start."""
        n = len(self.inertia)
        between = lambda a, b: (np.arange(n) == a) * 1.0 - (np.arange(n) == b)  # noqa: E731
        matrices = [np.diag(self.inertia).astype(float)]
        for found in (self.springs, self.dampers):
            matrices += [sum((v * np.outer(between(a, b), between(a, b)) for a, b, v in found), np.zeros((n, n)))]
        load = np.zeros((n, 3))
        for a, *rest in self.loads:
            load[a] = rest
        contacts = (_Contact * max(len(self.contacts), 1))()
        for k, (kind, a, b, *rest) in enumerate(self.contacts):
            contacts[k] = _Contact(KINDS.index(kind), (c.c_double * 8)(*between(a, b)), *rest)
        shaft, speed, instant = self.blow
        kick = np.array([round(instant / SPAN * STEPS), shaft, speed], dtype=float)
        q, v, rows = np.zeros(n), np.zeros(n), np.zeros((ROWS, 2 * n))
        arrays = [c.c_void_p(np.ascontiguousarray(m).ctypes.data) for m in (*matrices, load)]
        last = [c.c_void_p(item.ctypes.data) for item in (q, v, rows)]
        kicked = c.c_void_p(kick.ctypes.data)
        library("moreau").shafts(n, len(self.contacts), *arrays, contacts, kicked, c.c_double(SPAN), STEPS, ROWS, *last)
        return rows[:, :n], rows[:, n:]


def drawn(number: int) -> Shafts:
    """The same for ever; with three contacts and more friction often holds in loops."""
    r = np.random.default_rng(number)

    def size(low: float, high: float) -> float:
        return float(np.round(10 ** r.uniform(low, high), 3))

    def ends() -> tuple[int, int]:
        a, b = r.choice(n + 1, 2, replace=False)
        return int(a), int(b)

    n = int(r.integers(1, 5))
    springs = [(*ends(), size(0, 2)) for _ in range(int(r.integers(0, n + 2)))]
    dampers = [(*ends(), size(-1.5, 0.5)) for _ in range(int(r.integers(0, n + 1)))]
    pairs = [(a, b) for a in range(n) for b in (*range(a), n)]
    r.shuffle(pairs)
    contacts = []
    for a, b in pairs[: int(r.integers(1, 7))]:
        kind = str(r.choice(KINDS, p=[0.5, 0.15, 0.2, 0.15]))
        contacts.append((kind, int(a), int(b), *_numbers(kind, r, size)))
    loaded = {int(r.integers(n)), int(r.integers(n))}
    loads = [(k, size(-0.3, 1), size(0, 1), float(np.round(r.uniform(0, 6), 3))) for k in sorted(loaded)]
    blow = int(r.integers(n)), float(np.round(r.uniform(-3, 3), 2)), float(np.round(r.uniform(0.2, 1.5), 2))
    return Shafts([size(-0.5, 0.5) for _ in range(n)], springs, dampers, contacts, loads, blow)


def _numbers(kind: str, r: np.random.Generator, size) -> tuple[float, float, float]:  # type: ignore[no-untyped-def]
    match kind:
        case "friction":
            return size(-0.5, 0.7), float(r.choice([0.0, 0.9])), size(0, 1)
        case "wall":
            return -size(-2.5, -0.5), float(r.choice([0.0, 0.5, 0.8])), 0.0
        case "latch":
            return float(np.round(r.uniform(0.1, 1.6), 2)), 0.0, 0.0
    return 0.0, 0.0, 0.0
