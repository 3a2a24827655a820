"""Expressions and laws as a model reads them, one text at a time: values, units, and what is said of wrong ones."""

import math
import random
from fractions import Fraction

import pytest
from sysdyn.dsl import load
from sysdyn.dsl.model import dimensions as dim
from sysdyn.dsl.model import expression as ex
from sysdyn.dsl.model.values import Values
from sysdyn.dsl.names.arithmetic import Arithmetic
from sysdyn.dsl.names.calls import CallResolver, walk
from sysdyn.dsl.names.context import Context
from sysdyn.dsl.names.failures import Failed
from sysdyn.dsl.names.laws import law_of, own_variables, ratio_of
from sysdyn.dsl.names.symbols import Vector, nearest
from sysdyn.dsl.text.diagnostics import Report, SourceText
from sysdyn.dsl.tree import syntax

TEXT = """
fn twice(x: m) -> m = 2*x
table grip(s: 1) -> N linear [(0, 0), (2, 6)]
model m {
  param n = 4
  param l = 2 m
  param k = 3 N/m
  input u: V = 1 V
  node a, b: electrical
  node x: translation
  R: dissipator(e = 5 ohm*f) a -> ground
  T: transformer(e2 = 2*e1) a -> ground, b -> ground
  S: potential(e = 1 N/m*q) x
}
"""


@pytest.fixture(autouse=True)
def fresh():
    with ex.fresh():
        yield


class Read:
    """Texts read where the names of TEXT are in sight."""

    def __init__(self):
        document = load.document(SourceText("m.sd", TEXT), Report())
        self.model, _ = load._elaborate(document, document.models["m"], None, Report(), (), ())
        self.known = Values(self.model.parts.parameters, [])
        self.context = self.model.resolver

    def parsed(self, text):
        """The text as an expression, and where it stands."""
        source = SourceText("t.sd", f"scene s of m {{\n  trace ({text})\n}}\n")
        (scene,) = load.document(source, Report()).scenes.values()
        return scene.body[0].items[0].expr.expr, source

    def ask(self, text, do):
        """What a question about an expression finds; (code, message, help, the text that it points at) of a refusal."""
        expression, source = self.parsed(text)
        self.context.report = report = Report()
        try:
            with (
                self.model.context.entering(self.model.space),
                self.context.entering_scope(self.model.space.scope, source),
            ):
                return do(expression)
        except Failed:
            (d,) = report
            return d.code, d.message, d.help, source.text[d.place.span.start : d.place.span.end]

    def value(self, text):
        """(Number, unit) of an expression; a list of those of an array."""
        found = self.ask(text, self.context.resolve)
        if isinstance(found, tuple):
            return found
        shown = [
            (self.known.number(v.node), None if v.dimension is None else dim.show(v.dimension))
            for v in (found.items if isinstance(found, Vector) else (found,))
        ]
        return shown if isinstance(found, Vector) else shown[0]


@pytest.fixture
def read(fresh):
    return Read()


# -- arithmetic --------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("text", "value", "unit"),
    [
        ("2 m + 30 cm - 1 mm", 2.299, "m"),
        ("-l*k", -6.0, "N"),
        ("l/(2 s)/(4 s)", 0.25, "m/s^2"),
        ("l^2*k/2", 6.0, "J"),
        ("l^(1/2)*l^(3/2)", 4.0, "m^2"),
        ("n^n - 2^-1", 255.5, "dimensionless"),
        ("if l > 1 m and not (n <= 3) then l else 0", 2.0, "m"),
        ("if l < 1 m or n == 5 then 1 s else 7 ms", 7e-3, "s"),
    ],
)
def test_a_number_and_its_unit(read, text, value, unit):
    assert isinstance(read.context, Arithmetic)
    assert read.value(text) == (pytest.approx(value, rel=1e-15), unit)


@pytest.mark.long
def test_a_quantity_is_the_nearest_double_to_what_is_written(read):
    """Whatever its prefix: 1.1 uF is 1.1e-6, not 1.1 times a rounded 1e-6."""
    draw = random.Random(5)
    scales = {"uF": "1e-6", "pF": "1e-12", "kohm": "1000", "min": "60", "h": "3600", "mm": "1e-3"}
    for _ in range(200):
        plain = f"{draw.random() * 10 ** draw.randint(-3, 9):.{draw.randint(0, 17)}f}"
        text = draw.choice([plain, plain, "1.1", "1e-3", "0.0"])
        unit, scale = draw.choice([*scales.items()])
        assert read.value(f"{text} {unit}")[0] == float(Fraction(text) * Fraction(scale))


