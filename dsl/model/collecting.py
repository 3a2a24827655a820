"""No search for cycles of garbage while a text becomes a network, or a network a program: what is made there stays.

Python looks through all that is alive again and again as it grows: half of the time of a netlist of 30000 lines.
"""

from __future__ import annotations

import gc
from collections.abc import Iterator
from contextlib import contextmanager

MANY = 200_000
"""Objects of a long text, of 6000 lines; fewer than a first collection waits for."""
SELDOM = 250_000, 20, 100
"""Objects made, and younger collections, between two collections of cycles: Python's own (700, 10, 10) takes a sixth
of the CPU of a short command, and the first after 50 000, which its imports alone make, a twenty-fifth."""
_keeping = False


@contextmanager
def at_rest() -> Iterator[None]:
    """Without the collector, which goes on as it was behind it."""
    if not gc.isenabled():
        yield
        return
    gc.disable()
    try:
        yield
    finally:
        if gc.get_count()[0] > MANY:
            _grown_old()
        gc.enable()


def _grown_old() -> None:
    """What was made is looked through with the oldest alone, or never: not with what is young, a fifth of a check."""
    if _keeping:
        gc.freeze()
    elif not gc.get_freeze_count():  # what others keep stays so
        gc.freeze()
        gc.unfreeze()


def is_keeping() -> bool:
    """Whether the process ends with its command."""
    return _keeping


def keep() -> None:
    """The process ends with its command: what a long text has become is never looked through for garbage."""
    global _keeping
    _keeping = True
    gc.set_threshold(*SELDOM)
