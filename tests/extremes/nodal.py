"""Random rectifiers of one or three phases and their node potentials by other equations.

Modified nodal analysis, A x' + G x + B i(B' x) = s(t), with x the potentials, the currents of sources and of coils
(index 1 or 2), by Radau IIA of three stages (Hairer and Wanner, Solving Ordinary Differential Equations II, IV.8);
Newton's steps are limited at the junctions (Nagel, SPICE2, 1975).  No word of sysdyn in it.
"""

from dataclasses import dataclass, field

import numpy as np

VT = 0.02585
LEAK = 1e-10
"""Conductance (S) beside every diode: what is traced does not feel it, and blocked nets stay regular."""
MOST = 40_000
"""Iterations of Newton's method after which a run is given up."""
S6 = np.sqrt(6.0)
NODES = np.array([(4.0 - S6) / 10.0, (4.0 + S6) / 10.0, 1.0])
STAGES = np.array([
    [(88 - 7 * S6) / 360, (296 - 169 * S6) / 1800, (-2 + 3 * S6) / 225],
    [(296 + 169 * S6) / 1800, (88 + 7 * S6) / 360, (-2 - 3 * S6) / 225],
    [(16 - S6) / 36, (16 + S6) / 36, 1 / 9],
])  # fmt: skip
INVERSE = np.linalg.inv(STAGES)


@dataclass
class Circuit:
    """Branches (label, value, plus, minus) by names of nodes; a source's value is (amplitude, phase) and a battery's
    (voltage, pi / 2) at no frequency.
    """

    frequency: float
    ground: str = "ground"
    branches: dict = field(default_factory=lambda: {kind: [] for kind in "RCLDVE"})
    said: dict = field(default_factory=dict)

    def add(self, kind, value, a, b, init=None):
        label = f"{kind}{len(self.branches[kind])}"
        self.branches[kind].append((label, value, a, b))
        if init is not None:
            self.said[label] = init
        return label

    @property
    def nodes(self):
        seen = dict.fromkeys(n for listed in self.branches.values() for *_, a, b in listed for n in (a, b))
        return [n for n in seen if n != "ground"]

    def text(self, accuracy, end, rows=100, level=""):
        """The model up to `end` [s]; effort of every branch and current of every coil are traced by its label."""
        made = {
            "R": lambda v: f"resistor(R = {v!r} ohm)",
            "C": lambda v: f"capacitor(C = {v!r} F)",
            "L": lambda v: f"inductor(L = {v!r} H)",
            "D": lambda v: f"diode{level}" + ("" if level else f"(Is = {v!r} A, vT = {VT!r} V)"),
            "V": lambda v: f"voltage(v = {v[0]!r} V*sin(2*pi*{self.frequency!r} Hz*t + {v[1]!r}))",
            "E": lambda v: f"voltage(v = {v!r} V)",
        }
        lines = [f"node {', '.join(self.nodes)}: electrical"]
        for kind, listed in self.branches.items():
            lines += [f"{label}: {made[kind](value)} {a} -> {b}" for label, value, a, b in listed]
        lines += [
            f"init {label}.{'e' if label[0] == 'C' else 'f'} = {v!r} {'V' if label[0] == 'C' else 'A'}"
            for label, v in self.said.items()
        ]
        traced = [f"{label}.e as {label}" for k in "RC" for label, *_ in self.branches[k]]
        traced += [f"{label}.f as {label}" for label, *_ in self.branches["L"]]
        body = "\n  ".join(lines)
        return f"""from std.electrical import diode, voltage, capacitor, resistor, inductor
model rectifier {{
  {body}
}}
scene run of rectifier {{
  time 0 s to {end!r} s
  trace {", ".join(traced)} every {end / rows!r} s
  accuracy {accuracy}
}}
"""

    def drawn(self):
        """The text's elements in one line."""
        return "; ".join(f"{l} {a}-{b} {v}" for listed in self.branches.values() for l, v, a, b in listed)