def test_arrays_are_added_and_stretched_item_by_item(read):
    assert read.value("2*[l, 3 m] - [1 m, 50 cm]/2") == [(3.5, "m"), (5.75, "m")]
    assert read.value("-[n, 1]") == [(-4.0, "dimensionless"), (-1.0, "dimensionless")]


@pytest.mark.parametrize(
    ("text", "code", "message", "at"),
    [
        ("2 m + 3 s", "E203", "the two operands differ: m + s", "3 s"),
        ("l > 1 s", "E203", "the two operands differ: m > s", "l > 1 s"),
        ("if n > 1 then 1 m else 2 s", "E203", "the two branches differ: m and s", "if n > 1 then 1 m else 2 s"),
        ("[1 m, 2 m] + [1 m]", "E203", "an array is added to something of another size", "[1 m]"),
        ("[1, 2]*[3, 4]", "E203", "the product of two arrays is written dot(a, b) or cross(a, b)", "[3, 4]"),
        ("[1, 2] > [1, 3]", "E203", "arrays are not compared", "[1, 2] > [1, 3]"),
        ("(l > 1 m) + 1", "E203", "a condition stands where a number is wanted", "(l > 1 m)"),
        ("not 3", "E203", "a condition is wanted here: a comparison such as a < b", "3"),
        ("2^l", "E204", "the exponent is in m", "l"),
        ("l^n", "E204", "the exponent must be a rational constant because the base is in m", "n"),
        ("l^200", "E204", "the exponent 200 of a quantity is out of reason", "200"),
        ("l/0", "E324", "division by '0', which is zero", "0"),
    ],
)
def test_what_has_no_value_is_refused_where_it_stands(read, text, code, message, at):
    found = read.value(text)
    assert (found[0], found[1], found[3]) == (code, message, at)


def test_a_bare_number_beside_a_quantity_is_written_with_its_unit(read):
    assert read.value("l + 3") == ("E203", "the two operands differ: m + dimensionless", "write '3 m'", "3")


# -- calls -------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("text", "value", "unit"),
    [
        ("sum(i in 1..n: i^2*l)", 60.0, "m"),
        ("prod(i in 1..n: i)", 24.0, "dimensionless"),
        ("max(i in 1..n: i*(5 - i))", 6.0, "dimensionless"),
        ("min(l, 3 m)", 2.0, "m"),
        ("hypot(3 m, 4 m)", 5.0, "m"),
        ("atan2(l, 2 m)", math.pi / 4.0, "dimensionless"),
        ("sqrt(l*(8 m))", 4.0, "m"),
        ("celsius(20)", 293.15, "K"),
        ("twice(twice(l))", 8.0, "m"),
        ("dot([1 m, 2 m], [3 s, 4 s])", 11.0, "m.s"),
        ("norm([3 m, 4 m, 12 m])", 13.0, "m"),
        ("norm(cross([1, 2, 3], [3, 2, 1])/4)", math.sqrt(6.0), "dimensionless"),
    ],
)
def test_functions_have_values_and_units(read, text, value, unit):
    assert isinstance(read.context, CallResolver)
    assert read.value(text) == (pytest.approx(value, rel=1e-15), unit)


def test_a_reduction_stays_one_node_whatever_its_bounds(read):
    node = read.ask("sum(i in 1..n: i^2)", read.context.resolve).node
    assert (node.op, len(ex.topological([node]))) == ("reduce", 5)


@pytest.mark.parametrize(
    ("text", "code", "message", "help_", "at"),
    [
        ("sqt(l)", "E101", "unknown function 'sqt'", "nearest name in scope: 'sqrt'", "sqt(l)"),
        ("sqr(n)", "E101", "unknown function 'sqr'", "x^2", "sqr(n)"),
        ("sin(l)", "E205", "the argument of sin is in m", "sin(l/(1 m))", "l"),
        ("cos(5 s)", "E205", "the argument of cos is in s", "cos(5 s/(1 s)), or the unit of a frequency: 50 Hz", "5 s"),
        ("grip(1, 2)", "E206", "grip takes 1 argument, 2 given", "grip(s)", "grip(1, 2)"),
        ("twice(3)", "E206", "argument 'x' of twice is dimensionless, wants m", "write '3 m'", "3"),
    ],
)
def test_a_wrong_call_is_told_what_would_be_right(read, text, code, message, help_, at):
    assert read.value(text) == (code, message, help_, at)


