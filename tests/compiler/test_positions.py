"""Positions of points as unknowns of the start, between the springs of a triangle of ground, a and b."""

from dataclasses import replace

import pytest
from catalogue import PLACE
from networks import TRANSLATION, Net, of
from sysdyn.compiler.network.positions import from_stores, with_positions
from sysdyn.compiler.network.quadratures import with_quadratures
from sysdyn.dsl.model import expression as x
from sysdyn.dsl.model.evaluation import evaluate
from sysdyn.dsl.model.network import InitialCondition

pytestmark = pytest.mark.usefixtures("fresh")


def triangle(*said, **parts):
    """Springs s from ground to a, t from a to b, u from ground to b; said: (name, kind, value, fixed)."""
    net = Net()
    net.node("a", TRANSLATION)
    net.node("b", TRANSLATION)
    for name, ends in (("s", ("a",)), ("t", ("b", "a")), ("u", ("b",))):
        net.C(name, 1.0, *ends)
    initials = tuple(InitialCondition(of(name, kind), x.const(v), fixed, (), PLACE) for name, kind, v, fixed in said)
    return replace(net.network(**parts), initials=initials)


def rows(*said, **parts):
    """What the rows between contents and positions miss, and what is said: (name, fixed, value)."""
    found = with_positions(triangle(*said, **parts), frozenset())
    apart = [i.target for i in found.initials if i.store]
    told = [(i.target.data[0], i.fixed, i.value.data) for i in found.initials if not i.store]

    def missed(**at):
        return evaluate(apart, lambda n: at[n.data[0].partition(".")[0]])

    return [p.name for p in found.positions], missed, told


def test_contents_are_differences_of_positions():
    """At a = 1 and b = 3 the springs hold s = a, t = b - a and u = b; what is said of a is said of its position."""
    names, missed, told = rows(("a", "nq", 1.0, True))
    assert names == ["a.start", "b.start"]
    assert missed(a=1.0, b=3.0, s=1.0, t=2.0, u=3.0) == [0.0, 0.0, 0.0]
    assert missed(a=1.0, b=3.0, s=1.5, t=2.25, u=2.0) == [0.5, 0.25, -1.0]
    assert told == [("a.start", True, 1.0)]


def test_where_all_positions_are_told_contents_are_differences_of_these():
    names, missed, told = rows(("a", "nq", 1.0, True), ("b", "nq", 3.0, False))
    assert names == ["a.start", "b.start"]
    assert missed(a=1.0, b=3.0, s=1.0, t=2.0, u=3.0) == [0.0, 0.0, 0.0]
    assert told == [("a.start", True, 1.0), ("b.start", False, 3.0)]


def test_what_is_said_of_contents_stays():
    names, _, told = rows(("t", "bq", 0.5, True))
    assert names == ["a.start", "b.start"]
    assert told == [("t", True, 0.5)]


def test_positions_are_asked_where_they_tell_anything():
    """Springs in a tree of which nothing is said begin for themselves between masses; a loop, or a word, asks for
    their part.
    """
    net = Net()
    for name in "abcd":
        net.node(name, TRANSLATION)
    for name, ends in (("s", ("a", "b")), ("t", ("c",)), ("u", ("d", "c"))):
        net.C(name, 1.0, *ends)
    # the balance of a point without inertia may ask for their contents
    assert [p.name for p in with_positions(net.network(), frozenset()).positions] == [f"{n}.start" for n in "abcd"]
    for name in "abcd":
        net.L(f"m{name}", 1.0, name)
    bare = net.network()
    assert not with_positions(bare, frozenset()).positions
    said = replace(bare, initials=(InitialCondition(of("d", "nq"), x.const(1.0), False, (), PLACE),))
    assert [p.name for p in with_positions(said, frozenset()).positions] == ["c.start", "d.start"]
    net.C("w", 1.0, "a", "b")
    assert [p.name for p in with_positions(net.network(), frozenset()).positions] == ["a.start", "b.start"]


def test_a_quadrature_begins_at_its_position():
    network, wanted = with_quadratures(triangle(observe={"b": of("b", "nq")}))
    found = with_positions(network, wanted)
    (row,) = (i.target for i in found.initials if i.store == "b")
    assert evaluate([row], {of("b.q", "s"): 2.0, x.var("b.start", "start"): 1.5}.get) == [0.5]


def test_a_traced_position_is_that_of_springs_to_the_ground():
    """By s and t as well as by u: the first springs make the forest."""
    read = from_stores(triangle(observe={"b": of("b", "nq")})).observations[0].expression
    assert evaluate([read], {of("s", "bq"): 1.0, of("t", "bq"): 0.5, of("u", "bq"): 1.5}.get) == [1.5]
