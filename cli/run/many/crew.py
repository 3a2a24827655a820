"""Processes at work side by side: what sweeps, goldens, `verify` and `trade` run their jobs by.

A worker takes a job from its pipe and sends back what came of it.  One that dies takes its job with it: the supply says
what becomes of that.  `each` is the plain case: one function, many items; an item whose worker died DEATHS times is
lost.  Where nobody says how many, items are worked off here until what is left of them pays for processes, one a core.
"""

from __future__ import annotations

import contextlib
import multiprocessing
import os
import signal
import threading
import time
from collections import deque
from collections.abc import Callable, Generator, Iterator, Sequence
from dataclasses import field
from multiprocessing import resource_tracker
from multiprocessing.connection import Connection, wait
from multiprocessing.process import BaseProcess
from typing import Any, Protocol

from sysdyn.values import dataclass

DEATHS = 3
"""Workers that a job may kill."""
PAYS = 3.0
"""s: what is left of the work, as the items done so far foretell it, from which on processes pay; one takes 0.6 s to
start.
"""
SHARE = 0.5
"""Of the machine's memory: what processes of the size of this one may take together."""
_CONTEXT = multiprocessing.get_context("spawn")

Serve = Callable[..., None]
"""What a worker does: `serve(pipe, *setup)`; it answers every job that comes through the pipe until that is closed."""


def cores() -> int:
    """Those that this process may use."""
    try:
        return len(os.sched_getaffinity(0))
    except AttributeError:  # not on this system
        return os.cpu_count() or 1


class Supply(Protocol):
    """What a crew works off."""

    def next(self) -> Any | None:
        """A job; None where there is none now."""

    def took(self, job: Any, answer: Any, seconds: float) -> Iterator[Any]:
        """A worker's answer; what is handed on of it."""

    def handle_death(self, job: Any, how: str) -> Iterator[Any]:
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
        self._ended = False
        self._beginning = threading.Lock()
        """Held while a worker begins: `end`, of another thread, waits until it is one of the workers."""

    def _fill(self) -> None:
        """As many workers as there are jobs for."""
        while len(self._workers) < self._jobs and (job := self._supply.next()) is not None:
            with _block_interruptions(), self._beginning:
                if self._ended:
                    return
                worker = self._start_worker(job)
            self._give(worker, job)

    def _start_worker(self, job: Any) -> _Worker:
        mine, other = _CONTEXT.Pipe()
        process = _CONTEXT.Process(target=self._serve, args=(other, *self._setup), daemon=True)
        process.start()
        other.close()
        worker = _Worker(process, mine, job)
        self._workers.append(worker)
        return worker

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
                    yield from self._receive(worker)
                self._fill()
        finally:
            self.end()

    def _receive(self, worker: _Worker) -> Iterator[Any]:
        """Take a worker's answer and give it the next job; what the supply makes of one that died."""
        try:
            answer = worker.pipe.recv()
        # it died: by a signal, or by an exit of its own
        except (EOFError, OSError):
            worker.process.join()
            worker.pipe.close()
            self._workers.remove(worker)
            code = worker.process.exitcode
            how = f"signal {-code}" if code is not None and code < 0 else f"exit {code}"
            yield from self._supply.handle_death(worker.job, how)
            return
        found = list(self._supply.took(worker.job, answer, time.monotonic() - worker.began))
        job = self._supply.next()
        # nothing left for it
        if job is None:
            worker.pipe.close()
            self._workers.remove(worker)
        else:
            self._give(worker, job)
        yield from found

    def end(self) -> None:
        """No worker goes on, and none begins."""
        with self._beginning:
            self._ended = True
        for worker in self._workers:
            worker.pipe.close()
            worker.process.terminate()
        for worker in self._workers:
            worker.process.join(5.0)


@contextlib.contextmanager
def _block_interruptions() -> Iterator[None]:
    """An interruption waits, and a process that is begun here never hears of one: it is ended by the one who steers.

    Half begun it would find its pipe closed, and an interruption before it has said what to do with one would end it
    with a page of where it was.  A blocked signal stays so in a new process; other threads of this one may still take
    it, so what the first thread does about it waits too.
    """
    heard: list[object] = []
    with contextlib.ExitStack() as after:
        if threading.current_thread() is threading.main_thread():
            after.callback(lambda: signal.raise_signal(signal.SIGINT) if heard else None)
            after.callback(signal.signal, signal.SIGINT, signal.getsignal(signal.SIGINT))
            signal.signal(signal.SIGINT, lambda *said: heard.append(said))
        if hasattr(signal, "pthread_sigmask"):
            resource_tracker.ensure_running()  # which lets interruptions through again behind what it begins itself
            mask = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
            after.callback(signal.pthread_sigmask, signal.SIG_SETMASK, mask)
        yield


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
        yield job[0], answer

    def handle_death(self, job: tuple[int, Any], how: str) -> Iterator[tuple[int, Any]]:
        self.deaths[job[0]] = self.deaths.get(job[0], 0) + 1
        if self.deaths[job[0]] < DEATHS:
            self.waiting.append(job)
        else:
            yield job[0], Lost(how)


