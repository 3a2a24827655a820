"""What one text may ask to be made: one budget, in bytes, drawn on by whatever grows faster than the text.

Nodes of expressions, expansions of functions, instances of components and elements of arrays are charged what they
take in all stages together.  Half of the machine's memory is granted, at most GRANTED.  Where it is spent the text is
refused (E119) before memory or patience ends.
"""

from __future__ import annotations

import math
import os
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from functools import cache
from pathlib import Path

from sysdyn.dsl.text.diagnostics import Diagnostic, Place

GRANTED = 8 << 30
"""Bytes granted at most."""
NODE = 8 << 10
"""Bytes that a node of an expression takes, its share in derivation and in the compiled text included (measured: 1700
of buses joined at random by 6000 lines; the rest stands for the time that it takes)."""
EXPANSION = 4 * NODE
"""Bytes of one application of a function to arguments of its own."""
INSTANCE = 4 * NODE
"""Bytes of one instance of a component, beside its nodes (measured: 20 kB with them)."""
UNKNOWN = 768
"""Bytes that an element of an unknown takes, with its rows, their pattern and the arrays of a start (measured: 570 of
each node and branch of a line of a million sections)."""
STEPPED = 2 << 10
"""Bytes that an unknown takes in a run, with its share of the factors (measured: 2500 in that line)."""
TERM = 1 << 10
"""Bytes charged for each term of a sum that is added up while the text is read: it takes a microsecond or two."""
NUMBER = 16
"""Bytes of an element of a parameter."""

_GROUP = Path("/sys/fs/cgroup/memory.max")


class _Budget(threading.local):
    """What is left of it in a thread (bytes)."""

    def __init__(self) -> None:
        self.left = math.inf


_budget = _Budget()


class SpentError(Exception):
    """The budget is spent; what: what the last charge was for; place: of the statement that asked, where known."""

    def __init__(self, what: str) -> None:
        super().__init__(what)
        self.what = what
        self.place: Place | None = None

    def diagnostic(self, place: Place) -> Diagnostic:
        """E119, at the statement or at `place`."""
        message = f"{self.what}: more than the {shown(granted())} that one model may take"
        return Diagnostic("E119", message, self.place or place, help="fewer of them, or a loop over an array")


def granted() -> int:
    """Bytes that one text may ask for on this machine."""
    return min(there() // 2, GRANTED)


@cache
def there() -> int:
    """Bytes of memory that this process may take."""
    try:
        import resource
    except ImportError:  # Windows tells neither
        return 2 * GRANTED
    most = os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE")
    limit = resource.getrlimit(resource.RLIMIT_AS)[0]
    if limit != resource.RLIM_INFINITY:
        most = min(most, limit)
    if _GROUP.exists():  # of a container, which ends whoever takes more
        text = _GROUP.read_text().strip()
        most = min(most, int(text)) if text.isdigit() else most
    return most


def shown(amount: float) -> str:
    """An amount of memory for a reader."""
    for unit, size in (("TB", 1e12), ("GB", 1e9), ("MB", 1e6)):
        if amount >= size:
            return f"{amount / size:.3g} {unit}"
    return f"{amount / 1e3:.3g} kB"


@contextmanager
def drawn() -> Iterator[None]:
    """A stage that draws on the budget; a stage inside another draws on that one's."""
    before = _budget.left
    if before == math.inf:
        _budget.left = granted()
    try:
        yield
    finally:
        _budget.left = before


def charge(amount: float, what: str) -> None:
    """Draw an amount (bytes) for something; SpentError where that is more than is left."""
    _budget.left = left = _budget.left - amount
    if left < 0:
        raise SpentError(what)
