"""Random networks of resistors, capacitors and inductors, time constants up to 1e12 apart, against their modes.

A ladder of one to four stages: a resistor to the next node, there a capacitor, a coil or a resistor to ground.  Sizes
are drawn over 6 to 10 decades, the span from a part of the shortest time constant to ten times the longest.
"""

import random
import warnings
from dataclasses import dataclass

import mpmath
import numpy as np
from sysdyn.api import load
from sysdyn.dsl.text.diagnostics import ModelError

FORMULATIONS = ("lagrangian", "hamiltonian", "co_lagrangian", "co_hamiltonian")
METHODS = ("auto", "auto", "bdf", "radau")
KIND = {"C": ("capacitor(C = {} F)", "e"), "L": ("inductor(L = {} H)", "f"), "R": ("resistor(R = {} ohm)", "f")}
LATE = 1e-9
"""Of the span: the time tolerance of comparisons."""
LOOKED_AT = 40
DIGITS = 50


@dataclass(frozen=True)
class Network:
    """stages: kind (C, L, R), series resistance (ohm), size of the element to ground (SI); span (s)."""

    seed: int
    stages: tuple[tuple[str, float, float], ...]
    span: float
    formulation: str
    method: str
    accuracy: float

    @property
    def states(self) -> list[int]:
        """Stages with a capacitor, then those with a coil."""
        return [i for kind in "CL" for i, stage in enumerate(self.stages) if stage[0] == kind]

    @property
    def text(self) -> str:
        """In the language; the voltages of capacitors and currents of coils are traced as q<stage>."""
        lines = ["from std.electrical import voltage, resistor, capacitor, inductor", "model net {"]
        nodes = ", ".join(f"n{i}" for i in range(len(self.stages)))
        lines += [f"  node s, {nodes}: electrical", "  V: voltage(v = 1 V) s -> ground"]
        for i, (kind, series, size) in enumerate(self.stages):
            before = f"n{i - 1}" if i else "s"
            lines.append(f"  r{i}: resistor(R = {series!r} ohm) {before} -> n{i}")
            lines.append(f"  x{i}: {KIND[kind][0].format(repr(size))} n{i} -> ground")
        traced = {i: f"x{i}.{KIND[self.stages[i][0]][1]}" for i in self.states}
        lines += [f"  init {name} = 0 {'V' if name.endswith('e') else 'A'}" for name in traced.values()]
        listed = ", ".join(f"{name} as q{i}" for i, name in traced.items())
        return "\n".join([*lines, "}", f"scene run of net {{ time 0 s to {self.span!r} s; trace {listed} }}", ""])


def equations(stages):
    """A [n, n] and b [n] of x' = A x + b, x in the order of `Network.states`: nodal analysis, nodes without a
    capacitor eliminated.
    """
    k = len(stages)
    g, fed = mpmath.zeros(k, k), mpmath.zeros(k, 1)
    for i, (kind, series, size) in enumerate(stages):
        link = 1 / mpmath.mpf(series)
        g[i, i] += link + (1 / mpmath.mpf(size) if kind == "R" else 0)
        if i:
            g[i - 1, i - 1] += link
            g[i, i - 1] = g[i - 1, i] = -link
        else:
            fed[0] = link
    c, l = ([i for i in range(k) if stages[i][0] == kind] for kind in "CL")
    free, n = [i for i in range(k) if i not in c], len(c) + len(l)
    u = mpmath.zeros(k, n + 1)  # of the nodes, by the states and the source
    for m, i in enumerate(c):
        u[i, m] = 1
    if free:
        matrix = mpmath.matrix([[g[i, j] for j in free] for i in free])
        for m in range(n + 1):
            push = [-sum(g[i, j] * u[j, m] for j in c) for i in free]
            if m == n:
                push = [fed[i] for i in free]
            elif m >= len(c):
                push = [-1 if i == l[m - len(c)] else 0 for i in free]
            for i, value in zip(free, mpmath.lu_solve(matrix, mpmath.matrix(push)), strict=True):
                u[i, m] = value
    a, b = mpmath.zeros(n, n), mpmath.zeros(n, 1)
    for row, i in enumerate([*c, *l]):
        size = mpmath.mpf(stages[i][2])
        for m in range(n + 1):
            rate = u[i, m] if i in l else (fed[i] if m == n else 0) - sum(g[i, j] * u[j, m] for j in range(k))
            if m == n:
                b[row] = rate / size
            else:
                a[row, m] = rate / size
    return a, b


class Modes:
    """The motion from rest."""

    def __init__(self, stages) -> None:
        with mpmath.workdps(DIGITS):
            a, b = equations(stages)
            self.rates, self.shapes = mpmath.eig(a)
            self.rest = mpmath.lu_solve(a, -b)
            self.parts = mpmath.lu_solve(self.shapes, -self.rest)
        self.times = sorted(1.0 / abs(float(mpmath.re(rate))) for rate in self.rates)

    def at(self, t):
        """States [instants, states]."""
        n = len(self.rest)
        with mpmath.workdps(DIGITS):
            found = np.empty((len(t), n))
            for k, s in enumerate(t):
                now = [self.parts[m] * mpmath.exp(self.rates[m] * mpmath.mpf(float(s))) for m in range(n)]
                for i in range(n):
                    found[k, i] = float(mpmath.re(self.rest[i] + sum(self.shapes[i, m] * now[m] for m in range(n))))
        return found


def drawn(seed):
    """The network of a seed."""
    r = random.Random(seed)
    stages = []
    for _ in range(r.randint(1, 4)):
        kind = r.choice("CCLLR")
        stages.append((kind, 10 ** r.uniform(-3, 3), 10 ** (r.uniform(-3, 3) if kind == "R" else r.uniform(-9, 1))))
    if all(stage[0] == "R" for stage in stages):
        stages[-1] = ("C", stages[-1][1], 10 ** r.uniform(-9, 1))
    times = Modes(stages).times
    longest = np.log10(times[-1]) + 1.0
    span = float(10 ** r.uniform(max(np.log10(times[0]) - 0.5, longest - 9.0), longest))
    return Network(seed, tuple(stages), span, r.choice(FORMULATIONS), r.choice(METHODS), 10.0 ** -r.randint(1, 7))


def judged(network, folder):
    """(kind, largest error over the accuracy asked): right, near (up to 3), wrong, or not met, or refused with its
    code.
    """
    path = folder / f"net{network.seed}.sd"
    path.write_text(network.text)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        try:
            model = load(path, formulation=network.formulation, method=network.method, accuracy=network.accuracy)
            trace = model.run(unmet="warn", max_wall=60.0)
        except ModelError as error:
            return str(error).split(":")[0], np.inf
    t = np.array(trace.time)
    places = np.unique([*range(min(t.size, LOOKED_AT // 2)), *np.linspace(0, t.size - 1, LOOKED_AT // 2).astype(int)])
    late = LATE * network.span
    near = Modes(network.stages).at(np.clip(np.concatenate([t[places] - late, t[places], t[places] + late]), 0.0, None))
    near = near.reshape(3, places.size, -1)
    worst = 0.0
    for column, i in enumerate(network.states):
        values = np.array(trace[f"q{i}"])
        beyond = np.maximum(values[places] - near[:, :, column].max(0), near[:, :, column].min(0) - values[places])
        worst = max(worst, float(beyond.max() / np.abs(values).max()) / network.accuracy)
    if worst <= 1.0:
        return "right", worst
    if not trace.attributes["met"]:
        return "not met", worst
    return ("near" if worst <= 3.0 else "wrong"), worst
