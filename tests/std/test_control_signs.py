"""Controllers with gains of both signs on plants of both signs: limits are left again, as SciPy and loops say."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from sysdyn.api import simulate

KP, KI, KD, TAU, TS = 2.0, 3.0, 0.4, 0.05, 0.02
LO, HI = -1.5, 1.0
"""Limits that the plant's step of 2 V reaches on both ways."""
PLANT = """from std.control import {kind}

model loop {{
  state x: V = 0 V
  input r: V = if t < 2 s then 0.8 V else (if t < 6 s then 2 V else -0.3 V)
  C: {kind}({gains}, lo = -1.5 A, hi = 1 A) r = r, y = x
  dynamic x' = (({sign}1 ohm)*C.u - x)/(0.5 s)
}}

scene run of loop {{
  time 0 s to 10 s
  trace x, C.u as u every 0.1 s
}}
"""


def reference(t):
    return 0.8 if t < 2.0 else (2.0 if t < 6.0 else -0.3)


def traced(kind, gains, sign, folder):
    path = folder / "loop.sd"
    path.write_text(PLANT.format(kind=kind, gains=gains, sign="-" if sign < 0 else ""))
    return simulate(path, scene="run", accuracy=1e-7, output=folder / "t.h5")


@pytest.mark.parametrize("sign", [1.0, -1.0])
@pytest.mark.parametrize("derivative", [0.0, KD])
@pytest.mark.long
def test_pid(sign, derivative, tmp_path):
    """Of a plant that falls where the output rises the gains are negative: the loop is the mirror of the other."""
    given = (sign * g for g in (KP, KI, derivative))
    gains = "kp = {} A/V, ki = {} A/V/s, kd = {} A.s/V, tau = 50 ms".format(*given)
    trace = traced("pid", gains, sign, tmp_path)

    def output(t, y):
        error = reference(t) - y[0]
        return error, sign * (KP * error + KI * y[1] + derivative * (error - y[2]) / TAU)

    def rates(t, y):
        error, raw = output(t, y)
        stopped = (raw > HI and sign * error > 0.0) or (raw < LO and sign * error < 0.0)
        return [(sign * np.clip(raw, LO, HI) - y[0]) / 0.5, 0.0 if stopped else error, (error - y[2]) / TAU]

    start, states = [0.0, 0.0, 0.0], []
    for begin, end in ((0.0, 2.0), (2.0, 6.0), (6.0, 10.0)):
        at = np.linspace(begin, end - 1e-9, 41)
        found = solve_ivp(rates, (begin, end - 1e-9), start, "RK45", at, max_step=2e-3, rtol=1e-9, atol=1e-12)
        states += list(zip(found.t, found.y[0], strict=True))
        start = found.y[:, -1]
    t, x = np.array(states).T
    got = np.interp(trace.time, t, x)
    sampled = np.isin(np.round(trace.time, 6), np.round(t, 6))
    assert np.abs(np.asarray(trace["x"]) - got)[sampled].max() < 2e-5
    assert abs(trace["x"].values[-1] - (-0.3)) < 1e-2  # it has left its limit again
    assert trace["u"].values.min() >= LO
    assert trace["u"].values.max() <= HI


@pytest.mark.parametrize("sign", [1.0, -1.0])
@pytest.mark.parametrize("kind", ["sampled_pi", "sampled_pid"])
@pytest.mark.long
def test_sampled(kind, sign, tmp_path):
    """A plain loop over samples; between them the plant is exact."""
    rate = "" if kind == "sampled_pi" else f", kd = {sign * 0.05} A.s/V"
    gains = f"kp = {sign * KP} A/V, ki = {sign * KI} A/V/s{rate}, Ts = 20 ms"
    trace = traced(kind, gains, sign, tmp_path)
    x, integral, last, wanted = 0.0, 0.0, None, {}
    for k in range(500):
        error = reference(k * TS + 1e-12) - x
        slope = 0.0 if last is None or not rate else (error - last) / TS
        u = np.clip(sign * (KP * error + 0.05 * slope) + integral, LO, HI)
        integral, last = np.clip(integral + sign * KI * TS * error, LO, HI), error
        wanted[k] = x
        x = sign * u + (x - sign * u) * np.exp(-TS / 0.5)
    compared = list(range(0, 500, 5))
    got = np.interp([k * TS for k in compared], trace.time, np.asarray(trace["x"]))
    assert np.abs(got - [wanted[k] for k in compared]).max() < 2e-6
    assert abs(trace["x"].values[-1] - (-0.3)) < 1e-2


@pytest.mark.parametrize(("lo", "hi"), [(-2.0, 3.0), (3.0, -2.0)])
@pytest.mark.long
def test_switches(lo, hi, tmp_path):
    """A relay and a hysteresis whose outputs rise or fall with the input sin t."""
    path = tmp_path / "s.sd"
    path.write_text(f"""from std.control import relay, hysteresis

model s {{
  input u: V = 1 V*sin(1 rad/s*t)
  R: relay(band = 0.5 V, lo = {lo} A, hi = {hi} A) u = u
  H: hysteresis(on_at = 0.5 V, off_at = -0.5 V, lo = {lo} A, hi = {hi} A) u = u
  state x: A.s = 0 A.s
  dynamic x' = R.y
}}

scene run of s {{
  time 0 s to 6 s
  trace R.y as r, H.y as h every 0.25 s
}}
""")
    trace = simulate(path, scene="run", output=tmp_path / "t.h5")
    for t, r, h in zip(trace.time, trace["r"].values, trace["h"].values, strict=True):
        if min(abs(abs(np.sin(t)) - 0.5), 1.0) > 1e-3:
            assert r == (hi if np.sin(t) > 0.5 else (lo if np.sin(t) < -0.5 else 0.0))
            assert h == (hi if np.pi / 6 < t < np.pi * 7 / 6 else lo), t
