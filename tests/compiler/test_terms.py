"""Sums taken apart into terms over loops: worth what was written, by hand and against the sum itself."""

import itertools

import numpy as np
import pytest
from catalogue import PLACE
from chains import blank, parameter
from sysdyn.compiler.binding.counts import match
from sysdyn.compiler.forms.conjugates import negate_conjugates, with_book_signs
from sysdyn.compiler.forms.coverage import bind_covers, inside, outside
from sysdyn.compiler.forms.descriptor import Block, DescriptorForm, EquationFamily, LoopKernel, Pin, Summand, Unknowns
from sysdyn.compiler.model.energies import UnknownFamily
from sysdyn.compiler.model.terms import (
    LARGEST_LITERAL,
    Term,
    canonical,
    canonical_reductions,
    has_reduction,
    is_affine,
    local_variables,
    split,
    summands,
    terms,
    vanishes,
    without_nested,
)
from sysdyn.compiler.network.primal.bounds import Affine, Interval, Picked, WholeNumbers, number
from sysdyn.dsl.model import expression as x
from sysdyn.dsl.model.network import Loop
from sysdyn.dsl.text.diagnostics import ModelError

pytestmark = pytest.mark.usefixtures("fresh")

N = 3.0
I, K = "i", "k"


def q(*at):
    return x.var("a", "q", *at)


def total(name, body, first=1.0, last=None):
    """The sum of body(index) over first..n."""
    return x.reduction(
        "sum", name, x.const(first), x.param("n") if last is None else x.const(last), body(x.index(name))
    )


def value(root, at=()):
    """With n = 3, q[i] = i^2 + 0.5, p = 7, loop variables as given; sums are added up element by element."""
    match root.op:
        case "const":
            return root.data
        case "param":
            return {"n": N, "p": 7.0}[root.data]
        case "index":
            return dict(at)[root.data]
        case "var":
            return value(root.args[0], at) ** 2 + 0.5
        case "reduce":
            (operator, name), (first, last, body) = root.data, root.args
            ends = round(value(first, at)), round(value(last, at))
            items = [value(body, {**dict(at), name: float(k)}) for k in range(ends[0], ends[1] + 1)]
            return {"sum": sum, "prod": np.prod, "min": min, "max": max}[operator](items)
    return x.rebuild(root, tuple(x.const(value(a, at)) for a in root.args)).data


def worth(found, at=()):
    """The sum of terms over their loops."""

    def below(term, loops, known):
        if not loops:
            return value(term.expression, known)
        first, last = (round(value(b, known)) for b in (loops[0].first, loops[0].last))
        return sum(below(term, loops[1:], {**known, loops[0].index: float(k)}) for k in range(first, last + 1))

    return sum(below(term, term.loops, dict(at)) for term in found)


SQUARES = [
    lambda: x.mul(x.param("p"), total(I, q)),
    lambda: x.linear(2.0, [(3.0, q(x.const(2))), (-1.0, total(I, q))]),
    lambda: x.mul(q(x.const(1)), x.linear(5.0, [(1.0, total(I, q))])),
    lambda: x.mul(total(I, q), total(K, lambda k: x.mul(k, q(k)))),
    lambda: x.power(total(I, q), x.const(2.0)),
    lambda: total(I, lambda i: x.mul(q(i), x.reduction("sum", K, i, x.param("n"), q(x.index(K))))),
    lambda: x.call("sin", total(I, q)),
    lambda: x.linear(1.0, [(-2.0, total(I, lambda i: x.linear(4.0, [(3.0, q(i)), (0.5, i)])))]),
]


@pytest.mark.parametrize("make", SQUARES)
@pytest.mark.parametrize("read", [False, True])
def test_terms_are_worth_the_sum(make, read):
    root = make()
    found = split(canonical_reductions(root), (), PLACE, read=read)
    assert worth(found) == pytest.approx(value(root), rel=1e-14)


def test_a_factor_before_a_sum_is_one_term_with_a_loop_more():
    """p sum(i: q[i]) under a loop j is p q[#1] under #0, #1."""
    rows = Loop("j", x.const(1), x.param("n"))
    (found,) = terms(x.mul(x.param("p"), total(I, q)), (rows,), PLACE)
    assert [loop.index for loop in found.loops] == ["#0", "#1"]
    assert found.expression is x.mul(x.param("p"), q(x.index("#1")))


def test_products_of_sums_are_double_loops_where_they_are_differentiated_and_products_where_they_are_read():
    root = canonical_reductions(x.mul(total(I, q), total(K, q)))
    assert [len(t.loops) for t in split(root, (), PLACE)] == [2]
    assert [len(t.loops) for t in split(root, (), PLACE, read=True)] == [0]
    (one,) = split(canonical_reductions(x.mul(q(x.const(1)), total(I, q))), (), PLACE, read=True)
    assert len(one.loops) == 1  # a single sum is a loop either way


