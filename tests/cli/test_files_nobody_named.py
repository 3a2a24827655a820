"""Files that a command reads without being told to: pipes, devices, hostile TOML, ways out of the project."""

import os
import shutil
import textwrap
import time
from pathlib import Path

import pytest
from sysdyn.cli import plain_files
from sysdyn.cli.main import run
from sysdyn.cli.plain_files import UnfitError
from sysdyn.compiler.program import build
from texts import PENDULUM, write

posix = pytest.mark.skipif(os.name != "posix", reason="pipes and devices in folders")


def said(capsys, *command):
    code = run([str(c) for c in command])
    return code, capsys.readouterr().err


def fifo(path):
    os.mkfifo(path)


def device(path):
    path.symlink_to("/dev/zero")


def large(path):
    path.write_text("# " + "a" * plain_files.LONGEST)


HOSTILE = {
    "a pipe": (fifo, "no regular file"),
    "a device": (device, "no regular file"),
    "too long": (large, "longer than 1 MB"),
    "deep lists": (lambda path: path.write_text("a = " + "[" * 5000 + "]" * 5000), "nested too deep"),
    "a long key": (lambda path: path.write_text("a." * 50_000 + "b = 1"), "a key of more than 100 words"),
    "a long number": (lambda path: path.write_text("max-steps = " + "1" * 5000), "limit"),
    "no text": (lambda path: path.write_bytes(b"color = '\xff'"), "can't decode byte 0xff"),
    "a NUL": (lambda path: path.write_text('[check]\nfiles = ["a\\u0000b"]'), "is outside of"),
    "a folder with NUL": (lambda path: path.write_text('[golden]\nfolder = "a\\u0000b"'), "no name of a folder"),
}


@posix
@pytest.mark.parametrize("above", ["", "inner"])
@pytest.mark.parametrize("kind", HOSTILE)
def test_a_configuration_that_is_none_is_told_and_not_read(kind, above, tmp_path, capsys, monkeypatch):
    make, message = HOSTILE[kind]
    make(tmp_path / "sysdyn.toml")
    inner = tmp_path / above
    inner.mkdir(exist_ok=True)
    monkeypatch.chdir(inner)
    write(inner, PENDULUM)
    code, err = said(capsys, "check", "model.sd" if (inner / "model.sd").exists() else next(inner.glob("*.sd")).name)
    assert code == 2
    assert message in err
    assert "sysdyn.toml" in err


@pytest.mark.parametrize("text", ["tool = 3", "[tool]\nsysdyn = 3", "tool = [1]"])
def test_a_project_file_whose_tool_is_no_table(text, tmp_path, capsys):
    (tmp_path / "pyproject.toml").write_text(f"# [tool.sysdyn]\n{text}\n")
    code, err = said(capsys, "check", write(tmp_path, PENDULUM))
    assert code == 2
    assert "[tool.sysdyn] is a table" in err


@posix
@pytest.mark.parametrize("item", ["../secret.sd", "*.sd", "models", "link.sd", "../*.sd", "{outside}/secret.sd"])
def test_files_of_a_project_stay_inside_it(item, tmp_path, capsys, monkeypatch):
    project = tmp_path / "project"
    (project / "models").mkdir(parents=True)
    (tmp_path / "secret.sd").write_text("secret words\n")
    for link in (project / "link.sd", project / "models" / "link.sd"):
        link.symlink_to(tmp_path / "secret.sd")
    (project / "sysdyn.toml").write_text(f'[check]\nfiles = ["{item.format(outside=tmp_path)}"]\n')
    monkeypatch.chdir(project)
    code, err = said(capsys, "check")
    assert code == 2
    assert "the project's folder" in err
    assert "secret words" not in err


def test_a_link_inside_the_project_is_taken(tmp_path, capsys, monkeypatch):
    (tmp_path / "models").mkdir()
    path = write(tmp_path / "models", PENDULUM)
    (tmp_path / "one.sd").symlink_to(path)
    (tmp_path / "sysdyn.toml").write_text('[check]\nfiles = ["*.sd"]\n')
    monkeypatch.chdir(tmp_path)
    assert said(capsys, "check", "--quiet")[0] == 0


BOOK = """version = 1
model = "{model}"
[scenes.s]
scene = "s"
rtol = 1e-3
atol = 0.0
tau = 0.0
accuracy = 1e-4
error = 0.0
energy = 1.0
constraints = 1.0
formulations = ["lagrangian"]
"""


