"""Coordinates counted from one of them, and conjugates with the book's sign, by hand."""

import pytest
from catalogue import PLACE
from chains import blank, coordinate
from sysdyn.compiler.forms.conjugates import signed
from sysdyn.compiler.forms.relative_coordinates import in_relative_coordinates
from sysdyn.compiler.model.energies import energies
from sysdyn.dsl.model import expression as x
from sysdyn.dsl.model.evaluation import evaluate
from sysdyn.dsl.model.network import Energy

pytestmark = pytest.mark.usefixtures("fresh")


def quadratic(*terms):
    """The sum of c (a - b)^2/2; b None: of c a^2/2."""
    found = []
    for c, a, b in terms:
        u = a if b is None else x.sub(a, b)
        found.append(x.mul(x.const(c / 2.0), u, u))
    return x.add(*found)


def q(name):
    return x.var(name, "q")


def f(name):
    return x.var(name, "f")


def model(**functions):
    parts = {"T*": functions["kinetic"], "V": functions["potential"], "D": functions.get("content")}
    stated = tuple(Energy(name, node, (), PLACE) for name, node in parts.items() if node is not None)
    return energies(blank(coordinates=tuple(map(coordinate, "abc")), energies=stated))


def value(made, name, **known):
    """The sum of a state function's terms."""
    roots = [t.expression for t in made.function(name)]
    return sum(evaluate(roots, lambda leaf: known[leaf.data[1] + leaf.data[0]]))


TIED = quadratic((2.0, f("a"), f("b")), (3.0, f("b"), f("c")))
KNOWN = {"fa": 2.0, "fb": 5.0, "fc": 100.0}


def test_flows_that_inertia_reads_in_differences_are_counted_from_the_last():
    """a = u_a + c, b = u_b + c: T* = (u_a' - u_b')^2 + 3/2 u_b'^2 lacks c', V of a^2/2 is (u_a + c)^2/2."""
    found = in_relative_coordinates(model(kinetic=TIED, potential=quadratic((1.0, q("a"), None))))
    assert value(found, "T*", **KNOWN) == 9.0 + 1.5 * 25.0
    assert value(found, "V", qa=2.0, qb=5.0, qc=100.0) == 102.0**2 / 2.0


@pytest.mark.parametrize(("content", "floats"), [(("a", None), False), (("a", "c"), True)])
def test_what_reads_a_flow_by_itself_holds_them_where_they_are(content, floats):
    """A damper to the ground gives the sum of the balances a flow; one between two of them does not."""
    one, other = content
    damper = quadratic((4.0, f(one), None if other is None else f(other)))
    found = in_relative_coordinates(model(kinetic=TIED, potential=quadratic((1.0, q("a"), None)), content=damper))
    apart = 9.0 + 1.5 * (25.0 if floats else 95.0**2)
    assert value(found, "T*", **KNOWN) == apart
    if floats:
        assert value(found, "D", **KNOWN) == 2.0 * 4.0


def test_a_mass_of_its_own_is_no_reason():
    heavy = x.add(TIED, quadratic((1.0, f("c"), None)))
    made = model(kinetic=heavy, potential=quadratic((1.0, q("a"), None)))
    assert in_relative_coordinates(made) is made


def test_the_book_s_sign_of_a_conjugate():
    """Every p changes its sign, its rate too: p q - p' becomes p' - p q."""
    p, rate = x.var("a", "p"), x.var("a", "p", order=1)
    assert signed(x.sub(x.mul(p, q("a")), rate)) is x.sub(rate, x.mul(p, q("a")))
    assert signed(x.mul(p, p)) is x.mul(p, p)
    assert signed(q("a")) is q("a")
