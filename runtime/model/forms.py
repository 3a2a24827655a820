"""The index forms: which blocks stand where.

A form is a list of calls with their tables `at` (where unknown families begin) and `to` (where row families
begin); nothing else distinguishes the forms (q' = f are rows of the runtime's own):
  3     as written (2, 1 or 0 where the model's index is that): phi and psi
  2     stabilised (Gear, Gupta, Leimkuhler 1985): q' - f + Phi_q^T nu = 0, phi and phi_rate, multipliers nu; the row of
        each q is weighted (metric.py)
  2v    phi_rate in the place of phi
  1     phi_acceleration in the place of phi, psi_rate of psi
  0     as 1, momentum_rate in the place of momentum: linear in the slopes, what the underlying equation is made of
  0/3,5 the same with the constraints of the row families 3 and 5 not differentiated (structure/levels.py)
  constraints   what holds between displacements, flows and momenta alone (no rows q' - f)
  settled   all rows that hold at a consistent point: as written and hidden (no rows q' - f)
  valued    of these what no row derives by the rate of a flow: enough where values are shown and no rates
  rated     settled and dynamics_rate: what has no inertia follows from the rate of its balance
  start     the same and the block `initial`; unknowns of the start alone
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from sysdyn.runtime.model.description import BASE, BESIDE, SCALE, START, Description, Ints, RowFamily
from sysdyn.runtime.model.failures import ContractError, RowLabel
from sysdyn.values import dataclass

FEW = 10_000
"""Rows q' - f up to which their places are held as they are."""
NOWHERE = -(2**30)
"""A table's entry for a family that this call must not touch: any place made of it is out of range."""

_HEAD = (("dynamics", "dynamics"), ("phi_reaction", "dynamics"), ("psi_reaction", "dynamics"))
_TAIL = (("gamma", "gamma"), ("lambda", "lambda"))
FORMS: dict[str, tuple[tuple[str, str], ...]] = {
    "3": (*_HEAD, ("momentum", "momentum"), ("phi", "phi"), ("psi", "psi"), *_TAIL),
    "2": (
        *_HEAD,
        ("phi_reaction", "kinematics"),
        ("phi_normal", "kinematics"),
        ("momentum", "momentum"),
        ("phi", "phi"),
        ("phi_rate", "phi_rate"),
        ("psi", "psi"),
        *_TAIL,
    ),
    "2v": (*_HEAD, ("momentum", "momentum"), ("phi_rate", "phi_rate"), ("psi", "psi"), *_TAIL),
    "1": (
        *_HEAD,
        ("momentum", "momentum"),
        ("phi_acceleration", "phi_acceleration"),
        ("psi_rate", "psi_rate"),
        *_TAIL,
    ),
    "0": (
        *_HEAD,
        ("momentum_rate", "momentum_rate"),
        ("phi_acceleration", "phi_acceleration"),
        ("psi_rate", "psi_rate"),
        *_TAIL,
    ),
    "constraints": (("momentum", "momentum"), ("phi", "phi"), ("phi_rate", "phi_rate"), ("psi", "psi")),
    "settled": (
        *_HEAD,
        ("momentum", "momentum"),
        ("momentum_rate", "momentum_rate"),
        ("phi", "phi"),
        ("phi_rate", "phi_rate"),
        ("phi_acceleration", "phi_acceleration"),
        ("psi", "psi"),
        ("psi_rate", "psi_rate"),
        ("gamma", "gamma"),
        ("gamma_rate", "gamma_rate"),
        ("gamma_acceleration", "gamma_acceleration"),
        ("lambda", "lambda"),
    ),
}
FORMS["valued"] = tuple(
    call
    for call in FORMS["settled"]
    if call[1] not in ("momentum_rate", "phi_acceleration", "psi_rate", "gamma_rate", "gamma_acceleration")
)
FORMS["rated"] = (*FORMS["settled"], ("dynamics_rate", "dynamics_rate"))
FORMS["start"] = (*FORMS["rated"], ("initial", "initial"))
"""form -> (block, group of rows it is added to); blocks a model lacks are skipped."""
UNDERIVED = {"phi_acceleration": "phi_rate", "psi_rate": "psi"}
"""Block of form 0 -> what stands in its place where it is not differentiated."""
BARE = ("constraints", "settled", "valued", "rated", "start")
"""Forms without rows q' - f."""


@dataclass(frozen=True, slots=True)
class Planned:
    """One call: block, at [unknown families], to [row families]."""

    block: str
    at: Ints
    to: Ints


