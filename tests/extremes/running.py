"""One run of a text by the command's own function, and what a test asks of it."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from sysdyn.cli.run.request.run_request import RunRequest
from sysdyn.cli.run.running import run
from sysdyn.dsl.text.diagnostics import Report


@dataclass(frozen=True)
class Ran:
    """refused: why there is no complete trace, "" where there is one; met: by the run's own estimate; notes: codes."""

    refused: str
    met: bool
    outcome: object = None
    trace: object = None
    notes: frozenset = frozenset()

    def at(self, name, times):
        """Values at instants of the trace [s]; after a jump where one is there twice."""
        stored = np.asarray(self.trace.time)
        place = np.searchsorted(stored, times + 1e-9 * (stored[-1] - stored[0]), side="right") - 1
        assert np.abs(stored[place] - times).max() <= 1e-8 * (stored[-1] - stored[0])
        return np.asarray(self.trace[name])[place]


def ran(folder, text, **options):
    """A run of a text (or of a file that exists)."""
    path = Path(text) if isinstance(text, Path) else folder / "model.sd"
    if path.parent == folder:
        path.write_text(text, encoding="utf-8")
    report = Report()
    found = run(RunRequest(str(path), output=str(folder / "trace.h5"), **options), report)
    if found is None:
        return Ran(" ".join(d.code for d in report.diagnostics if d.severity == "error") or "no run", False)
    outcome = found.outcome
    if outcome.failure is not None:
        return Ran(str(outcome.failure), False, outcome)
    notes = frozenset(d.code for d in report.diagnostics)
    return Ran("", outcome.met, outcome, outcome.traced, notes)
