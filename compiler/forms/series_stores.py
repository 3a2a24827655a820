"""Implicit efforts in series with a store: its law tells them.

Where a coordinate without inertia moves with one potential store and one implicit effort y alone, its balance is
dV/dq + c y = 0, and laws that read y may read -(dV/dq)/c: states for an unknown that the run has to find.  A law with a
corner then has it where the rows of the store have theirs (friction in pipes: the factor reads the flow of the water's
inertia, the loss its own, which are one flow), and what is steep in y is a law of states.

Received: an EnergyModel.  Returned: the same with such efforts replaced in rows gamma; balances stay as they are.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

from sysdyn.compiler.forms.efforts import Effort, efforts
from sysdyn.compiler.forms.momenta import coordinates_with_inertia
from sysdyn.compiler.model.energies import EnergyModel, Row
from sysdyn.compiler.model.terms import Nest, local_variables
from sysdyn.dsl.model.calculus import derivative
from sysdyn.dsl.model.expression import Node, div, neg, substitute, variables
from sysdyn.dsl.model.network import loop_ranges
from sysdyn.values import dataclass


@dataclass(frozen=True, slots=True)
class _Told:
    """An implicit effort with the indices `at` as what the store says, for all iterations of the nest."""

    at: tuple[Node, ...]
    value: Node


def with_efforts_of_stores(model: EnergyModel) -> EnergyModel:
    """The model whose laws read the stores in series with what they are of."""
    told = dict(_series_pairs(model))
    if not told:
        return model

    def new(root: Node) -> Node:
        found = [n for n in local_variables(root, "e") if n.data[0] in told]
        change = {}
        for n in found:
            own = told[n.data[0]]
            change[n] = substitute(own.value, dict(zip(own.at, n.args, strict=True)))
        return substitute(root, change) if change else root

    def row(old: Row) -> Row:
        if old.kind != "gamma":
            return old
        return replace(old, terms=tuple(replace(t, expression=new(t.expression)) for t in old.terms))

    return replace(model, rows=tuple(map(row, model.rows)))


def _series_pairs(model: EnergyModel) -> Iterator[tuple[str, _Told]]:
    """Coordinates without inertia between one store and one implicit effort: the effort's value by the store's."""
    heavy, shapes = coordinates_with_inertia(model), {u.name: u.shape for u in model.unknowns}
    balances: dict[str, list[Effort]] = {}
    for effort in efforts(model):
        balances.setdefault(effort.on.data[0], []).append(effort)
    for name, balance in balances.items():
        kinds = sorted(balance, key=lambda e: e.name)
        # two efforts balance each other: the store's and the implicit one
        if name in heavy or [e.name for e in kinds] != ["implicit", "potential"]:
            continue
        implicit, stored = kinds
        found = local_variables(implicit.value, "e")
        if len(found) != 1 or found[0].data[0] not in shapes:
            continue
        y = found[0]
        factor = derivative(implicit.value, y)
        # linear in the implicit effort, over all its elements
        whole = _whole(implicit.nest, y.args, shapes[y.data[0]]) and implicit.on.args == y.args
        if whole and not variables(factor) and (stored.nest, stored.on) == (implicit.nest, implicit.on):
            yield y.data[0], _Told(y.args, neg(div(stored.value, factor)))


def _whole(nest: Nest, at: tuple[Node, ...], shape: tuple[tuple[Node, Node], ...]) -> bool:
    """Whether the indices run over the whole of a family."""
    return shape == loop_ranges(nest) and [n.data for n in at] == [loop.index for loop in nest]
