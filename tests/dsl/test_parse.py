"""Texts that are right: what tree they give."""

from __future__ import annotations

import gc
import math
import re
import subprocess
import sys
from dataclasses import fields, is_dataclass
from pathlib import Path

import pytest
from sysdyn.dsl.parser import lexing, recovery
from sysdyn.dsl.parser.parse import parse
from sysdyn.dsl.text.diagnostics import ModelError
from sysdyn.dsl.text.source import SourceText, Span
from sysdyn.dsl.tree import syntax
from sysdyn.dsl.tree.sameness import same_tree

ROOT = Path(__file__).parents[2]
CORPUS = sorted((Path(__file__).parent / "corpus").glob("*.sd"))
MODELS = sorted((ROOT / "models").glob("*/*.sd")) + sorted((ROOT / "dsl" / "std").glob("**/*.sd"))


def tree(text):
    file, found = parse(SourceText("t.sd", text))
    assert found == ()
    return file


def value(text):
    """The expression after 'const c ='."""
    return tree(f"const c = {text}").items[0].value


def statement(text, scene=False):
    head = "scene s of m" if scene else "model m"
    return tree(f"{head} {{\n  {text}\n}}\n").items[0].body[0]


def nodes(root):
    stack = [root]
    while stack:
        item = stack.pop()
        if isinstance(item, tuple):
            stack.extend(item)
        elif is_dataclass(item) and not isinstance(item, SourceText):
            yield item
            stack.extend(getattr(item, field.name) for field in fields(item))


@pytest.mark.parametrize("path", CORPUS, ids=lambda path: path.stem)
def test_the_corpus_parses_without_findings(path):
    assert parse(SourceText.read(path))[1] == ()


@pytest.mark.parametrize("path", MODELS, ids=lambda path: path.stem)
def test_models_and_library_parse_without_findings(path):
    assert parse(SourceText.read(path))[1] == ()


def test_the_corpus_has_every_kind_of_node():
    seen = {type(node).__name__ for path in CORPUS for node in nodes(parse(SourceText.read(path))[0])}
    kinds = {name for name in syntax.__all__ if is_dataclass(getattr(syntax, name))}
    assert kinds - seen == {"BrokenStatement"}


@pytest.mark.parametrize("path", CORPUS, ids=lambda path: path.stem)
def test_spans_hold_their_children_and_cover_their_text(path):
    source = SourceText.read(path)
    for node in nodes(parse(source)[0]):
        if isinstance(node, syntax.File):
            continue
        assert 0 <= node.span.start <= node.span.end <= len(source.text)
        if isinstance(node, syntax.Name | syntax.Word) and "/" not in node.name:
            assert source.text[node.span.start : node.span.end] == node.name
        for name in (field.name for field in fields(node)):
            child = getattr(node, name)
            if is_dataclass(child):
                assert node.span.start <= child.span.start
                assert child.span.end <= node.span.end


def test_precedence_and_n_ary_chains():
    match value("-a + b*c/d^2 - 3"):
        case syntax.Sum(
            (
                ("+", syntax.Negative(syntax.Name("a"))),
                (
                    "+",
                    syntax.Product(
                        (
                            ("*", syntax.Name("b")),
                            ("*", syntax.Name("c")),
                            ("/", syntax.Power(syntax.Name("d"), syntax.Number(2.0))),
                        )
                    ),
                ),
                ("-", syntax.Number(3.0)),
            )
        ):
            pass
        case other:
            pytest.fail(repr(other))


def test_a_power_binds_tighter_than_a_sign_and_to_the_right():
    assert isinstance(value("-x^2"), syntax.Negative)
    power = value("a^b^c")
    assert isinstance(power.exponent, syntax.Power)
    assert isinstance(value("a^-b").exponent, syntax.Negative)


