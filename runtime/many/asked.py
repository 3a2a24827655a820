"""What can be asked of runs in the core, what comes back, and why a model's runs are made one by one."""

from __future__ import annotations

import numpy as np
from sysdyn.runtime.accuracy.alternatives import alternatives
from sysdyn.runtime.accuracy.options import Options, choose_method
from sysdyn.runtime.accuracy.way import Way
from sysdyn.runtime.model.description import Floats, Ints
from sysdyn.runtime.model.system import System
from sysdyn.runtime.simulate import form_name, form_system, without_redundant
from sysdyn.runtime.start.start import ConsistentState
from sysdyn.runtime.structure.structure import Structure
from sysdyn.values import dataclass

DONE = 0
WHY = ("", "start", "structure", "stopped", "accuracy", "energy", "claim")
"""What kept a run from a result, by its state."""
END, EXTREMA, TRACES, ROWS = range(4)
"""What is kept of a run: end values alone, least and largest too, some rows of its trace too; all rows of the last one,
which is then handed back as a trace."""


class NotApplicableError(Exception):
    """Why runs of a model cannot be made this way: a sentence."""


@dataclass(frozen=True, slots=True)
class Claim:
    """An expectation on observed quantities: names of its sides (within None: nothing is granted); operator; moment
    always, finally, or at an instant [s].
    """

    left: str
    right: str
    within: str | None
    operator: str
    moment: str
    at: float = 0.0


@dataclass(frozen=True, slots=True)
class Results:
    """Of runs [k]: state (DONE, or what `WHY` names), steps, estimate (relative), cpu [s]; end, least, most [k,
    quantities]; traces [k, quantities, rows kept].
    """

    state: Ints
    steps: Ints
    estimate: Floats
    cpu: Floats
    end: Floats
    least: Floats
    most: Floats
    traces: Floats


def way_of(
    written: System, start: ConsistentState, facts: Structure, options: Options, method: str
) -> tuple[Way, ConsistentState]:
    """The way with the method that a nominal run took, and the start in its layout."""
    # as `simulate` begins: redundant constraints, index form, method
    written, start, facts = without_redundant(written, start, facts, options)
    system, index, _ = form_system(written, start, facts, options)
    first = Way(choose_method(options), system, index, form_name(system, facts))
    ways = (first,) if options.method != "auto" else alternatives(first, written, start, options)
    # the way that the nominal run took
    found = next((way for way in ways if way.method == method), None)
    if found is None:
        raise NotApplicableError(f"the nominal run took method {method}")
    return found, start


def obstacle(options: Options) -> str | None:
    """Why runs with these options are made one by one; None where nothing is in the way."""
    # nothing asked of any quantity
    if options.accuracy is None and not options.accuracy_on:
        return "the solver's own tolerances are given: there is no accuracy to be controlled"
    # tolerances of the user
    if options.rtol is not None or options.atol is not None or options.method == "euler":
        return "the solver's own tolerances are given: there is no accuracy to be controlled"
    # events need Python between steps
    if options.events:
        return "the model has events"
    # stops of sources: other numbers have other ones
    if options.stops is not None and np.isfinite(np.asarray(options.stops)).any():
        return "the text jumps or has kinks in time"
    if options.redundancy == "minimum_norm":
        return "redundancy minimum_norm"
    if options.to_range:
        return "the accuracy of a quantity is relative to its range"
    if options.accuracy_check:
        return "a second opinion is asked for"
    if options.max_wall is not None:
        return "the wall time of a run is limited"
    return None
