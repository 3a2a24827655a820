"""Texts that are wrong: what is said, where, and that the rest is read nevertheless."""

from __future__ import annotations

import pytest
from sysdyn.dsl.parser import complaints
from sysdyn.dsl.parser.grammar import load_tables
from sysdyn.dsl.parser.parse import parse
from sysdyn.dsl.text.codes import codes
from sysdyn.dsl.text.source import SourceText
from sysdyn.dsl.tree.syntax import BrokenStatement

SYNTAX = [f"E{number}" for number in range(107, 119)] + ["E308"]


def findings(text):
    return [(item.code, *item.place.start) for item in parse(SourceText("t.sd", text))[1]]


def only(text):
    found = parse(SourceText("t.sd", text))[1]
    assert len(found) == 1, found
    return found[0]


def in_model(line):
    return only(f"model m {{\n  param before = 1\n  {line}\n  param after = 1\n}}\n")


@pytest.mark.parametrize("code", SYNTAX)
def test_the_page_of_each_code_of_syntax_is_true(code):
    page = codes()[code]
    assert {item.code for item in parse(SourceText("bad", page.bad))[1]} == {code}
    assert parse(SourceText("good", page.good))[1] == ()


@pytest.mark.parametrize("code", [code for code, page in codes().items() if page.good and code not in SYNTAX])
def test_the_examples_of_the_other_codes_parse(code):
    page = codes()[code]
    netlist = page.by.startswith("sysdyn import")  # its wrong example is no text of ours
    for text in (page.good,) if netlist else (page.bad, page.good):
        assert parse(SourceText("t.sd", text))[1] == ()


@pytest.mark.parametrize("text", ["model {}", "component {}", "domain {}", "bundle {}"])
@pytest.mark.parametrize("name", ["t", "pi", "ground", "audit"])
def test_what_a_file_holds_hides_no_predefined_name(text, name):
    """A model t would hide the time in itself."""
    inner = {"domain": "effort e: V\n flow f: A\n node common effort", "bundle": "x: translation"}
    source = SourceText("t.sd", f"{text.format(name)} {{\n {inner.get(text.split()[0], '')}\n}}\n")
    assert [d.code for d in parse(source)[1]] == ["E108"]


