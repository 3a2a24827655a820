"""Binding: the numbers of one set of parameter values: p, ix, shapes, initial values (runtime/core/system/model.h).

Parameters are evaluated in the order of their dependencies, over whole index ranges at once.  Overriding one never
touches the compiled text.  Received: a network, its program and descriptor form, and overrides by name or
(name, index, ...).  Returned: a Binding; ModelError where the values make no sense.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import field
from typing import Any

import numpy as np
from numpy.typing import NDArray
from sysdyn.compiler.binding.ranges import Ranges
from sysdyn.compiler.forms.coverage import bind_covers
from sysdyn.compiler.forms.descriptor import DescriptorForm
from sysdyn.compiler.model.energies import EnergyModel
from sysdyn.compiler.model.integers import Slot
from sysdyn.compiler.model.interpret import Value, evaluate, over
from sysdyn.compiler.model.parameters import LARGEST, Extents, Override, Parameters, extents, positions, whole_number
from sysdyn.compiler.model.tables import numbers
from sysdyn.compiler.model.terms import Nest
from sysdyn.compiler.network.primal.slopes import check_slopes
from sysdyn.compiler.program.program import Program
from sysdyn.dsl.model.expression import Node
from sysdyn.dsl.model.network import Network
from sysdyn.dsl.text.diagnostics import Diagnostic, ModelError, Place
from sysdyn.values import dataclass

Overrides = Mapping[Override, Any]

OUTSIDE = {"extend": 0, "clamp": 1, "stop": 2}
"""What a table of two arguments does outside its data, as the text's helper reads it."""
SCALAR = ("observe", "audit")  # blocks whose row families are scalars, whatever else has their names


@dataclass(frozen=True, slots=True)
class Start:
    """Initial values of one statement: positions in a family of unknowns, fixed or guessed; one value for all of them
    is held once.
    """

    family: int
    positions: NDArray[np.int32]
    values: NDArray[np.float64]
    fixed: bool
    label: str
    file: str
    line: int
    place: Place

    def to_json(self) -> dict[str, Any]:
        """The dictionary of the contract's `initial` list."""
        names = ("family", "positions", "values", "fixed", "label", "file", "line")
        return {name: getattr(self, name) for name in names}

    def with_values(self, values: NDArray[np.float64]) -> Start:
        """The statement with other values."""
        return Start(self.family, self.positions, values, self.fixed, self.label, self.file, self.line, self.place)


@dataclass(frozen=True, slots=True)
class Binding:
    """Plain arrays for the runtime; `values` by parameter name (arrays over their shape)."""

    p: NDArray[np.float64]
    ix: NDArray[np.int32]
    shapes: tuple[Extents, ...]
    row_shapes: tuple[Extents, ...]
    initial: tuple[Start, ...]
    offsets: tuple[tuple[int, int, int], ...]  # row family, position in p, number: constants of integrated psi
    values: dict[str, Any]
    parameters: Parameters = field(repr=False)

    def evaluate(self, node: Node) -> float:
        """The value of an expression of parameters."""
        if node.op == "const":
            return float(node.data)
        return float(evaluate([node], self.parameters.lookup)[0])


def bind(
    network: Network,
    model: EnergyModel,
    form: DescriptorForm,
    program: Program,
    overrides: Overrides | None = None,
) -> Binding:
    """All numbers for one set of parameter values."""
    parameters = Parameters(network, overrides or {})
    # what the form was built on holds for these numbers
    check_slopes(network, parameters)
    owners = _owners(form, parameters)
    _refuse_outside(model, owners, parameters, network.place)
    bind_covers(form.covers, owners, parameters)
    # initial values before constants: these follow from them
    starts = _starts(form, owners, parameters)
    offsets = offsets_of(form, owners, starts, parameters)
    p, where = _layout(program, network, parameters, offsets)
    # the values of parameters become views of p
    for name in (q.name for q in network.parameters if q.shape):  # what a large model has is held once
        values, at = parameters.values[name], where[name]
        parameters.values[name] = p[at : at + values.size].reshape(values.shape)
    ix = integers(program.slots, owners, parameters, where, network)
    # integrated constraints: row, place and number of their constants
    rows = {(r.owner, r.block): k for k, r in enumerate(form.rows)}
    constants = tuple((rows[o.label, "phi"], where[o.name], offsets[o.name].size) for o in form.offsets)
    return Binding(
        p,
        ix,
        tuple(() if f.kind == "audit" else owners[f.owner] for f in form.families),
        tuple(() if r.block in SCALAR else owners[r.owner] for r in form.rows),
        starts,
        constants,
        dict(parameters.values),
        parameters,
    )


