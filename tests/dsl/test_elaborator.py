"""A model's text elaborated step by step: what each step enters, and where."""

import pytest
from sysdyn.dsl import load
from sysdyn.dsl.elaborate.elaborate import Elaborator
from sysdyn.dsl.elaborate.files import FileScope
from sysdyn.dsl.elaborate.instances.connections import Ends
from sysdyn.dsl.elaborate.instances.instances import BUILTINS
from sysdyn.dsl.elaborate.parts import NetworkBuilder, declarations_of, flatten
from sysdyn.dsl.elaborate.statements.events import Draft
from sysdyn.dsl.elaborate.statements.statements import STATEMENTS
from sysdyn.dsl.model import expression as ex
from sysdyn.dsl.model.expression_text import to_text
from sysdyn.dsl.names.laws import ONE_PORTS, TWO_PORTS
from sysdyn.dsl.names.symbols import NodeSymbol, ParameterSymbol
from sysdyn.dsl.text.diagnostics import Report
from sysdyn.dsl.text.source import SourceText
from sysdyn.dsl.tree import syntax

OSCILLATOR = """
component spring { param k = 4 N/m; branch: translation; law e = k*q; init q = 1 m }
model swing {
  param m = 2*mass
  param mass = 1.5 kg
  node x: translation
  M: kinetic(p = m*f) x -> ground
  K: spring() x -> ground
}
"""


@pytest.fixture(autouse=True)
def _fresh():
    with ex.fresh():
        yield


def begun(text):
    """The elaborator of the last model of a text, and its report."""
    report = Report()
    document = load.document(SourceText("m.sd", text), report)
    *_, model = document.models.values()
    return Elaborator(FileScope(document.file, report), model, report), report


def whole(text):
    elaborator, report = begun(text)
    elaborator.names()
    elaborator.elements()
    elaborator.settle()
    elaborator.statements()
    return elaborator, [d.code for d in report]


def test_names_come_first_and_parameters_in_the_order_of_their_dependence():
    elaborator, report = begun(OSCILLATOR)
    assert elaborator.parts == NetworkBuilder()
    elaborator.names()
    assert list(elaborator.parts.parameters) == ["mass", "m"]
    assert isinstance(elaborator.space.scope.symbols["m"], ParameterSymbol)
    assert isinstance(elaborator.space.scope.symbols["x"], NodeSymbol)
    assert elaborator.parts.branches == []
    assert not list(report)


def test_elements_make_branches_between_the_ends_that_the_text_says():
    elaborator, said = whole(OSCILLATOR)
    branches = {b.name: b for b in elaborator.parts.branches}
    assert [(n, b.kind, b.side) for n, b in branches.items()] == [("M", "kinetic", "p"), ("K", "potential", "e")]
    for b in branches.values():
        assert (b.plus.node, b.minus.node) == ("x", None)
    assert said == []
    # the component's own parameter stands under the instance
    assert to_text(elaborator.parts.parameters["K.k"].values[0]) == "4"
    assert branches["K"].law is ex.mul(ex.param("K.k"), ex.var("K", "bq"))


def test_what_has_the_name_of_a_component_does_not_hide_it():
    """Nodes and labels as the parts are called: what stands behind a label is a component."""
    elaborator, said = whole("""from std.electrical import resistor
model m {
  node flow, resistor: electrical
  dissipator: resistor(R = 1 ohm) flow -> resistor
  a: resistor(R = 2 ohm) resistor -> ground
  b: dissipator(e = 3 ohm*f) resistor -> ground
  c: flow(f = 1 A) ground -> flow
}
""")
    assert said == []
    assert {b.name: b.kind for b in elaborator.parts.branches} == {
        "dissipator": "dissipator", "a": "dissipator", "b": "dissipator", "c": "flow",
    }  # fmt: skip


def test_statements_of_instances_are_in_their_own_names():
    elaborator, _ = whole(OSCILLATOR)
    (initial,) = elaborator.parts.initials
    assert initial.target is ex.var("K", "bq")
    assert initial.fixed
    model, _ = whole(OSCILLATOR.replace("K: spring() x -> ground", "K: spring() x -> ground; init K.q ~ 2 m"))
    depths = {i.fixed: i.depth for i in model.parts.initials}
    assert depths[False] < depths[True]  # the model's own goes before what a component inside says


def test_a_circle_of_parameters_is_told_once():
    elaborator, report = begun("model m { param a = b; param b = a; param c = 1 }")
    elaborator.names()
    assert [d.code for d in report] == ["E105"]
    assert {"a", "b"} <= elaborator.space.scope.broken
    assert "c" in elaborator.parts.parameters