OF_ALL = "or parentheses around the whole quantity whose power is meant"
NUMBERS = "a number, as in m^2, m^1.5 or m^1/3; for a power of the quantity parentheses around it: (2 m)^(n)"
CASES = [
    ("time 0 s to 4 s", "E107", 3, "'time' belongs in a scene, not in a model", None),
    ("trace x", "E107", 3, "'trace' belongs in a scene", None),
    ("level a = b", "E107", 3, "belongs in a scene", None),
    ("const a = 1", "E107", 3, "'const' belongs at the top of a file", None),
    ("param ground = 1", "E108", 9, "'ground' is predefined", None),
    ("coord x, t: translation", "E108", 12, "'t' is predefined", None),
    ("for pi in 1..2 { }", "E108", 7, "'pi' is predefined", None),
    ("audit: mass(m = 1 kg) x", "E108", 3, "'audit' is predefined", None),
    ("-> ground", "E109", 3, "cannot begin with '->'", "comma"),
    ("a -> b", "E109", 3, "connection", "comma"),
    (", b = c", "E109", 3, "cannot begin with ','", "comma"),
    ("phi a: q' = if x then 1 else 2", "E110", 15, "needs parentheses", "(if ... then ... else ...)"),
    ("let y = 1 + if x then 1 else 2", "E110", 15, "needs parentheses", "(if ... then ... else ...)"),
    ("phi a: x == 1", "E111", 12, "'==' compares; a constraint is written with '='", "="),
    ("param a == 1", "E111", 11, "'==' compares; 'param' defines with '='", "="),
    ('expect golden "a.h5 within 1', "E112", 17, "not closed", '"'),
    ("param a = (1 + 2", "E112", 13, "'(' opened at line 3 is not closed", ")"),
    ("param a = [1, 2", "E112", 13, "'[' opened at line 3 is not closed", "]"),
    ("work (a + b on x", "E112", 8, "'(' opened at line 3 is not closed", ")"),
    ("param a = (1 + 2]", "E112", 13, "'(' opened at line 3 is not closed", ")"),
    ("connect(a, b)", "E113", 3, "no statement begins with 'connect'", "label: component() a -> b"),
    ("paran a = 1", "E113", 3, "no statement begins with 'paran'", "param"),
    ("enrgy T* = 1", "E113", 3, "no statement begins with 'enrgy'", "energy"),
    ("x = 3", "E113", 3, "no statement begins with 'x'", "let x = ..."),
    ("s' = 3", "E113", 3, "no statement begins with 's''", "dynamic s' = ..."),
    ("foo", "E113", 3, "no statement begins with 'foo'", None),
    ("work: mass(m = 1 kg) x", "E113", 3, "cannot be the label", "work_: ..."),
    ("let y = a < b < c", "E113", 17, "found '<'", "do not chain"),
    ("let y = 1 ** 2", "E113", 14, "a power is written with '^'", "a^b"),
    ("let y = .5", "E113", 11, "expected an expression, found '.'", "0.5"),
    ("let y = +5", "E113", 11, "expected an expression, found '+'", "leading '+'"),
    ("let y = 2 m/sqrt(x)", "E113", 19, "found '('", "sqrt is read as a unit; to divide by its value: m / sqrt(...)"),
    ("let y = (3 1/s)*x", "E113", 14, "found '1'", "3 s^-1 for 3 1/s"),
    ("let y = 1 +", "E113", 13, "the statement ends with '+'", None),
    ("let y = a && b", "E113", 13, "'&' (U+0026, ampersand)", "and"),
    ("let y = a\u00a0+ b", "E113", 12, "U+00A0, no-break space", "an ordinary space"),
    ("let y = 3 \u2212 2", "E113", 13, "U+2212", "hyphen"),
    ("let e\u0301 = 3", "E113", 8, "U+0301", "one character for the letter and its accent (Unicode NFC)"),
    ("work 3 N", "E113", 11, "expected 'on', found the end of the line", None),
    ("param a: = 3", "E113", 12, "expected a unit, found '='", None),
    ("coord x", "E113", 10, "expected", None),
    ("when x = 3 { g := 1 }", "E113", 10, "'=' defines", "=="),
    ("when x > 3 { g = 1 }", "E113", 18, "an action assigns with ':='", ":="),
    ("let y = 3 m^2.5.5", "E113", 18, "found '.'", None),
    ("let y = 3 m^(-2)/s", "E115", 13, "without parentheses, in 'm^(-2)/s'", f"write 'm^-2/s', {OF_ALL}"),
    ("let y = 3 N/m^(3/2)", "E115", 15, "without parentheses", f"write 'N/m^1.5', {OF_ALL}"),
    ("let y = 2 kg.m^(4/2)", "E115", 16, "without parentheses", f"write 'kg.m^2', {OF_ALL}"),
    ("let y = 3 m^(before)", "E115", 13, "without parentheses", NUMBERS),
    ("param y: m^(2) = 3 m^2", "E115", 14, "without parentheses", "^2"),
    ("param y: m^(n) = 3 m^2", "E115", 14, "without parentheses", "^2, ^1.5 or ^1/3"),
    ("param y: m^123 = 1", "E113", 14, "out of range", None),
    ("param y: m^1/7 = 1", "E113", 12, "an integer, a decimal or a fraction", None),
    ("param y: m^4/2 = 1", "E113", 12, "an integer, a decimal or a fraction", None),
    ("param y: m/2 = 1", "E113", 14, "no number 2", None),
    ("param y: 2 = 1", "E113", 12, "no number 2", None),
    ("let y = norm(i in 1..3: x[i])", "E113", 11, "'norm' does not run over an index", "sum"),
    ("C1.e = 0 V", "E113", 3, "no statement begins with 'C1.e'", "init C1.e = ... where it begins"),
    (
        "R1: resistor(R = 1 ohm a -> b",
        "E112",
        26,
        "the parentheses of 'resistor' are not closed",
        "(R = 1 ohm) a -> ...",
    ),
    ("V1: voltage(v = (1 V)*sin(f*t) a[1] -> b", "E112", 34, "of 'voltage' are not closed", "sin(f*t)) a -> ..."),
    ("R1: resistor a -> b (R = 1 ohm)", "E113", 23, "stand behind the component", "resistor(R = 1 ohm) a -> b"),
    ("kinetic T* = 1 J", "E113", 3, "no statement begins with 'kinetic'", "energy T* = 1/2*m*x'^2"),
    ("let y = 2 m (a + b)", "E113", 15, "'m' stands where a unit is read", ": 2*m*(...)"),
    ("let y = sum(x[i]^2*sin(k) for i in 1..n)", "E113", 29, "found 'for'", "sum(i in 1..n: ...)"),
    ("L = 1/2*m*x'^2 - V", "E113", 3, "a Lagrangian is written by its parts", "energy T* = 1/2*m*x'^2, energy V"),
    ("let y = 2 sin(a)", "E113", 16, "'sin' stands where a unit is read", ": 2*sin(...)"),
    ("param a = 3kg", "E114", 13, "'3kg': a number and its unit are separated by a space", "3 kg"),
    ("let y = 2x", "E114", 11, "'2x'", "2 x"),
    ("param a = 1e999 m", "E114", 13, "too large", "inf"),
    ("param a = 1e-999 m", "E114", 13, "too small", "0"),
    ("node then: electrical", "E115", 8, "'then' is reserved", "then_"),
    ("param if = 1", "E115", 9, "'if' is reserved", "if_"),
    ("true: mass(m = 1 kg) x", "E115", 3, "'true' is reserved", "true_"),
    ("energy D = 1", "E308", 10, "D is a content", "content D = ..."),
    ("content V* = 1", "E308", 11, "V* is an energy", "energy V* = ..."),
]


