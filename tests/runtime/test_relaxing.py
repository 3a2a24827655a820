"""What can do nothing but relax is known as that, and met by two runs whose steps shrink together."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from sysdyn.api import simulate
from sysdyn.runtime.accuracy import by_steps, controlled
from sysdyn.runtime.accuracy.control import Achieved
from sysdyn.runtime.accuracy.pairs import Sampled
from sysdyn.runtime.model.failures import SolverFailure

FORMULATIONS = ("lagrangian", "hamiltonian", "co_lagrangian", "co_hamiltonian")
LINE = """from std.electrical import resistor, capacitor, inductor, voltage

model line {{
  param n = 24
  node v[0..n]: electrical
  source: voltage(v = {source}) v[0] -> ground
  for i in 1..n {{
    R[i]: resistor(R = 1 ohm / n) v[i - 1] -> v[i]
    {store}
  }}
  {more}
}}

scene s of line {{
  time 0 s to 1 s
  trace v[n/2].e as y{every}
}}
"""
SMOOTH, CAPACITORS = "1 V*sin(2*pi*2 Hz*t)", "C[i]: capacitor(C = 1 F / n) v[i] -> ground\n    init C[i].e = 0 V"
INDUCTORS = "L[i]: inductor(L = 1 H / n) v[i] -> ground\n    init L[i].f = 0 A"
GYRATOR = "g: gyrator(e1 = 1 ohm*f2) v[n] -> ground, v[n/2] -> ground"
COIL = "coil: inductor(L = 1 H) v[n] -> ground\n  init coil.f = 0 A"


def asked(folder: Path, *, store: str = CAPACITORS, source: str = SMOOTH, more: str = "", every: str = "") -> Path:
    path = folder / "line.sd"
    path.write_text(LINE.format(store=store, source=source, more=more, every=every))
    return path


def questions(monkeypatch) -> list[bool]:
    """What is answered to the question whether a model relaxes."""
    told: list[bool] = []
    ask = by_steps.relaxes
    monkeypatch.setattr(by_steps, "relaxes", lambda *about: told.append(ask(*about)) or told[-1])
    return told


@pytest.mark.one_in(4)
@pytest.mark.parametrize("formulation", FORMULATIONS)
@pytest.mark.parametrize(
    ("store", "more", "so"),
    [(CAPACITORS, "", True), (INDUCTORS, "", True), (CAPACITORS, GYRATOR, False), (CAPACITORS, COIL, False)],
)
def test_one_sort_of_store_and_no_gyrator_relax(formulation, store, more, so, tmp_path, monkeypatch):
    told = questions(monkeypatch)
    monkeypatch.setattr(by_steps, "SIMPLE", 0)
    path = asked(tmp_path, store=store, more=more)
    simulate(path, method="radau", formulation=formulation, accuracy=1e-3, output=tmp_path / "t.h5", unmet="warn")
    assert told == [so]


@pytest.mark.one_in(4)
@pytest.mark.parametrize("source", [SMOOTH, "1 V", "1 V*exp(-(t - 0.5 s)^2/(0.04 s)^2)"])
@pytest.mark.parametrize("accuracy", [1e-3, 1e-5, 1e-7])
def test_what_is_met_is_within_what_was_asked(accuracy, source, tmp_path):
    path = asked(tmp_path, source=source, every=" every 20 ms")
    run = simulate(path, method="radau", accuracy=accuracy, output=tmp_path / "t.h5")
    best = simulate(path, method="radau", rtol=1e-13, output=tmp_path / "b.h5")
    values = best["y"].values
    assert np.abs(run["y"].values - values).max() <= accuracy * np.abs(values).max()


def test_two_runs_do_and_the_second_has_less_than_three_times_the_steps(tmp_path, monkeypatch):
    runs: list[Sampled] = []
    found = by_steps.shortened

    def shortened(run, *more):
        def noted(*how):
            runs.append(run(*how))
            return runs[-1]

        return found(noted, *more)

    monkeypatch.setattr(by_steps, "shortened", shortened)
    simulate(asked(tmp_path), method="radau", accuracy=1e-3, output=tmp_path / "t.h5")
    assert len(runs) == 2
    assert runs[0].steps < runs[1].steps < 3 * runs[0].steps


def _run(error):
    """Runs whose only value is off by error(tolerance, longest)."""

    def run(tolerance, longest):
        values = np.array([[1.0], [0.5 + error(tolerance, longest)]])
        return Sampled(tolerance, values, np.array([1.0]), round(1.0 / longest))

    return run


def test_errors_that_fall_with_the_steps_are_credited():
    got = by_steps.shortened(_run(lambda tolerance, longest: 0.3 * longest**3), np.array([1e-3]), lambda *how: None)
    assert isinstance(got, Achieved)
    assert got.met
    assert got.runs == 2


def test_errors_that_do_not_fall_are_not_believed():
    by_chance = iter((0.1, -0.1, 0.1))
    got = by_steps.shortened(_run(lambda tolerance, longest: next(by_chance)), np.array([1e-3]), lambda *how: None)
    assert isinstance(got, Sampled)


@pytest.mark.parametrize("cause", ["max_steps", "newton"])
def test_where_too_much_happens_the_tolerance_leads(cause):
    def run(tolerance, longest):
        raise SolverFailure(cause, 0.0, 0.0)

    assert by_steps.shortened(run, np.array([1e-3]), lambda *how: None) is None


def test_the_control_goes_on_from_the_last_run(tmp_path, monkeypatch):
    begun = []
    control = controlled.control

    def noted(*about, **how):
        begun.append(how["draft"])
        return control(*about, **how)

    monkeypatch.setattr(controlled, "control", noted)
    monkeypatch.setattr(by_steps, "RELAXING", replace(by_steps.RELAXING, safety=1e9))
    run = simulate(asked(tmp_path), method="radau", accuracy=1e-4, output=tmp_path / "t.h5")
    assert len(begun) == 1
    assert isinstance(begun[0], Sampled)
    assert run.attributes["met"] == 1
