"""Bindings of many runs at once: scalar parameters as columns over the runs, evaluated together.

What varies must be numbers alone: scalars that no array, shape, whole number or index follows from.  Received: a
binding of the text's own values and columns of overrides; returned: `ParameterColumns`, or None where a run needs its
own.  The numbers are those that `bind` gives each run, bit for bit (a caller that doubts it compares single runs).
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray
from sysdyn.compiler.binding.binding import Binding, Start, _owners, _refuse_outside, integers, places_of
from sysdyn.compiler.forms.coverage import bind_covers
from sysdyn.compiler.forms.descriptor import DescriptorForm
from sysdyn.compiler.model.energies import EnergyModel
from sysdyn.compiler.model.interpret import Value, evaluate
from sysdyn.compiler.model.parameters import Parameters
from sysdyn.compiler.program.program import Program
from sysdyn.dsl.model.expression import Node, reads, topological
from sysdyn.dsl.model.network import Network
from sysdyn.values import dataclass

Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class ParameterColumns:
    """p [runs, parameters]; starts: (statement of the binding, values [runs]) of those that vary; good [runs]: the
    values make sense, as far as it was looked at here.
    """

    p: Floats
    starts: tuple[tuple[Start, Floats], ...]
    good: NDArray[np.bool_]


class Read(Parameters):
    """Parameters as bound that note which of them are read."""

    def __init__(self, parameters: Parameters) -> None:
        self.__dict__.update(parameters.__dict__)
        self.read: set[str] = set()

    def lookup(self, node: Node, args: list[Value]) -> Value:
        """As of the parameters themselves."""
        if node.op == "param":
            self.read.add(node.data)
        return super().lookup(node, args)


def value_of(binding: Binding, name: str) -> Any:
    """The value of a parameter, or of a number that the compiler itself asks for."""
    own = binding.parameters
    return own.hidden[name] if name in own.hidden else own.values[name]


class Varied(Parameters):
    """Parameters of which some are other numbers, or columns over runs."""

    def __init__(self, parameters: Parameters, columns: Mapping[str, Any]) -> None:
        self.__dict__.update(parameters.__dict__)
        self.values = {**parameters.values, **columns}


def following(network: Network, varied: set[str]) -> list[str]:
    """Parameters that follow from others by their formulas, those before which they need first; `varied` left out."""
    found: list[str] = []
    known = set(varied)
    changed = True
    while changed:
        changed = False
        for p in network.parameters:
            uses = {n.data for n in topological(list(p.values)) if n.op == "param"}
            if p.name not in known and uses & known:
                known.add(p.name)
                found.append(p.name)
                changed = True
    return _dependency_order(network, found)


def _dependency_order(network: Network, names: list[str]) -> list[str]:
    """Names after those that their formulas use."""
    formulas = {p.name: p.values for p in network.parameters}
    left, order = list(names), list[str]()
    while left:
        free = [n for n in left if not {m.data for m in topological(list(formulas[n])) if m.op == "param"} & set(left)]
        if not free:
            break  # binding says that they depend on themselves
        order += free
        left = [n for n in left if n not in free]
    return order


def reads_of_structure(
    network: Network, model: EnergyModel, form: DescriptorForm, program: Program, binding: Binding
) -> set[str]:
    """Parameters that sizes, indices, ranges and integers are made of."""
    read = Read(binding.parameters)
    owners = _owners(form, read)
    _refuse_outside(model, owners, read, network.place)
    bind_covers(form.covers, owners, read)
    where = places_of(network, form, program, binding)[1]
    integers(program.slots, owners, read, where, network)
    nodes = [node for pin in form.pins for node in pin.at]
    nodes += [node for pin in form.pins for loop in pin.nest for node in (loop.first, loop.last)]
    nodes += [node for e in network.elements for node in (*e.at, e.value)]
    nodes += [node for p in network.parameters for pair in p.shape for node in pair]
    return read.read | {n.data for n in topological(nodes) if n.op == "param"}


def columns(
    network: Network,
    model: EnergyModel,
    form: DescriptorForm,
    program: Program,
    binding: Binding,
    varied: Mapping[str, Floats],
) -> ParameterColumns | None:
    """The numbers of runs whose scalar parameters are `varied` [runs]; None where they need bindings of their own."""
    known = {p.name: p for p in network.parameters}
    # constants of integrated rows need a binding each
    if form.offsets or not all(name in known for name in varied):
        return None
    names = [*varied, *following(network, set(varied))]
    moving = set(names)
    # as in `again.way`: numbers alone may follow
    if any(known[n].shape or known[n].whole for n in names) or any(e.name in moving for e in network.elements):
        return None
    if moving & reads_of_structure(network, model, form, program, binding):
        return None
    runs = len(next(iter(varied.values())))
    values = Varied(binding.parameters, {n: np.asarray(v, dtype=float) for n, v in varied.items()})
    good = np.ones(runs, dtype=bool)
    # formulas, for all runs at once
    for name in names[len(varied) :]:
        found = _over(known[name].values[0], values, runs)
        good &= np.isfinite(found)
        values.values[name] = found
    # runs in which a decision of the form fails are no good
    for slope in network.slopes:
        if not reads(slope.expression, moving):
            continue
        if slope.loops:
            return None
        found = _over(slope.expression, values, runs)
        good &= (found == 0.0) if slope.flat else (found != 0.0)
        if slope.sign:
            good &= slope.sign * found > 0.0
    starts: list[tuple[Start, Floats]] = []
    # initial values by formulas, outside of arrays
    for pin, start in zip(form.pins, binding.initial, strict=True):
        if not reads(pin.value, moving):
            continue
        if pin.nest:
            return None
        found = _over(pin.value, values, runs)
        good &= np.isfinite(found)
        starts.append((start, found))
    # one row of numbers a run
    p = np.tile(binding.p, (runs, 1))
    for place, name in enumerate(program.scalars):
        if name in moving:
            p[:, place] = values.values[name]
    return ParameterColumns(p, tuple(starts), good)


def _over(node: Node, values: Parameters, runs: int) -> Floats:
    """An expression over the runs."""
    found: Any = evaluate([node], values.lookup)[0]
    return np.broadcast_to(np.asarray(found, dtype=float), (runs,)).copy()
