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
UNFOLDED = 100_000
"""Nodes that a text of any length may unfold to, each some 50 us in all stages (models that people wrote: below 4000);
an expansion or an instance counts as many as its bytes do."""
FOLLOWING = 4
"""More of them for each character of the text, since what is written out is long by right (a line of a netlist: 1)."""
DEEPEST = 1000
"""Definitions that read each other, or components in each other: each level takes some ten frames of Python's stack, of
which `depth.FRAMES` may be (chains in models that people wrote: below 30)."""
NUMBER = 16
"""Bytes of an element of a parameter."""

_GROUP = Path("/sys/fs/cgroup/memory.max")


class _Budget(threading.local):
    """What is left of it in a thread: bytes, and what a text may unfold to."""

    def __init__(self) -> None:
        self.left = math.inf
        self.pieces = math.inf


_budget = _Budget()


class SpentError(Exception):
    """The budget is spent; what: what the last charge was for; place: of the statement that asked, where known."""

    def __init__(self, what: str) -> None:
        super().__init__(what)
        self.what = what
        self.place: Place | None = None

    def diagnostic(self, place: Place) -> Diagnostic:
        """E119, at the statement or at `place`."""
        message = f"{self.what}: more than the {format_bytes(memory_limit())} that one model may take"
        return Diagnostic("E119", message, self.place or place, help="fewer of them, or a loop over an array")


class TooManyError(SpentError):
    """A text unfolds to more than one of its length may."""

    def diagnostic(self, place: Place) -> Diagnostic:
        """E119, at the statement or at `place`."""
        message = (
            f"{self.what}: more than the {UNFOLDED} pieces, and {FOLLOWING} a character, that a text may unfold to"
        )
        help_ = "values that are used again as states or implicit unknowns, a loop over an array"
        return Diagnostic("E119", message, self.place or place, help=help_)


class TooDeepError(SpentError):
    """What a text asks for lies within each other deeper than it can be unfolded."""

    def diagnostic(self, place: Place) -> Diagnostic:
        """E119, at the statement or at `place`."""
        help_ = "fewer of them in a row; elements of an array that follow each other are a loop"
        message = f"{self.what} within each other more than {DEEPEST} deep"
        return Diagnostic("E119", message, self.place or place, help=help_)


def memory_limit() -> int:
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


def format_bytes(amount: float) -> str:
    """An amount of memory for a reader."""
    for unit, size in (("TB", 1e12), ("GB", 1e9), ("MB", 1e6)):
        if amount >= size:
            return f"{amount / size:.3g} {unit}"
    return f"{amount / 1e3:.3g} kB"


@contextmanager
def drawn(text: str) -> Iterator[None]:
    """A stage that draws on the budget of a text; a stage inside another draws on that one's.

    Where Python's stack ends the budget has ended too: the one place that hears of it.
    """
    before = _budget.left, _budget.pieces
    if before[0] == math.inf:
        _budget.left, _budget.pieces = memory_limit(), UNFOLDED + FOLLOWING * len(text)
    try:
        yield
    except RecursionError:  # expressions in definitions: together deeper than either may be
        raise TooDeepError("definitions, expressions and components are") from None
    finally:
        _budget.left, _budget.pieces = before


def check_depth(depth: int, what: str) -> None:
    """Count a level before it unfolds; TooDeepError where it is too deep."""
    if depth > DEEPEST:
        raise TooDeepError(what)


def charge(amount: float, what: str) -> None:
    """Draw an amount (bytes) for something; SpentError where that is more than is left."""
    _budget.left = left = _budget.left - amount
    if left < 0:
        raise SpentError(what)


def unfold(amount: float, what: str) -> None:
    """Draw for what a text unfolds to: its nodes, and their bytes; SpentError where either is more than is left."""
    _budget.pieces = pieces = _budget.pieces - amount / NODE
    if pieces < 0:
        raise TooManyError(what)
    charge(amount, what)
