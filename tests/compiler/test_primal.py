"""Laws, sources, two-ports and readings of networks against closed forms and reduced equations."""

import numpy as np
import pytest
from networks import (
    ELECTRICAL,
    HEAT,
    HYDRAULIC,
    ROTATION,
    TRANSLATION,
    Net,
    compiled,
    constraint_rank,
    matched,
    poles,
    readings,
    solve,
)
from scipy.integrate import solve_ivp
from sysdyn.compiler.binding.oracle import Oracle
from sysdyn.compiler.network.primal import primal
from sysdyn.compiler.network.primal.integrals import antiderivative, line
from sysdyn.dsl.model import expression as x
from sysdyn.dsl.model.calculus import derivative
from sysdyn.dsl.model.evaluation import evaluate
from sysdyn.dsl.text.diagnostics import ModelError

pytestmark = pytest.mark.usefixtures("fresh")


def sine(amplitude, frequency):
    return x.mul(x.const(amplitude), x.call("sin", x.mul(x.const(frequency), x.time())))


def of(name, kind):
    return x.var(name, kind)


def coordinates(net):
    return [c.name for c in primal(net.network())[0].coordinates]


def near(found, expected):
    assert matched(np.asarray(found, dtype=complex), np.asarray(expected, dtype=complex)) < 1e-9


def lead():
    net = Net()
    net.node("a")
    net.node("b")
    net.V("Vs", sine(1.0, 3.0), "a")
    net.R("R1", 2.0, "a", "b")
    net.C("C", 0.5, "a", "b")
    net.R("R2", 3.0, "b")
    return net


def test_lead_filter_has_three_coordinates_and_one_constraint():
    net, _, _ = primal(lead().network())
    assert [c.name for c in net.coordinates] == ["Vs", "R1", "C"]
    assert [(c.kind, c.name) for c in net.constraints] == [("psi", "b")]
    model = compiled(lead().network())
    assert [r.name for r in model.energies.of_kind("phi")] == ["b"]
    assert constraint_rank(model) == (1, 1)
    near(poles(model), [-(1 / 2 + 1 / 3) / 0.5])


def test_a_network_in_coordinates_is_left_alone():
    net, _, _ = primal(lead().network())
    assert primal(net) == (net, (), ())


def test_a_read_node_keeps_its_row():
    net = lead()
    net.node("c", HYDRAULIC)
    net.R("A", 1.0, "c")
    net.C("B", 1.0, "c")
    assert coordinates(net) == ["Vs", "R1", "C", "B"]
    net.read.add("c")
    found, _, _ = primal(net.network())
    assert [c.name for c in found.coordinates] == ["Vs", "R1", "C", "A", "B"]
    assert [c.name for c in found.constraints] == ["b", "c"]


def test_series_circuit_is_one_coordinate():
    net = Net()
    for name in "abc":
        net.node(name)
    net.V("V", sine(1.0, 2.0), "a")
    net.R("R", 0.3, "b", "a")
    net.L("L", 2.0, "b", "c")
    net.C("C", 0.5, None, "c", of=ELECTRICAL)
    found, _, _ = primal(net.network())
    assert [c.name for c in found.coordinates] == ["C"]
    assert not found.constraints
    model = compiled(net.network())
    assert constraint_rank(model) == (0, 0)
    near(poles(model), np.roots([2.0, 0.3, 2.0]))


def test_a_lone_inductor_across_a_capacitor():
    net = Net()
    net.node("a")
    net.L("L", 2.0, "a")
    net.C("C", 0.5, "a")
    net.R("R", 4.0, "a")
    near(poles(compiled(net.network())), np.roots([0.5, 0.25, 0.5]))


@pytest.mark.parametrize("ratio", [2.5, -0.7, 0.0])
def test_motor_is_a_gyrator(ratio):
    net = Net()
    net.node("a")
    net.node("b")
    net.node("s", ROTATION)
    net.V("V", 0.0, "a")
    net.R("R", 2.0, "a", "b")
    net.couple("gyrator", "M", ratio, ("b", None), ("s", None))
    net.L("J", 0.4, "s")
    net.R("B", 0.1, "s")
    near(poles(compiled(net.network())), [-(0.1 + ratio**2 / 2.0) / 0.4])


