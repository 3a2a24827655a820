"""Random rectifiers of exponential diodes (half-wave, bridge, centre tap, doubler, three phases; stacked, loaded by
resistors, coils and capacitors), and their voltages by other equations.

Reference at the start: node potentials minimise a convex function, the content of all branches; by Newton's method with
its conductances eliminated without subtraction (Grassmann, Taksar and Heyman, Operations Research 33, 1985): 1e-170 S
beside 1 S.
"""

from dataclasses import dataclass, field

import numpy as np

VT = 0.02585
FAINT = 1e-12
"""Part of its conductance at zero that a diode keeps, for the direction of a step alone."""


@dataclass
class Rectifier:
    """Branches by their nodes (ground: 0); source: (amplitude, phase, resistance, plus, minus), the rest (value, plus,
    minus).
    """

    frequency: float
    nodes: int = 0
    out: int = 0
    diodes: list = field(default_factory=list)
    resistors: list = field(default_factory=list)
    sources: list = field(default_factory=list)
    capacitors: list = field(default_factory=list)
    coils: list = field(default_factory=list)

    def node(self):
        self.nodes += 1
        return self.nodes

    def text(self, accuracy, end):
        """The model up to `end` [s]: the last stage's voltage as vo, what is held as c0, ..., l0, ..."""
        name = ["ground", *(f"n{k}" for k in range(1, self.nodes + 1))]
        lines = []

        def line(label, made, a, b):
            lines.append(f"{label}: {made} {a} -> {b}")

        for k, (v, a, b) in self._of("diodes"):
            line(f"D{k}", f"diode(Is = {v!r} A, vT = {VT} V)", name[a], name[b])
        for k, (v, a, b) in self._of("resistors"):
            line(f"R{k}", f"resistor(R = {v!r} ohm)", name[a], name[b])
        for k, (size, phase, r, a, b) in self._of("sources"):
            wave = f"{size!r} V*sin(2*pi*{self.frequency!r} Hz*t + {phase!r})"
            line(f"V{k}", f"voltage(v = {wave})", f"s{k}", name[b])
            line(f"S{k}", f"resistor(R = {r!r} ohm)", f"s{k}", name[a])
        for k, (v, a, b) in self._of("capacitors"):
            line(f"C{k}", f"capacitor(C = {v!r} F)", name[a], name[b])
            lines.append(f"init C{k}.e = 0 V")
        for k, (v, a, b) in self._of("coils"):
            line(f"L{k}", f"inductor(L = {v!r} H)", name[a], name[b])
            lines.append(f"init L{k}.f = 0 A")
        traced = [f"{name[self.out]}.e as vo", *(f"C{k}.e as c{k}" for k, _ in self._of("capacitors"))]
        traced += [f"L{k}.f as l{k}" for k, _ in self._of("coils")]
        nodes = ", ".join([*name[1:], *(f"s{k}" for k, _ in self._of("sources"))])
        listed = "\n  ".join(lines)
        return f"""from std.electrical import diode, voltage, capacitor, resistor, inductor
model rectifier {{
  node {nodes}: electrical
  {listed}
}}
scene run of rectifier {{
  time 0 s to {end!r} s
  trace {", ".join(traced)} every {end / 300!r} s
  accuracy {accuracy}
}}
"""

    def _of(self, kind):
        return list(enumerate(getattr(self, kind)))


