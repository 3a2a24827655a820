"""The manifest and the binding as typed frozen values.

Receives the manifest's "structure" and the binding as core/system/model.h lays them down (plain mappings and arrays);
hands on a `Description`: unknown families, row families, blocks with their kernels, p, ix, initial values.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import field, replace
from typing import Any
from weakref import WeakValueDictionary

import numpy as np
from numpy.typing import NDArray
from sysdyn.runtime.model.failures import ContractError, RowLabel
from sysdyn.runtime.model.switches import Switches
from sysdyn.values import dataclass

Floats = NDArray[np.float64]
Ints = NDArray[np.int32]
Places = NDArray[np.integer[Any]]
Shape = tuple[tuple[int, int], ...]
Index = tuple[int, ...]
"""(loop, slot, constant): the value is (loop variable or 0) + (ix[slot] or 0) + constant; loop, slot -1: none.
(loop, slot, constant, table): it is ix[ix[table] + that].
"""

KINDS = ("q", "f", "p", "s", "e", "kappa", "mu", "start", "slack", "unsaid", "audit")
START = ("start", "slack", "unsaid")
"""Kinds of the start alone: positions; what guesses miss, of the text and of zero where the text says nothing."""
BESIDE = (*START, "audit")
"""Kinds behind the unknowns as written."""
BASE = {
    "dynamics_rate": "dynamics",
    "phi_reaction": "dynamics",
    "psi_reaction": "dynamics",
    "momentum_rate": "momentum",
    "phi_rate": "phi",
    "phi_acceleration": "phi",
    "psi_rate": "psi",
    "gamma_rate": "gamma",
    "gamma_acceleration": "gamma",
    "observe_rate": "observe",
    "observe_scale": "observe",
}
"""The block whose row families another block shares."""
SCALE = "_scale"
"""Behind the name of a block: the sums of the magnitudes of its terms, for the row families of steep laws."""


def count(shape: Shape) -> int:
    """Elements of a family of that shape; scalars have one."""
    size = 1
    # no shape: a scalar
    for first, last in shape:
        size *= max(last - first + 1, 0)
    return size


def element(name: str, shape: Shape, position: int) -> str:
    """The name of the element at a row-major position: x, x[3], x[2, 5]."""
    # scalars have no index
    if not shape:
        return name
    index = []
    # from the last index: row-major
    for first, last in reversed(shape):
        position, rest = divmod(position, last - first + 1)
        index.append(str(first + rest))
    return f"{name}[{', '.join(reversed(index))}]"


def position_of(shape: Shape, at: Iterable[float]) -> int:
    """The row-major position of the element with these indices, which `element` names."""
    position = 0
    for index, (first, last) in zip(at, shape, strict=True):
        position = position * (last - first + 1) + round(index) - first
    return position


Elements = Sequence[tuple[str, str, int]]
"""Name, file and line of each element, from index 0 on, of a family whose elements the author wrote one by one."""


def name_of(name: str, shape: Shape, elements: Elements, position: int) -> tuple[str, str, int]:
    """What the element of a family is called, and where it stands ("", 0: where the family does)."""
    if not elements:
        return element(name, shape, position), "", 0
    # elements with names of their own: `v1#.multiplier`
    own, file, line = elements[shape[0][0] + position]
    _, _, tail = name.partition("#")  # v1#.multiplier, C1#.2'
    return own + re.sub(r"^\.\d+", "", tail), file, line


class _Elements:
    """What has a name and a shape, and perhaps names of its elements."""

    __slots__ = ()
    name: str
    shape: Shape
    elements: Elements

    @property
    def size(self) -> int:
        """Number of elements."""
        return count(self.shape)

    def name_of(self, position: int, name: str = "") -> str:
        """What an element is called; name: instead of the family's own."""
        return name_of(name or self.name, self.shape, self.elements, position)[0]


@dataclass(frozen=True, slots=True)
class Family(_Elements):
    """Unknowns of one name.  owner: coordinate (q f p) or constraint label (kappa mu)."""

    name: str
    kind: str
    owner: str
    unit: str
    nominal: float | None
    shape: Shape
    elements: Elements = ()

    def name_of(self, position: int, name: str = "") -> str:
        """What an element is called, as the text writes it: the index behind its owner: `x[2]'`."""
        name = name or self.name
        # a name that is not its owner's with something behind it
        if self.elements or not name.startswith(self.owner):
            return name_of(name, self.shape, self.elements, position)[0]
        return element(self.owner, self.shape, position) + name[len(self.owner) :]


