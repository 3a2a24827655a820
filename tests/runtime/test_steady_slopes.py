"""Slopes that are the same at every point are taken once, those that change are taken again."""

import json
import math

import pytest
from sysdyn.cli.main import run
from sysdyn.runtime.trace.trace import Trace

DISCHARGE = """model discharge {{
  param r = 2 ohm
  param c = 0.1 F
  coord x: electrical = 1 C
  energy V = 1/2*x^2/c
  content D = {content}
}}

scene s of discharge {{
  time 0 s to 1 s
  trace x
}}
"""


@pytest.mark.parametrize("method", ["bdf", "radau", "rosenbrock"])
@pytest.mark.parametrize(
    ("content", "end", "steady"),
    [
        ("1/2*r*x'^2", math.exp(-5.0), True),
        ("1/2*r*(1 + 3 Hz*t)*x'^2", 4.0 ** (-5.0 / 3.0), False),
        ("1/2*r*x'^2/(1 + x^2/(1 C)^2)", 1.0 / math.sqrt(2.0 * math.exp(10.0) - 1.0), False),
    ],
)
@pytest.mark.long
def test_only_slopes_that_change_are_taken_again(content, end, steady, method, tmp_path):
    (tmp_path / "d.sd").write_text(DISCHARGE.format(content=content))
    asked = ["simulate", str(tmp_path / "d.sd"), "--method", method, "--rtol", "1e-8", "-o", str(tmp_path / "d.h5")]
    assert run([*asked, "--quiet"]) == 0
    trace = Trace.open(tmp_path / "d.h5")
    assert trace["x"].values[-1] == pytest.approx(end, abs=5e-8)
    taken = json.loads(trace.attributes["statistics"])
    assert taken["factorisations"] >= 5
    assert taken["jacobian_evaluations"] <= 3 if steady else taken["jacobian_evaluations"] > 3
