"""States of rest of a model, each with its stability."""

from __future__ import annotations

import time
from dataclasses import field, replace
from typing import Any

import numpy as np
from sysdyn.cli.analysis.linearisation import linearise, loose_of
from sysdyn.cli.analysis.operating_point import Found, compile_target, of_nodes
from sysdyn.cli.analysis.states import model_at_rest, resting
from sysdyn.cli.page.columns import complex_text
from sysdyn.cli.run.request.run_request import RunRequest
from sysdyn.cli.run.request.targets import still
from sysdyn.dsl.model.units import Unit, quantity
from sysdyn.dsl.text.diagnostics import Report
from sysdyn.runtime.accuracy.options import Progress
from sysdyn.runtime.linear.rest import Rest
from sysdyn.runtime.linear.stability import StabilityVerdict, energy_at, verdict
from sysdyn.runtime.linear.tangent import NoLinearisation
from sysdyn.runtime.trace.trace_store import columns_of
from sysdyn.values import dataclass

SHOWN = ("q", "f", "s", "e")
"""Kinds of unknowns that a table shows, flows where they are not zero."""
MOST = 24
"""Values of a state that a table shows."""


@dataclass(frozen=True, slots=True)
class Equilibrium:
    """A state of rest; values: of y by name, in SI with these units; efforts: of the common-effort nodes (an operating
    point), as the scene traces them; judged: None where there is no linearisation, for the reason `why`.
    """

    rest: Rest
    values: dict[str, float]
    kinds: tuple[str, ...]
    units: tuple[str, ...]
    judged: StabilityVerdict | None
    why: str
    efforts: dict[str, tuple[float, Unit]] = field(default_factory=dict)

    def to_json(self) -> dict[str, Any]:
        """The object of --json."""
        judged = self.judged
        energy = judged.energy if judged is not None else None
        return {
            "values": self.values,
            "efforts": {name: value for name, (value, _) in self.efforts.items()},
            "stability": judged.stability if judged is not None else None,
            "by": judged.by if judged is not None else None,
            "why": self.why or None,
            "eigenvalues": [[m.eigenvalue.real, m.eigenvalue.imag] for m in judged.modes] if judged else [],
            "energy": energy.kind if energy is not None else None,
            "stiffness": list(energy.stiffness) if energy is not None else None,
            "conservative": energy.conservative if energy is not None else None,
            "residual": self.rest.residual,
            "free": list(self.rest.free),
            "contacts": self.rest.holding,
        }

    def to_text(self, number: int) -> str:
        """A few lines for the terminal."""
        lines = [f"{number}  {self._judgement()}"]
        # q, s and e, and flows that are not zero
        shown = [
            f"{name} = {value + 0.0:.9g}{'' if unit == '1' else f' {unit}'}"
            for (name, value), kind, unit in zip(self.values.items(), self.kinds, self.units, strict=True)
            if kind in SHOWN and (kind != "f" or value != 0.0)
        ]
        more = [f"... {len(shown) - MOST} more"] if len(shown) > MOST else []
        lines += [f"   {text}" for text in [*shown[:MOST], *more]]
        if self.efforts:
            kept = list(self.efforts.items())[:MOST]
            lines.append(f"   nodes {', '.join(f'{name} = {quantity(value, unit)}' for name, (value, unit) in kept)}")
        if self.rest.holding:
            lines.append(f"   {', '.join(f'{name} {how}' for name, how in list(self.rest.holding.items())[:MOST])}")
        if self.rest.free:
            lines.append(f"   one of a continuum; left open: {', '.join(self.rest.free[:6])}")
        # slowest decay, or fastest growth, first
        if self.judged is not None and self.judged.modes:
            modes = sorted(self.judged.modes, key=lambda m: -m.eigenvalue.real)[:6]
            rest = [f"... {len(self.judged.modes) - 6} more"] if len(self.judged.modes) > 6 else []
            lines.append(f"   eigenvalues {', '.join([*(complex_text(m.eigenvalue, 6) for m in modes), *rest])} 1/s")
        return "\n".join(lines)

    def _judgement(self) -> str:
        """The verdict on stability in words, with the test that decided it."""
        if self.judged is None:
            return f"stability unknown: {self.why}"
        by = {"linearisation": "by the eigenvalues (Lyapunov's indirect method)", "energy": "by the energy test"}
        energy = self.judged.energy if self.judged.stability != "asymptotically stable" else None
        # what the potential is there, where eigenvalues do not decide
        kind = (
            ""
            if energy is None
            else f"; the potential has a {energy.kind}"
            if energy.kind != "flat"
            else ("; the potential is flat in a direction")
        )
        said = (
            "not decided by the eigenvalues"
            if self.judged.stability == "undecided"
            else (f"{self.judged.stability} {by[self.judged.by]}")
        )
        return said + kind


def equilibria(
    request: RunRequest, tries: int, report: Report, progress: Progress | None = None
) -> tuple[Found, tuple[Equilibrium, ...], str] | None:
    """The model and its states of rest, and what is to be said where it has none; None where the report says why it has
    none to be asked of.
    """
    began = 0.0

    # the time that is left, by the time that the tried points took
    def advance(tried: int) -> None:
        """So many points of all; the time left by those that were tried."""
        nonlocal began
        now = time.monotonic()
        began = began if tried else now
        if progress is not None:
            whole, spent = tried / (tries + 1), now - began
            progress(whole, spent * (1.0 - whole) / whole if spent > 1.0 else None)

    # compiled whole, with the efforts of nodes observed
    made = compile_target(request, report, (), of_nodes, (), still)
    if made is None:
        return None
    found, states, why = resting(*made, tries, advance=advance)
    return (
        found,
        tuple(replace(_equilibrium_of(found, rest), efforts=_efforts(model_at_rest(found, rest))) for rest in states),
        why,
    )


def _efforts(here: Found) -> dict[str, tuple[float, Unit]]:
    """Efforts of the nodes at a state in SI, those that are known there; the unit in which each is traced."""
    state = here.state
    if not here.prepared.unasked:
        return {}
    with np.errstate(all="ignore"):
        values = here.system.observe(state.t, state.y, state.yd)
    units = {o.name: o.unit for o in here.prepared.network.observations}
    columns = [(c.name, float(values[c.place])) for c in columns_of(here.system.description)]
    return {
        name.removesuffix(".e"): (value * float(units[name].scale) + float(units[name].offset), units[name])
        for name, value in columns
        if np.isfinite(value)
    }


def _equilibrium_of(found: Found, rest: Rest) -> Equilibrium:
    """A state of rest with its unknowns by name, and the verdict on its stability or why there is none."""
    here = model_at_rest(found, rest)
    system = here.system
    n = system.form.written
    names = dict(zip(system.unknown_names[:n], map(float, rest.state.y), strict=True))
    kinds = tuple(map(str, system.kinds[:n]))
    units = tuple(system.description.families[int(k)].unit for k in system.family_of[:n])
    # a controller that acts at instants
    sampled = next((e.name for e in found.prepared.network.events if e.period is not None), None)
    if sampled is not None:
        return Equilibrium(rest, names, kinds, units, None, f"eigenvalues do not know what '{sampled}' does")
    try:
        small = linearise(here, ()).reduced
    except NoLinearisation as error:
        return Equilibrium(rest, names, kinds, units, None, str(error))
    # the energy test needs a potential of displacements
    primal = found.prepared.formulation in ("lagrangian", "hamiltonian")
    with np.errstate(all="ignore"):
        energy = energy_at(system, rest.state) if primal else None
    return Equilibrium(rest, names, kinds, units, verdict(small, loose_of(here), energy, rest.together), "")
