"""The start as one system sees it: what every integration from it begins with, found once for all of them."""

from __future__ import annotations

from functools import cached_property

import numpy as np
from sysdyn.runtime.integrate.factors import Factors
from sysdyn.runtime.integrate.underlying import Accelerations, underlying_form
from sysdyn.runtime.integrate.weights.unknown_roles import Roles, general_rates, roles, without_rate
from sysdyn.runtime.model.description import Floats
from sysdyn.runtime.model.scales import magnitudes, unresolved_sizes
from sysdyn.runtime.model.system import LARGE, System
from sysdyn.runtime.numerics.ordering import net_order_of
from sysdyn.runtime.start.start import ConsistentState

UNRESOLVED = 8.0
"""Times what round-off leaves open of an unknown: the least that its error test asks for."""


class Origin:
    """system: in any form; index: of that form as the error test takes it.

    y, rate [unknowns] and the entries jy, jyd of the Jacobian there; yd: rates of what is differentiated, those of
    algebraic unknowns do not follow from the start's equations.
    """

    def __init__(self, system: System, start: ConsistentState, index: int) -> None:
        self.system, self.start, self.t = system, start, start.t
        y, rate = start.for_form(system)
        # a large start is brought to the form whenever it is asked for
        self._point = None if system.unknowns > LARGE else (y, rate)
        self._index = index
        self._matrix: tuple[Floats, Floats] | None = None
        rates = self._rates()
        self.yd = np.where(system.differential(rates), rate, 0.0)
        # a large one has its roles when they are asked for
        if system.unknowns <= LARGE:
            self.roles = roles(system, start.t, rates, index)
        del rates, y, rate
        self._sized: tuple[float, tuple[Floats, float]] | None = None
        self._explicit: tuple[System, Roles] | None = None
        self.kept: Roles | None = None
        """Roles of what is left where unknowns leave the runs (condense/)."""
        self.factors = Factors()

    @property
    def y(self) -> Floats:
        """As the start has it, of a large system whenever it is asked for."""
        return (self._point or self.start.for_form(self.system))[0]

    @property
    def rate(self) -> Floats:
        """Rates [unknowns] of the start in the form of the system."""
        return (self._point or self.start.for_form(self.system))[1]

    def point(self, *, own: bool) -> tuple[Floats, Floats, Floats]:
        """y, yd, rate [unknowns]; own: nobody else changes them."""
        return (self.y, self.yd, self.rate) if own else (self.y.copy(), self.yd.copy(), self.rate.copy())

    @property
    def jy(self) -> Floats:
        """dF/dy [entries] at the start."""
        return self._entries()[0]

    @property
    def jyd(self) -> Floats:
        """dF/dy' [entries] at the start."""
        return self._entries()[1]

    def _rates(self) -> Floats:
        """dF/dy' [entries] as roles are told by it."""
        # of a large one without the other half of the Jacobian
        known = self._matrix is not None or self.system.unknowns <= LARGE
        jyd = self.jyd if known else self.system.slopes(self.t, self.y, self.rate, rate=True)
        return general_rates(self.system, self.t, self.y, self.rate, jyd)

    @cached_property
    def roles(self) -> Roles:
        """Of the unknowns: of a large system asked for where it is clear who steps, and let go of with the rest."""
        return roles(self.system, self.t, self._rates(), self._index)

    @cached_property
    def least(self) -> Floats:
        """What round-off leaves open of displacements and flows [unknowns]."""
        known = self._matrix is not None or self.system.unknowns <= LARGE
        jy = self.jy if known else self.system.slopes(self.t, self.y, self.rate, rate=False)
        return np.where(self.system.are("q", "f"), UNRESOLVED * unresolved_sizes(self.system, self.y, jy), 0.0)

    def _entries(self) -> tuple[Floats, Floats]:
        # kept as long as nobody lets go of it
        if self._matrix is None:
            self._matrix = self.system.jacobian(self.t, self.y, self.rate)
        return self._matrix

    def let_go(self) -> None:
        """Of the Jacobian and what follows from it: found again if asked."""
        self._matrix = self._sized = None
        # a large one keeps nothing that can be found again
        if self.system.unknowns > LARGE:
            self.__dict__.pop("least", None)
            self.__dict__.pop("roles", None)

    def initial_sizes(self, t_end: float) -> tuple[Floats, float]:
        """Magnitudes of the unknowns and the time scale (s) of the start, of a run to t_end (s)."""
        # another end has other magnitudes
        if self._sized is None or self._sized[0] != t_end:
            order = net_order_of(self.system)
            far = self.jy, self.jyd, self.yd, order.address
            clean, spent = self.start.without_noise, self.system.unknowns > LARGE
            self._sized = t_end, magnitudes(self.system, self.t, t_end, clean(self.y), self.yd, far, spent=spent)
            # its entries were overwritten
            if spent:
                self._matrix = None
        return self._sized[1]

    @property
    def explicit(self) -> tuple[System, Roles]:
        """What is solved for the slopes, and the roles where flows without a rate are solved for too; of form "0"."""
        # flows without inertia are solved for, not stepped
        if self._explicit is None:
            solved, _ = underlying_form(self.system, self.start)
            self._explicit = solved, without_rate(self.roles, Accelerations(solved).without_rate)
        return self._explicit

    def weigh_entries(self) -> None:
        """The entries of the Jacobian anew: its rows q' - f have other factors."""
        self.let_go()
