"""What all tests share."""

import os
import sys

import pytest


@pytest.fixture(autouse=True, scope="session")
def _one_cache(tmp_path_factory):
    """One folder of compiled models for all rooms and all processes of a run, empty at its begin."""
    base = tmp_path_factory.getbasetemp()
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("SYSDYN_CACHE", str((base.parent if "PYTEST_XDIST_WORKER" in os.environ else base) / "compiled"))
        patch.delenv("NO_COLOR", raising=False)
        yield


@pytest.fixture
def effort():
    """Calls a function and counts the lines of Python that it runs: what a clock would say on a machine of its own."""

    def counted(function):
        lines = 0

        def seen(_frame, event, _argument):
            nonlocal lines
            lines += event == "line"
            return seen

        before = sys.gettrace()
        sys.settrace(seen)
        try:
            return function(), lines
        finally:
            sys.settrace(before)

    return counted