@dataclass(frozen=True, slots=True)
class _Raised:
    """What a function raised in another process."""

    error: BaseException


def _call(pipe: Connection, function: Callable[[Any], Any]) -> None:
    """A worker that calls one function; what it raises is raised by the one who steers."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    with contextlib.suppress(EOFError, BrokenPipeError):
        while True:
            _, item = pipe.recv()
            try:
                answer: Any = function(item)
            except Exception as error:
                answer = _Raised(error)
            try:
                pipe.send(answer)
            except (TypeError, AttributeError, ValueError) as error:  # it cannot be handed over
                pipe.send(_Raised(RuntimeError(f"{answer!r:.500}: {error}")))


def as_ready(function: Callable[[Any], Any], items: Sequence[Any], jobs: int) -> Iterator[tuple[int, Any]]:
    """(number, function(item)) as they are ready, by processes; `Lost` for an item that kills its workers.

    function: of a module, for it is called in other processes; so are items and what comes of them handed over.
    """
    for k, answer in Crew(_Items(deque(enumerate(items))), jobs, _call, (function,)).results():
        if isinstance(answer, _Raised):
            raise answer.error
        yield k, answer


def each(
    function: Callable[[Any], Any],
    items: Sequence[Any],
    jobs: int | None,
    here: Callable[[Any], Any] | None = None,
    like: float | None = None,
) -> Generator[Any, None, None]:
    """function(item) of each item, in their order, whatever is ready first; `Lost` for one that kills its workers.

    jobs: processes; 1: all here.  None: here, until what is left foreseeably takes longer than PAYS, then one a core.
    here: what is called in this process, in the place of function.  like [s]: what one like them took before.  What an
    item raises is raised in its turn.
    """
    done, took = 0, [] if like is None else [like]
    # here, as long as processes would not pay
    while done < len(items) and _stays(took, len(items) - done, jobs if done or len(items) > 1 else 1):
        began = time.monotonic()
        answer = (here or function)(items[done])
        took.append(time.monotonic() - began)
        done += 1
        yield answer
    if done == len(items):
        return
    found: dict[int, Any] = {}
    # then by workers; answers wait for their turn
    for k, answer in Crew(_Items(deque(enumerate(items[done:], done))), jobs or _most(), _call, (function,)).results():
        found[k] = answer
        while done in found:
            answer = found.pop(done)
            if isinstance(answer, _Raised):
                raise answer.error
            done += 1
            yield answer


def _stays(took: Sequence[float], left: int, jobs: int | None) -> bool:
    """Whether the next item is worked off here; took [s]: by those done."""
    if jobs is not None:
        return jobs == 1
    return not took or left < 2 or sum(took) / len(took) * left < PAYS or _most() == 1


class Beside:
    """One item worked off by a process beside this one, from when this one has been at its own work for PAYS s.

    jobs: 1: never; None: where there are cores and memory for it.
    """

    def __init__(self, function: Callable[[Any], Any], item: Any, jobs: int | None) -> None:
        self._crew = Crew(_Items(deque([(0, item)])), 1, _call, (function,))
        self._found: list[Any] = []
        self._timer = threading.Timer(PAYS, self._collect)
        self._timer.daemon = True
        if (jobs or _most()) > 1:
            self._timer.start()

    def _collect(self) -> None:
        with contextlib.suppress(OSError):  # it is not wanted any more
            self._found += [answer for _, answer in self._crew.results()]

    def answer(self) -> Any | None:
        """What came of it, waited for; None where no process was begun, or it died, or the function raised."""
        self._timer.cancel()
        if self._timer.ident is not None:
            self._timer.join()
        found = self._found[0] if self._found else None
        return None if isinstance(found, (Lost, _Raised)) else found

    def close(self) -> None:
        """Nobody wants it any more."""
        self._timer.cancel()
        self._crew.end()


def company(seconds: float) -> int:
    """Processes for work of that length."""
    return _most() if seconds > PAYS else 1


def _most() -> int:
    """One a core, as far as processes of the size of this one have room."""
    try:
        import resource

        whole = os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")
        mine = 1024 * resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    except (ImportError, ValueError, OSError):  # not on this system
        return cores()
    return max(1, min(cores(), int(SHARE * whole / mine)))