def test_statements_that_belong_to_components_are_refused_in_a_model():
    for text, code in (("branch: translation", "E408"), ("port a: translation", "E408"), ("law e = 1 N", "E303")):
        elaborator, report = begun(f"model m {{ {text} }}")
        elaborator.names()
        assert [d.code for d in report] == [code], text


def test_a_component_in_itself_is_told():
    text = "component a { node p: electrical; A: a() }\nmodel m { A: a() }"
    assert "E801" in whole(text)[1]


def test_a_label_in_a_loop_has_its_variable():
    row = "node n[1..3]: electrical\n for i in 1..3 { R[i]: dissipator(e = 2 ohm*f) n[i] -> ground }"
    elaborator, said = whole(f"model m {{ {row} }}")
    (branch,) = elaborator.parts.branches
    assert said == []
    assert branch.at == (ex.index(branch.loops[0].index),)
    assert (branch.loops[0].first, branch.loops[0].last) == (ex.const(1.0), ex.const(3.0))
    assert whole(f"model m {{ {row.replace('R[i]', 'R')} }}")[1] == ["E106"]


def test_events_assign_what_is_discrete_and_cross_what_moves():
    text = "coord x: translation = 1 m\n energy T* = 1 kg*x'^2\n discrete g = 1\n"
    elaborator, said = whole(f"model m {{ {text} when x < 0 m {{ g := 2 }}\n every 0.5 s {{ g := 3 }} }}")
    assert said == []
    assert elaborator.parts.discretes == {"g"}
    one, other = elaborator.parts.events
    assert one.name == "when x < 0 m"
    assert other.period is ex.const(0.5)
    assert whole(f"model m {{ {text} when g < 0 {{ g := 2 }} }}")[1] == []
    assert whole(f"model m {{ {text} when 1 < 0 {{ g := 2 }} }}")[1] == ["E701"]
    assert whole(f"model m {{ {text} every -1 s {{ g := 2 }} }}")[1] == ["E703"]


def test_inequalities_wait_as_drafts_until_sizes_are_known():
    elaborator, said = whole("model m { coord x: translation = 1 m; energy T* = 1 kg*x'^2; phi floor: x >= 0 m }")
    assert said == []
    assert [type(d) for d in elaborator.parts.drafts] == [Draft]
    assert elaborator.parts.switches == []


def test_builtin_elements_are_the_one_and_two_ports():
    assert (*ONE_PORTS, *TWO_PORTS) == BUILTINS
    assert all(issubclass(kind, syntax.Statement) for kind in STATEMENTS)


def test_bodies_are_flattened_with_the_loops_around_each_statement():
    elaborator, _ = begun("model m { for i in 1..2 { for j in 1..3 { param a[i, j] = 1 } }\n param b = 2 }")
    found = [(s, [loop.index.name for loop in loops]) for s, loops in flatten(elaborator.model.body)]
    assert [([d.name for d in declarations_of(s)], loops) for s, loops in found] == [(["a"], ["i", "j"]), (["b"], [])]


def test_ends_say_what_a_connection_joins():
    along = Ends(None, None, None, None)
    assert along.plus is None
    elaborator, said = whole("model m { node a, b: electrical; R: dissipator(e = 1 ohm*f) a -> b }")
    (branch,) = elaborator.parts.branches
    assert (branch.plus.node, branch.minus.node, said) == ("a", "b", [])
    backwards, _ = whole("model m { node a, b: electrical; R: dissipator(e = 1 ohm*f) b -> a }")
    assert backwards.parts.branches[0].plus.node == "b"
    assert whole("model m { node a: electrical; R: dissipator(e = 1 ohm*f) a -> nowhere }")[1] == ["E101"]


@pytest.mark.parametrize(
    ("connection", "said"),
    [
        ("a = p, b = q, u = 0 V", None),
        ("a = p, a = q, b = ground, u = 0 V", "port 'a' of 'L' is bound twice"),
        ("a = p, b = q, u = 0 V, a = p", "port 'a' of 'L' is bound twice"),  # to the same too
        ("a = p, b = q, u = 1 V, u = 2 V", "input 'u' of 'L' is bound twice"),
    ],
)
def test_of_two_connections_of_one_port_or_input_none_is_taken(connection, said):
    link = "component link { port a, b: electrical; input u: V; R: dissipator(e = 2 ohm*f + u) a -> b }"
    elaborator, report = begun(f"{link}\nmodel m {{ node p, q: electrical; L: link() {connection} }}")
    elaborator.names()
    elaborator.elements()
    elaborator.settle()
    assert [(d.code, d.message) for d in report] == ([("E402", said)] if said else [])


