"""Locks: `trade --lock` writes a scene's choice, `simulate` and the API take what is not said elsewhere."""

import tomllib
from pathlib import Path

import pytest
from sysdyn import api
from sysdyn.cli.main import run
from sysdyn.runtime.trace.trace import Trace
from texts import PENDULUM, run_json, write


def locked(folder, text=PENDULUM, change=lambda lock: lock):
    """The model and a lock as trade writes it, its setting one that no default takes."""
    file = write(folder, text)
    setting = ["--formulation", "hamiltonian", "--index", "1", "--method", "bdf"]
    assert run(["trade", file, "--lock", "--quiet", *setting]) == 0
    path = Path(f"{file}.lock")
    path.write_text(change(path.read_text()))
    return file


def ran(*arguments, code=0):
    assert run(["simulate", *arguments, "-o", "out.h5"]) == code
    a = Trace.open("out.h5").attributes
    return a["formulation"], a["index"], a["method"], a.get("lock", "")


def test_a_lock_is_written_and_honoured(tmp_path, capsys):
    file = locked(tmp_path)
    held = tomllib.loads(Path(f"{file}.lock").read_text())
    assert list(held) == ["version", "sysdyn", "files", "scene"]
    assert list(held["files"]) == ["model.sd"]
    said = held["scene"]["swing"]
    assert (said["formulation"], said["index"], said["method"]) == ("hamiltonian", "1", "bdf")
    assert said["accuracy"] == 1e-4
    *how, text = ran(file)
    assert how == ["hamiltonian", "1", "bdf"]
    assert text == f"formulation hamiltonian, index 1, method bdf, tolerance {said['tolerance']:g}"
    trace = Trace.open("out.h5")
    assert float(trace.attributes["rtol"]) <= said["tolerance"]
    assert trace.attributes["met"] == 1
    assert "accuracy" in trace.attributes["judged"]
    capsys.readouterr()


@pytest.mark.long
def test_the_api_honours_it(tmp_path):
    file = locked(tmp_path)
    assert api.simulate(file, output="one.h5").attributes["method"] == "bdf"
    assert "lock" not in api.simulate(file, no_lock=True, output="two.h5").attributes


@pytest.mark.parametrize(
    ("arguments", "how", "part"),
    [
        (["--no-lock"], ("lagrangian", "0", "dopri"), ""),
        (["--method", "radau"], ("hamiltonian", "2", "radau"), "formulation hamiltonian"),
        (["--index", "3"], ("hamiltonian", "3", "radau"), "formulation hamiltonian"),
        (["--formulation", "lagrangian"], ("lagrangian", "0", "dopri"), ""),
        (["--formulation", "hamiltonian"], ("hamiltonian", "1", "bdf"), "index 1, method bdf, tolerance"),
        (["--accuracy", "1e-5"], ("hamiltonian", "1", "bdf"), "formulation hamiltonian"),
    ],
)
@pytest.mark.one_in(5)
def test_the_command_line_wins(tmp_path, arguments, how, part):
    *found, text = ran(locked(tmp_path), *arguments)
    assert tuple(found) == how
    assert text.startswith(part)
    assert bool(text) == bool(part)