@pytest.mark.parametrize("side", ["f", "e"])
@pytest.mark.parametrize("ratio", [3.0, -1.5])
def test_transformer_reflects_impedance(side, ratio):
    """f1 = n f2 reflects R to R/n^2; e1 = n e2 to n^2 R."""
    net = Net()
    net.node("a")
    net.node("b")
    net.L("L", 2.0, "a")
    net.couple("transformer", "X", ratio, ("a", None), ("b", None), side)
    net.R("R", 5.0, "b")
    reflected = 5.0 / ratio**2 if side == "f" else 5.0 * ratio**2
    watched = {"e1": of("X.1", "be"), "e2": of("X.2", "be"), "f1": of("X.1", "bf"), "f2": of("X.2", "bf")}
    model = compiled(net.network(observe=watched))
    near(poles(model), [-reflected / 2.0])
    oracle = Oracle(model.form, model.bind())
    y = np.random.default_rng(1).uniform(size=oracle.at[-1] - 6).astype(complex)
    seen = readings(model, oracle, y, y)
    if side == "f":
        assert seen["e2"] == pytest.approx(-ratio * seen["e1"])
    else:
        assert seen["e1"] == pytest.approx(ratio * seen["e2"])


def test_masses_and_springs_have_no_constraints():
    net = Net()
    for name in "xyz":
        net.node(name, TRANSLATION)
        net.L(f"m{name}", 2.0, name)
    net.C("k1", 1 / 3.0, "x")
    net.C("k2", 1 / 5.0, "y", "x")
    net.C("k3", 1 / 7.0, "y", "z")
    found, _, _ = primal(net.network())
    assert [c.name for c in found.coordinates] == ["x", "y", "z"]
    assert not found.constraints
    stiffness = np.array([[8.0, -5.0, 0], [-5.0, 12.0, -7.0], [0, -7.0, 7.0]])
    omega = np.sqrt(np.linalg.eigvalsh(stiffness / 2.0))
    near(poles(compiled(net.network())), np.concatenate((1j * omega, -1j * omega)))


def test_a_branch_on_an_expression():
    """A spring along sqrt(x^2 + y^2) between two moving points."""
    net = Net()
    net.node("x", TRANSLATION)
    net.node("y", TRANSLATION)
    net.L("mx", 1.0, "x")
    net.L("my", 1.0, "y")
    length = x.sqrt(x.add(*(x.mul(of(n, "nq"), of(n, "nq")) for n in "xy")))
    net.C("k", 0.25, None, on=length, of=TRANSLATION)
    model = compiled(net.network(observe={"e": of("k", "be"), "f": of("k", "bf")}))
    assert [n.name for n in model.form.families][:4] == ["x", "y", "x'", "y'"]
    oracle = Oracle(model.form, model.bind())
    y = np.zeros(int(oracle.at[-1]))
    y[:4] = 3.0, 4.0, 1.0, 2.0
    r = oracle.rows("dynamics", 0.0, y, y * 0)
    np.testing.assert_allclose(r[:2], [4 * 3.0, 4 * 4.0])
    seen = oracle.rows("observe", 0.0, y, y * 0)
    assert sorted(v for v in seen if v) == pytest.approx([11 / 5.0, 20.0])


def reduced(rhs, start, end, **options):
    return solve_ivp(rhs, (0.0, end), start, rtol=1e-10, atol=1e-12, **options).y[:, -1]


