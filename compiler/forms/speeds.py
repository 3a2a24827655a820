"""EnergyModel -> Speeds: the quasi-velocities of a model as the unknown speeds u of Kane's form.

    C(q, t) f + c(q, t) = [0; u]     rows of C: the flow constraints, the quasi-velocities, flows that complete them
    f = S u + s                      the columns of C^-1 that belong to u, and the rest
    S^T (M f' + Phi_q^T kappa - Upsilon) = 0  with f' = (S u + s)'

(Kane, Levinson: Dynamics, 1985, 2.14 and 6.1; book, afterword).  The columns of S are the partial velocities.  C falls
into parts that share no flow; each is inverted by its minors, so that S is regular wherever the quasi-velocities are.
What is said of families over ranges stays in flows.
"""

from __future__ import annotations

import random
from collections.abc import Iterable, Mapping, Sequence
from itertools import combinations

from sysdyn.compiler.forms.minors import determinant, inverse
from sysdyn.compiler.model.energies import EnergyModel, TracedQuantity
from sysdyn.compiler.model.terms import local_variables
from sysdyn.dsl.model.calculus import derivative, signals_held
from sysdyn.dsl.model.evaluation import evaluate
from sysdyn.dsl.model.expression import (
    Node,
    add,
    const,
    is_const,
    mul,
    neg,
    sub,
    substitute,
    topological,
    var,
    variables,
)
from sysdyn.dsl.text.diagnostics import Diagnostic, ModelError, Place
from sysdyn.values import dataclass

LARGEST = 6
"""Flows of one part: its minors are written out."""
DRAWN = 3
"""Random points at which ranks are looked at; the highest counts."""


@dataclass(frozen=True, slots=True)
class Speed:
    """An unknown speed: its name, its unit, and what it is in flows."""

    name: str
    unit: str
    expression: Node
    place: Place | None


@dataclass(frozen=True, slots=True)
class Speeds:
    """speeds: the unknowns u; columns: S by speed and coordinate; rest: s by coordinate; left_out: flow constraints
    that hold by f = S u + s.
    """

    speeds: tuple[Speed, ...]
    columns: Mapping[str, Mapping[str, Node]]
    rest: Mapping[str, Node]
    left_out: frozenset[str]

    def flow(self, coordinate: str) -> Node:
        """S u + s of a coordinate."""
        terms = (mul(column[coordinate], var(u, "f")) for u, column in self.columns.items() if coordinate in column)
        return add(*terms, self.rest[coordinate])


@dataclass(frozen=True, slots=True)
class _Line:
    """A row of C with c; speed: the unknown on its right side, None of a flow constraint."""

    label: str
    entries: Mapping[str, Node]
    rest: Node
    speed: Speed | None


def speeds_of(model: EnergyModel, kept: frozenset[str]) -> Speeds:
    """The speeds of all parts that have a quasi-velocity and no flow constraint whose reaction is read (kept).

    A quasi-velocity that follows from those before it is left a name.  ModelError E607 of such a flow constraint.
    """
    scalars = [c.name for c in model.coordinates if not c.shape]
    lines = [*_constraints(model), *(line for q in model.speeds if (line := _quasi(q, scalars)) is not None)]
    found: list[Speed] = []
    columns: dict[str, Mapping[str, Node]] = {}
    rest: dict[str, Node] = {}
    left_out: set[str] = set()
    # each set of flows that constraints and quasi-velocities join
    for names, part in _parts(lines):
        labels = {line.label for line in part if line.speed is None}
        # left to Lagrange's multipliers
        if labels & kept or len(names) > LARGEST or not names <= set(scalars) or len(labels) == len(part):
            continue
        order = [name for name in scalars if name in names]
        # as many independent lines as flows, inverted: flows by speeds
        square = _complete_basis(model, part, order)
        inverted = inverse([[line.entries.get(name, const(0.0)) for name in order] for line in square])
        for k, line in enumerate(square):
            if line.speed is not None:
                found.append(line.speed)
                column = {name: inverted[j][k] for j, name in enumerate(order)}
                columns[line.speed.name] = {n: v for n, v in column.items() if not is_const(v, 0.0)}
        # the part of a flow that does not depend on speeds
        for j, name in enumerate(order):
            rest[name] = neg(add(*(mul(inverted[j][k], line.rest) for k, line in enumerate(square))))
        left_out |= labels
    declared = {q.name: k for k, q in enumerate(model.speeds)}
    found.sort(key=lambda speed: declared.get(speed.name, len(declared)))
    return Speeds(tuple(found), {u.name: columns[u.name] for u in found}, rest, frozenset(left_out))


