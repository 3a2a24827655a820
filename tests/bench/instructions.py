"""What a step of the bdf costs in instructions: python tests/bench/instructions.py [--halves H] [FAMILY...]

Ours beside IDA on the text that `sysdyn compile` writes of the same model (peers/peer.c), dense and KLU, two policies
of refactoring: instructions that callgrind (valgrind) counts within the steps, over accepted steps, at a tolerance of
10^(-H/2).  A count does not depend on what else the machine does.  Without valgrind or SUNDIALS (Debian: valgrind,
libsundials-dev, libsuitesparse-dev) it says so.
"""

from __future__ import annotations

import argparse
import re
import shutil
import subprocess
import sys
import tempfile
from dataclasses import replace
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))
from measuring import Bench
from race import LARGE, POLICIES, Peers

FAMILIES = ("pendulum", "andrews", "crank")
KNOWN = "-march=haswell"
"""What callgrind knows of a processor."""


def counted(function: str, command: list[str]) -> tuple[int, str]:
    """Instructions within a function and what it calls, and what the command printed."""
    with tempfile.TemporaryDirectory() as folder:
        tool = ["valgrind", "--tool=callgrind", f"--callgrind-out-file={folder}/out", f"--toggle-collect={function}"]
        done = subprocess.run([*tool, *command], capture_output=True, text=True, check=True)
    found = re.search(r"Collected : (\d+)", done.stderr)
    assert found, done.stderr[-500:]
    return int(found[1]), done.stdout


def steps_of(family: str, halves: int) -> int:
    """Accepted steps of one integration by our bdf, which writes its first and its last row."""
    with tempfile.TemporaryDirectory() as folder:
        bench = Bench(f"benchmark/{family}", Path(folder))
        bench.options = replace(bench.options, every=bench.options.t_end - bench.options.t_start)
        run = bench.run(1, accuracy=None, rtol=10.0 ** (-0.5 * halves), method="bdf")
    assert run is not None
    return run.steps


def ours(family: str, halves: int) -> float:
    """Instructions an accepted step."""
    number, said = counted("sd_bdf_step", [sys.executable, __file__, "--one", "--halves", str(halves), family])
    return number / int(said)


def theirs(peers: Peers, family: str, index: str, halves: int) -> tuple[float, str]:
    """The fewest instructions an accepted step, and of which settings."""
    end = Bench(f"benchmark/{family}", peers.folder).options.t_end
    built = peers.build(family, index)
    assert built is not None
    program, n, _ = built
    found = []
    for linear in (kind for kind, fits in (("dense", n <= LARGE), ("klu", True)) if fits):
        for policy in POLICIES[:2]:
            command = [str(program), "ida", linear, *policy, repr(end), "100", str(halves)]
            number, said = counted("IDASolve", command)
            flag, steps = (int(item) for item in said.split()[1:3])
            if flag >= 0:
                found.append((number / steps, f"{linear} {' '.join(policy)}"))
    return min(found)


def main() -> None:
    """One row a family."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--halves", type=int, default=12)
    parser.add_argument("--one", action="store_true", help=argparse.SUPPRESS)
    parser.add_argument("family", nargs="*", default=FAMILIES)
    given = parser.parse_args()
    if given.one:
        print(steps_of(given.family[0], given.halves))
        return
    if not shutil.which("valgrind"):
        sys.exit("valgrind is missing (Debian: valgrind)")
    with tempfile.TemporaryDirectory() as folder:
        peers = Peers(Path(folder), KNOWN)
        if peers.missing:
            sys.exit(peers.missing)
        print(f"{'family':12s} {'ours':>9s} {'ida':>9s}  ratio  settings")
        for family in given.family:
            own = ours(family, given.halves)
            other, who = theirs(peers, family, "auto", given.halves)
            print(f"{family:12s} {own:9.0f} {other:9.0f}  {other / own:5.2f}  {who}", flush=True)


if __name__ == "__main__":
    main()
