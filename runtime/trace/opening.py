"""Opening a trace that came from elsewhere: one regular file, whose numbers stand in it and nowhere else.

HDF5 can name other files: by external links, by data sets whose raw numbers lie in any file, by virtual data sets.  A
trace that somebody sends could so show the reader's own files; none of these is ever followed.
"""

from __future__ import annotations

import contextlib
import errno
import os
import stat
from pathlib import Path
from typing import Any

from sysdyn.runtime.trace.claim import being_written

PACKED = 100
"""Bytes that one byte of a file may stand for: rows that are packed take a third to a twentieth, while a kilobyte can
claim a data set of a terabyte, which HDF5 fills in as it is read."""
SMALL = 1 << 26
"""Bytes that are never too many."""


def open_regular(path: str | Path, **options: Any) -> Any:
    """The h5py file, open for reading.  OSError where it is no regular file, or names others."""
    import h5py

    regular(path)
    file = h5py.File(path, "r", **options)
    # a file that names others is closed at once
    try:
        _verify_alone(file, os.stat(path).st_size)  # noqa: PTH116
    except BaseException:
        file.close()
        raise
    return file


def regular(path: str | Path) -> None:
    """OSError where the path is a folder, a pipe or a device: reading one may wait for ever."""
    mode = os.stat(path).st_mode  # noqa: PTH116 (a Path's stat says the same)
    # folders, pipes and devices
    if stat.S_ISDIR(mode):
        raise IsADirectoryError(errno.EISDIR, "this is a directory", str(path))
    if not stat.S_ISREG(mode):
        raise OSError(errno.EINVAL, "this is no regular file", str(path))


def destination(path: str | Path) -> Path:
    """The file that a path of a result leads to.  OSError where it is none, or links lead in a circle."""
    with contextlib.suppress(FileNotFoundError):
        regular(path)
    return Path(path).resolve()


def of_sweep(file: Any) -> bool:
    """Whether an open file holds the runs of a sweep."""
    return "sample" in file.attrs and "run" in file


def replaceable(path: str | Path, *, sweep: bool = False) -> bool:
    """Nothing is lost where a new trace (sweep: a new sweep) takes this path: there is nothing yet, an empty file, or
    one of sysdyn of the same kind; or one that a living run writes, which cannot be read at every instant (its claim
    says so: claim.py).  OSError where another program holds it.
    """
    import h5py

    # nothing there, empty, or ours of the same kind
    try:
        if not os.stat(path).st_size:  # noqa: PTH116
            return True
        regular(path)
        with h5py.File(path, "r") as file:
            return _outside_but_parameters(file) is None and _is_ours(file) and of_sweep(file) == sweep
    except FileNotFoundError:
        return True
    # held by another program, or by a run of ours
    except BlockingIOError as error:
        if being_written(Path(path).resolve()):
            return True
        raise OSError(error.errno, "another program holds this file open to write it", str(path)) from error
    # unreadable: ours only while a run writes it
    except (OSError, RuntimeError, ValueError, KeyError, TypeError):
        return being_written(Path(path).resolve())


def _is_ours(file: Any) -> bool:
    source = file.attrs.get("source", b"")
    said = source if isinstance(source, str) else bytes(source).decode("utf-8", "replace")
    return ("time" in file or of_sweep(file)) and said.startswith("sysdyn")


def _outside_but_parameters(file: Any) -> str | None:
    """As `_outside`; parameters, tens of thousands behind a netlist, are left out: nothing is read of what goes."""
    from h5py import h5d, h5g, h5l, h5o

    # links of other kinds, and data that stand elsewhere
    for name in file.id:
        kind = file.id.links.get_info(name).type
        item = h5o.open(file.id, name) if kind == h5l.TYPE_HARD and name != b"parameters" else None
        inner = _outside(item, [0]) if isinstance(item, h5g.GroupID) else None
        own = kind not in (h5l.TYPE_HARD, h5l.TYPE_SOFT) or (isinstance(item, h5d.DatasetID) and _elsewhere(item))
        if inner or own:
            return inner or _shown_name(name)
    return None


def _verify_alone(file: Any, size: int) -> None:
    """OSError where a link or a data set leads out of the file, or where its data sets claim far more numbers than a
    file of this size [bytes] holds; nothing is followed or read on the way.
    """
    claimed = [0]
    outside = _outside(file.id, claimed)
    if outside is not None:
        raise OSError(f"'{outside}' leads to another file: not followed")
    # a file that claims more than it can hold
    if claimed[0] > PACKED * size + SMALL:
        raise OSError(f"its {size} bytes claim to hold {claimed[0]:.3g}: it is damaged")


def _outside(group: Any, claimed: list[int]) -> str | None:
    """The first link or data set below a group that leads out of the file; claimed: grows by the bytes of the data."""
    from h5py import h5l, h5o

    # soft and hard links stay inside
    def link(name: bytes, info: Any) -> str | None:
        return None if info.type in (h5l.TYPE_HARD, h5l.TYPE_SOFT) else _shown_name(name)

    def data(name: bytes, info: Any) -> str | None:
        if info.type != h5o.TYPE_DATASET:
            return None
        found = h5o.open(group, name)
        claimed[0] += int(found.get_space().get_simple_extent_npoints()) * int(found.get_type().get_size())
        return _shown_name(name) if _elsewhere(found) else None

    linked: str | None = group.links.visit(link, info=True)
    stored: str | None = linked or h5o.visit(group, data, info=True)
    return stored


def _elsewhere(data: Any) -> bool:
    """Whether a data set's numbers lie in another file."""
    from h5py import h5d

    layout = data.get_create_plist()
    return bool(layout.get_layout() == h5d.VIRTUAL or layout.get_external_count())


def _shown_name(name: bytes) -> str:
    return name.decode("utf-8", "replace")
