"""T(p, q) in the place of T*(f, q): the Legendre transformation block by block."""

import numpy as np
import pytest
from catalogue import convert, names_of, network
from reference_values import load
from sysdyn.compiler.forms.legendre import COUPLED, legendre_transform
from sysdyn.compiler.model.energies import energies
from sysdyn.compiler.pipeline import compile_network
from sysdyn.dsl import load as dsl
from sysdyn.dsl.model import expression as x
from sysdyn.dsl.model.calculus import derivative, time_derivative
from sysdyn.dsl.model.evaluation import evaluate
from sysdyn.dsl.text.diagnostics import Report

CATALOGUE = load("catalogue.json")
TRANSFORMED = [
    (key, k) for key, entry in CATALOGUE.items() for k, m in enumerate(entry["models"]) if m["form"] == "hamiltonian"
]


def lowered(key, k, changes=()):
    entry = CATALOGUE[key]
    entry = {**entry, "parameters": entry["parameters"] | dict(changes)}
    net = network(entry, entry["models"][k])
    return entry, net, legendre_transform(energies(net), net.parameters)[0]


def test_what_is_transformed():
    """Every store of the catalogue but that of the relativistic mass: its T* is no square."""
    kept = []
    for key, k in TRANSFORMED:
        with x.fresh():
            _, _, model = lowered(key, k)
            if any(n.data[1] == "f" for t in model.function("T*") for n in x.variables(t.expression) if n.op == "var"):
                kept.append(key)
    assert kept == ["relativistic_mass"]


@pytest.mark.parametrize(("key", "k"), [(key, k) for key, k in TRANSFORMED if key != "relativistic_mass"])
def test_the_energy_is_that_of_the_catalogue(key, k):
    """T of the compiler against T of the catalogue, its slopes by p and by q too, at random values."""
    with x.fresh():
        entry, _, model = lowered(key, k)
        names = names_of(entry, entry["models"][k])
        wanted = convert(entry["models"][k]["energy_after_legendre"], names)
        signs = (("T", 1.0), ("T*", -1.0))
        parts = [(t.expression, sign) for name, sign in signs for t in model.function(name)]
        found = x.add(*(e if sign > 0 else x.neg(e) for e, sign in parts))
        random = np.random.default_rng(k)
        known = {}

        def value(node):
            if node not in known:
                given = node.op == "param" and node.data in entry["parameters"]
                known[node] = float(entry["parameters"][node.data]) if given else float(random.uniform(0.2, 1.0))
            return known[node]

        unknowns = sorted((n for n in x.variables(wanted) if n.op == "var"), key=lambda n: n.number)
        pairs = [(found, wanted), *((derivative(found, n), derivative(wanted, n)) for n in unknowns)]
        for ours, theirs in pairs:
            a, b = evaluate([ours, theirs], value)
            assert a == pytest.approx(b, rel=1e-12, abs=1e-14)


def test_a_store_without_inertia_keeps_its_coenergy():
    """Where M is singular at the values of the parameters, 0 = p - dT*/df stays."""
    with x.fresh():
        _, net, model = lowered("em_suspension", 1, {"M": "0"}.items())
        flows = {n.data[0] for t in model.function("T*") for n in x.variables(t.expression) if n.op == "var"}
        assert "x1" in flows
        form = compile_network(net, "hamiltonian").form
        (block,) = (b for b in form.blocks if b.name == "momentum")
        rows = {form.rows[s.row].owner: repr(s.expression) for kernel in block.kernels for s in kernel.rows}
    assert "x1.p" in rows["x1"]
    assert "M" in rows["x1"]


def test_the_pull_of_a_magnet_does_not_depend_on_its_gap():
    """(4.22): p_x' = F - p2^2/(2 b0), and 0 = dT/dp - f."""
    with x.fresh():
        entry, net, _ = lowered("em_suspension", 1)
        form = compile_network(net, "hamiltonian").form
        q1, p2 = x.var("x1", "q"), x.var("x2", "p")
        rows = {}
        for block in form.blocks:
            for kernel in block.kernels:
                for s in kernel.rows:
                    rows[block.name, form.rows[s.row].owner] = s.expression
        pull = derivative(rows["dynamics", "x1"], p2)
        at = {p2: 0.7, q1: 0.3} | {x.param(n): float(v) for n, v in entry["parameters"].items()}
        assert evaluate([pull], at.__getitem__)[0] == pytest.approx(0.7 / at[x.param("b0")], rel=1e-14)
        gap = derivative(derivative(pull, q1), p2)
        assert evaluate([gap], at.__getitem__)[0] == pytest.approx(0.0, abs=1e-15)
        slope = derivative(rows["momentum", "x2"], x.var("x2", "f"))
        assert abs(evaluate([slope], at.__getitem__)[0]) == 1.0


