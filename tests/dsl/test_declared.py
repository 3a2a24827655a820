"""Parameters, declarations, elements, casts, paths, members of branches: what a text makes of each, what it is told."""

from contextlib import suppress

import pytest
from sysdyn.dsl import load
from sysdyn.dsl.elaborate.elaborate import Elaborator
from sysdyn.dsl.elaborate.files import FileScope
from sysdyn.dsl.elaborate.instances.casts import cast_of
from sysdyn.dsl.elaborate.instances.elements import Elements
from sysdyn.dsl.elaborate.statements.declarations import DECLARED, Declarations
from sysdyn.dsl.elaborate.statements.parameters import ParameterDeclarations
from sysdyn.dsl.model import dimensions as dim
from sysdyn.dsl.model import expression as ex
from sysdyn.dsl.model.evaluation import evaluate
from sysdyn.dsl.model.values import Values
from sysdyn.dsl.names.failures import Failed
from sysdyn.dsl.names.paths import Paths
from sysdyn.dsl.names.quantities import BRANCH, QuantityResolver, branch_words
from sysdyn.dsl.text.diagnostics import Report
from sysdyn.dsl.text.source import SourceText


@pytest.fixture(autouse=True)
def _fresh():
    with ex.fresh():
        yield


def made(text):
    """The last model of a text, elaborated; of each finding its code, its message and the text it stands at."""
    report, source = Report(), SourceText("m.sd", text)
    document = load.document(source, report)
    *_, model = document.models.values()
    elaborator = Elaborator(FileScope(document.file, report), model, report)
    elaborator.names()
    elaborator.elements()
    elaborator.settle()
    elaborator.statements()
    return elaborator, [(d.code, d.message, source.text[d.place.span.start : d.place.span.end]) for d in report]


def parameter(text, name="a"):
    """A parameter of a model of one: its numbers in SI units, its unit's dimension."""
    elaborator, said = made(f"model m {{ {text} }}")
    assert said == []
    assert isinstance(elaborator.parameters, ParameterDeclarations)
    found = elaborator.parts.parameters[name]
    return evaluate(found.values, {}), dim.show(found.unit.dimension)


# -- parameters --------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("text", "values", "unit"),
    [
        ("param a = 3 mm", [0.003], "m"),
        ("param a = -2 kN", [-2000.0], "N"),
        ("param a[3] = [1 mm, 2 cm, 3 m]", [0.001, 0.02, 3.0], "m"),
        ("param a: s = 250 ms", [0.25], "s"),
        ("param a = 4", [4.0], "dimensionless"),
    ],
)
def test_a_parameter_is_held_in_si_units(text, values, unit):
    assert parameter(text) == (pytest.approx(values, rel=1e-15), unit)


def test_the_unit_of_a_parameter_is_as_it_is_written():
    """What a sweep or the report shows: the number of the text, not its SI value."""
    elaborator, _ = made("model m { param a = 3 mm; param b = -2 kN; param c = a/(1 s) }")
    units = {name: p.unit.text for name, p in elaborator.parts.parameters.items()}
    assert (units["a"], units["b"]) == ("mm", "kN")
    assert dim.show(elaborator.parts.parameters["c"].unit.dimension) == "m/s"


@pytest.mark.parametrize(
    ("text", "code", "message", "at"),
    [
        ("param a: m = 2 s", "E207", "'a' is declared m but its default is in s", "2 s"),
        ("param a[2] = [1 m, 2 s]", "E207", "the values of 'a' differ: m and s", "[1 m, 2 s]"),
        ("param a[3] = [1 m, 2 m]", "E805", "'a' has 2 values, which do not fit its shape", "[1 m, 2 m]"),
        ("param a = 1; param a = 2", "E106", "'a' is declared twice", "a"),
        ("param a = a + 1", "E105", "circular definition: a -> a", "param a = a + 1"),
        ("param a", "E207", "'a' has neither a unit nor a default", "a"),
        ("param a = [1, 2]", "E805", "'a' has 2 values, which do not fit its shape", "[1, 2]"),
        ("for i in 1..3 { param a = 2*i }", "E806", "'a' needs its loop variable: a[i]", "a"),
    ],
)
def test_a_wrong_parameter_is_told_where_it_stands(text, code, message, at):
    assert (code, message, at) in made(f"model m {{ {text} }}")[1]