@pytest.mark.parametrize(("line", "code", "column", "message", "help_"), CASES, ids=[case[0] for case in CASES])
def test_what_is_said_about_a_line(line, code, column, message, help_):
    found = in_model(line)
    assert (found.code, *found.place.start) == (code, 3, column)
    assert message in found.message
    assert help_ is None or help_ in (found.help or "")


@pytest.mark.parametrize("line", ["R1 resistor(R = 1 ohm) a -> b", "resistor R1(R = 1 ohm) a -> b"])
def test_a_label_without_its_colon_stands_before_the_component_that_the_file_knows(line):
    found = only(f"from std.electrical import voltage,\n    resistor\nmodel m {{\n  {line}\n}}\n")
    assert found.help == "R1: resistor(R = 1 ohm) a -> b"


def test_messages_never_name_terminals_of_the_grammar():
    lines = [case[0] for case in CASES] + ["for i in 1 { }", "init x 3", "trace", "energy", "table f", "branch a,:"]
    for line in lines:
        for frame in ("model m {\n%s\n}", "scene s of m {\n%s\n}", "%s\n", "domain d {\n%s\n}", "bundle d {\n%s\n}"):
            for item in parse(SourceText("t", frame % line))[1]:
                said = item.message + (item.help or "")
                assert "<name>" not in said
                assert "<newline>" not in said
                assert "__" not in said
                assert "None" not in said


def test_model_statements_in_a_scene():
    for line in ("param k = 3", "energy V = 3 J", "for i in 1..2 { init x = 3 }", "every 2 ms { g := 1 }"):
        word = line.split()[0]
        found = only(f"scene s of m {{\n  time 0 s to 1 s\n  {line}\n  trace x\n}}\n")
        assert (found.code, *found.place.start) == ("E107", 3, 3)
        assert f"'{word}' belongs in a model or component, not in a scene" in found.message
    assert only("scene s of m {\n  level full { }\n  trace x\n}").code == "E107"
    assert only("param k = 3\n").code == "E107"


def test_three_errors_in_one_file_are_all_found():
    text = (
        "model a {\n  param x = 3kg\n  param y = 2 m\n  connect(a, b)\n  for i in 1..3 {\n    let u = = 3\n"
        "    let v = 2\n  }\n}\nscene s of a {\n  tine 0 s to 1 s\n  trace x\n}\n"
    )
    assert findings(text) == [("E114", 2, 13), ("E113", 4, 3), ("E113", 6, 13), ("E113", 11, 3)]
    tree = parse(SourceText("t", text))[0]
    model, scene = tree.items
    assert [type(item).__name__ for item in model.body] == [
        "ParamStatement",
        "ParamStatement",
        "BrokenStatement",
        "ForStatement",
    ]
    assert [type(item).__name__ for item in model.body[3].body] == ["BrokenStatement", "LetStatement"]
    assert [type(item).__name__ for item in scene.body] == ["BrokenStatement", "TraceStatement"]


