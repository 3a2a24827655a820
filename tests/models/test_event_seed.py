"""The book's event systems: references.json, and closed forms with other parameters, in both primal formulations."""

import math

import numpy as np
import pytest
from reduced import ROOT
from reference_values import load
from sysdyn.api import simulate

SEED = ROOT / "models" / "seed"
REFERENCES = load("references.json")
EVENTS = ("bouncing_ball", "coulomb_planar_stop", "coulomb_slide", "stick_slip_belt", "stiction_oscillator")
ASKED = 1e-9
STATES = 1e-9
"""Of each variable's largest magnitude."""
INSTANTS = 1e-10
"""s."""


def run(model, tmp_path, times, settings=(), formulation="lagrangian", **options):
    at = ",".join(map(repr, times))
    chosen = {name: repr(value) for name, value in dict(settings).items()}
    file, output = SEED / f"{model}.sd", tmp_path / "t.h5"
    more = {"accuracy": ASKED, "at": at, "set": chosen, "formulation": formulation, "output": output, **options}
    return simulate(file, scene="reference", **more)


def values(trace, name, times):
    return np.array([trace[name].values[int(np.argmin(np.abs(trace.time - t)))] for t in times])


def happened(trace, times):
    """The largest distance of an instant from the nearest event."""
    found = np.array([e.time for e in trace.events])
    return max(float(np.abs(found - t).min()) for t in times)


@pytest.mark.parametrize("formulation", ["lagrangian", "hamiltonian"])
@pytest.mark.parametrize("model", EVENTS)
@pytest.mark.long
def test_references(model, formulation, tmp_path):
    reference = REFERENCES[model]
    trace = run(model, tmp_path, reference["t"], formulation=formulation)
    for name in reference["variables"]:
        wanted = np.array(reference["values"][name])
        error = np.abs(values(trace, name, reference["t"]) - wanted).max()
        assert error < STATES * max(np.abs(wanted).max(), 1.0), name
    assert happened(trace, [float(t) for _, t in reference["events"]]) < INSTANTS


def bounce(t, h, v, g, e, least=0.0):
    """Height, speed and instants of the impacts of a ball up to t; rest below a speed of `least`."""
    now, instants = 0.0, []
    while True:
        fall = (v + math.sqrt(v * v + 2.0 * g * h)) / g
        if now + fall > t:
            s = t - now
            return h + v * s - 0.5 * g * s * s, v - g * s, instants
        now, h, v = now + fall, 0.0, -e * (v - g * fall)
        instants.append(now)
        if v <= least:
            return 0.0, 0.0, instants


@pytest.mark.parametrize(
    "changed", [{"e": 0.55, "h_0": 0.4}, {"g": 3.7, "v_0": -2.0, "M": 0.3}, {"e": 1.0, "h_0": 2.0}, {"e": 0.0}]
)
@pytest.mark.one_in(2)
def test_a_ball_with_other_parameters(changed, tmp_path):
    p = {"g": 9.81, "e": 0.8, "h_0": 1.0, "v_0": 0.0, **changed}
    times = [0.1, 0.7, 1.3, 2.4]
    trace = run("bouncing_ball", tmp_path, times, changed)
    wanted = [bounce(t, p["h_0"], p["v_0"], p["g"], p["e"]) for t in times]
    assert np.abs(values(trace, "h", times) - [w[0] for w in wanted]).max() < 1e-9
    assert np.abs(values(trace, "v", times) - [w[1] for w in wanted]).max() < 5e-9
    least = ASKED * math.sqrt(p["v_0"] ** 2 + 2.0 * p["g"] * p["h_0"])  # slower than that it is at rest
    assert happened(trace, bounce(times[-1], p["h_0"], p["v_0"], p["g"], p["e"], least)[2]) < INSTANTS


def test_a_ball_through_fifty_impacts_and_to_rest(tmp_path):
    """Through its Zeno time, e = 0.8: instants, speeds behind the impacts, and what the books say."""
    end = math.sqrt(2.0 / 9.81) * (1.0 + 0.8) / (1.0 - 0.8)
    trace = run("bouncing_ball", tmp_path, [end + 0.1], until=repr(end + 0.2))
    instants = bounce(end, 1.0, 0.0, 9.81, 0.8, 1e-5)[2]
    assert len(instants) >= 50
    assert happened(trace, instants) < INSTANTS
    assert sum(e.name.startswith("impact") for e in trace.events) >= 50
    assert [e.after for e in trace.events][-1] == "holds"
    assert np.abs(trace["h"].values[trace.time > end]).max() == pytest.approx(0.0, abs=1e-9)
    books = trace["audit.energy"].values
    assert np.abs(books - books[0]).max() < 1e-9 * 9.81


