"""The journal of a trade: its reference and every run that came to its end, kept at once in the folder of the cache.

A trade that is killed, interrupted or out of its budget goes on where it was when it is asked again: of the same text,
imports and tables, options and version.  One that ended leaves nothing behind.
"""

from __future__ import annotations

import contextlib
import hashlib
import json
import shutil
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

from sysdyn import __version__
from sysdyn.cli.run.request import lock
from sysdyn.cli.run.request.run_request import RunRequest
from sysdyn.cli.run.request.targets import Target
from sysdyn.cli.trade.trade_results import Combination, Measured, Runs, TradeReference
from sysdyn.compiler.program import cache
from sysdyn.runtime.trace.trace import Trace


class TradeJournal:
    """runs: what was measured before; reference: the trace and what is known of it, None where none was made yet."""

    def __init__(self, digest: str) -> None:
        self.folder = cache.folder() / "trades" / digest
        self.runs: Runs = {}
        self.reference: tuple[Trace, TradeReference] | None = None
        for line in self._lines():
            with contextlib.suppress(ValueError, KeyError, TypeError):  # a line that a kill cut short
                self._read(json.loads(line))
        with contextlib.suppress(OSError, ValueError, KeyError, TypeError):
            known = TradeReference(**json.loads((self.folder / "reference.json").read_text(encoding="utf-8")))
            self.reference = Trace.open(self.folder / "reference.h5"), known

    def _lines(self) -> list[str]:
        with contextlib.suppress(OSError, ValueError):
            return (self.folder / "runs.jsonl").read_text(encoding="utf-8").splitlines()
        return []

    def _read(self, item: dict[str, Any]) -> None:
        combination = Combination(**item["combination"])
        if "reason" in item and "steps" not in item:
            self.runs[combination, item["tolerance"]] = item["reason"]
            return
        statistics = tuple((str(key), int(n)) for key, n in item["statistics"])
        self.runs[combination, item["tolerance"]] = Measured(
            **{**item, "combination": combination, "statistics": statistics}
        )

    def refer(self, trace: Trace, known: TradeReference) -> None:
        """Keeps the reference; its description last, so that a kill leaves none by halves."""
        with contextlib.suppress(OSError):
            self.folder.mkdir(parents=True, exist_ok=True)
            shutil.copyfile(trace.path, self.folder / "reference.h5")
            (self.folder / "reference.json").write_text(json.dumps(asdict(known)), encoding="utf-8")

    def take(self, combination: Combination, tolerance: float, found: Measured | str) -> None:
        """Keeps a run that came to its end, or why there is none; one that was stopped may be asked for longer."""
        if isinstance(found, Measured) and found.error is None:
            return
        self.runs[combination, tolerance] = found
        item = asdict(found) if isinstance(found, Measured) else {"reason": found, "tolerance": tolerance}
        with contextlib.suppress(OSError), (self.folder / "runs.jsonl").open("a", encoding="utf-8") as file:
            file.write("\n" + json.dumps({**item, "combination": asdict(combination)}))

    def remove(self) -> None:
        """The trade has ended."""
        shutil.rmtree(self.folder, ignore_errors=True)


def journal(request: RunRequest, target: Target) -> TradeJournal | None:
    """That of a request; None of a text that stands in no file."""
    if request.file == "-":
        return None
    asked = asdict(replace(request, file=Path(request.file).name, output=None, timings=True, no_lock=True))
    said = {"version": __version__, "asked": asked, "files": lock.hashes(target)}
    return TradeJournal(hashlib.sha256(json.dumps(said, sort_keys=True, default=str).encode()).hexdigest()[:32])
