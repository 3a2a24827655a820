"""Slips of which more than one thing may be meant, conditions in the wrong place: what is said, and that it works."""

import pytest
from sysdyn import api
from sysdyn.dsl.model.unit_habits import case_variants, correct_spelling

MODEL = """model m {{
  node x: translation = 0.1 m
  implicit T: K ~ 300 K
  M: kinetic(p = 1 kg*f) x
  S: potential(e = 10 N/m*q) x -> ground
  gamma level: T = 300 K + 1 K/m*x.q
  {}
}}
scene s of m {{
  time 0 s to 1 s
  trace x.q
  {}
}}
"""


def told(body="", scene=""):
    return [(d.code, d.message, d.help) for d in api.check(MODEL.format(body, scene)) if d.severity == "error"]


@pytest.mark.parametrize(
    ("wrong", "code", "help_", "right"),
    [
        ("param v = 30 pa", "E201", "write 'Pa' or 'pA'", "param v = 30 Pa"),
        ("param v = 1_000", "E114", "1000: digits stand together", "param v = 1000"),
        ("param v = 1.5d3", "E114", "1.5e3 for a power of ten, 1.5 d^3 for one of a unit", "param v = 1.5e3"),
        ("let v = exp(-300 K/T)", "E205", "'300 K / T' divides by the variable T", "let v = exp(-300 K / T)"),
        ("require x.q < 2 m", "E322", "expect always: x.q < 2 m", "expect always: x.q < 2 m"),
    ],
)
def test_what_may_be_meant_is_told(wrong, code, help_, right):
    found = told(wrong)
    assert found[0][0] == code
    assert help_ in found[0][2]
    assert not told(right)


def test_a_condition_on_what_moves_is_no_requirement():
    said = "require x.q < 2 m reads 'x.q', which is no parameter: it changes in a run"
    assert told("require x.q < 2 m")[0][1] == said


def test_a_claim_that_allows_less_than_nothing():
    assert told(scene="expect finally: x.q == 0 m within -1 m")[0][0] == "E912"
    assert not told(scene="expect finally: x.q == 0 m within 1 m")


def test_letters_in_the_wrong_case():
    assert case_variants("pa") == ["Pa", "pA"]
    assert correct_spelling("pa") is None
    meant = {"hz": "Hz", "RPM": "rpm", "KN": "kN", "Kg": "kg", "PA": "Pa", "kpa": "kPa"}
    assert {wrong: correct_spelling(wrong) for wrong in meant} == meant
    assert correct_spelling("mhz") is None


@pytest.mark.parametrize(
    ("right", "name"),
    [
        ("B: transformer(f1 = 2*f2) p = x, n = ground", "n"),
        ("P: resistor(R = 1 kohm, T = 3 K)", "T"),
        ("P: capacitor(V = 1 kohm, C = 1 uF)", "C"),
    ],
)
def test_a_comma_between_arguments_is_no_product_of_units(right, name):
    """`R = 1 kohm C = 1 uF`: the remedy had been '1 kohm.C'."""
    found = told(right.replace(f", {name} =", f" {name} ="))
    said = f"'{name} = ...' is an argument of its own: a comma stands before it"
    assert found[0] == ("E113", said, f", {name} = ...")
    assert said not in [message for _, message, _ in told(right)]