def _refuse_outside(model: EnergyModel, owners: dict[str, Extents], parameters: Parameters, place: Place) -> None:
    """ModelError E805 where an index lies outside its family, or there are more unknowns than the contract counts."""
    found = tuple(Ranges(owners, parameters).check(model))
    if found:
        raise ModelError(found)
    total = sum(math.prod(extents(box)) for box in owners.values())
    if total > LARGEST:
        raise ModelError([Diagnostic("E805", f"{total} elements are more than {LARGEST}", place)])


def _owners(form: DescriptorForm, parameters: Parameters) -> dict[str, Extents]:
    """First and last of every index by owner: declared shapes, and hulls of constraint labels."""
    owners = {name: parameters.extents(shape) for name, shape in form.shapes}
    for name, places in form.hulls:
        owners[name] = _hull(name, places, parameters)
    return owners


def _hull(name: str, places: tuple[tuple[tuple[Node, ...], Nest, Place], ...], parameters: Parameters) -> Extents:
    """The box around all rows of a label; a hole or a second row of one index is E805."""
    # a label without indices: one row, `constraint c: ...`
    if not places[0][0]:
        if len(places) > 1:
            raise ModelError([Diagnostic("E805", f"constraint {name} is given twice", places[-1][2])])
        return ()
    # the rows of every loop as places, one array an index
    found = [np.stack([np.rint(a) for a in over(nest, at, parameters.lookup)]) for at, nest, _ in places]
    everything = np.concatenate(found, axis=1).astype(np.int64)
    # all loops are empty: `for i in 1..0`
    if everything.shape[1] == 0:
        return tuple((1, 0) for _ in places[0][0])
    box = tuple((int(row.min()), int(row.max())) for row in everything)
    counts = np.bincount(positions(box, list(everything)), minlength=int(np.prod([b - a + 1 for a, b in box])))
    # each place of the box exactly once: 0 is a hole, 2 a second row
    wrong = int(np.argmax(counts != 1)) if np.any(counts != 1) else -1
    if wrong >= 0:
        at = np.unravel_index(wrong, [b - a + 1 for a, b in box])
        text = ", ".join(str(int(k) + first) for k, (first, _) in zip(at, box, strict=True))
        what = "is missing" if counts[wrong] == 0 else "is given twice"
        raise ModelError([Diagnostic("E805", f"constraint {name}[{text}] {what}", places[-1][2])])
    return box


def _starts(form: DescriptorForm, owners: dict[str, Extents], parameters: Parameters) -> tuple[Start, ...]:
    """Initial values of unknowns, statement by statement."""
    found = []
    for pin in form.pins:
        family = form.families[pin.family]
        *at, values = over(pin.nest, (*pin.at, pin.value), parameters.lookup_at_place(pin.place))
        box = owners[family.owner]
        where = _positions(family.owner, box, at, pin.place) if box else np.zeros(len(values), dtype=np.int32)
        parameters.finite(values, pin.place, f"the initial value of {family.name}")
        if values.size and (values == values[0]).all():
            values = np.broadcast_to(values[:1].copy(), values.shape)
        line = pin.place.start[0]
        found.append(Start(pin.family, where, values, pin.fixed, family.name, pin.place.file, line, pin.place))
    return tuple(found)


def _positions(name: str, box: Extents, at: list[NDArray[np.float64]], place: Place) -> NDArray[np.int32]:
    """Positions in a family; an index outside its shape is E805."""
    for values, (first, last) in zip(at, box, strict=True):
        outside = (values < first) | (values > last)
        if np.any(outside):
            k = values[np.argmax(outside)]
            raise ModelError([Diagnostic("E805", f"{name}: index {k:g} outside {first}..{last}", place)])
    return positions(box, [np.rint(values).astype(np.int64) for values in at]).astype(np.int32)


