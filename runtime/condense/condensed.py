"""A form of a model without what can be eliminated, as the core's steppers and the settling see it.

The system of core/system/condensed.h: kept unknowns z, kept rows, e = c + T z for the others (sums.py).
"""

from __future__ import annotations

import ctypes as c
from collections.abc import Sequence
from functools import cached_property
from hashlib import sha256
from typing import Any

import numpy as np
from numpy.typing import NDArray
from sysdyn.runtime.condense.composition import Composition, places_of, ranges
from sysdyn.runtime.condense.elimination import Mask
from sysdyn.runtime.condense.sums import ConstantSums, Straights, numbers_of
from sysdyn.runtime.model import core_library as lib
from sysdyn.runtime.model.description import Floats, Ints, Kernel
from sysdyn.runtime.model.failures import RowLabel
from sysdyn.runtime.model.forms import stretches
from sysdyn.runtime.model.lines import stretches_of, table
from sysdyn.runtime.model.patterns import Pattern, Places, compress
from sysdyn.runtime.model.redirected import redirect_entries
from sysdyn.runtime.model.system import LARGE, System
from sysdyn.runtime.numerics.matching import match_rows
from sysdyn.runtime.numerics.ordering import SMALL
from sysdyn.runtime.numerics.stretches import Ascents, Stretches, whole_of

AUDITED = ("audit", "ledger")
"""Blocks that are read where a step's energies are balanced."""
OBSERVING = ("observe", "observe_rate", "audit", "ledger")
SHOWING = (*OBSERVING, "observe_scale")
"""Blocks that a row reads."""


def _spans(full: NDArray[np.integer], number: NDArray[np.integer]) -> tuple[NDArray[np.integer], ...]:
    """Stretches in which places and numbers ascend by one: first place, first number, length."""
    begin = np.flatnonzero(np.concatenate([[True], (np.diff(full) != 1) | (np.diff(number) != 1)])[: full.size])
    return full[begin], number[begin], np.diff(np.concatenate([begin, [full.size]]))


class Room:
    """Where points, rows and matrices of whole systems are evaluated, one after the other; made when asked for."""

    def __init__(self, entries: int, *systems: System) -> None:
        self._systems, self._entries = systems, entries
        self.large = systems[0].unknowns > LARGE

    @cached_property
    def y(self) -> Floats:
        """A point [unknowns]."""
        return np.zeros(max(max(system.form.extended, system.unknowns) for system in self._systems) + 8)

    @cached_property
    def yd(self) -> Floats:
        """Its rates."""
        return np.zeros(self.y.size)

    @cached_property
    def slope(self) -> Floats:
        """Rows or entries of a matrix, of large systems rows alone: the core finds room for each matrix."""
        entries = 0 if self.large else self._entries
        return np.zeros(max(entries, *(system.rows for system in self._systems)) + 1)

    def rest(self) -> None:
        """Lets go of it all: who has its addresses binds it anew before anything is evaluated."""
        for name in ("y", "yd", "slope"):
            self.__dict__.pop(name, None)


