"""Which elements of an array of coordinates a kinetic store moves with: a range that the binding decides.

In `x[1..n]` with masses on 2..n, x[1] has no momentum; its row is 0 = U, not p' = U with p = 0, which would raise the
index.  The range's ends stand in loops as the parameters `#first x` and `#last x`.  Families of several indices, and
ranges with holes, are taken whole.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from sysdyn.compiler.model.energies import EnergyModel, UnknownFamily
from sysdyn.compiler.model.interpret import over
from sysdyn.compiler.model.parameters import Extents, Parameters
from sysdyn.compiler.model.terms import Nest, counter, local_variables
from sysdyn.dsl.model.expression import Node, add, const, param
from sysdyn.dsl.model.network import Loop, loop_ranges

Cover = tuple[str, tuple[tuple[Nest, Node], ...]]  # coordinate; where stores move with it: loops, index


def cover(model: EnergyModel, family: UnknownFamily, *, given: bool) -> Cover | None:
    """Where kinetic stores move with a family; None where they do with all of it, by the text alone."""
    m = model.mirror
    function, kind = (m.energy, m.conjugate) if given else (m.coenergy, m.rate)
    if len(family.shape) != 1:
        return None
    places = []
    # a term over the whole range that moves with each element covers the family
    for term in model.function(function):
        for node in local_variables(term.expression, kind):
            if node.data[0] == family.name:
                bounds = loop_ranges(term.loops)
                if bounds == family.shape and node.args == (counter(0),):
                    return None
                places.append((term.loops, node.args[0]))
    return family.name, tuple(places)


def inside(name: str) -> Nest:
    """The loop over the elements that a store moves with."""
    return (Loop("#0", param(f"#first {name}"), param(f"#last {name}")),)


def outside(family: UnknownFamily) -> tuple[Nest, Nest]:
    """The loops over the other elements, before and behind."""
    (first, last) = family.shape[0]
    before = Loop("#0", first, add(param(f"#first {family.name}"), const(-1)))
    return (before,), (Loop("#0", add(param(f"#last {family.name}"), const(1)), last),)


def bind_covers(covers: Sequence[Cover], owners: Mapping[str, Extents], parameters: Parameters) -> None:
    """Give the ends of all ranges their values."""
    for name, places in covers:
        first, last = owners[name][0]
        found = [over(nest, (at,), parameters.lookup)[0] for nest, at in places]
        elements = np.unique(np.rint(np.concatenate(found))) if found else np.zeros(0)
        low, high = (elements[0], elements[-1]) if len(elements) else (first, first - 1)
        if len(elements) and high - low + 1 != len(elements):  # holes: the whole family carries momenta
            low, high = first, last
        parameters.hidden[f"#first {name}"] = float(low)
        parameters.hidden[f"#last {name}"] = float(high)
