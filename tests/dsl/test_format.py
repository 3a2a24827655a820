"""Canonical layout: what it looks like, that it is stable, and that it says the same."""

from __future__ import annotations

from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from sysdyn.dsl.format.format import format_expression, format_text, format_unit
from sysdyn.dsl.parser.parse import parse
from sysdyn.dsl.text.diagnostics import ModelError
from sysdyn.dsl.text.source import SourceText, Span
from sysdyn.dsl.tree import syntax as s
from sysdyn.dsl.tree.sameness import first_difference

ROOT = Path(__file__).parents[2]
CORPUS = sorted((Path(__file__).parent / "corpus").glob("*.sd"))
MODELS = sorted((ROOT / "models").glob("*/*.sd")) + sorted((ROOT / "dsl" / "std").glob("**/*.sd"))
NOWHERE = Span(0, 0)


def tree(text):
    file, found = parse(SourceText("t.sd", text))
    assert found == (), text
    return file


def check_round_trip(text):
    once = format_text(text)
    assert format_text(once) == once
    assert first_difference(tree(text), tree(once)) is None
    return once


@pytest.mark.parametrize("path", [*CORPUS, *MODELS], ids=lambda path: path.stem)
@pytest.mark.one_in(200)
def test_formatting_is_idempotent_and_keeps_the_tree_and_the_comments(path):
    text = SourceText.read(path).text
    once = check_round_trip(text)
    assert [c.text for c in tree(once).comments] == [c.text for c in tree(text).comments]
    assert all(line == line.rstrip() for line in once.split("\n"))
    assert "\n\n\n" not in once
    assert once.endswith("\n")
    assert not once.endswith("\n\n")


def test_the_layout_nobody_would_choose():
    text = (Path(__file__).parent / "corpus" / "layout.sd").read_text(encoding="utf-8")
    assert format_text(text) == LAYOUT


LAYOUT = """\
# A file whose layout nobody would choose.
const a = 1 + 2*3
const b = 2                            # two on a line

## documented

## documented again
model m {
  param m = 1 kg
  param k = 4 N/m                      # both

  coord x: translation = 1 m
  # a comment at the wrong place
  energy T* = 1/2*m*x'^2
  energy V = (1/2*k*x^2)               # behind a broken line
  let y = [1,   # one
     2,
            3]                         # three

  # before the loop
  for i in 1..3 { init z[i] = 0; init w[i] = 1 }  # behind the loop
  for j in 1..2 {                      # behind the brace
    init v[j] = 0
    # at the end
  }
  when x > 1 m { }
  K: spring(k = 4 N/m, l0 = 0 m) x -> ground

  # last
}
table t1(x: 1) -> 1 linear [
  (0, 0), (1, 1),
  (2, 4)
]
scene s of m {
  time 0 s to 1 s
  trace x, x' every 1 ms
}
# the end
"""


@pytest.mark.parametrize(
    ("text", "wanted"),
    [
        ("a+b-c", "a + b - c"),
        ("a * b / c ^ 2", "a*b/c^2"),
        ("- x ^ - 2", "-x^-2"),
        ("4 kJ/K / n", "4 kJ/K / n"),
        ("4 kJ/K/n", "4 kJ/K/n"),
        ("30 m/s / foo(3) * 2", "30 m/s / foo(3)*2"),
        ("30 m/s /2", "30 m/s/2"),
        ("30 m/s /(2 s)", "30 m/s/(2 s)"),
        ("2 N ^2", "2 N ^2"),
        ("1 m / x[1].q'", "1 m / x[1].q'"),
        ("if a and(not b)or c then 1 else[ 1,2 ]", "if a and (not b) or c then 1 else [1, 2]"),
        ("sum( i in 1 .. n-1 : x[ i,2..3 ]' )", "sum(i in 1..n - 1: x[i, 2..3]')"),
        ("a.on( x , y=2 )", "a.on(x, y = 2)"),
        ("1e-3", "1e-3"),
        ("0.0500", "0.0500"),
        ('f("text")', 'f("text")'),
    ],
)
def test_expressions(text, wanted):
    expr = tree(f"const c = {text}").items[0].value
    assert format_expression(expr) == wanted
    assert first_difference(expr, tree(f"const c = {wanted}").items[0].value) is None


def test_units():
    unit = tree("const c = 3 kg.m^2/s^-1").items[0].value.unit
    assert format_unit(unit) == "kg.m^2/s^-1"


def name(text):
    return s.Name(text, NOWHERE)


def test_trees_made_elsewhere_get_their_parentheses():
    total = s.Sum((("+", name("a")), ("-", s.Sum((("+", name("b")), ("+", name("c"))), NOWHERE))), NOWHERE)
    assert format_expression(total) == "a - (b + c)"
    assert format_expression(s.Product((("*", total), ("/", total)), NOWHERE)) == "(a - (b + c))/(a - (b + c))"
    assert format_expression(s.Power(s.Negative(name("a"), NOWHERE), name("b"), NOWHERE)) == "(-a)^b"
    assert format_expression(s.Prime(total, NOWHERE)) == "(a - (b + c))'"
    test = s.Conditional(name("c"), total, name("d"), NOWHERE)
    assert format_expression(s.Negative(test, NOWHERE)) == "-(if c then a - (b + c) else d)"
    assert format_expression(s.Range(name("a"), total, NOWHERE)) == "a..a - (b + c)"


