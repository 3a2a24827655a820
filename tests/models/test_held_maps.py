"""Tables of two arguments that hold their values, against the motion that pieces of constant force give by hand."""

from bisect import bisect_right

import numpy as np
import pytest
from sysdyn import api
from sysdyn.cli.main import run

SPEEDS, TIMES = (0.0, 2.0, 5.0), (0.0, 1.0, 3.0)
FORCES = ((1.0, 2.0, 3.0), (10.0, 20.0, 30.0), (100.0, 200.0, 300.0))
ROWS = ", ".join(
    f"({v}, {s}, {f})" for v, row in zip(SPEEDS, FORCES, strict=True) for s, f in zip(TIMES, row, strict=True)
)
MODEL = f"""table gear(v: m/s, a: 1) -> N hold {{outside}} [ {ROWS} ]
model m {{{{
  coord x: translation = 0 m
  state z: 1 = {{z0}}
  energy T* = 1/2*(10 kg)*x'^2
  dynamic z' = 1/(1 s)
  work gear(x', z) on x
  init x' = 1.5 m/s
}}}}
scene s of m {{{{
  time 0 s to 10 s
  accuracy 1e-8
  trace x', gear(x', z) as force, z
}}}}
"""


def force(v, z):
    """The value of the last grid point at or before both, clamped."""
    return FORCES[max(bisect_right(SPEEDS, v) - 1, 0)][max(bisect_right(TIMES, z) - 1, 0)]


def speed(end, z0):
    """From one jump of the force to the next."""
    t, v = 0.0, 1.5
    while t < end - 1e-12:
        push = force(v + 1e-12, z0 + t + 1e-12)
        ends = [end, *(s - z0 for s in TIMES if s - z0 > t + 1e-12)]
        ends += [t + (s - v) * 10.0 / push for s in SPEEDS if s > v + 1e-12]
        v, t = v + push / 10.0 * (min(ends) - t), min(ends)
    return v


@pytest.mark.parametrize("outside", ["clamp", "extend"])
@pytest.mark.parametrize("backend", ["c", "numpy"])
def test_the_value_of_the_last_point_of_both_axes(outside, backend, tmp_path):
    path = tmp_path / "m.sd"
    path.write_text(MODEL.format(outside=outside, z0=-0.5))
    trace = api.load(path, backend=backend).run()
    assert trace["x'"][-1] == pytest.approx(speed(10.0, -0.5), rel=1e-8)
    t, v = trace.time, trace["x'"].values
    away = np.abs(t[:, None] - 0.5 - TIMES).min(axis=1) > 1e-6
    away &= np.abs(v[:, None] - SPEEDS).min(axis=1) > 1e-6
    assert away.sum() > 20
    assert list(trace["force"].values[away]) == [force(*pair) for pair in zip(v[away], t[away] - 0.5, strict=True)]


def test_a_map_that_stops_ends_the_run_where_an_argument_leaves_it(tmp_path, capsys):
    path, out = tmp_path / "m.sd", tmp_path / "t.h5"
    path.write_text(MODEL.format(outside="stop", z0=0.5))
    assert run(["simulate", str(path), "-o", str(out)]) == 3
    said = capsys.readouterr().err
    assert "error E932" in said
    assert "table gear along a left its range: it is z = 3" in said
    trace = api.Trace.open(out)
    assert trace.time[-1] == pytest.approx(2.5, abs=1e-9)
    assert trace["x'"][-1] == pytest.approx(speed(2.5, 0.5), rel=1e-6)