def test_a_faulty_head_does_not_hide_its_block():
    text = "model a b {\n  param x = 3kg\n  for i in 1.n {\n    let y = 2 +* 3\n  }\n  level 3 { law e = == }\n}\n"
    assert [(code, line) for code, line, _ in findings(text)] == [
        ("E113", 1),
        ("E114", 2),
        ("E113", 3),
        ("E113", 4),
        ("E113", 6),
        ("E113", 6),
    ]
    model = parse(SourceText("t", text))[0].items[0]
    assert model.name.name == "a"
    assert isinstance(model.body[1], BrokenStatement)


def test_a_broken_statement_tells_its_names():
    broken = parse(SourceText("t", "model m {\n  param kk: 3 N/m # not this\n}"))[0].items[0].body[0]
    assert {"kk", "N"} <= broken.names
    assert "this" not in broken.names


def test_an_error_on_one_line_of_several_statements():
    assert findings("const a = = 1; const b = 2; const c = * 3\n") == [("E113", 1, 11), ("E113", 1, 39)]


def test_unclosed_braces_are_placed_by_indentation():
    text = "model m {\n  for i in 1..3 {\n    let a = 1\n  param b = 1\n}\n\nscene s of m {\n  trace x\n}\n"
    found = only(text)
    assert (found.code, *found.place.start) == ("E112", 2, 17)
    assert found.related[0].place.start == (4, 3)
    tree = parse(SourceText("t", text))[0]
    assert [type(item).__name__ for item in tree.items] == ["ModelDefinition", "SceneDefinition"]


def test_a_file_that_ends_too_early():
    assert findings("model m {\n  param a = 1\n") == [("E112", 1, 9)]
    assert findings("model m {\n  level a {\n    param b = 1\n") == [("E112", 1, 9), ("E112", 2, 11)]
    assert [code for code, _, _ in findings("model m {\n  param a = (1 +\n")] == ["E112", "E112"]
    assert findings("const a =") == [("E113", 1, 10)]


def test_a_brace_too_many():
    found = only("model m {\n  param a = 1\n}\n}\nconst b = 2\n")
    assert (found.code, *found.place.start) == ("E112", 4, 1)
    assert len(parse(SourceText("t", "model m { }\n}\nconst b = 2\n"))[0].items) == 2


def test_an_unclosed_bracket_loses_one_statement_only():
    text = "model m {\n  R: resistor(R = 1 ohm\n  C: capacitor(C = 1 uF) a -> b\n  param x = 3kg\n}\n"
    assert findings(text) == [("E112", 2, 14), ("E114", 4, 13)]
    assert [type(item).__name__ for item in parse(SourceText("t", text))[0].items[0].body] == [
        "BrokenStatement",
        "InstanceStatement",
        "ParamStatement",
    ]


def test_units_in_the_rows_of_a_table():
    found = only("table f(x: mm) -> N linear [ (0, 1), (1 mm, 2) ]\n")
    assert "head of the table" in found.help


def test_a_second_sign_is_no_comment():
    assert only("// a comment\nconst a = 1\n").help == "a comment begins with '#'"


def test_every_word_of_a_body_is_known_to_the_messages():
    tables = load_tables()
    sets = [line.split() for line in tables.lookaheads.split("\n")]
    bodies = {
        "item": complaints.ITEM_WORDS,
        "role": complaints.DOMAIN_WORDS,
        "statement": complaints.MODEL_WORDS,
        "scene_statement": complaints.SCENE_WORDS,
    }
    for row, goto in zip(tables.rows.split("\n"), tables.gotos.split("\n"), strict=True):
        for left, words in bodies.items():
            if f" {left}:" in f" {goto}":
                terminals = {word for entry in row.split() for word in sets[int(entry.split(":")[1])]}
                assert {terminal for terminal in terminals if terminal.isalpha()} == words


def codes_of(text):
    return [item.code for item in parse(SourceText("t", text))[1]]