@pytest.mark.long
def test_nonlinear_laws(tmp_path):
    """Saturating coil f(p), quadratic valve c f |f|, cubic spring, all in one loop, against the reduced equations."""

    def network():
        net = Net()
        for name in "abc":
            net.node(name, HYDRAULIC)
        net.V("V", sine(2.0, 3.0), "a")
        net.branch("D", "dissipator", "e", lambda f: x.mul(x.const(0.7), f, x.call("abs", f)), "a", "b")
        net.branch("L", "kinetic", "f", lambda p: x.add(p, x.mul(x.const(0.2), p, p, p)), "b", "c")
        net.branch("C", "potential", "e", lambda q: x.add(q, x.mul(x.const(0.5), q, q, q)), "c")
        watched = {"f": of("D", "bf"), "p": of("L", "bp"), "q": of("C", "bq"), "b": of("b", "ne"), "e": of("L", "be")}
        return net.network(observe=watched, init=[(of("C", "bq"), 0.4), (of("L", "bp"), 0.0)])

    trace, outcome = solve(network, 3.0, tmp_path)
    assert outcome.final

    def rhs(t, y):
        p, q = y
        f = p + 0.2 * p**3
        return [2 * np.sin(3 * t) - 0.7 * f * abs(f) - (q + 0.5 * q**3), f]

    p, q = reduced(rhs, [0.0, 0.4], 3.0)
    f = p + 0.2 * p**3
    assert trace["p"].values[-1] == pytest.approx(p, abs=1e-5)
    assert trace["q"].values[-1] == pytest.approx(q, abs=1e-5)
    assert trace["f"].values[-1] == pytest.approx(f, abs=1e-5)
    assert trace["b"].values[-1] == pytest.approx(2 * np.sin(9.0) - 0.7 * f * abs(f), abs=1e-4)
    assert trace["e"].values[-1] == pytest.approx(rhs(3.0, [p, q])[0], abs=1e-4)


@pytest.mark.long
def test_diode_is_an_implicit_effort(tmp_path):
    """f = Is (exp(e/Vt) - 1) in series with a resistor charges a capacitor."""

    def network():
        net = Net()
        for name in "abc":
            net.node(name)
        net.V("V", sine(1.0, 5.0), "a")
        net.R("R", 0.5, "a", "b")
        net.branch(
            "D", "dissipator", "f", lambda e: x.linear(-0.01, ((0.01, x.call("exp", x.scale(10.0, e))),)), "b", "c"
        )
        net.C("C", 0.3, "c")
        return net.network(observe={"c": of("c", "ne")}, init=[(of("c", "ne"), 0.0)])

    notes = primal(network())[1]
    assert [n.code for n in notes] == ["N604", "N601"]
    trace, _ = solve(network, 2.0, tmp_path)

    def rhs(t, y):
        low, high = -5.0, 5.0  # the diode's effort, by bisection
        for _ in range(80):
            e = (low + high) / 2
            f = 0.01 * (np.exp(10 * e) - 1)
            low, high = (e, high) if 0.5 * f + e < np.sin(5 * t) - y[0] else (low, e)
        return [f / 0.3]

    assert trace["c"].values[-1] == pytest.approx(reduced(rhs, [0.0], 2.0)[0], abs=2e-5)


def transactor(kind):
    """Seed README, figure 2.14: a second circuit driven by a quantity of the first."""
    net = Net()
    for name in "abd":
        net.node(name)
    net.V("V", sine(1.0, 3.0), "a")
    net.L("L1", 1.0, "a", "b")
    net.R("R1", 2.0, "b")
    if kind == "flow":
        net.I("G", x.mul(x.const(5.0), of("L1", "bf")), None, "d", of=ELECTRICAL)
        net.C("C2", 0.3, "d")
        net.R("R2", 2.0, "d")
    else:
        net.node("g")
        net.V("G", x.mul(x.const(4.0), of("L1", "bf")), "g")
        net.R("R2", 1.0, "g", "d")
        net.L("L2", 0.5, "d")
    seen = {"i1": of("L1", "bf"), "v2": of("d", "ne"), "g": of("G", "be")}
    start = [(of("L1", "bf"), 0.0)]
    start += [(of("C2", "be"), 0.0)] if kind == "flow" else [(of("L2", "bf"), 0.0)]
    return net.network(observe=seen, init=start)


