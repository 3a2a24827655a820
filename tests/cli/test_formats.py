"""`check --output-format`: the same findings in every form; folders and patterns as arguments."""

import json
import re
import xml.etree.ElementTree as ET
from urllib.parse import unquote

import pytest
from sysdyn.cli.main import run

WRONG = """model m {
  param a = b      # µ, 50 % and more
  coord x: translation = 1 m
  energy T* = 1/2*(1 kg)*x'^2
  energy V = 1/2*k*x^2,
}
"""
WARNED = """model w {
  coord x: translation = 1 m
  energy T* = 1/2*(1 kg)*x'^2
  work -(1 N)*sign(x') on x
}
"""
RIGHT = """model r {
  coord x: translation = 1 m
  energy T* = 1/2*(1 kg)*x'^2
}
"""
NAMES = ["models/a/wrong, 100%.sd", "models/b/warned.sd", "models/right.sd"]


@pytest.fixture
def project(tmp_path):
    for name, text in zip(NAMES, (WRONG, WARNED, RIGHT), strict=True):
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_text(text)
    (tmp_path / "models" / ".hidden").mkdir()
    (tmp_path / "models" / ".hidden" / "other.sd").write_text(WRONG)
    return tmp_path


def checked(capsys, *arguments):
    code = run(["check", *arguments])
    return code, capsys.readouterr()


@pytest.fixture
def found(project, capsys):
    """The findings as --json gives them."""
    code, said = checked(capsys, "models", "--json")
    assert code == 1
    return json.loads(said.out)["diagnostics"]


@pytest.mark.long
def test_a_folder_is_all_the_files_below_it(found, capsys):
    _, said = checked(capsys, "models", "--json")
    files = json.loads(said.out)["result"]["files"]
    assert [f["file"] for f in files] == NAMES
    assert {d["file"] for d in found} == set(NAMES[:2])
    assert {d["severity"] for d in found} == {"error", "warning"}


@pytest.mark.parametrize(
    ("arguments", "files"),
    [
        (["models/**/w*.sd"], NAMES[:2]),
        (["models/*.sd"], NAMES[2:]),
        (["models/b", "models/b/warned.sd"], NAMES[1:2]),
    ],
)
@pytest.mark.one_in(2)
def test_patterns_and_doubles(project, capsys, arguments, files):
    _, said = checked(capsys, *arguments, "--json")
    assert [f["file"] for f in json.loads(said.out)["result"]["files"]] == files


@pytest.mark.parametrize("argument", ["empty", "models/*.txt"])
def test_nothing_to_check_is_wrong_usage(project, capsys, argument):
    (project / "empty").mkdir()
    code, said = checked(capsys, argument)
    assert code == 2
    assert argument in said.err


def test_a_file_whose_name_looks_like_a_pattern(project, capsys):
    (project / "a[1].sd").write_text(RIGHT)
    assert checked(capsys, "a[1].sd")[0] == 0


def test_json_is_json(found, project, capsys):
    code, said = checked(capsys, "models", "--output-format", "json")
    assert code == 1
    assert json.loads(said.out)["diagnostics"] == found


@pytest.mark.long
def test_full_is_the_default(project, capsys):
    plain = checked(capsys, "models")
    assert checked(capsys, "models", "--output-format", "full") == plain
    assert plain[1].out == ""


@pytest.mark.long
def test_concise_is_one_line_a_finding(found, project, capsys):
    code, said = checked(capsys, "models", "--output-format", "concise")
    assert code == 1
    lines = said.out.splitlines()
    assert len(lines) == len(found)
    for line, d in zip(lines, found, strict=True):
        assert line.startswith(f"{d['file']}:{d['line']}:{d['column']}: {d['severity']} {d['code']}: {d['message']}")


def test_github_annotates_the_lines(found, project, capsys):
    _, said = checked(capsys, "models", "--output-format", "github")
    lines = said.out.splitlines()
    assert len(lines) == len(found)
    for line, d in zip(lines, found, strict=True):
        level, fields, text = re.fullmatch(r"::(error|warning|notice) ([^:]*)::(.*)", line).groups()
        assert level == d["severity"]
        values = dict(pair.split("=", 1) for pair in fields.split(","))
        assert unquote(values["file"]) == d["file"]
        assert (values["line"], values["title"]) == (str(d["line"]), d["code"])
        assert unquote(text).startswith(d["message"])
        assert int(values["endColumn"]) >= int(values["col"]) == d["column"]


def test_junit_fails_where_there_are_errors(found, project, capsys):
    _, said = checked(capsys, "models", "--output-format", "junit")
    root = ET.fromstring(said.out)
    suites = {suite.get("name"): suite for suite in root}
    assert list(suites) == NAMES
    errors = [d for d in found if d["severity"] == "error"]
    assert root.get("failures") == suites[NAMES[0]].get("failures") == str(len(errors))
    for failure, d in zip(root.iter("failure"), errors, strict=True):
        assert failure.get("message").endswith(f": {d['message']} ({d['help']})")
    assert all(s.get("failures") == "0" for n, s in suites.items() if n != NAMES[0])


def test_sarif_holds_the_same_places_and_the_pages_of_the_codes(found, project, capsys):
    _, said = checked(capsys, "models", "--output-format", "sarif")
    log = json.loads(said.out)
    assert log["version"] == "2.1.0"
    (ran,) = log["runs"]
    assert ran["columnKind"] == "unicodeCodePoints"
    assert ran["invocations"] == [{"executionSuccessful": True, "toolExecutionNotifications": []}]
    rules = ran["tool"]["driver"]["rules"]
    assert [r["id"] for r in rules] == sorted({d["code"] for d in found})
    for rule in rules:
        assert rule["shortDescription"]["text"].endswith(".")
        assert rule["defaultConfiguration"]["level"] in ("error", "warning", "note")
    for result, d in zip(ran["results"], found, strict=True):
        assert rules[result["ruleIndex"]]["id"] == result["ruleId"] == d["code"]
        assert result["level"] == d["severity"]
        assert result["message"]["text"].startswith(d["message"])
        (location,) = result["locations"]
        place = location["physicalLocation"]
        assert unquote(place["artifactLocation"]["uri"]) == d["file"]
        assert re.fullmatch(r"[\w/.%-]+", place["artifactLocation"]["uri"])
        region = place["region"]
        assert (region["startLine"], region["startColumn"]) == (d["line"], d["column"])
        assert (region["endLine"], region["endColumn"]) == (d["end_line"], d["end_column"])


@pytest.mark.parametrize("form", ["concise", "github", "junit", "sarif"])
@pytest.mark.one_in(2)
def test_a_file_that_cannot_be_read_is_in_every_form(project, capsys, form):
    code, said = checked(capsys, "models/right.sd", "nothing.sd", "--output-format", form)
    assert code == 5
    assert "nothing.sd" in said.out
    assert "sysdyn:" not in said.err


@pytest.mark.parametrize(("form", "empty"), [("concise", ""), ("github", "")])
def test_nothing_found_is_nothing_said(project, capsys, form, empty):
    code, said = checked(capsys, "models/right.sd", "--output-format", form, "--quiet")
    assert (code, said.out, said.err) == (0, empty, "")


def test_quiet_leaves_the_errors(project, capsys):
    code, said = checked(capsys, "models", "--output-format", "concise", "--quiet")
    assert code == 1
    assert all(" error " in line for line in said.out.splitlines())


def test_two_forms_are_wrong_usage(project, capsys):
    code, said = checked(capsys, "models", "--json", "--output-format", "sarif")
    assert code == 2
    assert json.loads(said.out)["exit"] == 2
