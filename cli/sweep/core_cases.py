"""Cases of a sweep run in the core without Python between them, where the model allows it (cli/run/many/in_core.py)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray
from sysdyn.cli.run.many.in_core import InCore
from sysdyn.cli.run.many.reusable_model import Loaded
from sysdyn.cli.sweep.run_records import KeptRuns
from sysdyn.dsl.model import expression as ex
from sysdyn.dsl.text.diagnostics import ModelError, Report
from sysdyn.runtime.accuracy.options import instants
from sysdyn.runtime.integrate.request import TRACE
from sysdyn.runtime.many.asked import DONE, END, EXTREMA, TRACES, NotApplicableError

Floats = NDArray[np.float64]
KEEPS = {"end": END, "extrema": EXTREMA, "traces": TRACES}
ROWS = 256
"""Of a thinned trace at most."""


def thin_instants(begin: float, step: float, time: Floats) -> tuple[Floats, NDArray[np.int64]]:
    """Every k-th instant of an interval, and for each the place among `time` of the last row before what follows it."""
    number = round((float(time[-1]) - begin) / step)
    grid = begin + step * np.arange(0, number + 1, -(-(number + 1) // ROWS))
    place = np.clip(np.searchsorted(time, grid + 1e-9 * step, side="right") - 1, 0, None)
    return np.asarray(grid, dtype=np.float64), place


class Cases:
    """Runs of one text in the core.  NotApplicableError where they cannot be made that way, with the reason."""

    def __init__(self, loaded: Loaded, names: Sequence[str], keep: str) -> None:
        if not names:
            raise NotApplicableError("no number varies")
        self._loaded = loaded
        numbers, texts = loaded._split(dict.fromkeys(names, 0.0))
        if texts:
            raise NotApplicableError(f"{texts[0][0]} is part of the text")
        self._keys: tuple[Any, ...] = tuple(numbers)
        self._names = tuple(names)
        self._prepared, self._compiled = loaded.bound({})
        with ex.fresh(self._compiled.nodes):
            self._set_up(KEEPS[keep])

    def _set_up(self, keep: int) -> None:
        """Prepare runs in the core: what varies, and which instants of traces are kept."""
        loaded, prepared, scene = self._loaded, self._prepared, self._prepared.network.scene
        self._core = InCore(loaded.request, loaded.target, prepared, lambda: loaded.run({}, Report()), keep)
        self._moving = self._core.moving(key if isinstance(key, str) else key[0] for key in self._keys)
        self.time, rows = np.zeros(0), np.zeros(0, dtype=np.int64)
        # at the scene's interval, thinned
        if keep == TRACES and scene is not None and scene.every is not None and scene.start is not None:
            times, kinds = instants(self._core.options)
            evaluate = prepared.binding.evaluate
            self.time, rows = thin_instants(evaluate(scene.start), evaluate(scene.every), times[(kinds & TRACE) > 0])
        self._core.set_up(rows)
        self._extrema = keep != END

    def run(self, numbers: Sequence[int], cases: Sequence[Mapping[str, Any]]) -> tuple[KeptRuns | None, list[int]]:
        """What is kept of the cases, and the places of those that need a run of their own."""
        values = np.array([[case[name] for name in self._names] for case in cases], dtype=np.float64)
        with ex.fresh(self._compiled.nodes):
            # numbers of all cases at once; those without are run one by one
            p, anchor, good = self._bound(values)
        good &= self._loaded.allowed_rows(self._keys, values)
        batch = self._core.batch
        # cases that the core does not finish are run again by themselves
        found = batch.run(p[good], anchor[good])
        done = found.state == DONE
        place = np.flatnonzero(good)
        left = sorted({*np.flatnonzero(~good).tolist(), *place[~done].tolist()})
        if not done.any():
            return None, left
        nothing = np.zeros((int(done.sum()), 0))
        block = KeptRuns(
            np.asarray(numbers, dtype=np.int64)[place[done]],
            batch.columns,
            self._core.method,
            found.estimate[done],
            np.asarray(found.steps[done], dtype=np.int64),
            found.cpu[done],
            found.end[done],
            found.least[done] if self._extrema else nothing,
            found.most[done] if self._extrema else nothing,
            self.time,
            found.traces[done] if self.time.size else np.zeros((int(done.sum()), 0, 0)),
        )
        return block, left

    def _bound(self, values: Floats) -> tuple[Floats, Floats, NDArray[np.bool_]]:
        """Numbers p [k, parameters], initial values [k, written], and which [k] make sense."""
        prepared = self._prepared
        found = None
        if not self._core.jumps & self._moving and all(isinstance(key, str) for key in self._keys):
            varied = {key: values[:, j] for j, key in enumerate(self._keys)}
            found = prepared.compiled.columns(prepared.binding, varied)
        if found is None:
            return self._one_by_one(values)
        anchor = self._anchors(found.starts, len(values))
        good = found.good & np.isfinite(found.p).all(axis=1) & np.isfinite(anchor).all(axis=1)
        for k in {0, len(values) - 1}:  # what is evaluated together is what is bound alone
            alone = self._numbers_of_run(values[k]) if good[k] else None
            if alone is not None and not (np.array_equal(alone[0], found.p[k]) and np.array_equal(alone[1], anchor[k])):
                return self._one_by_one(values)
            good[k] &= alone is not None
        return found.p, anchor, good

    def _anchors(self, starts: Sequence[tuple[Any, Floats]], number: int) -> Floats:
        """Initial values of all unknowns: a fixed one wins over a guess, a later statement over an earlier."""
        anchor = np.tile(self._core.guesses, (number, 1))
        fixed = np.zeros(self._core.written, dtype=bool)
        for start in self._prepared.binding.initial:
            if start.fixed:
                fixed[self._core.at[start.family] + start.positions] = True
        for start, column in starts:
            for place in (self._core.at[start.family] + start.positions).tolist():
                if start.fixed or not fixed[place]:
                    anchor[:, place] = column
        return anchor

    def _numbers_of_run(self, values: Floats) -> tuple[Floats, Floats] | None:
        """The numbers of one run by a binding of its own; None where it has another structure, or none."""
        try:
            binding = self._prepared.compiled.bind(dict(zip(self._keys, map(np.asarray, values), strict=True)))
        except ModelError:
            return None
        return self._core.numbers_of_run(binding, self._moving)

    def _one_by_one(self, values: Floats) -> tuple[Floats, Floats, NDArray[np.bool_]]:
        p = np.tile(self._prepared.binding.p, (len(values), 1))
        anchor, good = np.tile(self._core.guesses, (len(values), 1)), np.zeros(len(values), dtype=bool)
        for k, row in enumerate(values):
            alone = self._numbers_of_run(row)
            if alone is not None:
                p[k], anchor[k] = alone
                good[k] = True
        return p, anchor, good
