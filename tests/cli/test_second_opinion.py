"""--accuracy-check: a second, independent run beside the one that is handed back."""

import json
from pathlib import Path

import numpy as np
import pytest
from sysdyn.cli.main import run
from sysdyn.runtime.accuracy import second_opinion
from sysdyn.runtime.trace.trace import Trace

SEED = Path(__file__).parents[2] / "models" / "seed"


def simulated(tmp_path, capsys, name, *options):
    trace = tmp_path / "t.h5"
    code = run(["simulate", str(SEED / f"{name}.sd"), "--scene", "reference", "-o", str(trace), "--json", *options])
    return code, json.loads(capsys.readouterr().out)["result"], trace


@pytest.mark.parametrize("name", ["pendulum", "lcr_nonlinear", "coulomb_slide"])
@pytest.mark.one_in(2)
def test_it_holds_what_the_run_promised(name, tmp_path, capsys):
    _, plain, _ = simulated(tmp_path, capsys, name, "--accuracy", "1e-5")
    code, checked, trace = simulated(tmp_path, capsys, name, "--accuracy", "1e-5", "--accuracy-check")
    assert code == 0
    assert plain["statistics"]["steps"] < checked["statistics"]["steps"]
    estimate = checked["statistics"]["error_estimate"]
    assert plain["statistics"]["error_estimate"] <= estimate <= 1e-5
    assert Trace.open(trace).attributes["method"] == plain["method"]
    assert [p.name for p in tmp_path.iterdir()] == ["t.h5"]


def test_a_second_run_that_disagrees_withdraws_the_verdict(tmp_path, capsys, monkeypatch):
    difference = second_opinion.difference

    def apart(coarse, fine, target):
        fine.values[:] += 1e-3 * fine.largest
        return difference(coarse, fine, target)

    monkeypatch.setattr(second_opinion, "difference", apart)
    code, checked, trace = simulated(tmp_path, capsys, "pendulum", "--accuracy", "1e-5", "--accuracy-check")
    assert code == 3
    assert Trace.open(trace).attributes["met"] == 0
    assert checked["statistics"]["error_estimate"] == pytest.approx(1e-3, rel=0.02)
    assert np.isfinite(Trace.open(trace)["q1"].values).all()


def test_it_needs_an_estimate(capsys):
    assert run(["simulate", str(SEED / "pendulum.sd"), "--rtol", "1e-5", "--accuracy-check"]) == 2
    assert "no estimate" in capsys.readouterr().err
