"""Random networks of electrical, translational and rotational parts, as a Net and as a Tableau."""

import numpy as np
from networks import ELECTRICAL, ROTATION, TRANSLATION, Net, Tableau, unrolled
from sysdyn.dsl.model import expression as x
from sysdyn.dsl.model.evaluation import evaluate


class Sketch:
    """Elements without a form: (name, kind, value, plus, minus), nodes by domain, two-ports."""

    def __init__(self, rng):
        self.rng = rng
        self.nodes, self.elements, self.couplings, self.read = [], [], [], set()

    def value(self):
        return float(self.rng.uniform(0.5, 2.0))

    def pick(self, items):
        return items[self.rng.integers(len(items))]

    def new_node(self, domain):
        name = f"{domain.name[0]}{len(self.nodes)}"
        self.nodes.append((name, domain))
        return name

    def element(self, kinds, plus, minus):
        if self.rng.random() < 0.5 and not (plus is None or minus is None):
            plus, minus = minus, plus
        name = f"{self.pick(kinds)}{len(self.elements)}"
        self.elements.append((name, name[0], self.value(), plus, minus))

    def circuit(self, grounded, size):
        """A connected graph: a tree, chords, edges that are split in series, dead ends."""
        kinds = "RRRLLCC"
        own = [None] if grounded else [self.new_node(ELECTRICAL)]
        for _ in range(size):
            fresh = self.new_node(ELECTRICAL)
            self.chain(kinds, fresh, self.pick(own), int(self.rng.integers(1, 4)))
            own.append(fresh)
        for _ in range(int(self.rng.integers(1, size + 2))):
            a, b = self.pick(own), self.pick(own)
            if a != b:
                self.chain(kinds, a, b, int(self.rng.integers(1, 4)))
        if self.rng.random() < 0.4 and grounded:
            self.chain("VR", self.pick(own[1:]), None, 2)
        if self.rng.random() < 0.3 and len(own) > 2:
            self.element("I", own[-1], own[1])
        return own

    def chain(self, kinds, a, b, length):
        """Branches in series from a to b."""
        for k in range(length):
            after = b if k == length - 1 else self.new_node(ELECTRICAL)
            self.element(kinds, a, after)
            a = after

    def mechanism(self, domain, size):
        """Masses, springs and dampers; every node has a mass or a damper."""
        own = [None]
        for _ in range(size):
            fresh = self.new_node(domain)
            self.element("L" if self.rng.random() < 0.8 else "R", fresh, None)
            self.element("CCR", fresh, self.pick(own))
            own.append(fresh)
        for _ in range(int(self.rng.integers(0, size + 1))):
            a, b = self.pick(own), self.pick(own)
            if a != b:
                self.element("CR", a, b)
        return own

    def two_ports(self, parts, number):
        for k in range(number):
            ends = []
            for _ in range(2):
                own = self.pick(parts)
                a, b = self.pick(own), self.pick(own)
                ends.append((a, b))
            if all(a != b for a, b in ends):
                kind = self.pick(("transformer", "gyrator"))
                ratio = float(self.rng.choice((-1.0, 1.0))) * self.value()
                self.couplings.append((kind, f"X{k}", ratio, *ends))

    def domain_of(self, ends):
        domains = dict(self.nodes)
        return next(domains[n] for n in ends if n is not None)

    def net(self):
        found = Net()
        for name, domain in self.nodes:
            found.node(name, domain)
        for name, kind, value, plus, minus in self.elements:
            getattr(found, kind)(name, value, plus, minus, of=self.domain_of((plus, minus)))
        for kind, name, ratio, first, second in self.couplings:
            of = (self.domain_of(first), self.domain_of(second))
            found.couple(kind, name, ratio, first, second, of=of)
        found.read = self.read
        return found

    def tableau(self):
        found = Tableau()
        for name, kind, value, plus, minus in self.elements:
            found.element(name, kind, value, plus, minus, self.domain_of((plus, minus)).common)
        for kind, name, ratio, first, second in self.couplings:
            for k, ends in enumerate((first, second)):
                found.element(f"{name}.{k + 1}", "port", 0.0, *ends, self.domain_of(ends).common)
            found.couple(kind, ratio, f"{name}.1", f"{name}.2")
        return found


