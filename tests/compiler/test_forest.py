"""Positions over a spanning forest of families of links, against every element visited."""


import numpy as np
import pytest
from sysdyn.compiler.network.primal.bounds import number
from sysdyn.compiler.network.primal.forest import IndexForest
from sysdyn.compiler.network.primal.index_classes import End, Link
from sysdyn.dsl.model import expression as x
from sysdyn.dsl.model.joined import Joined
from test_index_classes import box, inside, random_net

pytestmark = pytest.mark.usefixtures("fresh")


def point(end, k):
    """The element at an end of a link with these indices."""
    return end.item, tuple(c.value + (0 if n is None else k[n]) for n, c in end.at)


def value(root, held, bound):
    """The value of an expression that reads contents `var(link, "bq", ...)`."""
    if root.op == "reduce":
        first, last = (round(value(a, held, bound)) for a in root.args[:2])
        return sum(value(root.args[2], held, {**bound, root.data[1]: k}) for k in range(first, last + 1))
    if root.op == "sum":
        return root.data[0] + sum(c * value(a, held, bound) for c, a in zip(root.data[1], root.args, strict=True))
    if root.op == "var":
        return held[int(root.data[0]), tuple(round(value(a, held, bound)) for a in root.args)]
    return bound[root.data] if root.op == "index" else root.data


def forest_of(items, links):
    named = [Link(link.box, link.a, link.b, owner=n) for n, link in enumerate(links)]
    told = [x.var(str(n), "bq", *(x.index(f"#k{k}") for k in range(len(link.box)))) for n, link in enumerate(links)]
    return IndexForest(items, [list(zip(named, told, strict=True))])


def over(k):
    """Link indices with these values."""
    return {f"#k{d}": v for d, v in enumerate(k)}


@pytest.mark.parametrize("dimensions", [1, 2])
def test_loops_are_those_of_the_elements_and_no_more(dimensions):
    """Each loop holds for the contents of all positions; there are as many as elements less points that they join."""
    followed = 0
    for seed in range(120):
        random = np.random.default_rng([seed, dimensions])
        items, links = random_net(random, dimensions)
        points = {(item, at): place for place, (item, at) in enumerate(everywhere(items))}
        ends = {(n, k): (point(e.a, k), point(e.b, k)) for n, e in enumerate(links) for k in inside(e.box)}
        row = dict(zip(ends, np.eye(len(ends)), strict=True))
        incidence, joined = np.zeros((len(ends), len(points))), Joined()
        for place, (a, b) in enumerate(ends.values()):
            incidence[place, points[a]] += 1.0
            incidence[place, points[b]] -= 1.0
            joined.join(a, b)
        found = forest_of(items, links)
        loops = [
            value(around, row, over(k)) - row[owner, k] for owner, own, around in found.loops for k in inside(own)
        ]
        rows = np.array(loops).reshape(len(loops), len(ends))
        assert np.abs(rows @ incidence).max(initial=0.0) < 1e-12, seed
        if not found.refused:
            followed += 1
            number = len(ends) - len(points) + len({joined.first(p) for p in points})
            assert len(rows) == number == np.linalg.matrix_rank(rows) if number else not len(rows), seed
    assert followed > 100


def everywhere(items):
    """All elements."""
    return ((item, at) for item, own in enumerate(items) for at in inside(own))


def test_a_position_over_another_is_what_lies_between():
    """x[1..9] in a row, its links numbered as their lower ends: x[7] over x[3] is 3 + 4 + 5 + 6."""
    chain = Link(box((1, 8)), End(0, ((0, number(1)),)), End(0, ((0, number(0)),)))
    apart = End(1, ())
    found = forest_of([box((1, 9)), ()], [chain])
    held = {(0, (k,)): k for k in range(1, 9)}
    ends = [End(0, ((None, number(k)),)) for k in (7, 3)]
    assert value(found.between(*ends), held, {}) == 18
    assert found.between(ends[0], apart) is None
    ((cell,),) = found.trees()
    total, count = found.summed(cell, found.along(cell))
    assert count.data == 9
    assert value(total, held, {}) == sum(k * (9 - k) for k in range(1, 9))
