"""Nothing is lost by workers that die, of processes and of a Dask cluster; a run that kills its worker is named.

A slice always; SYSDYN_LONG=1: 1000 runs, ten workers killed at random.
"""

import os
import random
import signal
import sys
import threading
import time
import warnings
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from sysdyn.api import load
from sysdyn.cli.run.request.run_request import RunRequest
from sysdyn.cli.sweep import workers
from sysdyn.cli.sweep.one_run import Runner
from sysdyn.cli.sweep.run_records import Kept
from sysdyn.cli.sweep.workers import answer

LONG = bool(os.environ.get("SYSDYN_LONG"))
RUNS, KILLS = (1000, 10) if LONG else (80, 3)

FALL = """
model fall {
  param g = 9.81 m/s^2
  coord x: translation = 20 m
  energy T* = 1/2*(1 kg)*x'^2
  work -(1 kg)*g on x
  init x' = 0 m/s
}

scene s of fall {
  time 0 s to 2 s
  trace x
  accuracy 1e-6
}
"""


@pytest.fixture
def fall(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    Path("fall.sd").write_text(FALL)
    return RunRequest(str(tmp_path / "fall.sd"))


def tasks():
    return [(k, {"g": 9.0 + k / RUNS}) for k in range(RUNS)]


def right(found):
    """Every run once, and x(2 s) = 20 m - g 2 s^2."""
    kept = {k: item for item in found for k in ([item.run] if isinstance(item, Kept) else item.runs.tolist())}
    ends = [
        item.end["x"] if isinstance(item, Kept) else item.end[item.runs.tolist().index(k), 0]
        for k, item in sorted(kept.items())
    ]
    assert sorted(kept) == list(range(RUNS))
    assert np.abs(np.array(ends) - (20.0 - 2.0 * np.array([case["g"] for _, case in tasks()]))).max() < 2e-5


def slow(pipe, request, keep):
    """A worker of processes that takes 20 ms a run, each on its own, so that it can be killed at work."""
    runner = Runner(request, keep)
    try:
        while True:
            chunk = pipe.recv()
            time.sleep(0.02 * len(chunk.tasks))
            pipe.send(answer(runner, workers.Chunk(chunk.tasks, alone=True)))
    except EOFError:
        return


def children(pid):
    found = []
    for path in Path("/proc").glob("[0-9]*/stat"):
        try:
            words = path.read_text().rpartition(")")[2].split()
        except OSError:
            continue
        if int(words[1]) == pid:
            found.append(int(path.parent.name))
    return found


@pytest.mark.skipif(not Path("/proc/self/stat").exists(), reason="finds its workers in /proc")
def test_processes_killed_at_random_lose_nothing(fall):
    """Kills among the processes that this one began for it, at random instants."""
    before, chance, killed = set(children(os.getpid())), random.Random(1), []
    found = []
    due = sorted(chance.sample(range(1, RUNS - 10), KILLS))
    for item in workers.results(fall, tasks(), RUNS, 2, "end", slow):
        found.append(item)
        while due and len(found) > due[0]:
            due.pop(0)
            mine = [
                pid
                for pid in set(children(os.getpid())) - before
                if b"spawn_main" in Path(f"/proc/{pid}/cmdline").read_bytes()
            ]
            if mine:
                killed.append(chance.choice(mine))
                os.kill(killed[-1], signal.SIGKILL)
    assert len(killed) >= KILLS - 1
    right(found)


# --- Dask -------------------------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def cluster():
    distributed = pytest.importorskip("distributed", reason="needs Dask: pip install distributed")
    import cloudpickle
    from sysdyn.cli.sweep import on_dask

    cloudpickle.register_pickle_by_value(sys.modules[__name__])
    number = 4 if LONG else 2
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        options = {"threads_per_worker": 1, "dashboard_address": None, "silence_logs": 50}
        with distributed.LocalCluster(n_workers=number, **options) as found, pytest.MonkeyPatch.context() as patch:
            patch.setattr(on_dask, "ALONE", 600.0)  # new workers begin late where much else runs
            yield found


def slow_work(request, keep, chunk):
    from sysdyn.cli.sweep.on_dask import work

    time.sleep(0.02 * len(chunk.tasks))
    return work(request, keep, workers.Chunk(chunk.tasks, alone=True))


def poisoned(request, keep, chunk):
    from sysdyn.cli.sweep.on_dask import work

    if any(number == 17 for number, _ in chunk.tasks):
        os.kill(os.getpid(), signal.SIGKILL)
    return work(request, keep, chunk)


@pytest.mark.filterwarnings("ignore")
@pytest.mark.long
def test_dask_workers_killed_at_random_lose_nothing(fall, cluster):
    from sysdyn.cli.sweep.on_dask import results

    chance, found, killed = random.Random(2), [], []
    stop = threading.Event()

    def kill():
        while not stop.wait(0.4) and len(killed) < KILLS:
            pids = [nanny.pid for nanny in cluster.workers.values() if nanny.pid]
            if pids and found:
                killed.append(chance.choice(pids))
                os.kill(killed[-1], signal.SIGKILL)

    thread = threading.Thread(target=kill)
    thread.start()
    try:
        for item in results(fall, tasks(), RUNS, cluster.scheduler_address, "end", slow_work):
            found.append(item)
    finally:
        stop.set()
        thread.join()
    assert killed
    right(found)


@pytest.mark.filterwarnings("ignore")
@pytest.mark.long
def test_a_poison_run_on_dask_is_named_after_three_deaths(fall, cluster):
    from sysdyn.cli.sweep.on_dask import results

    found = list(results(fall, tasks()[:40], 40, cluster.scheduler_address, "end", poisoned))
    runs = [k for item in found for k in ([item.run] if isinstance(item, Kept) else item.runs.tolist())]
    assert sorted(runs) == list(range(40))
    [named] = [item for item in found if isinstance(item, Kept) and item.exit]
    assert (named.run, named.exit) == (17, 4)
    assert "died 3 times" in named.reason


def test_a_result_that_went_with_its_worker_is_made_again():
    from sysdyn.cli.sweep.on_dask import _Crew, _Given

    class Gone:
        status = "finished"

        def result(self, timeout):
            raise TimeoutError

    gone, cancelled = Gone(), []
    client = SimpleNamespace(sync=lambda *_, **__: {"workers": {"b": {}}}, cancel=lambda f, **_: cancelled.extend(f))
    client.scheduler = SimpleNamespace(identity=None)
    crew = _Crew(client, None, "end", workers.Queue(iter(()), 0, 1), None)
    given = _Given("a", workers.Chunk(((3, None), (4, None))), gone, False)
    assert list(crew._took(None, given)) == []
    assert cancelled == [gone]
    assert [task[0] for task in crew.queue.again] == [3, 4]


@pytest.mark.filterwarnings("ignore")
@pytest.mark.long
def test_the_command_and_python_on_dask(fall, cluster, capsys):
    from sysdyn.cli.main import run

    arguments = ["--over", "g=9..10:50", "--keep", "end", "--no-timings"]
    assert run(["sweep", fall.file, *arguments, "--dask", cluster.scheduler_address, "-o", "a.h5"]) == 0
    assert run(["sweep", fall.file, *arguments, "--jobs", "1", "-o", "b.h5"]) == 0
    here = load(fall.file).sweep({"g": "9..10:50"}, keep="end", dask=cluster.scheduler_address)
    from sysdyn.api import Sweep

    a, b = Sweep.open("a.h5"), Sweep.open("b.h5")
    assert a.keys() == b.keys()
    assert all(np.array_equal(a[name], b[name]) for name in a if name != "error_estimate")
    assert np.array_equal(here["end.x"], a["end.x"])
    assert run(["sweep", fall.file, *arguments, "--dask", "tcp://127.0.0.1:1", "-o", "c.h5"]) == 2