def sketch(seed):
    """A random network whose tableau is regular."""
    rng = np.random.default_rng(seed)
    while True:
        found = Sketch(rng)
        parts = []
        for _ in range(int(rng.integers(0, 3))):
            parts.append(found.circuit(bool(rng.random() < 0.7), int(rng.integers(1, 5))))
        for domain in (TRANSLATION, ROTATION):
            if rng.random() < 0.5 or not parts:
                parts.append(found.mechanism(domain, int(rng.integers(1, 4))))
        found.two_ports(parts, int(rng.integers(0, 4)))
        common = [n for n, d in found.nodes if d is ELECTRICAL]
        found.read = {n for n in common if rng.random() < 0.1}
        if found.tableau().regular():
            return found


class Arrays:
    """Random statements over loops: chains, ladders, taps, buses, grids; some of them unusual."""

    def __init__(self, seed):
        self.rng = rng = np.random.default_rng(seed)
        self.sizes = {"n": int(rng.integers(3, 7)), "m": int(rng.integers(2, 4)), "k": 2}
        self.net = Net()
        n, m, k = (x.param(name) for name in "nmk")
        self.families = {"a": (), "b": (), "v": ((0, n),), "w": ((1, n),), "z": ((1, n),), "u": ((1, n), (1, m))}
        self.hubs = [(), (x.const(0),), (n,), (k,), (x.const(1),)]
        for name, shape in self.families.items():
            self.net.node(name, ELECTRICAL, *shape)
        for number in range(int(rng.integers(3, 9))):
            self.statement(number)

    def pick(self, items):
        return items[self.rng.integers(len(items))]

    def numeric(self, node, at):
        look = {**self.sizes, **at}
        return round(evaluate([node if isinstance(node, x.Node) else x.const(node)], lambda n: look[n.data])[0])

    def statement(self, number):
        """One branch statement that stays inside its node families."""
        rng, n, m, k = self.rng, x.param("n"), x.param("m"), x.param("k")
        depth = int(rng.choice((0, 1, 1, 1, 1, 2)))
        along = self.pick([(1, n), (2, n), (1, x.sub(n, x.const(1))), (k, n), (1, k)])
        loops = (("i", *along), ("j", 1, m))[:depth]
        if rng.random() < 0.1 and depth:
            loops = (("i", 1, n), ("j", 2, m))[:depth]
        ends = []
        for _ in range(40):
            ends = [self.terminal(depth), self.terminal(depth)]
            if ends[0] != ends[1] and any(e is not None for e in ends) and all(self.inside(e, loops) for e in ends):
                break
        else:
            return
        if rng.random() < 0.15 and ends[0] is not None:
            ends[1] = None
        kind = self.pick("RRRLCV" if depth == 0 else "RRRLC")
        if ends[0] is None:
            ends.reverse()
        value = x.const(float(rng.uniform(0.5, 2.0)))
        if depth:
            value = x.mul(value, x.linear(1.0, ((0.3, x.index("i")),)))
        if kind == "V":
            value = x.time()
        getattr(self.net, kind)(f"{kind}{number}", value, *ends, loops=loops)

    def terminal(self, depth):
        rng = self.rng
        if rng.random() < 0.12:
            return None
        i = x.add(x.index("i"), x.const(int(rng.choice((-1, 0, 0, 1)))))
        j = x.add(x.index("j"), x.const(int(rng.choice((-1, 0, 0)))))
        name = self.pick("abvwz" if depth < 2 else "vwuuuu") if depth else self.pick("abvwu")
        if name in "ab":
            return name
        fixed = self.pick([x.const(1), x.param("n"), x.param("k")])
        if name == "u":
            if depth == 2:
                return (name, i, j)
            return (name, i if depth else fixed, self.pick([x.const(1), x.param("m")]))
        return (name, i if depth and rng.random() < 0.85 else fixed)

    def inside(self, end, loops):
        if end is None or isinstance(end, str):
            return True
        name, *at = end
        for k, node in enumerate(at):
            low, high = (self.numeric(b, {}) for b in self.families[name][k])
            for side in (1, 2):
                values = {loop[0]: self.numeric(loop[side], {}) for loop in loops}
                if not low <= self.numeric(node, values) <= high:
                    return False
        return True


def arrays(seed):
    """Random statements over loops with a regular tableau; inside an expression block."""
    for k in range(200):
        found = Arrays((seed, k))
        if found.net.branches and unrolled(found.net, **found.sizes).regular():
            return found
    raise AssertionError(seed)
