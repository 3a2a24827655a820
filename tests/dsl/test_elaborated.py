"""Tables, levels, what a component asks of its user, and expressions as they are written: each by hand."""

import pytest
from sysdyn.dsl import load
from sysdyn.dsl.elaborate.instances.head import Body
from sysdyn.dsl.elaborate.instances.level_ports import level_ports
from sysdyn.dsl.elaborate.instances.levels import elsewhere
from sysdyn.dsl.elaborate.tables import read_table
from sysdyn.dsl.format.format_expressions import format_expression, format_unit
from sysdyn.dsl.format.format_statements import statement_pieces
from sysdyn.dsl.model.units import NONE, Unit
from sysdyn.dsl.names.symbols import ComponentSymbol, Scope
from sysdyn.dsl.parser.notes import Notes
from sysdyn.dsl.text.diagnostics import Report, SourceText
from sysdyn.dsl.text.source import Span
from sysdyn.dsl.tree import syntax

HERE = Span(0, 1)
NUMBER, MILLI = Unit(NONE, 1.0, "1"), Unit(NONE, 1e-3, "m")


BEHIND = "does not lie behind the one before it: arguments increase from row to row"


def items(text, kind):
    """The items of a kind in a text without errors of syntax."""
    report = Report()
    document = load.document(SourceText("m.sd", text), report)
    assert not [d for d in report if d.severity == "error"], list(report)
    return [i for i in document.file.items if isinstance(i, kind)], document.file.source


# -- tables ------------------------------------------------------------------------------------------------------------


def table(rows, arguments="x: 1", how="linear"):
    found, source = items(f"table f({arguments}) -> 1 {how} [{rows}]\n", syntax.TableDefinition)
    report = Report()
    made = read_table(found[0], [NUMBER] * (arguments.count(",") + 1), NUMBER, source, report)
    return made, [(d.code, d.message) for d in report]


def test_a_table_holds_its_arguments_and_values():
    made, said = table("(0, 5), (1, 7), (3, 4)")
    assert (made.points, made.values, made.outside) == (((0.0, 1.0, 3.0),), (5.0, 7.0, 4.0), "clamp")
    assert said == []


def test_a_grid_is_kept_by_its_axes_whatever_the_order_of_its_rows():
    made, _ = table("(1, 0, 30), (0, 0, 10), (1, 2, 40), (0, 2, 20)", "x: 1, y: 1")
    assert (made.points, made.values) == (((0.0, 1.0), (0.0, 2.0)), (10.0, 20.0, 30.0, 40.0))


@pytest.mark.parametrize(
    ("rows", "arguments", "said"),
    [
        ("(0, 5)", "x: 1", "table f: two rows at least"),
        ("(0, 5), (0, 6)", "x: 1", f"table f: this row {BEHIND}"),
        ("(0, 5, 1), (1, 7, 1)", "x: 1", "a row of table f has 2 numbers, 3 given"),
        ("(0, 0, 1), (1, 1, 2)", "x: 1, y: 1", "table f: the rows must fill a grid, each point once"),
    ],
)
def test_what_makes_no_table_is_said(rows, arguments, said):
    made, found = table(rows, arguments)
    assert made is None
    assert found == [("E206", said)]


def test_values_come_in_si_units():
    found, source = items("table f(x: mm) -> 1 linear [(0, 5), (250, 7)]\n", syntax.TableDefinition)
    made = read_table(found[0], [MILLI], NUMBER, source, Report())
    assert made.points == ((0.0, 0.25),)


@pytest.mark.parametrize(
    ("text", "axes", "said"),
    [
        ("x, y\n# measured\n0, 5\n2, 7\n", ((0.0, 2.0),), []),
        ("0, 5\n2, seven\n", None, ["table f: line 2 of 'data.csv' is not 2 numbers"]),
        ("0, O\n1, 5\n2, 7\n", None, ["table f: line 1 of 'data.csv' is not 2 numbers"]),
        ("0, 5\n2, 1_0\n", None, ["table f: line 2 of 'data.csv' is not 2 numbers"]),
        ("+0.,.5\n2e0,-7E-1\n", ((0.0, 2.0),), []),
        ("0, 5\n0, 7\n", None, [f"table f: row 2 {BEHIND}"]),
    ],
)
def test_a_table_from_a_file(tmp_path, text, axes, said):
    (tmp_path / "data.csv").write_text(text)
    source = SourceText(str(tmp_path / "m.sd"), 'table f(x: 1) -> 1 linear file "data.csv"\n')
    item = load.document(source, Report()).file.items[0]
    report = Report()
    made = read_table(item, [NUMBER], NUMBER, source, report)
    assert (made and made.points) == axes
    assert [d.message for d in report] == said