def test_a_parameter_is_a_constant():
    (found,) = made("model m { param a = 2 s + t }")[1]
    assert found == ("E807", "parameter 'a' depends on 't': a parameter is a constant", "2 s + t")


def test_neither_a_parameter_nor_an_index_is_a_discrete_variable():
    """The value of the start had been kept, whatever events assigned."""
    part = "component part {\nparam r: ohm\nbranch: electrical\nlaw e = r*f\n}\n"
    said = made(f"{part}model m {{\ndiscrete k = 1 ohm\nnode a: electrical\nP: part(r = k) a -> ground\n}}")[1]
    assert ("E807", "parameter 'r' depends on 'k': a parameter is a constant", "r = k") in said
    said = made("model m { discrete n = 1; state x[1..3] = 1; for i in 1..3 { dynamic x[i]' = -x[n]/(1 s) } }")[1]
    assert ("E807", "an index depends on 'n', which is no constant", "n") in said


# -- declarations ------------------------------------------------------------------------------------------------------


def test_an_own_initial_value_is_that_of_every_element():
    elaborator, said = made("model m { param n = 4; coord x[1..n]: translation ~ 2 mm }")
    assert isinstance(elaborator.declarations, Declarations)
    assert said == []
    (initial,) = elaborator.parts.initials
    assert (initial.fixed, evaluate([initial.value], {})) == (False, [0.002])
    assert initial.target is ex.var("x", "q", ex.index(initial.loops[0].index))
    assert (initial.loops[0].first, initial.loops[0].last) == (ex.const(1.0), ex.param("n"))


@pytest.mark.parametrize(
    "body",
    [
        "coord x[0..2]: translation = [1 m, 20 mm, 3 m]",
        "coord x[0..2]: translation; init x = [1 m, 20 mm, 3 m]",
        "param n = 2; coord x[0..n]: translation; init x[0..n] = [1 m, 20 mm, 3 m]",
        "param a[1..3] = [1 m, 0.02 m, 3 m]; coord x[0..2]: translation = a[1..3]",
    ],
)
def test_a_list_gives_each_element_its_own_initial_value(body):
    elaborator, said = made(f"model m {{ {body}\n energy T* = 1/2*1 kg*x[0]'^2 }}")
    assert said == []
    known = Values(elaborator.parts.parameters, [])
    found = {known.number(i.target.args[0]): known.number(i.value) for i in elaborator.parts.initials}
    assert found == {0.0: 1.0, 1.0: 0.02, 2.0: 3.0}
    assert not any(i.loops for i in elaborator.parts.initials)


@pytest.mark.parametrize(("n", "told"), [(3, []), (2, [("E805", 2)]), (5, [("E805", 5)])])
def test_a_list_has_as_many_values_as_there_are_elements(n, told):
    """Once sizes are known, those of the scene among them."""
    text = (
        "model m {\n  param n = 3\n  state x[1..n]: m = [1 m, 2 m, 3 m]\n"
        "  for i in 1..n { dynamic x[i]' = 0 m/s }\n}\n"
        f"scene s of m {{\n  time 0 s to 1 s\n  set n = {n}\n  trace x[1]\n}}\n"
    )
    report = Report()
    document = load.document(SourceText("m.sd", text), report)
    load.network(document, document.models["m"], document.scenes["s"], report)
    assert [d.code for d in report] == [code for code, _ in told]
    assert [d.message for d in report] == [f"'x' has {k} elements there, 3 are given" for _, k in told]


def test_a_dynamic_variable_takes_the_unit_of_its_initial_value():
    elaborator, said = made("model m { state s = 3 m/s }")
    assert said == []
    (state,) = elaborator.parts.states
    assert dim.show(state.unit.dimension) == "m/s"


