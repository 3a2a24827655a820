"""What a netlist says: circuits and subcircuits with their elements, parameters and models, and what is asked."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import field

from sysdyn.cli.spice.netlist import Card
from sysdyn.cli.spice.parameters import ParameterText
from sysdyn.values import dataclass

GROUND = ("0", "gnd")
CELSIUS = 273.15  # K
USUAL = 27.0 + CELSIUS
"""Temperature (K) of a circuit and of its models where nothing is said, as in SPICE."""


@dataclass(frozen=True, slots=True)
class ModelCard:
    """`.model NAME KIND(...)`: texts of its values."""

    kind: str
    values: dict[str, str]
    card: Card


@dataclass(slots=True, eq=False)
class Circuit:
    """A circuit or subcircuit.  parent: the one whose lines define it; ports: of a subcircuit."""

    name: str
    parent: Circuit | None = None
    ports: tuple[str, ...] = ()
    parameters: dict[str, ParameterText] = field(default_factory=dict)
    elements: dict[str, Card] = field(default_factory=dict)
    inner: dict[str, Circuit] = field(default_factory=dict)
    models: dict[str, ModelCard] = field(default_factory=dict)

    @property
    def enclosing(self) -> Iterator[Circuit]:
        """It and those around it, where a name of a subcircuit or a model is looked for in turn."""
        found: Circuit | None = self
        while found is not None:
            yield found
            found = found.parent

    def find(self, name: str) -> Circuit | None:
        """A subcircuit that is known here."""
        return next((c.inner[name] for c in self.enclosing if name in c.inner), None)


@dataclass(slots=True)
class Netlist:
    """All of a text.  initial: V by node, of `.ic`; tran: (step or 0, stop, start) s; uic: initial conditions are used
    as they are; temperature, nominal: K of the circuit and of its models; width, length: m, of a transistor that says
    none; shared: nodes of `.global`.
    """

    title: str
    top: Circuit
    known: dict[str, float] = field(default_factory=dict)
    initial: dict[str, tuple[float, Card]] = field(default_factory=dict)
    tran: tuple[float, float, float] | None = None
    uic: bool = False
    shown: list[str] = field(default_factory=list)
    temperature: float = USUAL
    nominal: float = USUAL
    width: float = 1e-4
    length: float = 1e-4
    shared: dict[str, None] = field(default_factory=dict)
