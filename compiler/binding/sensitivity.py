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

import numpy as np
from numpy.typing import NDArray
from sysdyn.compiler.binding.binding import Binding
from sysdyn.compiler.binding.oracle import Oracle
from sysdyn.compiler.forms.descriptor import Block, DescriptorForm, Kernel
from sysdyn.dsl.model.calculus import differential, rate_name
from sysdyn.dsl.model.expression import Node, compare, conditional, const, is_const, mul, topological
from sysdyn.dsl.model.network import Parameter

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
_DERIVED = (*RATES, "phi_acceleration")
Blocks = dict[str, list[Kernel]]


class Sensitivity:
    """Slopes of the rows of a form by one parameter, or one element of it."""

    def __init__(
        self, form: DescriptorForm, binding: Binding, parameters: Sequence[Parameter], name: str, at: tuple[int, ...]
    ) -> None:
        """at: the index of an element; parameters: those whose values may be formulas in others."""
        slopes = [_Slope(parameters, rate_name(name, order), at) for order in range(LAST + 1)]
        blocks = _by_order(form, [{b.name: _changed(b, slope) for b in form.blocks} for slope in slopes])
        self._oracles = [
            Oracle(replace(form, blocks=tuple(Block(n, tuple(k)) for n, k in blocks.get(order, {}).items())), binding)
            for order in range(FIRST, LAST + 1)
        ]
        self.deeper = any(kernels for order, found in blocks.items() if order > LAST for kernels in found.values())
        """Whether a row reads a rate beyond the second."""

    def rows(self, block: str, order: int, t: float, y: Array, yd: Array) -> Array:
        """Slopes of one block by int u (order -1), u (0), u' (1) or u'' (2), every row family's place included."""
        return self._oracles[order - FIRST].rows(block, t, y, yd)


class _Slope:
    """The derivative of expressions by a parameter, formulas of other parameters followed."""

    def __init__(self, parameters: Sequence[Parameter], name: str, at: tuple[int, ...]) -> None:
        self._name, self._at = name, at
        self._follow: dict[str, Node] = {}
        self._follow = self._following(parameters)

    def __call__(self, expression: Node) -> Node:
        nodes = [n for n in topological([expression]) if n.op == "param"]
        seeds = {n: self._own(n) for n in nodes if n.data == self._name}
        seeds |= {n: self._follow[n.data] for n in nodes if n.data in self._follow and not n.args}
        return differential(expression, seeds) if seeds else const(0.0)

    def _following(self, parameters: Sequence[Parameter]) -> dict[str, Node]:
        """Slopes of the parameters whose value is a formula in this one."""
        found: dict[str, Node] = {}
        for _ in parameters:
            self._follow = dict(found)
            for p in parameters:
                if not p.shape and len(p.values) == 1 and p.name != self._name:
                    slope = self(p.values[0])
                    if not is_const(slope, 0.0):
                        found[p.name] = slope
            if found == self._follow:
                break
        return found

    def _own(self, node: Node) -> Node:
        """1 where the indices are those of the element."""
        pairs = zip(node.args, self._at, strict=True)
        return mul(const(1.0), *(conditional(compare("==", i, const(k)), const(1.0), const(0.0)) for i, k in pairs))


def _by_order(form: DescriptorForm, by: Sequence[dict[str, list[Kernel]]]) -> dict[int, Blocks]:
    """Slopes of all blocks by order; by: those by u, u' and u'' as the rows read them."""
    integrated = {offset.label for offset in form.offsets}
    found: dict[int, Blocks] = {}

    def put(order: int, block: str, kernels: Iterable[Kernel], *, own: bool | None = None) -> None:
        """The rows of families that the block has; own: those of integrated constraints alone, or without."""
        there = form.block(block)
        labels = {form.rows[s.row].owner for k in there.kernels for s in k.rows} if there is not None else set()
        wanted = labels if own is None else labels & integrated if own else labels - integrated
        for kernel in kernels:
            rows = tuple(s for s in kernel.rows if form.rows[s.row].owner in wanted)
            if rows:
                found.setdefault(order, {}).setdefault(block, []).append(Kernel(kernel.nest, rows))

    for order, slopes in enumerate(by):
        for name in slopes.keys() - {*_DERIVED, "phi"}:
            put(order, name, slopes[name])
        put(order, "phi", slopes.get("phi", ()), own=False)
        put(order - 1, "phi", slopes.get("phi_rate", ()), own=True)
        put(order, "phi_rate", slopes.get("phi_rate", ()), own=True)
        put(order + 1, "phi_acceleration", slopes.get("phi_rate", ()), own=True)
        put(order + 2, "phi_acceleration", slopes.get("phi", ()), own=False)
        for name, bases in RATES.items():
            for base in bases:
                put(order + 1, name, slopes.get(base, ()), own=False if base == "phi" else None)
    return found


def _changed(block: Block, change: Callable[[Node], Node]) -> list[Kernel]:
    """The block with its expressions changed, without the rows that are zero."""
    kernels = (
        Kernel(k.nest, tuple(replace(s, expression=change(s.expression)) for s in k.rows)) for k in block.kernels
    )
    kept = (Kernel(k.nest, tuple(s for s in k.rows if not is_const(s.expression, 0.0))) for k in kernels)
    return [k for k in kept if k.rows]
