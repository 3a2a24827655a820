"""Facts of a formulation at its start that verify reads beside the traces.

The residuals of the C and the NumPy carrier at a few seeded points, and the multipliers that redundant constraints
leave free: those in a vanishing combination of rows of [Phi_q; Psi_f].
"""

from __future__ import annotations

import numpy as np
from sysdyn.cli.run.prepare import Prepared, prepare
from sysdyn.cli.run.start.starting import Started
from sysdyn.dsl.model import expression as ex
from sysdyn.dsl.text.diagnostics import Report
from sysdyn.names import trace_name
from sysdyn.runtime.model.system import System
from sysdyn.runtime.structure.redundancy import combination, dependent, reactions
from sysdyn.values import dataclass

POINTS = 5
ROUNDING = 1e-9
"""Difference allowed between carriers, of the largest residual of a row over the points: sums are ordered apart."""


@dataclass(frozen=True, slots=True)
class Twins:
    """Both carriers of a formulation: the largest relative difference of their residuals, and the row that has it."""

    formulation: str
    backends: tuple[str, str]
    difference: float
    row: str

    @property
    def agree(self) -> bool:
        """Within rounding."""
        return self.difference <= ROUNDING


def twins(prepared: Prepared, started: Started, until: float) -> Twins | None:
    """Residuals of both carriers between the start and `until` [s]; None where there is but one carrier."""
    # the same rows by the other carrier
    other = prepare(
        prepared.network,
        Report(),
        formulation=prepared.formulation,
        backend="c" if prepared.backend == "numpy" else "numpy",
        traced=True,
    )
    if other is None or other.backend == prepared.backend:
        return None
    # what holds at the start, the senses of friction, constants of integrated rows were found with the first carrier
    system = started.system
    twin = System(other.structure, {**other.arrays, "p": np.array(system.description.p)}, other.carrier)
    twin.description.switches.set(system.description.switches.active)
    y, yd = started.state.for_form(system)
    random = np.random.default_rng(1)
    here, there = np.zeros((POINTS, system.rows)), np.zeros((POINTS, system.rows))
    # around the start, at instants over the span
    for k in range(POINTS):
        t = started.state.t + (until - started.state.t) * k / POINTS
        point, rate = (x + 1e-2 * random.standard_normal(x.size) * np.where(x == 0.0, 0.1, x) for x in (y, yd))
        with np.errstate(all="ignore"):  # a point may lie outside the range of a root or logarithm
            here[k], there[k] = system.residual(t, point, rate), twin.residual(t, point, rate)
    # no number in both is no difference
    apart = np.where(np.isfinite(here) | np.isfinite(there), np.abs(here - there), 0.0)
    size = np.max(np.abs(np.where(np.isfinite(here), here, 0.0)), axis=0, initial=0.0)
    ratio = np.max(np.where(np.isnan(apart), np.inf, apart), axis=0, initial=0.0) / np.where(size > 0.0, size, 1.0)
    k = int(np.argmax(ratio)) if ratio.size else -1
    label = system.row_label(k).label if ratio.size else ""
    return Twins(prepared.formulation, (prepared.backend, other.backend), float(np.max(ratio, initial=0.0)), label)


def free_quantities(prepared: Prepared, started: Started) -> tuple[str, ...]:
    """Traced quantities, as the trace names them, that read a multiplier of a redundant group."""
    free = free_multipliers(started)
    quantities = prepared.compiled.energies.quantities if free else ()
    found = [q.name for q in quantities if q.stored and any(n.data[0] in free for n in _multipliers(q.expression))]
    return tuple(trace_name(name) for name in found)


def _multipliers(expression: ex.Node) -> list[ex.Node]:
    return [n for n in ex.variables(expression) if n.op == "var" and n.data[1] in ("kappa", "mu")]


def free_multipliers(started: Started) -> frozenset[str]:
    """Names of the constraints in a redundant group: their multipliers are not unique."""
    if not started.facts.redundant:
        return frozenset()
    system = started.system
    y, yd = started.state.for_form(system)
    found = reactions(system, system.jacobian(started.state.t, y, yd)[0])
    free = found.multipliers[np.abs(combination(found, dependent(found))) > 1e-8]
    families = {int(k) for k in system.family_of[free]}
    return frozenset(system.description.families[k].owner for k in families)
