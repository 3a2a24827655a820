"""What tree a text is: each kind of node by hand, part for part, so that no two of its parts can change places."""

from fractions import Fraction

import pytest
from sysdyn.dsl.parser import build_expressions, build_scenes, build_statements
from sysdyn.dsl.parser.notes import Notes
from sysdyn.dsl.parser.parse import parse
from sysdyn.dsl.text.source import SourceText, Span
from sysdyn.dsl.tree import syntax_expressions as e
from sysdyn.dsl.tree import syntax_items as i
from sysdyn.dsl.tree import syntax_scenes as c
from sysdyn.dsl.tree import syntax_statements as s
from sysdyn.dsl.tree.sameness import first_difference

AT = Span(0, 1)


def read(text):
    file, found = parse(SourceText("t.sd", text))
    assert found == ()
    return file.items


def n(name):
    return e.Name(name, AT)


def w(name):
    return e.Word(name, AT)


def d(name, *indices):
    return e.Decl(name, indices, AT)


def num(text):
    return e.Number(float(text), text, AT)


def unit(text, *factors):
    return e.UnitExpression(tuple(e.UnitFactor(name, power, sign, AT) for name, power, sign in factors), text, AT)


VOLT, METRE, SECOND = (unit(name, (name, 1, ".")) for name in ("V", "m", "s"))


def qty(text, of):
    return e.QuantityLiteral(float(text), text, of, AT)


def less(left, right):
    return e.Sum((("+", left), ("-", right)), AT)


EXPRESSIONS = {
    "a - b - c": e.Sum((("+", n("a")), ("-", n("b")), ("-", n("c"))), AT),
    "a/b/c": e.Product((("*", n("a")), ("/", n("b")), ("/", n("c"))), AT),
    "a - b*c": less(n("a"), e.Product((("*", n("b")), ("*", n("c"))), AT)),
    "-a^b": e.Negative(e.Power(n("a"), n("b"), AT), AT),
    "a^b^c": e.Power(n("a"), e.Power(n("b"), n("c"), AT), AT),
    "a^-b": e.Power(n("a"), e.Negative(n("b"), AT), AT),
    "(a)": e.Parenthesized(n("a"), AT),
    "x[1, i].y'": e.Prime(e.Member(e.Item(n("x"), (num("1"), n("i")), AT), "y", AT), AT),
    "x[1..k]": e.Item(n("x"), (e.Range(num("1"), n("k"), AT),), AT),
    "f(a, b)": e.FunctionCall("f", (e.Arg(None, n("a"), AT), e.Arg(None, n("b"), AT)), AT),
    "f(x = a)": e.FunctionCall("f", (e.Arg("x", n("a"), AT),), AT),
    "r.on(x)": e.MethodCall(n("r"), "on", (e.Arg(None, n("x"), AT),), AT),
    "prod(j in a..b: c)": e.Reduction("prod", w("j"), n("a"), n("b"), n("c"), AT),
    "a < b": e.Compare("<", n("a"), n("b"), AT),
    "a or b and not c": e.Or((n("a"), e.And((n("b"), e.Not(n("c"), AT)), AT)), AT),
    "if a then b else c": e.Conditional(n("a"), n("b"), n("c"), AT),
    "[a, b]": e.Array((n("a"), n("b")), AT),
    "[]": e.Array((), AT),
    "true": e.Bool(True, AT),
    "false": e.Bool(False, AT),
    "2.50e3 kg.m/s^2": qty("2.50e3", unit("kg.m/s^2", ("kg", 1, "."), ("m", 1, "."), ("s", 2, "/"))),
    "3 m^-2": qty("3", unit("m^-2", ("m", -2, "."))),
}


@pytest.mark.parametrize(("text", "tree"), EXPRESSIONS.items(), ids=EXPRESSIONS)
def test_an_expression(text, tree):
    assert first_difference(read(f"const k = {text}"), (i.ConstDefinition(w("k"), tree, AT, None),)) is None


