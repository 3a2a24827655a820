"""The state that a run comes to: nothing is traced.

Receives a consistent start, its structure and options (t_end: the instant asked); hands on a `ConsistentState`, its
multipliers and rates those that all rows give there.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from sysdyn.runtime.accuracy.alternatives import alternatives
from sysdyn.runtime.accuracy.options import Options, choose_method
from sysdyn.runtime.accuracy.way import LONG, Way
from sysdyn.runtime.integrate.integrate import Integration
from sysdyn.runtime.integrate.request import LONGEST, Request
from sysdyn.runtime.model.description import Floats
from sysdyn.runtime.model.failures import SolverFailure
from sysdyn.runtime.model.system import System
from sysdyn.runtime.simulate import form_system, without_redundant
from sysdyn.runtime.start.start import ConsistentState
from sysdyn.runtime.structure.structure import Structure

RTOL = 1e-10
"""The solver's own tolerance where none is asked: the state is what the linearisation stands on."""


def arrival(
    written: System, start: ConsistentState, facts: Structure, options: Options
) -> tuple[System, ConsistentState]:
    """The system as written (without redundant rows that are left out) and its state at options.t_end.

    Raises NoSuchForm, WrongOption, SolverFailure.
    """
    written, start, facts = without_redundant(written, start, facts, options)
    # no time passes: the start itself
    if options.t_end <= start.t:
        return written, start
    begin = written.description.p.copy(), written.description.switches.active.copy()  # events write there
    system, index, _ = form_system(written, start, facts, options)
    way = Way(choose_method(options), system, index, "")
    # without accuracy no method is left for its sake
    controlled = replace(options, rtol=None, atol=None)
    ways = (way,) if options.method != "auto" else alternatives(way, written, start, controlled)
    # the next method takes over where one fails
    for k, way in enumerate(ways):
        try:
            return written, _run_to_end(way, start, options, begin, last=k + 1 == len(ways))
        except SolverFailure as failure:
            # the last one, or a limit that no method lifts
            if k + 1 == len(ways) or failure.cause in ("max_wall", "memory"):
                raise
    raise AssertionError


def _run_to_end(
    way: Way, start: ConsistentState, options: Options, begin: tuple[Floats, NDArray[np.bool_]], *, last: bool
) -> ConsistentState:
    """One run without rows, then the point it came to on all rows."""
    request = Request(
        t_end=options.t_end,
        instants=np.array([options.t_end]),
        every_step=False,
        rtol=options.rtol or RTOL,
        atol=options.atol,
        max_steps=options.max_steps if last else min(options.max_steps or LONG, LONG),
        max_wall=options.max_wall,
        h_max=min(LONGEST * (options.t_end - options.t_start), options.longest or np.inf),
        index=way.index,
        stops=options.stops,
        method=way.method,
        stiff_steps=1e5,
        events=options.events or None,
        begin=begin,
        condense=False,
        least_norm=options.redundancy == "minimum_norm" and way.system.leaves_out,
    )
    run = Integration(way.system, start, request)
    run.run(_nothing, spent=False)
    n = way.system.form.written
    y, yd = run.method.point()
    # onto all rows once more
    y, yd, settled = run.settler.settle(options.t_end, y[:n], yd[:n])
    if not settled:
        raise SolverFailure("newton", options.t_end, 0.0)
    return ConsistentState(options.t_end, y.copy(), yd.copy(), (), 0.0)


def _nothing(rows: Floats) -> None:
    """Rows are not wanted."""
