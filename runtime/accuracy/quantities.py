"""The quantities that a simulation stores and compares, and what their errors are relative to.

Received: the columns of the trace; the largest values and magnitudes that a run met.  Handed on: a size for each.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from sysdyn.runtime.accuracy.options import Options
from sysdyn.runtime.integrate.request import Finished
from sysdyn.runtime.integrate.rows.ledgers import turned_over
from sysdyn.runtime.model import core_library as lib
from sysdyn.runtime.model.description import Floats, Ints
from sysdyn.runtime.model.failures import WrongOption
from sysdyn.runtime.model.scales import ROUND_OFF, kinds_and_units
from sysdyn.runtime.model.system import System
from sysdyn.runtime.trace.trace import Column

PURE = 1e-8
"""Angles and other pure numbers: what is round-off beside this is nothing, whatever the largest that occurs."""

METERS = {
    "audit.kinetic": 2, "audit.potential": 3, "audit.dissipated": 4, "audit.supplied": 5, "audit.energy": 6,
    "audit.constraints": 7,
}  # fmt: skip
"""Places of the audit's members in a row."""


class Quantities:
    """places [columns]: of the observed value that each stores; names of columns, meters (members of the audit of which
    accuracy is asked, though they are not traced) and compared, which are both; to_range [k]: columns whose errors are
    relative to their range.
    """

    def __init__(self, system: System, columns: Sequence[Column], options: Options) -> None:
        self.system, self._columns = system, columns
        self.places: Ints = np.array([column.place for column in columns], dtype=np.int64)
        self.names = tuple(column.name for column in columns)
        traced = set(self.names)
        # meters (ledgers) that are compared although no column holds them
        self.meters = tuple(name for name, _ in options.accuracy_on if name in METERS and name not in traced)
        self.compared = (*self.names, *self.meters)
        ranged = [k for k, name in enumerate(self.names) if name in options.to_range]
        self.to_range: Ints = np.array(ranged, dtype=np.int64)
        self._beside: tuple[Floats, Floats, Floats] | None = None

    @property
    def row(self) -> list[int]:
        """Places in a row of the compared quantities."""
        return [*(lib.ROW_HEAD + self.places).tolist(), *(METERS[name] for name in self.meters)]

    def sizes(self, largest: Floats, magnitude: Floats) -> Floats:
        """What errors of the stored quantities are relative to [columns]: the largest met (largest [observed]), but no
        less than round-off of the largest of the same unit, unknowns (magnitude [kinds and units]) among them.
        """
        return np.asarray(np.maximum(largest[self.places], ROUND_OFF * self.largest_of_unit(largest, magnitude)))

    def largest_of_unit(self, largest: Floats, magnitude: Floats) -> Floats:
        """The largest of the unit of each stored quantity [columns], unknowns among them."""
        # of the same run as the last time
        last = self._beside
        if last is not None and last[0] is largest and last[1] is magnitude:
            return last[2]
        of_kinds, of_columns, number = self.system.once("units", self._units)
        # numbers without unit count by at least PURE
        found = np.zeros(number)
        found[0] = PURE
        # unknowns and stored quantities of one unit share the largest
        np.fmax.at(found, of_kinds[: magnitude.size], magnitude[: of_kinds.size])
        np.fmax.at(found, of_columns, largest[self.places])
        self._beside = largest, magnitude, np.asarray(found[of_columns])
        return self._beside[2]

    def _units(self) -> tuple[Ints, Ints, int]:
        """Number of the unit of each kind and unit of unknowns and of each stored quantity, and how many units there
        are; 0: pure numbers.
        """
        number = {"1": 0}
        of_kinds = [number.setdefault(unit, len(number)) for _, unit in kinds_and_units(self.system)]
        of_columns = [number.setdefault(column.unit, len(number)) for column in self._columns]
        return np.array(of_kinds, dtype=np.int32), np.array(of_columns, dtype=np.int32), len(number)

    def nominal(self, largest: Floats, magnitude: Floats) -> dict[str, float]:
        """Nominal magnitude of each stored quantity."""
        return self.by_name(self.sizes(largest, magnitude))

    def terms(self, largest: Floats) -> dict[str, float]:
        """Largest terms of each stored quantity, where it is a difference; largest [observed]."""
        return self.by_name(largest[self.places])

    def by_name(self, values: Floats) -> dict[str, float]:
        """Values of the stored quantities [columns] by their names."""
        return dict(zip(self.names, values.tolist(), strict=True))

    def terms_of_run(self, finished: Finished) -> Floats:
        """Largest values and terms of the compared quantities of a run [compared]."""
        return np.append(finished.largest[self.places], [_turned_over(meter, finished) for meter in self.meters])

    def accuracy_asked(self, options: Options) -> Floats:
        """Accuracy wanted of each compared quantity [compared]; infinite where none is."""
        names = list(self.compared)
        # the accuracy of all, then those asked of single quantities
        target = np.full(len(names), np.inf if options.accuracy is None else options.accuracy)
        for name, wanted in options.accuracy_on:
            if name not in names:
                raise WrongOption(f"accuracy on '{name}': it is not traced")
            target[names.index(name)] = wanted
        return target

    def of_run(self, finished: Finished) -> Floats:
        """What errors of the compared quantities of a run are relative to [compared]."""
        met = self.sizes(finished.largest, finished.magnitude)
        return np.append(met, [_turned_over(meter, finished) for meter in self.meters])


def _turned_over(meter: str, finished: Finished) -> float:
    """What an error of a meter is relative to: the norm of constraints is scaled, energies are what went round."""
    return 1.0 if meter == "audit.constraints" else turned_over(finished.balances)
