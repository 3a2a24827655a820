"""`sysdyn golden`: a project's goldens recorded, checked, sabotaged, accepted."""

import json
import os
import shutil
import signal
import tomllib
from pathlib import Path
from xml.etree import ElementTree

import h5py
import numpy as np
import pytest
from schema import NUMBER, conforms, envelope
from sysdyn.cli.golden import book, jobs
from sysdyn.cli.main import run
from texts import PENDULUM, run_json

SPRING = """\
model spring {
  param m = 1 kg
  param k = 40 N/m
  param idle = 0 m
  coord x: translation = 0.1 m
  energy T* = 1/2*m*x'^2
  energy V = 1/2*k*(x - idle)^2
  init x' = 0 m/s
}

scene ring of spring {
  time 0 s to 2 s
  trace x, x' as v
}
"""

FILTER = """\
from std.electrical import resistor, capacitor, voltage

model filter {
  param R = 10 kohm
  node a, b: electrical
  Vs: voltage(v = 5 V*sin(2*pi*10 Hz*t)) a -> ground
  Ra: resistor(R = R) a -> b
  Cb: capacitor(C = 1 uF) b -> ground
  init Cb.e = 0 V
}

scene first of filter {
  time 0 s to 0.3 s
  trace Cb.e as v, Ra.f as i
}
"""
TEXTS = {"pendulum": PENDULUM, "spring": SPRING, "filter": FILTER}
CASE = {"golden": str, "formulation": str, "backend": str, "exit": int, "message": str, "ok": bool, "seconds": NUMBER}


@pytest.fixture(scope="module")
def recorded(tmp_path_factory):
    """A project of three models with their goldens."""
    project = tmp_path_factory.mktemp("project")
    for name, text in TEXTS.items():
        (project / f"{name}.sd").write_text(text)
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(project)
        for name in TEXTS:
            assert run(["golden", "record", "-q", f"{name}.sd"]) == 0
    return project


@pytest.fixture
def project(recorded, tmp_path):
    """A copy of it, in which the test runs."""
    for path in recorded.rglob("*"):
        if path.is_file():
            target = tmp_path / path.relative_to(recorded)
            target.parent.mkdir(parents=True, exist_ok=True)
            target.write_bytes(path.read_bytes())
    return tmp_path


def sabotage(name, old, new):
    path = Path(f"{name}.sd")
    text = path.read_text()
    assert old in text
    path.write_text(text.replace(old, new))


@pytest.mark.long
def test_what_is_recorded(project):
    data = tomllib.loads((project / "golden/spring/golden.toml").read_text())
    assert data["model"] == "../../spring.sd"
    scene = data["scenes"]["ring"]
    assert scene["formulations"] == ["lagrangian", "hamiltonian"]
    assert 0.0 < 10.0 * scene["error"] <= scene["rtol"] == 2e-4
    went_round = 2 * (0.5 * 40.0 * 0.1**2)  # what the mass and the spring store at most
    assert scene["accuracy"] * went_round * 0.999 <= scene["energy"] < 1e-3 * went_round
    assert scene["accepted"][0]["reason"] == "recorded"
    structure = json.loads((project / "golden/spring/ring.json").read_text())["formulations"]
    assert structure["lagrangian"]["dof"] == 1
    assert structure["lagrangian"]["index"] == 0
    assert any("T*" in line for line in structure["lagrangian"]["equations"])
    for path in project.glob("golden/*/*.h5"):
        assert path.stat().st_size < 100e3
        with h5py.File(path) as file:
            assert all(item.attrs["nominal"] > 0.0 for name, item in file.items() if "nominal" in item.attrs)
    assert book.read(project / "golden/spring")[0].accuracy == scene["accuracy"]


def test_all_is_well(project, capsys):
    assert run(["golden", "check", "--junit", "out.xml", "--html", "out.html"]) == 0
    said = capsys.readouterr()
    assert said.out.startswith("all 8 checks passed")
    root = ElementTree.parse("out.xml").getroot()
    assert len(root) == 8
    names = {case.get("name") for case in root[0]}
    assert {"structure: dof", "structure: equations", "meter: energy", "v"} <= names


@pytest.mark.long
def test_other_methods_and_backends_are_no_alarm(project):
    assert run(["golden", "check", "--method", "bdf", "--method", "radau"]) == 0
    assert run(["golden", "check", "-q", "spring", "--backend", "c", "--backend", "numpy"]) == 0