EQUAL, GUESS = s.InitialValue("fixed", n("a"), AT), s.InitialValue("guess", n("a"), AT)
STATEMENTS = {
    "param p[3]: m = a": s.ParamStatement(d("p", num("3")), METRE, n("a"), AT, None),
    "param p": s.ParamStatement(d("p"), None, None, AT, None),
    "node u, v[1..k]: electrical ~ a": s.NodeStatement(
        (d("u"), d("v", e.Range(num("1"), n("k"), AT))), w("electrical"), GUESS, AT, None
    ),
    "port u, v: electrical": s.PortStatement((d("u"), d("v")), w("electrical"), AT, None),
    "branch: electrical": s.BranchStatement((), w("electrical"), AT, None),
    "branch u: electrical": s.BranchStatement((d("u"),), w("electrical"), AT, None),
    "input u: V = a": s.InputStatement(d("u"), VOLT, n("a"), AT, None),
    "output y = a": s.OutputStatement(d("y"), n("a"), AT, None),
    "quasi w: m/s = a": s.QuasiStatement(d("w"), unit("m/s", ("m", 1, "."), ("s", 1, "/")), n("a"), AT, None),
    "coord x, y: translation = a": s.CoordStatement("coord", (d("x"), d("y")), w("translation"), None, EQUAL, AT, None),
    "coord x: translation tangible": s.CoordStatement("coord", (d("x"),), w("translation"), True, None, AT, None),
    "coord x: translation intangible ~ a": s.CoordStatement(
        "coord", (d("x"),), w("translation"), False, GUESS, AT, None
    ),
    "implicit e1: V ~ a": s.ImplicitStatement((d("e1"),), VOLT, GUESS, AT, None),
    "state z: m = a": s.StateStatement(d("z"), METRE, n("a"), AT, None),
    "dynamic z = a": s.DynamicStatement(n("z"), n("a"), AT, None),
    "let y = a": s.LetStatement(d("y"), n("a"), AT, None),
    "energy T* own = a": s.EnergyStatement("T*", w("own"), n("a"), AT, None),
    "energy V = a": s.EnergyStatement("V", None, n("a"), AT, None),
    "content D = a": s.ContentStatement("D", None, n("a"), AT, None),
    "work a on b": s.WorkStatement(n("a"), n("b"), AT, None),
    "phi rod: a = b": s.ConstraintStatement("phi", d("rod"), n("a"), "=", n("b"), (), AT, None),
    "phi stop: a >= b while c restitution k": s.ConstraintStatement(
        "phi", d("stop"), n("a"), ">=", n("b"),
        (s.Guard("while", n("c"), AT), s.Guard("restitution", n("k"), AT)), AT, None,
    ),
    "init x.q = a": s.InitStatement(e.Member(n("x"), "q", AT), EQUAL, AT, None),
    "init x.q ~ a": s.InitStatement(e.Member(n("x"), "q", AT), GUESS, AT, None),
    "when a { z := b }": s.WhenStatement(n("a"), (s.ActionStatement(n("z"), n("b"), AT),), AT, None),
    "every a { z := b }": s.EveryStatement(n("a"), (s.ActionStatement(n("z"), n("b"), AT),), AT, None),
    "for j in a..b { let y[j] = c }": s.ForStatement(
        w("j"), n("a"), n("b"), (s.LetStatement(d("y", n("j")), n("c"), AT, None),), AT, None
    ),
    "require a > b": s.RequireStatement(e.Compare(">", n("a"), n("b"), AT), AT, None),
    "lossless": s.LosslessStatement(AT, None),
    "R: resistor(a) u -> v": s.InstanceStatement(
        d("R"), e.Dotted(("resistor",), AT), (e.Arg(None, n("a"), AT),), (s.Across(n("u"), n("v"), AT),), AT, None
    ),
    "R: lib.pump(a) u": s.InstanceStatement(
        d("R"), e.Dotted(("lib", "pump"), AT), (e.Arg(None, n("a"), AT),), (s.Single(n("u"), AT),), AT, None
    ),
    "W: flow(a) on b": s.InstanceStatement(
        d("W"), e.Dotted(("flow",), AT), (e.Arg(None, n("a"), AT),), (s.On(n("b"), AT),), AT, None
    ),
    "M: motor(a) p = u, m = v -> ground": s.InstanceStatement(
        d("M"),
        e.Dotted(("motor",), AT),
        (e.Arg(None, n("a"), AT),),
        (s.Bind(w("p"), n("u"), AT), s.BindAcross(w("m"), n("v"), n("ground"), AT)),
        AT,
        None,
    ),
}  # fmt: skip


