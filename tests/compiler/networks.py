"""Networks of nodes and branches for tests, without text; and their poles by way of the oracle."""

import itertools
import types

import numpy as np
from catalogue import ONE, PLACE
from chains import blank, parameter
from sysdyn.compiler.binding.oracle import Oracle
from sysdyn.compiler.pipeline import compile_network
from sysdyn.dsl.model import expression as x
from sysdyn.dsl.model.calculus import derivative
from sysdyn.dsl.model.evaluation import evaluate
from sysdyn.dsl.model.network import (
    Branch,
    Coupling,
    Domain,
    InitialCondition,
    Loop,
    NodeFamily,
    Observation,
    Terminal,
)


def domain(name, common, pseudo=False):
    return Domain(name, ONE, ONE, ONE, ONE, common, pseudo, PLACE)


ELECTRICAL, HYDRAULIC = domain("electrical", "effort"), domain("hydraulic", "effort")
TRANSLATION, ROTATION = domain("translation", "flow"), domain("rotation", "flow")
HEAT = domain("heat", "effort", True)


def of(name, kind, *at):
    return x.var(name, kind, *at)


def node(value):
    return value if isinstance(value, x.Node) else x.const(value)


def ranges(loops):
    return tuple(Loop(name, node(first), node(last)) for name, first, last in loops)


class Net:
    """Collects nodes and branches; `network()` is the value that the front end would hand over."""

    def __init__(self):
        self.nodes, self.branches, self.couplings, self.parts = {}, [], [], {}
        self.read = set()

    def node(self, name, of=ELECTRICAL, *shape):
        self.nodes[name] = NodeFamily(name, tuple((node(a), node(b)) for a, b in shape), of, PLACE)

    def terminal(self, where):
        if where is None:
            return Terminal(None, ())
        name, *at = where if isinstance(where, tuple) else (where,)
        return Terminal(name, tuple(map(node, at)))

    def branch(self, name, kind, side, law, plus, minus=None, *, loops=(), at=None, of=None, on=None):
        """law: of the branch's own variable (f of kinetic p, q of potential e, ...), or a node."""
        at = tuple(map(node, at)) if at is not None else tuple(x.index(n) for n, _, _ in loops)
        own = {"p": "bf", "f": "bp" if kind == "kinetic" else "be", "e": "bf", "q": "be"}.get(side)
        own = "bq" if (kind, side) == ("potential", "e") else own
        if callable(law):
            law = law(x.var(name, own, *at))
        elif law is not None:
            law = node(law)
        ends = (None, None) if on is not None else (self.terminal(plus), self.terminal(minus))
        touched = [e.node for e in ends if e is not None and e.node]
        of = of or self.nodes[touched[0]].domain
        self.branches.append(Branch(name, at, ranges(loops), of, kind, side, law, *ends, on, PLACE))

    def R(self, name, value, plus, minus=None, **more):
        self.branch(name, "dissipator", "e", lambda f: x.mul(node(value), f), plus, minus, **more)

    def L(self, name, value, plus, minus=None, **more):
        self.branch(name, "kinetic", "p", lambda f: x.mul(node(value), f), plus, minus, **more)

    def C(self, name, value, plus, minus=None, **more):
        self.branch(name, "potential", "q", lambda e: x.mul(node(value), e), plus, minus, **more)

    def V(self, name, value, plus, minus=None, **more):
        self.branch(name, "effort", "e", value, plus, minus, **more)

    def I(self, name, value, plus, minus=None, **more):  # noqa: E743, RUF100
        self.branch(name, "flow", "f", value, plus, minus, **more)

    def couple(self, kind, name, ratio, first, second, side="f", of=(None, None), loops=()):
        """A two-port `name` with branches name.1 and name.2 between pairs of nodes."""
        for k, (ends, own) in enumerate(zip((first, second), of, strict=True)):
            self.branch(f"{name}.{k + 1}", "port", None, None, *ends, of=own, loops=loops)
        at = tuple(x.index(n) for n, _, _ in loops)
        side = "e" if kind == "gyrator" else side
        pair = (f"{name}.1", f"{name}.2")
        self.couplings.append(Coupling(kind, *pair, at, ranges(loops), side, node(ratio), PLACE))

    def network(self, **parts):
        watched = [Observation(text, n, ONE, text, PLACE) for text, n in parts.pop("observe", {}).items()]
        sizes = tuple(parameter(n, v, whole=n in ("n", "m", "k")) for n, v in parts.pop("params", {}).items())
        start = tuple(
            InitialCondition(target, node(value), True, ranges(loops), PLACE)
            for target, value, *loops in parts.pop("init", ())
        )
        return blank(
            parameters=sizes,
            observations=tuple(watched),
            initials=start,
            nodes=tuple(self.nodes.values()),
            branches=tuple(self.branches),
            couplings=tuple(self.couplings),
            read=frozenset(self.read),
            **parts,
        )


