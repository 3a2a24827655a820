"""One random event model run to its end, and what became of it.

met: the run is met by its own estimate and its energy books; refused: it is not, and says why (a diagnostic, or the
quantity that missed); fault: it ended otherwise, or its books are open and it did not say so; hung: it did not end.
"""

import signal
import time
from contextlib import contextmanager
from dataclasses import dataclass

from sysdyn.cli.run.request.run_request import RunRequest
from sysdyn.cli.run.running import run
from sysdyn.dsl.text.diagnostics import ModelError, Report

LONGEST = 60
"""Seconds of wall time after which a run hangs."""
KINDS = ("met", "refused", "fault", "hung")


@dataclass(frozen=True)
class Verdict:
    """kind: of KINDS; reason: its diagnostic; events, steps; cpu seconds of its integration, wall of all."""

    number: int
    family: str
    kind: str
    reason: str
    events: int = 0
    steps: int = 0
    cpu: float = 0.0
    wall: float = 0.0


class _HungError(BaseException):
    """The run did not end."""


@contextmanager
def _limited(seconds):
    def over(*_):
        raise _HungError

    before = signal.signal(signal.SIGALRM, over)
    signal.alarm(seconds)
    try:
        yield
    finally:
        signal.alarm(0)
        signal.signal(signal.SIGALRM, before)


def judge(folder, drawn, **options):
    """The verdict on a model; folder: where its text and trace may stand."""
    path = folder / "model.sd"
    path.write_text(drawn.text, encoding="utf-8")
    report, began = Report(), time.monotonic()

    def verdict(kind, reason, *numbers):
        return Verdict(drawn.number, drawn.family, kind, reason, *numbers, wall=time.monotonic() - began)

    try:
        with _limited(LONGEST):
            found = run(RunRequest(str(path), scene="s", output=str(folder / "trace.h5"), **options), report)
    except _HungError:
        return verdict("hung", f"not ended after {LONGEST} s")
    except ModelError as error:
        return verdict("refused", str(error.diagnostics[0].message))
    except Exception as error:
        return verdict("fault", f"{type(error).__name__}: {error}")
    said = "; ".join(f"{d.code} {d.message}" for d in report.diagnostics if d.severity == "error")
    if found is None:
        return verdict("refused" if said else "fault", said)
    outcome = found.outcome
    numbers = len(outcome.events), outcome.statistics["steps"], outcome.timings["cpu_integrate_s"]
    if outcome.met and "energy" not in outcome.judgement.judged and drawn.family not in ("relays",):
        return verdict("fault", "no ledger judges it", *numbers)
    if outcome.met:
        return verdict("met", "", *numbers)
    return verdict("refused" if said else "fault", said, *numbers)