def test_nothing_is_left_of_zero():
    assert split(x.const(0.0), (), PLACE) == ()
    assert [t.expression.data for t in split(x.const(4.0), (), PLACE)] == [4.0]


def test_loop_variables_are_named_by_depth_and_those_of_sums_by_height():
    inner = x.reduction("sum", "u", x.const(1), x.index("j"), q(x.index("u"), x.index("j")))
    root = x.call("sin", x.reduction("sum", "v", x.const(1), x.const(2), x.mul(x.index("v"), inner)))
    nest, (found,) = canonical((Loop("j", x.const(1), x.param("n")), Loop("l", x.index("j"), x.param("n"))), root)
    assert nest == (Loop("#0", x.const(1), x.param("n")), Loop("#1", x.index("#0"), x.param("n")))
    low = x.reduction("sum", "#r1", x.const(1), x.index("#0"), q(x.index("#r1"), x.index("#0")))
    assert found is x.call("sin", x.reduction("sum", "#r2", x.const(1), x.const(2), x.mul(x.index("#r2"), low)))
    plain = q(x.const(1))
    assert canonical_reductions(plain) is plain


@pytest.mark.parametrize(
    ("operator", "number_"), [("sum", 15.5), ("prod", 1.5 * 4.5 * 9.5), ("min", 1.5), ("max", 9.5)]
)
def test_sums_inside_of_functions_are_written_out(operator, number_):
    """q = 1.5, 4.5, 9.5: q[i] = i^2 + 0.5."""
    inside_ = x.call("exp", x.scale(-1.0, x.reduction(operator, I, x.const(1), x.const(3), q(x.index(I)))))
    (found,) = without_nested(terms(inside_, (), PLACE), "an energy")
    assert not has_reduction(found.expression)
    assert value(found.expression) == pytest.approx(np.exp(-number_), rel=1e-14, abs=0.0)


def test_what_cannot_be_written_out_is_refused():
    for operator, last in (("sum", x.param("n")), ("sum", x.const(LARGEST_LITERAL + 1.0)), ("max", x.const(0.0))):
        root = x.call("exp", x.reduction(operator, I, x.const(1), last, q(x.index(I))))
        with pytest.raises(ModelError) as caught:
            without_nested((Term(root, (), PLACE),), "an energy")
        assert [d.code for d in caught.value.diagnostics] == ["N608"]
    whole = x.call("exp", x.reduction("sum", I, x.const(1), x.const(float(LARGEST_LITERAL)), q(x.index(I))))
    assert len(without_nested((Term(whole, (), PLACE),), "an energy")) == 1
    for operator, number_ in (("sum", 0.0), ("prod", 1.0)):  # over nothing
        root = x.call("exp", x.add(x.param("p"), x.reduction(operator, I, x.const(1), x.const(0), q(x.index(I)))))
        (found,) = without_nested((Term(root, (), PLACE),), "an energy")
        assert value(found.expression) == pytest.approx(np.exp(7.0 + number_), rel=1e-14)


def test_summands_carry_the_factor_before_their_sum():
    a, b, p = x.var("a", "f"), x.var("b", "f"), x.param("p")
    root = x.mul(p, x.linear(2.0, [(1.0, a), (-3.0, b)]))
    assert set(summands(root)) == {x.mul(p, a), x.scale(-3.0, x.mul(p, b)), x.scale(2.0, p)}
    assert vanishes(root, x.scale(-1.0, x.mul(p, a)), x.scale(3.0, x.mul(p, b)), x.scale(-2.0, p))
    assert not vanishes(root, x.scale(-1.0, x.mul(p, a)))
    assert vanishes()


def test_unknowns_by_kind_and_order():
    a, b, rate = x.var("a", "q"), x.var("b", "f"), x.var("b", "f", order=1)
    root = x.add(x.mul(b, a), rate, x.time())
    assert local_variables(root, "q") == [a]
    assert local_variables(root, ("q", "f")) == [a, b]
    assert local_variables(root, "f", 1) == [rate]
    assert local_variables(root, "f", None) == [b, rate]


def test_affine_expressions_have_constant_coefficients():
    a, b, p, half = x.var("a", "f"), x.var("b", "f"), x.param("p"), x.const(0.5)
    none = frozenset()
    for root in (p, a, x.linear(3.0, [(2.0, a), (1.0, b)]), x.mul(x.call("sin", p), a), x.mul(half, a)):
        assert is_affine(root, none)
    for root in (x.mul(a, b), x.mul(a, a), x.call("sin", a), x.div(p, a), x.conditional(x.compare(">", a, b), a, b)):
        assert not is_affine(root, none)
    assert not is_affine(x.mul(p, a), frozenset({"p"}))


