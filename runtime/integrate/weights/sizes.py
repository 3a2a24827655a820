"""How large the unknowns of one run are: what tolerances, round-off and the rows within a step are relative to.

Received: the start's sizes; what the method and the crossings meet.  A method of fewer unknowns (condense/) goes by
sizes of its own, which are shared at crossings and at the end.
"""

from __future__ import annotations

from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from sysdyn.runtime.integrate.origin import UNRESOLVED, Origin
from sysdyn.runtime.integrate.request import Request
from sysdyn.runtime.integrate.weights.round_off import open_unknowns
from sysdyn.runtime.integrate.weights.unknown_roles import Roles
from sysdyn.runtime.model.description import Floats, Ints
from sysdyn.runtime.model.scales import GROUP, ROUND_OFF, UNKNOWN, group_maximum, magnitudes, noise
from sysdyn.runtime.model.system import LARGE, System
from sysdyn.runtime.numerics.ordering import net_order_of
from sysdyn.runtime.numerics.stretches import Ascents, Stretches, whole_of
from sysdyn.runtime.start.start import ConsistentState

MET = -1.0
"""Stands for a magnitude that is the largest |y| met."""


NO_POWER = np.iinfo(np.int16).min
"""Of two, of zero."""


def _powers(y: Floats) -> NDArray[np.int16]:
    """The power of two that |y| is less than, and no less than half of; above any of what is no number."""
    found = np.where(y == 0.0, NO_POWER, np.frexp(y)[1]).astype(np.int16)
    found[~np.isfinite(y)] = np.iinfo(np.int16).max
    return found


