"""Which unknowns are constant sums of others, found by whole families.

A row made of constants and constants times unknowns (`curved` of the manifest tells the others) defines an unknown of a
family where it holds that family once; so a row family defines as many at once, and loops stay loops.  What a row
defines must read nothing that is defined through it: the families that take part form a graph without cycles.  An
unknown whose derivative some row reads is kept: it carries the state, and the error test sees it.

Displacements that no row and no observer reads (the charge through a resistor) need not be integrated: where every
constraint between displacements is such a row, its rate takes its place (form 2v), and they are left out.
"""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray
from sysdyn.runtime import tuning
from sysdyn.runtime.condense.composition import places_of, ranges
from sysdyn.runtime.model.description import Description, Floats, Ints
from sysdyn.runtime.model.forms import FORMS
from sysdyn.runtime.model.patterns import number_pairs
from sysdyn.runtime.model.system import System
from sysdyn.runtime.numerics.equilibrate import sparse_factors
from sysdyn.values import dataclass

Mask = NDArray[np.bool_]
HEALTHY = tuning.OPEN
"""Least pivot, in the largest entry of its row with equilibrated columns: what it defines has these digits less.  Where
a row reads one unknown else, which carries the state, and no constant, it is a multiple of that and has all its digits
(the voltage of a capacitor of 1 pF, whose charge stays)."""
NOISE = tuning.BY_FACTORS
"""Of the largest term of a row at the start: what is less there may be round-off, and nothing is said by it."""
OBSERVERS = ("observe", "observe_rate", "observe_scale", "audit", "ledger", "initial")
LONGEST = 12
"""Definitions one after the other: through more of them the rest would read everything (a chain of scalars)."""
FEW = 256
"""Entries of rows that are looked at one by one: what is written out by hand has tens of thousands of families."""
SEARCHED = 64
"""Families among which a circle of definitions is looked for."""
PREFERRED = ("kappa", "mu", "e", "f")
"""Kinds in the order in which they are defined by rows that could define more than one."""


@dataclass(frozen=True, slots=True)
class Elimination:
    """Of one form.  place, row, pivot [eliminated]: each unknown, the row that defines it and its entry there, those
    that it reads before it; start [eliminated + 1], entry: the other entries of each row; unread: displacements left
    out with their rows q' = f.
    """

    place: Ints
    row: Ints
    pivot: Ints
    start: Ints
    entry: Ints
    unread: Ints


def unread_families(description: Description, blocks: Iterable[str]) -> tuple[int, ...]:
    """Families of displacements that neither these blocks nor any observer reads."""
    read: set[int] = set()
    for block in (*blocks, *OBSERVERS):
        for kernel in description.blocks.get(block, ()):
            # a block that does not say what it reads may read all
            if kernel.reads is None:
                return ()
            read |= kernel.reads
    return tuple(k for k in description.families_of("q") if k not in read)


def affine(system: System) -> Mask:
    """Rows [rows] that constants make of unknowns; rows q' - f are not among them."""
    found = np.zeros(system.rows, dtype=bool)
    for group, family, first in system.form.groups:
        blocks = [block for block, into in FORMS[system.form.name] if into == group]
        kernels = [kernel for block in blocks for kernel in system.description.blocks.get(block, ())]
        # a row is affine where no kernel of its group is curved in it
        if all(kernel.curved is not None and family not in kernel.curved for kernel in kernels):
            found[first : first + system.description.rows[family].size] = True
    return found


def steady(description: Description, blocks: tuple[str, ...] = ("phi", "phi_rate")) -> bool:
    """Every constraint between displacements is a constant sum of them: its rate holds it for good."""
    kernels = [kernel for block in blocks for kernel in description.blocks.get(block, ())]
    return all(kernel.curved is not None and not kernel.curved for kernel in kernels)


def _candidates(system: System) -> tuple[Ints, Mask, Mask]:
    """Entries of the rows that might define an unknown, whatever the numbers; what is unread [unknowns]; the unknowns
    that stay because rows read their derivatives [unknowns].
    """
    columns, rows = system.pattern.columns_of(), system.pattern.row
    moving = system.structural()[1]
    # displacements that only their own kinematics read: charges of sources
    unread = unread_families(system.description, (call.block for call in system.form.calls))
    gone = np.isin(system.family_of, unread) & system.are("q")
    usable = affine(system)
    # rows with rates define no unknown: their derivative would be needed
    usable[rows[moving]] = False
    carried = np.zeros(system.unknowns, dtype=bool)
    # what has a rate is a state: it stays
    carried[columns[moving]] = carried[system.form.k_q] = True
    return places_of(usable[rows]), gone, carried & ~gone


