"""What a terminal shows of a diagnostic."""

from __future__ import annotations

import pytest
from sysdyn.dsl.text.diagnostics import Diagnostic, Related
from sysdyn.dsl.text.render import render
from sysdyn.dsl.text.source import SourceText


def shown(text, start, end, **more):
    source = SourceText("m.sd", text)
    return render(Diagnostic("E304", "said", source.place(start, end), **more)).split("\n")


def test_the_layout_of_the_reference():
    text = "\n" * 11 + "  L: kinetic(p = 1 mH/(1 + x.q/(1 mm))*f) c -> ground\n"
    start = text.index("p = ")
    source = SourceText("models/solenoid.sd", text)
    message = "kinetic law p(f, x) depends on displacement x"
    label = "the store does work along x"
    found = Diagnostic("E304", message, source.place(start, start + 28), "energy T* = ...", label=label)
    assert render(found) == (
        "error E304: kinetic law p(f, x) depends on displacement x\n"
        " --> models/solenoid.sd:12:14\n"
        "   |\n"
        "12 |   L: kinetic(p = 1 mH/(1 + x.q/(1 mm))*f) c -> ground\n"
        "   |              ^^^^^^^^^^^^^^^^^^^^^^^^^^^^ the store does work along x\n"
        "help: energy T* = ..."
    )


def test_a_second_place_is_a_second_snippet():
    source = SourceText("m.sd", "param a = 1\nparam a = 2\n")
    related = (Related("first declared here", source.place(6, 7)),)
    found = Diagnostic("E106", "'a' is declared twice", source.place(18, 19), related=related)
    assert render(found).split("\n") == [
        "error E106: 'a' is declared twice",
        " --> m.sd:2:7",
        "  |",
        "2 | param a = 2",
        "  |       ^",
        " --> m.sd:1:7",
        "  |",
        "1 | param a = 1",
        "  |       - first declared here",
    ]


def test_without_a_place():
    assert render(Diagnostic("E901", "no scene", None, "write one")) == "error E901: no scene\nhelp: write one"


@pytest.mark.parametrize(
    ("text", "start", "end", "line", "marks"),
    [
        ("\tab = c", 1, 3, "    ab = c", "    ^^"),
        ("a\tb c", 2, 3, "a   b c", "    ^"),
        ("\u65e5\u672c x", 3, 4, "\u65e5\u672c x", "     ^"),
        ("\u65e5\u672c x", 0, 2, "\u65e5\u672c x", "^^^^"),
        ("e\u0301 x", 3, 4, "e\u0301 x", "  ^"),
        ("a \x1b[31m b", 2, 3, "a \\x1b[31m b", "  ^^^^"),
        ("a \u202e b", 4, 5, "a \\u202e b", "         ^"),
        ("ab", 2, 2, "ab", "  ^"),
        ("", 0, 0, "", "^"),
    ],
)
def test_columns_are_those_of_the_terminal(text, start, end, line, marks):
    lines = shown(text, start, end)
    assert lines[3:5] == [f"1 | {line}".rstrip(), f"  | {marks}"]


def test_long_lines_are_clipped_around_the_span():
    text = "x" * 5000 + "HERE" + "y" * 5000
    lines = shown(text, 5000, 5004)
    assert max(map(len, lines)) < 120
    column = lines[4].index("^^^^")
    assert lines[3][column : column + 4] == "HERE"
    assert lines[3].count("...") == 2
    assert max(map(len, shown(text, 0, 10004))) < 120


def test_spans_over_several_lines_show_both_ends():
    text = "phi a: (x\n  + y\n  + z) = 3\n"
    lines = shown(text, 7, text.index(")") + 1)
    assert lines[3:] == ["1 | phi a: (x", "  |        ^^", "  ...", "3 |   + z) = 3", "  |   ^^^^"]
    two = shown("ab\ncd", 1, 4, label="both")
    assert two[3:] == ["1 | ab", "  |  ^", "2 | cd", "  | ^ both"]
    assert shown("ab\ncd", 1, 3)[3:] == ["1 | ab", "  |  ^"]


def test_nothing_of_a_text_reaches_the_terminal_raw():
    source = SourceText("\x1b]0;x\x07.sd", "param \x1b[2J = 1")
    related = (Related("\x1b[2J", source.place(0, 1)),)
    text = render(Diagnostic("E113", "'\x1b[2J'\n", source.place(6, 10), "\x9b2J", related))
    assert "\x1b" not in text
    assert "\x07" not in text
    assert "\x9b" not in text


def test_colours_only_when_asked():
    found = Diagnostic("W301", "said", SourceText("m.sd", "abc").place(0, 1), "help")
    assert "\x1b" not in render(found)
    coloured = render(found, color=True)
    assert "\x1b[1;33mwarning W301\x1b[0m" in coloured
    import re

    assert re.sub(r"\x1b\[[0-9;]*m", "", coloured) == render(found)
