"""A process that may not take what numpy needs to load is told so, before numpy's own libraries end it in their way."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from importlib.machinery import ModuleSpec
from types import ModuleType

LEAST = 170_000 * 1024
"""Bytes of address space that numpy's linear algebra and HDF5 take to load, on one thread: below, OpenBLAS exits with a
message of its own and a code that means something else.
"""


class TooLittle:
    """Stands before numpy where the limit is below what it needs."""

    def __init__(self, limit: int) -> None:
        self.limit = limit

    def find_spec(
        self, name: str, _path: Sequence[str] | None = None, _target: ModuleType | None = None
    ) -> ModuleSpec | None:
        """MemoryError for numpy; nothing is known of other modules."""
        if name == "numpy":
            need, most = (round(bytes_ / 1024**2) for bytes_ in (LEAST, self.limit))
            raise MemoryError(f"numpy needs {need} MB, {most} MB are allowed (ulimit -v)")
        return None


def stand_before_numpy() -> None:
    """Where the address space of this process is limited below LEAST."""
    try:
        import resource
    except ImportError:  # a system without such limits
        return
    limit, _ = resource.getrlimit(resource.RLIMIT_AS)
    if limit != resource.RLIM_INFINITY and limit < LEAST and "numpy" not in sys.modules:
        sys.meta_path.insert(0, TooLittle(limit))