@pytest.mark.parametrize(
    ("statement", "how"),
    [
        ("formulation lagrangian", ("lagrangian", "0", "dopri")),
        ("solver radau", ("hamiltonian", "2", "radau")),
        ("solver auto(index = 3)", ("hamiltonian", "3", "radau")),
    ],
)
@pytest.mark.long
def test_the_scene_wins(tmp_path, statement, how):
    file = locked(tmp_path)
    text = PENDULUM.replace("time 0 s to 1 s", f"time 0 s to 1 s\n  {statement}")
    write(tmp_path, text)
    path = Path(f"{file}.lock")
    from sysdyn.cli.run.request.lock import hashes
    from sysdyn.cli.run.request.run_request import RunRequest
    from sysdyn.cli.run.request.targets import target_of
    from sysdyn.dsl.text.diagnostics import Report

    now = hashes(target_of(RunRequest(file), Report()))["model.sd"]
    before = tomllib.loads(path.read_text())["files"]["model.sd"]
    path.write_text(path.read_text().replace(before, now))
    assert ran(file)[:3] == how


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (lambda lock: lock.replace('sysdyn = "', 'sysdyn = "9.'), "wrote it, this is"),
        (lambda lock: lock.replace('"model.sd" = "', '"model.sd" = "0'), "model.sd changed"),
        (lambda lock: lock.replace("bdf", "runge"), "cannot be read"),
        (lambda lock: lock + "[", "cannot be read"),
        (lambda lock: lock.replace("version = 1\n", ""), "cannot be read"),
        (lambda lock: lock.replace('"hamiltonian"', "3"), "cannot be read"),
        (lambda lock: lock.replace("\n[files]", "\nfiles = 3\n[other]"), "cannot be read"),
    ],
)
@pytest.mark.one_in(5)
def test_a_stale_lock_is_ignored_and_said_so_even_quietly(tmp_path, capsys, change, said):
    file = locked(tmp_path, change=change)
    capsys.readouterr()
    assert ran(file, "--quiet") == ("lagrangian", "0", "dopri", "")
    err = capsys.readouterr().err
    assert "W921" in err
    assert said in err
    code, found = run_json(capsys, "simulate", file, "-o", "out.h5")
    assert code == 0
    assert [d["code"] for d in found["diagnostics"] if d["severity"] == "warning"] == ["W921"]


def test_imports_and_tables_count(tmp_path, capsys):
    write(tmp_path, "component weight {\n  param m = 1 kg\n  branch: translation\n  law p = m*f\n}\n", "parts.sd")
    write(tmp_path, "0, 0\n1, 2\n", "force.csv")
    file = write(
        tmp_path,
        "from parts import weight\n"
        'table push(t: s) -> N linear clamp file "force.csv"\n'
        "model m {\n  node x: translation = 0 m\n  body: weight x\n"
        "  drive: effort(e = push(t)) ground -> x\n  init body.f = 0 m/s\n}\n"
        "scene s of m { time 0 s to 1 s; trace x.q as q every 0.1 s }\n",
    )
    assert run(["trade", file, "--lock", "--quiet", "--formulation", "lagrangian"]) == 0
    assert sorted(tomllib.loads(Path(f"{file}.lock").read_text())["files"]) == ["force.csv", "model.sd", "parts.sd"]
    assert "lock" in Trace.open(api.simulate(file, output="one.h5").path).attributes
    write(tmp_path, "0, 0\n1, 3\n", "force.csv")
    capsys.readouterr()
    assert ran(file)[3] == ""
    assert "force.csv changed" in capsys.readouterr().err


@pytest.mark.long
def test_scenes_are_locked_beside_each_other(tmp_path):
    text = PENDULUM + PENDULUM[PENDULUM.index("scene") :].replace("scene swing", "scene again")
    file = write(tmp_path, text)
    for scene, method in (("swing", "bdf"), ("again", "radau")):
        assert run(["trade", file, "--scene", scene, "--method", method, "--lock", "--quiet"]) == 0
    held = tomllib.loads(Path(f"{file}.lock").read_text())["scene"]
    assert {name: said["method"] for name, said in held.items()} == {"again": "radau", "swing": "bdf"}


@pytest.mark.long
def test_trade_verify_and_golden_ignore_locks(tmp_path, capsys):
    file = locked(tmp_path)
    found = run_json(capsys, "verify", file)[1]["result"]["runs"]
    assert found[0]["formulation"] == "lagrangian"
    settings = run_json(capsys, "trade", file)[1]["result"]["settings"]
    assert {s["formulation"] for s in settings if s["error"]} == {"lagrangian", "hamiltonian"}


def test_trade_writes_no_lock_by_itself(tmp_path):
    file = write(tmp_path, PENDULUM)
    assert run(["trade", file, "--quiet", "--formulation", "lagrangian"]) == 0
    assert not Path(f"{file}.lock").exists()
    assert run(["trade", "-", "--lock"]) == 2
