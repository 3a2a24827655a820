"""A model that lost a statement to a mistake of syntax is judged for names and units, and for nothing else."""

import re

import pytest
from sysdyn import api
from sysdyn.cli.main import run

WHOLE = """const big = 2
component spring {
  param k = 3 N/m
  branch : translation
  law e = k*q
}
model drum {
  param J = 0.7 kg.m^2
  param c = 0.2 N.m.s/rad
  coord th: rotation = 0.3 rad
  coord s: translation = 0.1 m
  state w: rad = 0 rad
  implicit g: N ~ 0 N
  energy T* = 1/2*J*th'^2
  energy T* = 1/2*(2 kg)*s'^2
  content D = 1/2*c*th'^2
  work -g on s
  gamma stiff: g = (4 N/m)*s*big
  dynamic w' = th' - w/(3 s)
  phi tied: s - th*(0.2 m/rad) = 0.04 m
  init s' ~ 0 m/s
  K: spring(k = 5 N/m) on s
  expect static: dof == 1
}
scene turn of drum {
  set c = 0.1 N.m.s/rad
  time 0 s to 1 s
  trace th, w
}
"""
UNREADABLE = "-({})"


def check(tmp_path, capsys, text):
    """Exit code, codes of findings and standard error of `check`."""
    path = tmp_path / "model.sd"
    path.write_text(text)
    code = run(["check", str(path)])
    err = capsys.readouterr().err
    return code, re.findall(r"^(?:error|warning|note) ([EWN]\d+)", err, re.M), err


def test_the_whole_text_is_right(tmp_path, capsys):
    assert check(tmp_path, capsys, WHOLE)[:2] == (0, [])


LINES = [k for k, line in enumerate(WHOLE.split("\n")) if line.startswith("  ")]


@pytest.mark.parametrize("how", ["-({})", "{} )", "!! {}"])
@pytest.mark.parametrize("number", LINES)
def test_any_statement_may_be_lost(tmp_path, capsys, number, how):
    lines = WHOLE.split("\n")
    lines[number] = "  " + how.format(lines[number].strip())
    code, found, err = check(tmp_path, capsys, "\n".join(lines))
    assert code == 1, err
    assert all(re.fullmatch(r"E1\d\d", c) for c in found), err
    assert ": ok" not in err


def test_names_and_units_of_the_rest_are_still_judged(tmp_path, capsys):
    text = WHOLE.replace("  dynamic w'", "  -dynamic w'").replace("1/2*J*th'^2", "1/2*J*th'^2 + 1/2*J*th")
    code, found, err = check(tmp_path, capsys, text.replace("trace th, w", "trace th, ww, w"))
    assert code == 1
    assert [c for c in found if c not in ("E109", "E113")] == ["E203", "E905"], err


def test_a_lost_item_of_the_file_that_a_model_needs(tmp_path, capsys):
    code, found, err = check(tmp_path, capsys, WHOLE.replace("component spring {", "component spring spring {"))
    assert code == 1
    assert all(re.fullmatch(r"E1\d\d", c) for c in found), err
    text = WHOLE.replace("const big = 2", "const big = = 2")
    code, found, err = check(tmp_path, capsys, text)
    assert code == 1
    assert all(re.fullmatch(r"E1\d\d", c) for c in found), err
    assert ": ok" not in err


def test_a_lost_item_that_a_model_does_without(tmp_path, capsys):
    code, found, err = check(tmp_path, capsys, WHOLE + "const unused = = 2\n")
    assert code == 1
    assert found == ["E113"]
    assert "turn of drum: ok" in err


@pytest.mark.parametrize("slip", ["0.5zork", "0.5output", "10k"])
def test_a_law_whose_number_cannot_be_read_is_told_of_that_alone(slip):
    model = f"model m {{ state x: m = 1 m; dynamic x' = 1 m/s*({slip} + 1) }}"
    text = f"{model}\nscene s of m {{ time 0 s to 1 s; trace x }}"
    assert [d.code for d in api.check(text)] == ["E114"]


def test_a_reduction_that_there_is_not_is_told_of_that_alone():
    text = "model m { coord x[1..2]: translation; energy T* = pi(i in 1..2: 1/2*1 kg*x[i]'^2) }"
    assert [d.code for d in api.check(text) if d.severity == "error"] == ["E113"]


OSCILLATOR = "model p { param m = SIZE kg; coord x: translation = 1 m; energy T* = 1/2*m*x'^2; energy V = 2 N/m*x^2 }"


def test_a_number_beyond_the_largest_is_told_of_alone():
    assert [d.code for d in api.check(OSCILLATOR.replace("SIZE", "1e400"))] == ["E114"]


def test_equations_beyond_the_largest_number_are_named():
    (found,) = (d for d in api.check(OSCILLATOR.replace("SIZE", "1e-310")) if d.severity == "error")
    assert found.code == "E519"
    assert found.message.startswith("the equations are no numbers at the start")