@pytest.mark.parametrize(("text", "tree"), STATEMENTS.items(), ids=STATEMENTS)
def test_a_statement_of_a_model(text, tree):
    assert (
        first_difference(read(f"model m {{\n  {text}\n}}\n"), (i.ModelDefinition(w("m"), (tree,), AT, None),)) is None
    )


SCENES = {
    "time a to b": c.TimeStatement(n("a"), n("b"), AT, None),
    "set p = a": c.SetStatement(n("p"), n("a"), AT, None),
    "level M.La = fine": c.SceneLevelStatement(e.Member(n("M"), "La", AT), w("fine"), AT, None),
    "trace a, b in mm as y every c": c.TraceStatement(
        (c.TraceItem(n("a"), None, None, AT), c.TraceItem(n("b"), unit("mm", ("mm", 1, ".")), w("y"), AT)),
        n("c"), AT, None,
    ),
    "accuracy a on b, k": c.AccuracyStatement(n("a"), (n("b"), n("k")), False, AT, None),
    "accuracy a": c.AccuracyStatement(n("a"), (), False, AT, None),
    "formulation kane": c.FormulationStatement(w("kane"), AT, None),
    "solver radau": c.SolverStatement(w("radau"), None, AT, None),
    "redundancy drop": c.RedundancyStatement(w("drop"), AT, None),
    "limit steps a": c.LimitStatement(w("steps"), n("a"), AT, None),
    "expect always: a < b": s.ExpectStatement("always", None, n("a"), "<", n("b"), None, AT, None),
    "expect at k: a == b within c": s.ExpectStatement("at", n("k"), n("a"), "==", n("b"), n("c"), AT, None),
    'expect golden "r.h5" within a': s.GoldenStatement("r.h5", n("a"), AT, None),
}  # fmt: skip


@pytest.mark.parametrize(("text", "tree"), SCENES.items(), ids=SCENES)
def test_a_statement_of_a_scene(text, tree):
    scene = i.SceneDefinition(w("go"), e.Dotted(("m",), AT), (tree,), AT, None)
    assert first_difference(read(f"scene go of m {{\n  {text}\n}}\n"), (scene,)) is None


ITEMS = {
    "from std.electrical import resistor, capacitor": i.Import(
        e.Dotted(("std", "electrical"), AT), (w("resistor"), w("capacitor")), AT, None
    ),
    "bundle pair { plus, minus: electrical }": i.BundleDefinition(
        w("pair"), (i.BundleMember((w("plus"), w("minus")), w("electrical"), AT),), AT, None
    ),
    "unit mil = a": i.UnitAlias(w("mil"), n("a"), AT, None),
    "unit person base": i.UnitBase(w("person"), AT, None),
    "fn f(x: m, y[3]: s) -> V = a": i.FunctionDefinition(
        w("f"),
        (i.FormalParameter("x", None, METRE, AT), i.FormalParameter("y", num("3"), SECOND, AT)),
        VOLT, n("a"), AT, None,
    ),
    "table f(x: m) -> V linear stop [(1, 2), (3, -4)]": i.TableDefinition(
        w("f"), (i.FormalParameter("x", None, METRE, AT),), VOLT, "linear", "stop",
        (i.TableRow((num("1"), num("2")), AT), i.TableRow((num("3"), num("-4")), AT)), None, AT, None,
    ),
    'table f(x: m) -> V cubic file "f.csv"': i.TableDefinition(
        w("f"), (i.FormalParameter("x", None, METRE, AT),), VOLT, "cubic", None, None, "f.csv", AT, None
    ),
    "component c { }": i.ComponentDefinition(w("c"), (), AT, None),
}  # fmt: skip


@pytest.mark.parametrize(("text", "tree"), ITEMS.items(), ids=ITEMS)
def test_an_item(text, tree):
    assert first_difference(read(text + "\n"), (tree,)) is None


