"""Waiting for a change of model files: what `check --watch` does between two checks."""

from __future__ import annotations

import time
from collections.abc import Iterable
from pathlib import Path

from sysdyn.cli.failures import UsageError
from sysdyn.cli.run.request import targets

POLL = 0.3
"""Seconds between two looks."""
BESIDE = ("*.sd", "*.csv", "*.txt")
"""Files in the same folder that a text may read: modules and tables."""

Stamps = dict[str, tuple[int, int]]


def stamps(given: Iterable[str]) -> Stamps:
    """(time, size) of the files that arguments name, and of those beside them; what is not there is left out."""
    try:
        named = targets.files(given)
    except UsageError:  # an empty folder may be filled
        named = []
    folders = dict.fromkeys(Path(name).parent for name in named)
    found: Stamps = {}
    for path in (p for folder in folders for pattern in BESIDE for p in folder.glob(pattern)):
        try:
            known = path.stat()
        except OSError:
            continue
        found[str(path)] = known.st_mtime_ns, known.st_size
    return found


def wait_for_change(given: Iterable[str], before: Stamps) -> Stamps:
    """Wait until the files are others than before; how they are now."""
    names = list(given)
    while (now := stamps(names)) == before:
        time.sleep(POLL)
    return now
