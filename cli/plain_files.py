"""Files that a command reads without being told to, as others may have put them there: regular ones of bounded size.

A configuration, a golden's book, a lock: received as paths, returned as text or as the tables of TOML.  A pipe would be
waited for, a device has no end, and tables within each other, or dotted keys, cost the square of their depth.
"""

from __future__ import annotations

import os
import re
import stat
from pathlib import Path
from typing import Any

LONGEST = 1_000_000
"""Bytes of such a file: those that people write have some kilobytes."""
DEEPEST = 100
"""Words of a dotted key of TOML: Python's reader takes the square of them (20 000: a minute)."""


class UnfitError(ValueError):
    """A file that is not of the kind that is read here; the message names it and says why."""


def text_of(path: Path) -> str:
    """The text of a regular file of at most LONGEST bytes.  Raises OSError, UnfitError."""
    # a pipe or a device could make the reader wait for ever
    if not stat.S_ISREG(path.stat().st_mode):
        raise UnfitError(f"{path}: no regular file: it is not read")
    handle = os.open(path, os.O_RDONLY | getattr(os, "O_NONBLOCK", 0) | getattr(os, "O_BINARY", 0))
    with os.fdopen(handle, "rb") as stream:
        if not stat.S_ISREG(os.fstat(handle).st_mode):  # another one since
            raise UnfitError(f"{path}: no regular file: it is not read")
        data = stream.read(LONGEST + 1)
    if len(data) > LONGEST:
        raise UnfitError(f"{path}: longer than {LONGEST // 1_000_000} MB: it is not read")
    try:
        return data.decode("utf-8")
    except UnicodeDecodeError as error:
        raise UnfitError(f"{path}: {error}") from None


def tables(path: Path, text: str | None = None) -> dict[str, Any]:
    """The tables of a TOML file; text: what stands there, where it was read before.  Raises OSError, UnfitError."""
    import tomllib

    text = text_of(path) if text is None else text
    if "a." * DEEPEST in re.sub(r"[^.,=\[\]{}#\n]+", "a", text):
        raise UnfitError(f"{path}: a key of more than {DEEPEST} words")
    try:
        return tomllib.loads(text)
    except RecursionError:
        raise UnfitError(f"{path}: lists or tables are nested too deep") from None
    except ValueError as error:  # what is no TOML, and numbers of thousands of digits
        raise UnfitError(f"{path}: {error}") from None


def inside(path: str | os.PathLike[str], folder: Path) -> bool:
    """Whether a path, links followed, stays inside a folder."""
    try:
        return Path(os.path.realpath(path)).is_relative_to(os.path.realpath(folder))
    except ValueError:  # a NUL in it
        return False


def project(folder: Path) -> Path:
    """The folder of the project in which another one lies: the nearest that says so, else the one above it."""
    real = Path(os.path.realpath(folder))
    signs = ("sysdyn.toml", "pyproject.toml", ".git")
    return next((above for above in real.parents if any((above / sign).exists() for sign in signs)), real.parent)