@pytest.mark.long
def test_a_controlled_flow_source_never_loads_its_control_port(tmp_path):
    """Seed README, section 7.1: as a psi it would give i1 = -0.0093, v2 = 0.1594."""
    found, _, _ = primal(transactor("flow"))
    assert [c.kind for c in found.constraints if c.name == "G.law"] == ["gamma"]
    trace, outcome = solve(lambda: transactor("flow"), 5.0, tmp_path)
    assert outcome.final
    assert trace["i1"].values[-1] == pytest.approx(0.2754, abs=6e-5)
    assert trace["v2"].values[-1] == pytest.approx(0.5111, abs=6e-5)
    assert trace["g"].values[-1] == pytest.approx(-trace["v2"].values[-1], abs=1e-4)


@pytest.mark.long
def test_a_flow_source_of_time_is_a_flow_constraint(tmp_path):
    def network():
        net = Net()
        net.node("a")
        net.I("S", sine(1.0, 2.0), None, "a", of=ELECTRICAL)
        net.C("C", 0.5, "a")
        net.R("R", 2.0, "a")
        watched = {"a": of("a", "ne"), "S": of("S", "be"), "P": x.mul(of("S", "be"), of("S", "bf"))}
        return net.network(observe=watched, init=[(of("C", "be"), 0.3)])

    found, _, _ = primal(network())
    assert {(c.kind, c.name) for c in found.constraints} == {("psi", "S.law"), ("psi", "a")}
    trace, _ = solve(network, 4.0, tmp_path)
    expected = reduced(lambda t, v: [(np.sin(2 * t) - v[0] / 2) / 0.5], [0.3], 4.0)[0]
    assert trace["a"].values[-1] == pytest.approx(expected, abs=1e-5)
    assert trace["S"].values[-1] == pytest.approx(-expected, abs=1e-5)


def test_a_source_controlled_by_a_read_node(tmp_path):
    """Seed, transactor_vccs: the control port is a voltage, whose node keeps its row."""

    def network():
        net = Net()
        for name in "abd":
            net.node(name)
        net.read.add("b")
        net.V("V", sine(1.0, 4.0), "a")
        net.R("R1", 1.0, "a", "b")
        net.C("C1", 0.5, "b")
        net.I("G", x.mul(x.const(0.7), of("b", "ne")), None, "d", of=ELECTRICAL)
        net.C("C2", 0.3, "d")
        net.R("R2", 2.0, "d")
        start = [(of("C1", "be"), 0.0), (of("C2", "be"), 0.0)]
        return net.network(observe={"v1": of("b", "ne"), "v2": of("d", "ne")}, init=start)

    trace, _ = solve(network, 5.0, tmp_path)
    v1, v2 = reduced(lambda t, v: [(np.sin(4 * t) - v[0]) / 0.5, (0.7 * v[0] - v[1] / 2.0) / 0.3], [0.0, 0.0], 5.0)
    assert trace["v1"].values[-1] == pytest.approx(v1, abs=1e-5)
    assert trace["v2"].values[-1] == pytest.approx(v2, abs=1e-5)


@pytest.mark.long
def test_a_law_that_reads_the_effort_of_a_kinetic_store(tmp_path):
    """Its momentum becomes a state: no law holds the rate of a flow."""

    def network():
        net = Net()
        for name in "abd":
            net.node(name)
        net.V("V", sine(1.0, 4.0), "a")
        net.R("R1", 1.0, "a", "b")
        net.L("L", 0.5, "b")
        net.V("G", x.scale(3.0, of("L", "be")), "d")
        net.R("R2", 2.0, "d", None)
        net.C("C2", 0.3, "d")
        start = [(of("L", "bf"), 0.0)]
        watched = {"L": of("L", "be"), "f": of("L", "bf"), "p": of("L", "bp"), "d": of("d", "ne")}
        return net.network(observe=watched, init=start)

    found, _, _ = primal(network())
    assert [s.name for s in found.states] == ["L.p"]
    assert [u.name for u in found.unknowns] == ["L.e"]
    trace, _ = solve(network, 2.0, tmp_path)
    f = reduced(lambda t, f: [(np.sin(4 * t) - f[0]) / 0.5], [0.0], 2.0)[0]
    assert trace["f"].values[-1] == pytest.approx(f, abs=1e-5)
    assert trace["p"].values[-1] == pytest.approx(0.5 * f, abs=1e-5)
    assert trace["d"].values[-1] == pytest.approx(3 * (np.sin(8.0) - f), abs=1e-4)


