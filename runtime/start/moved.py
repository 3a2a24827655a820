"""Guesses of the text that a start does not meet: what they asked for, what became of it, which rows stand against it.

Of unknowns that are guessed by numbers, and of expressions by what their rows miss.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from sysdyn.runtime import tuning
from sysdyn.runtime.model.description import Floats
from sysdyn.runtime.start.starter import Starter

NOTED = tuning.SAME
"""Of its size: a move of a guess that is told."""
Moved = tuple[str, float, float, str]
"""Name, guess, value at the start, what asked for that."""


def _asked(starter: Starter, values: Floats, place: int) -> str:
    """Labels of the rows that an unknown stands in: of the one that it alone meets, where there is one, or of the
    constraints; guesses are none.
    """
    found: list[str] = []
    held = values != 0.0
    # rows that only guess say nothing
    guesses = starter.moves("unsaid") | starter.moves("slack")
    silent = starter.rows[guesses[starter.columns]]
    mine = starter.rows[(starter.columns == place) & held]
    beside = starter.rows[(starter.columns != place) & held & starter.free[starter.columns]]
    # constraints and initial values that it stands in
    for row in sorted(set(mine.tolist()).difference(silent.tolist())):  # without numpy.ma, 7 ms of a short command
        label = starter.settled.row_label(row)
        base = label.kind.split("_")[0]
        text = f"init of line {label.line}" if base == "initial" else f"{base} {label.label}"
        if base in ("phi", "psi", "gamma", "momentum", "initial") and text not in found:
            found.append(text)
        # a balance that nothing else meets
        if base == "dynamics" and not (beside == row).any():
            return f"asked for by {label.label}"
    return "asked for by " + ", ".join(found[:4]) if found else "asked for by the balance of efforts"


def moved_guesses(starter: Starter, t: float, x: Floats, scale: Floats) -> Iterator[Moved]:
    """Written guesses, of unknowns and by expressions, that the start does not meet."""
    guess, missed = starter.guess, starter.moves("slack")
    size = np.where(missed, scale, np.maximum(np.abs(guess), 1e-3 * scale))
    told = starter.written & starter.free & (np.abs(x - guess) > NOTED * size)
    if not told.any():
        return
    values = starter.jacobian(t, x)
    # expressions by what they miss, unknowns by name
    for place in np.flatnonzero(told)[:100].tolist():
        if missed[place]:
            yield _missed(starter, values, x, place)
        else:
            yield starter.settled.name(place), float(guess[place]), float(x[place]), _asked(starter, values, place)


def _missed(starter: Starter, values: Floats, x: Floats, place: int) -> Moved:
    """Name of what an expression guesses, its value, the start's.

    Where a row guesses several unknowns at once its label stands for them, and 0 for what it would miss.
    """
    row, miss = starter.rows[starter.columns == place][0], float(x[place])
    mine = (starter.rows == row) & (starter.columns != place) & (values != 0.0)
    own = np.flatnonzero(mine & ~starter.written[starter.columns])
    # one unknown alone: its own name
    if own.size == 1:
        k = int(starter.columns[own[0]])
        return starter.settled.name(k), float(x[k] - miss / values[own[0]]), float(x[k]), _asked(starter, values, k)
    label = starter.settled.row_label(int(row))
    return f"guess of line {label.line}", 0.0, miss, "what its two sides differ by"
