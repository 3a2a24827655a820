"""Texts of the command line's tests, and how they run."""

import json
import os
import subprocess
import sys
from pathlib import Path

from sysdyn.cli.main import run

ROOT = Path(__file__).resolve().parents[2]

LADDER = """
from std.electrical import resistor, capacitor, voltage
model ladder {
  param Rr = 1 kohm
  param n = 3
  node v[0..n]: electrical
  V: voltage(v = 1 V) v[0]
  for i in 1..n {
    R[i]: resistor(R = Rr) v[i-1] -> v[i]
    C[i]: capacitor(C = 1 uF) v[i]
    init C[i].e = 0 V
  }
  require Rr < 10 kohm
}
scene s of ladder { time 0 s to 1 ms; trace v[n].e as out }
"""

PENDULUM = """\
model pendulum {
  param m = 1.13 kg
  param l = 2.34 m
  coord x: translation = 1 m
  coord y: translation ~ -2.1 m
  energy T* = 1/2*m*(x'^2 + y'^2)
  energy V = m*g0*y
  phi rod: x^2 + y^2 = l^2
  init x' = 0 m/s
}

scene swing of pendulum {
  time 0 s to 1 s
  trace x, y in mm, x' as speed every 10 ms
  expect always: abs(audit.energy) <= 1 J
}
"""

ARRAY = """\
model spring_row {
  param n = 3
  param m[1..n] = 1 kg
  param k = 2 N/m
  input push: N = 0 N
  coord x[1..n]: translation
  energy T* = sum(i in 1..n: 1/2*m[i]*x[i]'^2)
  energy V = sum(i in 1..n: 1/2*k*x[i]^2)
  for i in 1..n {
    init x[i] = i*1 cm
    init x[i]' = 0 m/s
  }
  work push on x[1]
}

scene ring of spring_row {
  time 0 s to 1 s
  trace x[1], x[n] as last every 50 ms
}
"""

TWO_SCENES = PENDULUM + "scene again of pendulum {\n  time 0 s to 2 s\n  trace x\n}\n"

BROKEN = PENDULUM.replace("= l^2", "= l")

FAILING = PENDULUM.replace("  expect always: abs(audit.energy) <= 1 J", "  expect finally: x == 3 m within 1 mm")

ENDLESS = PENDULUM.replace("time 0 s to 1 s", "time 0 s to 1e6 s").replace(" every 10 ms", "")
"""Runs for minutes: for interruptions."""

STUCK = """\
model blow_up {
  state z: 1 = 1
  dynamic z' = z^2*1 Hz
}

scene beyond of blow_up {
  time 0 s to 2 s
  trace z
}
"""
"""z = 1/(1 s - t): no solver passes 1 s."""


def write(folder, text, name="model.sd"):
    """A model file."""
    path = Path(folder) / name
    path.write_text(text, encoding="utf-8")
    return str(path)


def run_json(capsys, *arguments):
    """(exit code, the JSON object) of a command in this process."""
    capsys.readouterr()
    code = run([*arguments, "--json"])
    out = capsys.readouterr().out
    found = json.loads(out)
    assert out.count("\n") == 1
    assert found["exit"] == code
    return code, found


def environment(**changes):
    """This process's environment with changes; None takes a name away."""
    found = {**os.environ, **{k: v for k, v in changes.items() if v is not None}}
    return {k: v for k, v in found.items() if changes.get(k, "") is not None}


def process(*arguments, **options):
    """The command in a process of its own."""
    defaults = {"capture_output": True, "text": True, "timeout": 120, "check": False, "stdin": subprocess.DEVNULL}
    if "input" in options:
        del defaults["stdin"]
    return subprocess.run([sys.executable, "-m", "sysdyn.cli", *arguments], **{**defaults, **options})  # noqa: PLW1510
