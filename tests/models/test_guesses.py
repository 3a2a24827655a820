"""A guess that is consistent comes back, on the root that it is on; every guess that moved is noted."""

import json
import math

import pytest
from sysdyn.cli.main import run

CRANK = """
model crank {{
  param r = 0.21 m
  param l = 0.64 m
  coord th: rotation ~ {angle!r} rad
  coord x: translation ~ {guess}
  energy T* = 1/2*(1.7 kg)*x'^2 + 1/2*(0.3 kg.m^2)*th'^2
  phi rod: (x - r*cos(th))^2 + (r*sin(th))^2 = l^2
  init th' = 0 rad/s
}}
scene turn of crank {{
  formulation {formulation}
  time 0 s to 0.01 s
  trace x, th
}}
"""
ROOT = "r*cos(th) {sign} sqrt(l^2 - (r*sin(th))^2)"


def started(tmp_path, capsys, text):
    """x and th at the start, and what `check` says has moved."""
    from sysdyn.runtime.trace.trace import Trace

    path = tmp_path / "model.sd"
    path.write_text(text)
    assert run(["check", "--json", str(path)]) == 0
    (file,) = json.loads(capsys.readouterr().out)["result"]["files"]
    (target,) = file["targets"]
    assert run(["simulate", str(path), "-q", "--backend", "numpy", "-o", str(tmp_path / "trace.h5")]) == 0
    trace = Trace.open(tmp_path / "trace.h5")
    return float(trace["x"][0]), float(trace["th"][0]), target["moved"]


@pytest.mark.parametrize("formulation", ["lagrangian", "hamiltonian"])
@pytest.mark.parametrize("sign", ["+", "-"])
@pytest.mark.parametrize("angle", [0.0, 0.6, 1.2, 2.0, 3.0, 4.4, -0.9])
def test_a_consistent_guess_comes_back(tmp_path, capsys, angle, sign, formulation):
    text = CRANK.format(angle=angle, guess=ROOT.format(sign=sign), formulation=formulation)
    x, th, moved = started(tmp_path, capsys, text)
    assert th == angle
    root = math.sqrt(0.64**2 - (0.21 * math.sin(angle)) ** 2)
    assert x == pytest.approx(0.21 * math.cos(angle) + (root if sign == "+" else -root), rel=1e-14)
    assert moved == []


def test_a_guess_by_an_expression_that_moved_is_noted(tmp_path, capsys):
    text = CRANK.format(angle=0.6, guess=ROOT.format(sign="-") + " - 0.02 m", formulation="lagrangian")
    x, th, moved = started(tmp_path, capsys, text)
    root = 0.21 * math.cos(th) - math.sqrt(0.64**2 - (0.21 * math.sin(th)) ** 2)
    assert x == pytest.approx(root, rel=1e-12)
    (line,) = [m for m in moved if m.startswith("x: ")]
    before, after = line.removeprefix("x: ").partition(",")[0].split(" -> ")
    assert float(after) == pytest.approx(x, rel=1e-5)
    assert float(before) == pytest.approx(x - 0.02, rel=1e-4)
    assert "phi rod" in line
