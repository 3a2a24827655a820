"""What statements say of elements that run over loops of their own, against a look at every element."""

import pytest
from catalogue import PLACE
from chains import blank
from sysdyn.compiler.network.primal.bounds import WholeNumbers
from sysdyn.compiler.network.primal.overlaps import initially, meeting, ranges_of, restrict_loops, untold
from sysdyn.dsl.model import expression as x
from sysdyn.dsl.model.evaluation import evaluate
from sysdyn.dsl.model.network import InitialCondition, Loop

pytestmark = pytest.mark.usefixtures("fresh")


def over(name, first, last):
    return Loop(name, x.const(first), x.const(last))


def said(at, value, *loops):
    return InitialCondition(x.var("c", "bq", *at), value, True, loops, PLACE)


def whole(within):
    return {name: (i.first.value, i.last.value) for name, i in within.items()}


def test_a_value_holds_where_its_elements_are_and_zero_elsewhere():
    """c[i] = 2 i for i in 3..5 and c[8] = 7, read at c[k + 1] for k in 0..9."""
    sizes, i, k = WholeNumbers(blank()), x.index("i"), x.index("k")
    within = ranges_of([over("k", 0, 9)], sizes, PLACE)
    statements = [said([i], x.mul(x.const(2), i), over("i", 3, 5)), said([x.const(8)], x.const(7))]
    at = [x.add(k, x.const(1))]
    found = initially(statements, at, within, sizes)
    values = [evaluate([found], {k: float(here)}.get)[0] for here in range(10)]
    assert values == [0, 0, 6, 8, 10, 0, 0, 7, 0, 0]
    assert [whole(rest)["k"] for rest in untold(statements, at, within, sizes)] == [(0, 1), (5, 6), (8, 9)]
    assert initially(statements, [x.add(k, x.const(20))], within, sizes) is None


def test_the_part_that_two_ranges_share_is_a_loop_of_its_own():
    sizes, loops = WholeNumbers(blank()), [over("k", 0, 9)]
    i, k = x.index("i"), x.index("k")
    found, value = meeting(said([i], i, over("i", 3, 50)), [k], ranges_of(loops, sizes, PLACE), sizes)
    (loop,) = restrict_loops(loops, found)
    assert (loop.index, loop.first, loop.last, value) == ("k", x.const(3), x.const(9), k)


def test_indices_that_do_not_tell_the_elements_meet_nothing():
    """c[2 k, k] is no i + c; c[i, i] read at c[k, 4] holds for one k alone."""
    sizes, i, k = WholeNumbers(blank()), x.index("i"), x.index("k")
    within = ranges_of([over("k", 0, 9)], sizes, PLACE)
    for at in ((x.mul(x.const(2), k), k), (k, x.const(4))):
        assert meeting(said([i, i], i, over("i", 0, 9)), at, within, sizes) is None