@pytest.mark.parametrize(
    ("text", "code", "message", "at"),
    [
        ("coord x: translatoin", "E202", "'translatoin' is not a domain", "translatoin"),
        ("coord x: translation = 2 kg", "E207", "'x' is in m but starts at kg", "2 kg"),
        ("let y[1..3] = 2", "E806", "the elements of 'y' are given by one formula", "y[1..3]"),
        ("input u[1..2]: V = [1 V]", "E805", "input 'u' has 1 values, which do not fit its shape", "[1 V]"),
        ("coord x: translation = 1 m; init x = 2 m", "E106", "'x' gets its initial value twice", "init x = 2 m"),
    ],
)
def test_a_wrong_declaration_is_told_where_it_stands(text, code, message, at):
    assert (code, message, at) in made(f"model m {{ {text} }}")[1]


def test_every_declaring_statement_enters_its_name():
    text = (
        "coord a: translation; implicit b: N; state c = 1; node d: electrical; let e = 2; output f = 3; "
        "quasi g: m/s = 1 m/s; phi h: a = 0 m; discrete k = 1"
    )
    elaborator, _ = made(f"model m {{ {text} }}")
    assert set("abcdefghk") <= set(elaborator.space.scope.symbols)
    assert len(DECLARED) == 9


# -- elements ----------------------------------------------------------------------------------------------------------

NODES = "node a, b: electrical\n"


@pytest.mark.parametrize(
    ("text", "code", "message", "at"),
    [
        ("R: dissipator() a -> b", "E303", "'dissipator' takes one law, 0 given", "R: dissipator() a -> b"),
        (
            "R: dissipator(2 ohm*f) a -> b",
            "E404",
            "'2 ohm*f' is a positional argument: 'dissipator' is given its law by name",
            "2 ohm*f",
        ),
        ("R: dissipator(r = 2 ohm) a -> b", "E405", "'dissipator' has no law 'r'", "r = 2 ohm"),
        (
            "T: transformer(e2 = 2*e1) a -> b",
            "E402",
            "'T: transformer' needs 2 branches, has 1",
            "T: transformer(e2 = 2*e1) a -> b",
        ),
    ],
)
def test_a_wrong_element_is_told_what_it_wants(text, code, message, at):
    elaborator, said = made(f"model m {{ {NODES}{text} }}")
    assert isinstance(elaborator.element_builder, Elements)
    assert (code, message, at) in said


def test_a_two_port_is_two_branches_and_their_ratio():
    elaborator, said = made(f"model m {{ {NODES}T: transformer(e2 = 3*e1) a -> ground, b -> ground }}")
    assert said == []
    (coupling,) = elaborator.parts.couplings
    # no power stays within: e1 f1 + e2 f2 = 0
    assert (coupling.kind, coupling.side, evaluate([coupling.ratio], {})) == ("transformer", "f", [-3.0])
    ends = [(b.name, b.plus.node, b.minus.node, b.law) for b in elaborator.parts.branches]
    assert ends == [("T#1", "a", None, None), ("T#2", "b", None, None)]


def test_a_name_that_an_elements_own_variable_hides_is_told():
    said = made(f"model m {{ {NODES}param f = 2 A\n R: dissipator(e = 2 ohm*f) a -> b }}")[1]
    message = "'f' in the law of 'R' is the element's own flow; it hides the outer name"
    assert said == [("W101", message, "f")]


@pytest.mark.parametrize(
    ("laws", "code", "message", "at"),
    [
        ("law e = 2 ohm*f; law f = e/(2 ohm)", "E305", "branch 'R' has two laws", "law f = e/(2 ohm)"),
        ("law 2*e = 3 ohm*f", "E303", "the law must be solved for one port variable of its edge", "2*e"),
    ],
)
def test_a_branch_has_one_law_solved_for_one_variable(laws, code, message, at):
    text = f"component r {{ branch: electrical; {laws} }}\nmodel m {{ {NODES}R: r() a -> b }}"
    assert (code, message, at) in made(text)[1]


# -- casts -------------------------------------------------------------------------------------------------------------


def test_a_cast_is_the_expression_of_another_instance():
    r, f, s = ex.param("R1.r"), ex.var("R1", "bf"), ex.param("R1.s")
    law = ex.mul(r, f, ex.call("exp", ex.sub(s, ex.const(1.0))))
    other = ex.mul(ex.param("X[2].r"), ex.var("X[2]", "bf"), ex.call("exp", ex.sub(ex.param("X[2].s"), ex.const(1.0))))
    assert cast_of(law, "R1").under("X[2]") is other