@pytest.mark.parametrize("method", ["bdf", "radau"])
@pytest.mark.one_in(2)
def test_a_ball_beyond_its_last_impact(method, tmp_path):
    end = math.sqrt(2.0 / 9.81) * (1.0 + 0.5) / (1.0 - 0.5)  # the sum of all flights
    trace = run("bouncing_ball", tmp_path, [1.1 * end], {"e": 0.5}, accuracy=1e-6, until=repr(1.5 * end), method=method)
    late = trace.time > end
    assert np.abs(trace["h"].values[late]).max() < 1e-9
    assert np.abs(trace["v"].values[late]).max() < 1e-9
    assert abs(trace.events[-1].time - end) < 1e-6
    assert trace.events[-1].after == "holds"
    assert len(trace.events) < 40


@pytest.mark.parametrize("rtol", [1e-2, 1e-4, 1e-6, 1e-8])
@pytest.mark.one_in(2)
def test_low_bounces_are_resolved_at_any_tolerance(rtol, tmp_path):
    """By the bdf, whose error test does not see them: each flight is e times as long as the one before it."""
    file, end = SEED / "bouncing_ball.sd", math.sqrt(2.0 / 9.81) * (1.0 + 0.8) / (1.0 - 0.8)
    trace = simulate(file, scene="reference", until=repr(end + 0.2), rtol=rtol, method="bdf", output=tmp_path / "t.h5")
    flights = np.diff([e.time for e in trace.events if e.name.startswith("impact")])
    assert len(flights) >= 50
    assert np.abs(flights[1:] / flights[:-1] - 0.8).max() < 5e-3
    assert trace.events[-1].after == "holds"
    assert trace.statistics["steps"] < 3000


@pytest.mark.parametrize("changed", [{"mu": 0.11, "v_0": -2.0}, {"M": 0.7, "g": 3.7, "x_0": 1.0}])
@pytest.mark.long
def test_a_slide_with_other_parameters(changed, tmp_path):
    p = {"M": 2.0, "mu": 0.3, "g": 9.81, "x_0": 0.0, "v_0": 3.0, **changed}
    a, times = p["mu"] * p["g"], [0.2, 0.6, 1.1, 1.9]
    stop = abs(p["v_0"]) / a
    trace = run("coulomb_slide", tmp_path, times, changed)
    s = np.minimum(times, stop)
    sign = math.copysign(1.0, p["v_0"])
    assert np.abs(values(trace, "v", times) - (p["v_0"] - sign * a * s)).max() < 1e-9
    assert np.abs(values(trace, "x", times) - (p["x_0"] + p["v_0"] * s - 0.5 * sign * a * s * s)).max() < 1e-9
    if stop < 2.0:
        assert happened(trace, [stop]) < INSTANTS


@pytest.mark.parametrize("changed", [{"k": 33.0, "muk": 0.07}, {"mus": 0.3, "x_0": -0.4, "M": 1.7}])
def test_stiction_with_other_parameters(changed, tmp_path):
    """Half swings about kx = -+muk M g, until one ends where the spring is weaker than mus M g."""
    p = {"M": 1.0, "k": 20.0, "muk": 0.1, "mus": 0.14, "g": 9.81, "x_0": 0.5, **changed}
    half, shift = math.pi * math.sqrt(p["M"] / p["k"]), p["muk"] * p["M"] * p["g"] / p["k"]
    x, turns = p["x_0"], 0
    while abs(x) * p["k"] > p["mus"] * p["M"] * p["g"]:
        x, turns = -x + 2.0 * shift * math.copysign(1.0, x), turns + 1
    end = half * (turns + 1)
    trace = run("stiction_oscillator", tmp_path, [end], changed, until=repr(end))
    assert abs(values(trace, "x", [end])[0] - x) < STATES
    assert happened(trace, [half * (k + 1) for k in range(turns)]) < INSTANTS
    assert abs(values(trace, "v", [end])[0]) < 1e-12


@pytest.mark.parametrize("changed", [{"vx_0": 0.7, "vy_0": 1.1}, {"mu": 0.2, "vx_0": 0.0, "vy_0": -1.0}])
def test_a_stop_in_the_plane_with_other_parameters(changed, tmp_path):
    p = {"mu": 0.3, "g": 9.81, "vx_0": 1.5, "vy_0": -2.0, **changed}
    speed = math.hypot(p["vx_0"], p["vy_0"])
    stop, times = speed / (p["mu"] * p["g"]), [0.1, 0.3, 1.4]
    trace = run("coulomb_planar_stop", tmp_path, times, changed)
    left = 1.0 - np.minimum(times, stop) / stop
    assert np.abs(values(trace, "vx", times) - p["vx_0"] * left).max() < 1e-9
    assert np.abs(values(trace, "y", times) - p["vy_0"] * stop / 2.0 * (1.0 - left**2)).max() < 1e-9
    assert happened(trace, [stop]) < INSTANTS
    before = int(np.searchsorted(trace.time, stop - 1e-6))  # the row at which it stops, where its flow has no direction
    for name, v in (("ex", p["vx_0"]), ("ey", p["vy_0"])):
        # of a speed of 1e-7 m/s, whose round-off turns it by 1e-8
        assert trace[name].values[before] == pytest.approx(p["mu"] * 2.0 * p["g"] * v / speed, rel=5e-8)
        assert trace[name].values[before + 1] == 0.0
