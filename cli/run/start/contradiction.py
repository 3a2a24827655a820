"""What stands in the way of a consistent start, in the author's words (E903, E505, E510, E519).

A parameter that is zero takes an inertia, a stiffness or a ratio away, and with it the freedom to start where the text
says. Which one it is is tried out: with 1 in the place of the zero the start exists.
"""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
from sysdyn.cli.page.unit_text import read_unit
from sysdyn.cli.run.events import plan
from sysdyn.cli.run.prepare import Prepared, place_at
from sysdyn.cli.run.start.author import names_of
from sysdyn.cli.run.start.flat_laws import by_element
from sysdyn.dsl.model.dimensions import TIME
from sysdyn.dsl.model.expression import variables
from sysdyn.dsl.model.network import Parameter
from sysdyn.dsl.model.units import multiply, quantity, si
from sysdyn.dsl.text.diagnostics import ModelError, Place, Related, Report
from sysdyn.runtime.events.start import eventful_start
from sysdyn.runtime.model.failures import InconsistentStart, RowLabel, SolverFailure
from sysdyn.runtime.model.slopes import WITH_A_SLOPE, no_slope
from sysdyn.runtime.model.system import System
from sysdyn.runtime.numerics.rank import NotFiniteError
from sysdyn.runtime.numerics.work import Budget

MOST = 20
"""Zeros that are tried out: more are values of a table, not slips."""

RATES = {"phi_rate": 1, "psi_rate": 1, "phi_acceleration": 2}
"""Rows that are derivatives of what the text says: how often by time."""


def place_of(prepared: Prepared, label: RowLabel) -> Place:
    """Where a row or a value stands in the text."""
    return place_at(prepared.network, label.file, label.line)


def inconsistent(
    prepared: Prepared, t0: float, error: InconsistentStart, report: Report, until: float | None = None
) -> None:
    """Report why there is no start; until: `time.monotonic()` at which no more is tried."""
    where = place_of(prepared, error.rows[0]) if error.rows else prepared.network.place
    names = ", ".join(dict.fromkeys(_row_text(r) for r in error.rows)) or ", ".join(error.names)
    fixed_at = dict.fromkeys(place_of(prepared, c) for c in error.candidates)  # a line may fix several
    related = [Related("this value is fixed", place) for place in fixed_at]
    # a place that the author can change comes first
    if where.source is not prepared.network.place.source and related:  # the law of an element of a library
        related, where = [*related[1:], Related(f"the law of {names}", where)], related[0].place
    elif where == prepared.network.place and related:  # a row of no statement: what is fixed twice
        related, where = related[1:], related[0].place
    match error.kind:
        # the gammas alone have no solution there
        case "gamma":
            left = f"the residual cannot fall below {_residual(error)}"
            report.error("E519", f"gamma '{names}' has no solution at the start: {left}", where, related=related)
        # their slope in an unknown vanishes
        case "implicit":
            report.error("E505", f"the gammas do not determine {', '.join(error.names)} at the start", where)
        # a law without slope, by which the start cannot be found
        case "slope":
            report.error("E903", f"no start: {no_slope(by_element(prepared, error.rows))}", where, help=WITH_A_SLOPE)
        case "nonfinite" if not names:
            message = "the equations are no numbers at the start: products or quotients beyond 1e308?"
            sizes = "look at the sizes of parameters and initial values"
            report.error("E519", message, prepared.network.place, help=sizes)
        # something is no number at the guesses
        case "nonfinite":
            message = f"{names} is not a number at the initial values: a root or logarithm out of its range?"
            report.error("E519", message, where)
        # a parameter of zero that makes it impossible
        case _ if zero := _zero(prepared, t0, until):
            said = f"with {zero.name} = {quantity(0.0, zero.unit)} there is no start"
            left = f"{_residual(error)} is left over in {names}"
            free = f", or '~' for '=' of {_fixed_values(prepared, error)}" if error.candidates else ""
            here = [Related("this is left over", where), *related]
            report.error("E903", f"{said}: {left}", zero.place, help=f"{zero.name} other than zero{free}", related=here)
        # fixed values of which one has to be freed
        case _ if error.candidates:
            message, help_ = _contradicting(prepared, error, names)
            report.error("E903", message, where, help=help_, related=related)
        # an initial value against constraints
        case "fixed" if any(row.kind == "initial" for row in error.rows):
            message = f"an initial value contradicts the constraints: residual {_residual(error)}"
            report.error("E903", message, where, help="the value that they leave, or '~' for '='")
        # one row that no guess near it meets
        case "fixed" if len({row.label for row in error.rows}) == 1:  # nothing contradicts it
            message = f"no start was found near the guesses: {_residual(error)} is left over in {names}"
            help_ = "a guess, 0 where none is written, from which it can be reached: coord x: translation ~ 1 m"
            report.error("E510", message, where, help=f"{help_}; or correct it")
        # constraints against each other
        case "fixed":
            left = _residual(error)
            report.error(
                "E510", f"the constraints contradict each other at the start: residual {left} in {names}", where
            )
        # contacts that can neither hold nor be open
        case _ if not np.isfinite(error.residual):
            message = f"no start fits: what holds would let go at once, and hold at once where it does not: {names}"
            there = next((s.place for s in prepared.network.switches if s.name in error.names), where)
            report.error("E903", message, there, help="initial values of all that it ties: init ... = ...")
        # no number wherever it was tried
        case _ if not names:
            message = "no start was found: wherever it was sought the equations are no numbers"
            help_ = "a guess of what stands below a division, in a root, a logarithm or an exponential: init ... ~ ..."
            report.error("E903", message, where, help=help_)
        # what is left over, with the nearest remedy
        case _:
            message = f"no consistent start was found: {error.residual:.3g} of the terms is left over in {names}"
            report.error("E903", message, where, help=_nearer(prepared, error))


