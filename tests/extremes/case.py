"""A case of the extremes, and a family of them."""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field

import numpy as np

Values = dict[str, float]

POWERS = tuple(range(-15, 16, 3))


@dataclass(frozen=True)
class Case:
    """One run.  x: where it stands on the axis of its family's figure; values: of parameters."""

    name: str
    x: float
    values: Values
    until: float
    options: dict[str, object] = field(default_factory=dict)
    accuracy: float = 1e-4


@dataclass(frozen=True)
class Family:
    """wanted(t, values) -> traced name -> values at instants t [n]; {until} of the text is filled in for each case."""

    name: str
    axis: str
    text: str
    wanted: Callable[[np.ndarray, Values], dict[str, np.ndarray]]
    cases: tuple[Case, ...]


def in_units(
    name: str, text: str, wanted: Callable[..., dict[str, np.ndarray]], changes: Mapping[str, Callable[..., object]]
) -> Iterator[Family]:
    """A family for each unit that all values are scaled in; changes: unit -> factor -> the values and the end (s)."""
    for unit, change in changes.items():
        cases = []
        for k in POWERS:
            values, until = change(10.0**k)
            for formulation in ("lagrangian", "hamiltonian"):
                cases.append(Case(f"{unit} 1e{k} {formulation}", k, values, until, {"formulation": formulation}))
        yield Family(f"{name}, unit of {unit}", "lg of the factor", text, wanted, tuple(cases))
