"""Checks in a process of their own: whatever a text does there, the server answers; the newest text wins."""

from __future__ import annotations

import contextlib
import multiprocessing
import os
import sys
import threading
import time
from multiprocessing.connection import Connection
from multiprocessing.process import BaseProcess
from typing import Any

from sysdyn.cli.console import ROUTINE
from sysdyn.cli.failures import classify
from sysdyn.cli.run.check.checking import Checked, file_checked
from sysdyn.dsl.text.diagnostics import Diagnostic, Report, limit_findings
from sysdyn.dsl.text.source import UNSAVED, real

DELAY = 0.15
"""s: between a change and its check, for the next key to be pressed."""
PATIENCE = 1.0
"""s: that a check of an older text may take before it is given up for a newer one; a process takes 0.6 s to start."""
LONGEST = 60.0
"""s: that it may take before it is given up for another text."""
SPENT = "E119"
"""More than a model may take: it is not taken again."""
Accounts = dict[str, dict[str, Any]]
_CONTEXT = multiprocessing.get_context("spawn")


class Checker:
    """Texts that wait to be checked, and the process that checks one of them."""

    def __init__(self) -> None:
        self._waiting: dict[str, float] = {}
        self._process: BaseProcess | None = None
        self._pipe: Connection | None = None
        self._busy: tuple[str, float] | None = None
        self._text: str | None = None  # that is checked
        self._told = False  # whether its findings are

    def ask(self, name: str, at_once: bool = False) -> None:
        """Check a text, after a while in which nobody asks for it again."""
        self._waiting.pop(name, None)
        self._waiting[name] = time.monotonic() + (0.0 if at_once else DELAY)

    def forget(self, name: str) -> None:
        """Check it no more."""
        self._waiting.pop(name, None)

    @property
    def pipe(self) -> Connection | None:
        """Where an answer arrives, while one is waited for."""
        return self._pipe if self._busy is not None else None

    def go_on(self) -> float | None:
        """Begin what is due; how many seconds later to ask again, None where nothing waits but for an answer."""
        if not self._waiting:
            return None
        now = time.monotonic()
        # one check at a time; it has PATIENCE if its own text is newer by now, LONGEST otherwise
        if self._busy is not None:
            left = self._busy[1] + (PATIENCE if self._busy[0] in self._waiting else LONGEST) - now
            if left > 0.0:
                return left
            self.end()
        name, due = min(self._waiting.items(), key=lambda item: item[1])
        # its text changed a moment ago: more of it may come
        if due > now:
            return due - now
        del self._waiting[name]
        self._begin(name)
        return None

    def _begin(self, name: str) -> None:
        if self._process is None or not self._process.is_alive():
            self.begin()
        assert self._pipe is not None
        self._busy = name, time.monotonic()
        self._told = False
        self._text = UNSAVED.get(str(real(name)))
        with contextlib.suppress(OSError):  # it died meanwhile: seen when its answer is taken
            self._pipe.send((name, dict(UNSAVED)))

    def begin(self) -> None:
        """Let a process stand ready."""
        self.end()
        self._pipe, other = _CONTEXT.Pipe()
        self._process = _CONTEXT.Process(target=serve, args=(other,), daemon=True)
        self._process.start()
        other.close()

    def answer(self) -> tuple[str, str | None, Checked | Accounts]:
        """The name and the text that were checked and what was found: first what is wrong, then what there is."""
        assert self._pipe is not None
        assert self._busy is not None
        name = self._busy[0]
        try:
            said = self._pipe.recv()
            self._told = isinstance(said, Checked)
            if not self._told:
                self._busy = None
            return name, self._text, said
        except (EOFError, OSError):
            self.end()
            died = Checked(unread="a fault in sysdyn: the process that checked the text died")
            return name, self._text, {} if self._told else died

    def end(self) -> None:
        """No process goes on."""
        self._busy = None
        if self._pipe is not None:
            self._pipe.close()
            self._pipe = None
        if self._process is not None:
            self._process.kill()
            self._process.join(5.0)
            self._process = None


def serve(pipe: Connection) -> None:
    """What the process does: answer each text with its findings until nobody asks any more."""
    threading.Thread(target=_end_with_the_server, daemon=True).start()
    os.dup2(2, 1)  # standard output belongs to the protocol
    sys.stdout = sys.stderr
    from sysdyn.cli.run.start import starting  # noqa: F401 (nobody waits for them yet)

    with contextlib.suppress(EOFError, OSError, KeyboardInterrupt):
        while True:
            name, unsaved = pipe.recv()
            checked = found(name, unsaved)
            pipe.send(checked)
            pipe.send({} if any(d.code == SPENT for d in checked.found) else accounts(name))


def _end_with_the_server() -> None:
    """A server that is killed closes no pipe that a check would notice: the process ends in the midst of it."""
    server = multiprocessing.parent_process()
    if server is not None:
        server.join()
        os._exit(1)


def found(name: str, unsaved: dict[str, str]) -> Checked:
    """What `check` finds of a file where open documents stand for theirs."""
    UNSAVED.clear()
    UNSAVED.update(unsaved)
    try:
        return file_checked((name, False, False))
    except Exception as error:  # a fault is told as such, and the next text is checked
        return Checked(unread=classify(error)[1])


def accounts(name: str) -> Accounts:
    """What `sysdyn list` tells of each model of a file that has no errors."""
    from sysdyn.cli.manual import model_names
    from sysdyn.dsl import load
    from sysdyn.dsl.model import expression as ex

    told = {}
    try:
        document = load.read(name, Report())
        for model in document.models.values():
            with ex.fresh():
                listing = load.listing(document, model, None, Report())
                if listing is not None:
                    told[model.name.name] = model_names.account(document, model, listing)
    except Exception:  # the check has said why
        return {}
    return told


def visible_findings(result: Checked) -> list[Diagnostic]:
    """The findings that `check` shows."""
    kept = limit_findings(Report(result.found).diagnostics)
    return [d for d in kept if d.severity == "error" or d.code not in ROUTINE]
