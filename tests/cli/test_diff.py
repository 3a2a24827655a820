"""`sysdyn diff`: what it prints, writes and exits with."""

import re
from xml.etree import ElementTree

import h5py
import numpy as np
import pytest
from schema import NUMBER, conforms, envelope
from sysdyn.cli.main import run
from sysdyn.cli.page.junit import junit
from sysdyn.cli.page.unit_text import conversion
from texts import PENDULUM, process, run_json, write

DIFF = {"equal": bool, "worst": dict, "variables": list, "traces": list, "tolerance": dict}
VARIABLE = {
    "name": str,
    "status": str,
    "equal": bool,
    "ratio": (*NUMBER, type(None)),
    "time": (*NUMBER, type(None)),
    "unit": str,
    "note": str,
}


@pytest.fixture
def traces(tmp_path):
    """ref.h5, other.h5 of a pendulum 1 % longer."""
    model = write(tmp_path, PENDULUM)
    assert run(["simulate", "-q", model, "-o", "ref.h5"]) == 0
    assert run(["simulate", "-q", model, "-o", "other.h5", "--set", "l=2.36"]) == 0
    return tmp_path


@pytest.mark.long
def test_equal(traces, capsys):
    assert run(["diff", "ref.h5", "ref.h5"]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert lines[0].startswith("equal: 3 quantities; nearest to its limit")
    assert " ".join(lines[1].split()) == "quantity verdict times limit at [s] reference test limit unit"
    assert lines[-1].startswith("limit: 0 + 0.001 x nominal within 1e-09 s, 101 and 101 instants")


@pytest.mark.long
def test_the_first_line_names_the_worst(traces, capsys):
    assert run(["diff", "ref.h5", "other.h5"]) == 1
    lines = capsys.readouterr().out.splitlines()
    found = re.match(r"differs: (\S+) at ([\d.e-]+) s is ([\d.e+]+) times over the limit: .*, limit .*", lines[0])
    assert found
    assert float(found[3]) > 1.0
    assert lines[2].split()[:3] == [found[1], "differs", found[3]]
    assert len({line.index(word) for line, word in zip(lines[1:3], ("verdict", "differs"), strict=True)}) == 1


@pytest.mark.long
def test_json(traces, capsys):
    code, found = run_json(capsys, "diff", "ref.h5", "other.h5")
    assert code == 1
    envelope(found, "diff", DIFF)
    result = found["result"]
    conforms(result["worst"], {"variable": str, "time": NUMBER, "ratio": NUMBER})
    assert {v["name"] for v in result["variables"]} == {"x", "y", "speed"}
    for variable in result["variables"]:
        conforms(variable, VARIABLE)
    assert result["worst"]["variable"] == result["variables"][0]["name"]
    assert result["worst"]["ratio"] == max(v["ratio"] for v in result["variables"])
    code, found = run_json(capsys, "diff", "ref.h5", "other.h5", "--rtol", "0.5")
    assert (code, found["ok"], found["result"]["equal"]) == (0, True, True)


def test_no_limit_is_null_in_json(traces, capsys):
    with h5py.File("other.h5", "a") as file:
        file["x"][3] = np.nan
    code, found = run_json(capsys, "diff", "ref.h5", "other.h5")
    assert code == 1
    assert found["result"]["worst"] == {"variable": "x", "time": 0.03, "ratio": None, "status": "nonfinite"}


@pytest.mark.long
def test_quiet_says_no_more_than_the_reason(traces, capsys):
    assert run(["diff", "-q", "ref.h5", "ref.h5"]) == 0
    said = capsys.readouterr()
    assert (said.out, said.err) == ("", "")
    assert run(["diff", "-q", "ref.h5", "other.h5"]) == 1
    said = capsys.readouterr()
    assert said.out == ""
    assert said.err.startswith("sysdyn: differs: y at ")


def test_tolerances(traces):
    assert run(["diff", "-q", "ref.h5", "other.h5", "--rtol", "0.2"]) == 0
    assert run(["diff", "-q", "ref.h5", "other.h5", "--rtol", "0", "--atol", "1e9"]) == 0
    assert run(["diff", "-q", "ref.h5", "ref.h5", "--rtol", "0", "--tau", "0"]) == 0
    assert run(["diff", "-q", "ref.h5", "ref.h5", "--rtol", "0", "--tau", "1 ms"]) == 0


@pytest.mark.parametrize(
    "options",
    [
        ["--rtol", "-1"],
        ["--rtol", "nan"],
        ["--atol", "inf"],
        ["--tau", "-1"],
        ["--tau", "1 m"],
        ["--tau", "soon"],
        ["--junit", "-", "--json"],
        ["--junit", "-", "--html", "-"],
    ],
)
def test_wrong_usage(traces, options):
    assert run(["diff", "ref.h5", "other.h5", *options]) == 2


def test_both_from_standard_input_is_wrong(traces):
    assert run(["diff", "-", "-"]) == 2


@pytest.mark.long
def test_standard_input(traces):
    data = (traces / "other.h5").read_bytes()
    assert process("diff", "-q", "ref.h5", "-", text=False, input=data).returncode == 1
    assert process("diff", "-q", "-", "other.h5", text=False, input=data).returncode == 0
    assert process("diff", "-q", "-", "other.h5", text=False, input=data[:900]).returncode == 5


def test_unreadable_and_incomparable(traces, capsys):
    (traces / "text.h5").write_text("no trace")
    with h5py.File("empty.h5", "w"):
        pass
    for name, code, message in (
        ("missing.h5", 5, "missing.h5: No such file"),
        ("text.h5", 5, "text.h5: not readable as a trace"),
        (".", 5, "directory"),
        ("empty.h5", 3, "cannot be compared: empty.h5 has no data set 'time'"),
    ):
        assert run(["diff", "ref.h5", name]) == code
        said = capsys.readouterr()
        assert message in said.err
        assert said.out == ""
        assert run_json(capsys, "diff", name, "ref.h5")[0] == code


def test_nothing_in_common_cannot_be_compared(traces, capsys):
    with h5py.File("other.h5", "a") as file:
        for name in ("x", "y", "speed"):
            file.move(name, f"{name}_")
    assert run(["diff", "ref.h5", "other.h5"]) == 3
    assert "no quantity in common" in capsys.readouterr().err


def test_junit(traces):
    assert run(["diff", "-q", "ref.h5", "other.h5", "--junit", "out.xml"]) == 1
    root = ElementTree.parse("out.xml").getroot()
    (suite,) = root
    names = [case.get("name") for case in suite]
    assert set(names) == {"time (start)", "time (end)", "x", "y", "speed"}
    failed = [case.get("name") for case in suite if case.find("failure") is not None]
    assert len(failed) == int(suite.get("failures")) == int(root.get("failures")) >= 1
    assert run(["diff", "-q", "ref.h5", "other.h5", "--rtol", "1", "--junit", "out.xml"]) == 0
    assert ElementTree.parse("out.xml").getroot().get("failures") == "0"


def test_junit_of_hostile_names():
    text = junit([('a<b>&"\x00\ud800', 1.0, [("]]>\x1b", 'bad "<&>\x07')])])
    assert ElementTree.fromstring(text)[0][0].get("name").startswith("]]>")


def test_html(traces):
    assert run(["diff", "-q", "ref.h5", "other.h5", "--html", "out.html"]) == 1
    text = (traces / "out.html").read_text()
    assert text.startswith("<!doctype html>")
    assert not re.search(r"(src|href)=|url\(|@import|<script", text)
    pictures = re.findall(r"<svg.*?</svg>", text, re.DOTALL)
    assert pictures
    assert len(pictures) % 2 == 0
    for picture in pictures:
        ElementTree.fromstring(picture)
        assert "nan" not in picture
    assert run(["diff", "-q", "ref.h5", "ref.h5", "--html", "out.html"]) == 0
    assert "<svg" not in (traces / "out.html").read_text()


def test_html_of_holes_and_hostile_names(traces):
    with h5py.File("other.h5", "a") as file:
        file["x"][20:40] = np.nan
        file["y"][50] = np.inf
    for name in ("ref.h5", "other.h5"):
        with h5py.File(name, "a") as file:
            file.move("speed", "<script>&")
    assert run(["diff", "-q", "ref.h5", "other.h5", "--html", "out.html"]) == 1
    text = (traces / "out.html").read_text()
    assert "<script" not in text
    for picture in re.findall(r"<svg.*?</svg>", text, re.DOTALL):
        ElementTree.fromstring(picture)


@pytest.mark.parametrize(
    ("of", "to", "expected"),
    [
        ("m/s", "km/h", (3.6, 0.0)),
        ("(m/s)/s", "m/s^2", (1.0, 0.0)),
        ("m.s-1", "m/s", (1.0, 0.0)),
        ("kg m2 s-2", "J", (1.0, 0.0)),
        ("J/(m^2)", "kg/s**2", (1.0, 0.0)),
        ("degC", "K", (1.0, 273.15)),
        ("%", "1", (0.01, 0.0)),
        ("", "1", (1.0, 0.0)),
        ("EUR", "EUR", (1.0, 0.0)),
        ("EUR", "EUR/s", None),
        ("m", "s", None),
        ("][", "m", None),
        ("m^", "m", None),
        ("(m", "m", None),
        ("m**99999999", "m", None),
        ("m/0", "m", None),
        ("(" * 90, "m", None),
    ],
)
def test_units(of, to, expected):
    assert conversion(of, to) == (expected if expected is None else pytest.approx(expected))
