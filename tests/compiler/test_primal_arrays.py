"""Arrays of branches and nodes: one structure for every size, and the poles and readings of unrolled references."""

import numpy as np
import pytest
from catalogue import ONE, PLACE
from networks import (
    ELECTRICAL,
    TRANSLATION,
    Net,
    compiled,
    constraint_rank,
    matched,
    poles,
    read_all,
    readings,
    unrolled,
    vectors_agree,
)
from sysdyn.compiler.binding.manifest import structure
from sysdyn.compiler.binding.oracle import Oracle
from sysdyn.compiler.network.primal import primal
from sysdyn.dsl.model import expression as x
from sysdyn.dsl.model.network import Constraint, Loop, Unknown
from sysdyn.dsl.text.diagnostics import ModelError

pytestmark = pytest.mark.usefixtures("fresh")


def i(offset=0):
    return x.add(x.index("i"), x.const(offset))


def n(offset=0):
    return x.add(x.param("n"), x.const(offset))


def each(first=1, last=None):
    return (("i", first, n() if last is None else last),)


def line():
    """transmission_line.sd of the language's models."""
    net = Net()
    net.node("v", ELECTRICAL, (0, n()))
    net.node("w", ELECTRICAL, (1, n()))
    net.V("Vs", x.call("sin", x.time()), ("v", 0))
    net.R("R", 0.1, ("v", i(-1)), ("w", i()), loops=each())
    net.L("L", 0.5, ("w", i()), ("v", i()), loops=each())
    net.C("C", 0.7, ("v", i()), loops=each())
    net.R("Rt", 1.3, ("v", n()))
    return net


def line_network(size):
    watched = {f"v{k}": x.var("v", "ne", at) for k, at in enumerate((x.const(0), x.div(n(), x.const(2)), n()))}
    start = [(x.var("L", "bf", i()), 0.0, ("i", 1, n())), (x.var("C", "be", i()), 0.0, ("i", 1, n()))]
    return line().network(params={"n": size}, observe=watched, init=start)


def ladder():
    net = Net()
    net.node("v", ELECTRICAL, (0, n()))
    net.V("Vs", x.call("sin", x.time()), ("v", 0))
    net.R("R", x.linear(0.5, ((0.1, x.index("i")),)), ("v", i(-1)), ("v", i()), loops=each())
    net.C("C", x.linear(0.2, ((0.3, x.index("i")),)), ("v", i()), loops=each())
    return net


def run(tap=False):
    """A chain of resistors between a source and a capacitor: one coordinate, or two where it has a tap."""
    net = Net()
    net.node("m", ELECTRICAL, (0, n()))
    net.V("Vs", x.call("sin", x.time()), ("m", 0))
    net.R("R", x.linear(0.5, ((0.1, x.index("i")),)), ("m", i(-1)), ("m", i()), loops=each())
    net.C("C", 0.7, ("m", n()))
    if tap:
        net.C("T", 0.4, ("m", x.param("k")))
    return net


def double_run():
    """Resistors and inductors in turn, nodes between them in two families."""
    net = Net()
    net.node("m", ELECTRICAL, (0, n()))
    net.node("w", ELECTRICAL, (1, n()))
    net.R("R", 0.3, ("m", i(-1)), ("w", i()), loops=each())
    net.L("L", x.linear(0.5, ((0.1, x.index("i")),)), ("m", i()), ("w", i()), loops=each())
    net.C("C", 0.7, ("m", n()))
    net.C("T", 0.4, ("w", x.param("k")))
    net.R("E", 0.6, ("m", 0))
    return net


def plane():
    """Resistors along both indices of a plane of capacitors."""
    net = Net()
    m = x.param("m")
    j = x.index("j")
    net.node("u", ELECTRICAL, (1, n()), (1, m))
    rows, columns = (("i", 2, n()), ("j", 1, m)), (("i", 1, n()), ("j", 2, m))
    value = x.linear(0.5, ((0.1, x.index("i")), (0.05, j)))
    net.R("X", value, ("u", i(-1), j), ("u", i(), j), loops=rows)
    net.R("Y", value, ("u", i(), x.sub(j, x.const(1))), ("u", i(), j), loops=columns)
    net.C("C", value, ("u", i(), j), loops=(("i", 1, n()), ("j", 1, m)))
    return net


def floating_plane():
    """The same with capacitors along one index instead, and no ground: one reference."""
    net = plane()
    net.branches = [b for b in net.branches if b.name != "C"]
    net.branches[1:] = []
    m, j = x.param("m"), x.index("j")
    net.C("Y", 0.4, ("u", i(), x.sub(j, x.const(1))), ("u", i(), j), loops=(("i", 1, n()), ("j", 2, m)))
    net.L("B", 0.8, ("u", 1, 1), ("u", n(), m))
    return net