@pytest.mark.parametrize(
    ("text", "code", "message"),
    [
        ("exp(1, 2)", "E206", "exp takes 1 argument, 2 given"),
        ("max()", "E206", "max takes at least one argument, 0 given"),
        ("atan2(l, 1 s)", "E206", "the arguments of atan2 differ: m and s"),
        ("cross([1, 2], [3, 4])", "E206", "the arrays of cross have 2 and 2 elements"),
        ("dot([1, 2], [3, 4, 5])", "E206", "the arrays of dot have 2 and 3 elements"),
        ("norm(3)", "E206", "norm takes 1 array"),
        ("prod(i in 1..3: l)", "E203", "the factors of a product over a range are dimensionless"),
        ("twice(x = l)", "E404", "functions take their arguments by position, not 'x ='"),
        ("quasi(l)", "E319", "quasi(w) is what a work acts on"),
    ],
)
def test_a_call_that_cannot_be_is_refused(read, text, code, message):
    assert read.value(text)[:2] == (code, message)


def test_a_walk_meets_every_name_below(read):
    expression, _ = read.parsed("sum(i in 1..n: twice(l)*i) + dot([k, 1], [2, u])")
    assert sorted(n.name for n in walk(expression) if isinstance(n, syntax.Name)) == ["i", "k", "l", "n", "u"]


# -- laws --------------------------------------------------------------------------------------------------------------


def law(read, side, text, wanted=None, branch="R"):
    """Kind and side of a law of an element; of a refusal code, message and help."""
    assert isinstance(read.context, Context)
    symbol = read.model.space.scope.find(branch)

    def do(value):
        with read.context.bound(own_variables(symbol, ())):
            return law_of(read.context, symbol, (), side, value, wanted, value.span)

    found = read.ask(text, do)
    return found[:3] if isinstance(found, tuple) else (found.kind, found.side)


@pytest.mark.parametrize(
    ("side", "text", "kind"),
    [
        ("p", "2 H*f", "kinetic"),
        ("f", "p/(2 H)", "kinetic"),
        ("q", "3 F*e", "potential"),
        ("e", "q/(3 F)", "potential"),
        ("e", "5 ohm*f", "dissipator"),
        ("f", "e/(5 ohm)", "dissipator"),
        ("e", "u", "effort"),
        ("f", "2 A", "flow"),
    ],
)
def test_a_law_lies_on_an_edge_of_the_diagram(read, side, text, kind):
    assert law(read, side, text) == (kind, side)
    assert law(read, side, text, kind) == (kind, side)


def test_a_source_that_another_thing_controls_may_read_its_own_flow(read):
    """An input, time or another element beside it: a controlled source; by itself it is a resistor."""
    assert law(read, "e", "u + 2 ohm*f", "effort") == ("effort", "e")
    assert law(read, "e", "sin(t/(1 s))*1 ohm*f", "effort") == ("effort", "e")
    assert law(read, "e", "2 ohm*f", "effort") == (
        "E315", "source 'R': its law is a function of its own f", "that is a dissipator: 'dissipator(e = ...)'",
    )  # fmt: skip


@pytest.mark.parametrize(
    ("side", "text", "wanted", "code", "message"),
    [
        ("e", "e + 1 ohm*f", None, "E303", "the law must be solved for one port variable of its edge; it relates e, f"),
        ("e", "1 ohm*f + q/(1 F)", None, "E303",
         "the law must be solved for one port variable of its edge; it relates e, f, q"),
        ("q", "1 s*f", None, "E301",
         "a law must relate p-f, q-e or e-f; this one relates q and f, which q' = f already fixes"),
        ("p", "1 s*e", None, "E301",
         "a law must relate p-f, q-e or e-f; this one relates p and e, which p' = e already fixes"),
        ("p", "1 ohm*q", None, "E302", "p-q is the diagonal of the diagram: a memristive law"),
        ("e", "5 ohm*f", "potential", "E323", "'R' is a potential, but its law relates e to its own f"),
        ("f", "2 A", "potential", "E323", "'R' is a potential, but its law gives f"),
        ("q", "1 C", None, "E303", "a source gives its effort or its flow, not q"),
        ("f", "u/(1 ohm) + e/(1 ohm)", "effort", "E303", "the law of effort source 'R' gives f"),
        ("e", "5*f", None, "E208", "law of 'R': e is in V, the law in A"),
    ],
)  # fmt: skip
def test_a_law_off_the_diagram_is_told_why(read, side, text, wanted, code, message):
    assert law(read, side, text, wanted)[:2] == (code, message)