class CondensedSystem:
    """The kept unknowns and rows of a system; what Method and Settler ask of a System, with places of its own.

    kept, kept_rows: their places in the whole system; core: the core's structure of it; paired: row k belongs to
    unknown k; own_rows [unknowns]: where not every unknown has a row, those that are sure (-1: none).
    """

    def __init__(
        self, system: System, found: ConstantSums, terms: Composition, straights: Straights, kept_rows: Ints
    ) -> None:
        """found: the structure; terms: as sums of kept unknowns; straights: of found."""
        self._straights = straights
        self.whole, self.sums = system, found
        self._kept: Ints | Ascents = found.kept
        self._kept_rows: Ints | Ascents = kept_rows
        self._gone: Ints | Ascents = found.place
        self._unread: Ints | Ascents = found.unread
        self.unknowns, self.rows = int(found.kept.size), int(kept_rows.size)
        self.paired = False
        self.own_rows: Ints | None = None
        self._keep: list[object] = []
        columns = self._products(terms)
        self._lay_out(columns)
        # of a small system the order of rows does not matter to the elimination
        if self.unknowns == self.rows > SMALL and self._pair():
            self._lay_out(columns)

    def _pair(self) -> bool:
        """Kept rows in the order of the unknowns that they belong to: those whose rate they read, then any matching.
        False where there is none, and the order stays.
        """
        # rows that read a rate belong to the unknown whose rate it is
        form, columns, rows = self.whole.form, self.whole.pattern.columns_of(), self.whole.pattern.row
        row_at, at = numbers_of(self.whole.rows, self.kept_rows), numbers_of(self.whole.unknowns, self.kept)
        moving = self.whole.structural()[1]
        row = row_at[np.concatenate([form.k_row, rows[moving]])]
        column = at[np.concatenate([form.k_q, columns[moving]])]
        here = (row >= 0) & (column >= 0)
        row, column = row[here], column[here]
        # pairs that are alone in their row and their column
        alone = np.bincount(row, minlength=self.rows)[row] == 1
        alone &= np.bincount(column, minlength=self.rows)[column] == 1
        own = np.full(self.unknowns, -1)
        own[column[alone]] = row[alone]
        free = np.ones(self.rows, dtype=bool)
        free[row[alone]] = False
        del columns, rows, row_at, at, moving, row, column, here, alone  # of a large one the room counts
        # the rest by a matching in the pattern that is left
        left, open_ = np.flatnonzero(own < 0), np.flatnonzero(free)
        entries = (own[self.pattern.columns_of()] < 0) & free[self.pattern.row]
        number, place = np.cumsum(own < 0) - 1, np.cumsum(free) - 1
        where = Places(place[self.pattern.row[entries]], number[self.pattern.columns_of()[entries]])
        rest, _ = compress(open_.size, left.size, [where])
        found = match_rows(rest)
        # no matching: pairs found so far still say which rows belong to which unknowns
        if (found < 0).any():
            self.own_rows = own.astype(np.int32)
            return False
        own[left] = open_[found]
        self._kept_rows, self.paired = self.kept_rows[own], True
        return True

    @property
    def kept(self) -> Ints:
        """Places of the kept unknowns in the whole system."""
        return whole_of(self._kept)

    @property
    def kept_rows(self) -> Ints:
        """Places of the kept rows in the whole system."""
        return whole_of(self._kept_rows)

    @property
    def gone(self) -> Ints:
        """Places of the unknowns that are sums of kept ones."""
        return whole_of(self._gone)

    @property
    def unread(self) -> Ints:
        """Places of the unknowns that nothing reads."""
        return whole_of(self._unread)

    def expand_point(self, kept: Floats, stays: Floats | Stretches[Any], *, rate: bool = False) -> Floats:
        """Every unknown [unknowns of the whole] of a point, or the rate of each, by those of what is kept and of what
        nothing reads.
        """
        found = np.empty(self.whole.unknowns)
        found[self.unread] = whole_of(stays)
        lib.core.sd_condensed_expand(c.byref(self.condensed), lib.pointer(kept), lib.pointer(found), int(rate))
        return found

    def put_away(self) -> None:
        """Of a large system, once all is made: nobody reads these places for a while."""
        del self.sums
        self._kept, self._kept_rows = Ascents(self.kept), Ascents(self.kept_rows)
        self._gone, self._unread = Ascents(self.gone), Ascents(self.unread)

    def _hold(self, array: Ints | Floats) -> int | None:
        self._keep.append(array)
        return lib.pointer(array)

    def _products(self, terms: Composition) -> Ints:
        """Which entries of the whole matrix add to this one with what factor; the column of each such product."""
        system, found = self.whole, self.sums
        kept = np.zeros(system.rows, dtype=bool)
        kept[self.kept_rows] = True
        entry = places_of(kept[system.pattern.row])
        columns = system.pattern.columns_of()[entry]
        at, place = numbers_of(system.unknowns, self.kept)[columns], numbers_of(system.unknowns, found.place)[columns]
        # entries of unknowns that nothing reads have no place here
        read = (at >= 0) | (place >= 0)
        entry, at, place = entry[read], at[read], place[read]
        del columns, read
        # an entry of a kept unknown is a product, one of an eliminated unknown as many as that has terms
        gone = place >= 0
        count = np.ones(entry.size, dtype=np.int32)
        count[gone] = np.diff(terms.start)[place[gone]]
        # terms of the sums in the place of the entries of defined unknowns
        term = ranges(terms.start[place[gone]], count[gone])
        through = places_of(np.repeat(gone, count))
        column = np.repeat(at, count)
        column[through] = terms.source[term]
        self._shared = through, term
        self._from, self._share = np.repeat(entry, count), np.ones(column.size)
        return column

    def _lay_out(self, column: Ints) -> None:
        """The pattern of the products, and the place of each in it."""
        row = numbers_of(self.whole.rows, self.kept_rows)[self.whole.pattern.row[self._from]]
        self.pattern: Pattern
        self.pattern, (self._to,) = compress(self.rows, self.unknowns, [Places(row, column)])

    def _spans(self, full: Ints, chosen: Mask | None = None) -> tuple[c.Array[Any], int]:
        """Of the places of all numbers, or of those chosen [full]."""
        number = np.arange(full.size) if chosen is None else np.flatnonzero(chosen)
        first, begin, length = _spans(full[number], number)
        made = (lib.PlaceSpan * max(first.size, 1))()
        for k, span in enumerate(zip(first.tolist(), begin.tolist(), length.tolist(), strict=True)):
            made[k] = lib.PlaceSpan(*span)
        self._keep.append(made)
        return made, int(first.size)

    def renew(self, factors: Floats) -> None:
        """Takes the numbers of other sums of the same structure: the entries of T."""
        at, term = self._shared
        self._share[at] = factors[term]

    def fix(self) -> None:
        """Lets go of what only other numbers would need: `renew` is not asked again."""
        del self._shared

    def _observed_rates(self) -> bool:
        """Whether what is observed reads rates of eliminated unknowns."""
        read = {family for kernel in self._kernels(OBSERVING) for family in kernel.rates or ()}
        gone = np.zeros(self.whole.unknowns, dtype=bool)
        gone[self.gone] = True
        return bool(read & self.whole.families_in(gone))

    def _mark(self, name: str, read: Sequence[frozenset[int] | None]) -> None:
        """Says by that field which stretches hold families that are read, or sums of them: others are left out then;
        all do where it is not known of some block.
        """
        # None: a block that does not say what it reads
        if None not in read:
            families = frozenset[int]().union(*(some or () for some in read))
            self._straights.mark(name, np.isin(self.whole.family_of, sorted(families)))

    def _kernels(self, names: Sequence[str]) -> list[Kernel]:
        """Of the blocks of these names."""
        return [kernel for name in names for kernel in self.whole.description.blocks.get(name, ())]

    def _own_rows(self) -> Ints:
        """Kept rows q' - f as stretches (core/system/condensed.h), where no block adds to any and none is held."""
        whole, form = self.whole, self.whole.form
        # rows q' - f to which a block of multipliers adds (index 2)
        firsts = [planned.to[(planned.to >= 0) & (planned.to < form.kinematics)] for planned in form.calls]
        row = numbers_of(whole.rows, self.kept_rows)[form.k_row]
        q = numbers_of(whole.unknowns, self.kept)[form.k_q]
        here = row >= 0
        # rows that are more than q' - f are evaluated as all others
        if any(first.size for first in firsts) or whole.core.held or (q[here] < 0).any():
            return np.zeros((0, 4), dtype=np.int32)
        order = np.argsort(row[here], kind="stable")
        return stretches(row[here][order], q[here][order], form.k_f[here][order])

    def _rate_columns(self) -> Mask:
        """Of the kept unknowns [unknowns] those whose derivatives enter a row that is not q' - f by itself."""
        blocks, form = self.whole.description.blocks, self.whole.form
        planned = [call.block for call in (*form.calls, *form.scales)]
        rates = [kernel.rates for block in planned for kernel in blocks.get(block, ())]
        # without stretches, or where a block does not say whose rates it reads: all
        if not self._own.size or None in rates:
            return np.ones(self.unknowns, dtype=bool)
        read = frozenset[int]().union(*(families for families in rates if families))
        return np.isin(self.whole.family_of[self.kept], sorted(read))

    def _trim_rows(self) -> lib.System:
        """The whole system without rows q' - f that are not kept."""
        whole, form = self.whole, self.whole.form
        kept = np.zeros(whole.rows, dtype=bool)
        kept[self.kept_rows] = True
        here = kept[form.k_row]
        number = self._number
        # places of what is left, in the numbering of the entries that are read
        slot_q, slot_f = (self._hold(np.ascontiguousarray(number[slots][here])) for slots in whole.slots[:2])
        spans = stretches(*(np.ascontiguousarray(part[here]) for part in (form.k_row, form.k_q, form.k_f)))
        # entries go to places of their own: of those not read to one that all share
        elsewhere = redirect_entries(whole, number, number, self.places)
        self._keep.append(elsewhere)
        made = elsewhere.core
        made.kinematics = int(here.sum())
        made.k_q = made.k_f = None  # told by their stretches
        made.k_slot_q, made.k_slot_f = slot_q, slot_f
        made.k_scale = None
        made.k_span, made.k_spans = self._hold(spans), 0 if self._own.size else len(spans)
        for k, planned in enumerate(form.calls):  # without loops that add to rows that are not kept alone
            whole.spare_loops(elsewhere.calls[k], planned.block, kept, planned.to)
        return made

    def renumber(self) -> None:
        """Gives the entries that are read numbers of their own, and the others one place together: once."""
        # products of one column stand together: so many lines of so many entries
        column = self.whole.pattern.columns_of()[self._from]
        begin = np.flatnonzero(np.diff(column, prepend=-1))
        width = np.diff(begin, append=column.size)
        change = np.flatnonzero(np.diff(width, prepend=-1))
        self._shapes = list(zip(np.diff(change, append=width.size).tolist(), width[change].tolist(), strict=True))
        # an entry that no product reads has no number of its own
        read = np.zeros(self.whole.pattern.entries, dtype=bool)
        read[self._from] = True
        self.places = int(read.sum()) + 1
        self._number = np.cumsum(read, dtype=np.int32)
        self._number -= 1
        self._number[~read] = self.places - 1
        self._from = self._number[self._from]

    def make(self) -> None:
        """The core's structures, of entries that are numbered: once."""
        whole = self.whole
        # families that the ledgers read, and whose rates the observers show
        self._mark("audited", [kernel.reads for kernel in self._kernels(AUDITED)])
        self._mark("rated", [kernel.rates for kernel in self._kernels(SHOWING)])
        self._own = self._own_rows()
        self._trim = self._trim_rows()
        del self._number
        # lists of places as stretches, which are few
        unknown, row = self._spans(self.kept), self._spans(self.kept_rows)
        rate = self._spans(self.kept, self._rate_columns())
        rest = self._spans(self.kept_rows, self.kept_rows >= (whole.form.kinematics if self._own.size else 0))
        self.condensed = lib.Condensed(
            full=c.addressof(self._trim),
            unknowns=self.unknowns,
            rows=self.rows,
            unknown_spans=unknown[1],
            row_spans=row[1],
            rate_spans=rate[1],
            rest_spans=rest[1],
            own_spans=len(self._own),
            straights=self._straights.number,
            unknown=c.addressof(unknown[0]),
            row=c.addressof(row[0]),
            rate=c.addressof(rate[0]),
            rest=c.addressof(rest[0]),
            own=self._hold(self._own),
            straight=c.addressof(self._straights.array),
            observed_rates=int(self._observed_rates()),
            **self._told_products(),
        )
        self.core = lib.System(
            unknowns=self.unknowns,
            rows=self.rows,
            entries=self.pattern.entries,
            column=lib.pointer(self.pattern.column),
            row=lib.pointer(self.pattern.row),
            scales=whole.core.scales,
            stop=whole.core.stop,
            steady=whole.core.steady,
            together=whole.core.together,
        )

    def bind(self, room: Room) -> None:
        """Says where the whole system is evaluated: once it is known how much room all forms need."""
        condensed = self.condensed
        condensed.y, condensed.yd = lib.pointer(room.y), lib.pointer(room.yd)
        condensed.r = lib.pointer(room.slope)
        condensed.slope = None if room.large else condensed.r
        lib.core.sd_condensed_bind(c.byref(condensed), c.byref(self.core))

    def _told_products(self) -> dict[str, int | None]:
        """The products as the core has them: of a large system by stretches, where these are few."""
        found = None
        # of a large system as lines that repeat, if they are few
        if self.whole.unknowns > LARGE:
            found = stretches_of([self._from, self._to], self._shapes, self._share)
        # else places one by one
        if found is None:
            places = {"from_": self._hold(self._from), "to": self._hold(self._to), "share": self._hold(self._share)}
            return {"products": self._from.size, **places}
        made = (lib.Shares * max(len(found), 1))()
        for k, (at, number, width) in enumerate(found):
            tables = *table(self._from, found[k]), *table(self._to, found[k])
            held = [*(self._hold(item) for item in tables), self._hold(self._share[at : at + width].copy())]
            made[k] = lib.Shares(number, width, *held)
        # what the stretches say is let go
        self._keep.append(made)
        nothing = np.zeros(0, dtype=np.int32)
        self._from, self._to, self._share = nothing, nothing, np.zeros(0)
        return {"stretches": len(found), "shares": c.addressof(made)}

    @cached_property
    def key(self) -> tuple[int | bytes, ...]:
        """What of it an order of elimination and places in matrices depend on, beside the whole form."""
        digest = sha256()
        for part in (self.kept, self.kept_rows, self.pattern.column, self.pattern.row):
            digest.update(np.ascontiguousarray(part).data)
        return self.unknowns, digest.digest()

    @cached_property
    def rates(self) -> Ints:
        """Numbers of kept unknowns whose derivatives occur."""
        # entries of rates in rows that are kept
        columns, rows = self.whole.pattern.columns_of(), self.whole.pattern.row
        here = np.zeros(self.whole.rows, dtype=bool)
        here[self.kept_rows] = True
        moving = np.zeros(self.whole.unknowns, dtype=bool)
        moving[columns[self.whole.structural()[1] & here[rows]]] = True
        return np.flatnonzero(moving[self.kept]).astype(np.int32)

    def name(self, number: int) -> str:
        """Name of a kept unknown."""
        return self.whole.name(int(self.kept[number]))

    def row_label(self, number: int) -> RowLabel:
        """Label of a kept row."""
        return self.whole.row_label(int(self.kept_rows[number]))
