"""What a scene without `trace` traces: every coordinate and every dynamic variable, arrays element by element.

Received: an EnergyModel and its network (whose parameters give the sizes of arrays).  Returned: the model with these
quantities, and a note where an array is too large to be listed whole.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace
from itertools import islice, product

from sysdyn.compiler.model.energies import EnergyModel, TracedQuantity, UnknownFamily
from sysdyn.compiler.model.parameters import Parameters, extents
from sysdyn.compiler.network.authors import Authors, in_author_names, owner
from sysdyn.dsl.model.expression import const, var
from sysdyn.dsl.model.network import Network
from sysdyn.dsl.text.diagnostics import Diagnostic

MOST = 1000
"""Elements of one array: each is a row of text in the compiled model and a data set in the trace."""


def with_coordinates_observed(model: EnergyModel, network: Network) -> tuple[EnergyModel, tuple[Diagnostic, ...]]:
    """The model with a stored quantity for each coordinate and each dynamic variable."""
    parameters, own = Parameters(network, {}), network.authors
    found: list[TracedQuantity] = []
    notes: list[Diagnostic] = []
    kinds = [(c, model.mirror.coordinate, "q") for c in model.coordinates] + [(s, "s", "s") for s in model.states]
    for family, kind, unit in kinds:
        box = parameters.extents(family.shape)
        number = math.prod(extents(box))
        if number > MOST:
            whole, one = (
                in_author_names(f"{family.name}[0..{number - 1}]", own),
                in_author_names(f"{family.name}[0]", own),
            )
            whole, one = (whole, one) if owner(family.name, own) else (family.name, f"{family.name}[...]")
            text = f"nothing is traced: of the {number} elements of {whole} the first {MOST} are"
            notes.append(Diagnostic("N608", text, family.place, f"trace {one} in the scene"))
        found += islice(_elements(family, kind, family.units[unit], box, own), MOST)
    return replace(model, quantities=(*found, *model.quantities)), tuple(notes)


def _elements(
    family: UnknownFamily, kind: str, unit: str, box: tuple[tuple[int, int], ...], authors: Authors
) -> Iterator[TracedQuantity]:
    for at in product(*(range(first, last + 1) for first, last in box)):
        name = f"{family.name}[{', '.join(map(str, at))}]" if at else family.name
        name = in_author_names(name, authors)
        yield TracedQuantity(name, var(family.name, kind, *(const(k) for k in at)), True, unit, family.place)
