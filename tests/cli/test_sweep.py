"""`sysdyn sweep`: cases, results against closed forms, kills, runs that kill their worker, the file."""

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import h5py
import numpy as np
import pytest
from sysdyn import api
from sysdyn.cli.failures import UsageError
from sysdyn.cli.main import run
from sysdyn.cli.run.request.run_request import RunRequest
from sysdyn.cli.sweep import workers
from sysdyn.cli.sweep.axes import Axis, axis
from sysdyn.cli.sweep.journal import SweepJournal
from sysdyn.cli.sweep.run_records import Kept
from sysdyn.cli.sweep.study import study
from texts import LADDER

SPRING = """
model spring {
  param m = 1 kg
  param k = 4 N/m
  coord x: translation = 1 m
  energy T* = 1/2*m*x'^2
  energy V = 1/2*k*x^2
  init x' = 0 m/s
}

scene s of spring {
  time 0 s to 2 s
  trace x, x' as v every 10 ms
  accuracy 1e-6
  expect always: x <= 1.1 m
}
"""


@pytest.fixture
def spring(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    Path("spring.sd").write_text(SPRING)
    return "spring.sd"


def swept(capsys, *arguments):
    code = run(["sweep", *arguments, "--json"])
    return code, json.loads(capsys.readouterr().out)


def plain(name, text):
    return float(text.split()[0])


# --- what varies ------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("text", "values"),
    [
        ("k=1 N/m, 2 N/m", (1.0, 2.0)),
        ("k = 1 .. 3 : 5", (1.0, 1.5, 2.0, 2.5, 3.0)),
        ("k = 1..100:3:log", (1.0, 10.0, 100.0)),
        ("formulation=lagrangian,hamiltonian", ("lagrangian", "hamiltonian")),
        ("level plant = fine, coarse", ("fine", "coarse")),
    ],
)
@pytest.mark.one_in(3)
def test_lists_and_grids(text, values):
    found = axis(text, plain).values
    assert found == pytest.approx(values) if isinstance(values[0], float) else found == values


@pytest.mark.parametrize(
    "text",
    ["k", "k=", "=3", "k=1,,2", "k=1..2", "k=1..2:0", "k=1..2:x", "k=-1..2:3:log", "k=1..2:3:cubic", "k~gauss(1, 2)",
     "k~normal(1)", "k~normal(1, -2)", "k~uniform(2, 1)", "k~lognormal(1, 0.5)", "k~loguniform(0, 2)"],
)  # fmt: skip
@pytest.mark.one_in(12)
def test_what_is_no_axis_is_wrong_usage(text):
    with pytest.raises(UsageError):
        axis(text, plain)


@pytest.mark.parametrize("sample", ["random", "latin", "sobol"])
@pytest.mark.one_in(2)
def test_samples_have_their_distributions(sample):
    """Moments within four standard errors of a random sample; a stratified one is far better."""
    drawn = [axis("a~normal(3, 0.5)", plain), axis("b~uniform(-1, 1)", plain), axis("c~lognormal(2, 1.5)", plain)]
    cases = list(study(drawn, sample, 1024, 7).cases())
    table = np.array([[case[name] for name in "abc"] for case in cases])
    table[:, 2] = np.log(table[:, 2] / 2.0)
    deviations = np.array([0.5, 1.0 / np.sqrt(3.0), np.log(1.5)])
    allowed = 4.0 * deviations / 32.0 * (1.0 if sample == "random" else 0.1)
    assert np.all(np.abs(table.mean(axis=0) - [3.0, 0.0, 0.0]) < allowed)
    assert table.std(axis=0) == pytest.approx(deviations, rel=0.1 if sample == "random" else 0.02)
    assert cases == list(study(drawn, sample, 1024, 7).cases()), "one seed, one sample"
    assert cases != list(study(drawn, sample, 1024, 8).cases())


def test_a_product_of_lists_and_drawn_points():
    found = study([axis("k=1,2", plain), axis("m~uniform(0, 1)", plain), axis("c=5,6,7", plain)], None, 4, 0)
    cases = list(found.cases())
    assert found.number == len(cases) == 24
    assert [c["k"] for c in cases] == [1.0] * 12 + [2.0] * 12
    assert len({c["m"] for c in cases}) == 4
    with pytest.raises(UsageError, match="twice"):
        study([axis("k=1", plain), axis("k=2", plain)], None, None, 0)
    with pytest.raises(UsageError, match="--runs"):
        study([axis("k~normal(1, 1)", plain)], None, None, 0)
    with pytest.raises(UsageError, match="nothing varies"):
        study([], None, None, 0)


# --- runs -------------------------------------------------------------------------------------------------------------


