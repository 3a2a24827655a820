"""The events of a network as the runtime's plan: names become rows of block observe and places of p and y."""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import count

from sysdyn.cli.run.prepare import Prepared
from sysdyn.compiler.forms.descriptor import WITHOUT_ENTRIES, DescriptorForm, Frozen
from sysdyn.dsl.model.expression import Node
from sysdyn.dsl.model.network import Action, Event, Switch
from sysdyn.dsl.text.diagnostics import Diagnostic, ModelError, Report
from sysdyn.runtime.events.plan import Assignment, Condition, Contact, Happened, Kink, Plan, Relation, Sampled, When
from sysdyn.runtime.events.watching import NOTHING
from sysdyn.runtime.model.description import RowFamily, position_of
from sysdyn.runtime.model.system import System

ZENO = 8
"""Impacts before a rest that are told."""


def plan(prepared: Prepared, system: System, rest: float = 1e-6) -> Plan:
    """The plan of a bound model; ModelError where the values make none.  rest: see plan.Plan."""
    network = prepared.network
    if not network.events and not network.switches and not prepared.compiled.form.kinks:
        return Plan()
    return _Planner(prepared, system).plan(rest)


def zeno(prepared: Prepared, events: Sequence[Happened], report: Report) -> None:
    """N923 for the contacts whose impacts came ever faster until they were too slow to tell from rest: one for those of
    an array.
    """
    impacts: dict[str, list[float]] = {}
    rested: dict[str, dict[str, str]] = {}  # what is told of each contact, by arrays
    for event in events:
        name = event.element
        if event.name.startswith("impact ") and event.after == "free":
            impacts.setdefault(name, []).append(event.time)
        elif event.after == "holds" and len(times := impacts.pop(name, [])) >= ZENO:
            text = f"{len(times)} impacts from {times[0]:.9g} s on, ever faster, end at {event.time:.9g} s"
            rested.setdefault(name.partition("[")[0], {}).setdefault(name, text)
    places = {s.name: s.place for s in prepared.network.switches}
    for told in rested.values():
        (name, text), others = next(iter(told.items())), len(told) - 1
        alike = f" (and so do those of {others} more)" if others else ""
        place = places.get(name, prepared.network.place)
        report.note("N923", f"{name}: {text}{alike}: what was left of them is rest", place)


