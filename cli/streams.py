"""Standard streams that were closed before the program began: writing to one is an error, not silence."""

from __future__ import annotations

import contextlib
import errno
import io
import sys
from collections.abc import Iterator

NAMES = {"stdout": "the standard output stream", "stderr": "the standard error stream"}


class Closed(io.TextIOBase):
    """Nothing can be written to it: OSError, but for nothing."""

    def __init__(self, name: str) -> None:
        self.name = name

    def write(self, text: str) -> int:
        """0 of an empty text; else OSError."""
        if text:
            raise OSError(errno.EBADF, f"{self.name} is closed")
        return 0

    @property
    def buffer(self) -> Closed:
        """Bytes cannot be written either."""
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
