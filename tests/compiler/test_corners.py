"""Rows whose branches events hold: surfaces of a form, and loops that are written out for them, element by element."""

import pytest
from catalogue import PLACE
from chains import blank, parameter
from sysdyn.compiler.forms.corners import kinks
from sysdyn.compiler.forms.corners import written as module
from sysdyn.compiler.forms.corners.kinks import Surface, surfaces
from sysdyn.compiler.forms.corners.written import written
from sysdyn.compiler.forms.descriptor import Block, DescriptorForm, EquationFamily, LoopKernel, Summand
from sysdyn.dsl.model import expression as x
from sysdyn.dsl.model.network import Loop

pytestmark = pytest.mark.usefixtures("fresh")

BLOCKS = ("dynamics", "phi", "observe")


def counter(depth):
    return x.index(f"#{depth}")


def f(*at):
    return x.var("a", "f", *(x.const(k) if isinstance(k, int) else k for k in at))


def size(of):
    return x.call("abs", of)


def over(first, last, depth=0):
    bounds = (x.const(k) if isinstance(k, int) else k for k in (first, last))
    return Loop(f"#{depth}", *bounds)


def form(**blocks):
    """Blocks, each one kernel: (nest, expression of its only row), at the loop variables of the nest."""
    rows = tuple(EquationFamily(name, "a", "a", name, "N", PLACE) for name in BLOCKS)
    made = []
    for name, (nest, expression) in blocks.items():
        at = tuple(counter(k) for k in range(len(nest)))
        made.append(Block(name, (LoopKernel(tuple(nest), (Summand(BLOCKS.index(name), at, expression),)),)))
    return DescriptorForm("lagrangian", (), rows, tuple(made), (), (), (), ())


def elements(block):
    """(indices, expression) of the rows of a block that is written out."""
    (kernel,) = block.kernels
    assert kernel.nest == ()
    return [(tuple(int(n.data) for n in s.at), s.expression) for s in kernel.rows]


NETWORK = blank(parameters=(parameter("n", 3.0, whole=True),))


def test_a_loop_whose_rows_have_corners_is_written_out():
    (block,) = written(form(dynamics=([over(1, x.param("n"))], size(f(counter(0))))), NETWORK).blocks
    assert elements(block) == [((k,), size(f(k))) for k in (1, 2, 3)]


def test_bounds_that_follow_an_outer_loop():
    """j from i to 2: (1, 1), (1, 2), (2, 2)."""
    nest = [over(1, 2), over(counter(0), 2, 1)]
    (block,) = written(form(dynamics=(nest, size(f(counter(0), counter(1))))), NETWORK).blocks
    assert elements(block) == [(at, size(f(*at))) for at in ((1, 1), (1, 2), (2, 2))]


@pytest.mark.parametrize(
    "make",
    [
        lambda: x.mul(f(counter(0)), size(f(counter(0)))),  # f |f| is smooth
        lambda: x.mul(f(counter(0)), x.param("n")),  # without branches
        lambda: x.add(f(counter(0)), size(x.var("b", "f"))),  # of one quantity for all elements: held in the loop too
    ],
)
def test_loops_without_corners_of_their_own_elements_stay(make):
    given = form(dynamics=([over(1, 3)], make()))
    assert written(given, NETWORK) is given


def test_loops_over_nothing_and_over_too_much_stay(monkeypatch):
    empty = form(dynamics=([over(1, 0)], size(f(counter(0)))))
    assert written(empty, NETWORK) is empty
    given = form(dynamics=([over(1, 3)], size(f(counter(0)))))
    monkeypatch.setattr(module, "MOST", 2)
    assert written(given, NETWORK) is given
    monkeypatch.setattr(module, "MOST", 3)
    assert written(given, NETWORK) is not given


def test_what_reads_the_same_corners_is_written_out_with_them_and_nothing_else():
    """The quantity |-f[i]| is observed; |q[i]| is too, but no equation has a corner there."""
    read = form(dynamics=([over(1, 2)], size(f(counter(0)))), observe=([over(1, 2)], size(x.neg(f(counter(0))))))
    dynamics, observe = written(read, NETWORK).blocks
    assert [at for at, _ in elements(observe)] == [at for at, _ in elements(dynamics)] == [(1,), (2,)]
    other = form(
        dynamics=([over(1, 2)], size(f(counter(0)))), observe=([over(1, 2)], size(x.var("a", "q", counter(0))))
    )
    assert written(other, NETWORK).blocks[1] == other.blocks[1]
    alone = form(observe=([over(1, 2)], size(f(counter(0)))))
    assert written(alone, NETWORK) is alone


# --- surfaces ---------------------------------------------------------------------------------------------------------


def rows(*expressions):
    """One row of phi, or observe, behind one of dynamics."""
    return form(**{name: ((), root) for name, root in zip(BLOCKS, expressions, strict=False)})


def test_surfaces_come_in_the_order_of_the_text_with_their_rows():
    a, b = x.var("a", "f"), x.var("b", "q")
    found = surfaces(rows(size(a), x.mul(x.call("sign", b), a)))
    assert found == (Surface(a, False, 0), Surface(b, True, 1))


def test_a_surface_and_its_negative_are_one():
    a, b = x.var("a", "f"), x.var("b", "f")
    found = surfaces(rows(x.call("max", a, b), x.call("min", b, a)))
    assert [(s.u, s.row) for s in found] == [(x.sub(a, b), 0)]


def test_where_one_row_bends_and_another_jumps_it_jumps():
    a, b = x.var("a", "f"), x.var("b", "q")
    assert surfaces(rows(size(a), x.mul(b, x.call("sign", a)))) == (Surface(a, True, 0),)


def test_what_is_only_read_or_kept_on_one_side_by_a_contact_has_none():
    a = x.var("a", "f")
    assert surfaces(rows(a, a, size(a))) == ()
    along = x.sub(a, x.param("direction"))
    assert len(surfaces(rows(size(along)))) == 1
    assert surfaces(rows(size(along)), frozenset({"direction"})) == ()


def test_more_surfaces_than_pay_are_integrated_through(monkeypatch):
    many = rows(x.add(*(size(x.var(n, "f")) for n in "abc")))
    assert len(surfaces(many)) == 3
    monkeypatch.setattr(kinks, "MOST", 2)
    assert surfaces(many) == ()