def test_words_of_logic():
    test = value("a and not b == c or d")
    assert isinstance(test, syntax.Or)
    assert isinstance(test.operands[0], syntax.And)
    assert isinstance(test.operands[0].operands[1], syntax.Not)


def test_quantities_take_their_unit_up_to_the_next_space():
    quantity = value("9.81 m/s^2")
    assert quantity.value == 9.81
    assert [(f.op, f.name, f.exponent) for f in quantity.unit.factors] == [(".", "m", 1), ("/", "s", 2)]
    division = value("10 N / m")
    assert isinstance(division, syntax.Product)
    assert division.factors[1][1].name == "m"
    assert value("2 N.m/rad").unit.text == "N.m/rad"
    assert value("3 K^-1").unit.factors[0].exponent == -1


@pytest.mark.parametrize("word", ["then", "to", "every", "within", "on", "as"])
def test_no_keyword_is_a_unit(word):
    texts = {
        "then": "when if a then 1 else 2 { g := 1 }",
        "to": "time 0 to 4 s",
        "every": "trace 1 every 2 ms",
        "within": "expect x == 1 within 2",
        "on": "accuracy 1e-3 on x",
        "as": "trace 1 as one",
    }
    if word == "then":
        assert isinstance(value("if 1 == 1 then 2 else 3"), syntax.Conditional)
    else:
        statement(texts[word], scene=True)


def test_in_a_unit_one_is_no_quantity():
    table = tree("table f(x: 1) -> 1 linear clamp [ (0, 1), (1, 2) ]").items[0]
    assert table.result.text == "1"
    assert table.rows[1].numbers[1].value == 2.0


@pytest.mark.parametrize(
    "text",
    [
        "coord V: translation",
        "param flow = 1",
        "param time = 1 s",
        "param T = 1 s",
        "state state: m = 0 m",
        "param level = 2",
        "energy T* D = 1 J",
        "time: damper(b = on) x",
    ],
)
def test_keywords_are_names_where_nothing_else_can_be_meant(text):
    statement(text)


def test_energy_functions():
    assert statement("energy T* = x").function == "T*"
    assert statement("energy V* rod = x").name.name == "rod"
    assert statement("content G = x").function == "G"


def test_primes_members_and_methods():
    double = value("x[1]''")
    assert isinstance(double, syntax.Prime)
    assert isinstance(double.base, syntax.Prime)
    assert value("rod.on(x)").name == "on"
    assert value("a.b[1..n, 2].c'").base.base.indices[1].value == 2.0


def test_reductions():
    reduction = value("sum(i in 1..n - 1: x[i])")
    assert (reduction.op, reduction.index.name) == ("sum", "i")
    assert isinstance(reduction.upper, syntax.Sum)


def test_connections_of_an_element():
    element = statement("M: motor.rl(K = 1, R = 2 ohm) p = a, m = b -> c, on q, d -> e, f")
    kinds = [type(item).__name__ for item in element.connections]
    assert kinds == ["Bind", "BindAcross", "On", "Across", "Single"]
    assert element.component.names == ("motor", "rl")
    assert statement("b: machine").args is None
    assert statement("b: machine()").args == ()


def test_a_newline_ends_a_statement_only_where_it_can():
    one = tree("model m {\n  param x = (1\n + 2)\n  param y =\n 3\n param z = 1 +\n\n # why\n 2;param w = 4\n}")
    assert [item.decl.name for item in one.items[0].body] == ["x", "y", "z", "w"]


def test_a_starred_energy_at_the_end_of_a_line_is_no_operator():
    file, found = parse(SourceText("t", "model m {\n  energy T*\n  param x = 1\n}"))
    assert [item.place.start[0] for item in found] == [2]
    assert file.items[0].body[1].decl.name == "x"


def test_documentation_belongs_to_the_statement_below():
    file = tree("## One.\n## Two.\nconst a = 1\n\n## lost\n\nconst b = 2 ## behind\nconst c = 3\n")
    assert [item.doc for item in file.items] == ["One.\nTwo.", None, None]
    assert [comment.own_line for comment in file.comments] == [True, True, True, False]