@posix
@pytest.mark.parametrize("model", ["../../../secret.sd", "{outside}/secret.sd", "../../link.sd", "a\\\\u0000b"])
@pytest.mark.parametrize("command", [["list"], ["check"], ["accept", "m/s", "--reason", "r"]])
@pytest.mark.one_in(6)
def test_the_model_of_a_golden_stays_inside_the_project(model, command, tmp_path, capsys, monkeypatch):
    project = tmp_path / "project"
    (project / "golden" / "m").mkdir(parents=True)
    (tmp_path / "secret.sd").write_text("secret words\n")
    (project / "link.sd").symlink_to(tmp_path / "secret.sd")
    (project / "golden" / "m" / "golden.toml").write_text(
        BOOK.format(model=model.format(outside=tmp_path).replace("\\\\", "\\"))
    )
    monkeypatch.chdir(project)
    code, err = said(capsys, "golden", *command)
    assert code == 5
    assert "is outside of the project" in err
    assert "secret words" not in err


@posix
@pytest.mark.parametrize("kind", ["a pipe", "a device", "deep lists", "a long key"])
@pytest.mark.one_in(2)
def test_a_golden_book_that_is_none_is_told(kind, tmp_path, capsys, monkeypatch):
    (tmp_path / "golden" / "m").mkdir(parents=True)
    HOSTILE[kind][0](tmp_path / "golden" / "m" / "golden.toml")
    monkeypatch.chdir(tmp_path)
    code, err = said(capsys, "golden", "list")
    assert code == 5
    assert HOSTILE[kind][1] in err


def test_what_is_read_is_the_text_itself(tmp_path):
    path = tmp_path / "a.toml"
    path.write_text('a = "ä"\n[b]\nc = ["x.y.z", 1.5]\n', encoding="utf-8")
    assert plain_files.tables(path) == {"a": "ä", "b": {"c": ["x.y.z", 1.5]}}
    path.write_text("a = ")
    with pytest.raises(UnfitError, match=r"a\.toml"):
        plain_files.tables(path)


COMPILERS = {
    "words of no encoding": (
        'printf "\\377\\376 caf\\351\\n" >&2\nexit 1',
        "the C compiler failed with status 1: \ufffd",
    ),
    "words without end": ("yes é | head -c 30000000 >&2\nexit 1", "the C compiler failed with status 1: é"),
    "killed": ("kill -9 $$", "the C compiler failed with status -9"),
}


@posix
@pytest.mark.parametrize("kind", COMPILERS)
@pytest.mark.one_in(2)
def test_what_a_compiler_says_is_bytes(kind, tmp_path, capsys, monkeypatch):
    script, message = COMPILERS[kind]
    compiler(tmp_path, monkeypatch, f'[ "$1" = --version ] && exit 0\n{script}')
    monkeypatch.chdir(tmp_path)
    code, err = said(capsys, "simulate", write(tmp_path, PENDULUM), "--until", "0.1 s")
    assert code == 0
    assert message in err
    assert "the NumPy backend takes over" in err


@posix
@pytest.mark.skipif(shutil.which("cc") is None, reason="no C compiler")
def test_a_compiler_that_leaves_a_child_with_its_output_open_is_not_waited_for(tmp_path, monkeypatch):
    pid = tmp_path / "child"
    compiler(tmp_path, monkeypatch, f'sleep 600 &\necho $! >{pid}\nexec cc "$@"')
    assert build.build(f"/* {tmp_path} */ int sd_nothing(void) {{ return 0; }}\n").is_file()
    state = Path(f"/proc/{int(pid.read_text())}/stat")
    # a signal is sent when `build` returns, and may arrive a little later
    for _ in range(500):
        if ended := _is_gone(state):
            break
        time.sleep(0.02)
    assert ended


def _is_gone(state):
    """Whether a process has ended, by its file in /proc."""
    try:
        return state.read_text().rsplit(")", 1)[1].split()[0] == "Z"
    except OSError:
        return True


def compiler(folder, monkeypatch, script):
    path = folder / "compiler"
    path.write_text(textwrap.dedent(f"#!/bin/sh\n{script}\n"))
    path.chmod(0o755)
    monkeypatch.setenv("CC", str(path))
    monkeypatch.setenv("SYSDYN_CACHE", str(folder / "cache"))
