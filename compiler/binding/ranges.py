"""E805: every index that a model uses lies in its family, for the parameter values of a binding.

Indices are affine with coefficient one, so their extremes lie at the extremes of the loop variables: no array is
gone through, and no carrier ever reads beyond one.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping

from sysdyn.compiler.model.energies import EnergyModel
from sysdyn.compiler.model.interpret import Value, evaluate
from sysdyn.compiler.model.parameters import Extents, Parameters
from sysdyn.compiler.model.terms import Nest
from sysdyn.dsl.model.expression import Node, topological_unbound
from sysdyn.dsl.text.diagnostics import Diagnostic, Place

Bounds = Mapping[str, tuple[float, float]]  # extremes of each loop variable


class Ranges:
    """Checks the indices of one model under one binding."""

    def __init__(self, owners: Mapping[str, Extents], parameters: Parameters) -> None:
        self.owners = owners
        self.parameters = parameters

    def check(self, model: EnergyModel) -> Iterator[Diagnostic]:
        """What lies outside, each statement once."""
        for roots, nest, place in _statements(model):
            bounds = self.bounds(nest, {})
            if bounds is not None:
                found = next((message for root in roots for message in self.outside(root, bounds)), None)
                if found is not None:
                    yield Diagnostic("E805", found, place)

    def bounds(self, nest: Nest, outer: Bounds) -> Bounds | None:
        """Extremes of the loop variables; None where there is no iteration."""
        found = dict(outer)
        for loop in nest:
            low, high = self.extremes(loop.first, found)[0], self.extremes(loop.last, found)[1]
            if low > high:
                return None
            found[loop.index] = (low, high)
        return found

    def extremes(self, node: Node, bounds: Bounds) -> tuple[float, float]:
        """Least and largest value of an affine index."""
        return self._end_value(node, bounds, 0), self._end_value(node, bounds, 1)

    def _end_value(self, node: Node, bounds: Bounds, side: int) -> float:
        def lookup(leaf: Node, args: list[Value]) -> Value:
            if leaf.op == "index" and leaf.data in bounds:
                return bounds[leaf.data][side]
            return self.parameters.lookup(leaf, args)

        return float(evaluate([node], lookup)[0])

    def outside(self, root: Node, bounds: Bounds) -> Iterator[str]:
        """Messages for the references below root."""
        for node in topological_unbound([root]):
            # the least and the largest index against the family's box
            if node.op in ("var", "param") and node.args:
                name = node.data[0] if node.op == "var" else node.data
                box = self.owners.get(name) if node.op == "var" else self.parameters.boxes.get(name)
                for at, (first, last) in zip(node.args, box or (), strict=False):
                    low, high = self.extremes(at, bounds)
                    if low < first or high > last:
                        yield f"{name}: index {low if low < first else high:g} outside {first}..{last}"
            # the loop variable ranges between its own extremes
            elif node.op == "reduce":
                first_, last_, body = node.args
                inner = self.extremes(first_, bounds)[0], self.extremes(last_, bounds)[1]
                if inner[0] <= inner[1]:
                    yield from self.outside(body, {**bounds, node.data[1]: inner})


def _statements(model: EnergyModel) -> Iterator[tuple[Iterable[Node], Nest, Place]]:
    """Expressions, their loops and where they are written."""
    # in the order of the model: functions, works, rows, initial values, what is traced
    for name in model.functions:
        for term in model.function(name):
            yield (term.expression,), term.loops, term.place
    for work in model.works:
        yield (work.effort, work.on), work.loops, work.place
    for row in model.rows:
        for term in row.terms:
            yield (term.expression,), term.loops, term.place
    for target in model.initials:
        yield (target.target, target.value), target.nest, target.place
    for quantity in model.quantities:
        yield (quantity.expression,), (), quantity.place
