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
from numpy.typing import NDArray
from sysdyn.compiler.binding.binding import Binding, offsets_of, places_of
from sysdyn.compiler.binding.columns import Varied, following, reads_of_structure
from sysdyn.compiler.forms.descriptor import DescriptorForm
from sysdyn.compiler.model.energies import EnergyModel
from sysdyn.compiler.model.interpret import grid, last_of, with_loop_variables
from sysdyn.compiler.model.parameters import Extents
from sysdyn.compiler.program.program import Program
from sysdyn.dsl.model.expression import Node, reads, topological_unbound
from sysdyn.dsl.model.network import Network, Slope
from sysdyn.values import dataclass

Nodes = tuple[Node, ...]
"""Of an expression, each after those it needs."""
Columns = dict[str, NDArray[np.float64]]
"""Loop variables over the iterations of a nest; {} without loops."""


@dataclass(frozen=True, slots=True)
class Constants:
    """The form whose integrated rows have them; ranges of the indices by owner; places in p by name."""

    form: DescriptorForm
    owners: dict[str, Extents]
    where: dict[str, int]


@dataclass(frozen=True, slots=True)
class Consequences:
    """What follows from a set of scalar parameters.

    follow: parameters with the nodes of their formulas, each after those it needs; slopes; initial values, by their
    places among these: those that read any, with the loop variables of their iterations; places: (name, place in p);
    constants: of integrated rows, where any moves.
    """

    follow: tuple[tuple[str, Nodes], ...]
    slopes: tuple[tuple[Slope, Nodes, Columns], ...]
    pins: tuple[tuple[int, Nodes, Columns], ...]
    places: tuple[tuple[str, int], ...]
    constants: Constants | None = None


def way(
    network: Network,
    model: EnergyModel,
    form: DescriptorForm,
    program: Program,
    binding: Binding,
    names: frozenset[str],
) -> Consequences | None:
    """What follows from these parameters; None where more than numbers does."""
    known = {p.name: p for p in network.parameters}
    # a name that is no parameter of the network
    if not names <= known.keys():
        return None
    behind = following(network, set(names))
    moving = {*names, *behind}
    # arrays and sizes: another binding is made for these
    if any(known[n].shape or known[n].whole for n in moving) or any(e.name in moving for e in network.elements):
        return None
    if any(len(known[n].values) != 1 for n in behind):
        return None
    # where structure or a loop's range follows from them, more than numbers changes
    if moving & reads_of_structure(network, model, form, program, binding):
        return None

    def read(node: Node) -> bool:
        return reads(node, moving)

    # what has to be looked at again: slopes that were decided, initial values, constants of integrated rows
    slopes = [slope for slope in network.slopes if read(slope.expression)]
    pins = [(k, pin) for k, pin in enumerate(form.pins) if read(pin.value)]
    nests = [slope.loops for slope in slopes] + [term.loops for offset in form.offsets for term in offset.terms]
    if any(read(node) for nest in nests for loop in nest for node in (loop.first, loop.last)):
        return None
    # a start that moves changes which instants there are
    if network.scene is not None and network.scene.start is not None and read(network.scene.start):
        return None
    if any(read(node) for offset in form.offsets for node in offset.at):
        return None
    # constants follow initial displacements and what they were integrated from
    move = bool(pins) or any(read(term.expression) for offset in form.offsets for term in offset.terms)
    constants = Constants(form, *places_of(network, form, program, binding)) if form.offsets and move else None
    lookup = binding.parameters.lookup
    places = tuple((name, place) for place, name in enumerate(program.scalars) if name in moving)
    return Consequences(
        tuple((n, _nodes(known[n].values[0])) for n in behind),
        tuple((slope, _nodes(slope.expression), grid(slope.loops, lookup)) for slope in slopes),
        tuple((k, _nodes(pin.value), grid(pin.nest, lookup)) for k, pin in pins),
        places,
        constants,
    )


def _nodes(root: Node) -> Nodes:
    return tuple(topological_unbound([root]))


def rebind(binding: Binding, path: Consequences, overrides: Mapping[str, float]) -> Binding | None:
    """The binding with these values, whose names are those that the way was made for."""
    with np.errstate(all="ignore"):
        return _rebind(binding, path, overrides)


def _rebind(binding: Binding, path: Consequences, overrides: Mapping[str, float]) -> Binding | None:
    """Bind anew by the formulas of `path` alone; None where a value is not finite or a decision of the first binding
    fails.
    """
    parameters = Varied(binding.parameters, overrides)
    values, lookup = parameters.values, parameters.lookup
    for name, formula in path.follow:
        values[name] = float(last_of(formula, lookup))
    if not all(math.isfinite(values[name]) for name in (*overrides, *(name for name, _ in path.follow))):
        return None
    # a slope that was divided by is zero, one that was flat is not, or a sign has turned
    for slope, nodes, columns in path.slopes:
        value = np.asarray(last_of(nodes, with_loop_variables(columns, lookup)))
        wrong = value != 0.0 if slope.flat else value == 0.0
        if slope.sign:
            wrong = ~(slope.sign * value > 0.0)
        if wrong.any():
            return None
    starts = list(binding.initial)
    # initial values
    for k, nodes, columns in path.pins:
        value = np.asarray(last_of(nodes, with_loop_variables(columns, lookup)), dtype=float)
        if not np.isfinite(value).all():
            return None
        starts[k] = starts[k].with_values(np.full(starts[k].values.shape, value))
    p = binding.p.copy()
    for name, place in path.places:
        p[place] = values[name]
    # B q0 of integrated constraints, at the initial displacements
    if path.constants is not None:
        form, where = path.constants.form, path.constants.where
        for name, held in offsets_of(form, path.constants.owners, tuple(starts), parameters).items():
            p[where[name] : where[name] + held.size] = held
    return replace(binding, p=p, initial=tuple(starts), values=values, parameters=parameters)