CHAIN = """model chain {
  param m = 1.3 kg
  param l = 0.5 m
%s
}
"""


def pendulums(tmp_path, n):
    """A chain of n pendulums in absolute angles, M(q) coupled throughout and T* of degree two in the flows."""
    lines = [f"  coord a{k}: rotation = {0.3 + 0.2 * k} rad" for k in range(n)]
    for k in range(n):
        x, y = (" + ".join(f"{w}(a{j})*a{j}'" for j in range(k + 1)) for w in ("cos", "sin"))
        lines.append(f"  energy T* = 1/2*m*l^2*(({x})^2 + ({y})^2)")
        lines.append(f"  work m*g0*l on {' + '.join(f'cos(a{j})' for j in range(k + 1))}")
    path = tmp_path / "chain.sd"
    path.write_text(CHAIN % "\n".join(lines))
    report = Report()
    document = dsl.read(path, report)
    made = dsl.network(document, document.models["chain"], None, report)
    assert not report.failed
    return made


def rows_of(form):
    """The sum of each row by block and owner."""
    found = {}
    for block in form.blocks:
        for kernel in block.kernels:
            for s in kernel.rows:
                found.setdefault((block.name, form.rows[s.row].owner), []).append(s.expression)
    return {key: x.add(*parts) for key, parts in found.items()}


@pytest.mark.parametrize("n", [2, 3, 5, 6])
@pytest.mark.long
def test_inertias_that_move_and_join_coordinates(tmp_path, n):
    """0 = M^-1 p - f up to COUPLED coordinates, p' = -dT/dq + ..., against numpy's solution of M f = p.

    The rate of the momentum row is its total derivative wherever the row holds.
    """
    with x.fresh():
        net = pendulums(tmp_path, n)
        whole = x.add(*(t.expression for t in energies(net).function("T*")))
        rows = rows_of(compile_network(net, "hamiltonian").form)
        names = [c.name for c in net.coordinates]
        q, f, p = ([x.var(name, kind) for name in names] for kind in "qfp")
        inertia = [derivative(derivative(whole, a), b) for a in f for b in f]
        random = np.random.default_rng(n)
        at = dict(zip(q, random.uniform(-3.0, 3.0, n), strict=True)) | {x.param("m"): 1.3, x.param("l"): 0.5}
        matrix = np.reshape(evaluate(inertia, at.__getitem__), (n, n))
        momenta = random.normal(size=n)
        flows = np.linalg.solve(matrix, momenta)
        at |= dict(zip(f, flows, strict=True)) | dict(zip(p, momenta, strict=True))
        slopes = evaluate([derivative(rows["momentum", a], b) for a in names for b in f], at.__getitem__)
        solved = n <= COUPLED
        assert np.reshape(slopes, (n, n)) == pytest.approx(-np.eye(n) if solved else -matrix, abs=1e-13)
        assert evaluate([rows["momentum", a] for a in names], at.__getitem__) == pytest.approx([0.0] * n, abs=1e-12)
        pull = [x.sub(x.var(a, "p", order=1), rows["dynamics", a]) for a in names]
        wanted = [x.add(derivative(whole, a), derivative(potential(net), a)) for a in q]
        still = dict.fromkeys((x.var(a, "p", order=1) for a in names), 0.0)
        found = evaluate(pull, (at | still).__getitem__)
        assert found == pytest.approx(evaluate(wanted, at.__getitem__), rel=1e-11)
        rates = {x.var(a, k, order=1): v for k in "fp" for a, v in zip(names, random.normal(size=n), strict=True)}
        moving = at | rates | {x.var(a, "q", order=1): v for a, v in zip(names, flows, strict=True)}
        total = [time_derivative(rows["momentum", a]) for a in names]
        given = evaluate([rows["momentum_rate", a] for a in names], moving.__getitem__)
        assert given == pytest.approx(evaluate(total, moving.__getitem__), rel=1e-10, abs=1e-11)


def potential(net):
    """Minus V of the chain's weights."""
    return x.add(*(x.mul(w.effort, w.on) for w in net.works))


def test_an_inertia_that_a_binding_makes_singular_is_guarded(tmp_path):
    """The pivots of M at some point must not become zero with the values of parameters: m = 0."""
    with x.fresh():
        net = pendulums(tmp_path, 3)
        _, rests = legendre_transform(energies(net), net.parameters)
        assert [r.name for r in rests] == ["a0", "a1", "a2"]
        at = {x.param("m"): 1.0, x.param("l"): 0.5}
        assert all(value != 0.0 for value in evaluate([r.expression for r in rests], at.__getitem__))
