"""Files that commands write: the one at the path is always whole."""

from __future__ import annotations

import contextlib
import os
import threading
from collections.abc import Iterator
from pathlib import Path


@contextlib.contextmanager
def named(path: str | Path) -> Iterator[None]:
    """An OSError within names the file."""
    try:
        yield
    except OSError as error:
        error.filename, error.filename2 = str(path), None
        raise


def write(path: str | Path, data: str | bytes) -> None:
    """Beside the file, then renamed: one that cannot be written leaves what was there.  OSError names the file."""
    content = data.encode("utf-8") if isinstance(data, str) else data
    target = Path(os.path.realpath(path))
    with named(path):
        if target.exists() and not target.is_file():  # a device, a pipe, a folder
            target.write_bytes(content)
        else:
            _replace(target, content)


def _replace(target: Path, content: bytes) -> None:
    part = target.with_name(f".{os.getpid()}-{threading.get_ident()}.part")
    try:
        handle = part.open("wb")
    except PermissionError:
        target.write_bytes(content)  # the folder takes no new file, but this one may be written
        return
    try:
        with handle:
            handle.write(content)
        if target.exists():
            part.chmod(target.stat().st_mode)
        part.replace(target)
    except BaseException:
        part.unlink(missing_ok=True)
        raise
