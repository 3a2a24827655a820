"""What is decided by numbers once a binding: indices, slopes that inverses rest on, counts, what follows from what."""

import pytest
from catalogue import PLACE
from chains import blank, coordinate, parameter
from networks import Net
from sysdyn.compiler.binding.columns import following
from sysdyn.compiler.binding.counts import match
from sysdyn.compiler.binding.ranges import Ranges
from sysdyn.compiler.equations.order import FactorOrder
from sysdyn.compiler.model.parameters import Parameters
from sysdyn.compiler.network.primal.slopes import Slopes, check_slopes
from sysdyn.dsl.model import expression as x
from sysdyn.dsl.model.network import Loop, Slope
from sysdyn.dsl.text.diagnostics import ModelError

pytestmark = pytest.mark.usefixtures("fresh")


def refused(network, **values):
    with pytest.raises(ModelError) as caught:
        check_slopes(network, Parameters(network, values))
    return [(d.code, d.message) for d in caught.value.diagnostics]


def test_a_law_is_not_divided_by_a_slope_that_became_zero():
    s, a = x.param("s"), x.param("a")
    slopes = (Slope("R", s, (), False, PLACE), Slope("D", a, (), False, PLACE, 1), Slope("V", s, (), True, PLACE))
    network = blank(parameters=(parameter("s", 2.0), parameter("a", 1.0)), slopes=slopes[:2])
    check_slopes(network, Parameters(network, {}))
    assert refused(network, s=0.0) == [("E605", "the law of R cannot be inverted: s is zero")]
    assert refused(network, a=-3.0) == [("E605", "the law of D was compiled for a > 0, which is now -3")]
    flat = blank(parameters=(parameter("s", 0.0),), slopes=slopes[2:])
    check_slopes(flat, Parameters(flat, {}))
    assert refused(flat, s=2.0) == [("E605", "the law of V was compiled for s = 0, which is now 2")]


def test_a_slope_is_flat_where_it_is_zero_in_every_element():
    net, k = Net(), x.index("k")
    net.node("a")
    net.branch("b", "dissipator", "e", None, "a", loops=[("k", 0, 2)])
    (branch,), slopes = net.branches, Slopes(net.network(params={"s": 0.0}))
    assert slopes.flat(branch, x.mul(x.param("s"), x.add(k, x.const(1))))
    assert slopes.flat(branch, k) is None  # zero in the first alone: nothing rests on that
    assert not slopes.flat(branch, x.var("b", "bf", k))
    assert [s.flat for s in slopes.decided] == [True]


def test_an_index_outside_its_family_is_named_by_its_extreme():
    """x[i + m] for i in 1..3, x of 1..4."""
    network = blank(parameters=(parameter("m", 1.0),), coordinates=(coordinate("x"),))
    ranges, i = Ranges({"x": ((1, 4),)}, Parameters(network, {})), x.index("i")
    bounds = ranges.bounds((Loop("i", x.const(1), x.const(3)),), {})
    assert bounds == {"i": (1.0, 3.0)}
    assert not [*ranges.outside(x.var("x", "q", x.add(i, x.param("m"))), bounds)]
    (found,) = ranges.outside(x.var("x", "q", x.add(i, x.const(2))), bounds)
    assert found == "x: index 5 outside 1..4"
    assert ranges.bounds((Loop("i", x.const(2), x.const(1)),), {}) is None


def test_a_largest_matching_takes_partners_back():
    """Rows a, b, c with columns 1, 2 alone: two are matched, however greedy the first was."""
    a, b, c = (("row", k) for k in range(3))
    one, two, three = (("column", k) for k in range(3))
    found = match([a, b, c], {a: [one, two], b: [one], c: [two]})
    assert len(found) == len(set(found.values())) == 2
    assert match([a, b, c], {a: [one, two], b: [one], c: [two, three]}) == {a: two, b: one, c: three}


def test_what_follows_comes_behind_what_it_uses():
    """b = d + e, d = 2 a, e = 3 d, z = 5: of a follow d, e, b."""
    a, d, e = (x.param(n) for n in "ade")
    b = parameter("b", x.add(d, e))
    rest = parameter("e", x.mul(x.const(3), d)), parameter("d", x.mul(x.const(2), a)), parameter("z", 5.0)
    network = blank(parameters=(parameter("a", 1.0), b, *rest))
    assert following(network, {"a"}) == ["d", "e", "b"]
    assert following(network, {"z"}) == []


def test_factors_stand_as_books_write_them():
    """2 (a + b) m t sin(q) q f f' kappa."""
    m, q, f = x.param("m"), x.var("x", "q"), x.var("x", "f")
    total = x.add(x.param("a"), x.param("b"))
    written = [x.const(2), total, m, x.time(), x.call("sin", q), q, f, x.var("x", "f", order=1), x.var("c", "kappa")]
    order = FactorOrder(("a", "m"))
    assert sorted(written[4:] + written[:4], key=order.rank) == written
    assert sorted([x.param("new"), m, x.param("a")], key=order.rank) == [x.param("a"), m, x.param("new")]