def compiled(network, formulation="lagrangian", backend="numpy"):
    return compile_network(network, formulation, backend)


ROWS = ("dynamics", "phi_reaction", "psi_reaction", "momentum", "phi", "psi", "gamma", "lambda")


def pencil(model, binding=None, y=None):
    """dF/dy, dF/dyd of the form as written at rest, q' = f included, and the oracle."""
    oracle = Oracle(model.form, binding or model.bind())
    audit = next(k for k, f in enumerate(model.form.families) if f.kind == "audit")
    n, m = int(oracle.at[audit]), int(oracle.to[-1])
    size = int(oracle.at[-1])
    y = np.zeros(size) if y is None else np.concatenate((y, np.zeros(size - len(y))))
    matrices = []
    for order in (0, 1):
        a = np.zeros((m, n))
        for block in ROWS:
            v, r, c = oracle.entries(block, order, 0.0, y, np.zeros(size))
            np.add.at(a, (r.astype(int), c.astype(int)), v)
        matrices.append(a)
    used = [
        np.arange(oracle.to[k], oracle.to[k + 1])
        for k, r in enumerate(model.form.rows)
        if r.block in ("dynamics", "momentum", "phi", "psi", "gamma", "lambda")
    ]
    a, e = (matrix[np.concatenate(used)] for matrix in matrices)
    for q, f in kinematics(model.form, oracle):
        row, rate = np.zeros(n), np.zeros(n)
        rate[q], row[f] = 1.0, -1.0
        a, e = np.vstack((a, row)), np.vstack((e, rate))
    return a, e, oracle


def kinematics(form, oracle):
    place = {(f.owner, f.kind): k for k, f in enumerate(form.families)}
    for (owner, kind), k in place.items():
        if kind == "q":
            j = place[owner, "f"]
            yield from zip(range(oracle.at[k], oracle.at[k + 1]), range(oracle.at[j], oracle.at[j + 1]), strict=True)


SMALLEST, LARGEST = 1e-3, 1e3  # zero and infinite poles are not compared: how many there are is a form's own affair


def finite_poles(a, e, shift=0.37):
    """s with det(a + s e) = 0, by the inverse of the pencil at a shift."""
    assert a.shape[0] == a.shape[1], a.shape
    mu = np.linalg.eigvals(np.linalg.solve(a + shift * e, e))
    with np.errstate(divide="ignore", invalid="ignore"):
        s = shift - 1.0 / mu
    return s[np.isfinite(s) & (np.abs(s) < LARGEST) & (np.abs(s) > SMALLEST)]


def poles(model, binding=None):
    a, e, _ = pencil(model, binding)
    return finite_poles(a, e)


def constraint_rank(model):
    """(rank, rows) of the constraints' Jacobian: phi by q, psi by f, both by the coordinate."""
    oracle = Oracle(model.form, model.bind())
    size = int(oracle.at[-1])
    y = np.zeros(size)
    column, place = {}, {(f.owner, f.kind): k for k, f in enumerate(model.form.families)}
    for k, f in enumerate(model.form.families):
        if f.kind in ("q", "f"):
            j = place[f.owner, "f"]
            for i in range(oracle.at[k + 1] - oracle.at[k]):
                column[oracle.at[k] + i] = oracle.at[j] + i
    total = np.zeros((int(oracle.to[-1]), size))
    for block, kind in (("phi", "q"), ("psi", "f")):
        v, r, c = oracle.entries(block, 0, 0.0, y, y)
        kinds = {int(i): f.kind for k, f in enumerate(model.form.families) for i in range(*oracle.at[k : k + 2])}
        for value, i, j in zip(v, r.astype(int), c.astype(int), strict=True):
            if kinds[j] == kind:
                total[i, column[j]] += value
    rows = [
        i
        for k, r in enumerate(model.form.rows)
        if r.block in ("phi", "psi")
        for i in range(oracle.to[k], oracle.to[k + 1])
    ]
    return np.linalg.matrix_rank(total[rows]) if rows else 0, len(rows)


def matched(found, expected):
    """Largest distance between two sets of poles, each relative to its size, after the best assignment."""
    from scipy.optimize import linear_sum_assignment

    assert len(found) == len(expected), (np.sort_complex(found), np.sort_complex(expected))
    if not len(found):
        return 0.0
    d = np.abs(found[:, None] - expected[None, :]) / np.maximum(np.abs(expected)[None, :], 1e-2)
    i, j = linear_sum_assignment(d)
    return d[i, j].max()


