"""What all tests share."""

import gc
import os
import sys
from collections import Counter

import pytest


@pytest.fixture(autouse=True, scope="session")
def _one_cache(tmp_path_factory):
    """One folder of compiled models for all rooms and all processes of a run, empty at its begin."""
    base = tmp_path_factory.getbasetemp()
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("SYSDYN_CACHE", str((base.parent if "PYTEST_XDIST_WORKER" in os.environ else base) / "compiled"))
        patch.delenv("NO_COLOR", raising=False)
        yield


@pytest.fixture(autouse=True)
def _here(monkeypatch):
    """Work stays in this process unless a test asks for more of them: a clock would choose, and patches stay behind."""
    monkeypatch.setattr("sysdyn.cli.run.crew.PAYS", 1e6)


@pytest.fixture
def effort():
    """Calls a function and counts the lines of Python that it runs: what a clock would say on a machine of its own.

    What earlier tests left for the collector of garbage (directories, models) is not taken away meanwhile.
    """

    def counted(function):
        lines = 0

        def seen(_frame, event, _argument):
            nonlocal lines
            lines += event == "line"
            return seen

        before = sys.gettrace()
        gc.collect()
        gc.disable()
        sys.settrace(seen)
        try:
            return function(), lines
        finally:
            sys.settrace(before)
            gc.enable()

    return counted


def pytest_collection_modifyitems(config, items):
    """Of a test that is marked one_in(n) every n-th case runs; all of them with SYSDYN_LONG=1, or where it is named."""
    if os.environ.get("SYSDYN_LONG") or any("::" in argument for argument in config.args):
        return
    seen, kept, left = Counter(), [], []
    for item in items:
        mark, name = item.get_closest_marker("one_in"), item.nodeid.partition("[")[0]
        (left if mark and seen[name] % mark.args[0] else kept).append(item)
        seen[name] += 1
    config.hook.pytest_deselected(items=left)
    items[:] = sorted(kept, key=lambda item: item.get_closest_marker("first") is None)
