"""What rows without inertia say of displacements alone: their sums in which no flow and no force is left.

A damper behind a spring does not hold it once its other end is let go: each of the two balances has a flow that might
answer it, their sum has none.  Sums are left null vectors of rows in flows and forces that act; rows that have none by
themselves stand as they are (instant.py).

Received: rows, columns and values of dF/dy of settled rows; returned: `Hidden`.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray
from sysdyn.runtime.model.description import Floats
from sysdyn.runtime.model.facts import Mask
from sysdyn.runtime.numerics.equilibrate import factors
from sysdyn.runtime.numerics.least_change import DENSE
from sysdyn.runtime.numerics.rank import null_space
from sysdyn.runtime.start.integrated import BROKEN
from sysdyn.values import dataclass

Places = NDArray[np.signedinteger[Any]]


@dataclass(frozen=True, slots=True)
class Hidden:
    """weights [sums, rows]; the sums stand behind the rows."""

    weights: Floats

    def __len__(self) -> int:
        return len(self.weights)

    def of(self, values: Floats) -> Floats:
        """Sums of values [rows]."""
        return np.asarray(self.weights @ values)

    def entries(self, row: Places, column: Places, value: Floats) -> tuple[Places, Places, Floats]:
        """Row, column and value of the sums of entries."""
        total, at = np.nonzero(self.weights[:, row])
        return self.weights.shape[1] + total, column[at], self.weights[total, row[at]] * value[at]


def hidden(entries: tuple[Places, Places, Floats], rows: Mask, answers: Mask, asked: Mask) -> Hidden | None:
    """Sums of rows [rows] in which none of what answers [unknowns] is left, but something of what is asked [unknowns];
    None: there is none, or the rows are too many to look.
    """
    i, j, v = entries
    # entries of what answers: flows and forces
    mine = rows[i] & answers[j] & (v != 0.0)
    (own, row), (other, column) = (np.unique(item[mine], return_inverse=True) for item in (i, j))
    # nothing answers, or too many rows
    if not own.size or max(own.size, other.size) > DENSE:
        return None
    matrix = np.zeros((own.size, other.size))
    np.add.at(matrix, (row, column), v[mine])
    by_row, by_column = factors(matrix)
    # sums of rows in which no answer is left
    found = null_space((by_row[:, None] * matrix * by_column).T).T
    weights = np.zeros((len(found), rows.size))
    weights[:, own] = np.where(np.abs(found) > BROKEN, found, 0.0) * by_row
    # of these, sums in which something asked is left
    read = np.flatnonzero(asked[j] & (v != 0.0))
    left, terms = np.zeros((2, len(found), asked.size))
    for k, weight in enumerate(weights):
        part = weight[i[read]] * v[read]
        np.add.at(left[k], j[read], part)
        np.add.at(terms[k], j[read], np.abs(part))
    weights = weights[(np.abs(left) > BROKEN * terms).any(axis=1)]
    return Hidden(weights) if len(weights) else None
