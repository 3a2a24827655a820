"""What a network becomes is counted: coordinates less node rows are its meshes; contents and ranges by closed forms."""

import types
from dataclasses import replace

import numpy as np
import pytest
from networks import ELECTRICAL, TRANSLATION, Net
from sysdyn.compiler.forms.coverage import bind_covers
from sysdyn.compiler.network.primal.balances import balances
from sysdyn.compiler.network.primal.bounds import WholeNumbers, box_size
from sysdyn.compiler.network.primal.contents import held_at
from sysdyn.compiler.network.primal.incidence import Incidence
from sysdyn.compiler.network.primal.series import series
from sysdyn.dsl.model import expression as x
from sysdyn.dsl.model.connected_components import Joined
from sysdyn.dsl.model.evaluation import evaluate
from sysdyn.dsl.model.network import Loop

pytestmark = pytest.mark.usefixtures("fresh")


def counted(net):
    """Coordinates and node rows of a network, by elements."""
    network = net.network()
    sizes = WholeNumbers(network)
    incidence = Incidence(network, sizes)
    classes = series(incidence, frozenset())
    rows = balances(incidence, classes.merged).constraints
    coordinates = sum(box_size(sizes.box(c.shape, None)) for c in classes.coordinates)
    return coordinates, sum(box_size(tuple(sizes.interval(k.first, k.last, None) for k in r.loops)) for r in rows)


def meshes(edges):
    """Branches less nodes and more parts."""
    joined = Joined()
    for a, b in edges:
        joined.join(a, b)
    nodes = {end for edge in edges for end in edge}
    return len(edges) - len(nodes) + len({joined.first(n) for n in nodes})


@pytest.mark.parametrize("seed", range(40))
def test_coordinates_less_rows_are_the_meshes(seed):
    """Of any graph: each mesh has one flow of its own, whatever was merged into series classes."""
    random, net = np.random.default_rng(seed), Net()
    names = [f"n{k}" for k in range(int(random.integers(2, 8)))]
    edges = []
    for name in names:
        net.node(name, ELECTRICAL)
    for k in range(int(random.integers(len(names), 2 * len(names) + 2))):
        a, b = random.choice([*names, None], 2, replace=False)
        net.R(f"r{k}", 1.0, a, b) if random.random() < 0.5 else net.C(f"r{k}", 1.0, a, b)
        edges.append((a, b))
    coordinates, rows = counted(net)
    assert coordinates - rows == meshes(edges)


@pytest.mark.parametrize("ends", [(), ("first",), ("first", "last"), ("first", "last", "rungs")])
@pytest.mark.parametrize("n", [2, 7])
def test_the_meshes_of_a_chain_are_those_of_its_elements(ends, n):
    """A family of n branches in a row, tied to the ground at its ends, and at each of its nodes."""
    i, net = x.index("i"), Net()
    net.node("v", ELECTRICAL, (0, n))
    net.R("s", 1.0, ("v", x.add(i, x.const(-1))), ("v", i), loops=(("i", 1, n),))
    edges = [(k - 1, k) for k in range(1, n + 1)]
    for end in ends:
        where = {"first": 0, "last": n}
        if end in where:
            net.R(end, 1.0, ("v", where[end]))
            edges.append((where[end], None))
        else:
            net.C(end, 1.0, ("v", i), loops=(("i", 1, n),))
            edges += [(k, None) for k in range(1, n + 1)]
    coordinates, rows = counted(net)
    assert coordinates - rows == meshes(edges)


def test_what_a_store_holds_at_an_effort_or_flow():
    """q = C e, p = L f, either way the law is written; no law that is not a line is turned round."""
    net = Net()
    for name in "ab":
        net.node(name, ELECTRICAL)
    net.C("C", 0.5, "a")
    net.L("L", 0.25, "a", "b")
    branches = {b.name: b for b in net.network().branches}
    value = x.const(3.0)
    assert evaluate([held_at(branches["C"], "be", value)], float) == [1.5]
    assert evaluate([held_at(branches["L"], "bf", value)], float) == [0.75]
    turned = replace(branches["C"], side="be", law=x.linear(1.0, ((2.0, x.var("C", "bq")),)))
    assert evaluate([held_at(turned, "be", value)], float) == [1.0]
    bent = replace(turned, law=x.power(x.var("C", "bq"), x.const(2.0)))
    assert held_at(bent, "be", value) is None
    assert held_at(branches["C"], "bq", value) is value
    assert held_at(branches["C"], "bf", value) is None


@pytest.mark.parametrize(("masses", "found"), [((2, 5), (2, 5)), ((3, 3), (3, 3)), (None, (1, 0)), ((2, 5, 2), (1, 6))])
def test_the_range_that_carries_momenta(masses, found):
    """Of x[1..6]: from the first to the last that a store moves with; none without stores, all around holes."""
    places = []
    if masses is not None:
        first, last, step = (*masses, 1)[:3]
        loop = Loop("#0", x.const(0), x.const((last - first) // step))
        places = [((loop,), x.linear(float(first), ((float(step), x.index("#0")),)))]
    parameters = types.SimpleNamespace(lookup=float, hidden={})
    bind_covers([("x", tuple(places))], {"x": ((1, 6),)}, parameters)
    assert (parameters.hidden["#first x"], parameters.hidden["#last x"]) == found


def test_a_mass_between_springs_has_one_coordinate():
    """Common-flow nodes are coordinates themselves: no series classes, no rows."""
    net = Net()
    net.node("x", TRANSLATION)
    net.L("m", 2.0, "x")
    net.C("k", 0.5, "x", of=TRANSLATION)
    assert counted(net) == (0, 0)
