"""Where the entries of the mass matrix M stand in the matrices of a settled form (its sign: structure/inertia.py)."""

from __future__ import annotations

from typing import Any

import numpy as np
from sysdyn.runtime.many.asked import NotApplicableError
from sysdyn.runtime.model.description import Floats, Ints
from sysdyn.runtime.model.system import System
from sysdyn.runtime.structure.structure import DENSE
from sysdyn.values import dataclass


@dataclass(frozen=True, slots=True)
class MassMatrix:
    """M [flows, flows] by its entries: row, column; entry: place in the pattern; rate: 1 of dF/dy', 0 of dF/dy; sign:
    with which it counts.
    """

    flows: int
    row: Ints
    column: Ints
    entry: Ints
    rate: Ints
    sign: Floats


def mass_matrix(settled: System) -> MassMatrix:
    """The entries of a settled form; NotApplicableError where there are too many flows."""
    form = settled.form
    flows = np.flatnonzero(settled.kinds[: form.written] == "f")
    # M is dense in the core
    if flows.size > DENSE:
        raise NotApplicableError(f"more than {DENSE} flows")
    place = np.full(max(settled.unknowns, 1), -1, dtype=np.int64)
    # the place of each flow in M
    place[flows] = np.arange(flows.size)
    families = {f.owner: k for k, f in enumerate(settled.description.families) if f.kind == "f"}
    columns = settled.pattern.columns_of()
    parts: list[tuple[Any, Any, Any, int, float]] = []
    for group, family, first in form.groups:
        # balances and momenta of coordinates
        row = settled.description.rows[family]
        owner = families.get(row.owner)
        # other rows hold no inertia
        if group not in ("dynamics", "momentum") or owner is None:
            continue
        here = (settled.pattern.row >= first) & (settled.pattern.row < first + row.size)
        # entries by flows: dF/df' of a balance, dF/df of a momentum
        entries = np.flatnonzero(here & (place[columns] >= 0))
        number = place[form.at[owner] + (settled.pattern.row[entries] - first)]
        dynamic = group == "dynamics"
        parts.append((number, place[columns[entries]], entries, int(dynamic), 1.0 if dynamic else -1.0))
    sizes = [len(part[2]) for part in parts]

    def join_blocks(k: int) -> Any:
        return np.concatenate([np.zeros(0), *(np.asarray(part[k]) for part in parts)]).astype(np.int32)

    # by rates or values, and with which sign
    rate = np.repeat(np.array([p[3] for p in parts], dtype=np.int32), sizes)
    sign = np.repeat(np.array([p[4] for p in parts], dtype=float), sizes)
    return MassMatrix(flows.size, join_blocks(0), join_blocks(1), join_blocks(2), rate, sign)
