"""One run at a time writes a trace: `.NAME.lock` beside it, locked by the process that writes and gone when it ends."""

from __future__ import annotations

import contextlib
import os
from collections.abc import Iterator
from pathlib import Path

from sysdyn.runtime.model.failures import TraceError
from sysdyn.runtime.trace.interruptions import defer_interruptions
from sysdyn.runtime.trace.locks import lock as locked

_OPEN = os.O_RDWR | getattr(os, "O_NOFOLLOW", 0) | getattr(os, "O_CLOEXEC", 0)  # Windows has neither


@contextlib.contextmanager
def claim_trace(path: Path) -> Iterator[None]:
    """Holds the trace at `path` (resolved) for this process.  TraceError where a living run holds it.

    A lock dies with its process, so a killed run leaves none; where locks do not work nothing is refused.
    """
    lock, handle = _lock_of(path), None
    # an interrupt waits until the handle is known
    try:
        try:
            with defer_interruptions():
                handle = _lock_handle(lock)
        except BlockingIOError as error:
            said = "another run is writing this trace: wait for it, or give -o another name"
            raise TraceError(f"{path}: {said}") from error
        except OSError as error:
            raise TraceError(f"{path}: {error.strerror or error}") from error
        yield
    finally:
        # the name goes before the lock: who opens it now gets another file
        if handle is not None:
            with contextlib.suppress(OSError):
                lock.unlink()
            os.close(handle)


def being_written(path: Path) -> bool:
    """Whether a living run holds the trace at `path` (resolved)."""
    try:
        # no lock file: nobody writes
        handle = os.open(_lock_of(path), _OPEN)
    except OSError:
        return False
    try:
        locked(handle)
    except OSError:
        return True
    finally:
        os.close(handle)
    return False


def _lock_of(path: Path) -> Path:
    return path.with_name(f".{path.name}.lock")


def _lock_handle(lock: Path) -> int:
    """A handle of the lock's file; that of a run which just ended may have lost its name meanwhile, then once more."""
    # the file may have been unlinked between open and lock
    while True:
        handle = os.open(lock, _OPEN | os.O_CREAT, 0o600)
        try:
            # no locks here: nothing to hold
            if not locked(handle):
                return handle
        except OSError:
            os.close(handle)
            raise
        # the name still leads to the file that is locked
        with contextlib.suppress(FileNotFoundError):
            if lock.stat().st_ino == os.fstat(handle).st_ino:
                return handle
        os.close(handle)
