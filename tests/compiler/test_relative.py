"""Coordinates counted from one of them, efforts that stores tell, and conjugates with the book's sign, by hand."""

import pytest
from catalogue import ONE, PLACE
from chains import blank, coordinate
from sysdyn.compiler.forms.conjugates import negate_conjugates
from sysdyn.compiler.forms.relative_coordinates import in_relative_coordinates, without_ignorable
from sysdyn.compiler.forms.series_stores import with_efforts_of_stores
from sysdyn.compiler.model.energies import energies
from sysdyn.dsl.model import expression as x
from sysdyn.dsl.model.evaluation import evaluate
from sysdyn.dsl.model.network import Constraint, EnergyTerm, Unknown, VirtualWork

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
    stated = tuple(EnergyTerm(name, node, (), PLACE) for name, node in parts.items() if node is not None)
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


def parts(potential, **more):
    """Of a, b, c: only c has a mass."""
    return model(kinetic=quadratic((2.0, f("c"), None)), potential=potential, **more)


def are_tangible(made):
    return [c.name for c in made.coordinates if c.tangible]


def springs():
    return quadratic((2.0, q("a"), q("c")), (3.0, q("b"), q("c")))


def test_what_springs_read_in_differences_is_counted_from_what_has_the_mass():
    """a = u_a + c, b = u_b + c: V = u_a^2 + 3/2 u_b^2, a damper at a feels u_a' + c', and nothing reads c."""
    found = without_ignorable(parts(springs(), content=quadratic((4.0, f("a"), None))))
    assert value(found, "V", qa=2.0, qb=3.0) == 4.0 + 1.5 * 9.0
    assert value(found, "D", fa=2.0, fc=5.0) == 2.0 * 49.0
    assert value(found, "T*", fc=5.0) == 25.0
    assert are_tangible(found) == ["a", "b"]


@pytest.mark.parametrize("of", ["a", "c"])
def test_what_reads_a_place_by_itself_holds_all_where_they_are(of):
    made = parts(x.add(springs(), x.power(q(of), x.const(4.0))))
    assert without_ignorable(made) is made


def test_two_masses_on_a_spring_stay_as_they_are():
    masses = quadratic((2.0, f("a"), None), (1.0, f("c"), None))
    made = model(kinetic=masses, potential=quadratic((1.0, q("a"), q("c"))))
    assert without_ignorable(made) is made


def test_a_law_reads_the_store_in_series_with_what_it_is_of():
    """2 a + y = 0, so a' - y^3 is a' + (2 a)^3; with a mass at a it is not."""
    y, law = x.var("y", "e"), x.sub(f("a"), x.power(x.var("y", "e"), x.const(3.0)))
    more = {
        "unknowns": (Unknown("y", (), ONE, PLACE),),
        "works": (VirtualWork(x.neg(y), q("a"), (), PLACE, "dissipated"),),
        "constraints": (Constraint("gamma", "law", (), law, (), ONE, PLACE),),
    }
    spring = EnergyTerm("V", quadratic((2.0, q("a"), None)), (), PLACE)
    mass = EnergyTerm("T*", quadratic((2.0, f("a"), None)), (), PLACE)
    known = {"fa": 100.0, "qa": 3.0, "ey": 5.0}
    for stores, told in (((spring,), True), ((spring, mass), False)):
        made = energies(blank(coordinates=(coordinate("a"),), energies=stores, **more))
        (row,) = with_efforts_of_stores(made).rows
        found = sum(evaluate([t.expression for t in row.terms], lambda leaf: known[leaf.data[1] + leaf.data[0]]))
        assert found == (100.0 + 216.0 if told else 100.0 - 125.0)


def test_the_book_s_sign_of_a_conjugate():
    """Every p changes its sign, its rate too: p q - p' becomes p' - p q."""
    p, rate = x.var("a", "p"), x.var("a", "p", order=1)
    assert negate_conjugates(x.sub(x.mul(p, q("a")), rate)) is x.sub(rate, x.mul(p, q("a")))
    assert negate_conjugates(x.mul(p, p)) is x.mul(p, p)
    assert negate_conjugates(q("a")) is q("a")
