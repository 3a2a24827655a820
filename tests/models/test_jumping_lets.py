"""E520: what is differentiated by time must not jump; what has a kink may, and is right."""

import numpy as np
import pytest
from sysdyn import api

BASE = """\
HEAD
model m {
  param a = 0.1 m
  param v = 1 m/s
  coord x: translation = 0 m
  MORE
  let z = BASE
  energy T* = 1/2*(2 kg)*z'^2
  energy V = 1/2*(100 N/m)*x^2
  init x' = 1 m/s
}
scene s of m { time 0 s to 0.5 s; trace x every 10 ms; accuracy 1e-6 }
"""
JUMPS = {
    "text": ("x + (if t < 0.2 s then 0 m else a)", "", "at t = 0.2 s"),
    "input": ("x + u", "input u: m = a*step(t - 0.2 s)", "at t = 0.2 s"),
    "floor": ("x + a*floor(t/(0.3 s))", "", "at t = 0.3 s"),
    "sawtooth": ("x + a*frac(t/(0.3 s))", "", "at t = 0.3 s"),
    "hold": ("x + road(t)", "", "at t = 0.2 s"),
    "sign": ("x + a*sign(t - 0.2 s)", "", "at t = 0.2 s"),
    "position": ("x + (if x < 0.05 m then 0 m else a)", "", "where 'x < 0.05' changes"),
    "mixed": ("x + (if x < v*t/2 then 0 m else a)", "", "where "),
    "position's sign": ("x + a*sign(x - 0.05 m)", "", "where 'sign(x - 0.05)' changes"),
    "discrete": ("x + d", "discrete d = 0 m; when x > 0.05 m { d := a }", "when an event assigns 'd'"),
    "small": ("x + (if t < 0.2 s then 0 m else 1e-6*a)", "", "at t = 0.2 s"),
}
ROAD = "table road(t: s) -> m hold clamp [ (0, 0), (0.2, 0.1), (0.4, 0.3) ]"
MEETING = {
    "branches": "if t < 0.2 s then 0 m else v*(t - 0.2 s)",
    "abs": "v/2*(abs(t - 0.2 s) + (t - 0.2 s))",
    "max": "v*max(t - 0.2 s, 0 s)",
    "sign": "v/2*(sign(t - 0.2 s) + 1)*(t - 0.2 s)",
    "step": "v*step(t - 0.2 s)*(t - 0.2 s)",
    "floor": "v*0.2 s*(floor(t/(0.2 s)) + frac(t/(0.2 s)) - 1)*step(t - 0.2 s)",
}


def _run(folder, base, more="", head="", **options):
    text = BASE.replace("BASE", base).replace("MORE", more).replace("HEAD", head)
    (folder / "m.sd").write_text(text)
    return api.simulate(folder / "m.sd", output=folder / "m.h5", **options)


@pytest.mark.parametrize("case", JUMPS)
@pytest.mark.one_in(6)
def test_a_base_that_jumps_is_refused_with_where_and_what_to_write(tmp_path, case):
    base, more, where = JUMPS[case]
    with pytest.raises(api.ModelError) as refused:
        _run(tmp_path, base, more, ROAD if case == "hold" else "")
    (found,) = refused.value.diagnostics
    assert found.code == "E520"
    assert where in found.message
    assert found.place.source.text[found.place.span.start : found.place.span.end] == "z'"
    assert "ramp" in found.help


@pytest.mark.parametrize("case", MEETING)
@pytest.mark.long
def test_branches_that_meet_make_a_kink(tmp_path, case):
    """The base begins to move at v = 1 m/s: momentum stays, so x' falls by v; x = A sin(w t + phi)."""
    found = _run(tmp_path, "x + (" + MEETING[case] + ")")
    omega, t = np.sqrt(50.0), found.time - 0.2
    at, rate = np.sin(omega * 0.2) / omega, np.cos(omega * 0.2) - 1.0
    behind = at * np.cos(omega * t) + rate / omega * np.sin(omega * t)
    wanted = np.where(t <= 0.0, np.sin(omega * found.time) / omega, behind)
    assert np.abs(found["x"].values - wanted).max() < 1e-6 * 0.15


@pytest.mark.long
def test_what_jumps_behind_the_end_or_for_traces_alone_is_none(tmp_path):
    assert _run(tmp_path, "x + (if t < 0.7 s then 0 m else a)").final == 1
    with pytest.raises(api.ModelError, match="E520"):
        _run(tmp_path, "x + (if t < 0.7 s then 0 m else a)", until=1.0)
    text = BASE.replace("BASE", "x").replace("HEAD", "").replace("MORE", "let w = x + a*step(t - 0.2 s)")
    (tmp_path / "m.sd").write_text(text.replace("trace x", "trace w' as w, x' as v"))
    found = api.simulate(tmp_path / "m.sd", output=tmp_path / "m.h5")
    np.testing.assert_array_equal(found["w"].values, found["v"].values)


@pytest.mark.long
def test_a_damper_on_an_expression_that_jumps_is_refused_and_a_spring_is_not(tmp_path):
    text = """\
model m {
  coord x: translation = 0 m
  input u: m = if t < 0.2 s then 0 m else 0.1 m
  M: kinetic(p = 2 kg*f) x
  E: ELEMENT on x - u
  init x' = 0 m/s
}
scene s of m { time 0 s to 0.5 s; trace x, E.energy as E every 10 ms; accuracy 1e-6 }
"""
    (tmp_path / "m.sd").write_text(text.replace("ELEMENT", "dissipator(e = 20 N.s/m*f)"))
    with pytest.raises(api.ModelError, match="E520"):
        api.simulate(tmp_path / "m.sd", output=tmp_path / "m.h5")
    (tmp_path / "m.sd").write_text(text.replace("ELEMENT", "potential(e = 20 N/m*q)"))
    found = api.simulate(tmp_path / "m.sd", output=tmp_path / "m.h5")
    swing = np.cos(np.sqrt(10.0) * 0.3)
    assert found["x"].values[-1] == pytest.approx(0.1 * (1.0 - swing), abs=1e-7)
    assert found["E"].values[-1] == pytest.approx(0.1 * swing**2, abs=1e-7)


def test_elements_of_an_array_are_looked_at_each(tmp_path):
    text = """\
model m {
  param n = 200
  coord x[1..n]: translation = 0 m
  for i in 1..n { let z = x[i] + (if t < i*(1 s) then 0 m else JUMP)
    energy T* = 1/2*(2 kg)*z'^2
    energy V = 1/2*(100 N/m)*x[i]^2
    init x[i]' = 1 m/s }
}
scene s of m { time 0 s to 150.5 s; trace x[1] every 1 s }
"""
    (tmp_path / "m.sd").write_text(text.replace("JUMP", "(if i == 150 then 0.1 m else 0 m)"))
    with pytest.raises(api.ModelError, match=r"E520.*at t = 150 s"):
        api.simulate(tmp_path / "m.sd", output=tmp_path / "m.h5", until=150.5)
