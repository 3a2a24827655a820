"""Pulses in signals are found wherever they stand, and steps see them."""

import sys
from pathlib import Path

import numpy as np
import pytest
from sysdyn.cli.run.request import targets
from sysdyn.cli.run.request.run_request import RunRequest
from sysdyn.cli.run.running import ready
from sysdyn.compiler.binding.pulses import pulses
from sysdyn.dsl.model import expression as ex
from sysdyn.dsl.text.diagnostics import Report

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "bench"))
from pulses import SPAN, Shot, missed, shots

CARRIERS = {"": 1, " + 3 N*sin(40 rad/s*t)": 1, " + 3 N*sin(40 rad/s*t)*exp(-t/(3 s))": 1}


def found(tmp_path, signal, known=()):
    """Instants of a signal that pushes a mass; known: at which steps end anyhow."""
    path = tmp_path / "m.sd"
    path.write_text(Shot("gauss", 1.0, 1.0, 1.0, "auto").text.replace("set F = ", f"set F = {signal} + 0*"))
    report = Report()
    request = RunRequest(str(path))
    target = targets.one(targets.read(str(path), report), str(path), None, None, report)
    with ex.fresh():
        prepared = ready(request, target, report)
        assert prepared is not None, [d.message for d in report]
        return pulses(prepared.compiled.form, prepared.binding, 0.0, SPAN, prepared.network.tables, (), np.array(known))


@pytest.mark.parametrize("carrier", CARRIERS)
@pytest.mark.parametrize("width", [1e-2, 1e-4, 1e-7])
@pytest.mark.one_in(12)
def test_a_pulse_is_found_on_what_varies_by_itself(tmp_path, width, carrier):
    place = 7.2345678
    times = found(tmp_path, f"2 N*exp(-((t - {place} s)/({width * SPAN} s))^2){carrier}")
    inside = np.abs(times - place) < width * SPAN
    assert inside.any()
    assert times.size <= 5


@pytest.mark.parametrize(
    "signal", ["2 N*sin(3 rad/s*t)", "1 N*sin(40 rad/s*t)^3", "5 N*t/(1 s)*exp(-t/(2 s))", "1 N*tanh((t - 5 s)/(3 s))"]
)
@pytest.mark.long
def test_a_signal_that_steps_follow_has_none(tmp_path, signal):
    assert found(tmp_path, signal).size == 0


GATE = "2 N*(clip((mod(t, 2 s) - 1 s)/(10 ms), 0, 1) - clip((mod(t, 2 s) - 1.3 s)/(10 ms), 0, 1))"
CORNERS = [2 * k + at for k in range(5) for at in (1.0, 1.01, 1.3, 1.31, 2.0)]


@pytest.mark.long
def test_between_corners_that_are_known_a_gate_needs_none(tmp_path):
    assert found(tmp_path, GATE, CORNERS).size == 0
    assert found(tmp_path, GATE).size > 10
    narrow = "1 N*exp(-((t - 5.15 s)/(1 ms))^2)"
    times = found(tmp_path, f"{GATE} + {narrow}", CORNERS)
    assert (np.abs(times - 5.15) < 1e-3).any()


@pytest.mark.parametrize("shot", shots(8, seed=3), ids=lambda s: f"{s.shape}-{s.method}")
@pytest.mark.long
def test_no_pulse_is_missed_in_silence(tmp_path, shot):
    wrong, error = missed(shot, tmp_path)
    assert not wrong
    assert error < 1e-3
