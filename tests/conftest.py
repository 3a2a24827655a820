"""What all tests share."""

import gc
import os
import signal
import sys
from collections import Counter
from pathlib import Path

import pytest
from hypothesis import HealthCheck, settings

settings.register_profile("any machine", deadline=None, suppress_health_check=[HealthCheck.too_slow])
settings.load_profile("any machine")  # no test depends on wall time

sys.path.insert(0, str(Path(__file__).parent / "data"))  # `reference_values`, for all rooms

# a shell ignores some of these in what it starts in the background, and children would inherit that
for _signal in {"SIGINT", "SIGTERM", "SIGHUP"} & set(dir(signal)):
    _number = getattr(signal, _signal)
    if signal.getsignal(_number) is signal.SIG_IGN:
        signal.signal(_number, signal.default_int_handler if _signal == "SIGINT" else signal.SIG_DFL)

GOLDEN = 0.6180339887498949


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
    monkeypatch.setattr("sysdyn.cli.run.many.crew.PAYS", 1e6)


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
    """With SYSDYN_LONG=1, or where a test is named, all; else not what is marked long, and of what is marked one_in(n)
    one case in n: by multiples of the golden ratio, which leave no value of one of several parameters out.

    The marks leave a set that reaches every branch that all reach, at a third of the time (tests/bench/covering.py).
    """
    if os.environ.get("SYSDYN_LONG") or any("::" in argument for argument in config.args):
        return
    seen, kept, left = Counter(), [], []
    for item in items:
        mark, name = item.get_closest_marker("one_in"), item.nodeid.partition("[")[0]
        out = mark is not None and seen[name] * GOLDEN % 1.0 >= 1.0 / mark.args[0]
        (left if out or item.get_closest_marker("long") else kept).append(item)
        seen[name] += 1
    config.hook.pytest_deselected(items=left)
    items[:] = sorted(kept, key=lambda item: item.get_closest_marker("first") is None)