@dataclass(frozen=True, slots=True)
class Form:
    """A choice of calls with the layout of y and of the rows.

    written: unknowns as written (nu, and those of the start alone, stand behind them); at: places of the families,
    audit families behind all (`extended`); kind: (kind, number) of unknowns one after the other; kinematics: number of
    the rows q' - f, the first ones; k_span: their stretches; k_few: k_q and k_f where they are few;
    groups: (name of the group, row family, first row), ascending; scales: calls of the scale blocks of steep rows.
    """

    name: str
    written: int
    unknowns: int
    extended: int
    rows: int
    at: Ints
    calls: tuple[Planned, ...]
    kind: tuple[tuple[str, int], ...]
    kinematics: int
    k_span: Ints
    k_few: tuple[Ints, Ints] | None
    groups: tuple[tuple[str, int, int], ...]
    scales: tuple[Planned, ...]

    @property
    def k_row(self) -> Ints:
        """The rows q' - f."""
        return np.arange(self.kinematics, dtype=np.int32)

    @property
    def k_q(self) -> Ints:
        """Place of q in each of them."""
        return self._along(0)

    @property
    def k_f(self) -> Ints:
        """Place of its f."""
        return self._along(1)

    def _along(self, part: int) -> Ints:
        # of a small model the arrays stand
        if self.k_few is not None:
            return self.k_few[part]
        # of a large one stretches: first row, number, first place
        number, first, begin = self.k_span[:, 0], self.k_span[:, 1], self.k_span[:, 2 + part]
        found = np.repeat(begin - first, number)
        found += np.arange(found.size, dtype=np.int32)
        return found

    @property
    def base(self) -> str:
        """The name without the constraints that are not differentiated."""
        return self.name.partition("/")[0]

    def row_label(self, description: Description, row: int) -> RowLabel:
        """The author's label of a row."""
        # q' = f of a coordinate
        if row < self.kinematics:
            place = int(self.k_q[row])
            return RowLabel(f"{unknown_name(description, self, place)}' = f", "kinematic")
        # else the last group that begins at or before it
        for group, family, first in reversed(self.groups):
            if row >= first:
                label = description.rows[family].label_at(row - first)
                return replace(label, kind=group) if group in BASE else label
        raise ContractError(f"row {row} belongs to no family")


def unknown_name(description: Description, form: Form, place: int) -> str:
    """Name of the unknown at a place of y."""
    known = place < form.written or form.name == "start"
    # as written: by its family
    for k in reversed(np.flatnonzero(form.at <= place).tolist() if known else []):
        family = description.families[k]
        if family.kind != "audit" and place < form.at[k] + family.size:
            return family.name_of(place - int(form.at[k]))
    # nu behind the multipliers as written, in the order of the kappa
    place -= form.written
    for k in description.families_of("kappa"):
        family = description.families[k]
        if place < family.size:
            return family.name_of(place, nu_name(family.name))
        place -= family.size
    raise ContractError(f"there is no unknown {place} behind the multipliers nu")


def nu_name(kappa: str) -> str:
    """The name of the multiplier nu beside a kappa: rod.nu beside rod.multiplier."""
    return f"{kappa.removesuffix('.multiplier')}.nu"


def _layout(description: Description, others: tuple[str, ...]) -> tuple[Ints, list[tuple[str, int]], int, int]:
    """At (these kinds behind those as written, others of BESIDE nowhere), kinds and numbers of unknowns as written,
    their number, that of all.
    """
    at = np.full(len(description.families), NOWHERE, dtype=np.int32)
    kinds: list[tuple[str, int]] = []
    end = 0
    # kinds that stand beside the unknowns have no place as written
    for k, family in enumerate(description.families):
        if family.kind not in BESIDE:
            at[k] = end
            kinds.append((family.kind, family.size))
            end += family.size
    written = end
    # kinds of this form alone stand behind
    for kind in others:
        for k in description.families_of(kind):
            at[k] = end
            end += description.families[k].size
    return at, kinds, written, end


def _kinematics(description: Description, at: Ints) -> tuple[Ints, Ints, dict[str, int]]:
    """Places of q and of its f for every row q' - f; first row of each coordinate."""
    flows = {description.families[k].owner: k for k in description.families_of("f")}
    places_q, places_f, first = [], [], {}
    number = 0
    for k in description.families_of("q"):
        family = description.families[k]
        # a model that is not closed
        if family.owner not in flows:
            raise ContractError(f"coordinate {family.owner} has a displacement and no flow")
        flow = flows[family.owner]
        # shapes of both must agree
        if description.families[flow].size != family.size:
            raise ContractError(f"coordinate {family.owner}: displacement and flow differ in size")
        first[family.owner] = number
        number += family.size
        places_q.append(np.arange(family.size) + at[k])
        places_f.append(np.arange(family.size) + at[flow])
    if not places_q:
        return np.zeros(0, np.int32), np.zeros(0, np.int32), first
    return np.concatenate(places_q).astype(np.int32), np.concatenate(places_f).astype(np.int32), first


def _stabilised_places(rows: tuple[RowFamily, ...], home: str, first: dict[str, int]) -> Ints:
    """`to` of a block that adds to the rows q' - f of the coordinates that its rows are of."""
    places = [first.get(row.owner, NOWHERE) if row.block == home else NOWHERE for row in rows]
    return np.array(places, dtype=np.int32)


