"""T(p, q) in the place of T*(f, q): the Legendre transformation block by block."""

import numpy as np
import pytest
from catalogue import convert, load, names_of, network
from sysdyn.compiler.forms.legendre import transformed
from sysdyn.compiler.model.energies import energies
from sysdyn.compiler.pipeline import compile_network
from sysdyn.dsl.model import expression as x

CATALOGUE = load("catalogue.json")
TRANSFORMED = [
    (key, k)
    for key, entry in CATALOGUE.items()
    for k, m in enumerate(entry["models"])
    if m["form"] == "hamiltonian" and not (key == "two_link_arm" and m["n"] == 2)
]


def lowered(key, k, changes=()):
    entry = CATALOGUE[key]
    entry = {**entry, "parameters": entry["parameters"] | dict(changes)}
    net = network(entry, entry["models"][k])
    return entry, net, transformed(energies(net), net.parameters)[0]


def test_what_is_transformed():
    """Every store of the catalogue but those of the relativistic mass (its T* is no square) and of the arm's angles."""
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
        pairs = [(found, wanted), *((x.derivative(found, n), x.derivative(wanted, n)) for n in unknowns)]
        for ours, theirs in pairs:
            a, b = x.evaluate([ours, theirs], value)
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
        pull = x.derivative(rows["dynamics", "x1"], p2)
        at = {p2: 0.7, q1: 0.3} | {x.param(n): float(v) for n, v in entry["parameters"].items()}
        assert x.evaluate([pull], at.__getitem__)[0] == pytest.approx(0.7 / at[x.param("b0")], rel=1e-14)
        gap = x.derivative(x.derivative(pull, q1), p2)
        assert x.evaluate([gap], at.__getitem__)[0] == pytest.approx(0.0, abs=1e-15)
        slope = x.derivative(rows["momentum", "x2"], x.var("x2", "f"))
        assert abs(x.evaluate([slope], at.__getitem__)[0]) == 1.0
