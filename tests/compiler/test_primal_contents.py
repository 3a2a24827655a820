"""Initial conditions of networks: pins of coordinates, contents of stores in series, equations."""

import numpy as np
import pytest
from networks import ELECTRICAL, HYDRAULIC, TRANSLATION, Net, compiled, of, solve
from sysdyn.compiler.network.primal import primal
from sysdyn.dsl.model import expression as x
from sysdyn.dsl.model.evaluation import evaluate
from sysdyn.dsl.model.network import Loop

pytestmark = pytest.mark.usefixtures("fresh")


def i(offset=0):
    return x.add(x.index("i"), x.const(offset))


def pair():
    """Two capacitors and a resistor in one loop, the second capacitor the other way round."""
    net = Net()
    for name in "ab":
        net.node(name, HYDRAULIC)
    net.C("C", 0.5, "a")
    net.C("B", 0.25, "b", "a")
    net.R("R", 2.0, "b")
    return net


def starting(net, *init, **more):
    return net.network(init=init, **more)


def pinned(network):
    return [(repr(k.target), k.value, k.loops) for k in said(primal(network)[0])]


def said(network):
    """Initial conditions but for the contents of stores that share a coordinate, which are measured."""
    return [k for k in network.initials if not k.store]


def number(node, **values):
    return evaluate([node], lambda n: values[n.data])[0]


@pytest.mark.long
def test_stores_in_series_keep_their_own_contents(tmp_path):
    start = ((of("C", "be"), 3.0), (of("B", "be"), 2.0))

    def network():
        watched = {"C": of("C", "be"), "B": of("B", "be"), "q": of("B", "bq"), "a": of("a", "ne")}
        return starting(pair(), (of("C", "be"), 3.0), (of("B", "be"), 2.0), observe=watched)

    net, _, _ = primal(starting(pair(), *start))
    assert [c.name for c in net.coordinates] == ["C"]
    assert [repr(k.target) for k in said(net)] == ["C"]
    assert number(net.initials[0].value) == 1.5
    (content,) = net.parameters
    assert content.name == "B.content"
    # q_B = q_C + c: both carry the flow of the loop from b through a to ground
    assert number(content.values[0]) == 0.5 - 1.5
    trace, _ = solve(network, 1.5, tmp_path)
    rate = (1 / 0.5 + 1 / 0.25) / 2.0
    moved = (3.0 + 2.0) / (1 / 0.5 + 1 / 0.25) * (np.exp(-rate * 1.5) - 1.0)
    assert trace["C"].values[0] == pytest.approx(3.0)
    assert trace["B"].values[0] == pytest.approx(2.0)
    assert trace["C"].values[-1] == pytest.approx(3.0 + moved / 0.5, abs=1e-5)
    assert trace["B"].values[-1] == pytest.approx(2.0 + moved / 0.25, abs=1e-5)
    assert trace["q"].values[-1] == pytest.approx(0.5 + moved, abs=1e-5)
    assert trace["a"].values[-1] == pytest.approx(3.0 + moved / 0.5, abs=1e-5)


def test_equal_contents_need_no_parameter():
    assert not primal(starting(pair(), (of("C", "be"), 0.0), (of("B", "be"), 0.0)))[0].parameters
    assert not primal(starting(pair()))[0].parameters


def test_a_follower_alone_pins_the_class_at_nothing():
    net, _, _ = primal(starting(pair(), (of("B", "bq"), 2.0)))
    assert [(repr(k.target), number(k.value)) for k in said(net)] == [("C", 0.0)]
    assert number(net.parameters[0].values[0]) == 2.0


def test_an_opposed_follower():
    net = Net()
    net.node("a", HYDRAULIC)
    net.C("C", 0.5, "a")
    net.C("B", 0.25, "a")
    found, _, _ = primal(starting(net, (of("C", "be"), 2.0), (of("B", "be"), 5.0)))
    assert [c.name for c in found.coordinates] == ["C"]
    assert number(found.parameters[0].values[0]) == 1.25 + 1.0


def charged_run(**more):
    """Capacitors in series with one resistor: one coordinate for all."""
    net = Net()
    n = x.param("n")
    net.node("m", ELECTRICAL, (0, n))
    net.C("C", x.linear(0.5, ((0.25, i()),)), ("m", i(-1)), ("m", i()), loops=(("i", 1, n),))
    net.R("R", 2.0, ("m", 0))
    net.R("S", 1.0, ("m", n))
    return net.network(params={"n": 4.0}, **more)


def test_a_run_of_stores(tmp_path):
    n = x.param("n")
    start = (of("C", "be", i()), x.index("i"), ("i", 1, n))
    net, _, _ = primal(charged_run(init=(start,)))
    assert [(c.name, c.shape) for c in net.coordinates] == [("C", ())]
    assert [(repr(k.target), number(k.value), k.loops) for k in said(net)] == [("C", 0.75, ())]
    content = next(p for p in net.parameters if p.name == "C.content")
    counter = {content.indices[0]: 3.0, "n": 4.0}
    assert number(content.values[0], **counter) == (0.5 + 0.75) * 3 - 0.75

    def network():
        watched = {f"C{k}": of("C", "be", x.const(k)) for k in range(1, 5)}
        loops = ("i", 1, x.param("n"))
        return charged_run(init=((of("C", "be", i()), x.index("i"), loops),), observe=watched)

    trace, _ = solve(network, 2.0, tmp_path)
    c = 0.5 + 0.25 * np.arange(1, 5)
    elastance = (1 / c).sum()
    moved = 10.0 / elastance * (np.exp(-elastance / 3.0 * 2.0) - 1.0)
    for k in range(4):
        assert trace[f"C{k + 1}"].values[0] == pytest.approx(k + 1)
        assert trace[f"C{k + 1}"].values[-1] == pytest.approx(k + 1 + moved / c[k], abs=1e-5)