@pytest.mark.parametrize(
    ("name", "text", "code"),
    [
        ("a line of 100000 (", "const a = " + "(" * 100_000, "E116"),
        ("100000 ( in lines", "const a = " + "(\n" * 100_000, "E117"),
        ("10 MB of (", "(" * 10_000_000, "E116"),
        ("more than 10 MB", "#\n" * 5_000_001, "E116"),
        ("100000 open blocks", "model m {\n" + "for i in 1..2 {\n" * 100_000, "E117"),
        ("200000 }", "}\n" * 200_000, "E112"),
        ("9000 signs", "const a = " + "-" * 9000 + "x", "E117"),
        ("4000 powers", "const a = " + "x^" * 4000 + "x", "E117"),
        ("500 conditionals", "const a = " + "if a then b else " * 500 + "x", "E117"),
        ("2000 not", "const a = " + "not " * 2000 + "x", "E117"),
        ("201 calls", "const a = " + "f(" * 201 + "x" + ")" * 201, "E117"),
        ("100000 terms", "const a = " + " +\n".join(["x"] * 100_000), "E118"),
        ("60000 factors", "const a = " + "*\n".join(["x"] * 60_000), "E118"),
        ("60000 items", "const a = [" + ",\n".join(["x"] * 60_000) + "]", "E118"),
        ("a million digits", "const a = " + "9" * 1_000_000, "E116"),
        ("9000 digits", "const a = " + "9" * 9000, "E114"),
        ("9000 digits of exponent", "const a = 1e" + "9" * 9000, "E114"),
        ("9000 digits of a unit", "const a = 1 m^" + "9" * 9000, "E113"),
        ("NUL", "\0\n" * 100_000, "E113"),
        ("one NUL", "const a = 1\0", "E113"),
        ("9000 dots", "const a = " + "." * 9000, "E113"),
        ("9000 quotes", "const a = " + '"' * 9000, "E113"),
    ],
)
@pytest.mark.one_in(30)
def test_extreme_texts_are_refused(name, text, code):
    assert code in codes_of(text), name


@pytest.mark.long
def test_long_but_right_texts_are_read():
    assert codes_of("const a = x" + "'" * 9000) == []
    assert codes_of("const a = 3" + " " * 9000 + "m") == []
    assert codes_of("const a = 1\n" * 20_000) == []


def test_errors_without_end_are_cut():
    found = parse(SourceText("t", "? ?\n" * 100_000))[1]
    assert len(found) == 101
    assert "rest of the file is not read" in found[-1].message


@pytest.mark.parametrize(
    ("line", "help_"),
    [
        ("R1 = resistor(R = 1 ohm) a -> b   # load", "R1: resistor(R = 1 ohm) a -> b"),
        ("resistor R1(R = 1 ohm) a -> b", "R1: resistor(R = 1 ohm) a -> b"),
        ("Resistor R1(R=1);", "R1: Resistor(R=1) a -> b"),
        ("R1: resistor(R = 1 ohm) a - > b", "a -> b: the arrow is one sign"),
        ("let u = if t > 1 s then 5 V", "if c then a else b"),
        ("let u = 5 V if t > 1 s else 0 V", "the condition of a choice comes first: if c then a else b"),
        ("for i = 1:3 { }", "for i in 1..n { ... }"),
        ("every 1 ms every 2 ms { }", "every 5 ms { y := x }"),
    ],
)
def test_what_other_languages_write_is_shown_as_it_is_written_here(line, help_):
    assert in_model(line).help == help_


def test_a_brace_belongs_on_the_line_above():
    found = parse(SourceText("t.sd", "model m\n{\n  param k = 3\n}\n"))[1]
    assert [(d.code, d.help) for d in found] == [("E109", "the '{' at the end of the line above")]


@pytest.mark.parametrize(
    ("written", "unit", "meant"),
    [
        ("9810 Pa/m/A[i]*q", "A", "9810 Pa/m / A[...]"),
        ("3 A[1]", "A", "3 * A[...]"),
        ("2.5 N.m[1]", "m", "2.5 N * m[...]"),
    ],
)
def test_an_array_that_is_read_as_a_unit_is_told(written, unit, meant):
    found = in_model(f"let x = {written}")
    assert (found.code, found.message) == ("E113", f"'{unit}' stands where a unit is read")
    assert found.help == f"the variable stands apart: {meant}"
