"""N611 by hand: what reads efforts without a reference is told unless a shift of all of them leaves it as it is."""

from types import SimpleNamespace

import pytest
from catalogue import ONE, PLACE
from networks import ELECTRICAL, HYDRAULIC, TRANSLATION, Net, of
from sysdyn.dsl.model import expression as x
from sysdyn.dsl.model.network import Constraint
from sysdyn.dsl.rules.floating import floating
from sysdyn.dsl.text.diagnostics import Report

pytestmark = pytest.mark.usefixtures("fresh")


def island():
    """A loop of a capacitor and a resistor between a and b that nothing joins to ground, and c that is joined."""
    net = Net()
    for name in "abc":
        net.node(name, ELECTRICAL)
    net.C("C", 0.5, "a", "b")
    net.R("R", 2.0, "b", "a")
    net.R("S", 1.0, "c")
    return net


def told(net, expression, **parts):
    network, report = net.network(observe={"seen": expression}, **parts), Report()
    floating(SimpleNamespace(parts=network), network.observations, report)
    return [(d.code, d.message.partition(":")[2]) for d in report]


def e(name):
    return of(name, "ne")


ALONE = [("N611", " nothing joins 'a', 'b' to ground")]
SHIFTS = {
    "an effort": (lambda: e("a"), ALONE),
    "a difference": (lambda: x.sub(e("a"), e("b")), []),
    "a weighted difference": (lambda: x.sub(x.scale(2.0, e("a")), e("b")), ALONE),
    "a difference from what has a reference": (lambda: x.sub(e("a"), e("c")), ALONE),
    "a function of a difference": (lambda: x.call("exp", x.sub(e("b"), e("a"))), []),
    "a product of efforts": (lambda: x.mul(e("a"), e("b")), ALONE),
    "a difference of squares": (lambda: x.sub(x.mul(e("a"), e("a")), x.mul(e("b"), e("b"))), ALONE),
    "what has a reference": (lambda: e("c"), []),
    "a flow": (lambda: of("C", "bf"), []),
}


@pytest.mark.parametrize("case", SHIFTS)
def test_only_what_moves_with_all_efforts_is_told(case):
    made, notes = SHIFTS[case]
    assert told(island(), made()) == notes


def test_an_element_or_a_constraint_is_a_reference():
    grounded = island()
    grounded.R("T", 1.0, "b")
    assert told(grounded, e("a")) == []
    says = Constraint("gamma", "level", (), x.sub(e("b"), x.const(3.0)), (), ONE, PLACE)
    assert told(island(), e("a"), constraints=(says,)) == []


def test_a_law_that_reads_an_effort_alone_is_told():
    net = island()
    net.branch("D", "dissipator", "e", lambda f: x.mul(e("a"), f), "c")
    assert told(net, of("C", "bf")) == ALONE


def test_parts_are_told_by_themselves_and_nodes_of_common_flow_have_references():
    net = Net()
    net.node("p", HYDRAULIC)
    net.node("q", HYDRAULIC)
    net.node("m", TRANSLATION)
    net.R("R", 1.0, "m")
    assert told(net, e("p")) == [("N611", " nothing joins 'p' to ground")]
    assert told(net, e("m")) == []
