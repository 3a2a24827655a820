"""Compiled models kept by their content: a private folder of sealed libraries.

An entry is `model-<key>.so`: a shared library followed by its seal, sha256(key, library), which the loader of ELF files
passes over.  An entry whose seal is not that of its name is none: it is removed and built again, whatever it has
become (cut off, flipped, swapped with another, a folder, a link, a pipe).  A killed machine leaves no half entry: the
bytes are on the disk before the name is.  Beyond LIMIT the entries that were used longest ago go.
"""

from __future__ import annotations

import atexit
import contextlib
import hashlib
import os
import shutil
import stat
import time
from functools import cache
from pathlib import Path

MAGIC = b"sysdyn1\0"
SEAL = len(MAGIC) + hashlib.sha256().digest_size
LIMIT = 512 << 20
"""Bytes of all entries; SYSDYN_CACHE_LIMIT (bytes) says otherwise."""
KEPT = 3600.0
"""Seconds for which an entry just used is never removed: another process may be about to load it."""
_READ = os.O_RDONLY | sum(getattr(os, flag, 0) for flag in ("O_NOFOLLOW", "O_NONBLOCK", "O_BINARY"))
"""As it is, never through a link or a pipe: where the system knows such flags (Windows has others than POSIX)."""


def folder() -> Path:
    """The private folder of compiled models: SYSDYN_CACHE, or sysdyn in XDG_CACHE_HOME or ~/.cache.

    Where it cannot be made, or others could put a library into it, a folder for this process takes its place.
    """
    asked = requested_folder()
    try:
        asked.mkdir(mode=0o700, parents=True, exist_ok=True)
        real = asked.resolve(strict=True)
        private = _mine(real.stat()) and _is_trusted(real.parent.stat())
    except OSError:
        return folder_of_process()
    return asked if private and os.access(asked, os.W_OK) else folder_of_process()


def requested_folder() -> Path:
    """The folder that the environment asks for."""
    own = os.environ.get("SYSDYN_CACHE")
    base = os.environ.get("XDG_CACHE_HOME") or str(Path("~").expanduser() / ".cache")
    return Path(own) if own else Path(base) / "sysdyn"


def limit() -> int:
    """Bytes that all entries may take."""
    try:
        return int(os.environ.get("SYSDYN_CACHE_LIMIT", ""))
    except ValueError:
        return LIMIT


def _mine(found: os.stat_result) -> bool:
    """Only this user can put a file there."""
    if not hasattr(os, "getuid"):  # on Windows a user's folders are private, and modes say nothing
        return True
    return found.st_uid == os.getuid() and not found.st_mode & 0o022


def _is_trusted(parent: os.stat_result) -> bool:
    """Nobody but this user and root can put another folder in its place."""
    if not hasattr(os, "getuid"):
        return True
    if parent.st_uid not in (0, os.getuid()):
        return False
    if parent.st_mode & stat.S_ISVTX:  # in a sticky folder only owners rename
        return True
    shared = parent.st_mode & 0o020 and parent.st_gid != os.getgid()
    return not (parent.st_mode & 0o002 or shared)


@cache
def folder_of_process() -> Path:
    """A folder that lives as long as this process.  OSError where there is none."""
    import tempfile

    made = Path(tempfile.mkdtemp(prefix="sysdyn-"))
    atexit.register(shutil.rmtree, made, ignore_errors=True)
    return made


def path_of(key: str) -> Path:
    """Where the library of a key is kept."""
    return folder() / f"model-{key}.so"


def sound(entry: Path, key: str) -> bool:
    """The entry is a regular file that holds the library which was put there under this key; it counts as used now."""
    try:
        handle = os.open(entry, _READ)
    except OSError:
        return False
    try:
        if not stat.S_ISREG(os.fstat(handle).st_mode):
            return False
        with open(handle, "rb", closefd=False) as file:
            content = file.read()
        if content[-SEAL:] != MAGIC + _digest(key, content[:-SEAL]):
            return False
        with contextlib.suppress(OSError):
            os.utime(handle)
        return True
    except OSError:
        return False
    finally:
        os.close(handle)


def put(library: Path, key: str) -> Path:
    """Seals a library that was just built in a folder beside the entries, and gives it its name in one step."""
    entry = library.parent.parent / f"model-{key}.so"
    with library.open("r+b") as file:
        content = file.read()
        file.write(MAGIC + _digest(key, content))
        file.flush()
        os.fsync(file.fileno())
    if entry.is_dir() and not entry.is_symlink():
        shutil.rmtree(entry)
    library.replace(entry)
    _make_room(entry)
    return entry


def _digest(key: str, content: bytes) -> bytes:
    return hashlib.sha256(key.encode("ascii") + content).digest()


def _make_room(newest: Path) -> None:
    """Removes the entries used longest ago until the rest is within LIMIT; what other processes removed is gone too."""
    most = limit()
    entries = []
    for path in newest.parent.glob("model-*.so"):
        with contextlib.suppress(OSError):
            found = path.lstat()
            entries.append((found.st_mtime, found.st_size, path))
    total, now = sum(size for _, size, _ in entries), time.time()
    for used, size, path in sorted(entries):
        if total <= most:
            return
        if path != newest and now - used > KEPT:
            with contextlib.suppress(OSError):
                path.unlink()
                total -= size
