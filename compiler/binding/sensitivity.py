"""Exact slopes of rows and traced quantities by parameters, straight from the nodes (see `oracle`).

A parameter u that moves in time moves the differentiated rows by its rates too: of r(y, t, u) = 0

    d r'/du' = dr/du        d r''/du'' = dr/du        (at u' = u'' = 0)

The coefficients dr/du count as held, as those of the linearisation do: their own rates are left out (of a source
E sin(w t) they would belong to the change of the state's coordinates, not to its motion).  A flow constraint that was
integrated took u for a constant (q - u t - q0): of a u that moves it is the integral,

    dr = dr'/du int du dt        d r''/du' = dr'/du

Received: a descriptor form, its binding, the parameter's name and index.  Returned: rows of a block by int u, u, u'
and u''.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from sysdyn.compiler.binding.binding import Binding
from sysdyn.compiler.binding.oracle import Oracle
from sysdyn.compiler.forms.descriptor import Block, DescriptorForm, Kernel
from sysdyn.dsl.model.calculus import differential
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
Change = Callable[[Node], Node]


class Sensitivity:
    """Slopes of the rows of a form by one parameter, or one element of it."""

    def __init__(
        self, form: DescriptorForm, binding: Binding, parameters: Sequence[Parameter], name: str, at: tuple[int, ...]
    ) -> None:
        """at: the index of an element; parameters: those whose values may be formulas in others."""
        self._name, self._at = name, at
        self._follow: dict[str, Node] = {}
        self._follow = self._following(parameters)
        self._oracles = [Oracle(replace(form, blocks=tuple(_kept(b))), binding) for b in self._blocks(form)]

    def rows(self, block: str, order: int, t: float, y: Array, yd: Array) -> Array:
        """Slopes of one block by int u (order -1), u (0), u' (1) or u'' (2), every row family's place included."""
        return self._oracles[order - FIRST].rows(block, t, y, yd)

    def _blocks(self, form: DescriptorForm) -> Iterator[list[Block]]:
        by_u = {b.name: _changed(b, self._slope) for b in form.blocks}
        held, summed = _split(form, by_u)
        yield [_gathered(form, summed, "phi", ("phi_rate",), _same)]
        derived = (*RATES, "phi_acceleration")
        yield [*(b for name, b in held.items() if name not in derived), *summed.values()]
        rates = [_gathered(form, held, name, base, _same) for name, base in RATES.items()]
        yield [*rates, _gathered(form, summed, "phi_acceleration", ("phi_rate",), _same)]
        yield [_gathered(form, held, "phi_acceleration", ("phi",), _same)]

    def _following(self, parameters: Sequence[Parameter]) -> dict[str, Node]:
        """Slopes of the parameters whose value is a formula in this one."""
        found: dict[str, Node] = {}
        for _ in parameters:
            self._follow = dict(found)
            for p in parameters:
                if not p.shape and len(p.values) == 1 and p.name != self._name:
                    slope = self._slope(p.values[0])
                    if not is_const(slope, 0.0):
                        found[p.name] = slope
            if found == self._follow:
                break
        return found

    def _slope(self, expression: Node) -> Node:
        nodes = [n for n in topological([expression]) if n.op == "param"]
        seeds = {n: self._own(n) for n in nodes if n.data == self._name}
        seeds |= {n: self._follow[n.data] for n in nodes if n.data in self._follow and not n.args}
        return differential(expression, seeds) if seeds else const(0.0)

    def _own(self, node: Node) -> Node:
        """1 where the indices are those of the element."""
        pairs = zip(node.args, self._at, strict=True)
        return mul(const(1.0), *(conditional(compare("==", i, const(k)), const(1.0), const(0.0)) for i, k in pairs))


def _same(expression: Node) -> Node:
    return expression


def _split(form: DescriptorForm, by_u: dict[str, Block]) -> tuple[dict[str, Block], dict[str, Block]]:
    """The slopes without those of integrated displacement constraints, and the rates of these alone."""
    integrated = {offset.label for offset in form.offsets}

    def part(block: Block, *, own: bool) -> Block:
        kernels = (
            Kernel(k.nest, tuple(s for s in k.rows if (form.rows[s.row].owner in integrated) == own))
            for k in block.kernels
        )
        return Block(block.name, tuple(kernels))

    held = {name: part(b, own=False) if name == "phi" else b for name, b in by_u.items()}
    return held, {name: part(b, own=True) for name, b in by_u.items() if name == "phi_rate"}


def _changed(block: Block, change: Change) -> Block:
    """The block with its expressions changed."""
    kernels = (
        Kernel(k.nest, tuple(replace(s, expression=change(s.expression)) for s in k.rows)) for k in block.kernels
    )
    return Block(block.name, tuple(kernels))


def _gathered(
    form: DescriptorForm, by_u: dict[str, Block], name: str, base: tuple[str, ...], change: Change
) -> Block:
    """Block `name` as the changed slopes of its base, for the row families that it has."""
    own = form.block(name)
    families = {s.row for k in own.kernels for s in k.rows} if own is not None else set()
    labels = {form.rows[k].owner for k in families}
    found: list[Kernel] = []
    for part in (by_u[b] for b in base if b in by_u):
        for kernel in part.kernels:
            kept = tuple(s for s in kernel.rows if form.rows[s.row].owner in labels and not is_const(s.expression, 0.0))
            found.append(Kernel(kernel.nest, kept))
    return _changed(Block(name, tuple(found)), change)


def _kept(blocks: list[Block]) -> Iterator[Block]:
    """Blocks without the rows that are zero."""
    for block in blocks:
        kernels = (
            Kernel(k.nest, tuple(s for s in k.rows if not is_const(s.expression, 0.0))) for k in block.kernels
        )
        yield Block(block.name, tuple(k for k in kernels if k.rows))
