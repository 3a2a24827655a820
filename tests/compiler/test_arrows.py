"""Arrows from network to network, one by one: what each makes of a few nodes and branches, written down by hand."""

import numpy as np
import pytest
from catalogue import ONE, PLACE
from networks import ELECTRICAL, TRANSLATION, Net, compiled, matched, of, poles
from sysdyn.compiler.network.along import along
from sysdyn.compiler.network.dead_branches import dead_branches
from sysdyn.compiler.network.floating_parts import add_references
from sysdyn.compiler.network.influence import influences_on, links
from sysdyn.compiler.network.quadratures import massive
from sysdyn.compiler.network.skeleton import fill_shape, shape_of
from sysdyn.compiler.network.written_energies import ALL, as_elements
from sysdyn.dsl.model import expression as x
from sysdyn.dsl.model.evaluation import evaluate
from sysdyn.dsl.model.network import Dynamic, EnergyTerm, State

pytestmark = pytest.mark.usefixtures("fresh")


def ends(b):
    return tuple(None if t is None else t.node for t in (b.plus, b.minus))


def named(network):
    return {b.name: b for b in network.branches}


def value(node, **known):
    return evaluate([node], lambda leaf: known[".".join(leaf.data[:2])])[0]


# -- elements along displacements ----------------------------------------------------------------------------


def field(net, name, plus, minus=None):
    """A branch without a law."""
    net.branch(name, "field", None, None, plus, minus)


@pytest.mark.parametrize(("sign", "expected"), [(1.0, ("a", "b")), (-1.0, ("b", "a"))])
def test_a_spring_along_a_branch_stands_beside_it(sign, expected):
    net = Net()
    for name in "ab":
        net.node(name, TRANSLATION)
    field(net, "gap", "a", "b")
    net.branch("spring", "potential", "e", lambda q: q, None, of=TRANSLATION, on=x.scale(sign, of("gap", "bq")))
    found = named(along(net.network(), complementary=False))
    assert set(found) == {"spring"}  # the gap was but the way of it
    assert ends(found["spring"]) == expected


def test_elements_along_a_branch_between_common_effort_nodes_are_in_series():
    """R and C along the charge of one branch, C against it: one flow, e = e_R - e_C."""
    net = Net()
    for name in "ab":
        net.node(name, ELECTRICAL)
    field(net, "way", "a", "b")
    net.branch("R", "dissipator", "e", lambda f: f, None, of=ELECTRICAL, on=of("way", "bq"))
    net.branch("C", "potential", "q", lambda e: e, None, of=ELECTRICAL, on=x.neg(of("way", "bq")))
    found = along(net.network(observe={"e": of("way", "be"), "f": of("way", "bf")}), complementary=False)
    branches = named(found)
    assert set(branches) == {"R", "C"}
    inner = {n.name for n in found.nodes} - {"a", "b"}
    assert len(inner) == 1
    assert ends(branches["R"]) == ("a", *inner)
    assert ends(branches["C"]) == ("b", *inner)
    read = {o.name: o.expression for o in found.observations}
    assert value(read["e"], **{"R.be": 5.0, "C.be": 3.0}) == 2.0
    assert value(read["f"], **{"R.bf": 7.0}) == 7.0


def test_a_combination_becomes_transformers():
    """A spring on u = 2 a - 3 b of two masses: as a lever, w^2 = k (4/m1 + 9/m2) = 7; and 2 more by a force u on a
    against it.
    """

    def net(gain):
        net = Net()
        for name in "ab":
            net.node(name, TRANSLATION)
        net.L("m1", 1.0, "a")
        net.L("m2", 3.0, "b")
        lever = x.linear(0.0, [(2.0, of("a", "nq")), (-3.0, of("b", "nq"))])
        net.branch("k", "potential", "e", lambda q: q, None, of=TRANSLATION, on=lever)
        net.V("force", x.scale(gain, of("k", "bq")), "a")
        return net.network()

    found = along(net(0.0), complementary=True)
    assert sorted(value(c.ratio) for c in found.couplings) == [-3.0, 2.0]
    assert named(found)["k"].on is None
    for gain in (0.0, 1.0):
        for network in (net(gain), along(net(gain), complementary=True)):
            seen = poles(compiled(network))
            assert matched(seen[np.abs(seen) > 0.1], (7.0 + 2.0 * gain) ** 0.5 * np.array([1j, -1j])) < 1e-6


# -- state functions as elements -----------------------------------------------------------------------------


def test_an_energy_of_a_difference_is_a_spring():
    net = Net()
    for name in "ab":
        net.node(name, TRANSLATION)
    u = x.sub(of("a", "nq"), of("b", "nq"))
    energy = EnergyTerm("V", x.mul(x.const(1.5), u, u, u), (), PLACE)
    found = as_elements(net.network(energies=(energy,)), ALL)
    (b,) = found.branches
    assert not found.energies
    assert (b.kind, b.side, ends(b)) == ("potential", "e", ("a", "b"))
    assert value(b.law, **{f"{b.name}.bq": 2.0}) == 3 * 1.5 * 4.0


def test_an_energy_of_a_sum_of_nodes_is_no_element():
    net = Net()
    for name in "ab":
        net.node(name, TRANSLATION)
    u = x.add(of("a", "nq"), of("b", "nq"))
    found = as_elements(net.network(energies=(EnergyTerm("V", x.mul(u, u), (), PLACE),)), ALL)
    assert not found.branches
    assert len(found.energies) == 1


