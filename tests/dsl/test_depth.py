"""Room for nested expressions: given to threads that read at once, and put back by the last."""

import sys
import threading

import pytest
from sysdyn.dsl.model.depth import FRAMES, deep


def nested(levels):
    return 0 if levels == 0 else 1 + nested(levels - 1)


def test_there_is_room_inside_and_the_limit_is_the_callers_again():
    before = sys.getrecursionlimit()
    with deep():
        assert nested(FRAMES // 2) == FRAMES // 2
        with deep():
            assert sys.getrecursionlimit() >= FRAMES
        assert sys.getrecursionlimit() >= FRAMES
    assert sys.getrecursionlimit() == before


def test_a_failure_puts_it_back():
    before = sys.getrecursionlimit()
    with pytest.raises(ValueError, match="inside"), deep():
        raise ValueError("inside")
    assert sys.getrecursionlimit() == before


def test_the_last_thread_that_leaves_puts_it_back():
    before, entered, leave, found = sys.getrecursionlimit(), threading.Event(), threading.Event(), []

    def stays():
        with deep():
            entered.set()
            leave.wait(10.0)
            found.append(sys.getrecursionlimit())

    thread = threading.Thread(target=stays)
    thread.start()
    assert entered.wait(10.0)
    with deep():
        pass
    assert sys.getrecursionlimit() >= FRAMES
    leave.set()
    thread.join()
    assert found[0] >= FRAMES
    assert sys.getrecursionlimit() == before
