"""Processes that run cases side by side.

A worker that dies takes its run with it: that run is begun again by another, and named after DEATHS of them.
"""

from __future__ import annotations

import contextlib
import multiprocessing
import signal
from collections import deque
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from multiprocessing.connection import Connection, wait
from multiprocessing.process import BaseProcess

from sysdyn.cli.run.running import Request
from sysdyn.cli.sweep.one_run import Kept, Runner
from sysdyn.cli.sweep.study import Case

DEATHS = 3
"""Workers that a run may kill."""
_CONTEXT = multiprocessing.get_context("spawn")

Task = tuple[int, Case]
Serve = Callable[[Connection, Request], None]


def serve(pipe: Connection, request: Request) -> None:
    """A worker: tasks from the pipe until it is closed."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the one who steers ends it
    runner = Runner(request)
    with contextlib.suppress(EOFError, BrokenPipeError):
        while True:
            number, case = pipe.recv()
            pipe.send(runner(number, case))


@dataclass(slots=True)
class _Worker:
    process: BaseProcess
    pipe: Connection
    task: Task | None = None


def results(request: Request, tasks: Iterable[Task], jobs: int, serve: Serve = serve) -> Iterator[Kept]:
    """What is kept of each task, as it is ready; jobs 1: in this process.  serve: what a worker does."""
    if jobs == 1:
        runner = Runner(request)
        for number, case in tasks:
            yield runner(number, case)
        return
    crew = _Crew(request, iter(tasks), jobs, serve)
    try:
        yield from crew.results()
    finally:
        crew.end()


class _Crew:
    def __init__(self, request: Request, tasks: Iterator[Task], jobs: int, serve: Serve) -> None:
        self.request, self.tasks, self.serve = request, tasks, serve
        self.again: deque[Task] = deque()
        self.deaths: dict[int, int] = {}
        self.workers = [w for w in (self._begin() for _ in range(jobs)) if w is not None]

    def _begin(self) -> _Worker | None:
        """A worker with a task; None where there is no task."""
        task = self._next()
        if task is None:
            return None
        mine, other = _CONTEXT.Pipe()
        process = _CONTEXT.Process(target=self.serve, args=(other, self.request), daemon=True)
        process.start()
        other.close()
        worker = _Worker(process, mine)
        self._give(worker, task)
        return worker

    def _next(self) -> Task | None:
        return self.again.popleft() if self.again else next(self.tasks, None)

    def _give(self, worker: _Worker, task: Task | None) -> None:
        worker.task = task
        if task is None:
            worker.pipe.close()
            return
        with contextlib.suppress(BrokenPipeError):  # it died meanwhile: seen when it is waited for
            worker.pipe.send(task)

    def results(self) -> Iterator[Kept]:
        """Until every task is done."""
        while self.workers:
            ready = wait([w.pipe for w in self.workers])
            for worker in [w for w in self.workers if w.pipe in ready]:
                try:
                    kept: Kept = worker.pipe.recv()
                except (EOFError, OSError):
                    found = self._died(worker)
                    if found is not None:
                        yield found
                    continue
                self._give(worker, self._next())
                if worker.task is None:
                    self.workers.remove(worker)
                yield kept

    def _died(self, worker: _Worker) -> Kept | None:
        """The run that a worker died of goes to another, or is named."""
        worker.process.join()
        worker.pipe.close()
        self.workers.remove(worker)
        task, named = worker.task, None
        assert task is not None
        number, code = task[0], worker.process.exitcode
        self.deaths[number] = self.deaths.get(number, 0) + 1
        if self.deaths[number] < DEATHS:
            self.again.append(task)
        else:
            how = f"signal {-code}" if code is not None and code < 0 else f"exit {code}"
            named = Kept(number, 4, False, f"its worker died {DEATHS} times ({how})")
        new = self._begin()
        if new is not None:
            self.workers.append(new)
        return named

    def end(self) -> None:
        """No worker outlives the one who steers."""
        for worker in self.workers:
            worker.pipe.close()
            worker.process.terminate()
        for worker in self.workers:
            worker.process.join(5.0)