def definable(system: System, jy: Floats, constant: Floats, y: Floats) -> Mask:
    """Entries [entries] through which a row can define an unknown, by their values jy at any point; constant [rows]:
    what is left of each row where all unknowns are zero; y [unknowns]: of the start, at which what is defined must not
    be the small difference of large ones.
    """
    columns, rows = system.pattern.columns_of(), system.pattern.row
    size = np.abs(jy)
    # entries that are no numbers define nothing
    del jy
    size[~np.isfinite(size)] = 0.0
    here, gone, carried = system.once("may leave", lambda: _candidates(system))
    i, j = rows[here], columns[here]
    # |entry times value|: the term of the unknown in its row
    weight, term = size[here], y[j]
    np.multiply(weight, np.abs(term, out=term), out=term)
    terms = np.abs(constant)
    np.fmax.at(terms, i, term)
    # a small difference of large terms would lose its digits
    cancels = (term < HEALTHY * terms[i]) & (term > NOISE * terms[i])
    del term, terms
    by_row, by_column = sparse_factors(rows, columns, size, (system.rows, system.unknowns))
    # equilibrated, so that units do not decide which entry is large
    weight *= by_row[i]
    weight *= by_column[j]
    del size, by_row, by_column, columns  # of a large one the room counts
    largest = np.zeros(system.rows)
    np.maximum.at(largest, i, weight)
    reads = weight > 0.0
    # x = 5 y: a multiple of a state, whatever the factor
    multiple = (np.bincount(i[reads], minlength=system.rows) == 2) & (constant == 0.0)
    multiple &= np.bincount(i[reads & carried[j]], minlength=system.rows) == 1
    found = np.zeros(rows.size, dtype=bool)
    found[here] = ~(carried | gone)[j] & reads & ~cancels & ((weight >= HEALTHY * largest[i]) | multiple[i])
    return found


def eliminate(system: System, allowed: Mask) -> Elimination:
    """What can leave a form; allowed [entries]: `definable`."""
    gone = system.once("may leave", lambda: _candidates(system))[1]
    return _DefinitionSearch(system, allowed).found(places_of(gone))


def _rank(system: System, family: int) -> int:
    kind = system.description.families[family].kind
    return PREFERRED.index(kind) if kind in PREFERRED else len(PREFERRED)


def _numbers(of: Ints) -> set[int]:
    """Which numbers of families occur."""
    return set(of.tolist()) - {-1} if of.size < FEW else set(np.flatnonzero(np.bincount(of + 1)[1:]).tolist())


@dataclass(frozen=True, slots=True, eq=False)
class _Span:
    """Entries of some rows, row after row; rows [entries]: counted from the first; of: families of the unknowns."""

    entries: Ints
    rows: Ints
    of: Ints
    families: frozenset[int]