def islands():
    """A loop of three branches for each index, none with ground; every second node has a dead end."""
    net = Net()
    for name in "abc":
        net.node(name, ELECTRICAL, (1, n()))
    net.R("R", x.linear(0.5, ((0.1, x.index("i")),)), ("a", i()), ("b", i()), loops=each())
    net.C("C", 0.7, ("b", i()), ("a", i()), loops=each())
    net.L("L", 0.9, ("b", i()), ("a", i()), loops=each())
    net.R("D", 1.0, ("b", i()), ("c", i()), loops=each())
    return net


def plain_islands():
    """Closed series classes without any row."""
    net = Net()
    for name in "ab":
        net.node(name, ELECTRICAL, (1, n()))
    net.R("R", x.linear(0.5, ((0.1, x.index("i")),)), ("a", i()), ("b", i()), loops=each())
    net.C("C", 0.7, ("b", i()), ("a", i()), loops=each())
    return net


def bus():
    """Everything on one bus, which another resistor feeds."""
    net = Net()
    net.node("b")
    net.node("w", ELECTRICAL, (1, n()))
    net.R("F", 0.4, "b")
    net.R("R", x.linear(0.5, ((0.1, x.index("i")),)), "b", ("w", i()), loops=each())
    net.C("C", 0.7, ("w", i()), loops=each())
    return net


def floating_bus():
    net = bus()
    net.branches = [b for b in net.branches if b.name == "R"]
    net.C("C", 0.7, ("w", i(-1)), ("w", i()), loops=each(2))
    return net


def parallel_cells():
    """A chain whose links are many cells side by side, each with a node of its own (a pack of batteries)."""
    net = Net()
    net.node("v", ELECTRICAL, (0, n()))
    net.node("b", ELECTRICAL, (1, n()), (1, x.param("m")))
    loops = (*each(), ("j", 1, x.param("m")))
    j = x.index("j")
    net.R("R", x.linear(1.0, ((0.2, x.index("i")), (0.3, j))), ("v", i()), ("b", i(), j), loops=loops)
    net.R("P", 1.1, ("b", i(), j), ("v", i(-1)), loops=loops)
    net.C("C", 0.7, ("b", i(), j), ("v", i(-1)), loops=loops)
    net.C("D", 0.4, ("v", i()), ("v", i(-1)), loops=each())
    net.R("Rt", 1.3, ("v", n()), ("v", 0))
    return net


def springs():
    """A chain of masses with a damper to a wall at one end."""
    net = Net()
    net.node("x", TRANSLATION, (1, n()))
    net.L("M", x.linear(0.5, ((0.1, x.index("i")),)), ("x", i()), loops=each())
    net.C("K", 0.4, ("x", i(-1)), ("x", i()), loops=each(2))
    net.R("B", 0.2, ("x", n()))
    return net


def transformers():
    """A transformer for each index between a bus and a mass."""
    net = bus()
    net.branches = [b for b in net.branches if b.name != "C"]
    net.node("x", TRANSLATION, (1, n()))
    ends = (("w", i()), None), (("x", i()), None)
    net.couple("gyrator", "G", x.linear(1.0, ((0.2, x.index("i")),)), *ends, loops=each())
    net.L("M", 0.9, ("x", i()), loops=each())
    net.C("K", 0.5, ("x", i()), loops=each())
    return net


CASES = (
    line,
    ladder,
    run,
    lambda: run(True),
    double_run,
    plane,
    floating_plane,
    islands,
    plain_islands,
    bus,
    floating_bus,
    parallel_cells,
    springs,
    transformers,
)


def sized(net, size, **more):
    return net.network(params={"n": float(size), "m": 3.0, "k": 3.0}, **more)


@pytest.mark.parametrize("make", CASES)
@pytest.mark.long
def test_poles_and_modes_are_those_of_the_unrolled_network(make):
    for size in (4, 7):
        net = make()
        tableau = unrolled(net, n=size, m=3, k=3)
        model = compiled(sized(net, size, observe=read_all(tableau)))
        rank, rows = constraint_rank(model)
        assert rank == rows
        assert matched(poles(model), tableau.poles()) < 1e-8
        assert vectors_agree(model, tableau) < 1e-7


@pytest.mark.parametrize("make", CASES)
@pytest.mark.long
def test_structure_and_text_do_not_depend_on_the_size(make):
    found = []
    for size in (10, 100_000):
        with x.fresh():
            model = compiled(sized(make(), size), backend="c")
            found.append((model.text, structure(model.form, model.program, model.network)))
    assert found[0] == found[1]


@pytest.mark.long
def test_the_transmission_line_has_one_text(effort):
    found, lines = [], []
    for size in (10.0, 10.0, 100_000.0):
        with x.fresh():
            model, count = effort(lambda size=size: compiled(line_network(size), backend="c"))
            lines.append(count)
            found.append((model.text, structure(model.form, model.program, model.network)))
    assert found[1] == found[2]
    assert lines[2] <= 1.05 * lines[1]
    names = [f["name"] for f in found[0][1]["families"] if f["kind"] == "f"]
    assert names == ["Vs'", "R'", "C'", "Rt'"]