def rectifier(seed):
    """One of the measured family: phases 1 or 3, in each a resistor, a coil or both; a load; earthed or floating."""
    random = np.random.default_rng(seed)
    made = Circuit(float(f"{50.0 * 10.0 ** random.uniform(0, 1):.4g}"))

    def drawn(low, high, unit=1.0):
        return float(f"{unit * 10.0 ** random.uniform(low, high):.4g}")

    phases = int(random.choice([1, 3]))
    inner = str(random.choice(["R", "L", "RL"]))
    load = str(random.choice(["R", "RC", "RL", "RLC", "RE"]))
    earthed = str(random.choice(["source", "load", "floating"]))
    kind = str(random.choice(["bridge", "bridge", "half"]))
    free = bool(random.random() < 0.5)
    size, alike = drawn(0.7, 2.3), bool(random.random() < 0.5)
    of_coil, of_resistor, i_s = drawn(-2, 0, 1.0 / made.frequency), drawn(-1, 1), drawn(-13, -9)
    star = "ground" if earthed == "source" else "star"
    minus = "ground" if earthed == "load" else "m" if kind == "bridge" or earthed == "floating" else star
    if kind == "half":
        minus = star
    ends = [f"a{k}" for k in range(phases)]
    for k, end in enumerate(ends):
        last = f"s{k}"
        made.add("V", (size, round(2 * np.pi / 3 * k + 0.3, 4)), last, star)
        for position, item in enumerate(inner):
            nxt = end if position == len(inner) - 1 else f"x{k}"
            if item == "R":
                made.add("R", of_resistor if alike else drawn(-1, 1), last, nxt)
            else:
                value = of_coil if alike else drawn(-2, 0, 1.0 / made.frequency)
                made.add("L", value, last, nxt, None if free else 0.0)
            last = nxt
    if kind == "bridge" and phases == 1:
        ends.append(star)
    for end in ends:
        made.add("D", i_s if alike else drawn(-13, -9), end, "p")
        if kind == "bridge":
            made.add("D", i_s if alike else drawn(-13, -9), minus, end)
    out = "p"
    if load in ("RL", "RLC"):
        out = "q"
        made.add("L", drawn(-1, 1, 1.0 / made.frequency), "p", out, None if free else 0.0)
    if load in ("RC", "RLC"):
        made.add("C", drawn(-1, 1, 1e-2 / made.frequency), out, minus, 0.0)
    if load == "RE":
        made.add("E", 0.5 * size, "b", minus)
        minus = "b"
    made.add("R", drawn(1, 3), out, minus)
    if "ground" not in (star, minus):
        made.ground = minus
    made.kind = f"{phases}{kind} {inner} {load} {earthed} {'free' if free else 'held'}"
    return made


