"""Checks in processes of their own: one that is killed costs its own result and no other."""

from __future__ import annotations

import json
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor, as_completed
from pathlib import Path
from typing import Any

from sysdyn.cli.golden.book import Golden
from sysdyn.cli.golden.checking import INPUT_OUTPUT, Case


def in_processes(goldens: Sequence[Golden], root: Path, options: Sequence[str], jobs: int) -> Iterator[list[Case]]:
    """The cases of each golden as they come in; options: of `golden check` for all of them."""
    with ThreadPoolExecutor(jobs) as pool:
        waiting = [pool.submit(_one, golden, root, options) for golden in goldens]
        try:
            for done in as_completed(waiting):
                yield done.result()
        except BaseException:
            for future in waiting:
                future.cancel()
            raise


def _one(golden: Golden, root: Path, options: Sequence[str]) -> list[Case]:
    began = time.monotonic()
    with tempfile.TemporaryFile("w+b") as output:
        command = [sys.executable, "-m", "sysdyn.cli", "golden", "check", golden.label, "--folder", str(root)]
        ran = subprocess.run(
            [*command, "--json", "--pages", *options], stdout=output, stderr=subprocess.PIPE, check=False
        )
        output.seek(0)
        try:
            cases = json.loads(output.read())["result"]["checks"]
            return [_case(item) for item in cases]
        except (ValueError, KeyError, TypeError):
            pass
    last = (ran.stderr.decode("utf-8", "replace").strip().splitlines() or ["it said nothing"])[-1]
    how = f"was killed by signal {-ran.returncode}" if ran.returncode < 0 else f"ended with exit {ran.returncode}"
    message = f"the check {how}: {last}"
    seconds = time.monotonic() - began
    wrong = (("run", message),)
    code = ran.returncode if ran.returncode > 1 else INPUT_OUTPUT
    return [Case(golden.label, "", "", "", code, message, float("inf"), None, None, seconds, wrong)]


def _case(item: dict[str, Any]) -> Case:
    known = {name: item[name] for name in Case.__slots__ if name in item}
    known["cases"] = tuple((name, text) for name, text in known["cases"])
    known["ratio"] = float("inf") if known["ratio"] is None else known["ratio"]
    return Case(**known)
