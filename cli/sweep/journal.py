"""The journal of a sweep: one line of JSON a run, or a block of them, beside the result, written at once.

A kill loses the runs under way and no more: the same command reads the journal and goes on.
"""

from __future__ import annotations

import contextlib
import json
import os
from collections.abc import Iterator
from pathlib import Path
from types import TracebackType
from typing import Self

from sysdyn.cli import whole_files
from sysdyn.cli.failures import UsageError
from sysdyn.cli.sweep.run_records import Done, Item, Kept, KeptRuns
from sysdyn.runtime.model.failures import TraceError


class SweepJournal:
    """`.NAME.runs` beside the result; done: what it holds already, by number of the run."""

    def __init__(self, output: Path, digest: str) -> None:
        self.path = output.with_name(f".{output.name}.runs")
        self.done = Done()
        if os.path.lexists(self.path) and (self.path.is_symlink() or not self.path.is_file()):
            raise UsageError(f"{self.path} is no file of a sweep: remove it, or give -o another name")
        self._read(digest)
        self._file = self.path.open("a", encoding="utf-8")
        if not self.path.stat().st_size:
            self._line({"study": digest})

    def _read(self, digest: str) -> None:
        """Takes in what is there; a line that a kill cut short is taken away."""
        if not self.path.exists():
            return
        text = self.path.read_bytes()
        whole = text[: text.rfind(b"\n") + 1]
        with self._report_damage():
            lines = [json.loads(line) for line in whole.splitlines()]
            begun = json.dumps({"study": digest}).encode().startswith(text)  # the first line, or a part of it
            other = not begun and (lines[0].get("study") if lines else None) != digest
        if other:
            raise UsageError(
                f"{self.path} holds runs of another study, or of another text: remove it, or give -o another name"
            )
        with self._report_damage():
            for line in lines[1:]:
                self.done.take(KeptRuns.from_json(line["block"]) if "block" in line else Kept(**line))
        if whole != text:
            self.path.write_bytes(whole)

    @contextlib.contextmanager
    def _report_damage(self) -> Iterator[None]:
        try:
            yield
        except (ValueError, TypeError, KeyError, AttributeError, OverflowError) as error:
            raise TraceError(f"{self.path} is damaged: remove it, and the sweep begins anew ({error})") from error

    def _line(self, item: dict[str, object]) -> None:
        with whole_files.naming_file(self.path):
            self._file.write(json.dumps(item) + "\n")
            self._file.flush()

    def take(self, item: Item) -> None:
        """Keeps a result."""
        self.done.take(item)
        self._line({"block": item.to_json()} if isinstance(item, KeptRuns) else item.to_json())

    def remove(self) -> None:
        """All runs stand in the result."""
        self._file.close()
        self.path.unlink(missing_ok=True)

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        with contextlib.suppress(OSError) if error is not None else whole_files.naming_file(self.path):
            self._file.close()  # of a full disk what is left cannot be written now either