# --- signs, ranges, indices from tables, matchings --------------------------------------------------------------------


def book(formulation):
    """p = 3 f in a row of momentum, and p' = -p + 2 in one of dynamics; p begins at 5."""
    p, f = x.var("a", "p"), x.var("a", "f")
    families = tuple(Unknowns(f"a.{k}", k, "a", "1", PLACE) for k in ("f", "p"))
    rows = tuple(EquationFamily(name, "a", "a", name, "1", PLACE) for name in ("dynamics", "momentum"))
    expressions = x.linear(-2.0, [(1.0, x.var("a", "p", order=1)), (1.0, p)]), x.linear(0.0, [(1.0, p), (-3.0, f)])
    blocks = tuple(
        Block(r.block, (LoopKernel((), (Summand(k, (), e),)),))
        for k, (r, e) in enumerate(zip(rows, expressions, strict=True))
    )
    pins = tuple(Pin(k, (), x.const(5.0), True, (), PLACE) for k in (0, 1))
    return DescriptorForm(formulation, families, rows, blocks, pins, (), (), ())


def test_conjugates_of_complementary_forms_have_the_books_sign():
    """p is -p: its rate and itself change their signs, the row that defines it too, so that p stands first there."""
    given = book("co_hamiltonian")
    found = with_book_signs(given)
    dynamics, momentum = (b.kernels[0].rows[0].expression for b in found.blocks)
    p, rate, f = x.var("a", "p"), x.var("a", "p", order=1), x.var("a", "f")
    assert dynamics is x.linear(-2.0, [(-1.0, rate), (-1.0, p)])
    assert momentum is x.linear(0.0, [(1.0, p), (3.0, f)])
    assert [pin.value.data for pin in found.pins] == [5.0, -5.0]
    primal = book("hamiltonian")
    assert with_book_signs(primal) is primal
    assert negate_conjugates(f) is f


@pytest.mark.parametrize(
    ("places", "ends"),
    [
        ([2, 3, 4], (2, 4)),
        ([4, 2, 3, 3], (2, 4)),
        ([3], (3, 3)),
        ([], (1, 0)),  # no store at all: an empty range
        ([1, 2, 4], (1, 5)),  # a hole: the whole family
    ],
)
def test_a_store_moves_with_a_range_of_a_family(places, ends):
    class Known:
        def __init__(self):
            self.hidden = {}

        @staticmethod
        def lookup(_node):
            raise KeyError

    known = Known()
    bind_covers([("x", tuple(((), x.const(float(k))) for k in places))], {"x": ((1, 5),)}, known)
    assert (known.hidden["#first x"], known.hidden["#last x"]) == ends


def test_the_elements_outside_a_range_lie_before_and_behind():
    family = UnknownFamily("x", ((x.const(1), x.param("n")),), {}, PLACE)
    first, last = x.param("#first x"), x.param("#last x")
    assert inside("x") == (Loop("#0", first, last),)
    assert outside(family) == (
        (Loop("#0", x.const(1), x.add(first, x.const(-1))),),
        (Loop("#0", x.add(last, x.const(1)), x.param("n")),),
    )


def test_an_index_from_a_table_of_the_compiler():
    """#t = 4, 2, 9 from index 0 on."""
    sizes = WholeNumbers(
        blank(parameters=(parameter("#t", (x.const(4), x.const(2), x.const(9)), ((x.const(0), x.const(2)),)),))
    )
    found = sizes.index(x.param("#t", x.index("i")), ("i",), PLACE)
    assert found == Picked("#t", Affine("i", number(0)), (4, 2, 9))
    assert (found.loop, found.offset.value) == (None, 4)
    reached = [found.over({"i": Interval(number(a), number(b))}) for a, b in ((0, 2), (0, 1), (1, 1))]
    assert [(r.first.value, r.last.value) for r in reached] == [(2, 9), (2, 4), (2, 2)]
    assert found.substitute_loops({"i": x.const(2.0)}) is x.const(9)
    assert found.substitute_loops({"i": x.index("#0")}) is x.param("#t", x.index("#0"))


@pytest.mark.parametrize("seed", range(6))
def test_a_matching_is_as_large_as_any(seed):
    random = np.random.default_rng(seed)
    there = random.random((5, 5)) < 0.4
    pairs = {(0, i): [(1, j) for j in range(5) if there[i, j]] for i in range(5)}
    found = match([(0, i) for i in range(5)], pairs)
    best = max(sum(there[i, j] for i, j in enumerate(p)) for p in itertools.permutations(range(5)))
    assert len(found) == len(set(found.values())) == best
    assert all(partner in pairs[row] for row, partner in found.items())
