"""Subcircuits with the values of their parameters: each that differs in more than named parameters is a component."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import field

from sysdyn.cli.spice.calls import CircuitCalls
from sysdyn.cli.spice.circuit import Circuit, ModelCard
from sysdyn.cli.spice.devices import ModelValues
from sysdyn.cli.spice.netlist import Card, UnreadableCard, value
from sysdyn.cli.spice.parameters import evaluate
from sysdyn.cli.spice.writing import NetlistNames
from sysdyn.values import dataclass

INFORMATION = ("mfg", "type", "iave", "vpk", "vceo", "icrating", "ron_typ", "vds", "qg")
"""What models say of the parts that one buys."""


@dataclass(slots=True, eq=False)
class CircuitInstance:
    """A circuit with the values of its parameters.  caller: the first that calls it, whose parameters it reads too, as
    in SPICE; initial: V by node, of `.ic`; name: of its component.
    """

    circuit: Circuit
    known: Mapping[str, float]
    name: str
    caller: CircuitInstance | None = None
    initial: Mapping[str, float] = field(default_factory=dict)
    models: dict[str, ModelValues | None] = field(default_factory=dict)

    def model(self, name: str) -> ModelValues | None:
        """A model that is known here, with its numbers."""
        if name not in self.models:
            self.models[name] = self._model(name)
        return self.models[name]

    def _model(self, name: str) -> ModelValues | None:
        where = next((c for c in self.circuit.enclosing if name in c.models), None)
        if where is None:
            return None
        around: CircuitInstance | None = self
        while around is not None and around.circuit is not where:
            around = around.caller
        return _values(where.models[name], (around or self).known)


def _values(model: ModelCard, known: Mapping[str, float]) -> ModelValues:
    """A model's numbers.  Unreadable, with its card."""
    try:
        numbers = {n: value(text, known) for n, text in model.values.items() if n not in INFORMATION}
    except UnreadableCard as error:
        error.card = model.card
        raise
    return ModelValues(model.kind, numbers)


class CircuitInstances:
    """Gives each call its component; new ones wait in `found`."""

    def __init__(self, calls: CircuitCalls, top: CircuitInstance, named: NetlistNames) -> None:
        self.calls, self._named = calls, named
        self.found = [top]
        self._known: dict[tuple[object, ...], CircuitInstance] = {}

    def instance_of(
        self, caller: CircuitInstance, card: Card, inner: Circuit, given: Mapping[str, float], at: list[str]
    ) -> CircuitInstance:
        """The instance that a call with these values at these nodes makes; parameters that stay named are not its."""
        use = self.calls.uses[inner]
        own = {n: v for n, v in given.items() if n not in use.named}
        known = {**caller.known, **evaluate(inner.parameters, caller.known, own)}
        initial = self._initial(caller.initial, card, inner, at)
        read = tuple((n, known.get(n)) for n in sorted(use.reads) if n not in use.named or n not in inner.parameters)
        around = next((i for i in _callers(caller) if i.circuit is inner.parent), None)
        key = (inner, around, read, tuple(sorted(initial.items())))
        found = self._known.get(key)
        if found is None:
            found = CircuitInstance(inner, known, self._named.new(inner.name), caller, initial)
            self._known[key] = found
            self.found.append(found)
        return found

    def _initial(self, around: Mapping[str, float], card: Card, inner: Circuit, at: list[str]) -> dict[str, float]:
        """`.ic` of the nodes of a call, of shared ones, and of those inside, `x1.n`."""
        if not around:
            return {}
        prefix = f"{card.head}."
        inside = {n.removeprefix(prefix): v for n, v in around.items() if n.startswith(prefix)}
        shared = {n: v for n, v in around.items() if n in self.calls.shared}
        return {**shared, **inside, **{p: around[n] for p, n in zip(inner.ports, at, strict=True) if n in around}}


def _callers(instance: CircuitInstance | None) -> list[CircuitInstance]:
    """An instance and those that call it, innermost first."""
    found = []
    while instance is not None:
        found.append(instance)
        instance = instance.caller
    return found
