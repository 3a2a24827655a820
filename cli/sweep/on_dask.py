"""Cases of a sweep on the workers of a Dask scheduler.

The one who steers gives every worker its chunks by name, two at a time, so that it knows what a worker that dies was
at: what may have killed it is begun again by a worker that has nothing else, and is named after DEATHS of them.  A new
worker (a nanny begins one behind each that dies) takes part at once.  The model's files stand at the same path on every
worker.
"""

from __future__ import annotations

import importlib
import threading
import time
from collections.abc import Callable, Iterable, Iterator
from contextlib import suppress
from dataclasses import dataclass, field, replace
from itertools import count
from queue import Empty, SimpleQueue
from typing import Any

from sysdyn.cli.failures import UsageError
from sysdyn.cli.run.many.crew import DEATHS
from sysdyn.cli.run.request.run_request import RunRequest
from sysdyn.cli.sweep.one_run import Runner, Task
from sysdyn.cli.sweep.run_records import Item, Kept
from sysdyn.cli.sweep.workers import Answer, Chunk, Queue, answer
from sysdyn.dsl.text.source import real

DEPTH = 2
"""Chunks that a worker has at a time: one at work, one that waits."""
POLL = 0.3
"""s: how often it is looked which workers are there."""
ALONE = 60.0
"""s without any worker after which the sweep is given up (it goes on where it was)."""
_runners: dict[tuple[RunRequest, str], Runner] = {}
_one = threading.Lock()


def work(request: RunRequest, keep: str, chunk: Chunk) -> tuple[Answer, float]:
    """On a worker: what came of a chunk, and how long it took [s].  One at a time, however many threads it has."""
    with _one:
        began = time.monotonic()
        runner = _runners.setdefault((request, keep), Runner(request, keep))
        found = answer(runner, chunk)
        return found, time.monotonic() - began


Work = Callable[[RunRequest, str, Chunk], tuple[Answer, float]]


@dataclass(slots=True)
class _Given:
    address: str
    chunk: Chunk
    future: Any
    careful: bool


