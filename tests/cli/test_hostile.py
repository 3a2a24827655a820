"""Texts that are no models: a diagnostic in bounded time, nothing executed, nothing written elsewhere."""

import random
from pathlib import Path

import pytest
from sysdyn.cli.main import run
from texts import PENDULUM, process, write


def tree(folder):
    """Every path below a folder."""
    return sorted(str(path.relative_to(folder)) for path in Path(folder).rglob("*"))


def refused(path, capsys, *, commands=("check", "simulate", "compile", "fmt")):
    """Every command ends with exit 1 and a diagnostic that has a place."""
    for command in commands:
        assert run([command, path]) == 1, command
        err = capsys.readouterr().err
        assert "error E" in err
        assert " --> " in err
        assert "Traceback" not in err


@pytest.mark.parametrize("seed", range(8))
@pytest.mark.one_in(5)
def test_random_bytes(tmp_path, capsys, seed):
    path = tmp_path / "random.sd"
    path.write_bytes(random.Random(seed).randbytes(3000))
    refused(str(path), capsys)


def test_parentheses(tmp_path, capsys):
    path = write(tmp_path, "model m {\n  let a = " + "(" * 100_000 + "\n}\n")
    refused(path, capsys)


def test_a_sum_of_60000_terms(tmp_path, capsys):
    path = write(tmp_path, "model m {\n  let a = 1" + " +\n1" * 60_000 + "\n}\n")
    refused(path, capsys, commands=("check", "fmt"))


@pytest.mark.parametrize("part", range(1, 12))
@pytest.mark.one_in(6)
def test_cut_files(tmp_path, capsys, part):
    cut = PENDULUM[: len(PENDULUM) * part // 12]
    path = write(tmp_path, cut)
    code = run(["check", path])
    err = capsys.readouterr().err
    assert code == (1 if "error E" in err else 0)
    assert code == 1 or part >= 7
    assert "fault" not in err


HOSTILE = [
    'x); system("touch pwned"); //',
    "x__import__('os').system('touch pwned')",
    "$(touch pwned)",
    "`touch pwned`",
    'x"; touch pwned; "',
    "../../pwned",
    "x\\\n#include </etc/passwd>",
]


@pytest.mark.parametrize("name", HOSTILE)
@pytest.mark.one_in(5)
def test_names_with_code_in_them(tmp_path, capsys, name):
    before = tree(tmp_path)
    text = PENDULUM.replace("rod", name).replace("model pendulum", f"model pendulum{name}")
    path = write(tmp_path, text)
    assert run(["simulate", path]) == 1
    assert "error E" in capsys.readouterr().err
    assert tree(tmp_path) == sorted([*before, "model.sd"])


@pytest.mark.long
def test_keywords_of_c_and_python_are_names(tmp_path):
    text = PENDULUM
    for old, new in (("m", "int"), ("l", "lambda"), ("rod", "exit"), ("pendulum", "class")):
        text = "\n".join(swapped(line, old, new) for line in text.split("\n"))
    path = write(tmp_path, text)
    for backend in ("c", "numpy"):
        assert run(["simulate", "-q", path, "--backend", backend]) == 0


def swapped(line, old, new):
    """One name for another, units left alone."""
    import re

    return re.sub(rf"(?<![\d] )(?<![\w/]){old}\b(?!/s)", new, line)


def test_strings_and_paths_of_the_text_are_not_opened(tmp_path, capsys):
    text = PENDULUM.replace(
        "model pendulum {",
        'from std.os import system\ntable f(x: m) -> m linear clamp file "/etc/passwd"\nmodel pendulum {',
    )
    path = write(tmp_path, text)
    code = run(["check", path])
    captured = capsys.readouterr()
    assert code == 1
    assert "root:" not in captured.err


@pytest.mark.long
def test_scene_names_do_not_leave_the_folder(tmp_path):
    path = write(tmp_path, PENDULUM)
    before = tree(tmp_path)
    assert run(["simulate", "-q", path]) == 0
    assert tree(tmp_path) == sorted([*before, "model-swing.h5"])


@pytest.mark.long
def test_bounded_time_in_a_process(tmp_path):
    path = write(tmp_path, "model m {\n" + "  coord x[1..n]: translation = ((((\n" * 2000)
    ran = process("check", path, timeout=60)
    assert ran.returncode == 1
    assert "error E" in ran.stderr


@pytest.mark.parametrize(
    "data", [b"", b"\xff\xfe" + "model m {}".encode("utf-16-le"), b"\x00" * 100, b"model m {}\r\n"]
)
@pytest.mark.one_in(2)
def test_odd_files(tmp_path, capsys, data):
    path = tmp_path / "odd.sd"
    path.write_bytes(data)
    assert run(["check", str(path)]) in (0, 1)
    assert "fault" not in capsys.readouterr().err


def test_a_table_whose_file_is_a_link_to_itself(tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    Path("t.csv").symlink_to("t.csv")
    Path("m.sd").write_text('table a(x: m) -> N linear clamp file "t.csv"\nmodel m { coord x: translation }\n')
    assert run(["check", "m.sd"]) == 1
    assert "E206" in capsys.readouterr().err


@pytest.mark.parametrize("command", ["check", "fmt", "simulate", "verify", "reduce", "compile", "golden record", "new"])
@pytest.mark.one_in(4)
def test_a_link_to_itself_and_no_name_are_unreadable_files(tmp_path, capsys, monkeypatch, command):
    """Exit 5, never a fault inside."""
    monkeypatch.chdir(tmp_path)
    Path("loop.sd").symlink_to("loop.sd")
    for name in ("loop.sd",) if command == "new" else ("loop.sd", ""):
        assert run([*command.split(), name]) == 5, name
        assert "fault" not in capsys.readouterr().err


@pytest.mark.parametrize("encoding", ["utf-16", "utf-16-le", "utf-16-be"])
def test_a_text_in_utf_16_is_told_once(tmp_path, capsys, encoding):
    path = tmp_path / "odd.sd"
    path.write_bytes("model m {\n  param a = 1\n}\n".encode(encoding))
    assert run(["check", str(path)]) == 1
    said = capsys.readouterr().err
    assert said.count("error") == said.count("error E116") == 1
    assert "save the file as UTF-8" in said


def test_modules_that_import_each_other_are_both_named(tmp_path, capsys):
    for name, other in (("a", "b"), ("b", "a")):
        (tmp_path / f"{name}.sd").write_text(
            f"from {other} import {other}1\ncomponent {name}1 {{ param k = 1 }}\nmodel m {{ }}\n"
        )
    assert run(["check", str(tmp_path / "a.sd")]) == 1
    assert "error E801: modules 'a' and 'b' import each other" in capsys.readouterr().err