class Tableau:
    """Sparse tableau of scalar elements (Hachtel 1971): efforts of nodes (flows of common-flow nodes), e and f of each.

    Knows nothing of coordinates, classes or multipliers; pencil s*E + A over (nodes, e, f).
    """

    def __init__(self):
        self.nodes, self.elements, self.couplings = {}, {}, []

    def element(self, name, kind, value, plus, minus=None, common="effort"):
        self.elements[name] = (kind, value, plus, minus, common)
        for n in (plus, minus):
            if n is not None:
                self.nodes[n] = common

    def couple(self, kind, ratio, first, second):
        self.couplings.append((kind, ratio, first, second))

    def references(self):
        """One node of each common-effort component without ground."""
        label = {n: n for n in self.nodes}

        def find(n):
            while label.get(n, n) != n:
                n = label[n]
            return n

        for _, _, a, b, common in self.elements.values():
            if common == "effort":
                i, j = find(a), find(b)
                if i != j:
                    i, j = (j, i) if i is None else (i, j)
                    label[i] = j
        return {find(n) for n, common in self.nodes.items() if common == "effort"} - {None}

    def pencil(self):
        names = list(self.elements)
        k, b = len(self.nodes), len(names)
        number = {n: i for i, n in enumerate(self.nodes)}
        e_at = {n: k + i for i, n in enumerate(names)}
        f_at = {n: k + b + i for i, n in enumerate(names)}
        size = k + 2 * b
        a, s = [], []

        def row(still, moving=()):
            r, d = np.zeros(size), np.zeros(size)
            for j, c in still:
                r[j] += c
            for j, c in moving:
                d[j] += c
            a.append(r)
            s.append(d)

        grounded = self.references()
        for n, common in self.nodes.items():
            through = e_at if common == "flow" else f_at
            ends = [
                (through[m], sign)
                for m, (_, _, p, q, _) in self.elements.items()
                for end, sign in ((p, 1.0), (q, -1.0))
                if end == n
            ]
            row([(number[n], 1.0)] if n in grounded else ends)
        for n, (kind, value, p, q, common) in self.elements.items():
            across = e_at if common == "effort" else f_at
            ends = [(number[m], c) for m, c in ((p, -1.0), (q, 1.0)) if m is not None]
            row([(across[n], 1.0), *ends])
            match kind:
                case "R":
                    row([(e_at[n], 1.0), (f_at[n], -value)])
                case "L":
                    row([(e_at[n], 1.0)], [(f_at[n], -value)])
                case "C":
                    row([(f_at[n], 1.0)], [(e_at[n], -value)])
                case "V":
                    row([(e_at[n], 1.0)])
                case "I":
                    row([(f_at[n], 1.0)])
        for kind, r, p, q in self.couplings:
            if kind == "gyrator":
                row([(e_at[p], 1.0), (f_at[q], -r)])
                row([(e_at[q], 1.0), (f_at[p], r)])
            else:
                row([(f_at[p], 1.0), (f_at[q], -r)])
                row([(e_at[q], 1.0), (e_at[p], r)])
        return np.array(a), np.array(s)

    def poles(self):
        return finite_poles(*self.pencil())

    def regular(self):
        a, s = self.pencil()
        return np.linalg.cond(a + 0.37 * s) < 1e7


def every(*extents):
    return itertools.product(*(range(first, last + 1) for first, last in extents))


LETTER = {"kinetic": "L", "potential": "C", "dissipator": "R", "effort": "V", "flow": "I", "port": "port"}
OWN = {("kinetic", "p"): "bf", ("potential", "q"): "be", ("potential", "e"): "bq", ("dissipator", "e"): "bf"}


def unrolled(net, **sizes):
    """The Tableau of a Net, element by element; laws are linear, in the variable that `Net.R`, `L`, `C` use."""
    found = Tableau()

    def number(root, at):
        return evaluate([root], lambda n: at[n.data] if n.op == "index" else sizes[n.data])[0]

    def whole(nodes, at):
        return ",".join(str(round(number(n, at))) for n in nodes)

    def places(loops, at):
        if not loops:
            yield at
            return
        first, last = (round(number(b, at)) for b in (loops[0].first, loops[0].last))
        for k in range(first, last + 1):
            yield from places(loops[1:], {**at, loops[0].index: k})

    for b in net.branches:
        value = 0.0
        slope = None
        if (b.kind, b.side) in OWN:
            slope = derivative(b.law, x.var(b.name, OWN[b.kind, b.side], *b.at))
        for at in places(b.loops, {}):
            value = 0.0 if slope is None else number(slope, at)
            ends = [None if t.node is None else f"{t.node}[{whole(t.at, at)}]" for t in (b.plus, b.minus)]
            found.element(f"{b.name}[{whole(b.at, at)}]", LETTER[b.kind], value, *ends, b.domain.common)
    for c in net.couplings:
        for at in places(c.loops, {}):
            index = whole(c.at, at)
            found.couple(c.kind, number(c.ratio, at), f"{c.first}[{index}]", f"{c.second}[{index}]")
    return found


