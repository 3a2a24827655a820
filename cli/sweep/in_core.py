"""Cases of a sweep run in the core without Python between them, where the model allows it.

That is where they differ in numbers alone, nothing happens at instants of its own (events, jumps of the text), and the
rows fix the start but for what the text gives.  What a run needs that this way does not have (a structure of its own,
another method, a reason for what it missed) is left to a run on its own.
"""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from sysdyn.cli.run.loaded import Loaded
from sysdyn.cli.run.prepare import Prepared
from sysdyn.cli.run.running import options_of, stops
from sysdyn.cli.sweep.kept import Block
from sysdyn.compiler.binding.binding import Binding
from sysdyn.compiler.binding.columns import Read, following
from sysdyn.dsl.model import expression as ex
from sysdyn.dsl.text.diagnostics import ModelError, Report
from sysdyn.runtime.integrate.options import Options, instants
from sysdyn.runtime.integrate.request import TRACE
from sysdyn.runtime.many.anchors import guesses
from sysdyn.runtime.many.batch import DONE, END, EXTREMA, TRACES, Batch, Claim, NotApplicableError, way_of
from sysdyn.runtime.model.failures import SolverFailure

Floats = NDArray[np.float64]
KEEPS = {"end": END, "extrema": EXTREMA, "traces": TRACES}
ROWS = 256
"""Of a thinned trace at most."""


