"""Boxes of indices and the classes that links make of their elements, against every element visited."""

import itertools

import numpy as np
import pytest
from chains import blank, parameter
from networks import ELECTRICAL, Net
from sysdyn.compiler.network.primal.bounds import (
    Affine,
    Interval,
    WholeNumbers,
    box_difference,
    box_size,
    box_union,
    number,
    parts,
    union,
)
from sysdyn.compiler.network.primal.cycles import in_loops
from sysdyn.compiler.network.primal.incidence import elements
from sysdyn.compiler.network.primal.index_classes import IndexClasses, Link, LinkEnd
from sysdyn.dsl.model import expression as x
from sysdyn.dsl.model.connected_components import Joined
from sysdyn.dsl.text.diagnostics import ModelError

pytestmark = pytest.mark.usefixtures("fresh")


def box(*ranges):
    return tuple(Interval(number(a), number(b)) for a, b in ranges)


def plain(found):
    return [(i.first.value, i.last.value) for i in found]


def inside(found):
    return set(itertools.product(*(range(i.first.value, i.last.value + 1) for i in found)))


# -- boxes -------------------------------------------------------------------------------------------------


def random_box(random, dimensions, within=None):
    ranges = []
    for d in range(dimensions):
        first, last = (1, 6) if within is None else plain(within)[d]
        ranges.append(sorted(int(v) for v in random.integers(first, last + 1, 2)))
    return box(*ranges)


@pytest.mark.parametrize("seed", range(30))
def test_what_is_left_of_a_box_around_a_hole(seed):
    """The parts hold each element outside of the hole once; with the hole they are one box again."""
    random = np.random.default_rng(seed)
    whole = random_box(random, int(random.integers(1, 4)))
    hole = random_box(random, len(whole), whole)
    left = list(box_difference(whole, hole))
    assert sum(map(box_size, left)) == box_size(whole) - box_size(hole)
    assert set().union(*map(inside, left)) == inside(whole) - inside(hole)
    assert [plain(b) for b in union([*left, hole])] == [plain(whole)]


def test_boxes_that_do_not_make_one():
    assert box_union(box((1, 2)), box((4, 5))) is None
    assert box_union(box((1, 2), (1, 3)), box((3, 4), (1, 2))) is None
    assert plain(box_union(box((3, 4), (1, 2)), box((1, 2), (1, 2)))) == [(1, 4), (1, 2)]


def test_parts_have_names_of_their_own():
    found = parts([("a", box((1, 2))), ("b", box((1, 1))), ("a", box((5, 6))), ("a", box((3, 3)))])
    assert [(p.name, plain(p.box)) for p in found] == [
        ("a", [(1, 3)]), ("b", [(1, 1)]), ("a.2", [(5, 6)]), ("a", [(1, 3)]),
    ]  # fmt: skip


def test_sizes_of_expressions_of_parameters():
    i, n = x.index("i"), x.param("n")
    square = x.mul(i, i)
    sizes = WholeNumbers(
        blank(parameters=(parameter("n", 4.0, whole=True), parameter("a", square, ((x.const(2), n),), ("i",))))
    )
    assert sizes.bound(x.add(n, x.const(-1.0)), None).value == 3
    assert sizes.value(x.param("a", x.const(3.0))) == 9.0
    found = sizes.affine(x.linear(1.0, [(1.0, i), (2.0, n)]), ("i",), None)
    assert (found.loop, found.offset.value) == ("i", 9)
    assert sizes.affine(n, ("i",), None) == Affine(None, sizes.bound(n, None))
    with pytest.raises(ModelError, match="E805"):
        sizes.bound(x.mul(x.const(0.3), n), None)
    with pytest.raises(ModelError, match="E806"):
        sizes.affine(x.linear(0.0, [(2.0, i)]), ("i",), None)


# -- classes -----------------------------------------------------------------------------------------------


def classes_of(found, items):
    """The class of each element by cells: the group, and the places along axes that nothing ties together."""
    of = {}
    for item in range(len(items)):
        for cell in found.cells(item):
            root, _ = found.find(cell)
            open_ = found.free_dimensions(cell)
            for at in inside(found.box(cell)):
                along = [(axis, at[d] + found.axis(item, d)[1].value) for d, axis, _ in open_]
                of[item, at] = root, frozenset(along)
    return of


def visited(items, links):
    """The class of each element by joining element to element."""
    tied = Joined()
    for link in links:
        for k in inside(link.box):
            one, other = (tuple(c.value + (0 if n is None else k[n]) for n, c in e.at) for e in (link.a, link.b))
            tied.join((link.a.item, one), (link.b.item, other))
    return {(item, at): tied.first((item, at)) for item, own in enumerate(items) for at in inside(own)}


def random_link(random, items):
    """One that stays inside of two items: each of their indices is one of the link's plus a number, or a number."""
    lengths = [int(v) for v in random.integers(1, 5, 2)]
    ends = []
    for which in (int(random.integers(len(items))) for _ in range(2)):
        at, order = [], random.permutation(2) if random.random() < 0.2 else (0, 1)
        for index, (first, last) in zip(order, plain(items[which]), strict=False):
            room = last - first + 1 - lengths[index]
            runs = room >= 0 and random.random() < 0.8
            own = int(random.integers(first, first + room + 1 if runs else last + 1))
            at.append((int(index) if runs else None, number(own)))
        ends.append(LinkEnd(which, tuple(at)))
    return Link(box(*((0, length - 1) for length in lengths)), *ends)


