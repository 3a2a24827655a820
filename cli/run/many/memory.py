"""Pages that a command's arrays leave stay with its process, for the next arrays.

The C library gives each large array's pages back to the system and asks for new ones, empty, for the next: at a million
sections that was half of the CPU time to the first step (18.9 s of 34.9; 9.4 s of 25 so).  But gaps between arrays
are memory too, a sixth of all: where a model is huge its arrays have pages of their own again (`System.trim`).
"""

from __future__ import annotations

from contextlib import suppress

from sysdyn.dsl.model.collecting import is_keeping

TRIM_THRESHOLD, MMAP_MAX = -1, -4
"""Of malloc.h: how much free memory at the heap's end goes back (-1: none), how many arrays have pages of their own."""


def keep_pages() -> None:
    """Where the process ends with its command, and its C library has such a choice (glibc's mallopt)."""
    if not is_keeping():
        return
    import ctypes

    with suppress(OSError, AttributeError, TypeError):
        library = ctypes.CDLL(None)
        library.mallopt(TRIM_THRESHOLD, -1)
        library.mallopt(MMAP_MAX, 0)
