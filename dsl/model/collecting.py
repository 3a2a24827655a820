"""No search for cycles of garbage while a text becomes a network, or a network a program: what is made there stays.

Python looks through all that is alive again and again as it grows: half of the time of a netlist of 30000 lines.
"""

from __future__ import annotations

import gc
from collections.abc import Iterator
from contextlib import contextmanager


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
        gc.enable()