@pytest.mark.parametrize("build", ["cc -O0", "cc -O3 -march=native -ffp-contract=fast", "clang", "tcc"])
@pytest.mark.long
def test_another_compilers_build_is_no_alarm(project, capsys, monkeypatch, build):
    """The goldens were recorded with the flags of compiler/build.py; a wrapper's own come last and win."""
    name, *flags = build.split()
    if shutil.which(name) is None:
        pytest.skip(f"there is no {name}")
    wrapper = project / "wrapper"
    wrapper.write_text(f'#!/bin/sh\nexec {name} "$@" {" ".join(flags)}\n')
    wrapper.chmod(0o755)
    monkeypatch.setenv("CC", str(wrapper))
    monkeypatch.setenv("SYSDYN_CACHE", str(project / "cache"))
    code, found = run_json(capsys, "golden", "check")
    assert code == 0
    assert len(found["result"]["checks"]) == 8
    assert list((project / "cache").glob("model-*.so"))


def test_a_sabotaged_parameter_is_named(project, capsys):
    sabotage("filter", "R = 10 kohm", "R = 10.1 kohm")
    code, found = run_json(capsys, "golden", "check", "--jobs", "2", "--junit", "out.xml", "--html", "out.html")
    assert code == 1
    envelope(found, "golden", {"checks": list, "failed": int})
    checks = found["result"]["checks"]
    for case in checks:
        conforms(case, CASE)
        assert case["ok"] == (not case["golden"].startswith("filter"))
    wrong = next(case for case in checks if not case["ok"])
    assert wrong["variable"] in ("v", "i")
    assert wrong["ratio"] > 1.0
    assert "times over the limit" in wrong["message"]
    assert int(ElementTree.parse("out.xml").getroot().get("failures")) >= 2
    assert "<svg" in Path("out.html").read_text()
    assert run(["golden", "check", "filter"]) == 1
    first = capsys.readouterr().out.splitlines()[0]
    assert first.startswith("4 of 4 checks failed; worst: filter/first")
    assert run(["golden", "check", "-q", "pendulum/swing", "spring.sd"]) == 0


def test_a_changed_equation_is_found_by_the_structure(project, capsys):
    sabotage("spring", "(x - idle)^2", "(idle - x)^2")
    assert run(["golden", "check", "spring"]) == 1
    assert "is new" in capsys.readouterr().out


def test_a_drifting_meter_is_found(project, capsys):
    path = Path("golden/spring/golden.toml")
    lines = path.read_text().splitlines()
    path.write_text("\n".join("energy = 1e-30" if line.startswith("energy") else line for line in lines))
    assert run(["golden", "check", "spring"]) == 1
    assert "its bound is 1e-30 J" in capsys.readouterr().out


def test_accept_shows_and_wants_a_reason(project, capsys):
    sabotage("spring", "k = 40 N/m", "k = 41 N/m")
    before = Path("golden/spring/ring.h5").read_bytes()
    assert run(["golden", "accept", "spring"]) == 2
    said = capsys.readouterr()
    assert "spring/ring: differs: " in said.out
    assert "without a reason" in said.err
    assert run(["golden", "accept", "spring", "--reason", "  "]) == 2
    assert Path("golden/spring/ring.h5").read_bytes() == before
    reason = 'stiffer "spring",\nas measured'
    assert run(["golden", "accept", "-q", "spring", "--reason", reason]) == 0
    assert Path("golden/spring/ring.h5").read_bytes() != before
    assert run(["golden", "check", "-q", "spring"]) == 0
    accepted = book.read(Path("golden/spring"))[0].accepted
    assert [a.reason for a in accepted] == ["recorded", reason]
    assert "times over the limit" in accepted[1].change
    capsys.readouterr()
    assert run(["golden", "accept", "spring", "--reason", "again"]) == 0
    assert "nothing changed" in capsys.readouterr().out
    assert len(book.read(Path("golden/spring"))[0].accepted) == 2


def test_list(project, capsys):
    code, found = run_json(capsys, "golden", "list")
    assert code == 0
    envelope(found, "golden", {"goldens": list})
    assert [g["golden"] for g in found["result"]["goldens"]] == ["filter/first", "pendulum/swing", "spring/ring"]
    assert run(["golden", "list"]) == 0
    assert capsys.readouterr().out.splitlines()[0].startswith("golden")


def test_mutants(project, capsys):
    code, found = run_json(capsys, "golden", "check", "spring", "--mutate")
    assert code == 0
    mutants = {m["parameter"]: m for m in found["result"]["mutants"]}
    assert mutants["m"]["noticed"]
    assert mutants["k"]["noticed"]
    assert mutants["idle"]["noticed"] is None
    assert "it is 0" in mutants["idle"]["reason"]
    assert (found["result"]["tried"], found["result"]["noticed"]) == (2, 2)


