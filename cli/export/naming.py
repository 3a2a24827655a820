"""Unknowns, rows and outputs of an index form by name, in the letters of their family.

Inside, the complementary forms are the primal ones on a reflected network, with the primal letters; outside an effort
is e, a momentum p, a displacement q, whatever the form.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from sysdyn.cli.export.tables import ExportTables
from sysdyn.cli.export.tabulation import Formed
from sysdyn.compiler.binding.manifest import family_entry, where
from sysdyn.compiler.model.mirror import family_name, letter, word
from sysdyn.dsl.text.diagnostics import Place
from sysdyn.runtime.model import description
from sysdyn.runtime.model.description import BASE, BESIDE, Family, RowFamily
from sysdyn.runtime.model.forms import nu_name


def unknowns(formed: Formed, *, si: bool = False) -> list[dict[str, Any]]:
    """Families of unknowns in the order of y; si: with the place of the first and its size."""
    form, system = formed.prepared.compiled.form, formed.system
    formulation, families = formed.prepared.formulation, formed.system.description.families
    state = system.form.name == "0"
    y, yd = formed.state.for_form(system)
    moving = system.differential(system.jacobian(formed.state.t, y, yd)[1])
    found: list[dict[str, Any]] = []
    place = 0
    # in the order of y, of the explicit form states alone
    for k, family in enumerate(families):
        if family.kind in BESIDE or (state and family.kind not in ("q", "f", "p", "s")):
            continue
        first = int(system.form.at[k])
        differential = state or family.kind == "q" or bool(np.any(moving[first : first + family.size]))
        kind = letter(formulation, family.kind)
        name = family_name(formulation, family.name, family.kind)
        plain = {"kind": kind, "unit": form.families[k].unit, "differential": differential}
        for own, size in _entries(name, family):
            found.append({**own, **plain, **(_slice_entry(place, size) if si else {})})
            place += size
    # the multipliers nu that index 2 adds
    for k in system.description.families_of("kappa") if system.unknowns > system.form.written else ():
        family = families[k]
        plain = {"kind": "nu", "unit": _nu_unit(formed, k), "differential": False}
        for own, size in _entries(nu_name(family.name), family):
            found.append({**own, **plain, **(_slice_entry(place, size) if si else {})})
            place += size
    return found


def _entries(name: str, family: Family) -> list[tuple[dict[str, Any], int]]:
    """What says a family, and its size; one by one where the author wrote its elements so."""
    if not family.elements:
        return [(family_entry(name, family.shape), family.size)]
    return [({"name": family.name_of(k, name)}, 1) for k in range(family.size)]


def _nu_unit(formed: Formed, kappa: int) -> str:
    """The unit of the nu beside a kappa: q' = f - Phi_q^T nu; "" where displacements differ in unit and it has none."""
    description = formed.system.description
    units = {description.families[k].unit for k in description.families_of("q")}
    owner = description.families[kappa].owner
    of_phi = {row.unit for row in description.rows if row.block == "phi" and owner in (row.owner, row.label)}
    return f"({units.pop()})^2/(s.({of_phi.pop()}))" if len(units) == len(of_phi) == 1 else ""


def _slice_entry(place: int, size: int) -> dict[str, int]:
    return {"place": place, "size": size}


def elements(formed: Formed) -> tuple[str, ...]:
    """The name of every unknown, in the order of y."""
    formulation, system = formed.prepared.formulation, formed.system
    names: list[str] = []
    for place in range(system.unknowns):
        family = int(system.family_of[place])
        kind = str(system.kinds[place])
        if system.form.name == "0" and kind not in ("q", "f", "p", "s"):
            continue
        name = system.name(place)
        if family >= 0 and formulation.startswith("co_"):
            head, bracket, index = name.partition("[")
            name = family_name(formulation, head, kind) + bracket + index
        names.append(name)
    return tuple(names)


def rows(formed: Formed) -> list[dict[str, Any]]:
    """Families of rows in the order of r: q' = f first, then the groups of the form."""
    form, system, formulation = formed.prepared.compiled.form, formed.system, formed.prepared.formulation
    families = system.description.families
    found: list[dict[str, Any]] = []
    # a slope for each state
    if system.form.name == "0":
        # q' = f, then groups as the form has them
        for k, family in enumerate(families):
            if family.kind in ("q", "f", "p", "s"):
                found += _labels(family.name, family, "slope", form.families[k].place)
        return found
    for k, family in enumerate(families):
        if family.kind == "q" and system.form.kinematics:
            found += _labels(family.name, family, "kinematic", form.families[k].place)
    for group, k, _ in system.form.groups:
        row = form.rows[k]
        kind = word(formulation, group if group in BASE else row.kind)
        found += _labels(row.label, system.description.rows[k], kind, row.place)
    return found


def _labels(name: str, family: Family | RowFamily, kind: str, place: Place | None) -> list[dict[str, Any]]:
    """Entries of the rows of a family: one, or one for each element that the author wrote."""
    if not family.elements:
        said = family_entry(name, family.shape)
        return [{"label": said.pop("name"), **said, "kind": kind, **where(place)}]
    each = (description.name_of(name, family.shape, family.elements, k) for k in range(family.size))
    return [{"label": label, "kind": kind, "file": file, "line": line} for label, file, line in each]


def outputs(tables: ExportTables) -> list[dict[str, Any]]:
    """Traced quantities in the order of w; row: of block observe."""
    return [{"name": output.name, "unit": output.unit, "row": output.place} for output in tables.outputs]
