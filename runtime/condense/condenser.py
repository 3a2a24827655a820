"""What runs of a model are condensed to: whether it is worth it, the forms that are stepped and settled.

The numbers of a run renew the tables of the one before where the same unknowns may leave (condensed.py).
"""

from __future__ import annotations

from functools import cached_property
from hashlib import sha256
from typing import Any

import numpy as np
from sysdyn.runtime.condense.composition import Composition, places_of
from sysdyn.runtime.condense.condensed import CondensedSystem, Room
from sysdyn.runtime.condense.elimination import Elimination, definable, eliminate, steady
from sysdyn.runtime.condense.settled_rows import settled_rows
from sysdyn.runtime.condense.sums import ConstantSums, Straights, sums
from sysdyn.runtime.model.description import Floats
from sysdyn.runtime.model.system import LARGE, System
from sysdyn.runtime.numerics.least_change import least_norm
from sysdyn.runtime.numerics.ordering import Order, any_order, paired_order, with_pairs
from sysdyn.values import dataclass

LEAST, STEEP = 12, 50
"""Unknowns from which it is worth the trouble; the same where laws are steep.  Integrations of 13 to 42 unknowns take
0.74 to 0.86 of the time, whole runs in memory as long as before or less; of fewer the tables cost what the steps save.
Between steep laws small matrices may leave columns open (numerics/ordering.py), which a condensed one knows less well:
a circuit of diodes of less than 20 unknowns crawled."""
GAIN = 0.7
"""Part of the unknowns that may be left."""
DEFINED = "leaves runs: a constant sum of others"
UNREAD = "leaves runs: nothing reads it"


@dataclass(frozen=True, slots=True)
class Forms:
    """What an integration sees, and what its points are settled with."""

    stepped: CondensedSystem
    settled: CondensedSystem
    room: Room

    def bind(self) -> None:
        """Says where the whole systems are evaluated."""
        self.stepped.bind(self.room)
        self.settled.bind(self.room)

    def order(self) -> Order:
        """Elimination order of the stepped form's matrices [kept], found once."""
        stepped, whole = self.stepped, self.stepped.whole

        def make_order() -> Order:
            # rows stand in the order of their unknowns already
            if stepped.paired:
                return Order(paired_order(stepped.pattern), paired=True)
            order = any_order(stepped.pattern, leaving=bool(whole.form.scales))
            return with_pairs(stepped.pattern, order, lambda: stepped.own_rows)

        return whole.once(("order", *stepped.key), make_order)

    def complete_point(self, t: float, y: Floats) -> Floats:
        """Y [unknowns as written] at t (s) with the displacements that nothing reads where their constraints want them:
        runs do not integrate those, and what moves charge at once passes all of a node's.
        """
        whole, still = self.settled.whole, np.zeros(y.size)
        # rows of displacement constraints through which what nothing reads is known
        unread = np.isin(np.arange(y.size), self.settled.unread)
        row, column = whole.pattern.row, whole.pattern.columns_of()
        entry = np.flatnonzero(unread[column] & whole.of_groups("phi")[row])
        rows, at = np.unique(row[entry], return_inverse=True)
        # the least change that meets them, to first order
        slope, miss = whole.jacobian(t, y, still)[0][entry], whole.residual(t, y, still)[rows]
        return y + least_norm((rows.size, y.size), (at, column[entry], slope), -miss)


