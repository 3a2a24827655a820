"""What ends a command waits where half of something would be left behind."""

from __future__ import annotations

import contextlib
import signal
import threading
from collections.abc import Iterator
from types import FrameType


@contextlib.contextmanager
def defer_interruptions() -> Iterator[None]:
    """What ends a command (Ctrl-C, SIGTERM, SIGHUP) counts at the end of the block where Python handles it; in other
    threads than the main one there is none.
    """
    # signals are handled in the main thread alone
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    held: list[tuple[int, FrameType | None]] = []
    # those of this system that Python handles
    ends = [getattr(signal, name) for name in ("SIGINT", "SIGTERM", "SIGHUP") if hasattr(signal, name)]
    before = {number: handler for number in ends if callable(handler := signal.getsignal(number))}
    for number in before:
        signal.signal(number, lambda number, frame: held.append((number, frame)))
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
        # the first that came, as if it came now
        for number, frame in held[:1]:
            before[number](number, frame)
