"""One case run and judged: right, refused by its own judgement, refused falsely, silently wrong, unbounded.

Every case has a solution that doubles can hold, so that a finding instead of a run is a false one; a run that says it
is not met is an honest one.
"""

import re
import time
from dataclasses import dataclass

import numpy as np
from case import Case, Family
from running import ran

RIGHT = 3.0
"""Times the accuracy asked that a run which says it is met may be off."""
WALL = 120.0
"""Seconds of wall time after which a case is unbounded."""
TAU = 1e-9
"""Of the span: the time tolerance of `diff`, which a steep front is given."""
MOST = 400
"""Instants that are compared."""


@dataclass(frozen=True)
class Verdict:
    """kind: right, refused, falsely, wrong, unbounded; ratio: error over accuracy (nan without a trace); reason: of a
    refusal.
    """

    family: str
    case: str
    x: float
    kind: str
    ratio: float
    reason: str
    seconds: float


def judge(folder, family: Family, case: Case) -> Verdict:
    """The verdict on one case."""
    settings = tuple((name, repr(float(value))) for name, value in case.values.items())
    began = time.monotonic()
    run = ran(
        folder, family.text, scene="run", settings=settings, until=repr(float(case.until)), accuracy=case.accuracy,
        max_wall=repr(WALL), **case.options,
    )  # fmt: skip
    seconds = time.monotonic() - began
    ratio = np.nan if run.trace is None else worst(run, family, case) / case.accuracy
    if ratio > RIGHT:
        ratio = worst(run, family, case, TAU * case.until) / case.accuracy
    reason = run.refused if run.refused else "" if run.met else "not met by its own estimate or ledger"
    if "limit of wall time" in reason or "max_wall" in reason:
        kind = "unbounded"
    elif reason:
        kind = "falsely" if run.trace is None else "refused"
    else:
        kind = "right" if ratio <= RIGHT else "wrong"
    reason = re.sub(r"\s+", " ", reason)
    return Verdict(family.name, case.name, case.x, kind, float(ratio), reason, seconds)


def worst(run, family: Family, case: Case, tau: float = 0.0) -> float:
    """Largest error of any traced quantity, relative to its largest value over the span; within tau [s] in time."""
    stored = np.asarray(run.trace.time)
    kept = np.unique(np.linspace(0, stored.size - 1, MOST).astype(int))
    t, first = np.unique(stored[kept], return_index=True)
    wanted = [family.wanted(s, case.values) for s in ((t,) if tau == 0.0 else (np.maximum(t - tau, t[0]), t, t + tau))]
    found = 0.0
    for name in wanted[0]:
        got = np.asarray(run.trace[name])[kept][first]
        band = np.array([w[name] for w in wanted])
        size = np.max(np.abs(band))
        if "N922" in run.notes:  # it says itself that this is a difference of large numbers
            size = max(size, run.trace[name].nominal)
        error = np.max(np.maximum(np.maximum(band.min(axis=0) - got, got - band.max(axis=0)), 0.0))
        found = max(found, error / size if size > 0.0 else (0.0 if error == 0.0 else np.inf))
    return found if np.isfinite(found) else np.inf
