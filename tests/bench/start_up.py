"""What a short command costs: python tests/bench/start_up.py [--runs N] [--count] [MODEL...]

User and system CPU of a whole warm `sysdyn simulate` (compiled module and bytecode are there; the command runs twice
before), its children with it: the least and the median of N runs, beside those of Python alone and of `sysdyn
--version`, by turns.  --count: instructions as well (valgrind), which do not depend on what else the machine does.
Bytecode goes to a folder of its own, so that what the environment says of it (PYTHONDONTWRITEBYTECODE) does not count.
"""

from __future__ import annotations

import argparse
import os
import re
import resource
import subprocess
import sys
import tempfile
from pathlib import Path

MODELS = Path(__file__).parents[2] / "models"
WANTED = 0.25
"""CPU seconds of a warm command, at most (issue 17)."""


def cpu(command: list[str], folder: Path, environment: dict[str, str]) -> float:
    """User and system seconds of a command and its children."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    subprocess.run(command, cwd=folder, env=environment, capture_output=True, check=True)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return after.ru_utime - before.ru_utime + after.ru_stime - before.ru_stime


def instructions(command: list[str], folder: Path, environment: dict[str, str]) -> int:
    """Instructions outside the kernel, for one seed of Python's hashes."""
    tool = ["valgrind", "--tool=cachegrind", "--cache-sim=no", "--cachegrind-out-file=/dev/null"]
    done = subprocess.run(
        [*tool, *command],
        cwd=folder,
        env=environment | {"PYTHONHASHSEED": "0"},
        capture_output=True,
        text=True,
        check=True,
    )
    found = re.search(r"I +refs: +([\d,]+)", done.stderr)
    assert found, done.stderr[-500:]
    return int(found[1].replace(",", ""))


def main() -> None:
    """Print one row a command."""
    given = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    given.add_argument("--runs", type=int, default=20)
    given.add_argument("--count", action="store_true")
    given.add_argument("models", nargs="*", default=["gallery/pendulum", "book/lcr_nonlinear"], metavar="MODEL")
    asked = given.parse_args()
    sysdyn = [sys.executable, "-c", "from sysdyn.cli.main import main; main()"]
    commands = {"python": [sys.executable, "-c", "pass"], "--version": [*sysdyn, "--version"]}
    commands |= {name: [*sysdyn, "simulate", str(MODELS / f"{name}.sd")] for name in asked.models}
    with tempfile.TemporaryDirectory() as place:
        folder = Path(place)
        environment = {k: v for k, v in os.environ.items() if k != "PYTHONDONTWRITEBYTECODE"}
        environment["PYTHONPYCACHEPREFIX"] = str(folder / "bytecode")
        for command in [*commands.values()] * 2:
            cpu(command, folder, environment)
        times = [{name: cpu(command, folder, environment) for name, command in commands.items()}
                 for _ in range(asked.runs)]  # fmt: skip
        print(f"{'CPU s':24} {'least':>7} {'median':>7}" + "  10^6 instructions" * asked.count)
        for name, command in commands.items():
            own = sorted(row[name] for row in times)
            row = f"{name:24} {own[0]:7.3f} {own[len(own) // 2]:7.3f}"
            if asked.count:
                row += f"  {1e-6 * instructions(command, folder, environment):17.0f}"
            print(row + "  over what is wanted" * (name in asked.models and own[0] > WANTED))


if __name__ == "__main__":
    main()