def random_net(random, dimensions):
    """Families, and links between them."""
    items = [random_box(random, dimensions if random.random() < 0.8 else 1) for _ in range(random.integers(1, 4))]
    return items, [random_link(random, items) for _ in range(int(random.integers(1, 6)))]


@pytest.mark.parametrize("dimensions", [1, 2])
@pytest.mark.one_in(2)
def test_elements_belong_together_as_if_each_link_were_followed(dimensions):
    followed = 0
    for seed in range(1500):
        random = np.random.default_rng([seed, dimensions])
        items, links = random_net(random, dimensions)
        found = IndexClasses(items, links)
        if found.refused:
            continue
        followed += 1
        mine, theirs = classes_of(found, items), visited(items, links)
        assert set(mine) == set(theirs), seed
        pairs = set(zip((mine[e] for e in theirs), theirs.values(), strict=True))
        assert len(pairs) == len(set(mine.values())) == len(set(theirs.values())), seed
    assert followed > 100


def test_a_run_is_one_class_and_its_far_end_another():
    """x[1..9], x[k] = x[k+1] for k = 3..5: 3..6 are one, the others stand alone."""
    ends = LinkEnd(0, ((0, number(0)),)), LinkEnd(0, ((0, number(1)),))
    found = IndexClasses([box((1, 9))], [Link(box((3, 5)), *ends)])
    assert not found.refused
    assert sorted(plain(found.box(c))[0] for c in found.cells(0)) == [(1, 2), (3, 6), (7, 9)]
    assert [bool(found.free_dimensions(c)) for c in found.cells(0)] == [True, False, True]


def test_items_that_lie_beside_each_other_are_moved_onto_one_axis():
    """x[k] = y[k + 3] for k = 1..4, twice by other counts: no cut, no run, one class of four elements."""
    links = [Link(box((1, 4)), LinkEnd(0, ((0, number(0)),)), LinkEnd(1, ((0, number(3)),)))]
    links += [Link(box((2, 5)), LinkEnd(1, ((0, number(2)),)), LinkEnd(0, ((0, number(-1)),)))]
    found = IndexClasses([box((1, 4)), box((4, 7))], links)
    assert not found.refused
    assert [[plain(found.box(c))[0] for c, _ in group] for group in found.groups().values()] == [[(1, 4), (4, 7)]]


def test_senses_multiply_along_links():
    a, b, c = (LinkEnd(k, ()) for k in range(3))
    found = IndexClasses([(), (), ()], [Link((), a, b, -1), Link((), b, c, -1)])
    assert [found.find((k, ()))[1] for k in range(3)] == [1, -1, 1]


def test_a_link_over_two_steps_is_refused():
    ends = LinkEnd(0, ((0, number(0)),)), LinkEnd(0, ((0, number(2)),))
    assert IndexClasses([box((1, 9))], [Link(box((1, 7)), *ends)]).refused


# -- loops -------------------------------------------------------------------------------------------------


def looped(make):
    net = Net()
    make(net)
    network = net.network()
    found = elements(network, WholeNumbers(network))
    closed = in_loops([(e.ends[0].node, e.ends[1].node, box_size(e.box)) for e in found])
    return {found[k].name for k in closed}


def test_a_tree_has_no_loop_and_one_more_branch_closes_it():
    def tree(net, *more):
        for name in "abcd":
            net.node(name, ELECTRICAL)
        for name, *ends in (("1", "a", "b"), ("2", "b", "c"), ("3", "b", "d"), *more):
            net.R(name, 1.0, *ends)

    assert looped(tree) == set()
    assert looped(lambda net: tree(net, ("4", "d", "c"))) == {"1", "2", "3", "4"}
    assert looped(lambda net: tree(net, ("4", "a"), ("5", "d"))) == {"1", "2", "3", "4", "5"}
    assert looped(lambda net: tree(net, ("4", "a"))) == set()


def test_a_chain_within_a_family_closes_a_loop_with_two_ways_out():
    def chain(net, ways):
        net.node("v", ELECTRICAL, (1, 5))
        net.R("r", 1.0, ("v", x.index("i")), ("v", x.add(x.index("i"), x.const(1))), loops=(("i", 1, 4),))
        for k in ways:
            net.R(f"w{k}", 1.0, ("v", k))

    assert looped(lambda net: chain(net, [1])) == set()
    assert looped(lambda net: chain(net, [1, 5])) == {"r", "w1", "w5"}


def test_a_chain_and_branches_beside_it_close_loops():
    def ladder(net, last):
        i = x.index("i")
        net.node("v", ELECTRICAL, (1, 5))
        net.R("r", 1.0, ("v", i), ("v", x.add(i, x.const(1))), loops=(("i", 1, 4),))
        net.R("w", 1.0, ("v", i), loops=(("i", 1, last),))

    assert looped(lambda net: ladder(net, 1)) == set()
    assert looped(lambda net: ladder(net, 2)) == {"r", "w"}