def test_every_run_meets_its_closed_form(spring, capsys):
    code, found = swept(capsys, spring, "--over", "k=1 N/m .. 9 N/m : 5", "--over", "m=1 kg, 2 kg", "--jobs", "2")
    assert code == 0, found["diagnostics"]
    assert found["result"]["runs"] == 10
    with h5py.File("spring-s-sweep.h5") as file:
        w = np.sqrt(file["set.k"][()] / file["set.m"][()])
        assert np.abs(file["end.x"][()] - np.cos(2.0 * w)).max() < 1e-6
        turned = 2.0 * w > 1.5 * np.pi
        assert np.abs(file["max.v"][()] - w)[turned].max() < 1e-3
        t = file["time"][()]
        assert np.abs(file["trace.x"][()] - np.cos(w[:, None] * t)).max() < 2e-6
        assert file["set.k"].attrs["units"] in (b"kg/s^2", "kg/s^2", "N/m", b"N/m", "kg s-2", b"kg s-2")
        assert file.attrs["final"] == 1
        assert (file["met"][()] == 1).all()
        assert (file["exit"][()] == 0).all()
    assert not list(Path().glob(".*")), "nothing is left beside it"


@pytest.mark.long
def test_it_opens_in_xarray(spring, capsys):
    xarray = pytest.importorskip("xarray")
    assert run(["sweep", spring, "--over", "k=1,4", "--jobs", "1", "-o", "runs.h5"]) == 0
    with xarray.open_dataset("runs.h5", engine="h5netcdf") as data:
        assert data["trace.x"].dims == ("run", "time")
        assert float(data["end.x"].isel(run=1)) == pytest.approx(np.cos(4.0), abs=1e-6)


def test_formulations_alone(spring, capsys):
    """What varies is no number: the command ended in a fault (a worker in a traceback)."""
    over = ["--over", "formulation=lagrangian,hamiltonian", "--jobs", "1"]
    assert run(["sweep", spring, *over, "-o", "alone.h5", "--json"]) == 0
    result = json.loads(capsys.readouterr().out)["result"]
    assert (result["runs"], result["failed"]) == (2, [])
    assert all(found["largest"] == pytest.approx(found["least"], rel=1e-3) for found in result["end"].values())


def test_formulations_inputs_and_what_fails(spring, capsys):
    """A run that cannot be made, and one whose expectation fails, are named and kept; the others stand."""
    over = ["--over", "formulation=lagrangian,hamiltonian", "--over", "k=4 N/m,-1 N/m"]
    code, found = swept(capsys, spring, *over, "--jobs", "1", "-o", "runs.h5")
    assert code == 1  # an energy that is no minimum is a motion all the same: x leaves 1.1 m
    assert {f["run"] for f in found["result"]["failed"]} == {1, 3}
    assert all("E909" in f["reason"] for f in found["result"]["failed"])
    with h5py.File("runs.h5") as file:
        assert file["set.formulation"][()].tolist() == [b"lagrangian"] * 2 + [b"hamiltonian"] * 2
        assert file["end.x"][1] == pytest.approx(np.cosh(2.0), rel=1e-6)
        assert file["end.x"][3] == pytest.approx(np.cosh(2.0), rel=1e-6)
    code, found = swept(capsys, spring, "--over", "m=1 kg,0 kg", "--jobs", "1", "-o", "zero.h5")
    assert code in (1, 3)
    assert [f["run"] for f in found["result"]["failed"]] == [1]
    code, found = swept(capsys, spring, "--over", "k=1,4", "--jobs", "1", "--max-steps", "3", "-o", "steps.h5")
    assert code == 3
    assert len(found["result"]["failed"]) == 2
    lines = Path(spring).read_text().splitlines()
    for item in (*found["diagnostics"], *(f["diagnostic"] for f in found["result"]["failed"])):
        assert item["code"] == "E934"
        assert item["file"] == spring
        assert lines[item["line"] - 1][item["column"] - 1 :].strip()


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["--over", "zz=1,2"], "zz"),
        (["--over", "k=1 kg"], "kg"),
        (["--over", "k~normal(1, 1)"], "--runs"),
        (["--over", "k=1,2", "--plot", "x.txt"], ".png"),
        (["--over", "k=1,2", "-o", "spring.sd"], "model"),
        ([], "nothing varies"),
    ],
)
@pytest.mark.one_in(5)
def test_wrong_usage_is_told_before_anything_runs(arguments, said, spring, capsys):
    code, found = swept(capsys, spring, *arguments)
    assert code in (1, 2)
    assert any(said in d["message"] for d in found["diagnostics"])
    assert not list(Path().glob("*.h5"))


def test_a_study_file(spring, capsys):
    Path("study.toml").write_text(
        '[study]\nfile = "spring.sd"\nsample = "sobol"\nruns = 64\nseed = 3\noutput = "mc.h5"\njobs = 2\n\n'
        '[over]\nk = "~ normal(4 N/m, 0.2 N/m)"\nm = ["1 kg", "2 kg"]\n'
    )
    code, found = swept(capsys, "study.toml", "--plot", "mc.png")
    assert code == 0, found["diagnostics"]
    assert found["result"]["runs"] == 128
    assert Path("mc.png").read_bytes().startswith(b"\x89PNG")
    with h5py.File("mc.h5") as file:
        w = np.sqrt(file["set.k"][()] / file["set.m"][()])
        assert np.abs(file["end.x"][()] - np.cos(2.0 * w)).max() < 1e-6
        assert len(set(file["set.k"][()])) == 64
    Path("study.toml").write_text('[study]\nfile = "spring.sd"\nrun = 3\n')
    code, found = swept(capsys, "study.toml")
    assert code == 2
    assert "'run'" in found["diagnostics"][0]["message"]


