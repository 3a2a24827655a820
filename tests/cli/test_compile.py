"""`sysdyn compile`: files, stages, explanations."""

import json
from pathlib import Path

import pytest
from sysdyn.cli.main import run
from texts import ARRAY, BROKEN, PENDULUM, write


@pytest.mark.parametrize(("backend", "name"), [("c", "residual.c"), ("numpy", "residual.py")])
def test_files(tmp_path, backend, name):
    assert run(["compile", "-q", write(tmp_path, PENDULUM), "--backend", backend, "-o", "a/b"]) == 0
    more = ["binding.c"] if backend == "c" else []
    names = ["binding.json", "manifest.json", "sysdyn_model.h", name, *more]
    assert sorted(path.name for path in Path("a/b").iterdir()) == sorted(names)
    manifest = json.loads(Path("a/b/manifest.json").read_text())
    for key in ("version", "model", "scene", "formulation", "index", "unknowns", "rows", "parameters"):
        assert key in manifest
    text = Path("a/b", name).read_text(encoding="ascii")
    assert "rod" not in text  # names stay in the manifest
    if backend == "numpy":
        compile(text, name, "exec")


@pytest.mark.parametrize("stage", ["network", "energies", "descriptor", "program"])
@pytest.mark.parametrize("text", [PENDULUM, ARRAY])
def test_stages(tmp_path, capsys, stage, text):
    assert run(["compile", write(tmp_path, text), "--dump", stage]) == 0
    captured = capsys.readouterr()
    assert len(captured.out.splitlines()) > 3
    assert sorted(path.name for path in tmp_path.iterdir()) == ["model.sd"]


def test_stage_and_files(tmp_path, capsys):
    assert run(["compile", write(tmp_path, PENDULUM), "--dump", "descriptor", "-o", "out"]) == 0
    assert capsys.readouterr().out
    assert Path("out/manifest.json").is_file()


@pytest.mark.long
def test_formulations_differ(tmp_path):
    path = write(tmp_path, PENDULUM)
    for formulation in ("lagrangian", "hamiltonian"):
        assert run(["compile", "-q", path, "--formulation", formulation, "-o", formulation]) == 0
    one, other = (json.loads(Path(f, "manifest.json").read_text()) for f in ("lagrangian", "hamiltonian"))
    assert one["formulation"] == "lagrangian"
    assert len(other["unknowns"]) > len(one["unknowns"])
    assert Path("lagrangian/residual.c").read_text() != Path("hamiltonian/residual.c").read_text()


def test_explain_tells_what_was_integrated(tmp_path, capsys):
    text = PENDULUM.replace("  phi rod: x^2 + y^2 = l^2", "  psi track: x' = 2*y'")
    path = write(tmp_path, text.replace("  init x'", "  init y'"))
    assert run(["compile", path, "--explain", "-o", "out"]) == 0
    assert "N501" in capsys.readouterr().err
    assert run(["compile", path, "-o", "out"]) == 0
    assert "N501" not in capsys.readouterr().err


def test_errors_write_nothing(tmp_path):
    assert run(["compile", "-q", write(tmp_path, BROKEN), "-o", "out"]) == 1
    assert not Path("out").exists()


def test_a_file_where_the_folder_should_be(tmp_path, capsys):
    Path("out").write_text("mine")
    assert run(["compile", write(tmp_path, PENDULUM), "-o", "out"]) == 5
    assert Path("out").read_text() == "mine"
    assert "out" in capsys.readouterr().err


def test_explain_accounts_for_every_node_and_branch(tmp_path, capsys):
    text = """from std.electrical import resistor, capacitor, voltage

model line {
  param n = 4
  node v[0..n], w[1..n]: electrical
  Vs: voltage(v = 1 V) v[0] -> ground
  for i in 1..n {
    R[i]: resistor(R = 1 ohm) v[i - 1] -> w[i]
    S[i]: resistor(R = 2 ohm) w[i] -> v[i]
    C[i]: capacitor(C = 1 mF) v[i] -> ground
  }
}
"""
    assert run(["compile", write(tmp_path, text), "--explain", "-o", "out"]) == 0
    said = capsys.readouterr().err
    table = {tuple(line.split("  ", 1)) for line in said.splitlines() if line[:2] in ("P1", "P2", "P3")}
    lines = {(rule, " ".join(rest.split())) for rule, rest in table}
    assert lines == {
        ("P2", "branches Vs, -R[1], -S[1] coordinate Vs: one flow"),
        ("P2", "branches R[2..n - 1], S[2..n - 1] coordinate R: one flow"),
        ("P2", "branches C[1..n], R[n], S[n] coordinate C: one flow"),  # at the open end they are in series
        ("P3", "node v[1..n - 1] psi v: the sum of its flows is zero; its effort is the multiplier"),
        ("P2", "node v[0] merged: two branches, one flow"),
        ("P2", "node v[n] merged: two branches, one flow"),
        ("P2", "node w[1..n] merged: two branches, one flow"),
        ("P3", "node ground electrical reference of its component: no row"),
    }
    assert "note N601: the law of C was inverted" in said
    assert "for i in 2..n - 2" in said
