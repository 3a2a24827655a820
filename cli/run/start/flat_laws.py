"""Laws without a slope at a state, by the elements that have them: a balance of efforts holds those of several."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator

from sysdyn.cli.run.prepare import Prepared
from sysdyn.dsl.model.calculus import derivative
from sysdyn.dsl.model.expression import Node, variables
from sysdyn.dsl.text.diagnostics import Place
from sysdyn.runtime.model.failures import NoSuchForm, RowLabel
from sysdyn.runtime.model.slopes import no_slope


def by_element(prepared: Prepared, rows: Iterable[RowLabel]) -> tuple[RowLabel, ...]:
    """Rows of balances as those of the elements whose laws, other than linear, stand in them."""
    found = [label for row in rows for label in (tuple(_laws(prepared, row)) or (row,))]
    return tuple(dict.fromkeys(found))


def impossible(prepared: Prepared, error: NoSuchForm) -> tuple[str, tuple[RowLabel, ...]]:
    """The sentence of a form that does not exist, and the laws in its way."""
    laws = by_element(prepared, error.rows)
    return (str(error).replace(no_slope(error.rows), no_slope(laws)) if laws else str(error)), laws


def _laws(prepared: Prepared, row: RowLabel) -> Iterator[RowLabel]:
    """Laws that bend in the flow of a row's owner: works, and contents by their derivative."""
    owner, bracket, index = row.label.partition("[")
    network = prepared.compiled.network
    said: list[tuple[Node, Place]] = [(w.effort, w.place) for w in network.works]
    for energy in network.energies:
        if energy.function == "D":
            own = (n for n in variables(energy.expression) if n.op == "var" and n.data[:2] == (owner, "f"))
            said += [(derivative(energy.expression, flow), energy.place) for flow in own]
    for effort, place in said:
        for flow in variables(effort):
            bent = flow.op == "var" and flow.data[:2] == (owner, "f") and variables(derivative(effort, flow))
            if bent and place.element and row.kind == "dynamics":
                label = re.sub(r"\[.*", "", place.element) + bracket + index
                yield RowLabel(label, "law", place.file, place.start[0], row.slope)
                break