class _DefinitionSearch:
    """Unknowns and the rows that define them, as far as they are found; reads[a]: families that define family a; read:
    families that define any.  No family is defined through itself.

    allowed [entries]: the row may define the unknown.
    """

    def __init__(self, system: System, allowed: Mask) -> None:
        # entries in the order of rows, and where each row begins
        self.columns, self.rows = system.pattern.columns_of(), system.pattern.row
        self.of, self.allowed = system.family_of[self.columns], allowed
        entries = np.arange(self.rows.size, dtype=np.int32)
        self.start, self.entry = number_pairs(self.rows, entries, system.rows, entries.size)[1:]
        del entries
        self.seen: dict[tuple[int, int], _Span] = {}
        self.defined, self.free = np.zeros(system.unknowns, dtype=bool), np.ones(system.rows, dtype=bool)
        self.reads: dict[int, set[int]] = {}
        # which families a defined one reads, who reads it, and how deep it stands
        self.readers: dict[int, set[int]] = {}
        self.below: dict[int, int] = {}
        self.above: dict[int, int] = {}
        self.read: set[int] = set()
        self.parts: list[tuple[int, Ints]] = []
        # families in spans of rows: whole families are defined at once
        spans = [(first, first + system.description.rows[family].size) for _, family, first in system.form.groups]
        pairs = [(family, span) for span in spans for family in self._span(span).families]
        sizes = {pair: self._candidates(*pair).size for pair in pairs}
        # those that define most first; among equals by kind
        for family, span in sorted(pairs, key=lambda pair: (-sizes[pair], _rank(system, pair[0]), pair)):
            if sizes[family, span]:
                self._take(family, span)

    def _span(self, span: tuple[int, int]) -> _Span:
        """The entries of these rows."""
        if span not in self.seen:
            entries = self.entry[self.start[span[0]] : self.start[span[1]]]
            of = self.of[entries]
            self.seen[span] = _Span(entries, self.rows[entries] - span[0], of, frozenset(_numbers(of)))
        return self.seen[span]

    def _candidates(self, family: int, span: tuple[int, int]) -> Ints:
        """Entries through which these rows can define unknowns of a family: alone in their row, and free of circles; of
        several rows that could define an unknown the first.
        """
        seen = self._span(span)
        # an unknown that stands once in its row
        entries, own, of = seen.entries, seen.rows, seen.of
        here = of == family
        once = np.bincount(own[here], minlength=span[1] - span[0]) == 1
        # rows that read what is defined through this family would close a circle
        blocked = [k for k in seen.families if k != family and self._through(k, family)]
        once[own[np.isin(of, blocked)]] = False
        found = entries[here & once[own]]
        found = found[self.allowed[found] & ~self.defined[self.columns[found]] & self.free[self.rows[found]]]
        return np.asarray(found[np.unique(self.columns[found], return_index=True)[1]])

    def _through(self, first: int, family: int) -> bool:
        """Whether a family is defined through another one, or might be: no more than SEARCHED are looked at."""
        # nothing is defined through it
        if first not in self.reads or family not in self.read:
            return False
        seen, open_ = {first}, [first]
        # a search in the graph of definitions, cut off where it grows long
        while open_ and len(seen) <= SEARCHED:
            more = self.reads.get(open_.pop(), set()) - seen
            if family in more:
                return True
            seen |= more
            open_ += more
        return bool(open_)

    def _take(self, family: int, span: tuple[int, int]) -> None:
        """Defines what these rows can define of a family, unless a chain of definitions would grow too long."""
        chosen = self._candidates(family, span)
        if not chosen.size:
            return
        # what these rows read besides
        entries = self._span(span).entries
        taken = entries[np.isin(self.rows[entries], self.rows[chosen])]
        others = _numbers(self.of[taken]) - {family}
        below = 1 + max((self.below[k] for k in others if k in self.reads), default=0)
        # each link of a chain loses digits
        if below + self.above.get(family, 0) > LONGEST:
            return
        self._definition_depths(family, others, below)
        # one row defines one unknown
        self.defined[self.columns[chosen]] = True
        self.free[self.rows[chosen]] = False
        self.read |= others
        self.parts.append((family, chosen))

    def _definition_depths(self, family: int, others: set[int], below: int) -> None:
        """below[k]: definitions that k is made of one after the other, its own with them; above[k]: those that it is
        part of.
        """
        # the family reads these, and they know their reader
        self.reads.setdefault(family, set()).update(others)
        for k in others:
            self.readers.setdefault(k, set()).add(family)
        # upwards: those who read it stand deeper
        work = [(family, below)]
        while work:
            k, depth = work.pop()
            if depth > self.below.get(k, 0):
                self.below[k] = depth
                work += [(r, depth + 1) for r in self.readers.get(k, ())]
        # downwards: what it reads is part of more
        work = [(k, self.above.get(family, 0) + 1) for k in others]
        while work:
            k, depth = work.pop()
            if depth > self.above.get(k, 0):
                self.above[k] = depth
                work += [(r, depth + 1) for r in self.reads.get(k, ())]

    def _depths(self) -> dict[int, int]:
        """How many definitions a family is defined through, one after the other."""
        found: dict[int, int] = {}
        for first in self.reads:
            # depth first without recursion: a family after all that it reads
            path = [first]
            while path:
                new = [k for k in self.reads.get(path[-1], ()) if k not in found]
                if not new:
                    family = path.pop()
                    found[family] = max((1 + found[k] for k in self.reads.get(family, ())), default=0)
                path += new
        return found

    def found(self, unread: Ints) -> Elimination:
        """The unknowns, families that others read first, each in the order of its places."""
        none = np.zeros(0, dtype=np.int32)
        # one after the other, in order of depth: each reads only those before it
        pivot = np.concatenate([none, *(part for _, part in self.parts)])
        depths = self._depths()
        depth = np.concatenate([none, *(np.full(part.size, depths[f], dtype=np.int32) for f, part in self.parts)])
        pivot = pivot[np.lexsort((self.columns[pivot], depth))]
        # entries of the defining rows but the pivots
        row = self.rows[pivot]
        begin, count = self.start[row], self.start[row + 1] - self.start[row]
        others = np.ones(self.rows.size, dtype=bool)
        others[pivot] = False
        entry = self.entry[ranges(begin, count)]
        entry = entry[others[entry]]
        start = np.append(np.int32(0), np.cumsum(count - 1, dtype=np.int32))
        return Elimination(self.columns[pivot], row, pivot, start, entry, unread)
