"""Processes that run cases side by side.

A worker takes a chunk of cases, hands back what the core made of them, and what needs runs of their own, which are then
given out one by one.  A worker that dies takes its chunk with it: its cases are begun again one by one, and a run that
was alone in DEATHS of these is named.
"""

from __future__ import annotations

import contextlib
import multiprocessing
import signal
import time
from collections import deque
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, field
from itertools import islice
from multiprocessing.connection import Connection, wait
from multiprocessing.process import BaseProcess

from sysdyn.cli.run.running import Request
from sysdyn.cli.sweep.kept import Item, Kept
from sysdyn.cli.sweep.one_run import Runner, Task

DEATHS = 3
"""Workers that a run may kill."""
FIRST, LARGEST = 8, 1024
"""Cases of a first chunk, and at most."""
LASTS = 0.25
"""s: what a chunk should take."""
_CONTEXT = multiprocessing.get_context("spawn")

Serve = Callable[[Connection, Request, str], None]


@dataclass(frozen=True, slots=True)
class Chunk:
    """Cases for one worker; alone: one, for a run of its own."""

    tasks: tuple[Task, ...]
    alone: bool = False


Answer = tuple[list[Item], list[Task]]


def answer(runner: Runner, chunk: Chunk) -> Answer:
    """What came of a chunk, and what needs runs of their own."""
    if chunk.alone:
        return [runner(*task) for task in chunk.tasks], []
    return runner.chunk(chunk.tasks)


def serve(pipe: Connection, request: Request, keep: str) -> None:
    """A worker: chunks from the pipe until it is closed."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the one who steers ends it
    runner = Runner(request, keep)
    with contextlib.suppress(EOFError, BrokenPipeError):
        while True:
            pipe.send(answer(runner, pipe.recv()))


@dataclass(slots=True)
class Queue:
    """Chunks of tasks, as large as takes LASTS; what needs a run of its own comes first.  jobs: workers."""

    tasks: Iterator[Task]
    left: int
    jobs: int
    again: deque[Task] = field(default_factory=deque)
    size: int = FIRST
    more: bool = True

    def next(self) -> Chunk | None:
        """A chunk; None where there is none."""
        if self.again:
            return Chunk((self.again.popleft(),), alone=True)
        tasks = tuple(islice(self.tasks, max(1, min(self.size, self.left // (2 * self.jobs)))))
        self.left -= len(tasks)
        self.more = bool(tasks)
        return Chunk(tasks) if tasks else None

    def took(self, chunk: Chunk, found: Answer, seconds: float) -> None:
        """How long a chunk took tells how large the next ones are."""
        self.again.extend(found[1])
        if found[0] and not chunk.alone:
            wanted = int(len(chunk.tasks) * LASTS / max(seconds, 1e-6))
            self.size = max(1, min(wanted, 4 * self.size, LARGEST))


@dataclass(slots=True)
class _Worker:
    process: BaseProcess
    pipe: Connection
    chunk: Chunk
    began: float = 0.0


def results(
    request: Request,
    tasks: Iterable[Task],
    number: int,
    jobs: int,
    keep: str = "traces",
    serve: Serve = serve,
    runner: Runner | None = None,
) -> Iterator[Item]:
    """What is kept of `number` tasks, as it is ready; jobs 1: in this process (by `runner`, where it is given).

    serve: what a worker does.
    """
    queue = Queue(iter(tasks), number, jobs)
    if jobs == 1:
        runner = runner or Runner(request, keep)
        while (chunk := queue.next()) is not None:
            began = time.monotonic()
            found = answer(runner, chunk)
            queue.took(chunk, found, time.monotonic() - began)
            yield from found[0]
        return
    crew = _Crew(request, queue, keep, serve)
    try:
        yield from crew.results()
    finally:
        crew.end()


class _Crew:
    def __init__(self, request: Request, queue: Queue, keep: str, serve: Serve) -> None:
        self.request, self.queue, self.keep, self.serve = request, queue, keep, serve
        self.deaths: dict[int, int] = {}
        self.workers: list[_Worker] = []
        self._fill()

    def _fill(self) -> None:
        """As many workers as there are chunks for, at most `jobs`."""
        while len(self.workers) < self.queue.jobs and (chunk := self.queue.next()) is not None:
            mine, other = _CONTEXT.Pipe()
            process = _CONTEXT.Process(target=self.serve, args=(other, self.request, self.keep), daemon=True)
            process.start()
            other.close()
            worker = _Worker(process, mine, chunk)
            self.workers.append(worker)
            self._give(worker, chunk)

    @staticmethod
    def _give(worker: _Worker, chunk: Chunk) -> None:
        worker.chunk, worker.began = chunk, time.monotonic()
        with contextlib.suppress(BrokenPipeError):  # it died meanwhile: seen when it is waited for
            worker.pipe.send(chunk)

    def results(self) -> Iterator[Item]:
        """Until every task is done."""
        while self.workers:
            ready = wait([w.pipe for w in self.workers])
            for worker in [w for w in self.workers if w.pipe in ready]:
                try:
                    found: Answer = worker.pipe.recv()
                except (EOFError, OSError):
                    yield from self._died(worker)
                    continue
                self.queue.took(worker.chunk, found, time.monotonic() - worker.began)
                chunk = self.queue.next()
                if chunk is None:
                    worker.pipe.close()
                    self.workers.remove(worker)
                else:
                    self._give(worker, chunk)
                yield from found[0]
            self._fill()

    def _died(self, worker: _Worker) -> Iterator[Kept]:
        """The runs that a worker died of go to others one by one, or one is named."""
        worker.process.join()
        worker.pipe.close()
        self.workers.remove(worker)
        chunk, code = worker.chunk, worker.process.exitcode
        if not chunk.alone:
            self.queue.again.extend(chunk.tasks)
            return
        task = chunk.tasks[0]
        self.deaths[task[0]] = self.deaths.get(task[0], 0) + 1
        if self.deaths[task[0]] < DEATHS:
            self.queue.again.append(task)
        else:
            how = f"signal {-code}" if code is not None and code < 0 else f"exit {code}"
            yield Kept(task[0], 4, False, f"its worker died {DEATHS} times ({how})")

    def end(self) -> None:
        """No worker outlives the one who steers."""
        for worker in self.workers:
            worker.pipe.close()
            worker.process.terminate()
        for worker in self.workers:
            worker.process.join(5.0)
