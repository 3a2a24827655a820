"""Runs in the core: equal to single runs within the accuracy, bit for bit the same in any order, honest where they
miss something.
"""

import json
from pathlib import Path

import h5py
import numpy as np
import pytest
from sysdyn.cli.main import run
from sysdyn.cli.run.many.reusable_model import Loaded
from sysdyn.cli.run.request.run_request import RunRequest
from sysdyn.cli.sweep.core_cases import Cases
from sysdyn.cli.sweep.one_run import Runner
from sysdyn.dsl.text.diagnostics import Report
from sysdyn.runtime.many.asked import NotApplicableError

MODELS = Path(__file__).parents[2] / "models"
SEEDS = {
    "pendulum": ("th_0", "l", "m"),
    "dc_motor": (),
    "lcr_nonlinear": (),
    "slider_crank": (),
    "ebers_moll": (),
    "co_circuit": (),
    "pi_controller": (),
    "knife_edge": (),
    "two_tank": (),
    "em_suspension": (),
    "thermal_two_node": (),
    "bead_rod": (),
    "diode_circuit": (),
}
"""Models of every method, linear and not, with and without constraints; what varies (else their first parameters)."""


def varied(loaded, names, runs, seed=0):
    prepared = loaded.first.prepared
    values = prepared.binding.values
    some = [p.name for p in prepared.network.parameters if not p.shape and not p.whole and values[p.name]]
    names = list(names or some[:3])
    random = np.random.default_rng(seed)
    return names, [{n: float(values[n] * (1.0 + 0.02 * random.standard_normal())) for n in names} for _ in range(runs)]


@pytest.mark.parametrize("name", SEEDS)
@pytest.mark.parametrize("keep", ["end", "traces"])
@pytest.mark.one_in(30)
def test_runs_in_the_core_are_single_runs(name, keep):
    """End values and extrema within the accuracy of 1e-4 that both promise, and equal in any order and company."""
    loaded = Loaded(RunRequest(str(MODELS / "seed" / f"{name}.sd"), accuracy=1e-4))
    names, cases = varied(loaded, SEEDS[name], 12)
    core = Cases(loaded, names, keep)
    block, left = core.run(range(12), cases)
    assert not left
    assert (block.estimate <= 1e-4).all()
    order = np.random.default_rng(1).permutation(12)
    again, _ = core.run(order.tolist(), [cases[k] for k in order])
    alone, _ = Cases(loaded, names, keep).run([7], [cases[7]])
    for field in ("end", "least", "most", "estimate", "steps", "traces"):
        assert np.array_equal(getattr(block, field)[order], getattr(again, field)), field
        assert np.array_equal(getattr(block, field)[7:8], getattr(alone, field)), field
    for k in (0, 7):
        trace = loaded.run(cases[k], Report()).outcome.traced
        for j, quantity in enumerate(block.names):
            values = np.asarray(trace[quantity])
            size = max(np.abs(values).max(), 1e-12)
            assert abs(block.end[k, j] - values[-1]) <= 2e-4 * size, quantity
            if keep == "traces" and block.traces.size:
                assert abs(block.most[k, j] - values.max()) <= 2e-4 * size, quantity
                assert abs(block.least[k, j] - values.min()) <= 2e-4 * size, quantity


@pytest.mark.parametrize("name", ["slider_crank", "solenoid", "two_link_arm", "lcr_nonlinear", "inverted_pendulum"])
@pytest.mark.long
def test_what_is_met_is_within_the_accuracy(name):
    """End values against runs at 1e-9, parameters spread by 10 %: within 1e-4 of the largest, all of them."""
    loaded = Loaded(RunRequest(str(MODELS / "seed" / f"{name}.sd"), accuracy=1e-4))
    names, cases = varied(loaded, (), 5, 3)
    nominal = loaded.first.prepared.binding.values
    cases = [{n: nominal[n] + 5.0 * (v - nominal[n]) for n, v in case.items()} for case in cases]
    block, _ = Cases(loaded, names, "end").run(range(5), cases)
    for row, k in enumerate(block.runs):
        trace = loaded.run(cases[k], Report(), accuracy=1e-9).outcome.traced
        for j, quantity in enumerate(block.names):
            values = np.asarray(trace[quantity])
            assert abs(block.end[row, j] - values[-1]) <= 1e-4 * max(np.abs(values).max(), 1e-12), (k, quantity)


