"""Exact slopes of rows and traced quantities by parameters, straight from the nodes (see `oracle`).

A parameter u that moves in time moves rows by its rates too.  Where the text reads them (of a `let`, of a momentum) the
model is compiled with u among those that move, and u' and u'' are parameters of it (`dsl.model.calculus.moving`).  The
differentiated rows follow, of r(y, t, u, u', u'') = 0

    d r'/du' = dr/du        d r'/du'' = dr/du'        d r''/du'' = dr/du        (at u' = u'' = 0)

The coefficients dr/du count as held, as those of the linearisation do: their own rates are left out (of a source
E sin(w t) they would belong to the change of the state's coordinates, not to its motion).  A flow constraint that was
integrated took u for a constant (q - u t - q0): of a u that moves it is the integral,

    dr = dr'/du int du dt + dr'/du' du        d r''/du' = dr'/du

Received: a descriptor form, its binding, the parameter's name and index.  Returned: rows of a block by int u, u, u'
and u''.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace
from itertools import product

import numpy as np
from numpy.typing import NDArray
from sysdyn.compiler.binding.binding import Binding
from sysdyn.compiler.binding.oracle import Oracle
from sysdyn.compiler.forms.descriptor import Block, DescriptorForm, LoopKernel
from sysdyn.dsl.model.calculus import differential, rate_name
from sysdyn.dsl.model.expression import Node, compare, conditional, const, index, is_const, substitute, topological
from sysdyn.dsl.model.network import Network
from sysdyn.dsl.model.rewriting import following

Array = NDArray[np.float64]
RATES = {
    "phi_rate": ("phi",),
    "psi_rate": ("psi",),
    "gamma_rate": ("gamma",),
    "momentum_rate": ("momentum",),
    "dynamics_rate": ("dynamics", "phi_reaction", "psi_reaction"),
}
"""Blocks that are first derivatives, and of what."""
FIRST, LAST = -1, 2
"""Orders of slopes: by the integral of the parameter, by itself, by its first and second rate."""
_DERIVED = (*RATES, "phi_acceleration", "gamma_acceleration")
Blocks = dict[str, list[LoopKernel]]


class Sensitivity:
    """Slopes of the rows of a form by one parameter, or one element of it."""

    def __init__(
        self, form: DescriptorForm, binding: Binding, network: Network, name: str, at: tuple[int, ...]
    ) -> None:
        """at: the index of an element; network: its parameters may be formulas in others."""
        slopes = [_ParameterSlope(network, binding, rate_name(name, order), at) for order in range(LAST + 1)]
        blocks = _by_order(form, [{b.name: _map_rows(b, slope) for b in form.blocks} for slope in slopes])
        self._oracles = [
            Oracle(replace(form, blocks=tuple(Block(n, tuple(k)) for n, k in blocks.get(order, {}).items())), binding)
            for order in range(FIRST, LAST + 1)
        ]
        self.deeper = any(kernels for order, found in blocks.items() if order > LAST for kernels in found.values())
        """Whether a row reads a rate beyond the second."""

    def rows(self, block: str, order: int, t: float, y: Array, yd: Array) -> Array:
        """Slopes of one block by int u (order -1), u (0), u' (1) or u'' (2), every row family's place included."""
        return self._oracles[order - FIRST].rows(block, t, y, yd)


class _ParameterSlope:
    """The derivative of expressions by a parameter, formulas of other parameters followed."""

    def __init__(self, network: Network, binding: Binding, name: str, at: tuple[int, ...]) -> None:
        self._name, self._at, self._binding = name, at, binding
        self._known = {p.name: p for p in network.parameters}
        self._apart = [(s.name, s) for s in network.elements]
        self._follow = following(network, (name,)) - {name}

    def __call__(self, expression: Node) -> Node:
        return differential(expression, seeds) if (seeds := self._seeds(expression)) else const(0.0)

    def _seeds(self, expression: Node) -> dict[Node, Node]:
        nodes = [n for n in topological([expression]) if n.op == "param"]
        seeds = {n: self._own(n) for n in nodes if n.data == self._name}
        return seeds | {n: self._parameter_slope(n) for n in nodes if n.data in self._follow}

    def _own(self, node: Node) -> Node:
        """1 where the indices are those of the element."""
        return _where(node.args, self._at, const(1.0), const(0.0))

    def _parameter_slope(self, node: Node) -> Node:
        """The slope of a parameter by its formula: over its indices, element by element, or of an element apart."""
        p = self._known[node.data]
        loops = {index(name): at for name, at in zip(p.indices, node.args, strict=False)}
        slopes = [substitute(self(v), loops) for v in p.values]
        inner = node.args[len(p.indices) :]
        boxes = self._binding.parameters.boxes.get(p.name, ())[len(p.indices) :]
        found = slopes[0] if len(slopes) == 1 else const(0.0)
        if len(slopes) > 1:
            for at, slope in zip(product(*(range(a, b + 1) for a, b in boxes)), slopes, strict=True):
                found = _where(inner, at, slope, found)
        for name, apart in self._apart:
            if name == p.name:
                at = tuple(round(self._binding.evaluate(node)) for node in apart.at)
                found = _where(node.args, at, self(apart.value), found)
        return found


def _where(indices: Sequence[Node], at: Sequence[int], there: Node, elsewhere: Node) -> Node:
    """One value where the indices are these, the other elsewhere."""
    for i, k in zip(indices, at, strict=True):
        there = conditional(compare("==", i, const(k)), there, elsewhere)
    return there


def _by_order(form: DescriptorForm, by: Sequence[dict[str, list[LoopKernel]]]) -> dict[int, Blocks]:
    """Slopes of all blocks by order; by: those by u, u' and u'' as the rows read them."""
    integrated = {offset.label for offset in form.offsets}
    found: dict[int, Blocks] = {}

    def put(order: int, block: str, kernels: Iterable[LoopKernel], *, own: bool | None = None) -> None:
        """The rows of families that the block has; own: those of integrated constraints alone, or without."""
        there = form.block(block)
        labels = {form.rows[s.row].owner for k in there.kernels for s in k.rows} if there is not None else set()
        wanted = labels if own is None else labels & integrated if own else labels - integrated
        for kernel in kernels:
            rows = tuple(s for s in kernel.rows if form.rows[s.row].owner in wanted)
            if rows:
                found.setdefault(order, {}).setdefault(block, []).append(LoopKernel(kernel.nest, rows))

    # the derivative of a row by u' is the derivative of its rate by u'', and so on
    for order, slopes in enumerate(by):
        for name in slopes.keys() - {*_DERIVED, "phi"}:
            put(order, name, slopes[name])
        # constraints by themselves, and those that were integrated from flow constraints one order lower
        put(order, "phi", slopes.get("phi", ()), own=False)
        put(order - 1, "phi", slopes.get("phi_rate", ()), own=True)
        put(order, "phi_rate", slopes.get("phi_rate", ()), own=True)
        put(order + 1, "phi_acceleration", slopes.get("phi_rate", ()), own=True)
        put(order + 2, "phi_acceleration", slopes.get("phi", ()), own=False)
        put(order + 2, "gamma_acceleration", slopes.get("gamma", ()))
        # rates of balances follow from the rows whose rates they are
        for name, bases in RATES.items():
            for base in bases:
                put(order + 1, name, slopes.get(base, ()), own=False if base == "phi" else None)
    return found


def _map_rows(block: Block, change: Callable[[Node], Node]) -> list[LoopKernel]:
    """The block with its expressions changed, without the rows that are zero."""
    kernels = (
        LoopKernel(k.nest, tuple(replace(s, expression=change(s.expression)) for s in k.rows)) for k in block.kernels
    )
    kept = (LoopKernel(k.nest, tuple(s for s in k.rows if not is_const(s.expression, 0.0))) for k in kernels)
    return [k for k in kept if k.rows]