@dataclass(frozen=True, slots=True)
class RowFamily(_Elements):
    """Rows of one label.  name, stored, rate: of rows of block observe; content: of block initial."""

    block: str
    label: str
    owner: str
    kind: str
    file: str
    line: int
    unit: str
    shape: Shape
    name: str
    stored: bool
    rate: bool
    content: bool
    elements: Elements = ()

    def label_at(self, position: int) -> RowLabel:
        """The label of one row."""
        name, file, line = name_of(self.label, self.shape, self.elements, position)
        return RowLabel(name, self.kind, file or self.file, line or self.line, unit=self.unit)


@dataclass(frozen=True, slots=True)
class Reference:
    """A place in a family by its indices."""

    family: int
    indices: tuple[Index, ...]


@dataclass(frozen=True, slots=True)
class Kernel:
    """One loop nest of a block: (first, last) of each loop as indices, the entries it writes an iteration; reads,
    rates: families of unknowns and of their derivatives that it reads, curved: row families to which it adds more than
    constants and constants times unknowns, bent: those to which it adds what has slopes that change (None: not known);
    rows: what a loop adds to, of a kernel without loops none.
    """

    loops: tuple[tuple[Index, Index], ...]
    dy: tuple[tuple[Reference, Reference], ...]
    dyd: tuple[tuple[Reference, Reference], ...]
    reads: frozenset[int] | None = None
    rates: frozenset[int] | None = None
    curved: frozenset[int] | None = None
    bent: frozenset[int] | None = None
    rows: tuple[Reference, ...] = ()

    @property
    def steady(self) -> bool:
        """Its slopes never change."""
        return self.bent is not None and not self.bent


@dataclass(frozen=True, slots=True)
class Initial:
    """Initial values of elements of one family: positions [k], values [k] (SI), fixed or guessed."""

    family: int
    positions: Ints
    values: Floats
    fixed: bool
    label: RowLabel


def statements(
    at: Ints, size: int, initial: tuple[Initial, ...]
) -> tuple[Floats, NDArray[np.bool_], NDArray[np.bool_]]:
    """What a text says of unknowns at the start [size]: the values, 0 where it says nothing; which are fixed, and which
    are written.  Of an unknown that is said twice a fixed value counts; at: places of families, negative where the form
    has no such unknown (a displacement that is traced alone).
    """
    values, fixed, written = np.zeros(size), np.zeros(size, dtype=bool), np.zeros(size, dtype=bool)
    # fixed values after guesses: of an unknown that is said twice they count
    for item in sorted((item for item in initial if at[item.family] >= 0), key=lambda item: item.fixed):
        own = at[item.family] + item.positions
        values[own], written[own] = item.values, True
        fixed[own] |= item.fixed
    return values, fixed, written


@dataclass(frozen=True, slots=True)
class Description:
    """A compiled model bound to parameter values. p [parameters] SI, the binding's own and read-only where no event
    writes there (`System.own_numbers`); ix [integers]; layouts: what follows from the structure of the index forms
    made so far, found once (System.once); branches: places in p of laws that may slide (events/kinks.py); holds: those
    that say whether set-valued relations hold; systems: those of runs one after the other that share p, by index form;
    alive: those that somebody has now, where runs do not share them; room: work of their Jacobians; constants: of
    integrated constraints, by their family of rows, where they begin in p and how many there are.
    """

    families: tuple[Family, ...]
    rows: tuple[RowFamily, ...]
    blocks: dict[str, tuple[Kernel, ...]]
    p: Floats
    ix: Ints
    initial: tuple[Initial, ...]
    switches: Switches
    branches: tuple[int, ...] = ()
    holds: tuple[int, ...] = ()
    systems: dict[Any, Any] | None = field(default=None, compare=False)
    layouts: dict[Any, Any] = field(default_factory=dict, compare=False)
    alive: WeakValueDictionary[Any, Any] = field(default_factory=WeakValueDictionary, compare=False)
    room: list[Floats] = field(default_factory=list, compare=False)
    constants: tuple[tuple[int, int, int], ...] = ()
    complementary: bool = False

    def put(self, p: Floats) -> None:
        """Takes these numbers; those of a binding, where nothing writes into them, it has."""
        if self.p.flags.writeable:
            self.p[:] = p

    def families_of(self, kind: str) -> tuple[int, ...]:
        """Numbers of the families of one kind."""
        return tuple(k for k, family in enumerate(self.families) if family.kind == kind)

    def rows_of(self, block: str) -> tuple[int, ...]:
        """Numbers of the row families of a block (those of its base where it shares them)."""
        base = BASE.get(block, block)
        return tuple(k for k, row in enumerate(self.rows) if row.block == base)


