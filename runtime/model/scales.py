"""Magnitudes of the unknowns: what relative tolerances and scaled matrices refer to.

A magnitude is the nominal value of the manifest where it names one.  Else the largest of |y| at the start, |y'| times
the time scale of the start (never the span alone: a long run would call everything small), and a thousandth of these
among unknowns of the same kind and unit.  That time is the shortest in which anything gets as far as it is, or as its
like are where it is zero, unless it goes a thousand times as far (a particle near the speed of light beside a ball).
Unknowns that are zero with all of that take the magnitude that balances the rows they stand in: the other terms
of the row, and how far the row itself moves with t over the span (sources that start at zero).  What a steep law
proposes is shortened to what it bears: its slope is that of one point (core/start/magnitudes.c).  Such a row knows
nothing of what relieves it (the whole of a source on a diode would drive 1e8 A), and balances little where what drives
it is round-off (a diode that blocks): those that carry the state lie within what the sources make of them by the time
in which they move, or a thousandth of that of their like, and what by the whole span (core/start/response.h).  They are
no less than round-off of the terms that balance there makes of them, for what is held answers to nothing.
During a run magnitudes grow with max |y|, and what begins to move gets a thousandth of its like.  Behind a run that
has met less of a content than was guessed the next one guesses no more than that: else both would pass over what is
small beside the guess, and agree (a light mass that rings on a spring, 1272 times less than balances would let it).
"""

from __future__ import annotations

import ctypes as c

import numpy as np
from numpy.typing import NDArray
from sysdyn.runtime import tuning
from sysdyn.runtime.model import core_library as lib
from sysdyn.runtime.model.balance import RowBalance
from sysdyn.runtime.model.description import Floats, Ints
from sysdyn.runtime.model.inertia import own_places, with_flows
from sysdyn.runtime.model.patterns import Pattern, read_only
from sysdyn.runtime.model.system import LARGE, System
from sysdyn.values import dataclass

ROUND_OFF = tuning.CANCELS
"""Of the largest quantity of the same unit: smaller ones are what is left of a zero."""
UNKNOWN = 1.0
"""Magnitude of what is zero with all that could size it."""
GROUP = tuning.SMALL
_SAMPLES = 16
_PARTS = np.array([1e-6, *((np.arange(_SAMPLES) + 0.618) / _SAMPLES)])
"""Of the span: where rows are asked how far they moved, the first to tell how fast."""
RUNGS = 1e-3 ** np.arange(4)
"""Of the time scale: steps of implicit Euler that tell how far unknowns get."""
Far = tuple[Floats, Floats, Floats, int]
_HOLDS = ("phi", "psi")
"""Beginnings of the names of groups of constraints."""
SWEEPS = 8


@dataclass(frozen=True, slots=True)
class Sizing:
    """The core's tables for the magnitudes of one form (core/start/sizing.h), and the arrays that they point to."""

    core: lib.Sizing
    kept: tuple[object, ...]


def sizing(system: System) -> Sizing:
    """Found once a text."""
    return system.once("sizing", lambda: _sizing(system))


def _sizing(system: System) -> Sizing:
    """The tables from which the core finds magnitudes: balance, kinds, own entries of coordinates, displacements."""
    rows, nominal = balance(system), system.named
    kind, own = _kinds(system), [places.astype(np.int32) for places in own_places(system)]
    effort, moved = (item.astype(np.int32) for item in _rows_of_displacements(system))
    # a momentum's size is that of its flow, by its inertia
    partner = None
    if system.are("p").any():
        partner = np.full(system.unknowns, -1, dtype=np.int32)
        momenta, flows = with_flows(system)
        partner[momenta] = flows
    # arrays are kept as long as the structure points to them
    arrays = nominal, kind, partner, *own, effort, moved
    core = lib.Sizing(
        balance=rows.address,
        nominal=lib.pointer(nominal),
        kind=lib.pointer(kind),
        partner=lib.pointer(partner),
        owns=tuple(item.size for item in own),
        efforts=effort.size,
        effort=lib.pointer(effort),
        moved=lib.pointer(moved),
        parts=_PARTS.size,
        part=lib.pointer(_PARTS),
        rungs=RUNGS.size,
        rung=lib.pointer(RUNGS),
    )
    core.own[:] = [lib.pointer(item) for item in own]
    return Sizing(core, (rows, arrays))


