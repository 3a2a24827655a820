"""Rows of a descriptor form from its nodes at a few points, by sample: what a compiled module must give there.

All points are evaluated at once, every expression of a kernel with the ones that it shares; of a kernel with many
iterations only those are evaluated that a few chosen rows are made of.  No slot, routine or printed text of the
module takes part: it is the interpreter's word against the compiler's.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from sysdyn.compiler.binding.binding import Binding
from sysdyn.compiler.binding.places import starts
from sysdyn.compiler.forms.descriptor import Block, DescriptorForm, LoopKernel
from sysdyn.compiler.model.interpret import Value, evaluate, grid
from sysdyn.compiler.model.magnitudes import magnitudes
from sysdyn.compiler.model.parameters import Extents, positions
from sysdyn.compiler.model.terms import has_reduction
from sysdyn.dsl.model.expression import Node, const, topological
from sysdyn.values import dataclass

Array = NDArray[np.float64]
Whole = NDArray[np.int64]

MOST = 48
"""Iterations of a kernel that are evaluated whole; of more, the rows of MOST of them."""
LONG = 1000
"""Iterations of a kernel whose rows are left out where they hold sums inside: each would be a loop of ours."""


@dataclass(frozen=True, slots=True)
class Points:
    """t [points], y and yd [points, unknowns in the order of the form's families]."""

    t: Array
    y: Array
    yd: Array


@dataclass(frozen=True, slots=True)
class Sample:
    """Of one block: rows [k] in the order of the form's row families, value and the sum of the magnitudes of its terms
    [points, k].
    """

    rows: Whole
    value: Array
    size: Array


class SampledRows:
    """A descriptor form under a binding; at, to: where its families of unknowns and of rows begin."""

    def __init__(self, form: DescriptorForm, binding: Binding) -> None:
        self.form, self.binding = form, binding
        self.at, self.to = starts(binding.shapes), starts(binding.row_shapes)
        self._families = {(f.owner, f.kind): k for k, f in enumerate(form.families)}
        phi = {r.owner: binding.row_shapes[k] for k, r in enumerate(form.rows) if r.block == "phi"}
        self._constants = {
            offset.name: (phi[offset.label], binding.p[first : first + count])
            for (_, first, count), offset in zip(binding.offsets, form.offsets, strict=True)
        }

    def sample(self, block: Block, points: Points, *, careful: bool = False) -> Sample:
        """The rows of a block at the points; careful: sizes count the terms of what cancels inside of terms, too."""
        places = [self._places(kernel) for kernel in block.kernels]
        kept = self._chosen(block, places)
        found = np.flatnonzero(kept)
        sample = Sample(found, *(np.zeros((points.t.size, found.size)) for _ in range(2)))
        for kernel, (columns, rows) in zip(block.kernels, places, strict=True):
            self._add(kernel, columns, rows, kept, points, sample, careful)
        return sample

    def _places(self, kernel: LoopKernel) -> tuple[dict[str, Array], list[Whole]]:
        """Loop variables over all iterations, and the row of each summand there."""
        columns = grid(kernel.nest, self.binding.parameters.lookup)
        count = len(next(iter(columns.values()))) if columns else 1
        found = []
        for summand in kernel.rows:
            at = evaluate(summand.at, lambda n, a: self._index(n, a, columns))
            where = self._position(self.binding.row_shapes[summand.row], at)
            found.append(np.broadcast_to(self.to[summand.row] + where, count))
        return columns, found

    def _chosen(self, block: Block, places: Sequence[tuple[dict[str, Array], list[Whole]]]) -> NDArray[np.bool_]:
        """Rows that are compared: of short kernels all, of long ones those of MOST iterations, its ends among them."""
        kept = np.zeros(int(self.to[-1]), dtype=bool)
        left = np.zeros(kept.size, dtype=bool)
        for kernel, (_, rows) in zip(block.kernels, places, strict=True):
            for summand, where in zip(kernel.rows, rows, strict=True):
                some = where if where.size <= MOST else where[np.linspace(0, where.size - 1, MOST).astype(np.int64)]
                kept[some] = True
                if has_reduction(summand.expression):
                    left[where] |= where.size * self._longest(summand.expression) > LONG
        return kept & ~left

    def _longest(self, expression: Node) -> int:
        """Most iterations of a sum inside, where its bounds are of parameters; else more than any."""
        longest = 1
        for node in topological([expression]):
            if node.op == "reduce":
                if any(n.op in ("index", "var", "time") for n in topological(node.args[:2])):
                    return LONG + 1
                low, high = evaluate(node.args[:2], self.binding.parameters.lookup)
                longest *= max(int(high - low) + 1, 1)
        return longest

    def _add(
        self,
        kernel: LoopKernel,
        columns: dict[str, Array],
        rows: list[Whole],
        kept: NDArray[np.bool_],
        points: Points,
        sample: Sample,
        careful: bool,
    ) -> None:
        """What a kernel adds to the rows kept, at all points: iterations times points in one array."""
        wanted = np.zeros(rows[0].size, dtype=bool) if rows else np.zeros(0, dtype=bool)
        # iterations that add to a row which is sampled
        for where in rows:
            wanted |= kept[where]
        some = np.flatnonzero(wanted)
        if not some.size:
            return
        number, count = points.t.size, some.size
        inside = {name: np.tile(values[some], number) for name, values in columns.items()}
        which = np.repeat(np.arange(number), count)
        # term by term, so that the size of a row is that of its terms
        scaled = [(k, c, term) for k, s in enumerate(kernel.rows) for c, term in _terms(s.expression)]
        roots = [term for _, _, term in scaled]

        def lookup(node: Node, args: list[Value]) -> Value:
            return self._leaf(node, args, inside, which, points)

        found = evaluate(roots, lookup)
        sizes = magnitudes(roots, lookup, self.binding.parameters.table_size) if careful else found
        # several iterations may add to one row
        for (k, c, _), result, large in zip(scaled, found, sizes, strict=True):
            own = np.flatnonzero(kept[rows[k][some]])
            where = np.searchsorted(sample.rows, rows[k][some[own]])
            value, size = c * np.asarray(result, dtype=float), np.abs(c * np.asarray(large))
            with np.errstate(over="ignore", invalid="ignore"):  # a point may lie where terms overflow
                for target, array in ((sample.value, value), (sample.size, size)):
                    if count == 1:
                        target[:, where] += np.broadcast_to(array, number)[:, None]
                        continue
                    spread = np.broadcast_to(array, number * count).reshape(number, count)
                    for p in range(number):
                        np.add.at(target[p], where, spread[p][own])

    def _index(self, node: Node, args: list[Value], columns: dict[str, Array]) -> Value:
        if node.op == "index":
            return columns[node.data]
        return self.binding.parameters.lookup(node, args)

    def _position(self, box: Extents, at: Sequence[Value]) -> Whole:
        if not box or not at:
            return np.zeros(1, dtype=np.int64)
        return positions(box, [np.atleast_1d(np.rint(a).astype(np.int64)) for a in at])

    def _leaf(self, node: Node, args: list[Value], columns: dict[str, Array], which: Whole, points: Points) -> Value:
        """Value of a leaf at every iteration and point: loop variables, time, unknowns, constants, parameters."""
        if node.op == "index" and node.data in columns:
            return columns[node.data]
        if node.op == "time":
            return points.t[which]
        # f, q, p or a rate: by its place in y or y' of the point
        if node.op == "var":
            owner, kind, order = node.data
            family = self._families[owner, kind]
            place = self.at[family] + self._position(self.binding.shapes[family], args)
            return (points.yd if order else points.y)[which, np.broadcast_to(place, which.shape)]
        # the constant of an integrated row, which no text gives
        if node.op == "param" and node.data in self._constants:
            box, values = self._constants[node.data]
            return values[self._position(box, args)] if args else values[0]
        return self.binding.parameters.lookup(node, args)


def _terms(node: Node) -> list[tuple[float, Node]]:
    """(coefficient, node) of the top-level terms; a constant among them."""
    if node.op != "sum":
        return [(1.0, node)]
    constant, coefficients = node.data
    own = [(c, a) for c, a in zip(coefficients, node.args, strict=True)]
    return [*own, (constant, const(1.0))] if constant else own
