"""`new` writes what passes as it is, `doctor` finds what is wrong with the machine, the package says its version."""

import importlib.metadata
import json
import re
import subprocess
import sys
from pathlib import Path

import pytest
import sysdyn
from sysdyn import distribution
from sysdyn.cli.main import run
from sysdyn.cli.project import health, skeleton


def commands(text):
    """The commands of sysdyn in a CI file or a README, comments left out."""
    found = re.findall(r"(?:^\s*- run: |^)sysdyn (.*?)\s*(?:#.*)?$", text, re.M)
    return [line.split() for line in found]


def test_a_new_project_passes_as_it_is(tmp_path, monkeypatch, capsys):
    assert run(["new", "quarter-car", "--json"]) == 0
    made = json.loads(capsys.readouterr().out)["result"]["files"]
    folder = tmp_path / "quarter-car"
    assert {"quarter_car.sd", ".github/workflows/models.yml", "README.md", ".gitignore"} <= set(made)
    assert "golden/quarter_car/golden.toml" in made
    assert all((folder / name).is_file() for name in made)
    assert not any("NAME" in (folder / name).read_text() for name in made[:4])
    monkeypatch.chdir(folder)
    ci = commands((folder / ".github/workflows/models.yml").read_text())
    shown = commands((folder / "README.md").read_text())
    assert [c[0] for c in ci] == ["fmt", "check", "golden"]
    assert [c[0] for c in shown] == ["list", "check", "simulate", "plot", "report", "golden"]
    for command in (*ci, *shown):
        assert run(command) == 0, (command, capsys.readouterr().err)
    ignored = (folder / ".gitignore").read_text().split()
    assert "golden.html" in ignored
    assert (folder / "golden.html").is_file()


@pytest.mark.long
def test_a_change_of_the_model_fails_its_ci(tmp_path, monkeypatch, capsys):
    assert run(["new", str(tmp_path / "swing"), "--quiet"]) == 0
    assert capsys.readouterr().out == ""
    monkeypatch.chdir(tmp_path / "swing")
    model = tmp_path / "swing" / "swing.sd"
    model.write_text(model.read_text().replace("k = 50 N/m", "k = 50.5 N/m"))
    assert run(["golden", "check"]) == 1


@pytest.mark.parametrize("name", ["2nd", "if", "a+b", "ground"])
def test_a_name_that_no_model_can_have(name, tmp_path, capsys):
    assert run(["new", name]) == 2
    assert "cannot be the name of a model" in capsys.readouterr().err
    assert not (tmp_path / name).exists()


def test_what_is_there_is_never_overwritten(tmp_path, capsys):
    (tmp_path / "mine").mkdir()
    (tmp_path / "mine" / "notes").write_text("keep")
    assert run(["new", "mine"]) == 2
    assert "not empty" in capsys.readouterr().err
    assert [p.name for p in (tmp_path / "mine").iterdir()] == ["notes"]


def test_the_template_is_laid_out():
    from sysdyn.dsl.format.format import format_text

    text = (skeleton.TEMPLATE / "model.sd").read_text()
    assert format_text(text) == text


def test_doctor_on_this_machine(capsys):
    assert run(["doctor"]) == 0
    out = capsys.readouterr().out
    for name in ("sysdyn", "python", "packages", "core", "compiler", "cache", "trace files", "run (c)", "run (numpy)"):
        assert re.search(rf"^ok +{re.escape(name)} ", out, re.M), out
    assert importlib.metadata.version("numpy") in out


def test_doctor_without_compiler_and_cache(capsys, monkeypatch, tmp_path):
    (tmp_path / "taken").write_text("a file")
    monkeypatch.setenv("CC", "/nonexistent/cc")
    monkeypatch.setenv("SYSDYN_CACHE", str(tmp_path / "taken"))
    assert run(["doctor", "--json"]) == 0
    found = {f["name"]: f for f in reversed(json.loads(capsys.readouterr().out)["result"]["findings"])}
    assert found["compiler"]["state"] == found["cache"]["state"] == found["run (c)"]["state"] == "warning"
    assert "gcc" in found["compiler"]["help"]
    assert found["run (numpy)"]["state"] == "ok"


def test_doctor_tells_a_machine_that_computes_something_else(capsys, monkeypatch):
    monkeypatch.setattr(health.math, "cos", lambda x: 0.9)
    assert run(["doctor"]) == 1
    assert re.search(r"^error +run \(c\)", capsys.readouterr().out, re.M)


def test_the_package_says_its_version_and_is_the_command():
    assert sysdyn.__version__ == importlib.metadata.version(distribution.NAME)
    with pytest.raises(AttributeError):
        _ = sysdyn.nothing
    command = [sys.executable, "-m", "sysdyn", "--version"]
    ran = subprocess.run(command, capture_output=True, text=True, timeout=60, check=False)
    assert ran.stdout.strip() == f"sysdyn, version {sysdyn.__version__}"