def offsets_of(
    form: DescriptorForm, owners: dict[str, Extents], starts: tuple[Start, ...], parameters: Parameters
) -> dict[str, NDArray[np.float64]]:
    """Constants of integrated constraints: B q0 at the initial displacements (0 where none is written)."""
    held: dict[tuple[str, str], NDArray[np.float64]] = {}
    # initial displacements and momenta, as arrays over their families
    for k, family in enumerate(form.families):
        if family.kind in ("q", "p"):
            held[family.owner, family.kind] = np.zeros(extents(owners[family.owner]))
            for start in starts:
                if start.family == k:
                    held[family.owner, family.kind].flat[start.positions] = start.values
    found: dict[str, NDArray[np.float64]] = {}

    # the expressions of constants read these arrays
    def lookup(node: Node, args: list[Value]) -> Value:
        if node.op == "time":
            return parameters.start
        if node.op == "var":
            box = owners[node.data[0]]
            whole = [np.rint(a).astype(np.int64) for a in args]
            return held[node.data[:2]].flat[positions(box, whole) if box else 0]
        return parameters.lookup(node, args)

    # a sum over the terms of each constraint, each over its loops
    for offset in form.offsets:
        box = owners[offset.label]
        total = found.setdefault(offset.name, np.zeros(int(np.prod(extents(box)))))
        for term in offset.terms:
            *at, values = over(term.loops, (*offset.at, term.expression), lookup)
            where = positions(box, [np.rint(a).astype(np.int64) for a in at]) if box else np.zeros(len(values), int)
            np.add.at(total, where, values)
    return found


def _layout(
    program: Program, network: Network, parameters: Parameters, offsets: dict[str, NDArray[np.float64]]
) -> tuple[NDArray[np.float64], dict[str, int]]:
    """p: scalar parameters, arrays, constants of integrated rows, tables; and where each of the latter begins."""
    scalars = [float(parameters.values[name]) for name in program.scalars]
    parts = [np.asarray(scalars, dtype=float)]
    where: dict[str, int] = {}
    size = len(scalars)
    arrays = {q.name: np.ravel(parameters.values[q.name]) for q in network.parameters if q.shape}
    tables = {f"table {t.name}": numbers(t) for t in network.tables if t.name in program.tables}
    for name, held in (*arrays.items(), *offsets.items(), *tables.items()):
        where[name] = size
        parts.append(held)
        size += len(held)
    return np.concatenate(parts), where


def places_of(
    network: Network, form: DescriptorForm, program: Program, binding: Binding
) -> tuple[dict[str, Extents], dict[str, int]]:
    """Ranges of the indices by owner; where arrays, constants of integrated rows and tables begin in p."""
    owners = _owners(form, binding.parameters)
    offsets = offsets_of(form, owners, binding.initial, binding.parameters)
    return owners, _layout(program, network, binding.parameters, offsets)[1]


def integers(
    slots: Sequence[Slot],
    owners: dict[str, Extents],
    parameters: Parameters,
    where: dict[str, int],
    network: Network,
) -> NDArray[np.int32]:
    """Ix: the values of all slots, and behind them the tables of indices."""
    found: list[int] = []
    tables: list[NDArray[np.float64]] = []
    behind = len(slots)
    for slot in slots:
        if slot[0] == "picks":
            tables.append(np.ravel(parameters.values[slot[1]]))
            found.append(behind)
            behind += tables[-1].size
        else:
            found.append(_integer(slot, owners, parameters, where, network))
    return np.concatenate([np.asarray(found, dtype=np.int32), *(np.rint(t).astype(np.int32) for t in tables)])


def _integer(
    slot: Slot, owners: dict[str, Extents], parameters: Parameters, where: dict[str, int], network: Network
) -> int:
    """The value of a slot (compiler/model/integers.py), of tables of indices excepted."""
    kind, name = slot[0], slot[1]
    if kind == "value":
        return whole_number(parameters, name)
    # where a family's array is by itself
    if kind in ("origin", "stride"):
        return _origin(owners[name]) if kind == "origin" else _strides(owners[name])[slot[2]]
    # the same within the vector of all, a parameter's or a family's
    if kind in ("array", "step"):
        box = parameters.boxes[name] if name in parameters.boxes else owners[_label(name)]
        return where[name] + _origin(box) if kind == "array" else _strides(box)[slot[2]]
    table = next(t for t in network.tables if t.name == name)
    if kind == "table":
        return where[f"table {name}"]
    return len(table.points[slot[2]]) if kind == "points" else OUTSIDE[table.outside]


def _label(offset: str) -> str:
    return offset.removeprefix("#offset ")


def _strides(box: Extents) -> list[int]:
    sizes = extents(box)
    return [int(np.prod(sizes[k + 1 :], dtype=np.int64)) for k in range(len(sizes))]


def _origin(box: Extents) -> int:
    return -sum(first * stride for (first, _), stride in zip(box, _strides(box), strict=True))
