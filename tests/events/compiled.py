"""References in C beside the tests, compiled once a process: others compile their own."""

import ctypes as c
import subprocess
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory


@cache
def library(name: str) -> c.CDLL:
    """That of tests/events/<name>.c."""
    with TemporaryDirectory() as folder:
        file = Path(folder) / f"{name}.so"
        source = Path(__file__).with_name(f"{name}.c")
        subprocess.run(["gcc", "-O2", "-shared", "-fPIC", str(source), "-o", str(file), "-lm"], check=True)
        return c.CDLL(str(file))
