"""Numbers of parameters: what the checks that need values compute with.

Parameters of any array size; elements are computed one at a time and only where a check asks for them.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from itertools import islice

from sysdyn.dsl.model import expression as ex
from sysdyn.dsl.model.evaluation import evaluate
from sysdyn.dsl.model.expression import Node
from sysdyn.dsl.model.network import ElementSetting, Loop, Parameter


def as_constants(at: Mapping[Node, float]) -> dict[Node, Node]:
    """Numbers as nodes, to be put in the place of what has them."""
    return {node: ex.const(value) for node, value in at.items()}


class Values:
    """Values of a model's parameters; NaN where a parameter has none."""

    def __init__(self, parameters: Mapping[str, Parameter], elements: Sequence[ElementSetting] = ()) -> None:
        self._parameters = parameters
        self._known: dict[tuple[str, tuple[int, ...]], float] = {}
        self._set = {setting.name for setting in elements}
        for name in parameters:  # in the order of dependence: no deep recursion
            if not parameters[name].shape:
                self._element(name, ())
        for setting in elements:
            at = tuple(int(self.number(a)) for a in setting.at)
            self._known[setting.name, at] = self.number(setting.value)

    def number(self, node: Node, bound: Mapping[Node, float] | None = None) -> float:
        """The value of a node made of parameters and bound loop variables; NaN if it holds anything else."""
        if node.op == "const":
            return float(node.data)
        if node.op == "param" and not node.args and not bound:
            return self._element(node.data, ())
        return float(evaluate([node], lambda n: self._lookup(n, bound or {}))[0])

    def truth(self, node: Node, bound: Mapping[Node, float] | None = None) -> bool:
        """The value of a condition."""
        return bool(evaluate([node], lambda n: self._lookup(n, bound or {}))[0])

    def element(self, name: str, *at: int) -> float:
        """The value of a parameter, or of one element of an array."""
        return self._element(name, at)

    def _lookup(self, node: Node, bound: Mapping[Node, float]) -> float:
        if node in bound:
            return bound[node]
        if node.op != "param":
            return math.nan
        at = tuple(self.number(a, bound) for a in node.args)
        if not all(map(math.isfinite, at)):
            return math.nan
        return self._element(node.data, tuple(int(a) for a in at))

    def _element(self, name: str, at: tuple[int, ...]) -> float:
        key = (name, at)
        if key not in self._known:
            parameter = self._parameters.get(name)
            self._known[key] = math.nan
            if parameter is not None and parameter.values:
                self._known[key] = self._compute(parameter, at)
        return self._known[key]

    def _compute(self, parameter: Parameter, at: tuple[int, ...]) -> float:
        bound = {ex.index(name): float(i) for name, i in zip(parameter.indices, at, strict=False)} if at else {}
        k = 0
        if len(parameter.values) > 1:
            k = at[-1] - int(self.number(parameter.shape[-1][0]))
        return self.number(parameter.values[k], bound) if 0 <= k < len(parameter.values) else math.nan

    def iterations(self, loops: Sequence[Loop], at: Mapping[Node, float] | None = None) -> Iterator[dict[Node, float]]:
        """The values of the loop variables, the last loop's the fastest; bounds may follow outer loops."""
        at = dict(at or {})
        if not loops:
            yield at
            return
        first, last = self.number(loops[0].first, at), self.number(loops[0].last, at)
        if math.isfinite(first + last):
            for i in range(round(first), round(last) + 1):
                yield from self.iterations(loops[1:], {**at, ex.index(loops[0].index): float(i)})

    def cases(self, node: Node, loops: Sequence[Loop]) -> Iterator[dict[Node, float]]:
        """The values of the loop variables for which a function of its unknowns may be one of its own: the first ones
        alone where it does not follow them.
        """
        found = self.iterations(loops)
        return found if loops and self._follows(node) else islice(found, 1)

    def _follows(self, node: Node) -> bool:
        """Whether loop variables enter a function: not by the index of what is the same in each element."""
        stack, seen = [node], {node}
        while stack:
            top = stack.pop()
            below = () if top.op == "var" else top.args
            if top.op == "index":
                return True
            if top.op == "param" and top.args:
                parameter = self._parameters.get(top.data)
                if parameter is not None and len(parameter.values) == 1 and top.data not in self._set:
                    below = parameter.values
            stack += [n for n in below if n not in seen]
            seen.update(below)
        return False

    def bounds(self, node: Node, loops: Sequence[Loop]) -> tuple[float, float]:
        """Least and greatest value of an affine index over its loops (an empty loop gives inf, -inf)."""
        low: dict[Node, float] = {}
        high: dict[Node, float] = {}
        for loop in loops:
            me = ex.index(loop.index)
            low[me], high[me] = self.number(loop.first, low), self.number(loop.last, high)
            if low[me] > high[me]:
                return math.inf, -math.inf
        return self.number(node, low), self.number(node, high)