def test_long_lines_are_broken_where_the_language_allows():
    arguments = ", ".join(f"parameter_{number} = {number}.5 N.m/rad" for number in range(12))
    sums = " + ".join(f"some_name[{number}]*other_name^2" for number in range(30))
    product = "*".join(f"factor_number_{number}" for number in range(30))
    text = f"model m {{\n  e: thing({arguments}) a -> b\n  let u = {sums}\n  let v = {product}\n}}\n"
    once = check_round_trip(text)
    assert max(map(len, once.split("\n"))) <= 100
    assert len(once.split("\n")) > 15


@pytest.mark.long
def test_huge_and_deep_expressions_are_written():
    check_round_trip("const a = " + " +\n".join(["x"] * 50_000))
    check_round_trip("const a = " + "(" * 190 + "x" + ")" * 190)
    check_round_trip("const a = " + "if x then y else " * 190 + "z")


def test_texts_with_errors_are_refused():
    with pytest.raises(ModelError) as caught:
        format_text("model m {\n  param a = 3kg\n}\n")
    assert caught.value.diagnostics[0].code == "E114"
    assert format_text("") == ""
    assert format_text("# c") == "# c\n"


# --- texts made by a grammar, with spaces and line breaks put in at random ---

NAMES = st.sampled_from(["a", "b1", "x", "theta", "time", "m", "T", "\u03c9"])
UNITS = st.sampled_from(["m", "kg.m^2", "N/m", "V.s/rad", "K^-1"])
NUMBERS = st.sampled_from(["0", "1", "2.50", "1e-3", "6.02E+23", "007"])


def joined(item, signs, least=2, most=4):
    pieces = st.lists(st.tuples(item, st.sampled_from(signs)), min_size=least, max_size=most)
    return pieces.map(lambda drawn: "".join(text + sign for text, sign in drawn[:-1]) + drawn[-1][0])


ATOMS = st.one_of(
    NAMES,
    NUMBERS,
    st.tuples(NUMBERS, UNITS).map(" ".join),
    st.tuples(NAMES, NAMES).map(".".join),
    NAMES.map("{}'".format),
)


def larger(inner):
    closed = inner.map("({})".format)
    tight = st.one_of(ATOMS, closed)
    return st.one_of(
        closed,
        joined(tight, [" + ", "-", " +\n ", " - "]),
        joined(tight, ["*", " / ", " * "]),
        st.tuples(closed | NAMES, tight).map("^".join),
        tight.map("-{}".format),
        st.tuples(NAMES, st.lists(inner, max_size=3)).map(lambda drawn: f"{drawn[0]}( {' ,'.join(drawn[1])})"),
        st.tuples(NAMES, tight, inner).map(lambda drawn: f"sum({drawn[0]} in 1 ..{drawn[1]} : {drawn[2]})"),
        st.lists(inner, max_size=3).map(lambda items: f"[{','.join(items)}\n]"),
        st.tuples(inner, inner, inner).map(lambda drawn: "(if ({}) then {} else {})".format(*drawn)),
        st.tuples(closed, st.sampled_from(["==", "<=", " > "]), closed).map("".join).map("({})".format),
        joined(closed, [" and ", " or "]).map("({})".format),
    )


EXPRESSIONS = st.recursive(ATOMS, larger, max_leaves=12)
STATEMENTS = st.one_of(
    st.tuples(NAMES, EXPRESSIONS).map("param {0[0]} = {0[1]}".format),
    st.tuples(NAMES, UNITS, EXPRESSIONS).map("state {0[0]} :{0[1]} = {0[2]}".format),
    st.tuples(NAMES, NAMES, EXPRESSIONS).map("coord {0[0]},{0[1]}: rotation tangible ~ {0[2]}".format),
    st.tuples(NAMES, EXPRESSIONS).map("energy T* {0[0]}= {0[1]}".format),
    st.tuples(NAMES, NAMES, NUMBERS).map("phi {0[0]}[1]: {0[1]} = {0[2]} while a restitution 1".format),
    st.tuples(NAMES, EXPRESSIONS, NAMES).map("{0[0]}: thing(k = {0[1]}) a -> {0[2]}, b = c -> d".format),
    st.tuples(NAMES, EXPRESSIONS).map("when a > 1 {{ {0[0]} := {0[1]} }}".format),
    st.tuples(NAMES, EXPRESSIONS).map("for i in 1..3 {{\n init {0[0]}[i] = {0[1]};init b ~ 2 }}".format),
    st.tuples(NAMES, EXPRESSIONS).map("expect at 1 s: {0[0]} == ({0[1]}) within 1 mm".format),
)
SEPARATORS = st.sampled_from(["\n", "\n\n\n", ";", "  # said\n", "\n## doc\n", "\n   # own\n\n"])


@settings(max_examples=150, deadline=None)
@given(EXPRESSIONS)
@pytest.mark.long
def test_any_expression_survives_formatting(text):
    expr = tree(f"const c = {text}").items[0].value
    once = format_expression(expr)
    again = tree(f"const c = {once}").items[0].value
    assert first_difference(expr, again) is None
    assert format_expression(again) == once


@settings(max_examples=150, deadline=None)
@given(st.lists(st.tuples(STATEMENTS, SEPARATORS), max_size=6))
@pytest.mark.long
def test_any_model_survives_formatting(parts):
    text = "model m {\n" + "".join(statement + separator for statement, separator in parts) + "}\n"
    once = check_round_trip(text)
    assert [c.text for c in tree(once).comments] == [c.text for c in tree(text).comments]
