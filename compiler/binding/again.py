"""A binding made again with other numbers: what follows from the ones that changed, and nothing else.

Received: the binding of the text's own values and overrides of scalar parameters; returned: the binding that `bind`
would give, bit for bit, or None where that must be asked: where sizes, indices or integers follow from what changed, or
the new values make no sense (`bind` says why).
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace

import numpy as np
from sysdyn.compiler.binding.binding import Binding
from sysdyn.compiler.binding.columns import Varied, following, reads_of_structure
from sysdyn.compiler.forms.descriptor import DescriptorForm
from sysdyn.compiler.model.energies import EnergyModel
from sysdyn.compiler.model.interpret import last_of
from sysdyn.compiler.program.program import Program
from sysdyn.dsl.model.expression import Node, topological, topological_unbound
from sysdyn.dsl.model.network import Network, Slope
from sysdyn.values import dataclass

Nodes = tuple[Node, ...]
"""Of an expression, each after those it needs."""


@dataclass(frozen=True, slots=True)
class Way:
    """What follows from a set of scalar parameters.

    follow: parameters with the nodes of their formulas, each after those it needs; slopes; initial values, by their
    places among these: those that read any; places: (name, place in p).
    """

    follow: tuple[tuple[str, Nodes], ...]
    slopes: tuple[tuple[Slope, Nodes], ...]
    pins: tuple[tuple[int, Nodes], ...]
    places: tuple[tuple[str, int], ...]


def way(
    network: Network,
    model: EnergyModel,
    form: DescriptorForm,
    program: Program,
    binding: Binding,
    names: frozenset[str],
) -> Way | None:
    """What follows from these parameters; None where more than numbers does."""
    known = {p.name: p for p in network.parameters}
    if form.offsets or not names <= known.keys():
        return None
    behind = following(network, set(names))
    moving = {*names, *behind}
    if any(known[n].shape or known[n].whole for n in moving) or any(e.name in moving for e in network.elements):
        return None
    if any(len(known[n].values) != 1 for n in behind):
        return None
    if moving & reads_of_structure(network, model, form, program, binding):
        return None

    def read(node: Node) -> bool:
        return any(n.op == "param" and n.data in moving for n in topological([node]))

    slopes = [slope for slope in network.slopes if read(slope.expression)]
    pins = [(k, pin) for k, pin in enumerate(form.pins) if read(pin.value)]
    if any(slope.loops for slope in slopes) or any(pin.nest for _, pin in pins):
        return None
    if network.scene is not None and network.scene.start is not None and read(network.scene.start):
        return None
    places = tuple((name, place) for place, name in enumerate(program.scalars) if name in moving)
    return Way(
        tuple((n, _nodes(known[n].values[0])) for n in behind),
        tuple((slope, _nodes(slope.expression)) for slope in slopes),
        tuple((k, _nodes(pin.value)) for k, pin in pins),
        places,
    )


def _nodes(root: Node) -> Nodes:
    return tuple(topological_unbound([root]))


def again(binding: Binding, path: Way, overrides: Mapping[str, float]) -> Binding | None:
    """The binding with these values, whose names are those that the way was made for."""
    with np.errstate(all="ignore"):
        return _again(binding, path, overrides)


def _again(binding: Binding, path: Way, overrides: Mapping[str, float]) -> Binding | None:
    parameters = Varied(binding.parameters, overrides)
    values, lookup = parameters.values, parameters.lookup
    for name, formula in path.follow:
        values[name] = float(last_of(formula, lookup))
    if not all(math.isfinite(values[name]) for name in (*overrides, *(name for name, _ in path.follow))):
        return None
    for slope, nodes in path.slopes:
        value = last_of(nodes, lookup)
        if (value != 0.0) if slope.flat else (value == 0.0 or (slope.sign and not slope.sign * value > 0.0)):
            return None
    starts = list(binding.initial)
    for k, nodes in path.pins:
        value = float(last_of(nodes, lookup))
        if not math.isfinite(value):
            return None
        starts[k] = starts[k].at(np.full(starts[k].values.shape, value))
    p = binding.p.copy()
    for name, place in path.places:
        p[place] = values[name]
    return replace(binding, p=p, initial=tuple(starts), values=values, parameters=parameters)