@pytest.mark.parametrize(("arguments", "said"), [("k = 1 N/m", []), ("k = 1 N/m, k = 2 N/m", ["E106"])])
def test_an_argument_that_is_given_twice_is_refused(arguments, said):
    assert whole(OSCILLATOR.replace("spring()", f"spring({arguments})"))[1] == said


@pytest.mark.parametrize(
    ("ends", "named"),
    [
        ("port a, b: electrical; R: dissipator(e = 2 ohm*f) a -> b; S: dissipator(e = 1 ohm*f) b -> a", "a = p, b = q"),
        ("branch one, two: electrical; energy T* = 1/2*(1 H)*(one.f + two.f)^2", "one = p -> q, two = q -> ground"),
    ],
)
def test_nodes_in_a_row_are_named_in_the_remedy(ends, named):
    row = "p -> q" if ends.startswith("port") else "p -> q, q -> ground"
    elaborator, report = begun(f"component k {{ {ends} }}\nmodel m {{ node p, q: electrical; K: k() {row} }}")
    elaborator.names()
    elaborator.elements()
    elaborator.settle()
    assert [(d.code, d.help) for d in report] == [("E402", named)]


def test_a_condition_over_an_input_that_stands_still_never_comes_true():
    """An input given a constant, by its user, a default or a let between, is no mistake of the condition's author."""
    unit = "component valve {{ input u: 1\n discrete shut = u <= 0.5\n {}\n when on {{ shut := false }} }}"
    for condition in ("let on = u > 0.5", "let up = u\n let on = up > 0.5 and true"):
        elaborator, said = whole(f"{unit.format(condition)}\nmodel m {{ V: valve() u = 1 }}")
        assert said == []
        assert elaborator.parts.events == []
    elaborator, said = whole("model m { input u: 1 = 0; discrete g = 1; when u > 0.5 { g := 2 } }")
    assert said == []
    assert elaborator.parts.events == []
    assert whole("model m { param u = 1; discrete g = 1; when u > 0.5 { g := 2 } }")[1] == ["E701"]


def test_a_dynamic_of_a_second_derivative_is_no_dynamic_of_the_first():
    """It was read as q' = -q, by the units of q''."""
    report = Report()
    document = load.document(SourceText("m.sd", "model m {\n state q: m = 1 m\n dynamic q'' = -q/(1 s^2)\n}"), report)
    assert load.network(document, document.models["m"], None, report) is None
    (found,) = report
    assert (found.code, *found.place.start) == ("E508", 3, 10)
    assert "dynamic q' = v, dynamic v' = ..." in found.help


@pytest.mark.parametrize(
    ("statement", "code", "message"),
    [
        ("work 3 N on s", "E319", "work on s, which no effort moves"),
        ("init g = 1", "E903", "'g' is a discrete variable: it begins with the value of its declaration"),
        ("work 3 N on s*x/(1 m)", None, ""),
    ],
)
def test_what_has_no_virtual_displacement_and_what_has_no_start(statement, code, message):
    text = "coord x: translation = 1 m\n state s: m = 1 m\n dynamic s' = -s/(1 s)\n discrete g = 0"
    report = Report()
    inside = f"{text}\n energy T* = 1/2*(1 kg)*x'^2\n {statement}\n"
    document = load.document(SourceText("m.sd", f"model m {{\n {inside}}}"), report)
    load.network(document, document.models["m"], None, report)
    assert [(d.code, d.message) for d in report] == ([(code, message)] if code else [])


def test_a_parameter_of_what_moves_is_told_as_such():
    """Parameters are known before all else: what they name was told as unknown; an index of a sum is its own."""
    text = "param k = 2*x/(1 m)\n param j = sum(i in 1..3: i)*2*pi\n coord x: translation = 1 m\n coord i: translation"
    elaborator, said = whole(f"model m {{ {text}\n energy T* = 1 kg*x'^2 + 1 kg*i'^2\n param q = z }}")
    assert said == ["E101", "E807"]
    assert "j" in elaborator.parts.parameters


@pytest.mark.parametrize(
    ("value", "help_"), [("u - x", "over a time: (u - x)/(1 s), or a parameter in s"), ("y", "y' in place of y?")]
)
def test_a_dynamic_without_its_time_is_helped_by_a_time_not_by_its_own_rate(value, help_):
    """`x' in place of x?` would be E508; the flow of a coordinate may stand there."""
    report = Report()
    text = f"model m {{\n state x: m = 1 m\n coord y: translation\n input u: m = 0 m\n dynamic x' = {value}\n}}"
    load.network(document := load.document(SourceText("m.sd", text), report), document.models["m"], None, report)
    assert [(d.code, d.help) for d in report] == [("E208", help_)]