def test_a_run_is_one_coordinate():
    net, _, _ = primal(sized(run(), 50))
    assert [(c.name, c.shape) for c in net.coordinates] == [("C", ())]
    assert not net.constraints
    net, _, _ = primal(sized(run(True), 50))
    assert [(c.name, c.shape) for c in net.coordinates] == [("Vs", ()), ("C", ()), ("T", ())]
    assert [c.name for c in net.constraints] == ["m"]


def test_each_island_has_its_reference():
    net, _, _ = primal(sized(islands(), 9))
    rows = {c.name: [(loop.first, loop.last) for loop in c.loops] for c in net.constraints}
    whole = [(x.const(1), x.param("n"))]
    assert rows == {"a": whole, "c": whole}
    net, _, _ = primal(sized(plain_islands(), 9))
    assert [c.name for c in net.coordinates] == ["C"]
    assert not net.constraints


def test_interleaved_nets_are_refused():
    net = Net()
    net.node("v", ELECTRICAL, (0, n()))
    net.R("R", 1.0, ("v", i(-1)), ("v", i(1)), loops=each(1, n(-1)))
    with pytest.raises(ModelError, match=r"E806.*node v.*unrolled"):
        compiled(sized(net, 9))
    net.C("C", 1.0, ("v", i()), loops=each(0))  # grounded everywhere, it does not matter
    tableau = unrolled(net, n=9)
    assert matched(poles(compiled(sized(net, 9))), tableau.poles()) < 1e-8


def test_a_diagonal_is_refused():
    net = Net()
    net.node("u", ELECTRICAL, (1, n()), (1, n()))
    net.R("R", 1.0, ("u", i(), i()), loops=each())
    with pytest.raises(ModelError, match="E806"):
        compiled(sized(net, 5))


def test_an_index_outside_is_refused():
    net = ladder()
    net.R("Z", 1.0, ("v", i(1)), loops=each())
    with pytest.raises(ModelError, match=r"E805.*v\[2\.\.6\]"):
        compiled(sized(net, 5))


def summed(root):
    return x.reduction("sum", "i", x.const(1), n(), root)


def test_reads_are_cut_where_classes_change():
    """Sums, least and largest values, and rows over families whose elements lie in different classes."""
    square = x.mul(x.var("R", "bf", i()), x.var("R", "bf", i()))
    least, largest = (x.reduction(o, "i", x.const(1), n(), x.var("R", "bf", i())) for o in ("min", "max"))
    watched = {"sum": summed(square), "min": least, "max": largest, "power": summed(x.mul(square, x.param("n")))}
    watched["double"] = x.reduction(
        "sum", "j", x.const(1), n(), summed(x.mul(x.var("R", "bf", i()), x.var("L", "be", x.index("j"))))
    )
    watched |= {f"R{k}": x.var("R", "bf", x.const(k)) for k in range(1, 6)}
    watched |= {f"L{k}": x.var("L", "be", x.const(k)) for k in range(1, 6)}
    model = compiled(sized(line(), 5, observe=watched))
    oracle = Oracle(model.form, model.bind())
    y = np.random.default_rng(3).uniform(size=oracle.at[-1] - 6).astype(complex)
    seen = {k: v.real for k, v in readings(model, oracle, y, y).items()}
    flows = np.array([seen[f"R{k}"] for k in range(1, 6)])
    efforts = np.array([seen[f"L{k}"] for k in range(1, 6)])
    assert seen["sum"] == pytest.approx(flows @ flows)
    assert seen["power"] == pytest.approx(5 * flows @ flows)
    assert seen["min"] == pytest.approx(flows.min())
    assert seen["max"] == pytest.approx(flows.max())
    assert seen["double"] == pytest.approx(flows.sum() * efforts.sum())


def test_rows_are_cut_where_classes_change():
    loops = (Loop("i", x.const(1), n()),)
    row = Constraint("gamma", "g", (i(),), x.sub(x.var("z", "e", i()), x.var("R", "bf", i())), loops, ONE, PLACE)
    unknown = Unknown("z", ((x.const(1), n()),), ONE, PLACE)
    found, _, _ = primal(sized(line(), 5, constraints=(row,), unknowns=(unknown,)))
    pieces = [(c.at, c.loops[0].first, c.loops[0].last) for c in found.constraints if c.name == "g"]
    assert pieces == [((i(),), x.const(1), x.const(1)), ((i(),), x.const(2), x.param("n"))]


def test_triangular_reads_of_two_pieces_are_refused():
    inner = x.reduction("sum", "j", x.const(1), x.index("i"), x.var("R", "bf", x.index("j")))
    network = sized(line(), 5, observe={"t": summed(inner)})
    with pytest.raises(ModelError, match="E806"):
        primal(network)
