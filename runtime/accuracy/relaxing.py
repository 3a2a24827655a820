"""Whether a model can do nothing but relax: no motion of its own rings, whatever its numbers.

Slopes that never change make of the rows, for motions e^(sigma t), S(sigma) x = source, where x are the flows f and the
multipliers: D = K / sigma + R + sigma M between flows and coordinates, and what constraints ask beside what they react
with. With K, R, M symmetric, K or M absent (one sort of store) and reactions that are the transposed constraints (no
gyrator, no controlled source) sigma solves an eigenvalue problem of two symmetric matrices, one of which is definite
where stores hold what they take: it is real.

Received: the system and its start; handed on: yes or no.
"""

from __future__ import annotations

import numpy as np
from sysdyn.runtime.model.description import Description, Floats, Ints
from sysdyn.runtime.model.system import System
from sysdyn.runtime.start.start import ConsistentState

ALIKE = 1e-12
"""Of the terms of two sums that symmetry makes equal."""
RATE = 0.7548776662466927
"""sigma, of no meaning (1 / s): of K and M one is absent."""
OF_CONSTRAINTS = {"phi": "kappa", "psi": "mu"}
"""Groups of rows, and the kind of their multipliers."""


def relaxes(system: System, start: ConsistentState) -> bool:
    """Whether the model does; at any index."""
    description = system.description
    others = ("s", "e", "slack")
    if not system.core.steady or system.core.held or any(description.families_of(kind) for kind in others):
        return False
    return _one_sort(description) and _reciprocal(system, start)


def _one_sort(description: Description) -> bool:
    """Whether rows of the dynamics read displacements alone, or accelerations alone, beside flows."""
    kernels = description.blocks.get("dynamics", ())
    kinds = [{description.families[k].kind for k in reads or ()} for n in kernels for reads in (n.reads, n.rates)]
    return not any("q" in reads for reads in kinds[::2]) or not any(kinds[1::2])


def _reciprocal(system: System, start: ConsistentState) -> bool:
    """Whether what a flow does to a coordinate is what the flow of that does to its own, and reactions are what
    constraints ask: of two motions at random, for no entry's number cancels another's.
    """
    point = start.for_form(system)
    slopes = RATE * system.slopes(start.t, *point, rate=True)
    slopes += system.slopes(start.t, *point, rate=False)
    rows, flows = _along(system, "dynamics", "f")
    chance = np.random.default_rng(1)
    terms = np.bincount(system.pattern.row, np.abs(slopes), minlength=system.rows)[rows]
    own = 1.0 / np.sqrt(np.where(terms > 0.0, terms, 1.0))  # a weak gyrator beside a busbar is seen as it is
    one, two = (own * chance.uniform(1.0, 2.0, flows.size) for _ in range(2))
    forces = [_rows(system, slopes, _motion(system, slopes, flows, f)) for f in (one, two)]
    if not _equal(two * forces[0][rows], one * forces[1][rows]):
        return False
    for group, kind in OF_CONSTRAINTS.items():
        asked, multipliers = _along(system, group, kind)
        pushed = np.zeros(system.unknowns)
        pushed[multipliers] = by = chance.uniform(1.0, 2.0, multipliers.size)
        reaction = one * _rows(system, slopes, pushed)[rows]
        demand = by * forces[0][asked] * (RATE if group == "phi" else 1.0)
        if not (_equal(reaction, demand) or _equal(reaction, -demand)):
            return False
    return True


def _along(system: System, group: str, kind: str) -> tuple[Ints, Ints]:
    """Rows of a group, and places of the unknowns of one kind with the same owners."""
    return system.once(("along", group, kind), lambda: _found_along(system, group, kind))


def _found_along(system: System, group: str, kind: str) -> tuple[Ints, Ints]:
    form, description = system.form, system.description
    place = {description.families[k].owner: int(form.at[k]) for k in description.families_of(kind)}
    found = [
        (first, place[row.owner], row.size)
        for name, k, first in form.groups
        if name == group and (row := description.rows[k]).owner in place
    ]
    parts = [np.stack([first + np.arange(n), at + np.arange(n)]) for first, at, n in found]
    both = np.concatenate(parts, axis=1) if parts else np.zeros((2, 0), dtype=np.int64)
    return both[0], both[1]


def _motion(system: System, slopes: Floats, flows: Ints, f: Floats) -> Floats:
    """Of all unknowns where flows are f e^(sigma t): displacements their integrals, momenta what they are of them."""
    found = np.zeros(system.unknowns)
    found[flows] = f
    found[system.form.k_q] = found[system.form.k_f] / RATE
    rows, momenta = _along(system, "momentum", "p")
    if momenta.size:
        made = _rows(system, slopes, found)[rows]
        unit = np.zeros(system.unknowns)
        unit[momenta] = 1.0
        found[momenta] = -made / _rows(system, slopes, unit)[rows]
    return found


def _rows(system: System, slopes: Floats, x: Floats) -> Floats:
    """What a motion x e^(sigma t) [unknowns] puts into every row; slopes: dF/dy + sigma dF/dyd [entries]."""
    pattern = system.pattern
    terms = slopes * x[pattern.columns_of()]
    return np.bincount(pattern.row, terms, minlength=system.rows).astype(np.float64)


def _equal(one: Floats, two: Floats) -> bool:
    """Sums of both, beside their terms."""
    return abs(float(one.sum() - two.sum())) <= ALIKE * float(np.abs(one).sum() + np.abs(two).sum())
