"""Random models of several parts, coupled one way, both ways or not at all, with random traces.

Circuits, trains of masses, points with coordinates, controllers, implicit unknowns; transactors, forces and states that
read other parts; gyrators, springs and resistors between parts; energies whose one statement spans islands; dead ends.
Every scale is near one, so that no part is stiff and all run at the same accuracy; every store has a written start, for
what a search finds for unwritten ones is another matter.
"""

import numpy as np

HEAD = """
from std.electrical import resistor, capacitor, inductor, voltage, current
from std.mechanical import mass, spring, damper, force
model random {
"""


class Sketch:
    """Statements, and what can be read (made dimensionless) and traced."""

    def __init__(self, seed):
        self.rng = np.random.default_rng(seed)
        self.lines, self.reads, self.traced, self.number = [], [], [], 0
        self.wires, self.points, self.coordinates = [], [], False

    def chance(self, share):
        return self.rng.random() < share

    def pick(self, items):
        return items[self.rng.integers(len(items))]

    def value(self):
        return f"{self.rng.uniform(0.5, 2.0):.3f}"

    def fresh(self, letter):
        self.number += 1
        return f"{letter}{self.number}"

    def say(self, *lines):
        self.lines += [f"  {line}" for line in lines]

    def readable(self, text, unit):
        self.reads.append(f"{text}/(1 {unit})" if unit else text)
        self.traced.append(text)

    def signal(self):
        """A bounded number that moves in time, or that reads another part."""
        if self.reads and self.chance(0.75):
            return f"tanh({self.pick(self.reads)} - {self.value()})"
        return f"sin({self.value()}*t/(1 s))"

    def circuit(self):
        nodes = [self.fresh("n") for _ in range(int(self.rng.integers(1, 4)))]
        self.say(f"node {', '.join(nodes)}: electrical")
        source, first = self.fresh("n"), nodes[0]
        if self.chance(0.5):
            self.say(f"node {source}: electrical", f"V{source}: voltage(v = 1 V*{self.signal()}) {source} -> ground")
            self.say(f"R{source}: resistor(R = {self.value()} ohm) {source} -> {first}")
        else:
            self.say(f"I{first}: current(i = 1 A*{self.signal()}) ground -> {first}")
        for k, node in enumerate(nodes):
            self.say(f"C{node}: capacitor(C = {self.value()} F) {node} -> ground", f"init {node}.e = {self.value()} V")
            self.say(f"G{node}: resistor(R = {self.value()} ohm) {node} -> {self.pick([*nodes[:k], 'ground'])}")
            if self.chance(0.3):
                self.say(f"L{node}: inductor(L = {self.value()} H) {node} -> ground", f"init L{node}.f = 0 A")
                self.readable(f"L{node}.f", "A")
            self.readable(f"{node}.e", "V")
        self.wires += nodes

    def mechanism(self):
        nodes = [self.fresh("x") for _ in range(int(self.rng.integers(1, 4)))]
        self.say(f"node {', '.join(nodes)}: translation")
        for k, node in enumerate(nodes):
            other = self.pick([*nodes[:k], "ground"])
            self.say(f"M{node}: mass(m = {self.value()} kg) {node}")
            self.say(f"K{node}: spring(k = {self.value()} N/m) {node} -> {other}")
            self.say(f"B{node}: damper(b = 0.3 N.s/m) {node} -> {other}")
            self.say(f"init {node}.f = {self.value()} m/s", f"init {node}.q = {self.value()} m")
            self.readable(f"{node}.f", "m/s")
        self.say(f"F{nodes[0]}: force(F = 1 N*{self.signal()}) ground -> {nodes[0]}")
        self.points += nodes

    def particles(self):
        """Points with coordinates: one T* for all, springs, constraints and works for some."""
        names = [self.fresh("q") for _ in range(int(self.rng.integers(2, 5)))]
        self.coordinates = True
        for name in names:
            self.say(f"coord {name}: translation = {self.value()} m")
            self.say(f"init {name}' = 0 m/s", f"energy V = 1/2*({self.value()} N/m)*{name}^2")
            self.say(f"content D = 1/2*(0.2 N.s/m)*{name}'^2")
            self.readable(name, "m")
        squares = " + ".join(f"{name}'^2" for name in names)
        self.say(f"energy T* = 1/2*({self.value()} kg)*({squares})")
        if self.chance(0.5):
            a, b = names[:2]
            self.say(f"energy V = 1/2*({self.value()} N/m)*({a} - {b})^2")
        if self.chance(0.5):
            self.say(f"work ({self.value()} N)*{self.signal()} on {names[-1]}")

    def controller(self):
        name = self.fresh("s")
        self.say(f"state {name}: 1 = 0", f"dynamic {name}' = ({self.signal()} - {name})/({self.value()} s)")
        self.readable(name, "")

    def unknown(self):
        """An implicit force, a function of others, that may act on a point."""
        name, read = self.fresh("u"), self.signal()
        self.say(f"implicit {name}: N ~ 0 N", f"gamma g{name}: {name} + {name}^3/(1 N^2) = 1 N*{read}")
        self.readable(name, "N")
        if self.points and self.chance(0.7):
            self.say(f"W{name}: force(F = {name}) ground -> {self.pick(self.points)}")

    def bridges(self):
        """Couplings both ways between parts, and dead ends."""
        if len(self.wires) > 1 and self.chance(0.4):
            a, b = self.rng.choice(self.wires, 2, replace=False)
            self.say(f"Rb: resistor(R = {self.value()} ohm) {a} -> {b}")
        if len(self.points) > 1 and self.chance(0.3):
            a, b = self.rng.choice(self.points, 2, replace=False)
            self.say(f"Kb: spring(k = {self.value()} N/m) {a} -> {b}")
        if self.wires and self.points and self.chance(0.4):
            a, b = self.pick(self.wires), self.pick(self.points)
            self.say("node mid: electrical", f"Rg: resistor(R = {self.value()} ohm) {a} -> mid")
            self.say(f"Gb: gyrator(e1 = ({self.value()} V.s/m)*f2) mid -> ground, {b} -> ground")
        if self.wires and self.chance(0.4):
            self.say("node open: electrical", f"Rd: resistor(R = {self.value()} ohm) {self.pick(self.wires)} -> open")
            self.say("state probe: V = 0 V", "dynamic probe' = (open.e - probe)/(1 s)")
            self.traced.append("probe")
        if self.points and self.chance(0.4):
            self.say("node loose: translation")
            self.say(f"Kd: spring(k = {self.value()} N/m) {self.pick(self.points)} -> loose")


def text(seed):
    """A model and its scene, and whether it is a network alone."""
    sketch = Sketch(seed)
    kinds = [sketch.circuit, sketch.mechanism, sketch.controller, sketch.unknown]
    kinds += [sketch.particles] if sketch.chance(0.5) else []
    for _ in range(int(sketch.rng.integers(2, 6))):
        sketch.pick(kinds)()
    if not sketch.wires and not sketch.points and not sketch.coordinates:
        sketch.mechanism()
    sketch.bridges()
    count = min(len(sketch.traced), int(sketch.rng.integers(1, 3)))
    names = [str(n) for n in sketch.rng.choice(sketch.traced, count, replace=False)]
    scene = f"scene s of random {{\n  time 0 s to 5 s\n  trace {', '.join(names)}\n}}\n"
    return "\n".join([HEAD.strip("\n"), *sketch.lines, "}", scene]), not sketch.coordinates
