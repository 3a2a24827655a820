"""Every sign and index mutant of the lowering against `sysdyn verify`: python tests/mutation/run.py [options]

A mutant is dead where verify (or the compiler) refuses one of the MODELS.  At least 95 % must die; survivors are listed.
Options: --sample N (every so many that about N remain), --jobs N, --only FILE, --at LINE.  About four seconds a mutant.
"""

from __future__ import annotations

import argparse
import os
import shutil
import subprocess
import sys
import tempfile
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))
from mutants import Mutant, mutants

ROOT = Path(__file__).resolve().parents[2]
ROOMS = ("dsl", "compiler", "runtime", "cli", "models")
LOWERING = (
    "lowering.py", "kane.py", "momenta.py", "integration.py", "audit.py", "mirror.py", "reflection.py",
    "primal/balances.py", "primal/laws.py", "primal/series.py", "primal/potentials.py", "primal/reading.py",
    "primal/contents.py",
)  # fmt: skip
MODELS = (
    "seed/dc_motor", "seed/knife_edge", "seed/pendulum", "seed/lead_filter", "seed/two_link_arm", "seed/bead_rod",
    "seed/electrical_transformer", "seed/lcr_nonlinear", "seed/relativistic_mass", "seed/rack_pinion",
    "seed/fluid_transformer", "seed/em_suspension", "seed/transactor_vcvs", "seed/pi_controller", "seed/co_circuit",
    "seed/diode_circuit", "seed/two_tank", "mutation/ladder", "mutation/charges", "mutation/rolling",
)  # fmt: skip
TARGET = 0.95
DRIVER = """
import sys
from sysdyn.cli.main import run
for model in sys.argv[1:]:
    try:
        code = run(["verify", "-q", "--progress", "never", "--max-wall", "20", model])
    except BaseException as error:
        code = 4
    if code:
        print(model, code, file=sys.stderr)
        sys.exit(1)
"""


def tree(folder: Path) -> Path:
    """A copy of the package in a folder of its own."""
    package = folder / "sysdyn"
    for room in ROOMS:
        shutil.copytree(ROOT / room, package / room, ignore=shutil.ignore_patterns("__pycache__"))
    (package / "cli" / "api").rename(package / "api")
    return package


def killed(package: Path, cache: Path, limit: float = 240.0) -> str:
    """The model at which verify failed; "" where all pass."""
    places = [
        str(Path(__file__).parent / f"{m.removeprefix('mutation/')}.sd" if m.startswith("mutation/")
            else ROOT / "models" / f"{m}.sd")
        for m in MODELS
    ]  # fmt: skip
    environment = {**os.environ, "PYTHONPATH": str(package.parent), "SYSDYN_CACHE": str(cache)}
    environment["PYTHONDONTWRITEBYTECODE"] = "1"
    command = [sys.executable, "-c", DRIVER, *places]
    try:
        ran = subprocess.run(command, capture_output=True, text=True, env=environment, timeout=limit, check=False)
    except subprocess.TimeoutExpired:
        return "time"
    return "" if ran.returncode == 0 else (ran.stderr.strip().splitlines() or ["?"])[-1]


def main() -> int:
    parser = argparse.ArgumentParser()
    parser.add_argument("--sample", type=int)
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--only")
    parser.add_argument("--at", type=int)
    options = parser.parse_args()
    found: list[tuple[str, Mutant]] = [
        (name, m)
        for name in LOWERING
        if options.only in (None, name)
        for m in mutants((ROOT / "compiler" / name).read_text())
        if options.at in (None, m.line)
    ]
    step = max(1, len(found) // options.sample) if options.sample else 1
    found = found[::step]
    with tempfile.TemporaryDirectory() as scratch:
        clean = tree(Path(scratch) / "clean")
        broken = killed(clean, Path(scratch) / "cache")
        if broken:
            print(f"the models do not pass without a mutant: {broken}")
            return 2
        began, survivors = time.monotonic(), []

        def one(number: int) -> tuple[int, str]:
            name, mutant = found[number]
            folder = Path(scratch) / f"m{number}"
            package = tree(folder)
            text = "import sysdyn.dsl.expression as ex_\n"
            head, mark, rest = mutant.text.partition("from __future__ import annotations\n")
            (package / "compiler" / name).write_text(head + mark + text + rest if mark else text + mutant.text)
            verdict = killed(package, Path(scratch) / "cache")
            shutil.rmtree(folder)
            return number, verdict

        with ThreadPoolExecutor(options.jobs) as pool:
            for done, (number, verdict) in enumerate(pool.map(one, range(len(found))), 1):
                name, mutant = found[number]
                if not verdict:
                    survivors.append((name, mutant))
                    print(f"\rsurvives: compiler/{name}:{mutant.line}: {mutant.what}", flush=True)
                left = (time.monotonic() - began) / done * (len(found) - done)
                print(f"\r{done} of {len(found)}, {len(survivors)} survive, {left:.0f} s left ", end="", file=sys.stderr)
    dead = 1.0 - len(survivors) / max(len(found), 1)
    print(f"\n{len(found)} mutants, {100 * dead:.1f} % dead")
    return 0 if dead >= TARGET else 1


if __name__ == "__main__":
    sys.exit(main())