def test_a_tolerance_below_its_own_error_is_refused(project, capsys):
    (project / "chaos.sd").write_text(
        """\
model chaos {
  state x: 1 = 1
  state y: 1 = 1
  state z: 1 = 20
  param rate = 1 s^-1
  dynamic x' = 10*rate*(y - x)
  dynamic y' = rate*(x*(28 - z) - y)
  dynamic z' = rate*(x*y - 8/3*z)
}
scene long of chaos {
  time 0 s to 60 s
  trace x
}
"""
    )
    assert run(["golden", "record", "chaos.sd"]) == 3
    assert "the accuracy asked was not reached: x" in capsys.readouterr().err
    assert not (project / "golden/chaos").exists()


def test_recorded_once(project, capsys):
    assert run(["golden", "record", "spring.sd"]) == 2
    assert "golden accept" in capsys.readouterr().err
    (project / "other").mkdir()
    (project / "other" / "spring.sd").write_text(SPRING)
    assert run(["golden", "record", "other/spring.sd"]) == 2
    assert "--name" in capsys.readouterr().err
    assert run(["golden", "record", "-q", "other/spring.sd", "--name", "spring2", "--formulation", "hamiltonian"]) == 0
    assert book.read(project / "golden/spring2")[0].formulations == ("hamiltonian",)


def test_settings_are_kept(project):
    command = ["golden", "record", "-q", "spring.sd", "--name", "soft", "--set", "k=20 N/m"]
    assert run(command) == 0
    assert run(["golden", "check", "-q", "soft"]) == 0
    sabotage("spring", "k = 40 N/m", "k = 41 N/m")
    assert run(["golden", "check", "-q", "soft"]) == 0


def test_a_size_that_is_too_small(project, capsys):
    assert run(["golden", "record", "spring.sd", "--name", "small", "--size", "2"]) == 1
    assert "more than 2" in capsys.readouterr().err
    assert not (project / "golden/small/golden.toml").exists()


@pytest.mark.parametrize("number", ["1", "2"])
@pytest.mark.one_in(2)
def test_broken_goldens_are_said(project, capsys, number):
    trace = Path("golden/spring/ring.h5")
    trace.write_bytes(trace.read_bytes()[:3000])
    Path("golden/pendulum/swing.json").write_text("{}")
    assert run(["golden", "check", "--jobs", number]) == 5
    out = capsys.readouterr().out
    assert "not readable as a trace" in out
    assert "swing.json" in out
    assert out.startswith("4 of 8 checks failed")


def deadly(asked):
    """Kills its process at one golden, always."""
    if asked.golden.label == "pendulum/swing":
        os.kill(os.getpid(), signal.SIGKILL)
    return jobs.check_golden(asked)


def test_a_check_that_is_killed_costs_no_other(project):
    some = [golden for golden in book.find(Path("golden"), ()) if golden.label in ("pendulum/swing", "spring/ring")]
    asked = [jobs.GoldenJob(golden, (), (), ("c",), False) for golden in some]
    found = {case.golden: case for cases in jobs.in_processes(asked, 2, deadly) for case in cases}
    assert found["pendulum/swing"].exit == 5
    assert "killed by signal 9" in found["pendulum/swing"].message
    assert found["spring/ring"].message.startswith("equal")


@pytest.mark.long
def test_two_processes_find_what_one_finds(project, capsys):
    def shown(found):
        return [{k: v for k, v in check.items() if k != "seconds"} for check in found["result"]["checks"]]

    one, two = (run_json(capsys, "golden", "check", "--jobs", n) for n in "12")
    assert one[0] == two[0] == 0
    assert shown(one[1]) == shown(two[1])


BROKEN_BOOKS = ["", "[", "version = 9", "version = 1\nmodel = 3", "version = 1\nmodel = 'a'\nscenes = 4"]


@pytest.mark.parametrize("text", BROKEN_BOOKS)
@pytest.mark.one_in(3)
def test_broken_books_are_said(project, capsys, text):
    Path("golden/spring/golden.toml").write_text(text)
    assert run(["golden", "check"]) == 5
    said = capsys.readouterr().err
    assert "golden.toml" in said
    assert "Error" not in said  # of Python
    assert ("'version' is missing" in said) is (text == "")


def test_a_model_that_is_gone_or_broken(project, capsys):
    Path("spring.sd").unlink()
    sabotage("pendulum", "energy V = m*g0*y", "energy V = m*g0*")
    code, found = run_json(capsys, "golden", "check")
    assert code == 5
    messages = {c["golden"]: c["message"] for c in found["result"]["checks"]}
    assert "spring.sd: no such model" in messages["spring/ring"]
    assert messages["pendulum/swing"].startswith("pendulum.sd:7: E")
    assert messages["filter/first"].startswith("equal")


