"""Standard streams: closed before the program began (writing is an error, not silence), or left by their reader."""

from __future__ import annotations

import contextlib
import errno
import io
import os
import sys
from collections.abc import Iterator

NAMES = {
    "stdin": "the standard input stream",
    "stdout": "the standard output stream",
    "stderr": "the standard error stream",
}


class Closed(io.TextIOBase):
    """Nothing can be read from it or written to it: OSError, but for nothing."""

    def __init__(self, name: str) -> None:
        self.name = name

    def write(self, text: str) -> int:
        """0 of an empty text; else OSError."""
        if text:
            raise OSError(errno.EBADF, f"{self.name} is closed")
        return 0

    def read(self, size: int | None = -1, /) -> str:
        """OSError."""
        raise OSError(errno.EBADF, f"{self.name} is closed")

    @property
    def buffer(self) -> Closed:
        """Bytes can be neither."""
        return self


@contextlib.contextmanager
def standing_streams() -> Iterator[None]:
    """Closed streams stand as such: `print` would take the other one's place for them, or be silent."""
    closed = [name for name in NAMES if getattr(sys, name) is None]
    for name in closed:
        setattr(sys, name, Closed(NAMES[name]))
    try:
        yield
    finally:
        for name in closed:
            setattr(sys, name, None)


def silence(name: str = "stdout") -> None:
    """Python flushes standard streams at exit: give one that nobody reads any more a place that takes it."""
    setattr(sys, name, open(os.devnull, "w", encoding="utf-8"))  # noqa: SIM115, PTH123


def put(data: str | bytes, name: str = "stdout") -> None:
    """Write to a standard stream; where its reader went away the rest is left out, and the exit is what it would be."""
    stream = getattr(sys, name)
    try:
        (stream if isinstance(data, str) else stream.buffer).write(data)
    except BrokenPipeError:
        silence(name)


def flush() -> None:
    """What a full disk refuses is found here, not at exit; a reader that went away is as for `put`."""
    for name in ("stdout", "stderr"):
        try:
            getattr(sys, name).flush()
        except BrokenPipeError:
            silence(name)