def _shape(value: Any) -> Shape:
    return tuple((int(first), int(last)) for first, last in value)


def _shapes(value: Any, names: Sequence[str]) -> list[Shape]:
    # by name or in the order of the families
    items = [value[name] for name in names] if isinstance(value, Mapping) else list(value)
    # a binding of another model
    if len(items) != len(names):
        raise ContractError(f"the binding has {len(items)} shapes for {len(names)} families")
    return [_shape(item) for item in items]


def _reference(value: Any) -> Reference:
    family, indices = value
    return Reference(int(family), tuple(tuple(map(int, index)) for index in indices))


def _pairs(value: Any) -> tuple[tuple[Reference, Reference], ...]:
    return tuple((_reference(row), _reference(column)) for row, column in value)


def _bound(value: Any, depth: int) -> Index:
    """A loop's bound: a slot of ix, or an index that may follow a loop outside of it."""
    # a slot alone
    if isinstance(value, int):
        return (-1, value, 0)
    loop, slot, constant = (int(part) for part in value)
    # inner bounds follow outer loops only
    if loop >= depth:
        raise ContractError(f"a bound of loop {depth} follows loop {loop}")
    return (loop, slot, constant)


def _kernel(value: Mapping[str, Any]) -> Kernel:
    # loops from the outside in
    loops = tuple((_bound(low, depth), _bound(high, depth)) for depth, (low, high) in enumerate(value.get("loops", ())))
    # None: not said, so everything may be read
    names = ("reads", "rates", "curved", "bent")
    reads, rates, curved, bent = (frozenset(value[name]) if name in value else None for name in names)
    rows = tuple(_reference(row) for row in value.get("rows", ())) if loops else ()
    return Kernel(loops, _pairs(value.get("dy", ())), _pairs(value.get("dyd", ())), reads, rates, curved, bent, rows)


def _row(value: Mapping[str, Any], shape: Shape) -> RowFamily:
    """A family of rows from the manifest, its size from the binding."""
    label = str(value.get("label") or value.get("name") or "")
    return RowFamily(
        block=str(value["block"]),
        label=label,
        owner=str(value.get("owner") or ""),
        kind=str(value.get("kind") or value["block"]),
        file=str(value.get("file") or ""),
        line=int(value.get("line") or 0),
        unit=str(value.get("unit") or "1"),
        shape=shape,
        name=str(value.get("name") or label),
        stored=bool(value.get("stored", True)),
        rate=bool(value.get("rate", False)),
        content=bool(value.get("content", False)),
        elements=value.get("elements", ()),
    )


def _family(value: Mapping[str, Any], shape: Shape) -> Family:
    """A family of unknowns from the manifest, its size from the binding."""
    # a kind that this runtime does not know
    if value["kind"] not in KINDS:
        raise ContractError(f"family {value['name']}: unknown kind {value['kind']!r}")
    nominal = value.get("nominal")
    return Family(
        name=str(value["name"]),
        kind=str(value["kind"]),
        owner=str(value.get("owner") or value["name"]),
        unit=str(value.get("unit") or "1"),
        nominal=None if not nominal else abs(float(nominal)),
        shape=shape,
        elements=value.get("elements", ()),
    )