def test_a_table_lies_in_the_folder_of_its_text(tmp_path):
    (tmp_path / "inner").mkdir()
    (tmp_path / "data.csv").write_text("0, 5\n1, 7\n")
    source = SourceText(str(tmp_path / "inner" / "m.sd"), 'table f(x: 1) -> 1 linear file "../data.csv"\n')
    report = Report()
    assert read_table(load.document(source, Report()).file.items[0], [NUMBER], NUMBER, source, report) is None
    assert [d.message for d in report] == ["table f: '../data.csv' is outside the model's folder"]


# -- components --------------------------------------------------------------------------------------------------------

COMPONENT = """
component part {
  port a, b: electrical
  input u: V
  param R = 1 ohm
  level ideal default {
    branch: electrical
    let gain = 2
  }
  level real {
    branch inner: electrical
    param C = 1 uF
  }
}
"""


def component():
    (found,), source = items(COMPONENT, syntax.ComponentDefinition)
    return found, source


def test_what_a_component_asks_of_its_user():
    found, _ = component()
    head = Body((statement, ()) for statement in found.body).head
    assert (list(head.ports), list(head.inputs), list(head.parameters)) == (["a", "b"], ["u"], ["R"])
    assert not head.generic


def test_statements_of_a_kind_are_picked_in_their_order():
    found, _ = component()
    body = Body((statement, ()) for statement in found.body)
    assert [s.name.name for s, _ in body.statements_of(syntax.LevelStatement)] == ["ideal", "real"]
    assert body.statements_of(syntax.LevelStatement) is body.statements_of(syntax.LevelStatement)
    assert len(list(body)) == len(found.body)


def test_names_of_other_levels_are_told_with_the_first_of_them():
    found, source = component()
    symbol = ComponentSymbol("part", found.body, Scope(), source, source.place(0, 1))
    assert elsewhere(symbol, "ideal") == {"inner": "real", "C": "real"}
    assert elsewhere(symbol, "real") == {"gain": "ideal"}
    assert elsewhere(symbol, None) == {"gain": "ideal", "inner": "real", "C": "real"}


def test_levels_show_the_same_from_outside():
    found, source = component()
    levels = {s.name.name: (s, s.body) for s in found.body if isinstance(s, syntax.LevelStatement)}
    report = Report()
    level_ports("part", levels, source, report)
    assert [(d.code, d.message) for d in report] == [
        ("E804", "level 'ideal' of 'part' lacks branch 'inner', which level 'real' has"),
        ("E804", "level 'real' of 'part' lacks the branch, which level 'ideal' has"),
    ]
    same = Report()
    level_ports("part", {"ideal": levels["ideal"], "other": levels["ideal"]}, source, same)
    assert not len(same)


# -- as it is written --------------------------------------------------------------------------------------------------


def named(name):
    return syntax.Name(name, HERE)


def test_sums_and_products_are_spaced_as_they_bind():
    a, b, c = map(named, "abc")
    product = syntax.Product((("*", a), ("/", b)), HERE)
    assert format_expression(syntax.Sum((("+", product), ("-", c)), HERE)) == "a/b - c"
    assert format_expression(syntax.Power(a, syntax.Number(2.0, "2", HERE), HERE)) == "a^2"
    less = syntax.Compare("<", a, b, HERE)
    assert format_expression(syntax.Conditional(less, a, c, HERE)) == "if a < b then a else c"


def test_a_unit_is_written_with_dots_and_one_stroke_each():
    found = Notes(SourceText("m.sd", "kN.m/s^2")).unit(Span(0, 8))
    assert [(f.op, f.name, f.exponent) for f in found.factors] == [(".", "kN", 1), (".", "m", 1), ("/", "s", 2)]
    assert format_unit(found) == "kN.m/s^2"


def test_a_statement_in_pieces_is_the_statement():
    (found,), _ = items("model m {\n  param   R=1 ohm\n  node a,b : electrical\n}\n", syntax.ModelDefinition)
    assert ["".join(statement_pieces(s)).strip() for s in found.body] == ["param R = 1 ohm", "node a, b: electrical"]