def rectifier(seed):
    """One to three stages, each on the one before."""
    random = np.random.default_rng(seed)
    made = Rectifier(float(f"{50.0 * 10.0 ** random.uniform(0, 2):.5g}"))

    def drawn(low, high, unit=1.0):
        return float(f"{unit * 10.0 ** random.uniform(low, high):.4g}")

    def diode(a, b):
        made.diodes.append((drawn(-14, -8), a, b))

    def source(a, b, low=0.5, high=2.3):
        phase = float(f"{random.uniform(0, 6.28):.3f}")
        made.sources.append((drawn(low, high), phase, drawn(-1, 1), a, b))

    base = 0
    for _ in range(random.integers(1, 4)):
        kind = random.choice(["half", "bridge", "centre", "doubler", "three", "bridge"])
        p, m = made.node(), base
        if random.random() < 0.5:
            m = made.node()
            made.resistors.append((drawn(0, 3), m, base))
        ends = [made.node() for _ in range({"half": 1, "bridge": 2, "centre": 2, "doubler": 2, "three": 4}[kind])]
        if kind == "bridge":
            source(ends[0], ends[1])
            for end in ends:
                diode(end, p)
                diode(m, end)
        elif kind == "doubler":
            source(ends[0], m)
            made.capacitors.append((drawn(-1, 1, 1e-2 / made.frequency), *ends))
            diode(m, ends[1])
            diode(ends[1], p)
        elif kind == "three":
            for end in ends[:3]:
                source(end, ends[3])
                diode(end, p)
                diode(m, end)
        else:
            for end in ends:
                source(end, m)
                diode(end, p)
        load, out = random.choice(["R", "RC", "RLC", "RL"]), p
        if "L" in load:
            out = made.node()
            made.coils.append((drawn(-1, 1, 1.0 / made.frequency), p, out))
        if "C" in load:
            made.capacitors.append((drawn(-1, 1, 1e-2 / made.frequency), out, m))
        made.resistors.append((drawn(1, 3), out, m))
        made.out = base = p if random.random() < 0.7 else out
    return made


def without_subtraction(shared, to_ground, aim):
    """v [n] with L v = aim: conductances between nodes [n, n] and of each to ground [n]."""
    g, ground, right = shared.copy(), to_ground.copy(), aim.copy()
    n = ground.size
    for k in range(n - 1, -1, -1):
        whole = ground[k] + g[k, :k].sum()
        part = g[k, :k] / whole
        g[:k, :k] += np.outer(part, g[k, :k])
        np.fill_diagonal(g, 0.0)
        ground[:k] += part * ground[k]
        right[:k] += part * right[k]
        ground[k] = whole
    v = np.zeros(n)
    for k in range(n):
        v[k] = (right[k] + g[k, :k] @ v[:k]) / ground[k]
    return v


def at_the_start(made):
    """Potentials of all nodes [V] where capacitors hold no voltage and coils no current; None where none were found."""
    group = np.arange(made.nodes + 1)
    for _, a, b in made.capacitors:
        group[group == max(group[a], group[b])] = min(group[a], group[b])
    place = np.unique(group, return_inverse=True)[1]
    linear = [(1.0 / r, 0.0, a, b) for r, a, b in made.resistors]
    linear += [(1.0 / r, size * np.sin(phase), a, b) for size, phase, r, a, b in made.sources]
    g, drive, *ends = (np.array(item) for item in zip(*linear, strict=True))
    i_s, *steep = (np.array(item) for item in zip(*made.diodes, strict=True))
    (p, q), (c, d) = ([place[end.astype(int)] for end in both] for both in (ends, steep))
    plus, minus, z = np.concatenate([p, c]), np.concatenate([q, d]), np.zeros(place.max() + 1)

    def content(z):
        across, junction = z[p] - z[q] - drive, z[c] - z[d]
        with np.errstate(over="ignore"):
            return g @ across**2 / 2.0 + i_s @ (VT * np.expm1(junction / VT) - junction)

    for _ in range(20_000):
        junction = np.minimum((z[c] - z[d]) / VT, 700.0)
        flow = np.append(g * (z[p] - z[q] - drive), i_s * np.expm1(junction))
        slope = np.append(g, i_s * np.maximum(np.exp(junction), FAINT) / VT)
        shared, into = np.zeros((z.size, z.size)), np.zeros(z.size)
        for a, b, sign in ((plus, minus, 1.0), (minus, plus, -1.0)):
            np.add.at(shared, (a, b), slope)
            np.add.at(into, a, -sign * flow)
        np.fill_diagonal(shared, 0.0)
        step, now = np.append(0.0, without_subtraction(shared[1:, 1:], shared[0, 1:], into[1:])), content(z)
        while content(z + step) > now + 1e-13 * abs(now) and np.abs(step).max() > VT:
            step *= 0.5
        z = z + step
        if np.abs(step).max() < 1e-11:
            return z[place]
    return None
