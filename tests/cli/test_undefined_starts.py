"""A function that is no number where a run would begin: the statement, the call and its argument are told."""

import pytest
from texts import run_json, write

MODEL = """model m {{
  param a = 0.5
  coord h: translation = -1 m
  energy T* = 1/2*(1 kg)*h'^2
  work -(1 N.s/m)*h' on h
  work {}*(1 N) on h
  init h' = 0 m/s
}}
scene s of m {{ time 0 s to 1 s; trace h }}
"""


@pytest.mark.parametrize(
    ("law", "argument"), [("sqrt(h/(1 m))", "-1"), ("ln(a + h/(1 m))", "-0.5"), ("acos(a - h/(1 m))", "1.5")]
)
@pytest.mark.parametrize("command", ["check", "simulate"])
@pytest.mark.one_in(5)
def test_the_function_is_named_where_it_stands(tmp_path, capsys, monkeypatch, command, law, argument):
    monkeypatch.chdir(tmp_path)
    code, found = run_json(capsys, command, str(write(tmp_path, MODEL.format(law))))
    assert code == 1
    (said,) = [d for d in found["diagnostics"] if d["severity"] == "error"]
    assert (said["code"], said["line"], said["column"]) == ("E519", 6, 3)
    assert said["message"] == f"at the start {law} is no number: its argument is {argument}, h = -1 m"


def test_a_lone_constraint_contradicts_nothing(tmp_path, capsys):
    """What cannot be met, or not from the guesses, is told alone."""
    text = "model m {\n  coord x, y: translation\n  energy T* = 1/2*(1 kg)*(x'^2 + y'^2)\n"
    path = write(tmp_path, text + "  phi rod: x^2 + y^2 = -4 m^2\n}\nscene s of m { time 0 s to 1 s; trace x }\n")
    code, found = run_json(capsys, "check", str(path))
    (said,) = [d for d in found["diagnostics"] if d["severity"] == "error"]
    assert (code, said["code"], said["line"]) == (1, "E510", 4)
    assert said["message"] == "no start was found near the guesses: 4 m^2 is left over in rod"
    assert "a guess, 0 where none is written" in said["help"]


def test_a_mass_of_zero_is_named_where_nothing_else_determines_a_motion(tmp_path, capsys):
    """It was the model's name, and "inertia ... is missing"."""
    text = MODEL.format("0").replace("(1 kg)", "m").replace("  param a", "  param m = 0 kg\n  param a")
    path = write(tmp_path, text.replace("  work -(1 N.s/m)*h' on h\n", ""))
    code, found = run_json(capsys, "check", str(path))
    (said,) = [d for d in found["diagnostics"] if d["severity"] == "error"]
    assert (code, said["code"], said["line"]) == (1, "E516", 2)
    assert said["message"].startswith("with m = 0 kg the equations do not determine 'h'")