# --- what dies --------------------------------------------------------------------------------------------------------


def deadly(pipe, request, keep):
    """A worker that dies of run 3, always, and of run 5 the first time."""
    marker = Path(request.output)
    while True:
        try:
            tasks = pipe.recv().tasks
        except EOFError:
            return
        numbers = [number for number, _ in tasks]
        if 3 in numbers or (5 in numbers and not marker.exists()):
            if 5 in numbers:
                marker.touch()
            os.kill(os.getpid(), signal.SIGKILL)
        pipe.send(([Kept(number, 0, True) for number in numbers], []))


@pytest.mark.long
def test_a_run_that_kills_its_worker_is_named_and_nothing_else_is_lost(tmp_path):
    request = RunRequest("none.sd", output=str(tmp_path / "marker"))
    found = {k.run: k for k in workers.results(request, [(n, {}) for n in range(12)], 12, 2, "end", deadly)}
    assert sorted(found) == list(range(12))
    assert found[3].exit == 4
    assert "died 3 times (signal 9)" in found[3].reason
    assert all(k.exit == 0 for n, k in found.items() if n != 3)


def test_kill_9_loses_the_runs_under_way_alone(spring, capsys):
    """The whole family of processes is killed; the same command goes on."""
    arguments = ["sweep", spring, "--over", "k=1..9:200", "--jobs", "2", "-o", "runs.h5"]
    call = [sys.executable, "-m", "sysdyn.cli", *arguments]
    process = subprocess.Popen(call, start_new_session=True, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    journal = Path(".runs.h5.runs")
    limit = time.monotonic() + 60.0
    while not (journal.exists() and journal.read_text().count("\n") > 20):
        assert process.poll() is None
        assert time.monotonic() < limit
        time.sleep(0.02)
    os.killpg(process.pid, signal.SIGKILL)
    process.wait()
    kept = journal.read_text().count("\n") - 1
    code, found = swept(capsys, *arguments[1:])
    assert code == 0
    assert found["result"]["resumed"] >= kept > 0
    with h5py.File("runs.h5") as file:
        assert np.abs(file["end.x"][()] - np.cos(2.0 * np.sqrt(file["set.k"][()]))).max() < 1e-6
    assert not journal.exists()


def test_a_journal_of_another_study_is_not_taken(tmp_path):
    with SweepJournal(tmp_path / "a.h5", "one") as journal:
        journal.take(Kept(0, 0, True, end={"x": 1.0}))
    path = tmp_path / ".a.h5.runs"
    path.write_text(path.read_text() + '{"run": 1, "ex')  # cut short by a kill
    with SweepJournal(tmp_path / "a.h5", "one") as journal:
        assert journal.done.singles == {0: Kept(0, 0, True, end={"x": 1.0})}
    with pytest.raises(UsageError, match="another study"):
        SweepJournal(tmp_path / "a.h5", "two")


def test_names_that_are_texts_stay_texts():
    assert axis("file=a, b", lambda name, text: None) == Axis("file", ("a", "b"))


def test_a_text_that_ends_too_soon_says_so(spring, tmp_path, capsys):
    path = tmp_path / "cut.sd"
    text = Path(spring).read_text()
    path.write_text(text[: text.index("init") + 4])
    code, found = swept(capsys, str(path), "--over", "k=1,4", "--until", "1", "-o", "runs.h5")
    assert code == 1
    assert {d["code"] for d in found["diagnostics"]} >= {"E112"}
    with pytest.raises(api.ModelError, match="E112"):
        api.load(path)


@pytest.mark.long
def test_numbers_that_the_text_refuses_fail_alone(tmp_path, capsys, monkeypatch):
    """The first case among them: the others run, in the core and out of it."""
    monkeypatch.chdir(tmp_path)
    Path("m.sd").write_text(LADDER)
    for keep in ("end", "traces"):
        code = run(["sweep", "m.sd", "--over", "Rr=-1000,500,20000,2000", "--keep", keep, "--json", "-o", f"{keep}.h5"])
        found = json.loads(capsys.readouterr().out)["result"]
        assert code == 1
        assert [(f["run"], f["reason"][:4]) for f in found["failed"]] == [(0, "E322"), (2, "E322")]
    assert run(["sweep", "m.sd", "--over", "n=1,2,5", "--json", "-o", "n.h5"]) == 0
    found = json.loads(capsys.readouterr().out)["result"]["end"]["out"]
    assert found["largest"] == pytest.approx(1 - np.exp(-1), rel=1e-3)
    assert found["least"] == pytest.approx(0.00211787, rel=1e-3)