def test_a_scene_that_is_gone_is_no_wrong_usage_and_costs_no_other_check(project, capsys):
    sabotage("filter", "scene first of", "scene renamed of")
    code, found = run_json(capsys, "golden", "check", "filter", "spring")
    assert code == 1
    messages = {c["golden"]: c["message"] for c in found["result"]["checks"]}
    assert messages["filter/first"].startswith("E901: filter.sd has no scene 'first'")
    assert messages["spring/ring"].startswith("equal")
    assert run(["golden", "accept", "filter", "--reason", "renamed"]) == 1
    assert "filter/first: E901: " in capsys.readouterr().err
    Path("filter.sd").unlink()
    assert run(["golden", "accept", "filter", "--reason", "gone"]) == 5
    assert "filter/first: filter.sd: no such model" in capsys.readouterr().err


def test_wrong_usage(project, capsys):
    assert run(["golden", "check", "sprin"]) == 2
    assert "nearest: 'spring/ring'" in capsys.readouterr().err
    assert run(["golden", "check", "spring", "--formulation", "co_lagrangian"]) == 2
    assert run(["golden", "check", "--folder", "nowhere"]) == 2
    assert run(["golden", "record", "spring.sd", "--rtol", "2"]) == 2
    assert run(["golden", "record", "spring.sd", "--scene", "no"]) == 2
    assert run(["golden"]) == 2


def test_expect_golden(project, capsys):
    scene = """
scene again of spring {
  time 0 s to 2 s
  trace x, x*x as y every 10 ms
  expect golden "golden/spring/ring.h5" within 1e-3
}
"""
    Path("spring.sd").write_text(SPRING + scene)
    code, found = run_json(capsys, "simulate", "spring.sd", "--scene", "again")
    assert code == 0
    assert found["result"]["expects"][0]["ok"] is True
    code, found = run_json(capsys, "simulate", "spring.sd", "--scene", "again", "--set", "k=41")
    assert code == 1
    (diagnostic,) = (d for d in found["diagnostics"] if d["severity"] == "error")
    assert diagnostic["code"] == "E909"
    assert "times over the limit" in diagnostic["message"]
    Path("golden/spring/ring.h5").write_bytes(b"no trace")
    assert run(["simulate", "-q", "spring.sd", "--scene", "again"]) == 1
    Path("golden/spring/ring.h5").unlink()
    assert run(["simulate", "-q", "spring.sd", "--scene", "again"]) == 1
    assert "E907" in capsys.readouterr().err


@pytest.mark.long
def test_a_golden_is_a_trace(project):
    with h5py.File("golden/pendulum/swing.h5") as file:
        assert file.attrs["Conventions"] == b"CF-1.11"
        assert file["time"].is_scale
        assert file["x"].dims[0].keys() == ["time"]
        assert np.all(np.diff(file["time"]) > 0)
    assert run(["diff", "-q", "golden/pendulum/swing.h5", "golden/pendulum/swing.h5"]) == 0
    assert run(["plot", "-q", "golden/pendulum/swing.h5", "-o", "a.png"]) in (0, 5)


@pytest.mark.long
def test_a_golden_of_a_scene_that_needs_a_part_holds_the_structure_of_the_whole(tmp_path, monkeypatch):
    """An array with initial values that nothing asks for: a fault in sysdyn before (exit 4)."""
    walls = (
        "  node room, wall[1..2]: heat\n  air: potential(q = 60 kJ/K*e) room -> ground\n  for i in 1..2 {\n"
        "    store[i]: potential(q = 20 kJ/K*e) wall[i] -> ground\n"
        "    skin[i]: dissipator(f = 15 W/K*e) room -> wall[i]\n    init wall[i].e = 293 K\n  }\n"
    )
    (tmp_path / "spring.sd").write_text(SPRING.replace("  coord", walls + "  coord"))
    monkeypatch.chdir(tmp_path)
    assert run(["golden", "record", "spring.sd"]) == 0
    structure = json.loads(Path("golden/spring/ring.json").read_text())
    assert "store" in json.dumps(structure)
    assert run(["golden", "check"]) == 0


def test_what_the_scene_expects_and_does_not_find_is_said(tmp_path, monkeypatch, capsys):
    """It was recorded without a word: a golden of a scene whose expect fails."""
    text = SPRING.replace("  trace x", "  expect finally: x == 3 m within 1 mm\n  trace x")
    (tmp_path / "spring.sd").write_text(text)
    monkeypatch.chdir(tmp_path)
    assert run(["golden", "record", "spring.sd"]) == 0
    assert "expected 3 m within 0.001 m" in capsys.readouterr().err
