"""The last good state of a run that stopped, in the author's names and units, and what it says of the cause."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable
from typing import Any

import numpy as np
from numpy.typing import NDArray
from sysdyn.cli.run.prepare import Prepared
from sysdyn.compiler.model.interpret import evaluate
from sysdyn.dsl.elaborate.scenes.stopping import RANGE
from sysdyn.dsl.model import expression as ex
from sysdyn.dsl.model.calculus import derivative
from sysdyn.dsl.model.expression import Node
from sysdyn.dsl.model.expression_text import to_text
from sysdyn.dsl.model.network import Constraint
from sysdyn.dsl.text.diagnostics import ModelError, Place
from sysdyn.runtime.model.system import System
from sysdyn.runtime.numerics.rank import singular_decomposition

SHOWN = 4
"""Unknowns of the last good state that a finding lists."""
STATE = ("q", "f", "p", "s")
GROWN = 1e6
"""Times its size at the start, and more than that in SI units: no motion that was meant."""
LOST = 1e-3
"""Least singular value of the gradients of constraints, of that at the start: less is a rank that is lost."""
MANY = 50
"""Constraints and coordinates of which the gradients are looked at."""
SMALL = 1e-6
"""Of its size at the start: a divisor that has nearly vanished."""


class LastState:
    """What is known at the last good point: values by name, with units."""

    def __init__(self, prepared: Prepared, system: System, time: float, y: NDArray[np.float64]) -> None:
        self.prepared, self.system, self.time, self.y = prepared, system, time, y
        network = prepared.network
        self._elements = {b.name for b in network.branches} | {n.name for n in network.nodes}
        self._at = {
            (f.owner, f.kind): int(first) for f, first in zip(system.description.families, system.form.at, strict=False)
        }

    def value_text(self, k: int) -> str:
        """`x' = 4 m/s`."""
        unit = self.system.description.families[int(self.system.family_of[k])].unit
        return f"{self.name(k)} = {self.y[k]:.6g}{'' if unit == '1' else f' {unit}'}"

    def name(self, k: int) -> str:
        """An unknown as the author reads it: `x'`, and `C.q` of an element or a node."""
        name = str(self.system.unknown_names[k])
        base = name.removesuffix("'")
        kind = str(self.system.kinds[k])
        return f"{base}.{kind}" if re.sub(r"\[.*", "", base) in self._elements and kind in STATE else name

    def states(self) -> list[int]:
        """Places of the unknowns that make the state."""
        number = min(len(self.system.unknown_names), self.y.size)
        names = self.system.unknown_names
        return [k for k in range(number) if self.system.kinds[k] in STATE and RANGE not in names[k]]

    def some_values(self) -> str:
        """A few unknowns."""
        return ", ".join(self.value_text(k) for k in self.states()[:SHOWN])

    def values_read(self, node: Node) -> list[str]:
        """The unknowns that an expression reads, with their values."""
        found = (self._place(n) for n in ex.variables(node))
        return [self.value_text(k) for k in dict.fromkeys(k for k in found if k is not None)]

    def _place(self, node: Node) -> int | None:
        """Where a variable without indices stands in y."""
        if node.op != "var" or node.args:
            return None
        family, kind, order = node.data
        if (kind, order) == ("q", 1):
            kind = "f"
        k = self._at.get((family, kind))
        return k if k is not None and k < self.y.size else None

    def value(self, node: Node, y: NDArray[np.float64] | None = None) -> float:
        """The value of an expression of unknowns without indices; no number where it has others, or loop variables."""
        where = self.y if y is None else y

        def lookup(n: Node, arguments: list[Any]) -> Any:
            if n.op == "time":
                return float(self.time)
            if n.op == "var":
                k = self._place(n)
                return math.nan if k is None else float(where[k])
            return self.prepared.binding.parameters.lookup(n, arguments)

        try:
            with np.errstate(all="ignore"):
                return float(evaluate([node], lookup)[0])
        except (ArithmeticError, KeyError, ValueError, TypeError, ModelError):
            return math.nan

    def unbounded_growth(self, start: NDArray[np.float64]) -> str | None:
        """The unknown that has grown beyond all bounds since the start."""
        states = self.states()
        size = np.abs(self.y[states]) / np.maximum(np.abs(start[states]), 1.0)
        if not states or not size.max() > GROWN:
            return None
        return f"{self.value_text(states[int(np.argmax(size))])} grows without bound"

    def vanishing(self, start: NDArray[np.float64]) -> str | None:
        """A divisor that has nearly vanished since the start."""
        for expression, _ in self._statements():
            for node in ex.topological([expression]):
                inner = [a for a, e in zip(node.args, node.data, strict=True) if e < 0] if node.op == "mul" else ()
                called = [node.args[0]] if node.op == "call" and node.data in ("ln", "log10") else ()
                for base in (*inner, *called):
                    now, before = self.value(base), self.value(base, start)
                    if abs(now) < SMALL * abs(before):
                        what = "the argument of a logarithm" if called else "a divisor"
                        itself = base.op == "var" and self._place(base) is not None
                        value = "" if itself else f"{to_text(base)} = {now:.3g}, "
                        return f"{what} goes to zero: {value}{', '.join(self.values_read(base)[:2])}"
        return None

    def dependent(self, start: NDArray[np.float64] | None = None) -> list[Constraint]:
        """Constraints whose gradients have become dependent here (start: that were not at the start); [] where the
        gradients are not known, or not dependent.
        """
        found = [c for c in self.prepared.network.constraints if c.kind in ("phi", "psi") and not c.loops]
        names = [c.name for c in self.prepared.network.coordinates if not c.shape]
        # arrays and large models are not judged
        if not 0 < len(found) <= MANY or not 0 < len(names) <= MANY:
            return []

        def gradients(y: NDArray[np.float64]) -> NDArray[np.float64]:
            by = {"phi": [[ex.var(n, "q")] for n in names]}
            by["psi"] = [[ex.var(n, "q", order=1), ex.var(n, "f")] for n in names]
            rows = [[sum(self.value(derivative(c.expression, v), y) for v in vs) for vs in by[c.kind]] for c in found]
            # normed gradients: their smallest singular value tells the distance from dependence
            j = np.array(rows)
            return np.asarray(j / np.maximum(np.linalg.norm(j, axis=1, keepdims=True), 1e-300))

        j = gradients(self.y)
        if not np.isfinite(j).all():
            return []
        left, sizes, _ = singular_decomposition(j)
        least = sizes[-1] if len(found) <= len(names) else 0.0
        before = 1.0 if start is None else singular_decomposition(gradients(start))[1][-1]
        if not least < LOST * before:
            return []
        # the constraints that take part in the combination
        weights = np.abs(left[:, -1])
        return [c for c, w in zip(found, weights, strict=True) if w > 0.1 * weights.max()]

    def _statements(self) -> Iterable[tuple[Node, Place]]:
        network = self.prepared.network
        yield from ((e.expression, e.place) for e in network.energies)
        yield from ((w.effort, w.place) for w in network.works)
        yield from ((d.expression, d.place) for d in network.dynamics)
        yield from ((c.expression, c.place) for c in network.constraints)

    def statement(self, unknown: str) -> Place | None:
        """The energy, work or dynamic that drives an unknown the most; None where none is known to."""
        base = re.sub(r"\[.*", "", unknown.removesuffix("'"))
        network = self.prepared.network
        # a state has its own dynamic
        for d in network.dynamics:
            if d.state.data[0] == base:
                return d.place
        position = ex.var(base, "q")
        moves = (position, ex.var(base, "q", order=1), ex.var(base, "f"))
        found: list[tuple[float, Place]] = []
        # the size of what each statement contributes
        for e in network.energies:
            if not e.loops:
                found += [(abs(self.value(derivative(e.expression, v))), e.place) for v in moves]
        for w in network.works:
            if not w.loops:
                found.append((abs(self.value(ex.mul(w.effort, derivative(w.on, position)))), w.place))
        known = [item for item in found if math.isfinite(item[0]) and item[0] > 0.0]
        # a momentum says what moves, not why
        forces = [item for item in known if item[1] not in {e.place for e in network.energies if e.function == "T*"}]
        return max(forces or known, key=lambda item: item[0], default=(0.0, None))[1]
