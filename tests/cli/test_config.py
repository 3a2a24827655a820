"""`sysdyn.toml` and `[tool.sysdyn]`: defaults of commands; what is wrong in them is told with file, key and nearest."""

import json

import pytest
from sysdyn.cli.main import group, run
from sysdyn.cli.project.config import KEYS
from texts import PENDULUM, write

WARNED = PENDULUM.replace("energy V = m*g0*y", "energy V = m*g0*y\n  work -(1 N)*sign(x') on x")


def said(capsys, *command):
    code = run([str(c) for c in command])
    return code, capsys.readouterr()


def test_every_key_is_an_option_of_its_command():
    for table, keys in KEYS.items():
        command = group.get_command(None, table) if table else None
        for parameter, _ in keys.values():
            if command is None:
                continue
            inner = getattr(command, "commands", {"": command})
            assert any(parameter in [p.name for p in c.params] for c in inner.values()), (table, parameter)


@pytest.mark.parametrize(("name", "head"), [("sysdyn.toml", "check"), ("pyproject.toml", "tool.sysdyn.check")])
def test_a_project_says_how_it_is_checked(tmp_path, capsys, name, head):
    folder = tmp_path / "p" / "models"
    folder.mkdir(parents=True)
    model = write(folder, WARNED)
    assert said(capsys, "check", model)[0] == 0
    (tmp_path / "p" / name).write_text(f'[{head}]\nstrict = true\noutput-format = "concise"\n')
    code, out = said(capsys, "check", model)
    assert code == 1
    assert "warning" in out.out
    code, out = said(capsys, "check", model, "--output-format", "json")  # the command line goes before it
    assert json.loads(out.out)["exit"] == 1


def test_files_are_those_of_the_project(tmp_path, capsys, monkeypatch):
    (tmp_path / "models").mkdir()
    (tmp_path / "inner").mkdir()
    write(tmp_path / "models", PENDULUM)
    (tmp_path / "sysdyn.toml").write_text('[check]\nfiles = ["models"]\n')
    for folder in (".", "inner"):
        monkeypatch.chdir(tmp_path / folder)
        code, out = said(capsys, "check", "--json")
        found = json.loads(out.out)
        assert code == 0
        assert len(found["result"]["files"]) == 1
        monkeypatch.chdir(tmp_path)


def test_what_all_commands_share_and_what_one_says(tmp_path, capsys):
    model = write(tmp_path, PENDULUM)
    (tmp_path / "sysdyn.toml").write_text('backend = "numpy"\n[simulate]\nmax-steps = 3\n')
    code, out = said(capsys, "simulate", model)
    assert code == 3
    assert "E934" in out.err
    code, out = said(capsys, "simulate", model, "--max-steps", "5000")
    assert code == 0
    assert "numpy" in out.err


WRONG = [
    ("[check]\nstrikt = true\n", "[check] has no key 'strikt'; nearest: 'strict'"),
    ('bakend = "c"\n', "has no key 'bakend'; nearest: 'backend'"),
    ("accuracy = 1e-6\n", "has no key 'accuracy': a scene says it"),
    ("strict = true\n", "has no key 'strict': it belongs in [check]"),
    ('color = "blue"\n', "color = 'blue': one of auto, always, never"),
    ("[check]\nstrict = 1\n", "strict = 1: true or false"),
    ('max-steps = "many"\n', "max-steps = 'many': a whole number"),
    ("[check]\nfiles = 3\n", "files = 3: a list of texts"),
    ("[chek]\nstrict = true\n", "has no key 'chek'; nearest: 'check'"),
    ("[check\n", "line 1"),
]


@pytest.mark.parametrize(("text", "message"), WRONG, ids=[w[0].strip()[:20] for w in WRONG])
def test_what_is_wrong_is_told(tmp_path, capsys, text, message):
    model = write(tmp_path, PENDULUM)
    (tmp_path / "sysdyn.toml").write_text(text)
    code, out = said(capsys, "check", model, "--json")
    assert code == 2
    (found,) = json.loads(out.out)["diagnostics"]
    assert found["code"] == "usage"
    assert message in found["message"]
    assert str(tmp_path / "sysdyn.toml") in found["message"]


@pytest.mark.long
def test_other_tools_and_other_folders_are_no_business_of_it(tmp_path, capsys):
    model = write(tmp_path, PENDULUM)
    (tmp_path / "pyproject.toml").write_text("[tool.other]\nstrikt = true\n")
    assert said(capsys, "check", model)[0] == 0
    (tmp_path / "below").mkdir()
    (tmp_path / "below" / "sysdyn.toml").write_text("nonsense = 1\n")
    assert said(capsys, "check", model)[0] == 0
