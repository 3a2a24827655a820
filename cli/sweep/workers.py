"""Processes that run cases side by side.

A worker takes a chunk of cases, hands back what the core made of them, and what needs runs of their own, which are then
given out one by one.  A worker that dies takes its chunk with it: its cases are begun again one by one, and a run that
was alone in DEATHS of these is named.
"""

from __future__ import annotations

import contextlib
import signal
import time
from collections import deque
from collections.abc import Iterable, Iterator
from dataclasses import field
from itertools import islice
from multiprocessing.connection import Connection

from sysdyn.cli.run.many.crew import DEATHS, Crew, Serve
from sysdyn.cli.run.request.run_request import RunRequest
from sysdyn.cli.sweep.one_run import Runner, Task
from sysdyn.cli.sweep.run_records import Item, Kept
from sysdyn.values import dataclass

FIRST, LARGEST = 8, 1024
"""Cases of a first chunk, and at most."""
LASTS = 0.25
"""s: what a chunk should take."""


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


def serve(pipe: Connection, request: RunRequest, keep: str) -> None:
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
    deaths: dict[int, int] = field(default_factory=dict)
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

    def took(self, job: Chunk, answer: Answer, seconds: float) -> Iterator[Item]:
        """How long a chunk took tells how large the next ones are."""
        self.again.extend(answer[1])
        if answer[0] and not job.alone:
            wanted = int(len(job.tasks) * LASTS / max(seconds, 1e-6))
            self.size = max(1, min(wanted, 4 * self.size, LARGEST))
        yield from answer[0]

    def handle_death(self, job: Chunk, how: str) -> Iterator[Kept]:
        """The runs that a worker died of go to others one by one, or one is named."""
        if not job.alone:
            self.again.extend(job.tasks)
            return
        task = job.tasks[0]
        self.deaths[task[0]] = self.deaths.get(task[0], 0) + 1
        if self.deaths[task[0]] < DEATHS:
            self.again.append(task)
        else:
            yield Kept(task[0], 4, False, f"its worker died {DEATHS} times ({how})")


def results(
    request: RunRequest,
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
    if jobs > 1:
        yield from Crew(queue, jobs, serve, (request, keep)).results()
        return
    runner = runner or Runner(request, keep)
    while (chunk := queue.next()) is not None:
        began = time.monotonic()
        found = answer(runner, chunk)
        yield from queue.took(chunk, found, time.monotonic() - began)