def _constraints(model: EnergyModel) -> Iterable[_Line]:
    for row in model.of_kind("psi"):
        entries: dict[str, Node] = {}
        whole = add(*(t.expression for t in row.terms))
        held, signals = signals_held(whole)
        flows = local_variables(held, "f")
        for flow in flows:
            entries[flow.data[0]] = substitute(derivative(held, flow), signals)
        rest = substitute(whole, dict.fromkeys(local_variables(whole, "f"), const(0.0)))
        yield _Line(row.name, entries, rest, None)


def _quasi(q: TracedQuantity, scalars: Sequence[str]) -> _Line | None:
    flows = local_variables(q.expression, "f")
    if any(n.data[0] not in scalars for n in flows) or any(n.op == "reduce" for n in topological([q.expression])):
        return None
    entries = {n.data[0]: derivative(q.expression, n) for n in flows}
    rest = substitute(q.expression, dict.fromkeys(flows, const(0.0)))
    return _Line(q.name, entries, rest, Speed(q.name, q.unit, q.expression, q.place))


def _parts(lines: Sequence[_Line]) -> list[tuple[set[str], list[_Line]]]:
    """Lines that share flows, with these."""
    found: list[tuple[set[str], list[_Line]]] = []
    for line in lines:
        names, own = set(line.entries), [line]
        apart = []
        for part in found:
            if part[0] & names:
                names, own = names | part[0], part[1] + own
            else:
                apart.append(part)
        found = [*apart, (names, own)]
    return found


def _complete_basis(model: EnergyModel, part: Sequence[_Line], order: Sequence[str]) -> list[_Line]:
    """The lines and as many flows as make them a square of full rank."""
    units = {c.name: c for c in model.coordinates}
    square: list[_Line] = []
    for line in sorted(part, key=lambda line: line.speed is not None):
        if _rank([*square, line], order) == len(square):
            if line.speed is not None:
                continue  # a name for what is known
            place = next(r.place for r in model.of_kind("psi") if r.name == line.label)
            message = f"formulation kane: psi {line.label} follows from the others"
            raise ModelError((Diagnostic("E607", message, place, "formulation lagrangian, hamiltonian"),))
        square.append(line)
    flows = [
        _Line(f"u.{name}", {name: const(1.0)}, const(0.0), Speed(f"u.{name}", units[name].units["f"], var(name, "f"),
        units[name].place)) for name in order
    ]  # fmt: skip
    choices = [[*square, *more] for more in combinations(flows, len(order) - len(square))]
    return min((c for c in choices if _rank(c, order) == len(order)), key=lambda c: _size(c, order))


def _size(square: Sequence[_Line], order: Sequence[str]) -> tuple[int, int]:
    """The determinant's size: first those that are numbers and parameters."""
    whole = determinant([[line.entries.get(name, const(0.0)) for name in order] for line in square])
    nodes = topological([whole])
    return sum(n.op not in ("const", "param") for n in nodes if not n.args), len(nodes)


def _rank(lines: Sequence[_Line], order: Sequence[str]) -> int:
    """The rank of lines at random values, the highest of some."""
    return max(_rank_at(lines, order, random.Random(k)) for k in range(DRAWN))


def _rank_at(lines: Sequence[_Line], order: Sequence[str], drawn: random.Random) -> int:
    """Rank of the lines' coefficients at a random point, by Gaussian elimination with pivoting in rows."""
    known: dict[Node, float] = {}
    roots = [line.entries.get(name, const(0.0)) for line in lines for name in order]
    values = evaluate(roots, lambda node: known.setdefault(node, drawn.uniform(0.3, 1.2)))
    wide = len(order)
    rows = [values[k * wide : (k + 1) * wide] for k in range(len(lines))]
    rank = 0
    for column in range(wide):
        pivot = max(range(rank, len(rows)), key=lambda k: abs(rows[k][column]), default=None)
        if pivot is None or abs(rows[pivot][column]) < 1e-9:
            continue
        rows[rank], rows[pivot] = rows[pivot], rows[rank]
        for k in range(rank + 1, len(rows)):
            factor = rows[k][column] / rows[rank][column]
            rows[k] = [a - factor * b for a, b in zip(rows[k], rows[rank], strict=True)]
        rank += 1
    return rank


def definition(speed: Speed, values: Mapping[Node, Node]) -> Node | None:
    """The speed at pinned values of displacements and flows; None where one of them is not pinned."""
    node = substitute(speed.expression, {n: values[n] for n in variables(speed.expression) if n in values})
    return None if any(n.op == "var" for n in variables(node)) else node


def kinematics(speeds: Speeds, coordinate: str) -> Node:
    """0 = f - S u - s."""
    return sub(var(coordinate, "f"), speeds.flow(coordinate))