def thinned(begin: float, step: float, time: Floats) -> tuple[Floats, NDArray[np.int64]]:
    """Every k-th instant of an interval, and for each the place among `time` of the last row before what follows it."""
    number = round((float(time[-1]) - begin) / step)
    grid = begin + step * np.arange(0, number + 1, -(-(number + 1) // ROWS))
    place = np.clip(np.searchsorted(time, grid + 1e-9 * step, side="right") - 1, 0, None)
    return np.asarray(grid, dtype=np.float64), place


class InCore:
    """Runs of one text in the core.  NotApplicableError where they cannot be made that way, with the reason."""

    def __init__(self, loaded: Loaded, names: Sequence[str], keep: str) -> None:
        self._loaded = loaded
        numbers, texts = loaded._split(dict.fromkeys(names, 0.0))
        if texts:
            raise NotApplicableError(f"{texts[0][0]} is part of the text")
        if loaded.first.prepared.backend != "c":
            raise NotApplicableError("the model is not compiled to C")
        self._keys: tuple[Any, ...] = tuple(numbers)
        self._names = tuple(names)
        self._prepared, self._compiled = loaded.bound({})
        with ex.fresh(self._compiled.nodes):
            self._set_up(KEEPS[keep])

    def _set_up(self, keep: int) -> None:
        prepared = self._prepared
        options = self._options(prepared)
        report = Report()
        try:
            ran = self._loaded.run({}, report)
        except (ModelError, SolverFailure) as error:
            raise NotApplicableError(f"the text's own numbers do not run: {error}") from error
        if ran is None or ran.exit or not ran.outcome.met:
            raise NotApplicableError("the text's own numbers do not run, or are not met")
        started, self.method = ran.started, ran.outcome.method
        claims = _claims(prepared)
        way, start = way_of(started.system, started.state, started.facts, options, self.method)
        if started.system.description.rows_of("initial"):
            raise NotApplicableError("an initial value is no unknown of this formulation")
        scene = prepared.network.scene
        self.time, rows = np.zeros(0), np.zeros(0, dtype=np.int64)
        if keep == TRACES and scene is not None and scene.every is not None and scene.start is not None:
            times, kinds = instants(options)
            evaluate = prepared.binding.evaluate
            self.time, rows = thinned(evaluate(scene.start), evaluate(scene.every), times[(kinds & TRACE) > 0])
        free = not any(
            node.op == "time"
            for block in prepared.compiled.form.blocks
            for kernel in block.kernels
            for row in kernel.rows
            for node in ex.topological([row.expression])
        )
        # a structure of its own: other runs of the same text write into theirs
        way = replace(way, system=way.system.another(way.system.form.name))
        kept = END if keep == END else EXTREMA if not rows.size else TRACES
        self._batch = Batch(way, start, options, keep=kept, thin=rows, claims=claims, free=free)
        self._at, self._written = way.system.form.at, way.system.form.written
        self._extrema = keep != END
        self._nominal = guesses(self._at, self._written, way.system.description.initial)[0]

    def _options(self, prepared: Prepared) -> Options:
        """The options of every run; NotApplicableError where they follow from what varies."""
        read = Read(prepared.binding.parameters)
        seen = replace(prepared, binding=replace(prepared.binding, parameters=read))
        report = Report()
        options = options_of(self._loaded.request, self._loaded.target, seen, report, time.monotonic(), None)
        if options is None:
            raise NotApplicableError("the scene's options make no sense")
        plain = {key if isinstance(key, str) else key[0] for key in self._keys}
        moving = plain | set(following(prepared.compiled.network, plain))
        if read.read & moving:
            raise NotApplicableError(f"the scene's instants follow from {sorted(read.read & moving)[0]}")
        read.read.clear()
        options = replace(options, output=None, stops=stops(seen, options, report))
        # where the text may jump at instants that follow from what varies, each run is looked at
        self._looked = options if read.read & moving else None
        if prepared.network.events or prepared.network.switches:
            raise NotApplicableError("the model has events")
        return options

    def run(self, numbers: Sequence[int], cases: Sequence[Mapping[str, Any]]) -> tuple[Block | None, list[int]]:
        """What is kept of the cases, and the places of those that need a run of their own."""
        values = np.array([[case[name] for name in self._names] for case in cases], dtype=np.float64)
        with ex.fresh(self._compiled.nodes):
            p, anchor, good = self._bound(values)
        found = self._batch.run(p[good], anchor[good])
        done = found.state == DONE
        place = np.flatnonzero(good)
        left = sorted({*np.flatnonzero(~good).tolist(), *place[~done].tolist()})
        if not done.any():
            return None, left
        nothing = np.zeros((int(done.sum()), 0))
        block = Block(
            np.asarray(numbers, dtype=np.int64)[place[done]],
            self._batch.columns,
            self.method,
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
        if self._looked is None and all(isinstance(key, str) for key in self._keys):
            varied = {key: values[:, j] for j, key in enumerate(self._keys)}
            found = prepared.compiled.columns(prepared.binding, varied)
        if found is None:
            return self._one_by_one(values)
        anchor = self._anchors(found.starts, len(values))
        good = found.good & np.isfinite(found.p).all(axis=1) & np.isfinite(anchor).all(axis=1)
        for k in {0, len(values) - 1}:  # what is evaluated together is what is bound alone
            alone = self._alone(values[k]) if good[k] else None
            if alone is not None and not (np.array_equal(alone[0], found.p[k]) and np.array_equal(alone[1], anchor[k])):
                return self._one_by_one(values)
            good[k] &= alone is not None
        return found.p, anchor, good

    def _anchors(self, starts: Sequence[tuple[Any, Floats]], number: int) -> Floats:
        """Initial values of all unknowns: a fixed one wins over a guess, a later statement over an earlier."""
        anchor = np.tile(self._nominal, (number, 1))
        fixed = np.zeros(self._written, dtype=bool)
        for start in self._prepared.binding.initial:
            if start.fixed:
                fixed[self._at[start.family] + start.positions] = True
        for start, column in starts:
            for place in (self._at[start.family] + start.positions).tolist():
                if start.fixed or not fixed[place]:
                    anchor[:, place] = column
        return anchor

    def _alone(self, values: Floats) -> tuple[Floats, Floats] | None:
        """The numbers of one run by a binding of its own; None where it has another structure, or none."""
        prepared = self._prepared
        try:
            binding: Binding = prepared.compiled.bind(dict(zip(self._keys, map(np.asarray, values), strict=True)))
        except ModelError:
            return None
        first = prepared.binding
        same = np.array_equal(binding.ix, first.ix) and binding.shapes == first.shapes
        if not same or binding.row_shapes != first.row_shapes or binding.p.size != first.p.size:
            return None
        if self._looked is not None and stops(replace(prepared, binding=binding), self._looked, Report()).size:
            return None
        return binding.p, guesses(self._at, self._written, binding.initial)[0]  # type: ignore[arg-type]

    def _one_by_one(self, values: Floats) -> tuple[Floats, Floats, NDArray[np.bool_]]:
        p = np.tile(self._prepared.binding.p, (len(values), 1))
        anchor, good = np.tile(self._nominal, (len(values), 1)), np.zeros(len(values), dtype=bool)
        for k, row in enumerate(values):
            alone = self._alone(row)
            if alone is not None:
                p[k], anchor[k] = alone
                good[k] = True
        return p, anchor, good


def _claims(prepared: Prepared) -> tuple[Claim, ...]:
    """The scene's expectations as the core looks at them."""
    network = prepared.network
    if network.goldens:
        raise NotApplicableError("a golden file is expected")
    found = []
    for k, e in enumerate(network.expectations):
        within = None if e.within is None else f"expect {k} within"
        moment = "at" if e.at is not None else e.moment
        at = 0.0 if e.at is None else prepared.binding.evaluate(e.at)
        found.append(Claim(f"expect {k} left", f"expect {k} right", within, e.operator, moment, at))
    return tuple(found)