def _initial(value: Mapping[str, Any], names: Mapping[str, int], families: Sequence[Family]) -> Initial:
    """Initial values of one statement from the binding."""
    # by name or number of the family
    family = value["family"]
    place = names[family] if isinstance(family, str) else int(family)
    return Initial(
        family=place,
        positions=np.atleast_1d(np.asarray(value["positions"], dtype=np.int32)),
        values=np.atleast_1d(np.asarray(value["values"], dtype=np.float64)),
        fixed=bool(value["fixed"]),
        label=RowLabel(
            str(value.get("label") or family),
            "init",
            str(value.get("file") or ""),
            int(value.get("line") or 0),
            unit=families[place].unit,
        ),
    )


def describe(manifest: Mapping[str, Any], binding: Mapping[str, Any]) -> Description:
    """Typed values of a manifest (whole, or its "structure") and a binding.

    Raises ContractError where they do not fit each other.
    """
    # a binding that stands alone hands on what the last one was made of
    before: Description | None = binding.get("layouts", {}).get("last") if binding.get("alone") else None
    if before is not None:
        return _again(before, binding)
    # the manifest may be whole
    structure = manifest.get("structure", manifest)
    families, rows = structure["families"], structure["rows"]
    shapes = _shapes(binding["shapes"], [str(item["name"]) for item in families])
    row_shapes = _shapes(binding["row_shapes"], [str(item.get("label")) for item in rows])
    names = {str(item["name"]): k for k, item in enumerate(families)}
    layouts = binding.get("layouts", {})  # of other bindings of the same sizes
    # once for all bindings of the same sizes
    if "described" not in layouts:
        layouts["described"] = (
            tuple(_family(item, shape) for item, shape in zip(families, shapes, strict=True)),
            tuple(_row(item, shape) for item, shape in zip(rows, row_shapes, strict=True)),
            {
                str(name): tuple(_kernel(kernel) for kernel in block["kernels"])
                for name, block in structure["blocks"].items()
            },
        )
    own_families, own_rows, blocks = layouts["described"]
    # what differs from binding to binding
    initial = tuple(_initial(item, names, own_families) for item in binding.get("initial", ()))
    found = Description(
        families=own_families,
        rows=own_rows,
        blocks=blocks,
        p=_numbers(binding),
        ix=np.ascontiguousarray(binding["ix"], dtype=np.int32),
        initial=initial,
        switches=Switches(tuple(_switch_place(item, families, shapes) for item in structure.get("switches", ()))),
        branches=tuple(int(place) for place in structure.get("branches", ())),
        holds=tuple(binding.get("holds", ())),
        systems={} if binding.get("alone") else None,
        layouts=layouts,
        constants=tuple((int(row), int(place), int(number)) for row, place, number in binding.get("offsets", ())),
        complementary=bool(structure.get("complementary")),
    )
    # remembered for the next binding of this model
    if binding.get("alone"):
        layouts["last"] = found
    return found


def _numbers(binding: Mapping[str, Any]) -> Floats:
    """The array p of a binding where it stands (of a large model the room counts), else a copy: events write there, and
    the next run.
    """
    p = np.asarray(binding["p"], dtype=np.float64)
    # events write into p, and the next run too: a copy
    if not binding.get("stand") or binding.get("alone"):
        return p.copy()
    # of a large model p is where it is, and must not be written to
    p = p[:]
    p.flags.writeable = False
    return p


def _again(before: Description, binding: Mapping[str, Any]) -> Description:
    """A description of the same structure with the numbers of a binding."""
    before.p[:] = binding["p"]
    own, given = before.initial, binding.get("initial", ())
    # other places than before: statements anew
    if any(old.positions is not new["positions"] for old, new in zip(own, given, strict=True)):
        names = {family.name: k for k, family in enumerate(before.families)}
        return replace(before, initial=tuple(_initial(item, names, before.families) for item in given))
    # the same places: values alone
    values = (np.atleast_1d(np.asarray(item["values"], dtype=np.float64)) for item in given)
    found = (Initial(i.family, i.positions, v, i.fixed, i.label) for i, v in zip(own, values, strict=True))
    return replace(before, initial=tuple(found))


def _switch_place(
    item: Mapping[str, Any], families: Sequence[Mapping[str, Any]], shapes: list[Shape]
) -> tuple[int, int]:
    """Family and position of the multiplier of a constraint that holds at times."""
    family = next(k for k, f in enumerate(families) if f["kind"] in ("kappa", "mu") and f["owner"] == item["owner"])
    return family, position_of(shapes[family], item["at"])
