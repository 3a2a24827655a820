"""Slips of the pen, one at a time: the right line first, the author's object, reason and remedy; nothing else."""

import json
from collections import Counter

import pytest
from bases import BASES
from failures import STOPS
from scoring import answer
from slips import SLIPS
from sysdyn.api import check
from sysdyn.cli.main import run


@pytest.mark.parametrize("slip", SLIPS, ids=[f"{s.kind}: {s.new.strip()[:40]!r}" for s in SLIPS])
@pytest.mark.one_in(77)
def test_a_slip_is_told_once_and_well(slip):
    found = answer(slip)
    assert (found.points, found.wrong) == (3, ()), [(d.code, d.message, d.help) for d in found.findings]


@pytest.mark.parametrize("name", BASES)
@pytest.mark.one_in(12)
def test_a_right_model_has_no_finding(name):
    assert [d for d in check(BASES[name]) if d.severity != "note"] == []


def test_every_class_has_slips():
    counted = Counter(s.kind for s in SLIPS)
    assert sum(counted.values()) >= 120
    for kind in ("misspelt", "units", "habits", "domains", "references", "redundancy", "starts", "values", "loops"):
        assert counted[kind] >= 4, kind
    assert len({(s.base, s.old, s.new) for s in SLIPS}) == len(SLIPS)


@pytest.mark.parametrize("name", STOPS)
@pytest.mark.one_in(5)
def test_a_run_that_stops_speaks_the_same_language(name, tmp_path, capsys):
    """One error with its code, at the author's line, the function or cause with its value, and the last good state."""
    stop = STOPS[name]
    path = tmp_path / "m.sd"
    path.write_text(stop.text)
    assert run(["check", str(path), "--quiet"]) == 0, capsys.readouterr().err
    assert run(["simulate", str(path), "-o", str(tmp_path / "t.h5"), "--json"]) == 3
    (found,) = [d for d in json.loads(capsys.readouterr().out)["diagnostics"] if d["severity"] == "error"]
    assert found["code"] == stop.code
    assert found["file"] == str(path)
    assert stop.mark in stop.text.split("\n")[found["line"] - 1]
    assert all(said in found["message"] for said in stop.said), found["message"]
    assert stop.remedy in found["help"], found["help"]
    assert stop.code == "E934" or "last good state at" in found["help"]


FLOATING = """from std.electrical import resistor, voltage

model m {
  node a, b, c: electrical
  V: voltage(v = 5 V*sin(2*pi*50 Hz*t)) a -> b
  R1: resistor(R = 1 kohm) a -> c
  R2: resistor(R = 1 kohm) c -> b
}

scene s of m {
  time 0 s to 20 ms
  trace a.e - b.e as u, R1.f, (c.e - b.e)^2 as square
}
"""


@pytest.mark.parametrize("read", ["a.e", "a.e - 0.5*b.e", "abs(c.e)", "a.e + b.e - c.e"])
@pytest.mark.long
def test_an_effort_without_reference_is_noted(read):
    """Where one effort is read by itself; never where differences are, nor once the network is grounded."""
    text = FLOATING.replace("R1.f,", f"R1.f, {read} as read,")
    (note,) = [d for d in check(text) if d.code == "N611"]
    assert text.split("\n")[note.place.start[0] - 1].strip().startswith("trace")
    assert "no reference" in note.message
    assert [d for d in check(FLOATING) if d.code == "N611"] == []
    assert [d for d in check(text.replace("c -> b", "c -> ground")) if d.code == "N611"] == []