class Nodal:
    """The equations of a circuit: x = potentials, currents of V, E and L."""

    def __init__(self, circuit, vt=VT):
        self.circuit, self.vt = circuit, vt
        names = [n for n in dict.fromkeys(["ground", *circuit.nodes]) if n != circuit.ground]
        if not any("ground" in (a, b) for listed in circuit.branches.values() for *_, a, b in listed):
            names = [n for n in names if n != "ground"]
        self.place = {name: k for k, name in enumerate(names)}
        sources = circuit.branches["V"] + circuit.branches["E"]
        n, at = len(names), len(names)
        size = n + len(sources) + len(circuit.branches["L"])
        self.a, self.g, self.rows = np.zeros((size, size)), np.zeros((size, size)), {}
        for _, value, *ends in circuit.branches["R"]:
            d = self.across(*ends, size)
            self.g += np.outer(d, d) / value
        for label, value, *ends in circuit.branches["C"]:
            d = self.across(*ends, size)
            self.a += value * np.outer(d, d)
            self.rows[label] = d
        for label, value, *ends in sources + circuit.branches["L"]:
            d = self.across(*ends, size)
            self.g[:, at] += d
            self.g[at] += d
            if label[0] == "L":
                self.a[at, at] = -value
            self.rows[label] = at
            at += 1
        self.b = np.array([self.across(*ends, size) for _, _, *ends in circuit.branches["D"]]).reshape(-1, size)
        self.i_s = np.array([value for _, value, *_ in circuit.branches["D"]])
        self.size, self.most, self.taken = size, 0.0, 0

    def across(self, a, b, size=None):
        d = np.zeros(size or self.size)
        for node, sign in ((a, 1.0), (b, -1.0)):
            if node in self.place:
                d[self.place[node]] += sign
        return d

    def drive(self, t):
        s = np.zeros(self.size)
        for label, (amp, phase), *_ in self.circuit.branches["V"]:
            s[self.rows[label]] = amp * np.sin(2 * np.pi * self.circuit.frequency * t + phase)
        for label, value, *_ in self.circuit.branches["E"]:
            s[self.rows[label]] = value
        return s

    def currents(self, u):
        """Of the diodes at junction voltages, and their slopes."""
        e = np.exp(np.minimum(u / self.vt, 600.0))
        return self.i_s * (e - 1.0) + LEAK * u, self.i_s * e / self.vt + LEAK

    def limited(self, new, old):
        """Junction voltages at which the laws are taken next (SPICE's pnjlim)."""
        critical = self.vt * np.log(self.vt / (np.sqrt(2.0) * self.i_s))
        far = (new > critical) & (np.abs(new - old) > 2.0 * self.vt)
        arg = 1.0 + (new - old) / self.vt
        with np.errstate(invalid="ignore", divide="ignore"):
            up = np.where(arg > 0.0, old + self.vt * np.log(np.where(arg > 0, arg, 1.0)), critical)
            first = self.vt * np.log(np.maximum(new, 1e-300) / self.vt)
        return np.where(far, np.where(old > 0.0, up, first), new)

    def stages(self, t, h, x, guess, u, scale=1.0):
        """Stage values [3, n] of one step and their junction voltages, or None."""
        s, n = 3, self.size
        big = np.kron(INVERSE / h, self.a) + np.kron(np.eye(s), self.g)
        right = scale * np.concatenate([self.drive(t + c * h) for c in NODES])
        right = right + np.kron((INVERSE / h).sum(axis=1), self.a @ x)
        z, u = guess.ravel().copy(), u.copy()
        for _ in range(60):
            i, slope = self.currents(u)
            matrix, side = big.copy(), right.copy()
            for k in range(s):
                block = slice(k * n, (k + 1) * n)
                matrix[block, block] += (self.b.T * slope[k]) @ self.b
                side[block] -= self.b.T @ (i[k] - slope[k] * u[k])
            size = 1.0 / np.maximum(np.abs(matrix).max(axis=1), 1e-300)
            try:
                new = np.linalg.solve(matrix * size[:, None], side * size)
            except np.linalg.LinAlgError:
                return None
            junction = new.reshape(s, n) @ self.b.T
            u_new = self.limited(junction, u)
            unlinear = np.abs(self.currents(u_new)[0] - i - slope * (junction - u)).max(initial=0.0)
            done = np.all(u_new == junction) and unlinear <= 1e-11 + 1e-8 * max(self.most, np.abs(i).max(initial=0.0))
            z, u = new, u_new
            if not np.isfinite(z).all():
                return None
            self.taken += 1
            if done:
                self.most = max(self.most, np.abs(self.currents(u_new)[0]).max(initial=0.0))
                return z.reshape(s, n), u
        return None

    def start(self):
        """x just behind 0, where capacitors held no voltage and coils no current: of a step that moves neither."""
        for part in (1e-7, 1e-6, 1e-5):
            h, x, u, found = part / self.circuit.frequency, np.zeros(self.size), np.zeros((3, self.i_s.size)), None
            for scale in (0.0, 0.01, 0.1, 0.3, 0.6, 1.0):  # the sources grow
                guess = np.zeros((3, self.size)) if found is None else found[0]
                found = self.stages(0.0, h, x, guess, u, scale)
                if found is None:
                    break
                u = found[1]
            if found is not None:
                return h, found[0][-1]
        return 0.0, None

    def run(self, times, tol=1e-7, cap=1 / 200):
        """x at instants [times, n], or None where it stops."""
        (t, x), longest = self.start(), cap / self.circuit.frequency
        if x is None:
            return None
        state = np.abs(self.a).max(axis=0) > 0.0
        branches = self.circuit.branches
        amplitude = sum(abs(v[0]) for _, v, *_ in branches["V"]) + sum(abs(v) for _, v, *_ in branches["E"])
        size = np.full(self.size, 0.01 * amplitude)
        size[len(self.place) :] /= max([v for _, v, *_ in branches["R"]], default=1.0)
        h, poly, rows = 1e-4 * longest, None, []
        due = list(times)
        while due and due[0] <= 0.0:
            rows.append(x)
            due.pop(0)
        while due:
            h = min(h, longest)
            step = min(h, due[0] - t) if due[0] - t < 1.5 * h else h
            if step < 1e-16 / self.circuit.frequency or self.taken > MOST:
                return None
            guess = np.tile(x, (3, 1)) if poly is None else np.array([poly(t + c * step) for c in NODES])
            found = self.stages(t, step, x, guess, guess @ self.b.T)
            if found is None:
                found = self.stages(t, step, x, np.tile(x, (3, 1)), np.tile(self.b @ x, (3, 1)))
            if found is None:
                h = step / 4
                continue
            z = found[0]
            # two half steps of backward differentiation would be dearer: the stages against the polynomial before
            size = np.maximum(size, np.abs(z).max(axis=0))
            error = 0.0
            if poly is not None:
                apart = np.abs(self.a @ (poly(t + step) - z[-1]))
                stored = np.abs(self.a) @ size + 1e-30
                error = float((apart / stored)[state].max(initial=0.0)) / 30.0
            if error > tol and step > 1e-12 / self.circuit.frequency:
                h = step * max(0.2, 0.8 * (tol / error) ** 0.25)
                continue
            at = np.concatenate([[t], t + NODES * step])
            values = np.vstack([x, z])

            def poly(when, at=at, values=values):
                w = [np.prod([(when - at[j]) / (at[i] - at[j]) for j in range(4) if j != i]) for i in range(4)]
                return np.array(w) @ values

            t, x = t + step, z[-1]
            while due and abs(due[0] - t) <= 1e-12 * due[-1]:
                rows.append(x)
                due.pop(0)
            h = max(h, step) * min(2.0, 0.8 * (tol / max(error, 1e-30)) ** 0.25) if error else 2.0 * h
        return np.array(rows)

    def traced(self, x):
        """label -> values, as `Circuit.text` traces."""
        found = {}
        for kind in "RC":
            for label, _, *ends in self.circuit.branches[kind]:
                found[label] = x @ self.across(*ends)
        for label, *_ in self.circuit.branches["L"]:
            found[label] = x[:, self.rows[label]]
        return found