def ratio(read, kind, side, text):
    """A two-port's law from the text: (side, value of its ratio)."""
    ports = read.model.space.scope.find("T").branches

    def do(value):
        with read.context.bound(own_variables(ports[0], (), "1") | own_variables(ports[1], (), "2")):
            return ratio_of(read.context, ports, (), kind, side, value, value.span)

    found = read.ask(text, do)
    return found[:3] if isinstance(found, tuple) else (found.side, read.known.number(found.ratio))


@pytest.mark.parametrize("r", [4.0, -0.25])
@pytest.mark.parametrize("side", ["e1", "e2", "f1", "f2"])
@pytest.mark.parametrize("kind", ["transformer", "gyrator"])
def test_two_ports_pass_on_their_power(read, kind, side, r):
    """Whichever of the four is given, the law for branch 1 and the one that goes with it, which e1 f1 + e2 f2 = 0
    asks for, are together the one that was written.
    """
    other = str(3 - int(side[1]))
    letter = side[0] if kind == "transformer" else {"e": "f", "f": "e"}[side[0]]
    unit = {("gyrator", "e"): " ohm", ("gyrator", "f"): " S"}.get((kind, side[0]), "")
    which, found = ratio(read, kind, side, f"({r}{unit})*{letter}{other}" if unit else f"({r})*{letter}{other}")
    if kind == "transformer":
        one = {which + "1": found * 3.0, which + "2": 3.0}
        beside = "f" if which == "e" else "e"
        one |= {beside + "1": 5.0, beside + "2": -found * 5.0}
    else:
        beside = "f" if which == "e" else "e"
        one = {which + "1": found * 3.0, beside + "2": 3.0, beside + "1": 5.0, which + "2": -found * 5.0}
    assert one["e1"] * one["f1"] + one["e2"] * one["f2"] == pytest.approx(0.0, abs=1e-12)
    assert one[side] == pytest.approx(r * one[letter + other], rel=1e-15)


@pytest.mark.parametrize(
    ("kind", "side", "text", "code", "message", "help_"),
    [
        ("transformer", "e1", "2 ohm*f2", "E316", "transformer 'T' given as e1 against f2: that is a gyrator",
         "'gyrator(e1 = ...)'"),
        ("gyrator", "f1", "2*f2", "E316", "gyrator 'T' given as f1 against f2: that is a transformer",
         "'transformer(f1 = ...)'"),
        ("transformer", "e1", "2*e2 + 1 V", "E317",
         "transformer ratio of 'T' depends on T#2.e, a flow or effort of its own ports",
         "ratios may depend on displacements and signals"),
        ("transformer", "e1", "2 V", "E303",
         "the law of transformer 'T' gives e1 without e2: its two sides would not act on each other",
         "e1 = n*e2, with a ratio n other than 0"),
        ("gyrator", "e1", "0*f2", "E303",
         "the law of gyrator 'T' gives e1 without f2: its two sides would not act on each other",
         "e1 = n*f2, with a ratio n other than 0"),
    ],
)  # fmt: skip
def test_what_is_no_two_port_is_told_what_it_is(read, kind, side, text, code, message, help_):
    found = ratio(read, kind, side, text)
    assert found[:2] == (code, message)
    assert help_ is None or found[2] == help_


@pytest.mark.parametrize(("name", "near"), [("C2", "C1"), ("r", "R"), ("Rload", "R_load"), ("zz", None)])
def test_the_nearest_name(name, near):
    """Another number is nearer than none: C is no slip for C2 where there is C1."""
    assert nearest(name, ["C", "R", "C1", "R_load", "x3"]) == near
