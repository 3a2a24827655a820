"""Exponents of units: integers, decimals, fractions; what is beside them is a power or a division of the quantity."""

import re

import pytest
from sysdyn.api import check
from sysdyn.cli.main import run
from sysdyn.cli.page.unit_text import conversion
from sysdyn.dsl.format.format import format_text
from sysdyn.dsl.parser.parse import parse
from sysdyn.dsl.text.source import SourceText
from sysdyn.dsl.tree.sameness import same_tree

SHOWN = re.compile(r"  y +(.*)$", re.MULTILINE)


def shown(line, folder, capsys):
    """How `list` shows the parameter y."""
    path = folder / "m.sd"
    path.write_text(f"model m {{\n  {line}\n  coord x: translation = 1 m\n  energy T* = 1/2*(1 kg)*x'^2\n}}\n")
    assert run(["list", str(path)]) == 0, capsys.readouterr()
    return SHOWN.search(capsys.readouterr().out)[1]


@pytest.mark.parametrize(
    ("line", "wanted"),
    [
        ("param y = 2e8 N/m^1.5", "200000000 N/m^1.5"),
        ("param y = 2 s^-1.5", "2 s^-1.5"),
        ("param y = 3 V/Hz^1/2", "3 V/Hz^1/2"),
        ("param y = 3 N/m^3/2", "3 N/m^3/2"),
        ("param y = 4 mm^1/3/s", "4 mm^1/3/s"),
        ("param y: kg.m^1/2 = 3 kg.m^0.5", "3 kg.m^1/2"),
        ("param y: N/m^1.5 = 2 kN/m^1.5", "2000 N/m^1.5"),
        ("param y = sqrt(4 N/m)", "2 kg^0.5/s"),
        ("param y = (8 m)^(1/3)", "2 m^1/3"),
        # powers and divisions of quantities
        ("param y = (2 s)^(-1)", "0.5 1/s"),
        ("param y = 2 s ^(-1)", "0.5 1/s"),
        ("param y = 4 m^4/2", "2 m^4"),
        ("param y = 4 m^2/2", "2 m^2"),
        ("param y = 4 m^2/5", "0.8 m^2"),
        ("param y = 4 m^1/20", "0.2 m"),
        ("param y = 4 m^1/2.5", "1.6 m"),
    ],
)
def test_an_exponent_is_what_a_reader_takes_it_for(line, wanted, tmp_path, capsys):
    assert shown(line, tmp_path, capsys) == wanted


def test_a_shown_unit_is_one_of_the_language(tmp_path, capsys):
    """What `list` prints of a root is read as a declaration again."""
    for expression in ("sqrt(4 N/m)", "(8 m)^(1/3)", "(2 m)^(3/4)", "sqrt(9 V/Hz)"):
        unit = shown(f"param y = {expression}", tmp_path, capsys).split()[1]
        shown(f"param y: {unit} = {expression}", tmp_path, capsys)


@pytest.mark.parametrize("unit", ["N/m^1.5", "m^1/3/s", "V/Hz^1/2", "kg.m^2", "s^-1.5", "m^01"])
def test_the_formatter_keeps_a_unit(unit):
    text = f"model m {{\n  param a: {unit} = 3 {unit}\n  let b = (3 {unit})^(1/2) + 3 {unit} ^2\n}}\n"
    assert format_text(text) == text
    trees = [parse(SourceText("m.sd", t))[0] for t in (text, format_text(text))]
    assert same_tree(*trees)


def test_scales_of_fractional_powers():
    """1 mm^1.5 = 1e-4.5 m^1.5; traces in such units are compared."""
    assert conversion("mm^1.5", "m^1.5")[0] == pytest.approx(10.0**-4.5, rel=1e-15)
    assert conversion("mm^1/3", "m^1/3")[0] == pytest.approx(0.1, rel=1e-15)
    assert conversion("m^(1/2)", "m^0.5") == (1.0, 0.0)
    assert conversion("m^0.5", "m") is None


def test_a_law_with_a_fractional_unit():
    """Hertz: k h^1.5; another unit is an error at the energy."""
    text = (
        "model m {\n  param k = 2e8 N/m^1.5\n  coord h: translation = 1 m\n  energy T* = 1/2*(1 kg)*h'^2\n"
        "  energy V = 2/5*k*h^2*sqrt(h)\n  init h' = 0 m/s\n}\n"
    )
    assert [d.code for d in check(text) if d.severity == "error"] == []
    assert [d.code for d in check(text.replace("N/m^1.5", "N/m^2")) if d.severity == "error"] == ["E208"]


@pytest.mark.parametrize("line", ["param y = 2 s^(-1)", "param y = 3 kg.m^(2)", "param y = 3 N/m^(3/2)"])
def test_an_exponent_in_parentheses_is_mended(line, tmp_path, capsys):
    path = tmp_path / "m.sd"
    path.write_text(f"model m {{\n  {line}\n  coord x: translation = 1 m\n  energy T* = 1/2*(1 kg)*x'^2\n}}\n")
    assert run(["check", "--fix", str(path)]) == 0, capsys.readouterr()
    assert path.read_text().splitlines()[1] == "  " + line.replace("(3/2)", "1.5").replace("(", "").replace(")", "")


ROD = """model m {{
  param J = 1/12 kg.m^2   # a rod
  param rate = 1/5 s
  let twice = 2*J
  coord h: rotation = 1 rad
  energy T* = {0}
  work (2 N.m)*sin(rate*t) on h
}}
"""


@pytest.mark.parametrize("energy", ["1/2*J*h'^2", "1/2*twice*h'^2", "1/2*(1 kg.m^2)*h'^2 + J*h'^2"])
def test_a_number_over_a_quantity_is_told_at_the_parameter(energy):
    """`1/12 kg.m^2` is 1/(12 kg.m^2); `1/5 s` beside it, which is read as a rate, is as it is meant."""
    found = [(d.code, d.place.start[0], d.help) for d in check(ROD.format(energy)) if d.severity == "error"]
    assert found[0] == ("E207", 2, "'1/12 kg.m^2' divides by 12 kg.m^2; '(1/12)*1 kg.m^2' is that part of a unit")
    assert [(line, help_) for _, line, help_ in found[1:]] == [(6, "'J' is the cause, see there")]
    assert [
        d for d in check(ROD.format(energy.replace("J", "(1/J)").replace("twice", "(1/J)"))) if d.severity == "error"
    ] == []
