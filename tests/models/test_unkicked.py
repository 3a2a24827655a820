"""Runs that stay at a rest which is not stable, because nothing is beside it: N924."""

import pytest
from model_runs import attempt

OSCILLATOR = """\
model oscillator {{
  coord x: translation = {0}
  energy T* = 1/2*(1 kg)*x'^2
  energy V = 1/2*(1 N/m)*x^2
  work (1 N.s/m)*x'*(1 - x^2/(1 m^2)) on x
  init x' = 0 m/s
}}

scene s of oscillator {{ time 0 s to {1}; trace x }}
"""
UPRIGHT = """\
model upright {
  coord th: rotation = 0 rad
  energy T* = 1/2*(1 kg.m^2)*th'^2/(1 rad^2)
  energy V = (4 J)*cos(th)
  init th' = 0 rad/s
}

scene s of upright { time 0 s to 100 s; trace th }
"""


def notes(tmp_path, text):
    ran, report = attempt(tmp_path, text)
    assert ran.exit == 0
    return [(d.message, d.help) for d in report if d.code == "N924"]


@pytest.mark.parametrize(
    ("text", "rate", "name"), [(OSCILLATOR.format("0 m", "1000 s"), 0.5, "x"), (UPRIGHT, 2.0, "th'")]
)
def test_nothing_kicks_it(tmp_path, text, rate, name):
    """The roots of s^2 - s + 1 = 0; of s^2 = 4."""
    ((message, help_),) = notes(tmp_path, text)
    assert message == (
        f"nothing moves: the run stays at a rest that is not stable, beside which {name} grows at {rate:.3g} 1/s"
    )
    assert help_.startswith(f"that is by e^{rate * (1000 if name == 'x' else 100):.3g} over the run")


@pytest.mark.parametrize(("begun", "end"), [("1 nm", "50 s"), ("0 m", "100 s")])
def test_what_is_kicked_or_short_is_not_noted(tmp_path, begun, end):
    """50 powers of e in 100 s."""
    assert notes(tmp_path, OSCILLATOR.format(begun, end)) == []


def test_a_stable_rest_is_not_noted(tmp_path):
    assert notes(tmp_path, UPRIGHT.replace("cos(th)", "(-cos(th))")) == []
