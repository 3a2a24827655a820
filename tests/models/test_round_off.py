"""A start is found whatever the last digits of its iterations are."""

from dataclasses import replace

import h5py
import numpy as np
import pytest
from model_runs import trace_of
from sysdyn.cli import main
from sysdyn.cli.run.request.run_request import RunRequest
from sysdyn.cli.run.running import run
from sysdyn.dsl.text.diagnostics import Report
from sysdyn.runtime.start import start
from test_seed import SEED, settings_of


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize(
    ("model", "formulation"),
    [("rack_pinion", "co_lagrangian"), ("lever", "co_hamiltonian"), ("ebers_moll", "lagrangian")],
)
@pytest.mark.one_in(6)
def test_last_digits_do_not_decide(tmp_path, monkeypatch, model, formulation, seed):
    random = np.random.default_rng(seed)
    exact = start.solve

    def shaken(problem, x, *most):
        found = exact(problem, x, *most)
        return replace(found, x=found.x * (1.0 + 2e-16 * random.standard_normal(found.x.size)))

    monkeypatch.setattr(start, "solve", shaken)
    report = Report()
    settings = tuple((name, repr(value)) for name, value in settings_of(model, seed % 3).items())
    request = RunRequest(
        str(SEED / f"{model}.sd"),
        scene="reference",
        formulation=formulation,
        accuracy=1e-3,
        settings=settings,
        until="0.01",
        output=str(tmp_path / "trace.h5"),
    )
    assert run(request, report) is not None, [d.message for d in report]


@pytest.mark.parametrize(("method", "index"), [("bdf", "auto"), ("radau", "auto"), ("dopri", "0")])
@pytest.mark.long
def test_a_tolerance_without_absolute_part_at_rest(tmp_path, method, index):
    """Forced oscillators from y = y' = 0: y'' = sin t - y, all relative tolerance; y = (sin t - t cos t)/2."""
    text = """model forced {
      coord y: translation
      energy T* = 1/2*1 kg*y'^2
      energy V = 1/2*1 N/m*y^2
      work 1 N*sin(1 rad/s*t) on y
    }
    scene s of forced {
      time 0 s to 6 s
      trace y every 0.1 s
    }
    """
    trace = trace_of(tmp_path, text, method=method, index=index, rtol=1e-7, atol=0.0)
    t, y = trace.time, trace["y"].values
    np.testing.assert_allclose(y, 0.5 * (np.sin(t) - t * np.cos(t)), rtol=0.0, atol=1e-6)


APART = """
model apart {{
  coord x: translation = {far} m
  coord y: translation = {far} m + 2 m
  energy T* = 1/2*3 kg*x'^2 + 1/2*2 kg*y'^2
  energy V = 1/2*50 N/m*(y - x - 1 m)^2
  init x' = 0 m/s
  init y' = 0 m/s
}}
scene go of apart {{ time 0 s to 3 s; accuracy 1e-6; trace y - x as apart, x every 0.5 s }}
"""


@pytest.mark.parametrize("formulation", ["lagrangian", "hamiltonian"])
@pytest.mark.long
def test_a_difference_of_large_numbers_says_how_well_it_is_known(tmp_path, capsys, formulation):
    path = tmp_path / "apart.sd"
    for far, said in (("7e12", True), ("7", False)):
        path.write_text(APART.format(far=far), encoding="utf-8")
        main.run(["simulate", str(path), "--formulation", formulation, "-o", str(tmp_path / "t.h5")])
        note = "note N922: apart is known to" in capsys.readouterr().err
        assert note == said
        with h5py.File(tmp_path / "t.h5") as trace:
            exact = 1.0 + np.cos(trace["time"][()] * np.sqrt(50.0 * (1 / 3 + 1 / 2)))
            error = abs(trace["apart"][()] - exact).max()
        assert (error > 1e-4) == said


PULSE = """\
model pulse {
  state a: 1 = 1
  state b: 1 = 0
  dynamic a' = -a*1 s^-1
  dynamic b' = (a - b)*1 s^-1
}
scene s of pulse {
  time 0 s to 100 s
  trace b every 10 s
}
"""


@pytest.mark.parametrize("method", ["bdf", "radau", "rosenbrock", "dopri"])
@pytest.mark.long
def test_what_passes_between_the_rows_is_the_size_that_errors_are_relative_to(tmp_path, method):
    """b = t exp(-t), 1/e at 1 s; 4.5e-4 in the first row behind the start."""
    path = tmp_path / "pulse.sd"
    path.write_text(PULSE, encoding="utf-8")
    main.run(["simulate", str(path), "--method", method, "-o", str(tmp_path / "t.h5")])
    with h5py.File(tmp_path / "t.h5") as trace:
        t, b = trace["time"][()], trace["b"]
        assert b.attrs["nominal"] == pytest.approx(np.exp(-1.0), rel=0.05)
        assert np.abs(b[()] - t * np.exp(-t)).max() < 1e-4 * b.attrs["nominal"]


def test_multipliers_between_the_rows_are_the_least_too(tmp_path):
    """Two rows that say the same share the force of the rod; unshared, the first held it all: twice the nominal."""
    text = (SEED / "redundant_pendulum.sd").read_text(encoding="utf-8")
    traced = "trace rod.multiplier as a, again.multiplier as b every 0.4 s"
    path = tmp_path / "two.sd"
    path.write_text(text.replace("trace q1, q2, th, om every 10 ms", traced), encoding="utf-8")
    main.run(["simulate", str(path), "-o", str(tmp_path / "t.h5")])
    with h5py.File(tmp_path / "t.h5") as trace:
        for name in ("a", "b"):
            assert trace[name].attrs["nominal"] == pytest.approx(np.abs(trace[name][()]).max(), rel=1e-3)
