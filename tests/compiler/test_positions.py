"""Initial positions of points as contents of the springs between them: a triangle of ground, a and b."""

from dataclasses import replace

import pytest
from catalogue import PLACE
from networks import TRANSLATION, Net, of
from sysdyn.compiler.network.positions import UNWRITTEN, from_stores, with_contents
from sysdyn.dsl.model import expression as x
from sysdyn.dsl.model.network import Initial

pytestmark = pytest.mark.usefixtures("fresh")


def triangle(*said, **parts):
    """Springs s from ground to a, t from a to b, u from ground to b; said: (name, kind, value, fixed)."""
    net = Net()
    net.node("a", TRANSLATION)
    net.node("b", TRANSLATION)
    for name, ends in (("s", ("a",)), ("t", ("b", "a")), ("u", ("b",))):
        net.C(name, 1.0, *ends)
    initials = tuple(Initial(of(name, kind), x.const(v), fixed, (), PLACE) for name, kind, v, fixed in said)
    return replace(net.network(**parts), initials=initials)


def begun(*said):
    """Guessed contents by name, and what fixed rows miss at contents."""
    initials = with_contents(triangle(*said), frozenset()).initials
    guesses = {i.target.data[0]: i.value.data for i in initials if not i.fixed}
    rows = [x.sub(i.target, i.value) for i in initials if i.fixed]
    return guesses, lambda **at: x.evaluate(rows, lambda n: at[n.data[0]])


def test_springs_begin_at_the_difference_of_their_ends():
    """a = 1 and b ~ 3: s = 1 is fixed with a, and t and u differ by it."""
    guesses, missed = begun(("a", "nq", 1.0, True), ("b", "nq", 3.0, False))
    assert guesses == {"s": 1.0, "t": 2.0, "u": 3.0}
    assert missed(s=1.0, t=2.0, u=3.0) == [0.0, 0.0]
    assert missed(s=1.5, t=2.0, u=3.0) == [0.5, 0.0]
    assert missed(s=1.0, t=2.0, u=3.25)[1] in (0.25, -0.25)


def test_a_content_that_is_said_moves_points_least():
    """t = 1/2 pulls a and b apart alike; a guess of a holds it but for the weight of b, which is not said."""
    guesses, missed = begun(("t", "bq", 0.5, True))
    assert guesses == {"s": -0.25, "u": 0.25}
    assert missed(s=-0.25, t=0.5, u=0.25) == [0.0, 0.0]
    guesses, _ = begun(("t", "bq", 0.5, True), ("a", "nq", 1.0, False))
    apart = 1.5 * UNWRITTEN / (1.0 + UNWRITTEN)  # b would go from 0 to 3/2
    assert guesses == pytest.approx({"s": 1.0 - apart, "u": 1.5 - apart}, rel=1e-15)


def test_a_traced_position_is_that_of_springs_to_the_ground():
    """By s and t as well as by u: the first springs make the forest."""
    read = from_stores(triangle(observe={"b": of("b", "nq")})).observations[0].expression
    assert x.evaluate([read], {of("s", "bq"): 1.0, of("t", "bq"): 0.5, of("u", "bq"): 1.5}.get) == [1.5]
