"""Which parameters may change the index of a model: those whose zero makes a matrix of the equations lose rank.

The text of a module does not depend on the index, its tables do: they are those of the parameters that were bound.
"""

from __future__ import annotations

import numpy as np
from sysdyn.cli.export.binding_json import parameters
from sysdyn.cli.export.tables import ExportTables
from sysdyn.cli.export.tabulation import Formed
from sysdyn.compiler.binding.following import Following
from sysdyn.compiler.forms.descriptor import DescriptorForm
from sysdyn.dsl.model.calculus import derivative
from sysdyn.dsl.model.expression import is_const, topological_unbound, variables
from sysdyn.dsl.text.diagnostics import ModelError
from sysdyn.runtime.structure.structure import index_of

LARGEST = 60
"""Unknowns up to which each parameter is tried at zero; above, all that stand before derivatives are named."""
MOST = 60
"""Parameters up to which each is tried."""
_INERTIAL = ("dynamics", "momentum", "lambda", "gamma")


def index_parameters(formed: Formed, tables: ExportTables, following: Following) -> list[str]:
    """Names of the parameters that may change the index, in the order of the manifest."""
    compiled = formed.prepared.compiled
    names = [p.name for p in compiled.network.parameters]
    suspects = _inertial(compiled.form)
    while True:  # those that the suspects follow from
        more = {used for name in suspects for used in following.follows.get(name, ())} - suspects
        if not more:
            break
        suspects |= more
    found = [name for name in names if name in suspects and name not in following.structural]
    if formed.system.unknowns > LARGEST or len(names) > MOST or tables.form == "0":
        return found
    boxes = formed.prepared.binding.parameters.boxes
    said = parameters(compiled.network, following, boxes)
    places = {item["name"]: slice(item["place"], item["place"] + item["size"]) for item in said}
    tried = {name for name in names if name not in following.structural and _changes(formed, places, following, name)}
    return [name for name in names if name in tried]


def _changes(formed: Formed, places: dict[str, slice], following: Following, name: str) -> bool:
    """Whether the index at the start is another one, or none, where a parameter is zero."""
    prepared, written = formed.prepared, formed.written
    arrays = dict(prepared.arrays)
    # other parameters are formulas of it: all are bound anew
    if any(name in used for used in following.follows.values()):
        try:
            arrays = prepared.arrays_of(prepared.compiled.bind({name: 0.0}))
        except (ModelError, ArithmeticError):
            return True
    else:
        arrays["p"] = arrays["p"].copy()
        arrays["p"][places[name]] = 0.0
    other = type(written)(prepared.structure, arrays, prepared.carrier)
    if written.left_out:
        other = other.without_constraints(written.left_out)
    jy, jyd = other.jacobian(formed.state.t, *formed.state.for_form(other))
    # 1/p: no number at zero
    if not (np.isfinite(jy).all() and np.isfinite(jyd).all()):
        return True
    return index_of(other, formed.state)[0] != formed.facts.index


def _inertial(form: DescriptorForm) -> set[str]:
    """Parameters in what multiplies derivatives, flows in momenta, and implicit unknowns in gammas."""
    found: set[str] = set()
    for block in form.blocks:
        if block.name not in _INERTIAL:
            continue
        for kernel in block.kernels:
            for row in kernel.rows:
                # the slope by a rate, by a flow in a momentum row, by an implicit unknown in a gamma
                for column in variables(row.expression):
                    if column.op == "var" and (column.data[2] == 1 or block.name in ("momentum", "gamma")):
                        value = derivative(row.expression, column)
                        if not is_const(value, 0.0):
                            found |= {n.data for n in topological_unbound([value]) if n.op == "param"}
    return found