@pytest.mark.long
def test_laws_that_move_with_time_or_place(tmp_path):
    """A resistance of time, a transformer whose ratio is a function of the displacement of a mass."""

    def network():
        net = Net()
        net.node("a", HYDRAULIC)
        net.node("x", TRANSLATION)
        ratio = x.linear(1.0, ((0.5, x.call("sin", of("x", "nq"))),))
        net.L("L", 0.5, "a")
        net.branch("R", "dissipator", "e", lambda f: x.mul(x.linear(1.0, ((0.5, x.time()),)), f), "a")
        net.couple("transformer", "X", ratio, ("a", None), ("x", None))
        net.L("M", 2.0, "x")
        net.C("K", 0.25, "x")
        start = [(of("L", "bf"), 1.0), (of("x", "nq"), 0.2), (of("x", "nf"), 0.5)]
        return net.network(observe={"f": of("L", "bf"), "x": of("x", "nq")}, init=start)

    trace, outcome = solve(network, 2.0, tmp_path)

    def rhs(t, y):
        f, q, v = y
        n = 1 + 0.5 * np.sin(q)
        e = -(1 + 0.5 * t) * (f + n * v)  # flows into L, R and the transformer add up to zero; f1 = n v
        return [e / 0.5, v, (n * e - 4 * q) / 2.0]

    expected = reduced(rhs, [1.0, 0.2, 0.5], 2.0)
    assert trace["f"].values[-1] == pytest.approx(expected[0], abs=2e-5)
    assert trace["x"].values[-1] == pytest.approx(expected[1], abs=2e-5)
    assert abs(outcome.samples.energy[-1]) < 1e-4


@pytest.mark.long
def test_heat_leaves_no_trace_in_the_audit(tmp_path):
    """Two heat capacities and a resistance that the losses of a circuit warm."""

    def network():
        net = Net()
        net.node("T1", HEAT)
        net.node("T2", HEAT)
        net.node("a")
        net.V("V", 3.0, "a")
        net.R("R", 2.0, "a")
        loss = x.mul(of("R", "be"), of("R", "bf"))
        net.I("Q", loss, None, "T1", of=HEAT)
        net.C("C1", 2.0, "T1")
        net.R("Rw", 0.5, "T1", "T2")
        net.C("C2", 3.0, "T2")
        net.R("Ra", 4.0, "T2")
        start = [(of("T1", "ne"), 10.0), (of("T2", "ne"), 20.0)]
        return net.network(observe={"T1": of("T1", "ne"), "T2": of("T2", "ne")}, init=start)

    assert {e.function for e in primal(network())[0].energies} == {"D"}  # of the circuit's resistor
    trace, outcome = solve(network, 3.0, tmp_path)

    def rhs(t, y):
        wall = (y[0] - y[1]) / 0.5
        return [(4.5 - wall) / 2.0, (wall - y[1] / 4.0) / 3.0]

    expected = reduced(rhs, [10.0, 20.0], 3.0)
    assert [trace[n].values[-1] for n in ("T1", "T2")] == pytest.approx(expected, abs=1e-4)
    assert abs(outcome.samples.energy[-1]) < 1e-4


