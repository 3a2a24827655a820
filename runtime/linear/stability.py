"""Stability of a state of rest: Lyapunov's indirect method, and the energy test of Lagrange and Dirichlet.

Indirect: of the motion beside it, x' = a x without the states that nothing depends on, every eigenvalue in the open
left half plane: asymptotically stable; one in the open right half plane: unstable; else the linearisation does not
decide.

Energy: on the virtual displacements, the null space of [Phi_q; Psi_f], the balances have the stiffness
K = V_qq + (Phi_q^T kappa)_q.  Where K is symmetric there and no effort depends on a flow but those of dissipators, a
minimum (K > 0) is stable; without dissipators and gyroscopic efforts a direction with K < 0 is unstable.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from sysdyn.runtime import tuning
from sysdyn.runtime.linear.modes import Eigenmode, balance_matrix, modes
from sysdyn.runtime.linear.tangent import Reduced
from sysdyn.runtime.model.description import Floats
from sysdyn.runtime.model.system import System
from sysdyn.runtime.numerics.equilibrate import equilibrate
from sysdyn.runtime.numerics.rank import null_space
from sysdyn.runtime.start.start import ConsistentState
from sysdyn.values import dataclass

STILL = tuning.OPEN
"""Real part of an eigenvalue, relative to the largest one, that decides nothing: half the digits of a double root."""
FLAT = tuning.SAME
"""Of the largest stiffness: what is below is none."""


@dataclass(frozen=True, slots=True)
class EnergyTest:
    """kind: minimum, maximum, saddle or flat; stiffness: eigenvalues of K on unit virtual displacements, rising;
    conservative: no dissipation and no gyroscopic effort.
    """

    kind: str
    stiffness: tuple[float, ...]
    conservative: bool


@dataclass(frozen=True, slots=True)
class StabilityVerdict:
    """stability: asymptotically stable, stable, unstable or undecided; by: linearisation or energy."""

    stability: str
    by: str
    modes: tuple[Eigenmode, ...]
    energy: EnergyTest | None


def verdict(small: Reduced, loose: NDArray[np.bool_], energy: EnergyTest | None, together: int = 0) -> StabilityVerdict:
    """What both methods say together; loose [unknowns]: what nothing depends on; together: directions in which
    displacements move without changing anything: so many eigenvalues at zero say nothing.
    """
    # states that something depends on
    felt = np.flatnonzero((small.places >= 0) & ~loose[small.places])
    values = np.linalg.eigvals(balance_matrix(small.a[np.ix_(felt, felt)])[0]) if felt.size else np.zeros(0)
    near = STILL * float(np.abs(values).max(initial=0.0))
    # as many eigenvalues at zero as directions move freely say nothing
    values = values[np.argsort(np.abs(values))]
    values = values[min(together, int((np.abs(values) <= near).sum())) :]
    found = modes(small.a, small.decomposed)
    # Lyapunov: one in the right half plane
    if (values.real > near).any():
        return StabilityVerdict("unstable", "linearisation", found, energy)
    # all in the left half plane
    if (values.real < -near).all():
        return StabilityVerdict("asymptotically stable", "linearisation", found, energy)
    # eigenvalues on the axis: the potential decides (Lagrange, Dirichlet)
    if energy is not None and energy.kind == "minimum":
        return StabilityVerdict("stable", "energy", found, energy)
    # no minimum and nothing dissipates: unstable (Chetayev)
    if energy is not None and energy.kind in ("maximum", "saddle") and energy.conservative:
        return StabilityVerdict("unstable", "energy", found, energy)
    # on the axis, and the energy says nothing
    return StabilityVerdict("undecided", "linearisation", found, energy)


def energy_at(system: System, state: ConsistentState) -> EnergyTest | None:
    """The energy test at a state of rest; None where it says nothing: steady motion, efforts that effort constraints or
    dynamic variables give, or that have no potential.  system: the form as written of a primal formulation.
    """
    # steady motion: the potential of rest does not apply
    if np.abs(state.y[system.kinds[: state.y.size] == "f"]).any():
        return None
    settled = system.another("settled")
    jy, _ = settled.jacobian(state.t, state.y, state.yd)
    full = settled.dense(jy)
    flows, places, balances = _coordinates(settled)
    # efforts from constraints or dynamic variables have no potential
    if full[np.ix_(balances, np.flatnonzero(np.isin(settled.kinds, ("e", "s"))))].any():
        return None
    # stiffness and damping by displacements and flows of the coordinates
    stiff = np.where(places >= 0, full[np.ix_(balances, np.maximum(places, 0))], 0.0)
    loss = full[np.ix_(balances, flows)]
    bound = _bound(settled, full, flows, places)
    # virtual displacements: what the constraints leave free
    free = null_space(equilibrate(bound)[0]) if bound.size else np.eye(flows.size)
    stiff, loss = (free.T @ part @ free for part in (stiff, loss))
    # the constraints hold everything
    if not stiff.size:
        return None
    size = float(np.abs(stiff).max())
    # gyroscopic or circulatory: damping that is not symmetric
    turning = float(np.abs(loss - loss.T).max()) > FLAT * max(float(np.abs(loss).max()), 1e-300)
    worst = float(np.linalg.eigvalsh((loss + loss.T) / 2.0).min())
    active = worst < -FLAT * float(np.abs(loss).max())
    # no potential, or energy that something brings in
    if not np.isfinite(stiff).all() or np.abs(stiff - stiff.T).max() > FLAT * size or active:
        return None
    values: Floats = np.asarray(np.linalg.eigvalsh((stiff + stiff.T) / 2.0), dtype=np.float64)
    return EnergyTest(_kind(values), tuple(map(float, values)), not turning and not np.abs(loss).any())


def _kind(values: Floats) -> str:
    # all above, all below, both, or none but round-off
    near = FLAT * float(np.abs(values).max(initial=0.0))
    if (values > near).all():
        return "minimum"
    if (values < -near).all():
        return "maximum"
    return "saddle" if (values < -near).any() else "flat"


def _coordinates(settled: System) -> tuple[Floats, Floats, Floats]:
    """Of each coordinate: place of its flow, of its displacement (-1: it has none), row of its balance."""
    families, form = settled.description.families, settled.form
    first = {settled.description.rows[k].owner: row for group, k, row in form.groups if group == "dynamics"}
    displacement = {f.owner: int(form.at[k]) for k, f in enumerate(families) if f.kind == "q"}
    nothing = np.zeros(0, dtype=np.int64)
    flows: list[NDArray[np.integer]] = [nothing]
    places: list[NDArray[np.integer]] = [nothing]
    rows: list[NDArray[np.integer]] = [nothing]
    for k, family in enumerate(families):
        # coordinates have flows; displacements some of them
        if family.kind != "f":
            continue
        here = np.arange(family.size)
        flows.append(form.at[k] + here)
        # a coordinate without displacement: its place is -1
        own = displacement.get(family.owner)
        places.append(own + here if own is not None else np.full(family.size, -1))
        rows.append(first[family.owner] + here)
    return tuple(np.concatenate(part).astype(np.int64) for part in (flows, places, rows))  # type: ignore[return-value]


def _bound(settled: System, full: Floats, flows: Floats, places: Floats) -> Floats:
    """[Phi_q; Psi_f] of the constraints that hold."""
    # constraints that do not hold now bind nothing
    idle = set(settled.idle_multipliers().tolist())
    parts = []
    for group, k, row in settled.form.groups:
        size = settled.description.rows[k].size
        if group not in ("phi", "psi"):
            continue
        # by displacements for phi, by flows for psi
        block = full[row : row + size]
        part = np.where(places >= 0, block[:, np.maximum(places, 0)], 0.0) if group == "phi" else block[:, flows]
        parts.append(part[[r for r in range(size) if _multiplier(settled, k, r) not in idle]])
    return np.vstack([np.zeros((0, flows.size)), *parts])


def _multiplier(settled: System, row: int, position: int) -> int:
    """Place of the multiplier of a constraint's row."""
    # phi has kappa, psi has mu
    own = settled.description.rows[row]
    kind = "kappa" if own.block == "phi" else "mu"
    families = settled.description.families
    k = next(k for k, f in enumerate(families) if f.kind == kind and f.owner in (own.owner, own.label))
    return int(settled.form.at[k]) + position
