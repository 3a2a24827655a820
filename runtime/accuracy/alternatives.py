"""What method auto tries, and in which order."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from sysdyn.runtime.accuracy.options import Options, own_tolerances
from sysdyn.runtime.accuracy.way import Way
from sysdyn.runtime.integrate.underlying import rateless
from sysdyn.runtime.model.scales import magnitudes
from sysdyn.runtime.model.system import LARGE, System
from sysdyn.runtime.start.start import ConsistentState

NOT_STIFF = "not stiff"
"""Why method auto stays with the explicit method."""
SMALL = 100
"""Unknowns up to which eight solutions of a step cost less than iterations that converge, of steep laws."""
MEDIUM = 300
"""Unknowns up to which eight solutions of a step cost less than iterations that converge, where no law is steep: nltl
as co_hamiltonian (200) takes 0.4 to 0.7 of radau's CPU at 1e-2 to 1e-6, rc_ladder as co_lagrangian (102) 0.9 to 1.1.
"""

FEW = 30
"""Unknowns up to which the bdf of steep laws at index 2 costs less than eight solutions at index 1 (nonlinear_fluid, 7
unknowns: 0.8 to 0.9 of its CPU); a tube of 71 takes 0.15 to 0.4 of the bdf's, which stability holds at its steps."""
GROWS = 10.0
"""Relative change of a law over that of an unknown, at its magnitude, from which on it turns within a part of that: a
step ends where it does, and the cheapest are the bdf's (diodes 30 and more; friction of turbulent flow 2)."""

COARSE, COARSER = 1e-6, 1e-3
"""Accuracies, of small systems and of medium ones (a beam of 160 takes 0.5 of radau's CPU at 1e-2, 1.4 at 1e-4), below
which more stages, whose orders are higher, cost less than the method without Newton's iteration.
"""


def alternatives(way: Way, written: System, start: ConsistentState, options: Options) -> tuple[Way, ...]:
    """What method auto tries, in this order; `way` among it.

    The explicit method on the underlying equation comes first where there is one and no law is steep: it is by far the
    cheapest on a model that is not stiff, and gives up in a few steps on one that is.
    """
    other = replace(way, method="bdf" if way.method == "radau" else "radau")
    # rtol or atol given: no accuracy to choose a method by
    if own_tolerances(options):
        return way, other
    # index 0 asked for: the explicit method, then the implicit ones
    if way.method == "dopri":
        return replace(way, reason=NOT_STIFF), replace(way, method="radau"), replace(way, method="bdf")
    # a form asked for leaves the choice of the method alone
    if options.index != "auto":
        return replace(way, reason=f"index {way.name} was asked for"), other
    # events that switch: the implicit methods, whose steps end at events
    if options.events and not options.events.bends:
        steep = options.events.of_laws and way.system.form.scales
        first = _rosenbrock_at_index_1(way, written, start, options) if steep else ()
        return _because("events", (*first, way, other))
    # steep laws without such events: a diode in a filter
    if way.system.form.scales:
        return _because("steep laws", _of_steep_laws(way, other, written, start, options))
    system = written.another("0")
    # unknowns without an explicit rate: a massless joint
    missing = rateless(system, start)
    if missing:
        # what was built to look at index 0 is let go
        if system.unknowns > LARGE:
            system.forget()
        return _because(f"no explicit equation for {missing[0]}", (*_without_newton(way, options), way, other))
    return Way("dopri", system, 1, "0", NOT_STIFF), *_without_newton(way, options), way, other


def _without_newton(way: Way, options: Options) -> tuple[Way, ...]:
    """The method that solves a few linear systems a step and iterates for nothing, where it is the cheapest."""
    # every quantity's accuracy counts; the finest decides
    wanted = [a for a in (options.accuracy, *(w for _, w in options.accuracy_on)) if a is not None]
    most = SMALL if way.system.form.scales else MEDIUM
    least = COARSE if way.system.unknowns <= SMALL else COARSER
    serves = way.index <= 1 and way.system.unknowns <= most and min(wanted, default=1.0) >= least
    return (replace(way, method="rosenbrock"),) if serves else ()


def _of_steep_laws(way: Way, other: Way, written: System, start: ConsistentState, options: Options) -> tuple[Way, ...]:
    """Newton's method holds the steps of any method where laws turn, and those of the bdf are the cheapest.  CPU of two
    runs over that of radau's: 0.35 to 0.95 along diode lines of 50 to 1000 sections (which radau does not end at 1e-6),
    0.3 to 1.06 on diode grids of up to 30 x 30, 0.6 to 1.3 along LC lines with diodes of up to 300, 0.3 to 1.1 in tube.
    """
    iterating = (way, other) if way.method == "bdf" else (other, way)
    ways = _without_newton(way, options) + iterating + _radau_at_index_1(way, written, options)
    return _rosenbrock_at_index_1(way, written, start, options) + ways


def _rosenbrock_at_index_1(way: Way, written: System, start: ConsistentState, options: Options) -> tuple[Way, ...]:
    """Rosenbrock at index 1 where steep laws of index 2 do not turn."""
    # a small system gains too little, a large one pays for the dense factors
    if way.index != 2 or not FEW < way.system.unknowns <= SMALL:
        return ()
    reduced = _without_newton(Way("rosenbrock", written.another("1"), 1, "1", reduced=True), options)
    return () if reduced and _turns(written, start, options) else reduced


def _turns(system: System, start: ConsistentState, options: Options) -> bool:
    """Whether a steep law changes by GROWS times as much as an unknown does, in parts, where these are as large as they
    get.
    """
    # slopes where the unknowns are at their largest
    t, y = options.t_start, magnitudes(system, options.t_start, options.t_end, start.y, start.yd)[0]
    slopes = np.abs(system.jacobian(t, y, np.zeros_like(y))[0]) * y[system.pattern.columns_of()]
    # rows that are not steep have size zero and do not count
    sizes = system.steep_sizes(t, y)[system.pattern.row]
    with np.errstate(all="ignore"):
        return not bool((slopes[sizes != 0.0] <= GROWS * sizes[sizes != 0.0]).all())


def _radau_at_index_1(way: Way, written: System, options: Options) -> tuple[Way, ...]:
    """Radau at index 1, where constraints that diodes make and leave hold by their derivatives: of 48 runs of
    rectifiers at random that neither method met at index 2 it met 12.
    """
    # index 1 has no derivatives of constraints to use; events change the constraints
    if way.index < 2 or way.system.unknowns > MEDIUM or options.events:
        return ()
    return (Way("radau", written.another("1"), 1, "1"),)


def _because(reason: str, ways: tuple[Way, ...]) -> tuple[Way, ...]:
    return replace(ways[0], reason=reason), *ways[1:]
