"""Diagnostics as data, their JSON, and the registry of codes."""

from __future__ import annotations

import pickle
import re

import pytest
from sysdyn.api import check
from sysdyn.dsl.text.codes import codes, explain
from sysdyn.dsl.text.diagnostics import Diagnostic, ModelError, Related, Report
from sysdyn.dsl.text.source import SourceText

SOURCE = SourceText("m.sd", "first line\nsecond \U0001f600 line\n")


def test_json_is_the_object_of_the_contract():
    place = SOURCE.place(18, 21)
    related = (Related("declared here", SOURCE.place(0, 5)),)
    assert Diagnostic("W301", "said", place, "do this", related).to_json() == {
        "code": "W301",
        "severity": "warning",
        "message": "said",
        "help": "do this",
        "file": "m.sd",
        "line": 2,
        "column": 8,
        "end_line": 2,
        "end_column": 11,
        "related": [{"file": "m.sd", "line": 1, "column": 1, "message": "declared here"}],
    }
    nowhere = Diagnostic("E901", "no scene", None).to_json()
    assert nowhere["file"] is None
    assert nowhere["line"] is None
    assert nowhere["severity"] == "error"
    assert nowhere["related"] == []
    assert Diagnostic("N501", "said", place).severity == "note"


def test_a_report_is_sorted_and_holds_each_finding_once():
    other = SourceText("a.sd", "text")
    report = Report()
    report.error("E203", "late", SOURCE.place(5, 6))
    report.error("E203", "late", SOURCE.place(5, 6))
    report.error("E101", "other file", other.place(0, 1))
    report.error("W301", "early", SOURCE.place(1, 2))
    report.error("E101", "early", SOURCE.place(1, 2))
    report.error("E901", "nowhere", None)
    assert [(item.code, item.message) for item in report] == [
        ("E101", "early"),
        ("E203", "late"),
        ("W301", "early"),
        ("E101", "other file"),
        ("E901", "nowhere"),
    ]
    assert len(report) == 5
    assert report.failed
    with pytest.raises(ModelError) as caught:
        report.raise_if_failed()
    assert caught.value.diagnostics == report.diagnostics
    assert "E203: late" in str(caught.value)


def test_a_hidden_name_is_told_before_the_errors_that_follow_from_it():
    text = "model m { param p = 2 bar; node n: hydraulic; S: effort(e = p) n -> ground; param k = 1 m + 1 s }\n"
    assert [d.code for d in check(text)] == ["W101", "E208", "E203"]


def test_warnings_and_notes_do_not_fail():
    report = Report([Diagnostic("W301", "said", None), Diagnostic("N501", "said", None)])
    assert not report.failed
    report.raise_if_failed()


def test_an_error_crosses_processes():
    error = ModelError([Diagnostic("E101", "said", SOURCE.place(0, 5))])
    again = pickle.loads(pickle.dumps(error))
    assert again.diagnostics[0].place.start == (1, 1)


EXPECTED = """
E101-E119 N101 N102 W101 E201-E214 W201 E301-E325 W301 W302 E401-E409 E411-E415 N401 E501-E520 N501 E601-E608 E701-E705
W705 E801-E808 E901-E912 W909 E920 E921 W920 W921 E930-E934 E941 W941 N601-N604 N608-N609 N611 N905 N907 N922-N924 N941
"""


def expected():
    for item in EXPECTED.split():
        first, _, last = item.partition("-")
        for number in range(int(first[1:]), int((last or first)[1:]) + 1):
            yield f"{first[0]}{number}"


def test_every_code_of_the_language_has_a_page():
    assert set(codes()) == set(expected())
    for code, page in codes().items():
        assert re.fullmatch(r"[EWN]\d{3}", code)
        assert page.title.endswith(".")
        assert len(page.why) > 40
        assert page.bad != page.good or code == "N609"
        text = explain(code)
        assert text.startswith(f"{page.severity} {code}: {page.title}")
        assert max(map(len, text.split("\n"))) <= 110
        assert text.count("\n") < 100


def test_explain_takes_small_letters_and_refuses_what_is_none():
    assert explain("e503") == explain("E503")
    assert "Wrong:" in explain("E503")
    assert "Right:" in explain("E503")
    with pytest.raises(KeyError):
        explain("E999")


RECURSION = """model chain {
  param n = 4
  param a[1..n] = [1, 2, 3, 4]
  for i in 1..n { let s[i] = SUM }
  state z: 1 = 0
  dynamic z' = s[n]*(1 Hz)
}
"""


def test_a_recursion_along_an_array_is_told_with_the_sum_to_write():
    """It was circular, which it is not, and a state was to break it."""
    (found,) = [d for d in check(RECURSION.replace("SUM", "s[i-1] + a[i]")) if d.severity == "error"]
    assert (found.code, found.place.start[0]) == ("E105", 4)
    assert "elements of 's' are defined by elements of 's'" in found.message
    assert "sum(j in" in found.help
    assert not [d for d in check(RECURSION.replace("SUM", "sum(j in 1..i: a[j])")) if d.severity == "error"]