def test_coupled_inductances_are_laws_that_read_each_other():
    """T* = f1^2 + f1 f2 + 3 f2^2: p1 = 2 f1 + f2, p2 = f1 + 6 f2, and the audit keeps f p - T*."""
    net = Net()
    for name in "ab":
        net.node(name, ELECTRICAL)
        field(net, f"l{name}", name)
    one, two = of("la", "bf"), of("lb", "bf")
    energy = EnergyTerm("T*", x.add(x.mul(one, one), x.mul(one, two), x.scale(3.0, x.mul(two, two))), (), PLACE)
    found = as_elements(net.network(energies=(energy,)), ALL)
    known = {"la.bf": 2.0, "lb.bf": 5.0}
    laws = [value(named(found)[name].law, **known) for name in ("la", "lb")]
    assert laws == [9.0, 32.0]
    (kept,) = found.energies
    assert value(kept.expression, **known, **{"la.bp": 9.0, "lb.bp": 32.0}) == 2 * 9.0 + 5 * 32.0 - (4 + 10 + 75)


# -- parts without ground, masses, dead ends -----------------------------------------------------------------


def test_each_part_without_a_ground_gets_one_reference():
    net = Net()
    for name in "abcde":
        net.node(name, ELECTRICAL)
    for name, *pair in (("1", "a", "b"), ("2", "b", "c"), ("3", "c", "a"), ("4", "d", "e"), ("5", "d", "e")):
        net.C(name, 1.0, *pair)
    net.C("6", 1.0, "e")  # d and e reach the ground
    found = add_references(net.network()).constraints
    assert [(c.kind, c.name.rpartition(".")[2]) for c in found] == [("psi", "reference")]
    assert found[0].name[0] in "abc"


def test_a_part_that_counts_from_another_node_than_its_ground_needs_none():
    net = Net()
    for name in "abc":
        net.node(name, ELECTRICAL)
    for name, *pair in (("1", "a", "b"), ("2", "b", "c"), ("3", "b"), ("4", "b")):
        net.C(name, 1.0, *pair)
    assert not add_references(net.network()).constraints


def test_a_mass_on_each_point_of_a_family():
    def net(last):
        net = Net()
        net.node("m", TRANSLATION, (1, 4))
        net.L("mass", 1.0, ("m", x.index("i")), loops=(("i", 1, last),))
        return net.network()

    assert massive(net(4)) == {"m"}
    assert massive(net(3)) == frozenset()


def test_a_branch_to_a_node_of_its_own_is_dead_unless_it_is_read():
    def dead(asked):
        net = Net()
        for name in "ab":
            net.node(name, ELECTRICAL)
        net.R("R", 1.0, "a")
        net.C("C", 1.0, "a")
        net.R("stub", 1.0, "a", "b")
        network = net.network()
        return dead_branches(network, links(network), frozenset(asked))

    assert dead([("n", "a")]) == [frozenset({("b", "stub"), ("n", "b")})]
    assert dead([("n", "b")]) == []
    assert dead([("b", "stub")]) == []


# -- influence ----------------------------------------------------------------------------------------------


def test_what_is_read_influences_and_is_not_influenced():
    """A filter s' = e(a) - s drives a second circuit: asked of this one both are needed, of the first one it alone."""
    net = Net()
    for name in "ab":
        net.node(name, ELECTRICAL)
    net.R("R", 1.0, "a")
    net.C("C", 1.0, "a")
    net.V("source", of("s", "s"), "b")
    net.R("load", 1.0, "b")
    network = net.network(
        states=(State("s", (), ONE, PLACE),),
        dynamics=(Dynamic(of("s", "s"), x.sub(of("a", "ne"), of("s", "s")), (), PLACE),),
    )
    found = links(network)
    first = {("n", "a"), ("b", "R"), ("b", "C")}
    assert influences_on(found, frozenset({("n", "a")})) == first
    assert influences_on(found, frozenset({("s", "s")})) == first | {("s", "s")}
    every = first | {("s", "s"), ("n", "b"), ("b", "source"), ("b", "load")}
    assert influences_on(found, frozenset({("n", "b")})) == every


# -- laws with holes ----------------------------------------------------------------------------------------


def law(name, first, second):
    f = of(name, "bf")
    return x.linear(1.0, [(first, f), (2.0, x.call("exp", x.scale(second, f)))])


def test_laws_that_differ_in_numbers_have_one_shape():
    one, other = shape_of(law("r1", 3.0, 0.5), "r1"), shape_of(law("r2", 4.0, 0.7), "r2")
    assert one.key == other.key
    assert [h.data for h in one.holes] != [h.data for h in other.holes]
    assert fill_shape(one, "r2", (), other.holes) is law("r2", 4.0, 0.7)
    own = fill_shape(one, "r", (x.const(4.0),), one.holes)
    assert {n.args for n in x.variables(own)} == {(x.const(4.0),)}
    assert value(own, **{"r.bf": 2.0}) == pytest.approx(1.0 + 3.0 * 2.0 + 2.0 * 2.718281828459045)


def test_laws_of_other_functions_have_another_shape():
    f = of("r", "bf")
    shapes = [x.call("exp", f), x.call("sin", f), x.mul(f, f), x.power(f, x.const(3.0)), of("r", "be")]
    keys = {shape_of(x.scale(2.0, node), "r").key for node in shapes}
    assert len(keys) == len(shapes)
    assert shape_of(of("other", "bf"), "r") is None
    assert shape_of(x.call("abs", f), "r") is None
