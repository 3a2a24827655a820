"""A trace in memory as a source of a comparison."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from sysdyn.runtime.comparison.curve import Floats
from sysdyn.runtime.comparison.verdict import About, TraceEvent
from sysdyn.runtime.trace.trace import Trace


class Arrays:
    """Rows in memory.  time [n]; values and rates by name [n]."""

    def __init__(
        self,
        time: Floats,
        values: Mapping[str, Floats],
        rates: Mapping[str, Floats] | None = None,
        about: Sequence[About] = (),
        events: Sequence[TraceEvent] = (),
        time_unit: str = "s",
    ) -> None:
        # lists are taken as well as arrays
        self.time = np.asarray(time, dtype=np.float64)
        self.time_unit = time_unit
        self.values = {name: np.asarray(v, dtype=np.float64) for name, v in values.items()}
        self.rates = {name: np.asarray(v, dtype=np.float64) for name, v in (rates or {}).items()}
        # without a description: a number whose size is that of its values
        known = {a.name: a for a in about}
        self.quantities = {name: known.get(name, About(name, "1", None)) for name in self.values}
        self.events = tuple(events)

    def read(self, name: str, first: int, last: int) -> tuple[Floats, Floats | None]:
        """Rows first..last-1."""
        rates = self.rates.get(name)
        return self.values[name][first:last], None if rates is None else rates[first:last]


def arrays_of(trace: Trace) -> Arrays:
    """A trace that was read as a whole."""
    found = {name: trace[name] for name in trace.names}
    return Arrays(
        trace.time,
        {name: q.values for name, q in found.items()},
        {name: q.derivative for name, q in found.items() if q.derivative is not None},
        [About(name, q.units, q.nominal) for name, q in found.items()],
    )
