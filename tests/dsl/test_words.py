"""What is said of words and spellings of other languages, of numbers without a unit and of units nobody declared."""

import gc

import pytest
from sysdyn.dsl import load
from sysdyn.dsl.format.layout import CONTINUATION, WIDTH, fill
from sysdyn.dsl.model import collecting
from sysdyn.dsl.model.units import Unit, find_unit
from sysdyn.dsl.names import habits
from sysdyn.dsl.names.fitting import fitting_unit, in_unit
from sysdyn.dsl.names.symbols import NameFamily, ParameterSymbol, Scope, nearest
from sysdyn.dsl.names.unit_reading import read_unit
from sysdyn.dsl.parser.foreign import explain_suffix, find_slip, spice
from sysdyn.dsl.text.codes import codes
from sysdyn.dsl.text.diagnostics import Report, SourceText
from sysdyn.dsl.text.remedies import REMEDIES
from sysdyn.dsl.text.source import Span
from sysdyn.dsl.tree import syntax
from sysdyn.dsl.tree.walking import children

FORCE = (("kg", 1), ("m", 1), ("s", -2))
MASS, LENGTH, TIME = ((("kg", 1),), (("m", 1),), (("s", 1),))
HERE = Span(0, 1)


# -- names of other languages ------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("word", "said", "meant"),
    [
        ("PI", "pi", "pi"),
        ("gnd", "ground", "ground"),
        ("g", "g0", None),  # it may be a parameter that was forgotten
        ("x_dot", "x'", "x'"),
        ("dx", "x'", None),
        ("y_dot", None, None),  # y has no rate
    ],
)
def test_a_name_that_others_write(word, said, meant):
    found = habits.name(word, word, 0, lambda name: name == "x")
    assert (None if found is None else found.said, found and found.meant) == (said, meant)


@pytest.mark.parametrize(
    ("word", "arguments", "said"),
    [
        ("der", ["x"], "x'"),
        ("der", ["x*y"], "let y = x*y, and y' where its rate is read"),
        ("pow", ["a + b", "2"], "(a + b)^2"),
        ("V", ["a", "b"], "a.e - b.e"),
        ("I", ["R1"], "R1.f"),
        ("fmod", ["a", "b"], "mod"),
        ("nothing", ["a"], None),
    ],
)
def test_a_function_that_others_write(word, arguments, said):
    found = habits.function(word, arguments)
    assert (None if found is None else found.said) == said


def test_a_domain_has_its_own_words_for_effort_and_flow():
    assert [habits.variable(*pair) for pair in (("electrical", "U"), ("rotation", "omega"), ("heat", "U"))] == [
        "e",
        "f",
        None,
    ]


def test_one_parameter_is_blamed_once_wherever_it_is_read():
    said = habits.unitless("m", "2", MASS)
    assert said == "'m' is a number without unit; in kg it fits: param m = 2 kg"
    assert habits.unitless_parameter(said) == "unit of m"
    assert habits.unitless_parameter("a factor in kg is missing") is None


# -- spellings ---------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("number", "unit", "said"),
    [
        ("3", "kg", ("3 kg", "3 kg")),
        ("5", "Nm", ("5 N.m", "5 N.m")),
        ("10", "k", ("10e3, or with its unit, as in '10 kohm'", None)),
        ("7", "apples", ("7 apples, or 7*apples for a product", None)),
    ],
)
def test_a_number_with_something_grown_to_it(number, unit, said):
    assert explain_suffix(number, unit) == said


def test_a_line_of_a_netlist():
    assert spice("R1", "in 0 1k") == "R1: resistor(R = 1 kohm) in -> ground"
    assert spice("X1", "a b part") == "X1: component(name = value) a -> b"
    assert spice("R1", ": resistor(R = 1 kohm) a -> b") is None


@pytest.mark.parametrize(
    ("text", "sign", "kind", "meant"),
    [
        ("param a = 0,15 m", ",", ",", "0.15"),
        ("param a = 1,000 m", ",", ",", None),  # thousands, or decimals: only its author knows
        ("y = a**2", "*", "*", "^"),
        ("R: r() a -> 0", "0", "<number>", "ground"),
        ("param a = 3. m", ".", ".", ".0"),
        ("param a = 3 N m", "m", "<name>", "3 N.m"),
    ],
)
def test_a_sign_that_others_write(text, sign, kind, meant):
    start = text.rindex(sign) if sign != "." else text.index(sign)
    found = find_slip(text, start, start + len(sign), kind)
    assert found is not None
    assert found.meant == meant


def test_a_sign_of_the_language_is_no_slip():
    assert find_slip("y = a*b", 5, 6, "*") is None


def test_the_nearest_name_differs_in_case_before_it_differs_in_letters():
    assert nearest("Mass", ["mask", "mass"]) == "mass"
    assert nearest("masss", ["mask", "mass"]) == "mass"
    assert nearest("zeta", ["mask", "mass"]) is None