def _level_calls(
    calls: list[Planned], level: set[int], rows: tuple[RowFamily, ...], number: int
) -> tuple[list[Planned], int]:
    """The calls with constraints of these families as they are in the rows of their derivatives, and how many rows:
    a block gives all its families, and those that are not wanted stand in rows behind the others, which nothing reads.
    """
    found: list[Planned] = []
    for call in calls:
        mine = [k for k in range(call.to.size) if call.to[k] >= 0]
        # blocks without derived constraints stay
        if call.block not in UNDERIVED or not level & set(mine):
            found.append(call)
            continue
        # the underived block and the derived one, each with its own rows
        for block, kept in ((call.block, False), (UNDERIVED[call.block], True)):
            to = call.to.copy()
            for k in mine:
                # wanted here, or out of the way behind all others
                if (k in level) != kept:
                    to[k] = number
                    number += rows[k].size
            found.append(Planned(block, call.at, to))
    return found, number


def stretches(row: Ints, q: Ints, f: Ints) -> Ints:
    """Rows q' - f as stretches of which all three ascend by one: number, first row, q and f [stretches, 4]."""
    parts = np.stack([row, q, f])
    begin = np.flatnonzero(np.concatenate([[True], (np.diff(parts) != 1).any(axis=0)])[: row.size])
    number = np.diff(np.concatenate([begin, [row.size]]))
    return np.ascontiguousarray(np.stack([number, *parts[:, begin]], axis=1), dtype=np.int32)


def _stretches(q: Ints, f: Ints) -> Ints:
    return stretches(np.arange(q.size, dtype=np.int32), q, f)


def plan(description: Description, name: str) -> Form:
    """The calls and tables of one index form."""
    own = START if name == "start" else ()
    # places of unknowns as written; audits behind
    at, kind, written, extended = _layout(description, (*own, "audit"))
    unknowns = written
    if "kinematics" not in description.layouts:  # the same in every form
        made = _kinematics(description, at)
        few = made[:2] if made[0].size <= FEW else None  # of a large model the room counts
        description.layouts["kinematics"] = int(made[0].size), _stretches(*made[:2]), few, made[2]
    kinematics, k_span, k_few, first = description.layouts["kinematics"]
    # forms without rows q' - f
    bare = name in BARE
    if bare:
        nothing = np.zeros(0, dtype=np.int32)
        kinematics, k_span, k_few = 0, k_span[:0], (nothing, nothing)
    number = kinematics
    # rows of each group of blocks, one behind the other; a block adds to those of its group
    nu = at.copy()
    tables: dict[str, Ints] = {}
    groups: list[tuple[str, int, int]] = []
    calls: list[Planned] = []
    scales: list[Planned] = []
    # phi' beside phi, with multipliers nu
    stabilised = name == "2" and "phi" in description.blocks
    normal = "phi_normal" if "phi_normal" in description.blocks else "phi_reaction"
    # "2/3,5": families whose constraints stay underived
    base, _, kept = name.partition("/")
    level = {int(k) for k in kept.split(",")} if kept else set[int]()
    for block, group in FORMS[base]:
        # a block that this model, or this form, has not
        if block not in description.blocks or (group in ("kinematics", "phi_rate") and name == "2" and not stabilised):
            continue
        # nu act through one block alone
        if group == "kinematics" and block != normal:
            continue
        # the first block of a group lays out its rows
        if group != "kinematics" and group not in tables:
            tables[group] = np.full(len(description.rows), NOWHERE, dtype=np.int32)
            for k in description.rows_of(group):
                tables[group][k] = number
                groups.append((group, k, number))
                number += description.rows[k].size
        if group == "kinematics":  # multipliers nu of the stabilised form, in the rows q' = f
            for k in description.families_of("kappa"):
                nu[k] = unknowns
                kind.append(("nu", description.families[k].size))
                unknowns += description.families[k].size
            calls.append(Planned(block, nu, _stabilised_places(description.rows, BASE.get(block, block), first)))
        else:
            calls.append(Planned(block, at, tables[group]))
            # a steep law has a block of magnitudes
            if block + SCALE in description.blocks:
                scales.append(Planned(block + SCALE, at, tables[group]))
    # unknowns of a start behind those of the form
    for one in own:
        size = sum(description.families[k].size for k in description.families_of(one))
        kind.append((one, size))
        unknowns += size
    calls, number = _level_calls(calls, level, description.rows, number)
    return Form(
        name=name,
        written=written,
        unknowns=unknowns,
        extended=max(extended, unknowns),
        rows=number,
        at=at,
        calls=tuple(calls),
        kind=tuple(kind),
        kinematics=kinematics,
        k_span=k_span,
        k_few=k_few,
        groups=tuple(groups),
        scales=tuple(scales),
    )