@pytest.mark.parametrize("formulation", ["lagrangian", "hamiltonian"])
@pytest.mark.long
def test_tank_with_inertia(formulation, tmp_path):
    """Pump, pipe with inertia, tank, outlet."""

    def network():
        net = Net()
        net.node("a", HYDRAULIC)
        net.node("b", HYDRAULIC)
        net.V("P", 2.0, "a")
        net.L("I", 0.5, "a", "b")
        net.C("T", 1.5, "b")
        net.R("O", 0.8, "b")
        start = [(of("T", "be"), 1.0), (of("I", "bf"), 0.0)]
        return net.network(observe={"b": of("b", "ne"), "f": of("I", "bf"), "p": of("I", "bp")}, init=start)

    trace, _ = solve(network, 2.0, tmp_path, formulation)
    f, e = reduced(lambda t, y: [(2.0 - y[1]) / 0.5, (y[0] - y[1] / 0.8) / 1.5], [0.0, 1.0], 2.0)
    assert trace["b"].values[-1] == pytest.approx(e, abs=1e-5)
    assert trace["f"].values[-1] == pytest.approx(f, abs=1e-5)
    assert trace["p"].values[-1] == pytest.approx(0.5 * f, abs=1e-5)


def test_efforts_of_field_branches_are_those_of_their_nodes():
    net = lead()
    net.branch("F", "field", None, None, "b", of=ELECTRICAL)
    work = x.mul(x.const(2.0), of("F", "bf"), of("F", "bf"))
    from catalogue import PLACE
    from sysdyn.dsl.model.network import EnergyTerm

    model = compiled(net.network(observe={"e": of("F", "be")}, energies=(EnergyTerm("D", work, (), PLACE),)))
    near(poles(model), [-(1 / 2 + 1 / 3 + 1 / 4) / 0.5])
    field = Net()
    field.node("x", TRANSLATION)
    field.L("m", 1.0, "x")
    field.branch("F", "field", None, None, "x")
    with pytest.raises(ModelError, match="E102"):
        compiled(field.network(observe={"e": of("F", "be")}))


def test_definitions_in_a_circle_are_refused():
    net = Net()
    net.node("a")
    net.node("b")
    net.V("A", of("B", "be"), "a")
    net.V("B", of("A", "be"), "b")
    net.R("R", 1.0, "a", "b")
    with pytest.raises(ModelError, match="E105"):
        primal(net.network(observe={"e": of("A", "be")}))


def test_odd_networks_are_no_crash():
    net = lead()
    net.node("lonely")
    net.node("ring")
    net.R("Z", 1.0, "ring", "ring")
    model = compiled(net.network())
    assert len(poles(model)) == 1
    with pytest.raises(ModelError, match=r"E409.*lonely"):
        primal(net.network(observe={"e": of("lonely", "ne")}))
    with pytest.raises(ModelError, match=r"E102.*momentum"):
        primal(net.network(observe={"p": of("R1", "bp")}))
    bare = Net()
    bare.node("x", TRANSLATION)
    assert [c.name for c in primal(bare.network())[0].coordinates] == ["x"]
    empty = Net()
    empty.node("v", ELECTRICAL, (1, x.param("n")))
    empty.R("R", 1.0, ("v", x.index("i")), loops=(("i", 1, x.param("n")),))
    found, _, _ = primal(empty.network(params={"n": 0.0}))
    assert not found.coordinates


def test_antiderivatives_are_exact():
    v, c = x.var("v", "f"), x.param("c")
    size = x.call("abs", v)
    laws = (
        x.mul(c, v),
        x.mul(c, v, size),
        x.add(x.mul(v, v, v), x.mul(c, size), x.const(2.0)),
        x.mul(x.add(v, c), x.add(v, size), v),
        x.mul(c, v, v, size, size, size),
    )
    for law in laws:
        slope = derivative(antiderivative(law, v, []), v)
        for at in (-1.3, 0.4, 2.0):
            got, expected = evaluate([slope, law], lambda n, at=at: at if n is v else 0.7)
            assert got == pytest.approx(expected, rel=1e-14)
    assert antiderivative(x.call("tan", v), v, []) is None
    assert antiderivative(x.power(v, x.const(0.5)), v, []) is None
    straight = line(x.linear(3.0, ((2.0, v),)), v)
    assert evaluate([straight.inverse(x.const(7.0))], lambda n: 0.0) == [2.0]
    assert line(x.mul(v, v), v) is None