class Sizes:
    """magnitude [unknowns] in SI units, time (s): the scale of the start."""

    def __init__(self, system: System, start: ConsistentState, request: Request, origin: Origin) -> None:
        self.system, self._start, self._request = system, start, request
        self._origin: Origin | None = origin
        found, self.time = origin.initial_sizes(request.t_end)
        # the last run has shown that unknowns stay below
        if request.ceiling is not None:
            found = np.minimum(found, request.ceiling)
        self._magnitude: Floats = np.maximum(found, self.least)
        self._own: tuple[Ints | Ascents, Floats, Floats] | None = None
        self._met = np.zeros(0)
        self._away: tuple[Ascents, Stretches[np.float64], Stretches[np.float64]] | None = None

    @property
    def magnitude(self) -> Floats:
        """[unknowns] in SI units."""
        self._bring_back()
        return self._magnitude

    def put_away(self) -> None:
        """Of a large system of which the method has sizes of its own: nobody reads those of all for a while.  Of the
        others |y| met is held, and magnitudes that are not that.
        """
        assert self._own is not None
        if self._away is not None:
            return
        # what the method does not step
        other = np.ones(self.system.unknowns, dtype=bool)
        other[whole_of(self._own[0])] = False
        met, magnitude = self.met[other], self.magnitude[other]
        # magnitudes equal to what was met say nothing more
        apart = Stretches(np.where(magnitude == met, MET, magnitude))
        self._away = Ascents(np.flatnonzero(other).astype(np.int32)), Stretches(met), apart
        self._magnitude = self._met = met[:0].copy()

    def _bring_back(self) -> None:
        """Makes the sizes of all unknowns whole again, where `put_away` has let go of them."""
        if self._away is None or self._own is None:
            return
        (other, *others), (kept, magnitude, met) = self._away, self._own
        self._away = None
        # of what the method steps, then of the others
        self._magnitude, self._met = np.empty(self.system.unknowns), np.empty(self.system.unknowns)
        self._magnitude[whole_of(kept)], self._met[whole_of(kept)] = magnitude, met
        largest, apart = (item.whole for item in others)
        self._met[other.whole], self._magnitude[other.whole] = largest, np.where(apart == MET, largest, apart)

    @property
    def unnamed(self) -> NDArray[np.bool_]:
        """Unknowns with a state's meaning whose size nothing names [unknowns]."""
        found: NDArray[np.bool_] = self.system.are("q", "f", "p", "s") & (self.system.nominal == 0.0)
        return found

    @cached_property
    def least(self) -> Floats:
        """Magnitudes below which a tolerance is less than round-off leaves open: no step meets it [unknowns]."""
        origin = self._origin or Origin(self.system, self._start, self._request.index)
        return origin.least / max(self._request.rtol, 1e-15)

    @property
    def met(self) -> Floats:
        """Largest |y| met [unknowns]; of a condensed form as far as it is shared (`share`)."""
        self._bring_back()
        if self._met.size < self.system.unknowns:
            self._met = np.zeros(self.system.unknowns)
        return self._met

    @cached_property
    def resolution(self) -> Floats | NDArray[np.int16]:
        """|y| of which is known what round-off leaves open [unknowns], by powers of two where the core does not read it
        too.
        """
        number = self.system.unknowns
        rough = number > LARGE and not self._request.events  # (core/run/events/modes.h)
        return np.full(number, NO_POWER, dtype=np.int16) if rough else np.zeros(number)

    def _has_grown(self, y: Floats) -> bool:
        """Whether some |y| may be more than twice what it was when asked before; it is as large as now, then."""
        known = self.resolution
        # powers of two take a quarter of the room
        size, most = (_powers(y), known) if known.dtype == np.int16 else (np.abs(y), 2.0 * known)
        if (size <= most).all():
            return False
        np.maximum(known, size, out=known)
        return True

    def spare_resolved(self) -> None:
        """Behind the last jump: nobody asks for it again."""
        self.__dict__.pop("resolved", None)

    def let_go(self) -> None:
        """Of what the start knows: found again if asked."""
        self._origin = None
        self.spare()

    def spare(self) -> None:
        """Of what follows from that: made again if asked."""
        self.__dict__.pop("least", None)

    @property
    def own(self) -> tuple[Ints, Floats, Floats] | None:
        """Of a method of fewer unknowns: their places, magnitudes and |y| met; None where it steps all."""
        return None if self._own is None else (whole_of(self._own[0]), *self._own[1:])

    def sizes_of_method(self, kept: Ints | None) -> tuple[Floats, Floats]:
        """Magnitude and |y| met of the unknowns that the method steps; kept: their places, None: all."""
        # all unknowns are stepped
        if kept is None:
            return self.magnitude, self.met
        held = Ascents(kept) if self.system.unknowns > LARGE else kept
        self._own = held, self.magnitude[kept], np.zeros(kept.size)
        return self._own[1:]

    def share(self, y: Floats) -> None:
        """What a method of fewer unknowns knows of their sizes becomes known of all at a point y."""
        # the method's sizes are those of all
        if self._own is None:
            return
        kept, magnitude, met = whole_of(self._own[0]), *self._own[1:]
        # what was eliminated is as large as at this point
        for sizes in (self.met, self.magnitude):
            np.maximum(sizes, np.abs(y), out=sizes)
        self.magnitude[kept], self.met[kept] = magnitude, met

    def hand_down(self) -> None:
        """The magnitudes that the method of fewer unknowns goes by, from those of all."""
        if self._own is not None:
            self._own[1][:] = self.magnitude[whole_of(self._own[0])]

    def sizes_at(self, y: Floats, *, last: bool = False) -> tuple[Floats, Floats]:
        """Largest |y| met and magnitude of every unknown; what was eliminated is as large as at the last point y.
        last: in the arrays of the run, which is over.
        """
        if self._own is None:
            return self.met, self.magnitude
        kept, magnitude, met = whole_of(self._own[0]), *self._own[1:]
        largest = np.maximum(self.met, np.abs(y), out=self.met if last else None)
        largest[kept] = met
        sizes = np.maximum(self.magnitude, largest, out=self.magnitude if last else None)
        sizes[kept] = magnitude
        return largest, sizes

    def begin_to_move(self, t: float, end: float, y: Floats, rate: Floats) -> None:
        """Unknowns that stood at zero so far, and whose rates say only now how large they will be: their size, where it
        is unknown; a part of what their like have been at least, as at the start.
        """
        # unknowns without nominal value that begin to move
        moves = (rate != 0.0) & self.unnamed
        unknown = moves & (self.met <= ROUND_OFF) & (self.magnitude == UNKNOWN)
        # their size is unknown: by their rates, and by what moves with t
        if unknown.any():
            with np.errstate(over="ignore"):
                found, _ = magnitudes(self.system, t, end, y, rate)
            grows = self._grows(t, end, np.where(unknown, 0.0, y), np.where(unknown, 0.0, rate))
            self.magnitude[unknown] = np.maximum(np.maximum(found, grows), self.least)[unknown]
        # at least a part of the largest of their like
        if (moves & (self.met <= ROUND_OFF * self.met.max(initial=0.0))).any():
            like = group_maximum(self.system, self.met)
            begin = moves & (self.met <= ROUND_OFF * like)
            self.magnitude[begin] = np.maximum(self.magnitude, GROUP * like)[begin]

    def _grows(self, t: float, end: float, y: Floats, rate: Floats) -> Floats:
        """Magnitudes [unknowns] by what moves with t up to `end` (s): at the very instant at which that begins, rates
        are round-off of it.
        """
        # no Jacobian of a large system for that
        if self.system.unknowns > LARGE:
            return np.zeros(self.system.unknowns)
        far = *self.system.jacobian(t, y, rate), rate, net_order_of(self.system).address
        found, _ = magnitudes(self.system, t, end, y, rate, far)
        return np.where(found == UNKNOWN, 0.0, found)

    def resolve(self, t: float, y: Floats, rate: Floats, roles: Roles) -> None:
        """No magnitude asks for more than round-off leaves: contents that grew are summed where flows are zero; rate
        [unknowns]: of what has one.
        """
        # nothing has grown: known already
        if not self._has_grown(y):
            return
        spared = self.system.unknowns > LARGE and self._own is not None
        # sizes of large systems make room for the Jacobian
        if spared:
            self.hand_down()
            self.put_away()
        jy = self.system.slopes(t, y, np.where(roles.differential, rate, 0.0), rate=False)
        pattern = self.system.pattern
        if spared:
            self.system.put_away(whole=True)
        open_ = noise(self.system, pattern, y, jy, self.time)
        del jy
        if spared:
            self.system.spare()
        # a state keeps its size
        open_[roles.state] = 0.0
        self._at_least(open_)

    def resolve_by_rows(self, t: float, y: Floats, yd: Floats, carries: NDArray[np.bool_]) -> None:
        """Raises magnitudes to what is left open of all that the rows determine, by the inverse of their Jacobian:
        where steps fail by it. A state has its size from what it was; one that was never more than what is open (the
        charge through a diode that blocks, beside large ones) has none.
        """
        open_ = open_unknowns(self.system, t, y, yd, self.time)
        self._at_least(np.where(carries & (self.sizes_at(y)[0] > open_), 0.0, open_))

    @property
    def resolves(self) -> float:
        """What a tolerance needs of a magnitude beside what round-off leaves open."""
        return UNRESOLVED / max(self._request.rtol, 1e-15)

    def _at_least(self, open_: Floats) -> None:
        """No magnitude is less than a tolerance needs of what is open [unknowns], which is written to."""
        open_ *= self.resolves
        np.maximum(self.magnitude, open_, out=self.magnitude)
