"""`check --fix`: the remedies that leave no choice are written, nothing else is touched."""

import json

import pytest
from schema import CHECK, EDIT, conforms, envelope
from sysdyn.cli.main import run
from sysdyn.cli.run.check.mending import mend
from sysdyn.dsl.text import codes
from sysdyn.dsl.text.diagnostics import SourceText

WRONG = """# kept: 5 Nm, der(x), 0,15
model m {
  param M = 5 Nm
  param a = 9.81 m/s²
  param k := 0,15 N/m
  param d = 3 kN*s/m
  param J = 5kg
  let w = 2*PI*2 Hz
  coord x: translation = 1 m
  energy T* = 1/2*(1 kg)*x'**2
  work -d*der(x) on x
  node q: electrical
  R: dissipator(e = 1 Ohm*f) q -> gnd
  S: effort(e = 5 V) q -> 0
  phi stop: x == 1 m
}
"""
RIGHT = """# kept: 5 Nm, der(x), 0,15
model m {
  param M = 5 N.m
  param a = 9.81 m/s^2
  param k = 0.15 N/m
  param d = 3 kN.s/m
  param J = 5 kg
  let w = 2*pi*2 Hz
  coord x: translation = 1 m
  energy T* = 1/2*(1 kg)*x'^2
  work -d*x' on x
  node q: electrical
  R: dissipator(e = 1 ohm*f) q -> ground
  S: effort(e = 5 V) q -> ground
  phi stop: x = 1 m
}
"""


@pytest.mark.long
def test_habits_are_mended_and_shown(tmp_path, capsys):
    path = tmp_path / "m.sd"
    path.write_text(WRONG)
    assert run(["check", "--fix", "m.sd"]) == 0
    said = capsys.readouterr()
    assert path.read_text() == RIGHT
    assert said.out.startswith("--- m.sd\n+++ m.sd (fixed)\n")
    assert "-  param M = 5 Nm\n" in said.out
    assert "+  param M = 5 N.m\n" in said.out
    assert "m.sd: 13 of its findings mended" in said.err
    assert run(["check", "--fix", "m.sd"]) == 0
    assert capsys.readouterr().out == ""


def test_json_lists_what_was_mended(tmp_path, capsys):
    (tmp_path / "m.sd").write_text(WRONG)
    assert run(["check", "--fix", "--json", "m.sd"]) == 0
    (file,) = json.loads(capsys.readouterr().out)["result"]["files"]
    assert len(file["fixed"]) == 13
    assert {d["code"] for d in file["fixed"]} == {"E101", "E111", "E113", "E114", "E201"}


def test_what_has_a_choice_is_left(tmp_path, capsys):
    text = "model m {\n  param R = 10k\n  param k = 1,000 N/m\n  let y = 2x\n  let z = sni(1)\n  param g = 3 foo\n}\n"
    (tmp_path / "m.sd").write_text(text)
    assert run(["check", "--fix", "m.sd"]) == 1
    assert (tmp_path / "m.sd").read_text() == text
    assert capsys.readouterr().out == ""


def test_a_mended_unit_may_bring_another_finding_to_light():
    text, done = mend(SourceText("m.sd", "model m {\n  param k: N/m = 5 Nm\n}\n"))
    assert "5 N.m" in text
    assert [d.code for d in done] == ["E201"]


@pytest.mark.parametrize("code", sorted(codes.codes()))
@pytest.mark.one_in(77)
def test_mending_never_adds_findings(code):
    """Over all wrong examples: what is written raises no code that was not there, and right texts stay as they are."""
    page = codes.codes()[code]
    if len(page.bad) > 20_000:
        pytest.skip("a text at a limit")
    assert mend(SourceText("m.sd", page.good))[0] == page.good
    text, done = mend(SourceText("m.sd", page.bad))
    if done:
        assert mend(SourceText("m.sd", text))[0] == text
        assert code in {d.code for d in done}


def test_line_ends_and_files_that_are_right_are_kept(tmp_path):
    path = tmp_path / "m.sd"
    path.write_bytes(WRONG.replace("\n", "\r\n").encode())
    assert run(["check", "--fix", "-q", "m.sd"]) == 0
    assert path.read_bytes() == RIGHT.replace("\n", "\r\n").encode()
    before = path.stat().st_mtime_ns
    assert run(["check", "--fix", "-q", "m.sd"]) == 0
    assert path.stat().st_mtime_ns == before


def test_standard_input_is_no_file(capsys):
    assert run(["check", "--fix", "-"]) == 2
    assert "standard input" in capsys.readouterr().err


def test_sarif_carries_the_changes(tmp_path, capsys):
    (tmp_path / "m.sd").write_text("model m {\n  param M = 5 Nm\n}\n")
    assert run(["check", "m.sd", "--output-format", "sarif"]) == 1
    (result,) = json.loads(capsys.readouterr().out)["runs"][0]["results"]
    (fix,) = result["fixes"]
    (change,) = fix["artifactChanges"]
    (replacement,) = change["replacements"]
    assert replacement["insertedContent"]["text"] == "N.m"
    region = replacement["deletedRegion"]
    assert (region["startLine"], region["startColumn"], region["endColumn"]) == (2, 15, 17)


@pytest.mark.parametrize("line", ["param R = 10k", "phi stop: x == 1 m", "let y := x"])
@pytest.mark.one_in(2)
def test_a_model_with_a_slip_is_not_called_ok(tmp_path, capsys, line):
    text = f"model m {{\n  coord x: translation = 1 m\n  energy T* = 1/2*(1 kg)*x'^2\n  {line}\n}}\n"
    (tmp_path / "m.sd").write_text(text)
    assert run(["check", "m.sd"]) == 1
    assert ": ok" not in capsys.readouterr().err
    assert run(["check", "m.sd", "--json"]) == 1
    (file,) = json.loads(capsys.readouterr().out)["result"]["files"]
    assert [t["ok"] for t in file["targets"]] == [False]


def test_edits_of_json_mend_the_text(tmp_path, capsys):
    """A script that makes the edits of --json, round after round, writes what --fix writes."""
    path = tmp_path / "m.sd"
    path.write_text(WRONG)
    for _ in range(30):
        run(["check", str(path), "--json"])
        found = json.loads(capsys.readouterr().out)
        envelope(found, "check", CHECK)
        edits = found["result"]["edits"]
        for edit in edits:
            conforms(edit, EDIT)
            told = found["diagnostics"][edit["diagnostic"]]
            assert told["line"] == edit["line"]
            assert told["help"]
        if not edits:
            break
        lines = path.read_text().split("\n")
        edit = edits[0]
        assert edit["line"] == edit["end_line"]
        line = lines[edit["line"] - 1]
        lines[edit["line"] - 1] = line[: edit["column"] - 1] + edit["text"] + line[edit["end_column"] - 1 :]
        path.write_text("\n".join(lines))
    mine = path.read_text()
    path.write_text(WRONG)
    run(["check", str(path), "--fix", "--quiet"])
    assert mine == path.read_text()
