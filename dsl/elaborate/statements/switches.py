"""Events and switches of arrays, element by element: they are few, and each happens at its own instant."""

from __future__ import annotations

from collections.abc import Iterator

from sysdyn.dsl.elaborate.parts import ElaborationContext
from sysdyn.dsl.elaborate.statements.events import Draft, event_of, watch
from sysdyn.dsl.model import budget
from sysdyn.dsl.model import expression as ex
from sysdyn.dsl.model.calculus import NoDerivativeError, time_derivative
from sysdyn.dsl.model.expression import Node
from sysdyn.dsl.model.network import Loop, Switch
from sysdyn.dsl.model.units import NONE
from sysdyn.dsl.model.values import Values, as_constants


def expand_events(frame: ElaborationContext, known: Values) -> None:
    """Events and switches with their observations, an array's element by element."""
    for event in frame.parts.event_drafts:
        for change in _iterations(event.loops, known):
            frame.parts.events.append(event_of(frame, event, change))
    for draft in frame.parts.drafts:
        for change in _iterations(draft.loops, known):
            try:
                frame.parts.switches.append(_switch(frame, draft, change, known))
            except NoDerivativeError as none:
                none.place = draft.place
                raise


def _bounds(draft: Draft) -> tuple[Node | None, Node | None, Node | None]:
    """The bound of a multiplier, and what it lacks to it on both sides."""
    if draft.bound is None:
        return None, None, None
    return draft.bound, ex.sub(draft.bound, draft.multiplier), ex.add(draft.bound, draft.multiplier)


def _iterations(loops: tuple[Loop, ...], known: Values) -> Iterator[dict[Node, Node]]:
    """Numbers for the loop variables."""
    for k, _ in enumerate(known.iterations(loops)):
        if k:
            budget.charge(budget.NODE, "events and inequalities that are written out one by one")
    for at in known.iterations(loops):
        yield as_constants(at)


def _switch(frame: ElaborationContext, draft: Draft, change: dict[Node, Node], known: Values) -> Switch:
    """One element of a set-valued law with its watched values."""

    def in_element(node: Node) -> Node:
        return ex.substitute(node, change)

    def seen(node: Node | None) -> str | None:
        return None if node is None else watch(frame, in_element(node), NONE, draft.place)

    # what is compared while it sticks
    bound, upper, lower = (seen(n) for n in _bounds(draft))
    at = tuple(int(known.number(in_element(n))) for n in draft.at)
    name = f"{draft.label}[{', '.join(map(str, at))}]" if at else draft.label
    guard = None if draft.guard is None else ex.conditional(draft.guard, ex.const(1.0), ex.const(0.0))
    # the law's own variable, its rate and, of a phi, its acceleration, by which contacts open and close
    value = watch(frame, in_element(draft.value), draft.unit.dimension, draft.place)
    rate = watch(frame, in_element(draft.rate or time_derivative(draft.value)), NONE, draft.place)
    multiplier = watch(frame, in_element(draft.multiplier), NONE, draft.place)
    twice = time_derivative(time_derivative(in_element(draft.value))) if draft.kind == "phi" else None
    acceleration = None if twice is None else watch(frame, twice, NONE, draft.place)
    sense = None if draft.sense is None else in_element(draft.sense)
    restitution = None if draft.restitution is None else in_element(draft.restitution)
    return Switch(
        name, draft.label, at, draft.kind, draft.place, value, rate, multiplier, draft.element,
        acceleration, bound, upper, lower, sense, seen(guard), restitution,
        tuple(watch(frame, in_element(n), NONE, draft.place) for n in draft.aim),
        tuple(in_element(n) for n in draft.direction),
        None if draft.holds is None else in_element(draft.holds),
        draft.bound is not None and bool(ex.variables(draft.bound)),
    )  # fmt: skip