@dataclass(slots=True)
class _Crew:
    """What each worker (by address) was given; careful: what may have killed a worker."""

    client: Any
    request: RunRequest
    keep: str
    queue: Queue
    work: Work
    given: dict[str, dict[str, _Given]] = field(default_factory=dict)
    ready: SimpleQueue[Any] = field(default_factory=SimpleQueue)
    careful: list[Chunk] = field(default_factory=list)
    deaths: dict[int, int] = field(default_factory=dict)
    numbers: Any = field(default_factory=count)
    looked: float = 0.0
    seen: float = field(default_factory=time.monotonic)

    def workers(self) -> set[str]:
        """Addresses of those that are there."""
        self.looked = time.monotonic()
        return set(self.client.sync(self.client.scheduler.identity, n_workers=-1)["workers"])

    def look(self) -> list[Kept]:
        """Takes note of workers that came and went; runs that have killed enough of them."""
        there, named = self.workers(), list[Kept]()
        # workers that are gone: what they had is another's
        for address in [a for a in self.given if a not in there]:
            for item in self.given.pop(address).values():
                if item.future.done() and item.future.status == "finished":
                    self.ready.put((None, item))  # its result came through
                    continue
                self.client.cancel([item.future], force=True)
                named += self._handle_death(item.chunk)
        # workers that came
        for address in there - set(self.given):
            self.given[address] = {}
        self.seen = self.looked if self.given else self.seen
        self.queue.jobs = max(1, len(self.given))
        # nobody for a long time
        if self.looked - self.seen > ALONE:
            raise UsageError(f"no worker has been there for {ALONE:g} s: the same command goes on where it was")
        return named

    def _handle_death(self, chunk: Chunk) -> list[Kept]:
        """A chunk is begun again task by task, each by a worker that has nothing else; or its run is named."""
        if len(chunk.tasks) == 1:
            task = chunk.tasks[0]
            self.deaths[task[0]] = self.deaths.get(task[0], 0) + 1
            if self.deaths[task[0]] >= DEATHS:
                return [Kept(task[0], 4, False, f"its worker died {DEATHS} times")]
        self.careful += [Chunk((task,), alone=True) for task in chunk.tasks]
        return []

    def give(self) -> None:
        """Every worker has as many chunks as it may have."""
        for address, items in self.given.items():
            while len(items) < DEPTH and not any(item.careful for item in items.values()):
                careful = bool(self.careful)
                if careful and items:
                    break  # it is given nothing more until it may be alone with what is suspected
                chunk = self.careful.pop() if careful else self.queue.next()
                if chunk is None:
                    return
                self._submit(address, chunk, careful=careful)

    def _submit(self, address: str, chunk: Chunk, *, careful: bool) -> None:
        key = f"sysdyn-{id(self):x}-{next(self.numbers)}"
        future = self.client.submit(
            self.work, self.request, self.keep, chunk, key=key, workers=[address], pure=False, allow_other_workers=False
        )
        item = _Given(address, chunk, future, careful)
        self.given[address][key] = item
        future.add_done_callback(lambda _: self.ready.put((key, item)))

    def results(self) -> Iterator[Item]:
        """Until every task is done."""
        yield from self.look()
        while True:
            self.give()
            if not any(self.given.values()) and not self.careful and not self.queue.again and not self.queue.more:
                return
            try:
                key, item = self.ready.get(timeout=POLL)
            except Empty:
                yield from self.look()
                continue
            yield from self._took(key, item)
            if time.monotonic() - self.looked > POLL:
                yield from self.look()

    def _took(self, key: str | None, item: _Given) -> Iterator[Item]:
        """The result of a chunk; one that was cancelled is another worker's by now."""
        # an answer to what was given to another one since
        if key is not None and not any(items.pop(key, None) for items in self.given.values()):
            return
        # fetched, unless its worker died meanwhile
        if item.future.status == "finished":
            came = self._fetch(item)
            if came is None:
                self.client.cancel([item.future], force=True)
                self.queue.again.extend(item.chunk.tasks)
                return
            yield from self.queue.took(item.chunk, *came)
        # with its worker
        elif item.future.status == "cancelled":
            yield from self._handle_death(item.chunk)
        # an error of the work itself is raised here
        else:
            error = item.future.exception()
            if type(error).__name__ != "KilledWorker":  # the scheduler's own count of deaths
                raise error
            yield from self._handle_death(item.chunk)
        item.future.release()

    def _fetch(self, item: _Given) -> tuple[Answer, float] | None:
        """What a worker has ready; None where it died before that was fetched (Dask would wait for ever)."""
        while True:
            with suppress(TimeoutError):
                found: tuple[Answer, float] = item.future.result(timeout=POLL)
                return found
            if item.address not in self.workers():
                return None


def results(
    request: RunRequest, tasks: Iterable[Task], number: int, address: str, keep: str = "traces", work: Work = work
) -> Iterator[Item]:
    """What is kept of `number` tasks by the workers of the scheduler at `address`, as it is ready.

    work: what a worker does with a chunk.
    """
    try:
        distributed: Any = importlib.import_module("distributed")
    except ImportError:
        raise UsageError("--dask needs Dask: pip install distributed") from None
    # workers may run in other folders
    whole = replace(request, file=str(real(request.file)))
    try:
        client = distributed.Client(address, timeout=10)
    except (OSError, ValueError) as error:
        raise UsageError(f"--dask {address}: {error}") from None
    with client:
        crew = _Crew(client, whole, keep, Queue(iter(tasks), number, 1), work)
        try:
            yield from crew.results()
        # what is under way would go on without anybody
        finally:
            left = [item.future for items in crew.given.values() for item in items.values()]
            if left:
                client.cancel(left, force=True)
