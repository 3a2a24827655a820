"""What a shell completes: commands, scenes, names, levels, topics."""

import subprocess
import sys

import pytest
from click.shell_completion import ShellComplete
from sysdyn.cli.main import group

MODEL = """component part {
  port a: translation
  level stiff default {
    k: potential(e = 4 N/m*q) a -> ground
  }
  level soft {
    k: potential(e = 1 N/m*q) a -> ground
  }
}

model m {
  param mass = 2 kg
  input push: N = 1 N*sin(t/(1 s))
  node x: translation = 1 m
  M: kinetic(p = mass*f) x
  F: effort(e = push) ground -> x
  P: part() a = x
}

## Let go.
scene free of m {
  time 0 s to 1 s
  trace x.q
}

scene forced of m {
  time 0 s to 1 s
}
"""


def offered(*words):
    """Completions of the last word behind the others: text -> help."""
    complete = ShellComplete(group, {}, "sysdyn", "_SYSDYN_COMPLETE")
    return {item.value: item.help for item in complete.get_completions(list(words[:-1]), words[-1])}


@pytest.fixture
def model(tmp_path):
    (tmp_path / "m.sd").write_text(MODEL)
    return "m.sd"


def test_commands_and_choices(model):
    assert {"simulate", "std", "scene"} & set(offered("s")) == {"simulate", "std"}
    assert set(offered("simulate", model, "--formulation", "co_")) == {"co_lagrangian", "co_hamiltonian", "co_kane"}


@pytest.mark.parametrize("command", ["simulate", "list", "compile", "verify"])
def test_scenes_of_the_file(model, command):
    assert offered(command, model, "--scene", "f") == {"free": "Let go.", "forced": ""}
    assert offered(command, model, "--scene", "fr") == {"free": "Let go."}


def test_names_and_levels_of_the_model(model):
    assert offered("simulate", model, "--set", "") == {"mass=": "in kg", "push=": "input"}
    assert offered("simulate", model, "--level", "P") == {"P=stiff": "as it is", "P=soft": "part"}
    assert set(offered("simulate", model, "--model", "")) == {"m"}


def test_topics_components_and_codes():
    assert set(offered("help", "un")) == {"units"}
    assert offered("std", "resis")["resistor"] == "Ohm's law."
    assert set(offered("explain", "E20")) == {f"E20{k}" for k in range(1, 10)}


@pytest.mark.parametrize("file", ["nothing.sd", "broken.sd"])
def test_what_cannot_be_read_offers_nothing(tmp_path, file):
    (tmp_path / "broken.sd").write_text("model m { node }")
    assert offered("simulate", file, "--scene", "") == {}
    assert offered("simulate", file, "--set", "") == {}


@pytest.mark.long
def test_the_script_for_a_shell(tmp_path):
    command = [sys.executable, "-c", "from sysdyn.cli.main import main; main()"]
    env = {"_SYSDYN_COMPLETE": "zsh_source", "PATH": "/usr/bin:/bin", "HOME": str(tmp_path)}
    ran = subprocess.run(command, capture_output=True, text=True, timeout=60, env=env, check=False)
    assert ran.returncode == 0
    assert "compdef" in ran.stdout
