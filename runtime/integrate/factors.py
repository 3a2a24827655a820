"""Factorisations of the matrices that a method steps with, handed on from run to run of one start.

What a run learns of small matrices, the order of their pivots
(core/linear/elimination/elimination.h), serves the next run as well.  Where there is no
next run they go with the run that took them.
"""

from __future__ import annotations

from typing import Any

from sysdyn.runtime.model import core_library as lib
from sysdyn.runtime.model.patterns import Pattern
from sysdyn.runtime.numerics.ordering import Order

LEARNT = 100
"""Unknowns up to which a run learns anything (SD_REPLAYED)."""


class Made:
    """One factorisation of the core, None once it is freed; it keeps pattern and order, which the core reads.

    beside: what its holder learnt of its own, for the next.
    """

    def __init__(self, pattern: Pattern, order: Order, *, complex_: bool) -> None:
        self.pattern, self.order, self.complex = pattern, order, complex_
        self.linear: Any = order.complex_linear(pattern) if complex_ else order.linear(pattern)
        self.beside: Any = None

    def again(self) -> None:
        """As new, but for what was learnt."""
        (lib.core.sd_linear_z_again if self.complex else lib.core.sd_linear_again)(self.linear)

    def __del__(self) -> None:
        # freed by the core that made it
        if getattr(self, "linear", None):
            (lib.core.sd_linear_z_free if self.complex else lib.core.sd_linear_free)(self.linear)
            self.linear = None


class Factorisation:
    """The core's factorisation of matrices of one pattern, until nobody holds it.

    linear: its structure, of complex ones its address.
    """

    def __init__(self, made: Made, factors: Factors) -> None:
        self.made, self._factors = made, factors
        self.linear: Any = made.linear

    def __del__(self) -> None:
        # where both are garbage at once the other may have gone first
        if self.made.pattern.unknowns <= LEARNT and self.made.linear:
            self.made.again()
            self._factors.at_hand.append(self.made)


class Factors:
    """The factorisations of the runs from one start that no run holds."""

    def __init__(self) -> None:
        self.at_hand: list[Made] = []

    def take(self, pattern: Pattern, order: Order, *, complex_: bool = False) -> Factorisation:
        """One of these, or a new one."""
        # one of the same pattern that is not in use
        for k, made in enumerate(self.at_hand):
            if made.pattern is pattern and made.complex == complex_ and made.linear:
                return Factorisation(self.at_hand.pop(k), self)
        return Factorisation(Made(pattern, order, complex_=complex_), self)