def null_vector(a, e, s):
    """The vector of the pencil at a simple pole; None where the pole is not simple enough to compare vectors."""
    _, sizes, vectors = np.linalg.svd(a + s * e)
    return vectors[-1].conj() if len(sizes) < 2 or sizes[-2] > 1e-5 else None


def solve(network, end, path, formulation="lagrangian", accuracy=1e-6, **more):
    """The trace of a network from 0 to `end`, and the outcome."""
    from sysdyn.runtime.accuracy.options import Options
    from sysdyn.runtime.model.carrier import load
    from sysdyn.runtime.simulate import simulate
    from sysdyn.runtime.trace.trace import Trace

    with x.fresh():
        model = compiled(network(), formulation)
        b = model.bind()
        arrays = {k: getattr(b, k) for k in ("p", "ix", "shapes", "row_shapes", "offsets")}
        arrays["initial"] = [s.to_json() for s in b.initial]
        module = types.ModuleType("generated")
        exec(compile(model.text, "generated", "exec"), module.__dict__)  # noqa: S102
        options = Options(path / "t.h5", 0.0, end, accuracy=accuracy, every=end / 20, **more)
        outcome = simulate(model.manifest(b), arrays, load(module), options)
        return Trace.open(path / "t.h5"), outcome


def read_all(tableau):
    """Observations of every effort and flow of a Tableau made by `unrolled`: name -> node."""

    def split(text):
        name, _, at = text.rstrip("]").partition("[")
        return name, tuple(x.const(int(k)) for k in at.split(",") if k)

    found = {}
    for text, common in tableau.nodes.items():
        name, at = split(text)
        found[f"n {text}"] = x.var(name, "ne" if common == "effort" else "nf", *at)
    for text in tableau.elements:
        name, at = split(text)
        found[f"e {text}"] = x.var(name, "be", *at)
        found[f"f {text}"] = x.var(name, "bf", *at)
    return found


def readings(model, oracle, y, yd):
    """Values of the observations at complex y, yd of a model that is linear, less those at rest."""
    size = int(oracle.at[-1])

    def at(y, yd):
        r = oracle.rows("observe", 0.0, np.append(y, np.zeros(size - len(y))), np.append(yd, np.zeros(size - len(y))))
        rows = {e.label: oracle.to[k] for k, e in enumerate(model.form.rows) if e.block == "observe"}
        return {name: r[k] for name, k in rows.items()}

    rest, real, imaginary = at(0 * y.real, 0 * y.real), at(y.real, yd.real), at(y.imag, yd.imag)
    return {name: real[name] - rest[name] + 1j * (imaginary[name] - rest[name]) for name in rest}


def vectors_agree(model, tableau, number=3):
    """Largest relative difference of all efforts and flows in the modes of the model and of the tableau."""
    a, e, oracle = pencil(model)
    b, d = tableau.pencil()
    names = [f"n {n}" for n in tableau.nodes]
    names += [f"{kind} {n}" for kind in "ef" for n in tableau.elements]
    floating = floating_nodes(tableau)
    worst = 0.0
    for s in finite_poles(b, d)[:number]:
        mine, theirs = null_vector(a, e, s), null_vector(b, d, s)
        if mine is None or theirs is None:
            continue
        seen = readings(model, oracle, mine, s * mine)
        kept = [k for k, name in enumerate(names) if name[2:] not in floating or name[0] != "n"]
        u, v = np.array([seen[names[k]] for k in kept]), theirs[kept]
        u = u * (np.vdot(u, v) / np.vdot(u, u))
        worst = max(worst, np.abs(u - v).max() / np.abs(v).max())
        for n, (_, _, plus, minus, common) in tableau.elements.items():
            across = "e" if common == "effort" else "f"
            ends = [seen[f"n {m}"] if m is not None else 0.0 for m in (plus, minus)]
            gap = abs(ends[0] - ends[1] - seen[f"{across} {n}"])
            worst = max(worst, gap / max(abs(value) for value in seen.values()))
    return worst


def floating_nodes(tableau):
    """Common-effort nodes of components without ground: their efforts are known up to a constant."""
    seen = {None}
    while True:
        more = {
            n
            for _, _, a, b, common in tableau.elements.values()
            if common == "effort" and (a in seen) != (b in seen)
            for n in (a, b)
        }
        if more <= seen:
            return {n for n, common in tableau.nodes.items() if common == "effort"} - seen
        seen |= more