def _contradicting(prepared: Prepared, error: InconsistentStart, names: str) -> tuple[str, str]:
    """Fixed values that contradict each other, or rows (names); what may be freed."""
    fixed = _fixed_values(prepared, error)
    left = f"{names}: residual {_residual(error)}"
    own = {r.label.rstrip("'") for r in error.rows} <= {c.label.rstrip("'") for c in error.candidates}
    itself = own and all(not r.file for r in error.rows)
    message = f"fixed initial values of {fixed} contradict {left}"
    if itself:
        left = _residual(error)
        message, fixed = f"fixed initial values contradict each other: {fixed}, residual {left}", "them"
    among = "one of " if itself or len(set(fixed.split(", "))) > 1 else ""
    free = f"free {among}{fixed}: '~' for '='"
    still = [r.label for r in error.rows if r.kind == "dynamics" and _without_inertia(prepared, r.label)]
    free += f"; or {still[0]} lacks an inertia: energy T* = 1/2*m*{still[0]}'^2" if still else ""
    gaps = {switch.name for switch in prepared.network.switches if switch.kind == "phi"}
    struck = not itself and any(r.label in gaps for r in error.rows)
    return message, free + ("; or the rate behind the impact: a run begins when it is over" if struck else "")


def _nearer(prepared: Prepared, error: InconsistentStart) -> str:
    """What may help where nothing is found: no guess mends a short circuit."""
    sides = {switch.name for switch in prepared.network.switches}
    one = next((r.label for r in error.rows if re.sub(r"\[.*", "", r.label) in sides), None)
    given = f"a resistance in series with {one}, which passes or stops all that the others ask for"
    help_ = "guesses nearer to a solution: init ... ~ ..."
    return help_ if one is None else f"{given}; else {help_}"


def _row_text(row: RowLabel) -> str:
    """A row by its name; what an `init` says of an expression has none."""
    return f"the value at line {row.line}" if row.label == row.kind == "initial" and row.line else row.label


def _without_inertia(prepared: Prepared, name: str) -> bool:
    """Whether a coordinate that the text declares moves nothing that has a kinetic energy."""
    network = prepared.network
    if all(c.name != name for c in network.coordinates) or network.branches:
        return False
    kinetic = [e.expression for e in network.energies if e.function in ("T*", "T")]
    return all(n.op != "var" or n.data[0] != name for root in kinetic for n in variables(root))


def _fixed_values(prepared: Prepared, error: InconsistentStart) -> str:
    """The fixed values to free, as the author writes them: `x'`, and `shaft.f` of a node or an element."""
    places = [place_of(prepared, c) for c in error.candidates]
    names = names_of(prepared.network, (c.label for c in error.candidates))
    shown = []
    for name, place in zip(names, places, strict=True):
        written = re.match(r"init\s+([^=~:]+?)\s*[=~]", place.source.text[place.span.start : place.span.end])
        alone = written and ".." not in written[1] and places.count(place) == 1
        shown.append(written[1] if written and alone else name)
    return ", ".join(f"'{name}'" for name in dict.fromkeys(shown))


def _residual(error: InconsistentStart) -> str:
    """What is left over, in the unit of the row, or of what is fixed twice."""
    row = next(iter((*error.rows, *error.candidates)), RowLabel(""))
    known = read_unit(row.unit)
    unit = si(multiply(known.dimension, TIME, -RATES.get(row.kind, 0))).text if known else "1"
    return f"{error.residual:.3g}{f' {unit}' if unit != '1' else ''}"


def _zero(prepared: Prepared, t0: float, until: float | None) -> Parameter | None:
    """The parameter that is zero and without which there is no start: with 1 in its place there is one."""
    values = prepared.binding.values
    zeros = [
        p for p in prepared.network.parameters if np.ndim(values.get(p.name, 1.0)) == 0 and not values.get(p.name, 1)
    ]
    budget = Budget(until)
    for p in zeros[:MOST]:
        if p.name in prepared.network.discretes or p.whole:
            continue
        try:
            binding = prepared.compiled.bind({p.name: 1.0})
            system = System(prepared.structure, prepared.arrays_of(binding), prepared.carrier)
            with np.errstate(all="ignore"):
                eventful_start(system, t0, plan(replace(prepared, binding=binding), system), budget)
        except SolverFailure:  # no time is left
            return None
        except (InconsistentStart, NotFiniteError, ModelError):
            continue
        return p
    return None
