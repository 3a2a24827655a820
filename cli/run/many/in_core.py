"""Runs of one text in the core, set up at the text's own numbers: what sweeps and runs in memory have in common.

That is where they differ in numbers alone, nothing happens at instants of its own (events, jumps of the text), and the
rows fix the start but for what the text gives.  What a run needs that this way does not have (a structure of its own,
another method, a reason for what it missed) is left to a run on its own.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from sysdyn.cli.run.prepare import Prepared
from sysdyn.cli.run.request.run_request import RunRequest, options_of, stops
from sysdyn.cli.run.request.targets import Target
from sysdyn.cli.run.running import Ran
from sysdyn.compiler.binding.binding import Binding
from sysdyn.compiler.binding.columns import Read, following
from sysdyn.dsl.model import expression as ex
from sysdyn.dsl.text.diagnostics import ModelError, Report
from sysdyn.runtime.accuracy.options import Options
from sysdyn.runtime.many.asked import ROWS, Claim, NotApplicableError, obstacle, way_of
from sysdyn.runtime.many.batch import Batch
from sysdyn.runtime.model.description import statements
from sysdyn.runtime.model.failures import SolverFailure

Floats = NDArray[np.float64]
Rows = Callable[[Options], NDArray[np.int64]]
"""Numbers of the rows of the trace that are kept."""


PLAIN = "newton"
"""The strategy of a start that is found where it is looked for first."""


class InCore:
    """A text set up in the core, for runs with other numbers.  NotApplicableError where that cannot be: the reason.

    scene: parameters that the options follow from; jumps: those that instants follow from at which the text may jump:
    where one of them changes, each run is looked at.
    """

    def __init__(
        self, request: RunRequest, target: Target, prepared: Prepared, nominal: Callable[[], Ran | None], keep: int
    ) -> None:
        """nominal: a run with the text's own numbers."""
        # what the core cannot do by itself: runs go one by one then
        if prepared.backend != "c":
            raise NotApplicableError("the model is not compiled to C")
        if prepared.network.events or prepared.network.switches:
            raise NotApplicableError("the model has events")
        self.prepared, self._keep, self._claims = prepared, keep, _claims(prepared)
        if keep == ROWS:
            self._as_ever()
        self.options = self._options(request, target)
        # options that need Python between steps
        why = obstacle(self.options)
        if why is not None:
            raise NotApplicableError(why)
        self._nominal = nominal

    def _as_ever(self) -> None:
        """What a run is asked beside its accuracy must be what any other run of the text is asked."""
        network = self.prepared.network
        if self.prepared.compiled.form.kinks:
            raise NotApplicableError("the model has kinks")
        read = ex.topological([x for c in network.statics for x in (c.left, c.right, c.within) if x is not None])
        if any(node.op == "param" and not str(node.data).startswith("static ") for node in read):
            raise NotApplicableError("a claim about counts reads parameters")

    def _options(self, request: RunRequest, target: Target) -> Options:
        """The options of every run."""
        read = Read(self.prepared.binding.parameters)
        seen = replace(self.prepared, binding=replace(self.prepared.binding, parameters=read), layouts={})
        report = Report()
        options = options_of(request, target, seen, report, time.monotonic(), None, held=True)
        if options is None:
            raise NotApplicableError("the scene's options make no sense")
        self.scene = frozenset(read.read)
        read.read.clear()
        options = replace(options, output=None, stops=stops(seen, options, report))
        self.jumps = frozenset(read.read)
        return options

    def moving(self, names: Iterable[str]) -> frozenset[str]:
        """Parameters that change where these do.  NotApplicableError where the scene's options are among them."""
        plain = frozenset(names)
        moving = plain | frozenset(following(self.prepared.compiled.network, set(plain)))
        if self.scene & moving:
            raise NotApplicableError(f"the scene's instants follow from {sorted(self.scene & moving)[0]}")
        return moving

    def set_up(self, thin: NDArray[np.int64] | None = None) -> None:
        """The structures of the core; thin: numbers of the rows of the trace that are kept."""
        try:
            ran = self._nominal()
        except (ModelError, SolverFailure) as error:
            raise NotApplicableError(f"the text's own numbers do not run: {error}") from error
        if ran is None or ran.exit or not ran.outcome.met:
            raise NotApplicableError("the text's own numbers do not run, or are not met")
        started, self.method = ran.started, ran.outcome.method
        if self._keep == ROWS and started.state.strategy != PLAIN:
            raise NotApplicableError(f"the start is sought in another way than most ({started.state.strategy})")
        way, start = way_of(started.system, started.state, started.facts, self.options, self.method)
        if started.system.description.rows_of("initial"):
            raise NotApplicableError("an initial value is no unknown of this formulation")
        # a structure of its own: other runs of the same text write into theirs
        way = replace(way, system=way.system.another(way.system.form.name))
        free, claims = _free(self.prepared), self._claims
        self.batch = Batch(way, start, self.options, keep=self._keep, thin=thin, claims=claims, free=free)
        self.at, self.written = way.system.form.at, way.system.form.written
        self.guesses = statements(self.at, self.written, way.system.description.initial)[0]

    def numbers_of_run(self, binding: Binding, moving: frozenset[str]) -> tuple[Floats, Floats] | None:
        """Numbers p and initial values of one run; None where it has another structure."""
        first = self.prepared.binding
        same = np.array_equal(binding.ix, first.ix) and binding.shapes == first.shapes
        if not same or binding.row_shapes != first.row_shapes or binding.p.size != first.p.size:
            return None
        if self.jumps & moving and stops(replace(self.prepared, binding=binding), self.options, Report()).size:
            return None
        return binding.p, statements(self.at, self.written, binding.initial)[0]  # type: ignore[arg-type]


def _free(prepared: Prepared) -> bool:
    """Nothing in the rows depends on time."""
    return not any(
        node.op == "time"
        for block in prepared.compiled.form.blocks
        for kernel in block.kernels
        for row in kernel.rows
        for node in ex.topological([row.expression])
    )


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