@pytest.mark.long
def test_small_swings_meet_the_closed_form(tmp_path):
    """th(T) of a pendulum released at 1e-3 rad: th_0 cos(sqrt(g/l) T) to 1e-6; of amplitudes from 1e-3 to 1.5 rad the
    accuracy is kept though magnitudes differ by 1000 from the nominal run's.
    """
    loaded = Loaded(RunRequest(str(MODELS / "seed" / "pendulum.sd"), until="3"))
    core = Cases(loaded, ["th_0"], "end")
    amplitudes = [1e-3, 1e-2, 0.5, 1.5]
    block, left = core.run(range(4), [{"th_0": a} for a in amplitudes])
    assert not left
    q1 = block.end[:, block.names.index("q1")]
    assert q1[0] / 2.34 / 1e-3 == pytest.approx(np.cos(3.0 * np.sqrt(9.81 / 2.34)), abs=2e-4)
    for k, a in enumerate(amplitudes):
        trace = loaded.run({"th_0": a}, Report()).outcome.traced
        assert abs(q1[k] - np.asarray(trace["q1"])[-1]) <= 2e-4 * np.abs(np.asarray(trace["q1"])).max()


def test_what_is_another_structure_is_left_to_a_run_of_its_own():
    """No mass, a negative one, a rest without direction: no result in the core, and the others stand."""
    loaded = Loaded(RunRequest(str(MODELS / "seed" / "pendulum.sd")))
    cases = [{"m": 1.0, "th_0": 0.2}, {"m": 0.0, "th_0": 0.2}, {"m": -1.0, "th_0": 0.2}, {"m": 2.0, "th_0": 0.0}]
    block, left = Cases(loaded, ["m", "th_0"], "end").run(range(4), cases)
    assert left == [1, 2, 3]
    assert block.runs.tolist() == [0]
    kept = Runner(RunRequest(str(MODELS / "seed" / "pendulum.sd")))(3, cases[3])
    assert kept.met


@pytest.mark.parametrize(
    ("name", "parameter", "why"),
    [("bouncing_ball", "g", "events"), ("redundant_pendulum", "m", "minimum_norm")],
)
def test_why_not(name, parameter, why):
    loaded = Loaded(RunRequest(str(MODELS / "seed" / f"{name}.sd")))
    with pytest.raises(NotApplicableError, match=why):
        Cases(loaded, [parameter], "end")


def test_an_expectation_that_fails_is_named(tmp_path, monkeypatch, capsys):
    """Looked at in the core, told by a run on its own."""
    monkeypatch.chdir(tmp_path)
    text = (MODELS / "seed" / "pendulum.sd").read_text()
    text = text.replace("every 10 ms", "every 10 ms\n  expect always: q1 <= 0.5 m")
    Path("p.sd").write_text(text)
    code = run(["sweep", "p.sd", "--over", "th_0=0.1..0.3:8", "--jobs", "1", "--keep", "end", "--json"])
    found = json.loads(capsys.readouterr().out)["result"]
    assert code == 1
    assert found["in_core"] == 5
    assert [f["run"] for f in found["failed"]] == [5, 6, 7], "2.34 sin(0.2143) is 0.498"
    assert all("E909" in f["reason"] for f in found["failed"])


def test_results_are_equal_bit_for_bit_whoever_runs_them(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    file = str(MODELS / "seed" / "pendulum.sd")
    tables = []
    for jobs in ("1", "3"):
        arguments = ["--over", "th_0=0.05..0.5:120", "--over", "m=1,2", "--jobs", jobs, "--keep", "extrema"]
        assert run(["sweep", file, *arguments, "-o", f"{jobs}.h5", "--no-timings"]) == 0
        with h5py.File(f"{jobs}.h5") as found:
            tables.append({name: found[name][()] for name in found})
    assert tables[0].keys() == tables[1].keys()
    assert all(np.array_equal(tables[0][name], tables[1][name]) for name in tables[0])
    assert "min.q1" in tables[0]
    assert "trace.q1" not in tables[0]


@pytest.mark.long
def test_runs_in_the_core_pass_no_line_of_python_each(effort):
    """A period of the pendulum at 1e-4, end values: 10000 runs a second of a core (tests/bench/sweeps.py)."""
    loaded = Loaded(RunRequest(str(MODELS / "seed" / "pendulum.sd"), until="3.07"))
    core = Cases(loaded, ["th_0"], "end")
    cases = [{"th_0": float(a)} for a in np.linspace(0.05, 0.5, 500)]
    lines = [effort(lambda n=n: core.run(range(n), cases[:n]))[1] for n in (100, 100, 500)]
    assert lines[2] - lines[1] < 10 * 400
