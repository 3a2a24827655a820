"""Which constraints stand in the underlying equation as they are: those that determine flows without inertia.

Form 0 differentiates every constraint, so that it determines rates of flows.  A coordinate without inertia has no rate
in its balance; where no constraint gives it one, the flow itself is solved for, from its balance (a resistor's) or from
a constraint that is not differentiated (a capacitor's current from Kirchhoff's law), and the state is what is left.

Pantelides' algorithm (1988) over the highest derivatives: a constraint is differentiated when it and those matched
along its alternating paths have fewer flows left than they are.  Balances are never differentiated: where they would
have to be (capacitors in parallel that hold coordinates of their own), there is no such equation.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from sysdyn.runtime.model.patterns import Pattern
from sysdyn.runtime.model.system import System
from sysdyn.runtime.numerics.matching import match_rows

LARGE = 4000
"""Unknowns beyond which the paths are not sought."""
_PAIRS = {"phi_rate": "phi_acceleration", "psi": "psi_rate"}
"""Constraints of flows, and their derivatives."""
_ALWAYS = ("dynamics", "momentum_rate", "gamma", "lambda")

Longs = NDArray[np.int64]


def undifferentiated_families(system: System) -> tuple[int, ...] | None:
    """Row families of constraints that stand as they are, ascending; None where balances would have to be
    differentiated, or the model is too large.
    """
    # of large models matching costs too much
    if system.unknowns > LARGE:
        return None
    rows = _Rows(system.another("settled"))
    # differentiate what cannot be matched until all can
    while True:
        failed = rows.unmatched_equations()
        if not failed:
            return rows.as_they_are()
        if not rows.differentiate(failed):
            return None


class _Rows:
    """Equations [n], each at a level: 0 as it is, 1 differentiated; unknowns by their highest derivative."""

    def __init__(self, settled: System) -> None:
        first = {(group, k): row for group, k, row in settled.form.groups}
        families = settled.description.rows
        own: list[tuple[Longs, Longs, int]] = []
        # rows with two levels: as they are and differentiated
        for (group, k), row in first.items():
            here = row + np.arange(families[k].size, dtype=np.int64)
            if group in _ALWAYS:
                own.append((here, here, -1))
            elif group in _PAIRS:
                later = first.get((_PAIRS[group], k), row)
                own.append((here, later + np.arange(families[k].size, dtype=np.int64), k))
        self.row = np.concatenate([np.stack([a, b]) for a, b, _ in own], axis=1)  # [2 levels, n]
        self.family = np.concatenate([np.full(a.size, k) for a, _, k in own])
        self.level = np.zeros(self.family.size, dtype=np.int64)
        in_y, in_rate = settled.structural()
        columns = settled.pattern.columns_of()
        self._entries = settled.pattern.row, columns, in_y, in_rate
        self._rated, self._plain = settled.are("f", "p", "s")[columns], settled.are("e", "kappa", "mu")[columns]
        self._flow = settled.are("f")[columns]
        self._sizes = settled.rows, settled.unknowns

    def _entries_now(self) -> tuple[Longs, Longs]:
        """Equation and unknown of each entry: of each equation the unknowns whose highest derivative stands in it."""
        # the rows of the present level of each equation
        row, column, in_y, in_rate = self._entries
        number = np.full(self._sizes[0], -1, dtype=np.int64)
        number[self.row[self.level, np.arange(self.level.size)]] = np.arange(self.level.size)
        mine = number[row] >= 0
        # an equation stands for the highest derivatives in it
        rates = mine & in_rate & self._rated
        moved = np.zeros(self._sizes[1], dtype=bool)
        moved[column[rates]] = True
        take = rates | (mine & in_y & (self._plain | (self._flow & ~moved[column])))
        return number[row[take]], column[take].astype(np.int64)

    def unmatched_equations(self) -> set[int]:
        """Equations on the alternating paths of those for which no unknown is left."""
        # equations to unknowns; what is left over, and what alternates with it
        equation, unknown = self._entries_now()
        order, unknowns = np.lexsort((unknown, equation)), self._sizes[1]
        first = np.searchsorted(equation[order], np.arange(self.level.size + 1))
        pattern = Pattern(unknowns, self.level.size, first.astype(np.int32), unknown[order].astype(np.int32))
        own = match_rows(pattern)
        met, grown = own < 0, True
        while grown:
            known = np.zeros(unknowns + 1, dtype=bool)  # the last: of those without an unknown
            known[unknown[met[equation]]] = True
            grown = bool((known[own] & ~met).any())
            met |= known[own]
        return set(np.flatnonzero(met).tolist())

    def differentiate(self, failed: set[int]) -> bool:
        """The families of these equations go to level 1; False where one of them cannot."""
        found = np.array(sorted(failed), dtype=np.int64)
        if (self.family[found] < 0).any() or (self.level[found] > 0).any():
            return False
        self.level[np.isin(self.family, self.family[found])] = 1
        return True

    def as_they_are(self) -> tuple[int, ...]:
        """Families of constraints at level 0."""
        return tuple(sorted({int(k) for k in self.family[(self.level == 0) & (self.family >= 0)]}))