@pytest.mark.parametrize(
    "foreign",
    [ex.param("other"), ex.param("R12.r"), ex.var("a", "ne"), ex.var("R1", "bq", order=1), ex.index("i")],
    ids=repr,
)
def test_what_reads_anything_of_others_is_not_cast(foreign):
    assert cast_of(ex.mul(ex.param("R1.r"), foreign), "R1") is None


def test_a_condition_is_true_of_the_instances_of_which_it_is():
    cast = cast_of(ex.compare("<", ex.const(0.0), ex.param("R1.r")), "R1")
    three = "".join(f"R{k}: r(r = {v}) a -> b\n" for k, v in ((1, 1), (2, -1), (3, 0)))
    text = f"component r {{ param r = 2; branch: electrical; law e = r*(1 ohm)*f }}\nmodel m {{ {NODES}{three} }}"
    known = Values(made(text)[0].parts.parameters)
    assert [cast.truth(path, known) for path in ("R1", "R2", "R3")] == [True, False, False]


# -- paths and quantities ----------------------------------------------------------------------------------------------

CELLS = """
component cell {
  port p, m: electrical
  param r = 2 ohm
  inner: dissipator(e = r*f) p -> m
}
model m {
  node v[0..5]: electrical
  S: capacitor_like() v[0] -> ground
  for i in 1..2 { X[i]: cell(r = 3 ohm) p = v[i - 1], m = v[i] }
  for i in 3..5 { X[i]: cell(r = 7 ohm*i) p = v[i - 1], m = v[i] }
  LINE
}
component capacitor_like { branch: electrical; law q = 2 F*e }
"""


def read(expression):
    """An expression's node where the cells are in sight (None where it is refused), the elaborator, what it is told."""
    text = CELLS.replace("LINE", f"let y = {expression}")
    elaborator, said = made(text)
    assert issubclass(QuantityResolver, Paths)
    assert isinstance(elaborator.resolver, QuantityResolver)
    elaborator.resolver.report = report = Report()
    node, space, names = None, elaborator.space, elaborator.resolver
    with suppress(Failed), elaborator.context.entering(space), names.entering_scope(space.scope, elaborator.source):
        node = names.resolve(space.scope.symbols["y"].expression).node
    said += [(d.code, d.message, text[d.place.span.start : d.place.span.end]) for d in report]
    return node, elaborator, said


@pytest.mark.parametrize(("index", "ohm"), [(1, 3.0), (2, 3.0), (3, 21.0), (5, 35.0)])
def test_an_element_of_a_label_comes_from_the_statement_whose_range_holds_it(index, ohm):
    node, elaborator, said = read(f"X[{index}].r")
    assert said == []
    parameter = elaborator.parts.parameters[node.data]
    (value,) = evaluate(parameter.values, lambda n: float(index))
    assert value == ohm


def test_an_element_that_no_statement_has_is_told():
    assert ("E805", "'X' has no element [6]", "X[6]") in read("X[6].r")[2]
    assert ("E805", "'X' has no element [0]", "X[0]") in read("X[0].inner.f")[2]


def test_members_of_a_branch_are_what_it_takes_up():
    e, f = ex.var("S", "be"), ex.var("S", "bf")
    for word, node in {"e": e, "f": f, "q": ex.var("S", "bq"), "power": ex.mul(e, f)}.items():
        assert read(f"S.{word}")[::2] == (node, [])
    assert BRANCH[:6] == ("e", "f", "q", "p", "power", "energy")


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("S.dot", "'S' has no member 'dot'"),
        ("S.G", "'S' has no member 'G': it is not a dissipator"),
        ("v[1].f", "node 'v[1]' has no member 'f'"),
    ],
)
def test_a_member_that_is_not_there_is_told(text, message):
    assert ("E102", message, text) in read(text)[2]


def test_members_are_named_with_the_units_of_their_domain():
    (branch, *_) = made(CELLS.replace("LINE", ""))[0].parts.branches
    assert branch_words(branch.domain) == ("e [V]", "f [A]", "q [C]", "p [Wb]", "power [W]", "energy [J]")
