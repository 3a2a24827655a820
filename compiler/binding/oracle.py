"""Rows and Jacobian entries of a descriptor form, evaluated straight from its nodes: what both emitters must meet.

No slots, no routines, no elimination of common subexpressions: every expression of every kernel is evaluated over the
iterations of its loops and scattered by the shapes of a binding.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from sysdyn.compiler.binding.binding import Binding
from sysdyn.compiler.binding.places import starts
from sysdyn.compiler.forms.descriptor import DescriptorForm, LoopKernel
from sysdyn.compiler.model.interpret import Value, over
from sysdyn.compiler.model.parameters import Extents, positions
from sysdyn.compiler.model.terms import has_reduction
from sysdyn.dsl.model.calculus import derivative
from sysdyn.dsl.model.expression import (
    Node,
    combine_terms,
    const,
    index,
    is_const,
    rebuild,
    substitute,
    topological,
    topological_unbound,
    variables,
)

Array = NDArray[np.float64]
Point = tuple[float, Array, Array]  # t, y, yd


class Oracle:
    """A descriptor form under a binding."""

    def __init__(self, form: DescriptorForm, binding: Binding) -> None:
        self.form = form
        self.binding = binding
        self.at = starts(binding.shapes)
        self.to = starts(binding.row_shapes)
        self._families = {(f.owner, f.kind): k for k, f in enumerate(form.families)}
        self._constants = {}
        for (_, first, count), offset in zip(binding.offsets, form.offsets, strict=True):
            self._constants[offset.name] = (offset.label, binding.p[first : first + count])

    def rows(self, block: str, t: float, y: Array, yd: Array) -> Array:
        """R of one block, every row family's place included."""
        r, point = np.zeros(int(self.to[-1])), (t, y, yd)
        for kernel in self._kernels(block):
            for summand in kernel.rows:
                roots = (*summand.at, summand.expression)
                *at, values = over(kernel.nest, roots, lambda n, a: self._leaf(n, a, point))
                where = self._position(self.binding.row_shapes[summand.row], at)
                np.add.at(r, self.to[summand.row] + np.broadcast_to(where, values.shape), values)
        return r

    def magnitudes(self, block: str, t: float, y: Array, yd: Array) -> Array:
        """Sum of the magnitudes of the terms of each row of one block."""
        r, point = np.zeros(int(self.to[-1])), (t, y, yd)
        for kernel in self._kernels(block):
            for summand in kernel.rows:
                node = summand.expression
                terms = (node,) if node.op != "sum" else node.args
                scales = (1.0,) if node.op != "sum" else node.data[1]
                (*at,) = over(kernel.nest, (*summand.at, *terms), lambda n, a: self._leaf(n, a, point))
                where = self._position(self.binding.row_shapes[summand.row], at[: len(summand.at)])
                for c, values in zip(scales, at[len(summand.at) :], strict=True):
                    np.add.at(r, self.to[summand.row] + np.broadcast_to(where, values.shape), np.abs(c * values))
        return r

    def find_undefined(
        self, block: str, t: float, y: Array, yd: Array, *, infinite: bool = True
    ) -> tuple[int, Node, list[float]] | None:
        """(row family, node, its arguments) of the first operation that makes of numbers what is none; None: there is
        none in the block.  infinite: what overflows counts too.
        """
        point = (t, y, yd)
        for kernel in self._kernels(block):
            for summand in kernel.rows:
                # operations that can fail on finite arguments
                nodes = [n for n in topological([summand.expression]) if n.op in ("table", "call", "pow", "mul", "sum")]
                nodes = [n for n in nodes if not has_reduction(n)]
                roots = (*nodes, *(a for n in nodes for a in n.args))
                if not nodes:
                    continue
                values = over(kernel.nest, roots, lambda n, a: self._leaf(n, a, point))
                rest = iter(values[len(nodes) :])
                # the first whose arguments are finite and whose value is not
                for node, value in zip(nodes, values[: len(nodes)], strict=True):
                    arguments = [next(rest) for _ in node.args]
                    wrong = ~np.isfinite(value) if infinite else np.isnan(value)
                    bad = np.flatnonzero(wrong & np.all([np.isfinite(a) for a in arguments], axis=0))
                    if bad.size:
                        return summand.row, node, [float(a[bad[0]]) for a in arguments]
        return None

    def entries(self, block: str, order: int, t: float, y: Array, yd: Array) -> tuple[Array, Array, Array]:
        """(v, rows, columns) of dy (order 0) or dyd (order 1) in the order of the contract."""
        found: list[tuple[Array, Array, Array]] = []
        for kernel in self._kernels(block):
            kernel = self._written_out(kernel)
            parts = [self._entry(kernel, k, column, (t, y, yd)) for k, column in _columns(kernel, order)]
            if parts:
                found.append(tuple(np.stack(p, axis=1).ravel() for p in zip(*parts, strict=True)))  # type: ignore[arg-type]
        if not found:
            return np.zeros(0), np.zeros(0), np.zeros(0)
        v, rows, columns = (np.concatenate(p) for p in zip(*found, strict=True))
        return v, rows, columns

    def _entry(self, kernel: LoopKernel, k: int, column: Node, point: Point) -> tuple[Array, Array, Array]:
        """One entry of a Jacobian over a kernel's iterations: values, rows and columns."""
        summand = kernel.rows[k]
        family = self._families[column.data[0], column.data[1]]
        slope = derivative(summand.expression, column)
        roots = (*summand.at, *column.args, slope)
        *at, values = over(kernel.nest, roots, lambda n, a: self._leaf(n, a, point))
        cut = len(summand.at)
        row = self.to[summand.row] + self._position(self.binding.row_shapes[summand.row], at[:cut])
        place = self.at[family] + self._position(self.binding.shapes[family], at[cut:])
        shape = values.shape
        return values, np.broadcast_to(row, shape).astype(float), np.broadcast_to(place, shape).astype(float)

    def _written_out(self, kernel: LoopKernel) -> LoopKernel:
        """The kernel with each min, max and product over a range written out: only of sums there are slopes."""
        rows = tuple(replace(s, expression=self._elements(s.expression)) for s in kernel.rows)
        return kernel if rows == kernel.rows else replace(kernel, rows=rows)

    def _elements(self, root: Node) -> Node:
        """An expression whose products and extrema over ranges are written out, as derivatives want them; sums stay."""
        done: dict[Node, Node] = {}
        for node in topological_unbound([root]):
            args = tuple(done.get(a, a) for a in node.args)
            done[node] = rebuild(node, args)
            if node.op != "reduce":
                continue
            bounds, body, name = node.args[:2], self._elements(node.args[2]), index(node.data[1])
            done[node] = rebuild(node, (*args[:2], body))
            if node.data[0] == "sum" or any(n.op == "index" for n in topological(bounds)):
                continue
            first, last = (round(float(v[0])) for v in over((), bounds, self.binding.parameters.lookup))
            parts = [substitute(body, {name: const(float(k))}) for k in range(first, last + 1)]
            done[node] = combine_terms(node.data[0], parts)
        return done[root]

    def _kernels(self, name: str) -> tuple[LoopKernel, ...]:
        block = self.form.block(name)
        return block.kernels if block is not None else ()

    def _position(self, box: Extents, at: list[Array]) -> NDArray[np.int64]:
        if not box:
            return np.zeros(1, dtype=np.int64)
        return positions(box, [np.rint(a).astype(np.int64) for a in at])

    def _leaf(self, node: Node, args: list[Value], point: Point) -> Value:
        """Value of a leaf at a point (t, y, y'): time, unknowns by place, constants of integrated rows, parameters."""
        t, y, yd = point
        if node.op == "time":
            return t
        # f, q, p or a rate: by its place in y or y'
        if node.op == "var":
            owner, kind, order = node.data
            family = self._families[owner, kind]
            box = self.binding.shapes[family]
            whole = [np.rint(a).astype(np.int64) for a in args]
            place = self.at[family] + (positions(box, whole) if box else 0)
            return (yd if order else y)[place]
        # the constant of an integrated row, which no text gives
        if node.op == "param" and node.data in self._constants:
            label, values = self._constants[node.data]
            owners = {r.owner: self.binding.row_shapes[k] for k, r in enumerate(self.form.rows) if r.block == "phi"}
            whole = [np.rint(a).astype(np.int64) for a in args]
            return values[positions(owners[label], whole)] if args else values[0]
        return self.binding.parameters.lookup(node, args)


def _columns(kernel: LoopKernel, order: int) -> list[tuple[int, Node]]:
    found = []
    for k, summand in enumerate(kernel.rows):
        nodes = (n for n in variables(summand.expression) if n.op == "var" and n.data[2] == order)
        for column in sorted(nodes, key=lambda n: n.number):
            if column.data[1] != "audit" and not is_const(derivative(summand.expression, column), 0.0):
                found.append((k, column))
    return found
