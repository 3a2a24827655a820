"""Pairs of signals at random moments of a run: python tests/fuzz/signals.py [--cases N] [--seed S]

Two of SIGINT, SIGTERM and SIGHUP, up to 50 ms apart, reach a run that would not end.  It has failed where it does not
end by itself within PATIENCE seconds, by another exit than 130 (or the signal's own death, before Python stands), shows
a traceback, or leaves anything but its trace.
"""

from __future__ import annotations

import argparse
import os
import random
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path

PATIENCE = 30.0
APART = 0.05
LATEST = 2.0
"""Seconds after which the first signal has been sent; a run stands after half of them."""
TEXT = """model swing {
  coord x: translation = 1 m
  energy T* = 1/2*(1 kg)*x'^2
  energy V = 1/2*(1e4 N/m)*x^2
}
scene s of swing {
  time 0 s to 1e5 s
  trace x every 1 s
}
"""
SENT = tuple(getattr(signal, name) for name in ("SIGINT", "SIGTERM", "SIGHUP") if hasattr(signal, name))


def wrong(chance: random.Random) -> str | None:
    """What was wrong with one run; None where nothing was."""
    with tempfile.TemporaryDirectory() as folder:
        (Path(folder) / "m.sd").write_text(TEXT)
        command = [sys.executable, "-m", "sysdyn", "simulate", "-q", "m.sd", "-o", "m.h5", "--max-wall", "60"]
        run = subprocess.Popen(command, cwd=folder, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
        first, second = chance.choice(SENT), chance.choice(SENT)
        at, apart = chance.uniform(0.3, LATEST), chance.uniform(0.0, APART)
        time.sleep(at)
        run.send_signal(first)
        time.sleep(apart)
        run.send_signal(second)
        try:
            _, said = run.communicate(timeout=PATIENCE)
        except subprocess.TimeoutExpired:
            run.kill()
            run.communicate()
            return f"{first.name} at {at:.3f} s, {second.name} {apart:.3f} s later: it does not end"
        left = sorted({path.name for path in Path(folder).iterdir()} - {"m.sd", "m.h5"})
        ends = (130, -first, -second)
        if run.returncode in ends and not left and "Traceback" not in said:
            return None
        what = f"exit {run.returncode}, left {left}: {said[-500:]}"
        return f"{first.name} at {at:.3f} s, {second.name} {apart:.3f} s later: {what}"


def failures(cases: int, seed: str) -> Iterator[str]:
    """What was wrong with runs, as they come."""
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    for number in range(cases):
        found = wrong(random.Random(f"{seed} {number}"))
        if found is not None:
            yield f"{seed} {number}: {found}"


def main() -> int:
    """Exit 1 where a run failed."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--cases", type=int, default=100)
    parser.add_argument("--seed", default="signals")
    options = parser.parse_args()
    count = 0
    for found in failures(options.cases, options.seed):
        print(found, flush=True)
        count += 1
    print(f"{options.cases} pairs of signals, {count} failed")
    return 1 if count else 0


if __name__ == "__main__":
    sys.exit(main())