class _Planner:
    """Finds rows and places."""

    def __init__(self, prepared: Prepared, system: System) -> None:
        self.prepared, self.system = prepared, system
        description = system.description
        names = [r.name_of(k) for r in _rows(system) for k in range(r.size)]
        self.row = {name: k for k, name in enumerate(names)}
        self.unknown = {
            (f.owner, f.kind): (int(system.form.at[k]), f.shape)
            for k, f in enumerate(description.families)
            if f.kind in "sf"
        }
        self.relations: list[Relation] = []

    def plan(self, rest: float) -> Plan:
        """Everything that may happen."""
        network, switches = self.prepared.network, self.prepared.compiled.network.switches
        whens = tuple(self._when(e) for e in network.events if e.condition is not None)
        sampled = tuple(self._sample_plan(e) for e in network.events if e.period is not None)
        number = count()
        contacts = tuple(self._contact(next(number) if s.holds is None else -1, s) for s in switches)
        limits = dict(network.scene.limits) if network.scene else {}
        limit = round(self.prepared.binding.evaluate(limits["events"])) if "events" in limits else None
        kinks = tuple(self._kink(k) for k in self.prepared.compiled.form.kinks)
        plain = _plain(self.prepared.compiled.form)
        return Plan(tuple(self.relations), whens, sampled, contacts, kinks, limit, rest, plain)

    def _kink(self, k: Frozen) -> Kink:
        rate = -1 if k.rate is None else self.row[k.rate]
        above, below = (self.row[name] for name in k.slide) if k.slide else (-1, -1)
        branch = self.prepared.compiled.program.scalars.index(k.branch)
        return Kink(k.text, k.label, branch, self.row[k.value], rate, above, below, k.jumps, k.inner, k.passage)

    def _when(self, event: Event) -> When:
        assert event.condition is not None
        return When(event.name, self._condition(event.condition), self._assignments(event.actions))

    def _sample_plan(self, event: Event) -> Sampled:
        """Plan of an `every`: its period [s] and assignments; E703 of a period that is none, or is below what is told
        apart.
        """
        assert event.period is not None
        period = self.prepared.binding.evaluate(event.period)
        if not 0.0 < period < math.inf:
            text = f"the period of 'every' must be a positive constant, it is {period:g} s"
            raise ModelError([Diagnostic("E703", text, event.place)])
        scene = self.prepared.network.scene
        span = self.prepared.binding.evaluate(scene.end) - self.prepared.begin if scene and scene.end else math.inf
        if period <= NOTHING * span < math.inf:
            text = f"'every {period:g} s' is shorter than instants are told apart in {span:g} s: {NOTHING * span:.1g} s"
            raise ModelError([Diagnostic("E703", text, event.place)])
        return Sampled(event.name, period, self._assignments(event.actions))

    def _condition(self, node: Node) -> Condition:
        if node.op in ("and", "or", "not"):
            return (node.op, *(self._condition(a) for a in node.args))
        watched = node.args[0]
        name, kind = watched.data[:2]
        self.relations.append(Relation(self.row[name], kind != "rests", kind == "ticks"))
        return ("relation", len(self.relations) - 1, node.data)

    def _assignments(self, actions: tuple[Action, ...]) -> tuple[Assignment, ...]:
        return tuple(self._assignment(a) for a in actions)

    def _assignment(self, action: Action) -> Assignment:
        """Place and row of an assignment: a discrete variable is among parameters, a state or flow among unknowns."""
        row, target = self.row[action.value], action.target
        if target.op == "param":
            return Assignment(self._indexed_name(target.data, target), "discrete", self.prepared.place(target), row)
        name, kind, _ = target.data
        # a flow that this formulation has replaced
        if (name, kind) not in self.unknown:
            text = f"an event assigns the flow of {name}, which is no unknown of this formulation"
            raise ModelError([Diagnostic("E702", text, action.place)])
        first, shape = self.unknown[name, kind]
        shown = self._indexed_name(name, target) + "'" * (kind == "f")
        place = first + position_of(shape, self.prepared.indices(target))
        return Assignment(shown, "state" if kind == "s" else "flow", place, row)

    def _indexed_name(self, name: str, node: Node) -> str:
        return f"{name}[{', '.join(map(str, self.prepared.indices(node)))}]" if node.args else name

    def _contact(self, number: int, s: Switch) -> Contact:
        """Plan of a switch: rows that it watches, its sense, restitution and directions by place."""

        def row(name: str | None) -> int:
            return -1 if name is None else self.row[name]

        restitution = 0.0 if s.restitution is None else self.prepared.binding.evaluate(s.restitution)
        # known with the parameters alone
        if not 0.0 <= restitution <= 1.0:
            text = f"phi {s.name}: restitution {restitution:g} is not between 0 and 1"
            raise ModelError([Diagnostic("E514", text, s.place)])
        sense = -1 if s.sense is None else self.prepared.place(s.sense)
        related, aim = s.kind == "relation", tuple(self.row[name] for name in s.aim)
        # a relation whose bound is a reaction
        if related and aim:
            self.relations.append(Relation(aim[0], True))
        kind = "friction" if related else s.kind
        return Contact(
            s.name, kind, number, row(s.value), row(s.rate), row(s.multiplier), row(s.acceleration), row(s.bound),
            row(s.upper), row(s.lower), sense, row(s.guard), restitution,
            aim, tuple(self.prepared.place(n) for n in s.direction),
            -1 if s.holds is None else self.prepared.place(s.holds), s.moves, s.dual,
            len(self.relations) - 1 if related and aim else -1,
        )  # fmt: skip


def _plain(form: DescriptorForm) -> frozenset[int]:
    """Row families that are sums of unknowns and nothing else, but for the constants of integrated constraints."""
    found, offsets = set(range(len(form.rows))), {o.name for o in form.offsets}
    for block in form.blocks:
        if block.name in WITHOUT_ENTRIES or block.name.endswith("_rate"):
            continue
        for kernel in block.kernels:
            found -= {s.row for s in kernel.rows if not _sum_of_unknowns(s.expression, offsets)}
    return frozenset(found)


def _sum_of_unknowns(node: Node, offsets: set[str]) -> bool:
    terms = node.args if node.op == "sum" and node.data[0] == 0.0 else (node,)
    return all(term.op == "var" or (term.op == "param" and term.data in offsets) for term in terms)


def _rows(system: System) -> list[RowFamily]:
    return [system.description.rows[k] for k in system.description.rows_of("observe")]