def test_documentation_belongs_to_the_statement_below_it():
    (model,) = read("## a pump\nmodel m {\n  ## its speed\n  param w\n  param v\n}\n")
    assert (model.doc, [p.doc for p in model.body]) == ("a pump", ["its speed", None])


# -- what the grammar alone cannot say ---------------------------------------------------------------------------------


def told(build, values, text="0123456789"):
    """What a builder makes of values, and what it says: code, message, help, the text that it points at."""
    source = SourceText("t.sd", text)
    notes = Notes(source)
    made = build(values, Span(0, len(text)), notes)
    found = [(x.code, x.message, x.help, text[x.place.span.start : x.place.span.end]) for x in notes.report]
    return made, found


def test_only_four_operations_run_over_an_index():
    bounds = e.Range(num("1"), num("3"), AT)
    _, found = told(build_expressions.reduction, [e.Word("mean", Span(0, 4)), e.Word("t", Span(5, 6)), bounds, n("a")])
    assert found == [
        ("E113", "'mean' does not run over an index", "sum, prod, min or max(i in 1..n: ...)", "0123"),
        ("E108", "'t' is predefined and cannot be declared", "another name", "5"),
    ]


@pytest.mark.parametrize(
    ("power", "made", "message"),
    [
        ("-12", -12, None),
        ("100", 1, "the exponent '100' of a unit is out of range: -99 to 99"),
        ("1.5", Fraction(3, 2), None),
        ("-2.0", -2, None),
        ("1.2345678", Fraction(100, 81), None),  # as exact as an exponent of a quantity
    ],
)
def test_exponents_of_units_are_small_numbers(power, made, message):
    factor, found = told(build_expressions.unit_variable, [e.Word("u", AT), e.Number(0.0, power, Span(2, 5))])
    assert (factor.name, factor.exponent) == ("$u", made)
    assert [(code, text, at) for code, text, _, at in found] == ([] if message is None else [("E113", message, "234")])


def test_a_unit_has_no_number_but_one():
    one, found = told(build_expressions.unit_one, [num("1")])
    assert (one.name, told(build_expressions.unit, [one])[1]) == ("1", [])
    two, _ = told(build_expressions.unit_one, [num("2")], "2")
    _, found = told(build_expressions.unit, [two], "2")
    assert [f[:2] for f in found] == [("E113", "a unit has no number 2 in it; only 1 stands for none")]


@pytest.mark.parametrize(
    ("build", "letter", "kind", "help_"),
    [
        (build_statements.energy, "T*", s.EnergyStatement, None),
        (build_statements.content, "G", s.ContentStatement, None),
        (build_statements.energy, "D", s.ContentStatement, "content D = ..."),
        (build_statements.content, "V", s.EnergyStatement, "energy V = ..."),
    ],
)
def test_a_state_function_is_what_its_letter_says(build, letter, kind, help_):
    made, found = told(build, [w(letter), None, n("a")])
    assert (type(made), made.function) == (kind, letter)
    assert [(code, help_) for code, _, help_, _ in found] == ([] if help_ is None else [("E308", help_)])


def test_nodes_have_a_common_effort_or_flow():
    made, found = told(build_statements.domain_node, ["momentum"])
    assert isinstance(made, s.BrokenStatement)
    assert [f[1] for f in found] == ["nodes have a common effort or a common flow, not a common momentum"]
    assert told(build_statements.domain_node, ["flow"])[0].common == "flow"


def test_time_is_a_label_that_declares_nothing():
    """The library has elements `t`; no parameter may be named so."""
    assert told(build_statements.instance, [d("t"), e.Dotted(("damper",), AT), None, None])[1] == []
    assert [f[0] for f in told(build_statements.param, [d("t"), None, None])[1]] == ["E108"]
    assert [f[0] for f in told(build_statements.instance, [d("pi"), e.Dotted(("damper",), AT), None, None])[1]] == [
        "E108"
    ]


def test_a_scene_keeps_what_it_sets():
    made, found = told(build_scenes.set_, [n("p"), num("3")])
    assert (made.target.name, made.value.value, found) == ("p", 3.0, [])