class _Condenser:
    """What runs of one system are condensed to: structures of the run before where the same unknowns may leave."""

    def __init__(self, system: System) -> None:
        self.whole = system.another("2v")
        self._allowed = np.zeros(0, dtype=bool)
        self._found: Elimination | None = None
        self._forms: Forms | None = None
        self._numbers: ConstantSums
        self._terms: Composition
        self._straights: Straights
        self._last: tuple[Forms | None, bytes] | None = None
        """What came of the last numbers asked, and their digest."""

    @cached_property
    def settled_system(self) -> System:
        """What points are settled with: made when rows are left for it."""
        return self.whole.another("settled")

    def forms(self, t: float, y: Floats, yd: Floats) -> Forms | None:
        """With the numbers of now; of the same start and parameters those of the last time."""
        digest = sha256()
        # the same start and parameters as the last time: the same forms
        for item in (np.array([t]), y, yd, self.whole.description.p):
            digest.update(np.ascontiguousarray(item).data)
        asked = digest.digest()
        if self._last is None or self._last[1] != asked:
            self._last = self._renew(t, y, yd), asked
        found = self._last[0]
        if found is not None:
            found.bind()
        return found

    def _renew(self, t: float, y: Floats, yd: Floats) -> Forms | None:
        """The forms at these numbers; None where little would leave, or sums are no numbers. Structures are found anew
        only where other entries may define.
        """
        whole = self.whole
        large, zero = whole.unknowns > LARGE, np.zeros(whole.unknowns)
        constant = whole.residual(t, zero, zero)
        del zero
        jy = None if large else whole.slopes(t, y, yd, rate=False)
        # of a large system the slopes are found twice rather than held
        allowed = definable(whole, whole.slopes(t, y, yd, rate=False) if jy is None else jy, constant, y)
        if self._found is None or not np.array_equal(allowed, self._allowed):
            self._allowed, self._found, self._forms = allowed, eliminate(whole, allowed), None
        found = self._found
        jy = whole.slopes(t, y, yd, rate=False) if jy is None else jy
        # too little leaves to pay for the detour
        few = found.place.size + found.unread.size < (1.0 - GAIN) * whole.unknowns
        # a definition whose entries are no numbers
        if few or not np.isfinite(jy[found.entry]).all():
            return None
        numbers = sums(whole, found, jy, constant)
        del jy, constant
        # constants that are no numbers
        if not np.isfinite(numbers.constant).all():
            return None
        if large:  # the room counts: other numbers find all anew
            self._allowed, self._found = allowed[:0].copy(), None
            held = [found, numbers]
            del found, numbers, allowed
            whole.put_away(whole=True)
            whole.spare()
            whole.trim()
            return self._make_forms(held)
        # no forms yet for this structure
        if self._forms is None:
            self._forms = self._make_forms([found, numbers])
        # the same structure with other numbers
        elif not numbers.same(self._numbers):
            self._numbers, factors = numbers, self._terms.values(numbers.factor)
            self._straights.renew(numbers)
            self._forms.stepped.renew(factors)
            self._forms.settled.renew(factors)
        return self._forms

    def _make_forms(self, held: list[Any]) -> Forms | None:
        """The forms of an elimination and its sums, which are taken out of held: what they need no more goes."""
        numbers: ConstantSums = held.pop()
        found: Elimination = held.pop()
        whole = self.whole
        rows = np.ones(whole.rows, dtype=bool)
        # rows that define an unknown, and rows q' - f of what nothing reads
        rows[found.row] = False
        rows[whole.form.k_row[np.isin(whole.form.k_q, found.unread)]] = False
        del found
        terms, straights = numbers.composition(whole.unknowns), Straights(numbers)
        straights.renew(numbers)
        factors = terms.values(numbers.factor)
        # a large system keeps only what it steps with
        if whole.unknowns > LARGE:
            straights.fix()
            terms, numbers = terms.places(), numbers.places()
        else:
            self._terms, self._straights, self._numbers = terms, straights, numbers
        kept = settled_rows(whole, self.settled_system, ~rows, numbers)
        # rows of rates that observers read would be open
        if kept is None:
            return None
        rows_of = {whole: places_of(rows), self.settled_system: places_of(kept)}
        del rows, kept
        made = {}
        # the settled form first: of a large system its pattern is let go before the other's is made
        for system in (self.settled_system, whole):
            form = made[system] = CondensedSystem(system, numbers, terms, straights, rows_of.pop(system))
            form.renew(factors)
            if whole.unknowns > LARGE:
                form.fix()
            form.renumber()
            form.make()
            if system is not whole and whole.unknowns > LARGE:
                assert form.rates is not None  # found by its pattern
                system.put_away(whole=True)
                whole.spare()
                whole.trim()
        for form in made.values():
            if whole.unknowns > LARGE:
                form.put_away()
        # both forms evaluate the whole system in the same room
        room = Room(max(form.places for form in made.values()), whole, self.settled_system)
        return Forms(made[whole], made[self.settled_system], room)


def condense_model(system: System, t: float, y: Floats, yd: Floats) -> Forms | None:
    """A model as written (form 3) without what constant sums define; None where little would be gained, or where the
    rest does not follow from what is kept alone.  The next call for the system may take the structures of this one.
    """
    least = STEEP if system.form.scales else LEAST
    # a small system, another form, redundant constraints or constraints that hold at times
    if system.unknowns < least or system.form.name != "3" or system.left_out or system._may_hold[0].size:
        return None
    # rows of constraints whose entries move
    if not system.once("steady", lambda: steady(system.description)):
        return None
    return system.own("condensed", lambda: _Condenser(system)).forms(t, y, yd)


def departures(system: System) -> list[tuple[str, str]]:
    """What leaves the runs of a model as written that have neither events nor jumps: names and why."""
    zero = np.zeros(system.unknowns)
    found = condense_model(system, 0.0, zero, zero)
    if found is None:
        return []
    parts = ((found.stepped.gone, DEFINED), (found.stepped.unread, UNREAD))
    # arrays by their first element: `C[0] ..`
    names = [f.name if not f.elements else f"{f.name_of(0)} .." for f in system.description.families]
    return [
        (f"{names[k]} ({number} of {system.description.families[k].size})", why)
        for places, why in parts
        for k, number in zip(*np.unique(system.family_of[places], return_counts=True), strict=True)
    ]