@pytest.mark.long
def test_the_hooks_of_pre_commit_pass_on_a_new_project(tmp_path, monkeypatch, capsys):
    text = (Path(__file__).resolve().parents[2] / ".pre-commit-hooks.yaml").read_text()
    entries = re.findall(r"^  entry: sysdyn (.*)$", text, re.M)
    assert [e.split()[0] for e in entries] == ["fmt", "check"]
    assert re.findall(r"^  files: (.*)$", text, re.M) == [r"\.sd$"] * 2
    assert run(["new", "swing", "--quiet"]) == 0
    monkeypatch.chdir(tmp_path / "swing")
    before = (tmp_path / "swing" / "swing.sd").read_bytes()
    for entry in entries:
        assert run([*entry.split(), "swing.sd"]) == 0
    assert (tmp_path / "swing" / "swing.sd").read_bytes() == before


STRANGER = "sysdyn-0.1.0.dist-info"


@pytest.mark.parametrize("name", [STRANGER, "sysdyn-1.2.egg-info", "sysdyn-0.1.0-py3.11.egg-info"])
def test_the_other_project_of_this_name_is_told_by_the_import(name, tmp_path, monkeypatch):
    """Its files lie in the same folder of site-packages: both `sysdyn/__init__.py` and ours are one file."""
    site = tmp_path / "sysdyn"
    site.mkdir()
    monkeypatch.setattr(distribution, "__file__", str(site / "distribution.py"))
    distribution.warn_of_other.cache_clear()
    (tmp_path / "sysdyn_compiler-0.1.0.dist-info").mkdir()
    distribution.warn_of_other()  # its own metadata are no stranger's: -W error
    (tmp_path / name).mkdir()
    distribution.warn_of_other.cache_clear()
    with pytest.warns(RuntimeWarning, match="pip uninstall sysdyn sysdyn-compiler, then install sysdyn-compiler again"):
        distribution.warn_of_other()
    distribution.warn_of_other()  # once


def test_the_other_project_of_this_name_is_told_by_doctor(tmp_path, monkeypatch, capsys):
    (tmp_path / STRANGER).mkdir()
    (tmp_path / STRANGER / "METADATA").write_text("Metadata-Version: 2.1\nName: sysdyn\nVersion: 0.1.0\n")
    monkeypatch.syspath_prepend(tmp_path)
    assert run(["doctor"]) == 1
    assert "pip uninstall sysdyn sysdyn-compiler" in capsys.readouterr().out


ORIGINS = {
    None: "sysdyn-compiler==0.2.0",
    '{"url": "https://host.example/a/sysdyn", "vcs_info": {"vcs": "git", "commit_id": "5eb3119a"}}': (
        '"sysdyn-compiler @ git+https://host.example/a/sysdyn@5eb3119a"'
    ),
    '{"url": "file:///a/sysdyn", "dir_info": {}}': "wheels/sysdyn_compiler-*",
    '{"url": "file:///a/sysdyn_compiler-0.1.0-cp311-cp311-linux_x86_64.whl", "archive_info": {}}': (
        "wheels/sysdyn_compiler-*"
    ),
}


@pytest.mark.parametrize(("origin", "wanted"), ORIGINS.items())
def test_a_new_project_installs_this_distribution_and_no_stranger(origin, wanted, tmp_path, monkeypatch, capsys):
    """As pip recorded where this installation comes from (PEP 610): index, repository, folder, file."""

    class Installed:
        def read_text(self, name):
            assert name == "direct_url.json"
            return origin

    monkeypatch.setattr(importlib.metadata, "distribution", lambda name: {distribution.NAME: Installed()}[name])
    assert run(["new", str(tmp_path / "swing")]) == 0
    ci = (tmp_path / "swing/.github/workflows/models.yml").read_text()
    assert f"      - run: pip install {wanted}\n" in ci
    assert ("put a wheel of it there" in capsys.readouterr().err) == wanted.startswith("wheels/")


def test_no_page_advises_to_install_the_other_project():
    """`pip install sysdyn` is a stranger's package."""
    root = Path(__file__).resolve().parents[2]
    pages = [p for top in ("cli", "dsl", "compiler", "runtime", "models", "README.md") for p in [root / top]]
    files = [f for p in pages for f in ([p] if p.is_file() else p.rglob("*")) if f.suffix in {".py", ".md", ".yml"}]
    assert len(files) > 500
    advice = re.compile(r"pip3? install[^\n]* ['\"]?sysdyn(?![-_\w])")
    named = [f for f in files if advice.search(f.read_text(encoding="utf-8"))]
    assert named == []
