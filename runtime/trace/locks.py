"""Locks of whole files: they die with their process, and where the system has none (Windows) nothing is refused."""

from __future__ import annotations

import errno

try:
    import fcntl
except ImportError:
    fcntl = None  # type: ignore[assignment]

_NO_LOCKS = (errno.ENOLCK, errno.ENOTSUP, errno.ENOSYS, errno.EINVAL)


def lock(handle: int) -> bool:
    """Whether the file is locked now; False: locks do not work here.  BlockingIOError where another process has it."""
    # Windows
    if fcntl is None:
        return False
    try:
        fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError as error:
        # a file system without locks
        if error.errno in _NO_LOCKS:
            return False
        raise
    return True


def unlock(handle: int) -> None:
    """Lets go of it."""
    if fcntl is not None:
        fcntl.flock(handle, fcntl.LOCK_UN)