def line():
    net = Net()
    n = x.param("n")
    net.node("v", ELECTRICAL, (0, n))
    net.node("w", ELECTRICAL, (1, n))
    each = (("i", 1, n),)
    net.V("Vs", 0.0, ("v", 0))
    net.R("R", 0.1, ("v", i(-1)), ("w", i()), loops=each)
    net.L("L", 0.5, ("v", i()), ("w", i()), loops=each)
    net.C("C", 0.7, None, ("v", i()), of=ELECTRICAL, loops=each)
    net.R("Rt", 1.3, ("v", n))
    return net


def test_flows_are_pinned_with_their_sense():
    n = x.param("n")
    each = ("i", 1, n)
    start = [(of("L", "bf", i()), x.index("i"), each), (of("L", "bp", i()), 3.0, each)]
    found = pinned(line().network(params={"n": 6.0}, init=start))
    assert [t for t, _, _ in found] == ["Vs'", "R[i]'", "Vs'", "R[i]'"]
    assert number(found[0][1], i=1.0) == 1.0  # Vs from v[0] to ground, L[1] from v[1] to w[1]: both against R[1]
    assert number(found[1][1], i=4.0) == -4.0
    assert number(found[2][1], i=1.0) == 6.0
    assert number(found[3][1], i=1.0) == -6.0
    assert found[1][2] == (Loop("i", x.const(2), n),)


def test_node_efforts_pin_the_store_to_ground():
    n = x.param("n")
    found = pinned(line().network(params={"n": 6.0}, init=[(of("v", "ne", i()), x.index("i"), ("i", 0, n))]))
    (first, _, loops), (second, value, _) = found
    assert first == "0"  # the source says what v[0] is: an equation between numbers
    assert loops == (Loop("i", x.const(0), x.const(0)),)
    assert second == "C[i]"
    assert number(value, i=4.0) == pytest.approx(-0.7 * 4.0)


def test_node_efforts_without_a_store_are_equations():
    """c[n + 1] has a source, the nodes before it have stores."""
    net = Net()
    n = x.param("n")
    net.node("c", ELECTRICAL, (1, x.add(n, x.const(1))))
    net.V("V", 2.0, ("c", x.add(n, x.const(1))))
    net.R("R", 1.0, ("c", i(1)), ("c", i()), loops=(("i", 1, n),))
    net.C("C", 0.5, ("c", i()), loops=(("i", 1, n),))
    start = [(of("c", "ne", i()), 4.0, ("i", 1, x.add(n, x.const(1))))]
    found = pinned(net.network(params={"n": 5.0}, init=start))
    assert [t for t, _, _ in found] == ["C[i]", "2"]
    assert [number(v) for _, v, _ in found] == [2.0, 4.0]


def test_other_targets_are_equations():
    net = pair()
    guess = x.add(of("R", "be"), of("a", "ne"))
    found = pinned(starting(net, (guess, 1.0), (of("R", "be"), 2.0)))
    assert [t for t, _, _ in found] == ["-2*C' + 2*C", "C'"]
    assert number(found[1][1]) == -1.0


def test_springs_and_nodes_of_mechanisms():
    net = Net()
    net.node("x", TRANSLATION)
    net.node("y", TRANSLATION)
    net.L("M", 2.0, "x")
    net.L("N", 2.0, "y")
    net.C("K", 0.25, None, "x", of=TRANSLATION)
    net.C("J", 0.5, "y", "x")
    start = [(of("x", "nq"), 1.0), (of("y", "nf"), 2.0), (of("y", "np"), 3.0)]
    start += [(of("K", "be"), 4.0), (of("M", "bp"), 6.0), (of("J", "be"), 1.0)]
    found = pinned(starting(net, *start))
    targets = [t for t, _, _ in found]
    assert targets == ["x", "y'", "y.p", "x", "x'", "y - x"]
    assert number(found[3][1]) == -1.0
    assert number(found[4][1]) == 3.0
    compiled(starting(net, *start[:2]))


@pytest.mark.long
def test_the_charge_of_a_tank_starts_its_constraint(tmp_path):
    """The integrated constraint takes the contents that the text gives, not zero."""

    def network():
        net = Net()
        net.node("a", HYDRAULIC)
        net.node("b", HYDRAULIC)
        net.C("A", 0.5, "a")
        net.R("R", 2.0, "a", "b")
        net.C("B", 0.25, "b")
        net.R("S", 1.0, "b")
        watched = {"a": of("a", "ne"), "b": of("b", "ne")}
        return starting(net, (of("a", "ne"), 3.0), (of("b", "ne"), 1.0), observe=watched)

    trace, _ = solve(network, 1.0, tmp_path)
    matrix = np.array([[-1 / 1.0, 1 / 1.0], [1 / 0.5, -(0.5 + 1.0) / 0.25]])
    values, vectors = np.linalg.eig(matrix)
    end = vectors @ (np.exp(values) * np.linalg.solve(vectors, [3.0, 1.0]))
    assert trace["a"].values[0] == pytest.approx(3.0)
    assert [trace["a"].values[-1], trace["b"].values[-1]] == pytest.approx(end, abs=1e-5)
