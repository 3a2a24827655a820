"""Connected components of a pattern."""

from __future__ import annotations

import numpy as np
from sysdyn.runtime.model.description import Ints, Places


def components(row: Places, column: Places, unknowns: int) -> Ints:
    """Connected component of each column [unknowns] of a pattern: the least column in it.  Minima along rows, and of
    the components that they name, until nothing changes.
    """
    label = np.arange(unknowns, dtype=np.int32)
    least = np.full(int(row.max(initial=-1)) + 1, unknowns, dtype=np.int32)
    # each pass takes the least label along rows, then that of the component it names
    while True:
        before = label.copy()
        np.minimum.at(least, row, label[column])
        np.minimum.at(label, before[column], least[row])
        np.minimum.at(label, column, least[row])
        label = label[label]
        if (label == before).all():
            return label
