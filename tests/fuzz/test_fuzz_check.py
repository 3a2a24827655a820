"""The whole of `check`, its start included, on mutated models: no fault, no hang, nothing but findings on the streams.

A slice; SYSDYN_LONG=1 takes 20000 texts.  What failed once is kept in `kept/`, and stays a finding with a place.
"""

import os
import subprocess
import sys
from pathlib import Path

import pytest

RUN = Path(__file__).parent / "run.py"
CAMPAIGN = Path(__file__).parent / "campaign.py"
KEPT = Path(__file__).parent / "kept"
LONG = bool(os.environ.get("SYSDYN_LONG"))


def fuzz(*options, within):
    """What the runner said, and its exit code."""
    return script(RUN, *options, within=within)


def script(path, *options, within):
    """What a script said, and its exit code."""
    done = subprocess.run(
        [sys.executable, str(path), *map(str, options)], capture_output=True, text=True, timeout=within, check=False
    )
    return done.returncode, done.stdout + done.stderr


@pytest.mark.long
def test_mutated_models():
    cases = 20_000 if LONG else 24
    code, said = fuzz("--cases", cases, "--jobs", 2, "--seed", "ci", within=200 if not LONG else 6 * 3600)
    assert code == 0, said
    assert said.endswith(f"{cases} texts, 0 failed\n")


@pytest.mark.long
def test_what_failed_once():
    files = sorted(KEPT.glob("*.sd"))[:: 1 if LONG else 12]
    assert files
    code, said = fuzz(*(option for path in files for option in ("--file", path)), "--jobs", 2, within=200)
    assert code == 0, said
    assert said.endswith(f"{len(files)} texts, 0 failed\n")


@pytest.mark.skipif(os.name != "posix", reason="forks")
@pytest.mark.long
def test_hostile_input_to_every_door():
    code, said = script(CAMPAIGN, *(() if LONG else ("--cases", 2)), "--seed", "ci", within=8 * 3600)
    assert code == 0, said
    assert said.count(" cases, 0 failed\n") == 6
