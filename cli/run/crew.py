"""Processes at work side by side: what sweeps, goldens, `verify` and `trade` run their jobs by.

A worker takes a job from its pipe and sends back what came of it.  One that dies takes its job with it: the supply says
what becomes of that.  `each` is the plain case: one function, many items; an item whose worker died DEATHS times is
lost.
"""

from __future__ import annotations

import contextlib
import multiprocessing
import signal
import time
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from dataclasses import field
from multiprocessing.connection import Connection, wait
from multiprocessing.process import BaseProcess
from typing import Any, Protocol

from sysdyn.values import dataclass

DEATHS = 3
"""Workers that a job may kill."""
_CONTEXT = multiprocessing.get_context("spawn")

Serve = Callable[..., None]
"""What a worker does: `serve(pipe, *setup)`; it answers every job that comes through the pipe until that is closed."""


class Supply(Protocol):
    """What a crew works off."""

    def next(self) -> Any | None:
        """A job; None where there is none now."""

    def took(self, job: Any, answer: Any, seconds: float) -> Iterator[Any]:
        """A worker's answer; what is handed on of it."""

    def died(self, job: Any, how: str) -> Iterator[Any]:
        """A worker died of a job, by `signal N` or with `exit N`; what is handed on of that."""


@dataclass(slots=True)
class _Worker:
    process: BaseProcess
    pipe: Connection
    job: Any
    began: float = 0.0


class Crew:
    """At most `jobs` workers, each `serve(pipe, *setup)` in a process of its own."""

    def __init__(self, supply: Supply, jobs: int, serve: Serve, setup: tuple[Any, ...]) -> None:
        self._supply, self._jobs, self._serve, self._setup = supply, jobs, serve, setup
        self._workers: list[_Worker] = []

    def _fill(self) -> None:
        """As many workers as there are jobs for."""
        while len(self._workers) < self._jobs and (job := self._supply.next()) is not None:
            mine, other = _CONTEXT.Pipe()
            process = _CONTEXT.Process(target=self._serve, args=(other, *self._setup), daemon=True)
            process.start()
            other.close()
            worker = _Worker(process, mine, job)
            self._workers.append(worker)
            self._give(worker, job)

    @staticmethod
    def _give(worker: _Worker, job: Any) -> None:
        worker.job, worker.began = job, time.monotonic()
        with contextlib.suppress(BrokenPipeError):  # it died meanwhile: seen when it is waited for
            worker.pipe.send(job)

    def results(self) -> Iterator[Any]:
        """What is handed on, until every job is done; no worker outlives the one who steers."""
        try:
            self._fill()
            while self._workers:
                ready = wait([w.pipe for w in self._workers])
                for worker in [w for w in self._workers if w.pipe in ready]:
                    yield from self._answered(worker)
                self._fill()
        finally:
            self._end()

    def _answered(self, worker: _Worker) -> Iterator[Any]:
        try:
            answer = worker.pipe.recv()
        except (EOFError, OSError):
            worker.process.join()
            worker.pipe.close()
            self._workers.remove(worker)
            code = worker.process.exitcode
            how = f"signal {-code}" if code is not None and code < 0 else f"exit {code}"
            yield from self._supply.died(worker.job, how)
            return
        found = list(self._supply.took(worker.job, answer, time.monotonic() - worker.began))
        job = self._supply.next()
        if job is None:
            worker.pipe.close()
            self._workers.remove(worker)
        else:
            self._give(worker, job)
        yield from found

    def _end(self) -> None:
        for worker in self._workers:
            worker.pipe.close()
            worker.process.terminate()
        for worker in self._workers:
            worker.process.join(5.0)


@dataclass(frozen=True, slots=True)
class Lost:
    """An item whose workers died.  how: `signal N` or `exit N`, of the last."""

    how: str


@dataclass(slots=True)
class _Items:
    """Items by number, each for a worker of its own choice."""

    waiting: deque[tuple[int, Any]]
    deaths: dict[int, int] = field(default_factory=dict)

    def next(self) -> tuple[int, Any] | None:
        return self.waiting.popleft() if self.waiting else None

    def took(self, job: tuple[int, Any], answer: Any, seconds: float) -> Iterator[tuple[int, Any]]:
        if isinstance(answer, BaseException):
            raise answer
        yield job[0], answer

    def died(self, job: tuple[int, Any], how: str) -> Iterator[tuple[int, Any]]:
        self.deaths[job[0]] = self.deaths.get(job[0], 0) + 1
        if self.deaths[job[0]] < DEATHS:
            self.waiting.append(job)
        else:
            yield job[0], Lost(how)


def _call(pipe: Connection, function: Callable[[Any], Any]) -> None:
    """A worker that calls one function; what it raises is raised by the one who steers."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    with contextlib.suppress(EOFError, BrokenPipeError):
        while True:
            _, item = pipe.recv()
            try:
                answer: Any = function(item)
            except Exception as error:
                answer = error
            try:
                pipe.send(answer)
            except (TypeError, AttributeError, ValueError) as error:  # it cannot be handed over
                pipe.send(RuntimeError(f"{answer!r:.500}: {error}"))


def each(function: Callable[[Any], Any], items: Sequence[Any], jobs: int) -> Iterator[tuple[int, Any]]:
    """(number, function(item)) as they are ready, `Lost` for one that kills its workers; jobs 1: here, in order.

    function: of a module, for it is called in other processes; so are items and what comes of them handed over.
    """
    if jobs == 1 or len(items) == 1:
        yield from ((k, function(item)) for k, item in enumerate(items))
        return
    yield from Crew(_Items(deque(enumerate(items))), jobs, _call, (function,)).results()
