"""Numbers of a scene that no run can be asked for: its span, its interval, its accuracy, its limits, its solver.

Those that are plain constants are told with the text (dsl/elaborate/scenes/scenes.py); these are known where
parameters have values.  What the command line says in a scene's place is not judged here.
Received: a target, a scene's network, values, a request; handed back: findings, each at its statement.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator
from typing import TYPE_CHECKING

from sysdyn.cli.run.request.targets import Target
from sysdyn.dsl.elaborate.scenes.scenes import FINEST_ACCURACY
from sysdyn.dsl.model.expression import Node
from sysdyn.dsl.model.network import Expectation, Network, Scene
from sysdyn.dsl.text.diagnostics import Diagnostic, Place, Span
from sysdyn.dsl.tree import syntax

if TYPE_CHECKING:
    from sysdyn.cli.run.request.run_request import RunRequest

INSTANTS = 2e7
"""Of a trace with a fixed interval: they are laid out before the run, about 50 bytes each."""
SPANS = (1e-75, 1e75)
"""s: shortest and longest span of a run; beyond them second rates of magnitudes near 1 and their squares are no
doubles."""
_INDICES = (0.0, 1.0, 2.0, 3.0)
_ORDERS = {"bdf": (1.0, 2.0, 3.0, 4.0, 5.0), "radau": (5.0, 9.0, 13.0)}
"""Of the methods whose order can be asked for."""

Value = Callable[[Node], float]


def wrong_numbers(target: Target, network: Network, value: Value, request: RunRequest) -> Iterator[Diagnostic]:
    """What is wrong of what the request leaves to the scene."""
    scene = network.scene
    assert scene is not None
    yield from _span(target, scene, value, until=request.until is not None)
    # claims at instants beyond the end
    if request.until is None:
        yield from _claims(scene, network.expectations, value)
    # accuracies of the scene, unless the command line has one
    said = () if request.accuracy is not None else (scene.accuracy, *(node for _, node in scene.accuracy_on))
    for wanted in dict.fromkeys(value(node) for node in said if node is not None):
        if not FINEST_ACCURACY <= wanted < 1.0:
            text = f"accuracy {wanted:g}: from {FINEST_ACCURACY:g} to less than 1, what double precision can tell"
            yield Diagnostic("E906", text, _place(target, scene, syntax.AccuracyStatement), "accuracy 1e-6")
    # limits are whole numbers
    for name, node in scene.limits:
        most = value(node)
        if not (math.isfinite(most) and round(most) >= 1):
            place = _place(target, scene, syntax.LimitStatement, lambda s, name=name: s.name.name == name)
            yield Diagnostic("E912", f"limit {name} {most:g}: a whole number from 1 on", place, f"limit {name} 10000")
    yield from _solver(target, scene, value, request)


def _span(target: Target, scene: Scene, value: Value, *, until: bool) -> Iterator[Diagnostic]:
    """The time from where to where, and how many instants of it are traced."""
    if scene.start is None or scene.end is None:
        return
    t0, t1 = value(scene.start), value(scene.end)
    right = math.isfinite(t0) and math.isfinite(t1) and t1 > t0
    # backwards, or never ending
    if not (until or right):
        text = f"the time is from {t0:g} s to {t1:g} s: a run goes forward and ends"
        yield Diagnostic("E912", text, _place(target, scene, syntax.TimeStatement), "time 0 s to 10 s")
    # instants that doubles do not tell apart
    elif not until and (text := beyond(t0, t1)):
        yield Diagnostic("E912", text, _place(target, scene, syntax.TimeStatement), "time 0 s to 10 s")
        return
    every = None if scene.every is None else value(scene.every)
    if every is None or not (right or until):
        return
    place = _place(target, scene, syntax.TraceStatement, lambda s: s.every is not None, lambda s: s.every.span)
    # the interval of the trace
    if not every > 0.0:
        yield Diagnostic("E912", f"the interval of the trace is {every:g} s: it is positive", place, "every 10 ms")
    elif not until and (t1 - t0) / every > INSTANTS:
        text = f"every {every:g} s from {t0:g} s to {t1:g} s is more than {INSTANTS:.0e} instants"
        yield Diagnostic("E912", text, place, f"every {(t1 - t0) / 1000.0:.3g} s, or none: each step is traced then")


def _claims(scene: Scene, claims: Iterable[Expectation], value: Value) -> Iterator[Diagnostic]:
    """Claims at instants that are not in the time of the scene."""
    if scene.start is None or scene.end is None:
        return
    t0, t1 = value(scene.start), value(scene.end)
    for claim in claims:
        at = t0 if claim.at is None else value(claim.at)
        if t0 < t1 and not t0 <= at <= t1:
            text = f"a claim at {at:g} s of a run from {t0:g} s to {t1:g} s: nothing could tell whether it holds"
            yield Diagnostic(
                "E912", text, claim.place, f"time {min(at, t0):g} s to {max(at, t1):g} s, or another instant"
            )


def beyond(t0: float, t1: float) -> str:
    """What is said of a span that no run can have, "" of others; t0, t1 [s]."""
    least, most = SPANS
    if least <= t1 - t0 <= most:
        return ""
    return f"from {t0:g} s to {t1:g} s are {t1 - t0:g} s: {least:g} s to {most:g} s are what double precision allows"


def _solver(target: Target, scene: Scene, value: Value, request: RunRequest) -> Iterator[Diagnostic]:
    """The options of the solver, and the step that one of them needs."""
    said = {name: value(node) for name, node in scene.solver_options}
    place = _place(target, scene, syntax.SolverStatement)
    # lengths of time are positive
    for name in ("step", "longest"):
        if not said.get(name, 1.0) > 0.0:
            text = f"{name} = {said[name]:g} s of the solver: it is positive"
            yield Diagnostic("E912", text, place, f"{name} = 1 ms")
    # forms that there are
    if request.index is None and said.get("index", 0.0) not in _INDICES:
        yield Diagnostic("E607", f"index = {said['index']:g} of the solver", place, "index = 0, 1, 2, 2v, 3")
    # orders of the method
    orders = _ORDERS.get(scene.solver or "", ())
    if request.method in (None, scene.solver) and "order" in said and said["order"] not in orders:
        text = f"order = {said['order']:g} of the solver {scene.solver}"
        yield Diagnostic("E607", text, place, "bdf(order = 1 .. 5): at most; radau(order = 5), 9 or 13: that one")
    method = request.method or scene.solver or "auto"
    # the one method that needs a step
    if method == "euler":
        if request.method is None and request.step is None and "step" not in said:
            yield Diagnostic("E607", "method euler needs a step", place, "solver euler(step = 1 ms)")
        if said.get("step", 0.0) > said.get("longest", math.inf):
            text = f"step = {said['step']:g} s of the solver is longer than longest = {said['longest']:g} s"
            yield Diagnostic("E607", text, place, "euler takes steps of one length: step alone")
    # others choose theirs
    elif "step" in said and request.method is None:
        text = f"step = {said['step']:g} s of the solver {method}, which chooses its steps"
        yield Diagnostic("E607", text, place, f"{method}(longest = ..) bounds them; euler(step = ..) has one length")


def _place(
    target: Target,
    scene: Scene,
    kind: type,
    like: Callable[..., bool] = lambda _: True,
    span: Callable[..., Span] = lambda s: s.span,
) -> Place:
    """The scene's own statement of a kind; the scene's name where there is none."""
    said = () if target.scene is None else target.scene.body
    found = next((s for s in said if isinstance(s, kind) and like(s)), None)
    return scene.place if found is None else Place(target.document.file.source, span(found))
