"""Which rows hold at a point of a run, and what moves a point onto them: at rows, between steps, behind a jump."""

from __future__ import annotations

from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from sysdyn.runtime.condense.condenser import Forms
from sysdyn.runtime.condense.elimination import steady
from sysdyn.runtime.integrate.request import Request
from sysdyn.runtime.integrate.weights.sizes import Sizes
from sysdyn.runtime.integrate.weights.unknown_roles import Roles
from sysdyn.runtime.model.description import Floats
from sysdyn.runtime.model.system import LARGE, System
from sysdyn.runtime.numerics.stretches import Stretches, whole_of
from sysdyn.runtime.start.restart import Restart, still
from sysdyn.runtime.start.settled import Settler, flows_open, values_told

PROJECTED = ("1", "0")
"""Forms whose rows let the constraints drift: accepted points are moved onto them."""
SHOWN = ("observe", "observe_rate", "observe_scale", "audit", "ledger")
"""Blocks that the rows of a trace evaluate."""
SLACK = 0.1
"""Of the tolerance: what rows within a step may move of the state, in magnitudes, and need not be the least change,
where constraints are constant sums: their unknowns are interpolated differently (radau_dense.c).  Of curved ones
the least change takes out most of the error between steps (a parallelogram by dopri: 25 times).  Where laws are steep
what follows shares the change, and the iteration nears the least one slowly (a tube of water: six solutions where rows
hold after one).
"""
RATED = 5_000
"""Unknowns up to which a point behind a jump is asked for flows that are open.  With the rates of all balances that
of a larger net is dear to find (a driven grid of 35 x 35: 20 s): its loops of stores are left as rows leave them.
"""


class Settlers:
    """point: t (s), y, yd [unknowns] of the start; settler: of the method's points; of_trace: of rows."""

    def __init__(
        self,
        system: System,
        forms: Forms | None,
        request: Request,
        sizes: Sizes,
        roles: Roles,
        point: tuple[float, Floats, Floats],
    ) -> None:
        self.system, self._forms, self._request, self._sizes = system, forms, request, sizes
        n = system.form.written
        self._keeps = Stretches(roles.state[:n]) if n > LARGE else roles.state[:n]
        self._common = roles.common[:n]
        t, y, yd = point
        self._point = (t, y[:n], yd[:n]) if system.unknowns <= RATED else None
        # rows that a point meets, and what the trace shows
        self.settler = self._by_basis(self.settler_of("settled" if forms is not None else self.whole_form))
        self.of_trace = self._by_basis(self.settler_of("valued")) if self._values_do() else self.settler

    def _by_basis(self, settler: Settler) -> Settler:
        """Told how far it may go by basic solutions, and how well points settle."""
        system, request = self.system, self._request
        # where constraints come and go what is left of a zero counts
        still = 0.0 if request.switched else SLACK * request.tolerance
        sums = system.once("sums", lambda: steady(system.description, ("phi", "phi_rate", "psi")))
        # of steep laws what follows shares a move of the state
        slack = still if system.form.scales else SLACK * request.tolerance if sums else 0.0
        # the least change shares what is open: flows between contacts, potentials where all laws are faint
        flat = bool(request.events) and self.whole_form == "rated"
        settler.by_basis(slack, determined=request.switched or flat)
        settler.core.contents.still = still
        settler.core.contents.enough = request.settled_to if request.draft else 0.0
        return settler

    def _values_do(self) -> bool:
        """Whether no row shows a rate that hidden rows alone tell."""
        system, request = self.system, self._request
        # not asked for, or rows that rates decide, or too large
        if not request.valued or request.events or request.least_norm or self._point is None:
            return False
        if self._forms is not None or self.whole_form != "settled":
            return False
        # a block that does not say whose rates it shows
        shown = [kernel.rates for block in SHOWN for kernel in system.description.blocks.get(block, ())]
        read = [rates for rates in shown if rates is not None]
        # not said: any
        if len(read) < len(shown):
            return False
        valued, settled = system.another("valued"), system.another("settled")
        return values_told(valued, settled, self._point, self.keeps, frozenset[int]().union(*read))

    @property
    def both(self) -> frozenset[Settler]:
        """What settles points of this run."""
        return frozenset((self.settler, self.of_trace))

    @property
    def failures(self) -> int:
        """Points that did not settle."""
        return sum(settler.core.contents.failures for settler in self.both)

    @property
    def keeps(self) -> NDArray[np.bool_]:
        """Unknowns as written that carry the state."""
        return whole_of(self._keeps)

    @cached_property
    def whole_form(self) -> str:
        """All rows that hold at a point, with every unknown: where events change them any flow may be open."""
        system = self.system
        # no form with rates
        if "dynamics_rate" not in system.description.blocks:
            return "settled"
        turning = bool(self._request.events)
        # constraints that come and go: any flow may be open
        if self._request.switched:
            return "rated"
        if self._point is None:
            return "rated" if turning else "settled"
        settled = system.another("settled")
        return "rated" if flows_open(settled, *self._point, self.keeps, turning=turning) else "settled"

    def settler_of(self, name: str, state: NDArray[np.bool_] | None = None, *, whole: bool = False) -> Settler:
        """Of the rows of a form; state: what should move least, if not what carries the state; whole: with every
        unknown, whatever leaves the runs.
        """
        form = self.system.form
        # what leaves the runs is left out of the settled form too
        left = self._forms.settled if self._forms is not None and name == "settled" and not whole else None
        system = self.system.another(name)
        magnitude = self._sizes.magnitude[: form.written]
        # a group moves together where the run's own state is kept
        common = self._common if state is None else None
        state = self.keeps if state is None else state
        return Settler(system, form.k_span, magnitude, self._sizes.time, state, left, common)

    def projection(self) -> Settler | None:
        """Of the constraints alone, onto which accepted points are moved; None where no row lets them drift."""
        # forms whose rows hold their constraints
        if self.system.form.name not in PROJECTED:
            return None
        return self.settler_of("constraints", np.ones(self.system.form.written, dtype=bool))

    @cached_property
    def restart(self) -> Restart:
        """Finds consistent points behind jumps, with every unknown."""
        settler = self.settler
        # behind a jump all unknowns count
        if self._forms is not None:
            settler = self.settler_of(self.whole_form, whole=True)
            settler.by_basis(0.0, determined=True)
        return Restart(settler, self.keeps)

    def across(self, t: float, y: Floats, yd: Floats) -> tuple[Floats, Floats] | None:
        """y, yd [unknowns as written] behind a jump at t (s), of the text or a law; where no state jumps, what is left
        of the unknowns tells.  None where no point was found.
        """
        # where no state jumps, the condensed rows tell
        if self._forms is not None and self.whole_form == "settled":
            found = still(self.settler, t, (y, yd), self.keeps, self._sizes.magnitude[: self.system.form.written])
            if found is not None:
                return found
        return self.restart.across(t, y if self._forms is None else self._forms.complete_point(t, y), yd)

    def rest(self) -> None:
        """Of a large system: lets go of the room in which points behind a jump were settled."""
        self.settler.rest()
        # made only where something jumped
        if "restart" in self.__dict__:
            self.restart.settler.rest()
