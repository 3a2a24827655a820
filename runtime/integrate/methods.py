"""The stepping methods of the core behind one face: what an integration needs to know of each.

The fields that all structures have in common (sd_ivp: t, h, steps, cause, ...) are read and set through `contents`.
"""

from __future__ import annotations

import ctypes as c
from collections.abc import Callable
from typing import Any

from sysdyn.runtime.condense.condensed import CondensedSystem
from sysdyn.runtime.integrate.factors import Factorisation, Factors
from sysdyn.runtime.integrate.underlying import Underlying
from sysdyn.runtime.model import core_library as lib
from sysdyn.runtime.model.description import Floats
from sysdyn.runtime.model.system import LARGE, System
from sysdyn.runtime.numerics.ordering import Order
from sysdyn.runtime.numerics.stretches import Stretches


class Method:
    """One of "bdf", "radau", "rosenbrock", "dopri", "energy" on one system.

    linear: the core's real factorisation; factors, order: where complex ones come from, of their matrices; underlying:
    for dopri and energy; stages: of radau, at most.
    Of a condensed system it steps what is kept, and shows every unknown.
    """

    def __init__(
        self,
        name: str,
        system: System | CondensedSystem,
        linear: Any,
        factors: Factors,
        order: Order,
        underlying: Underlying | None = None,
        stages: int = 3,
    ) -> None:
        self.name = name
        self.expanded: Any = None
        self._pairs: tuple[Factorisation, ...] = ()
        self._core: Any = None
        # radau: a complex matrix for each pair of stages
        if name == "radau":
            taken = [factors.take(system.pattern, order, complex_=True) for _ in range(stages // 2)]
            self._pairs = tuple(taken)
            pairs = (c.c_void_p * lib.PAIRS)(*self.complex)
            self._core = lib.core.sd_radau_new(c.byref(system.core), linear, pairs, stages)
        # energy: an explicit method that reads the audit
        elif name == "energy":
            assert underlying is not None
            assert isinstance(system, System)
            audited = system.observed_rows("audit")[1]
            self._core = lib.core.sd_energy_new(c.byref(system.core), underlying.core, system.form.extended, audited)
        # dopri: on the underlying equation
        elif underlying is not None:
            self._core = lib.core.sd_dopri_new(c.byref(system.core), underlying.core)
        elif name == "rosenbrock":
            self._core = lib.core.sd_rosenbrock_new(c.byref(system.core), linear)
        else:
            self._core = lib.core.sd_bdf_new(c.byref(system.core), linear)
        if not self._core:
            raise MemoryError
        self._n = system.unknowns
        # a condensed form: full points by an expansion
        if isinstance(system, CondensedSystem):
            self._n = system.whole.unknowns
            condensed = c.addressof(system.condensed)
            self.expanded = lib.core.sd_expanded_new(self.stepper, condensed, self._n)
            if not self.expanded:
                raise MemoryError
            self._condensed = system

    @property
    def complex(self) -> tuple[int, ...]:
        """The core's complex factorisations."""
        return tuple(item.linear for item in self._pairs)

    @property
    def contents(self) -> Any:
        """The core's structure."""
        return self._core.contents

    @property
    def stepper(self) -> int:
        """Address of its sd_stepper, or of the one that shows every unknown."""
        return c.addressof(self.expanded.contents.face if self.expanded else self.contents.stepper)

    def start(self, t: float, y: Floats, yd: Floats) -> None:
        """From (t, y, yd) with a step of its own choice."""
        self.begin(y, yd)
        lib.core.sd_stepper_start(self.stepper, t, lib.pointer(y), lib.pointer(yd))

    def rest(self) -> None:
        """Of a large system: until the next start it has no more than its last point, for between pieces of a run the
        room counts.
        """
        if self.name == "radau" and self._n > LARGE:
            lib.core.sd_radau_rest(self._core)

    def begin(self, y: Floats, yd: Floats) -> None:
        """Notes what no step moves of the point that it starts from."""
        # what nothing reads stays at the start
        if self.expanded:
            stays = y[self._condensed.unread], yd[self._condensed.unread]
            self._stays = [Stretches(item) if self._n > LARGE else item for item in stays]

    def point(self) -> tuple[Floats, Floats]:
        """y, yd [unknowns] of the last accepted point."""
        return self.last()()

    def last(self) -> Callable[[], tuple[Floats, Floats]]:
        """What gives this point whenever it is asked for: of a large system it holds what is stepped or stays."""
        stepper, number = self.contents.stepper, self._condensed.unknowns if self.expanded else self._n
        y, yd = (lib.reader(item, number).copy() for item in (stepper.y, stepper.yd))
        # all unknowns are stepped
        if not self.expanded:
            return lambda: (y, yd)
        condensed, (stays, still) = self._condensed, self._stays

        def expanded_system() -> tuple[Floats, Floats]:
            return condensed.expand_point(y, stays), condensed.expand_point(yd, still, rate=True)

        # large: expanded when it is asked for
        if self._n > LARGE:
            return expanded_system
        found = expanded_system()  # before the numbers of another run are put there
        return lambda: found

    def __del__(self) -> None:
        # the expansion points into the method: first
        if getattr(self, "expanded", None):
            lib.core.sd_expanded_free(self.expanded)
        if getattr(self, "_core", None):
            getattr(lib.core, f"sd_{self.name}_free")(self._core)