def test_empty_texts():
    for text in ("", "\n\n", "# only a comment", ";", "\ufeff"):
        assert parse(SourceText("t", text.lstrip("\ufeff")))[0].items == ()


def test_names_are_unicode_and_columns_are_code_points():
    file = tree("const \u03c9 = 1")
    assert file.items[0].name.name == "\u03c9"
    source = SourceText("t", "const \U0001f600 = 1")
    assert parse(source)[1][0].place.start == (1, 7)


@pytest.mark.long
def test_a_sum_of_50000_terms_is_one_node():
    total = value(" +\n".join(["x"] * 50_000))
    assert len(total.terms) == 50_000


def test_nesting_of_200_is_read():
    inner = value("(" * 190 + "x" + ")" * 190)
    depth = 0
    while isinstance(inner, syntax.Parenthesized):
        inner, depth = inner.expr, depth + 1
    assert depth == 190


def test_same_tree_sees_content_and_not_places():
    assert same_tree(tree("const a = 1 + 2"), tree("const  a =\n 1  +  2"))
    assert not same_tree(tree("const a = 1 + 2"), tree("const a = 1 + 3"))
    assert not same_tree(tree("const a = 1 + 2"), tree("const a = 1 - 2"))


def test_the_collector_of_garbage_is_left_as_it_was():
    assert gc.isenabled()
    parse(SourceText("t", "const a = ("))
    assert gc.isenabled()
    gc.disable()
    try:
        parse(SourceText("t", "const a = 1"))
        assert not gc.isenabled()
    finally:
        gc.enable()


def test_numbers_keep_every_digit():
    assert value("-0.0617138900142764496358948458001 rad").operand.value == -0.06171389001427645 * -1
    assert value("5e-324").value == 5e-324
    assert math.isclose(value("1.797e308").value, 1.797e308)


def test_reading_files(tmp_path):
    file = tmp_path / "m.sd"
    file.write_bytes(b"\xef\xbb\xbfconst a = 1\r\nconst b = 2\r\n")
    source = SourceText.read(file)
    assert source.position(source.text.index("b =")) == (2, 7)
    assert source.line(1) == "const a = 1"
    assert len(parse(source)[0].items) == 2
    file.write_bytes(b"const a = 1\nconst \xff = 2\n")
    with pytest.raises(ModelError) as caught:
        SourceText.read(file)
    (found,) = caught.value.diagnostics
    assert (found.code, found.place.start) == ("E116", (2, 7))
    with pytest.raises(FileNotFoundError):
        SourceText.read(tmp_path / "none.sd")


def test_positions():
    source = SourceText("t", "ab\ncd\r\nef\rg")
    assert [source.position(offset) for offset in (0, 2, 3, 7, 10)] == [(1, 1), (1, 3), (2, 1), (3, 1), (4, 1)]
    assert [source.line(number) for number in (1, 2, 3, 4)] == ["ab", "cd", "ef", "g"]
    assert source.place(3, 5).end == (2, 3)
    assert Span(1, 2).end == 2


def test_parsing_needs_neither_lark_nor_time():
    """Start-up of check: the tables come with the package."""
    program = "import sys, sysdyn.dsl.parser.parse; print('lark' in sys.modules, 'numpy' in sys.modules)"
    run = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    assert run.stdout.split() == ["False", "False"]


@pytest.mark.parametrize("module", [lexing, recovery])
def test_no_group_of_a_pattern_is_possessive(module):
    """Python 3.11.2 of Debian 12 loses its place where such a group begins and fails: `1..n` was an error there."""
    patterns = [item.pattern for item in vars(module).values() if isinstance(item, re.Pattern)]
    assert patterns
    assert not [pattern for pattern in patterns if re.search(r"[^\\]\)[?*+]\+", pattern)]