# -- units -------------------------------------------------------------------------------------------------------------


def parameter(name, dimension):
    place = SourceText("m.sd", name).place(0, 1)
    return ParameterSymbol(name, NameFamily(name, (), (), ()), dimension, truth=False, place=place)


def named(name):
    return syntax.Name(name, HERE)


def test_a_number_in_the_dimension_that_is_wanted():
    assert in_unit(syntax.Number(3.0, "3", HERE), FORCE) == "write '3 N'"
    assert in_unit(syntax.Negative(syntax.Number(3.0, "3", HERE), HERE), FORCE) == "write '-3 N'"
    assert in_unit(syntax.Number(20.0, "20", HERE), (("K", 1),)) == "celsius(20), or '20 K' where kelvins are meant"
    assert in_unit(syntax.Number(3.0, "3", HERE), ()) == "write '3', a number"


def test_the_parameter_whose_unit_would_make_a_product_fit():
    """b*v in newtons where b is in kg: a factor 1/s is missing, and with b in N.s/m it fits."""
    scope = Scope(symbols={"b": parameter("b", MASS), "v": parameter("v", (("m", 1), ("s", -1)))})
    assert fitting_unit(scope, named("b"), (("s", -1),)) == "'b' is in kg, N.s/m is wanted"
    product = syntax.Product((("*", named("b")), ("*", named("v"))), HERE)
    found = fitting_unit(scope, product, (("s", -1),))
    assert found == "a factor in s^-1 is missing; with 'b' in N.s/m (it is in kg) it fits"
    assert fitting_unit(scope, syntax.Number(3.0, "3", HERE), LENGTH) is None


def unit_of(text):
    """The unit of a quantity `1 text`, as the parser reads it."""
    document = load.document(SourceText("m.sd", f"model m {{\n  param a = 1 {text}\n}}\n"), Report())
    (model,) = document.models.values()
    return model.body[0].value.unit, document.file.source


@pytest.mark.parametrize(
    ("text", "scale", "dimension"),
    [("km/h", 1000.0 / 3600.0, {"m": 1, "s": -1}), ("kN.m", 1e3, {"kg": 1, "m": 2, "s": -2}), ("mm^2", 1e-6, {"m": 2})],
)
def test_a_unit_is_the_product_of_its_factors(text, scale, dimension):
    unit, source = unit_of(text)
    report = Report()
    found = read_unit(unit, Scope(), source, report)
    assert float(found.scale) == pytest.approx(scale, rel=1e-15)
    assert dict(found.dimension) == dimension
    assert not len(report)


def test_a_unit_that_nobody_declared_is_told_with_what_is_near():
    unit, source = unit_of("kNm")
    report = Report()
    assert read_unit(unit, Scope(), source, report) is None
    (found,) = report
    assert (found.code, found.message, found.help) == ("E201", "'kNm' is not a unit, in '1 kNm'", "write 'kN.m'")


def test_a_unit_of_the_file_goes_before_those_that_are_known():
    unit, source = unit_of("furlong")
    scope = Scope(units={"furlong": Unit(LENGTH, 201.168, "furlong")})
    assert float(read_unit(unit, scope, source, Report()).scale) == 201.168
    assert find_unit("furlong") is None


# -- trees, lines, the collector ---------------------------------------------------------------------------------------


def test_the_children_of_a_node_are_those_of_its_pairs_too():
    a, b = named("a"), named("b")
    product = syntax.Product((("*", a), ("/", b)), HERE)
    assert list(children(product)) == [a, b]
    assert list(children(syntax.Negative(product, HERE))) == [product]
    assert list(children(a)) == []


def test_a_line_is_broken_where_the_language_lets_it():
    words = [f"{'x' * 20}, "] * 8
    lines = fill(words, 2)
    assert all(len(line) <= WIDTH for line in lines)
    assert [len(line) - len(line.lstrip()) for line in lines] == [2, 2 + CONTINUATION]
    assert "".join(line.strip() + " " for line in lines) == "".join(words)
    assert fill(["a = ", "b"], 4) == ["    a = b"]


def test_no_garbage_is_sought_inside_and_it_is_again_behind():
    assert gc.isenabled()
    with collecting.at_rest(), collecting.at_rest():
        assert not gc.isenabled()
    assert gc.isenabled()
    assert not collecting.is_keeping()


def test_what_a_long_text_becomes_is_old_at_once(monkeypatch):
    monkeypatch.setattr(collecting, "MANY", 1000)
    with collecting.at_rest():
        made = [[k] for k in range(3000)]
    assert gc.isenabled()
    assert gc.get_freeze_count() == 0
    assert {id(item) for item in made} <= {id(item) for item in gc.get_objects(generation=2)}


def test_remedies_are_of_codes_that_there_are():
    assert set(REMEDIES) <= set(codes())