def _kinds(system: System) -> Ints:
    """What each unknown is, as core/start/sizing.h says it [unknowns]."""
    masks = (
        system.are("q", "f", "p", "s"),
        system.are("f"),
        _with_momentum(system),
        *(system.are(kind) for kind in ("q", "p", "s")),
    )
    # one bit for each property
    found = np.zeros(system.unknowns, dtype=np.int32)
    for k, mask in enumerate(masks):
        found |= mask.astype(np.int32) << k
    return found


def balance(system: System) -> RowBalance:
    """The rows of a system's Jacobian."""
    pattern = system.pattern
    return system.once("balance", lambda: RowBalance(system.rows, pattern.row, pattern.columns_of(), alike(system)))


def _rows_of_displacements(system: System) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Rows of dynamics, and the places of their displacements."""
    form, description = system.form, system.description
    places = {description.families[k].owner: k for k in description.families_of("q")}
    rows = [np.zeros(0, dtype=np.int64)]
    columns = [np.zeros(0, dtype=np.int64)]
    for group, family, first in form.groups:
        owner = description.rows[family].owner
        number = description.rows[family].size
        # balances of coordinates that have displacements
        if group == "dynamics" and owner in places and description.families[places[owner]].size == number:
            rows.append(first + np.arange(number))
            columns.append(form.at[places[owner]] + np.arange(number))
    return np.concatenate(rows), np.concatenate(columns)


def alike(system: System) -> Ints:
    """Number of the kind and unit of each unknown [unknowns]; read-only."""
    begin, number = _groups(system)
    return system.once_if_small("alike", lambda: read_only(np.repeat(number, np.diff(begin, append=system.unknowns))))


def _groups(system: System) -> tuple[Ints, Ints]:
    """Where stretches of one kind and unit begin among the unknowns, and the number of each."""
    return system.once("groups of unknowns", lambda: _alike(system))


def _alike(system: System) -> tuple[Ints, Ints]:
    families, numbers = system.description.families, kinds_and_units(system)
    # nu have a number of their own
    number = [*(numbers[family.kind, family.unit] for family in families), len(numbers)]
    every = np.array(number, dtype=np.int32)[system.family_of]
    begin = np.flatnonzero(np.diff(every, prepend=-1)).astype(np.int32)
    return begin, every[begin]


def kinds_and_units(system: System) -> dict[tuple[str, str], int]:
    """Number of each kind and unit."""
    keys: dict[tuple[str, str], int] = {}
    for family in system.description.families:
        keys.setdefault((family.kind, family.unit), len(keys))
    return keys


def group_maximum(system: System, values: Floats) -> Floats:
    """Largest value among the unknowns of the same kind and unit."""
    begin, of = _groups(system)
    return _largest(begin, of, values)


def group_maxima(system: System, values: Floats) -> Floats:
    """Largest absolute value of each kind and unit, by its number in `alike`; zero at least."""
    numbers, families, (first, which) = kinds_and_units(system), system.description.families, system.begins
    of = [*(numbers[families[k].kind, families[k].unit] for k in which), len(numbers)]  # nu behind the others
    more = system.unknowns > system.form.written
    begin = np.append(first, np.int32(system.form.written))[: first.size + more]
    largest = np.zeros(len(numbers) + 1)
    if begin.size:
        np.maximum.at(largest, of[: begin.size], np.maximum.reduceat(values, begin))
    return largest


def round_off_beside(system: System, magnitude: Floats) -> Floats:
    """What is left of a zero beside the largest unknown of its unit [observed values]."""
    description, largest = system.description, dict[str, float]()
    for (_, unit), most in zip(kinds_and_units(system), group_maxima(system, magnitude), strict=False):
        # over all kinds of one unit: a force beside reactions
        largest[unit] = max(float(most), largest.get(unit, 0.0))
    rows = [description.rows[k] for k in description.rows_of("observe")]
    sizes = [ROUND_OFF * largest.get(row.unit, 0.0) for row in rows]
    return np.repeat(np.array(sizes, dtype=np.float64), [row.size for row in rows])


def largest_of_group(group: NDArray[np.integer], values: Floats) -> Floats:
    """Of each value the largest of its group [values]; zero at least.  Groups lie in stretches, for families do."""
    # reduceat refuses empty arrays
    if not group.size:
        return np.zeros(0)
    new = np.ones(group.size, dtype=bool)
    np.not_equal(group[1:], group[:-1], out=new[1:])
    # stretches of one group
    begin = np.flatnonzero(new)
    return _largest(begin, group[begin], values)


def _largest(begin: NDArray[np.integer], of: NDArray[np.integer], values: Floats) -> Floats:
    largest = np.zeros(int(of.max(initial=-1)) + 1)
    # the largest of each stretch, then of its group
    if begin.size:
        np.maximum.at(largest, of, np.maximum.reduceat(values, begin))
    return np.repeat(largest[of], np.diff(begin, append=values.size))


def balanced_sizes(system: System, y: Floats, jy: Floats) -> Floats:
    """Size of each unknown at a point [unknowns], all positive: |y|, or what balances its rows."""
    size = np.where(np.isfinite(jy), np.abs(jy), 0.0)
    found = balance(system).propagate(np.abs(y), size, np.zeros(system.rows), largest=True)
    found = np.maximum(found, GROUP * group_maximum(system, found))
    return np.where(found > 0.0, found, 1.0)


def unresolved_sizes(system: System, y: Floats, jy: Floats) -> Floats:
    """What round-off leaves open of each unknown [unknowns]: of the terms of the constraints that it stands in.

    A charge of 1e-17 C in a sum with one of 0.1 C is known to 1e-17 C, whatever tolerance is asked of it.
    """
    found = np.zeros(system.unknowns)
    arrays = map(lib.pointer, (_holding(system), np.ascontiguousarray(y), jy, found))
    # the core found no memory
    if lib.core.sd_unresolved(c.byref(system.core), *arrays):
        raise MemoryError
    return found


def _holding(system: System) -> NDArray[np.bool_]:
    """Rows of constraints [rows]."""
    return system.of_groups(*(g for g in dict.fromkeys(g for g, _, _ in system.form.groups) if g[:3] in _HOLDS))


def noise(system: System, pattern: Pattern, y: Floats, jy: Floats, time: float) -> Floats:
    """What round-off leaves open of each unknown [unknowns] in steps of `time` (s): flows are differences of their
    displacements over it, and multipliers balance what flows make of that.  pattern: the system's, which may have let
    go of it.
    """
    found, (bare, _held) = np.zeros(system.unknowns), system.bare(pattern)
    # flags of what stands where, the point, its slopes
    arrays = map(lib.pointer, (*noisy(system), np.ascontiguousarray(y), jy))
    if lib.core.sd_noise(c.byref(bare), *arrays, time, SWEEPS, GROUP, lib.pointer(found)):
        raise MemoryError
    return found


def noisy(system: System) -> tuple[NDArray[np.bool_], NDArray[np.bool_], NDArray[np.bool_], NDArray[np.bool_]]:
    """Rows of constraints, of balances [rows], multipliers and flows [unknowns], as `noise` goes by them."""
    return _holding(system), system.of_groups("dynamics"), system.are("kappa", "mu", "e"), system.are("f")


def _with_momentum(system: System) -> NDArray[np.bool_]:
    """Unknowns of coordinates whose momenta are unknowns [unknowns]; read-only."""
    return system.once("with momentum", lambda: _own_momentum(system))


def _own_momentum(system: System) -> NDArray[np.bool_]:
    families = system.description.families
    owners = {family.owner for family in families if family.kind == "p"}
    member = np.array([*(family.owner in owners for family in families), False])
    return read_only(np.asarray(member[system.family_of]))


def magnitudes(
    system: System, t0: float, t_end: float, y: Floats, yd: Floats, far: Far | None = None, *, spent: bool = False
) -> tuple[Floats, float]:
    """Magnitude of each unknown [unknowns], all positive, and the time scale of the start [s].

    far: the motion linearised at the start, which says how far each unknown gets (sd_relaxed, start/sizing.h): dF/dy,
    dF/dyd [entries], rates [unknowns], the address of an order of elimination; None: as its rate says.  spent: nobody
    else needs these entries, which are overwritten: of a large system the room counts.
    """
    span = max(t_end - t0, 0.0) or 1.0
    a = system._read(_finite(y))
    del y  # of a large system the room counts
    b = system._read(_finite(yd))
    found, tau = np.zeros(system.unknowns), np.zeros(1)
    # without a linearised motion the core goes by rates
    motion = (None, None, None, None) if far is None else (*map(lib.pointer, far[:3]), far[3])
    answers = lib.pointer(found), lib.pointer(tau)
    tables = sizing(system)
    # of a large system what was found on the way is let go
    if system.unknowns > LARGE:
        system.spare()
    core = c.byref(tables.core), c.byref(system.core)
    if lib.core.sd_magnitudes(*core, t0, span, lib.pointer(a), lib.pointer(b), *motion, spent, *answers):
        raise MemoryError
    system.failure.check()
    return found, float(tau[0])


def _finite(x: Floats) -> Floats:
    """X with zeros for what is no number."""
    finite = np.isfinite(x)
    return x if finite.all() else np.where(finite, x, 0.0)


def confirm_magnitudes(system: System, span: float, met: Floats, magnitude: Floats) -> Floats:
    """Magnitudes after a run [unknowns]: the largest |y| it met and a thousandth of that among unknowns of the same
    kind and unit, where that is less than it went by and not round-off.  Multipliers keep theirs: what they met may be
    round-off altogether.
    """
    found, by_kind = np.zeros(system.unknowns), _by_kind(system)
    arrays = lib.pointer(met), lib.pointer(magnitude), lib.pointer(found)
    bare, _held = system.bare()
    if lib.core.sd_confirmed(c.byref(by_kind.core), c.byref(bare), span, *arrays):
        raise MemoryError
    return found


def ceiling(system: System, met: Floats, confirmed: Floats) -> Floats:
    """What guesses of the next run are no larger than [unknowns]: of contents that nothing names the largest |y| met,
    or a thousandth of what the run confirmed; nothing of one that is zero but for round-off.  Flows are left alone
    where branches may block: theirs are round-off (bridges of exponential diodes at 1e-5: 192596 steps by theirs too,
    4297 without, 31547 by guesses alone).
    """
    found, by_kind = confirmed.copy(), _by_kind(system)
    blocks = bool(system.form.scales) or bool(system.description.switches.places)
    lib.core.sd_ceiling(c.byref(by_kind.core), blocks, lib.pointer(met), lib.pointer(found))
    return found


def _by_kind(system: System) -> Sizing:
    """The core's tables without the rows, which nobody reads who goes by kinds alone."""
    return system.once_if_small("sizing by kind", lambda: _of_kinds(system))


def _of_kinds(system: System) -> Sizing:
    kind, like, nominal = _kinds(system), alike(system), system.named
    rows = lib.Balance(unknowns=like.size, kinds=1 + int(like.max(initial=0)), kind=lib.pointer(like))
    core = lib.Sizing(balance=c.addressof(rows), nominal=lib.pointer(nominal), kind=lib.pointer(kind))
    return Sizing(core, (rows, kind, like, nominal))
