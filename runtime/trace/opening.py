"""Opening a trace that came from elsewhere: one regular file, whose numbers stand in it and nowhere else.

HDF5 can name other files: by external links, by data sets whose raw numbers lie in any file, by virtual data sets.  A
trace that somebody sends could so show the reader's own files; none of these is ever followed.
"""

from __future__ import annotations

import errno
import os
import stat
from pathlib import Path
from typing import Any


def opened(path: str | Path, **options: Any) -> Any:
    """The h5py file, open for reading.  OSError where it is no regular file, or names others."""
    import h5py

    regular(path)
    file = h5py.File(path, "r", **options)
    try:
        _alone(file)
    except BaseException:
        file.close()
        raise
    return file


def regular(path: str | Path) -> None:
    """OSError where the path is a folder, a pipe or a device: reading one may wait for ever."""
    mode = os.stat(path).st_mode  # noqa: PTH116 (a Path's stat says the same)
    if stat.S_ISDIR(mode):
        raise IsADirectoryError(errno.EISDIR, "this is a directory", str(path))
    if not stat.S_ISREG(mode):
        raise OSError(errno.EINVAL, "this is no regular file", str(path))


def replaceable(path: str | Path) -> bool:
    """Nothing is lost where a new trace takes this path: there is nothing yet, an empty file, or a trace of sysdyn."""
    try:
        if not os.stat(path).st_size:  # noqa: PTH116
            return True
        with opened(path) as file:
            return "time" in file and bytes(file.attrs.get("source", b"")).startswith(b"sysdyn")
    except FileNotFoundError:
        return True
    except (OSError, RuntimeError, ValueError, KeyError, TypeError):
        return False


def _alone(file: Any) -> None:
    """OSError where a link or a data set leads out of the file; nothing is followed on the way."""
    from h5py import h5d, h5l, h5o

    def link(name: bytes, info: Any) -> str | None:
        return None if info.type in (h5l.TYPE_HARD, h5l.TYPE_SOFT) else _shown(name)

    def data(name: bytes, info: Any) -> str | None:
        if info.type != h5o.TYPE_DATASET:
            return None
        layout = h5o.open(file.id, name).get_create_plist()
        return _shown(name) if layout.get_layout() == h5d.VIRTUAL or layout.get_external_count() else None

    outside = file.id.links.visit(link, info=True)
    if outside is None:
        outside = h5o.visit(file.id, data, info=True)
    if outside is not None:
        raise OSError(f"'{outside}' leads to another file: not followed")


def _shown(name: bytes) -> str:
    return name.decode("utf-8", "replace")
