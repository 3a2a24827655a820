"""How often each row is differentiated until all rates follow: Pryce's offsets of the descriptor form.

    sigma_ij = highest derivative of unknown j in row i;   T = a transversal of largest sum
    the smallest c >= 0 and d with  d_j - c_i >= sigma_ij,  equal on T;   index = max c_i + (1 where some d_j = 0)

(Pryce: A simple structural analysis method for DAEs, BIT 41, 2001; book, 6.1: the index by repeated differentiation.)
Structure alone: an index by the values of entries may differ, so that the rows say where it comes from, not what it is.

Received: a form without families over ranges.  Returned: `Offsets`, None where no transversal is there.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.optimize import linear_sum_assignment
from sysdyn.compiler.equations.matrices import rows_of
from sysdyn.compiler.forms.descriptor import BESIDE, DescriptorForm
from sysdyn.dsl.model.expression import variables
from sysdyn.values import dataclass

NEVER = -1e6
"""Of an unknown that a row does not hold."""
BLOCKS = ("dynamics", "momentum", "phi", "psi", "gamma", "lambda")


@dataclass(frozen=True, slots=True)
class Offsets:
    """differentiated: (kind of row, owner, times) of rows that are; once_more: (owner, kind) of unknowns whose rates
    appear only when all rows are differentiated once more; index by structure.
    """

    differentiated: tuple[tuple[str, str, int], ...]
    once_more: tuple[tuple[str, str], ...]
    index: int


def offsets(form: DescriptorForm) -> Offsets | None:
    """The offsets of all rows, q' = f among them.  Raises NoSuchEquations for families over ranges."""
    unknowns = [(f.owner, f.kind) for f in form.families if f.kind not in BESIDE]
    place = {name: k for k, name in enumerate(unknowns)}
    names: list[tuple[str, str]] = []
    orders: list[dict[int, int]] = []
    # q' = f is a row of the structure
    for owner, kind in unknowns:
        if kind == "q":
            names.append(("kinematic", owner))
            orders.append({place[owner, "q"]: 1, place[owner, "f"]: 0})
    # the highest derivative of each unknown in each row: Pryce's signature matrix
    for row in rows_of(form, *BLOCKS):
        held: dict[int, int] = {}
        for node in variables(row.expression):
            if node.op == "var" and node.data[:2] in place:
                k = place[node.data[:2]]
                held[k] = max(held.get(k, 0), node.data[2])
        names.append((row.block, row.owner))
        orders.append(held)
    if len(orders) != len(unknowns):
        return None
    # its canonical offsets; none where it is singular
    c, d = _canonical_offsets(orders, len(unknowns)) or (None, None)
    if c is None or d is None:
        return None
    found = tuple((*name, int(times)) for name, times in zip(names, c, strict=True) if times)
    late = tuple(name for name, order in zip(unknowns, d, strict=True) if order == 0)
    return Offsets(found, late, max(c, default=0) + bool(late))


def _canonical_offsets(orders: Sequence[dict[int, int]], n: int) -> tuple[list[int], list[int]] | None:
    """Offsets of rows and of unknowns."""
    sigma = np.full((n, n), NEVER)
    for i, held in enumerate(orders):
        for j, order in held.items():
            sigma[i, j] = order
    # a transversal of largest sum
    rows, columns = linear_sum_assignment(sigma, maximize=True)
    if sigma[rows, columns].min(initial=0.0) < 0.0:
        return None
    c = np.zeros(n)
    # the least c and d that satisfy d_j - c_i >= sigma_ij, equal along it
    while True:
        d = (sigma + c[:, None]).max(axis=0)
        more = d[columns] - sigma[rows, columns]
        if np.array_equal(more, c):
            return [int(v) for v in c], [int(v) for v in d]
        c = more
