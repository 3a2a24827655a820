"""The manifest of a compiled model: CONTRACT's keys for one binding, and `structure` for the runtime (model.h).

A scalar has one entry under its name.  A family has one entry for all its elements, named `x[1..1000]`, with its
`shape` as [[first, last], ...]: the manifest of a chain of 10^5 links is as short as that of ten.
"""

from __future__ import annotations

import re
from typing import Any

from sysdyn.compiler.binding.binding import Binding
from sysdyn.compiler.forms.descriptor import BESIDE, DescriptorForm, EquationFamily, Unknowns
from sysdyn.compiler.formulations import COMPLEMENTARY
from sysdyn.compiler.model.integers import FamilyReference, Index
from sysdyn.compiler.model.mirror import family_name, letter
from sysdyn.compiler.model.parameters import Extents
from sysdyn.compiler.network.authors import Authors, owner
from sysdyn.compiler.program.program import KernelPattern, Program
from sysdyn.dsl.model.network import Network
from sysdyn.dsl.model.units import Unit
from sysdyn.dsl.text.diagnostics import Place


def structure(form: DescriptorForm, program: Program, network: Network) -> dict[str, Any]:
    """What the runtime needs beside the code: families, rows, blocks, constraints that hold at times, places in p of
    laws that may slide; no numbers of a binding.
    """
    elements = {family: [[n, p.file, p.start[0]] for n, p in each] for family, each in network.authors.items()}

    def element_list(name: str) -> dict[str, Any]:
        """[name, file, line] of each element of a gathered family, from index 0 on: one list for all that it holds."""
        family = owner(name, network.authors)
        return {} if family is None else {"elements": elements[family]}

    return {
        "complementary": form.formulation in COMPLEMENTARY,
        "branches": [program.scalars.index(k.branch) for k in form.kinks if k.slide],
        "switches": [{"owner": s.label, "at": list(s.at)} for s in network.switches if s.holds is None],
        "families": [_family(f) | element_list(f.name) for f in form.families],
        "rows": [_row(r) | element_list(r.label) for r in form.rows],
        "blocks": {name: {"kernels": [_kernel(k) for k in patterns]} for name, patterns in program.patterns},
    }


def _family(family: Unknowns) -> dict[str, Any]:
    plain = {"name": family.name, "kind": family.kind, "owner": family.owner, "unit": family.unit}
    return {**plain, "nominal": None, **where(family.place)}


def _row(row: EquationFamily) -> dict[str, Any]:
    found = {"block": row.block, "label": row.label, "owner": row.owner, "kind": row.kind, **where(row.place)}
    found |= {"unit": row.unit, "rate": row.rate}
    if row.block == "observe":
        found |= {"name": row.label, "stored": row.stored}
    if row.block == "initial":
        found |= {"content": row.content}
    return found


def where(place: Place | None) -> dict[str, Any]:
    """File and line of a place, for an entry."""
    return {"file": place.file if place else None, "line": place.start[0] if place else None}


def _kernel(pattern: KernelPattern) -> dict[str, Any]:
    """Entry of a kernel: loops, rows, entries of both Jacobians, and what its values read."""
    return {
        "loops": [[_bound(a), _bound(b)] for a, b in pattern.loops],
        "rows": [_reference(r) for r in pattern.rows],
        "dy": [[_reference(r), _reference(c)] for r, c in pattern.dy],
        "dyd": [[_reference(r), _reference(c)] for r, c in pattern.dyd],
        "reads": list(pattern.reads),
        "rates": list(pattern.rates),
        "curved": list(pattern.curved),
        "bent": list(pattern.bent),
    }


def _bound(index: Index) -> int | list[int]:
    """A slot; [loop, slot, constant] where an inner bound follows an outer loop."""
    return [index.loop, index.slot, index.constant] if index.loop >= 0 else index.slot


def _reference(place: FamilyReference) -> list[Any]:
    return [place.family, [i.as_list() for i in place.indices]]


def manifest(
    network: Network, form: DescriptorForm, program: Program, binding: Binding, index: int | None = None
) -> dict[str, Any]:
    """The object of manifest.json."""
    scene = network.scene.name if network.scene is not None else None
    branches = {k.branch for k in form.kinks}
    return {
        "version": 1,
        "model": network.model,
        "scene": scene,
        "formulation": form.formulation,
        "index": index,
        "unknowns": _unknowns(form, program, binding, network.authors),
        "rows": _rows(form, binding, network.authors),
        "parameters": [
            {"name": p.name, "unit": p.unit.text, "value": _plain(_in_unit(binding.values[p.name], p.unit))}
            for p in network.parameters
            if p.name not in branches and not p.name.startswith("#")
        ],
        "structure": structure(form, program, network),
    }


def _in_unit(value: Any, unit: Unit) -> Any:
    """A value in SI as one in a unit: (value - offset)/scale."""
    return value if unit.scale == 1 and not unit.offset else (value - float(unit.offset)) * float(1 / unit.scale)


def _plain(value: Any) -> Any:
    return value if isinstance(value, float) else value.tolist()


def family_entry(name: str, box: Extents) -> dict[str, Any]:
    """The entry of a family: name[first..last] with its shape; the name alone for a scalar."""
    if not box:
        return {"name": name}
    inside = ", ".join(f"{first}..{last}" for first, last in box)
    head, mark, tail = (name, "", "") if name[-1] != "'" and "." not in name else _head(name)
    return {"name": f"{head}[{inside}]{mark}{tail}", "shape": [list(pair) for pair in box]}


def _head(name: str) -> tuple[str, str, str]:
    """X' and x.p with the index behind x."""
    if name.endswith("'"):
        return name[:-1], "'", ""
    head, _, tail = name.rpartition(".")
    return head, ".", tail


def _each(name: str, box: Extents, authors: Authors) -> list[dict[str, Any]]:
    """The entry of a family, or those of the elements of a gathered one."""
    family = owner(name, authors)
    if family is None:
        return [family_entry(name, box)]
    tail = re.sub(r"^\.\d+", "", name[len(family) :])
    return [{"name": authors[family][k][0] + tail} for k in range(box[0][0], box[0][1] + 1)]


def _unknowns(form: DescriptorForm, program: Program, binding: Binding, authors: Authors) -> list[dict[str, Any]]:
    """Entries of all unknowns, element by element: name, kind, unit, and whether its rate stands in an equation."""
    moving = {
        column.family
        for name, patterns in program.patterns
        for pattern in (patterns if name in ("dynamics", "lambda") else ())
        for _, column in pattern.dyd
    }
    found = []
    for k, family in enumerate(form.families):
        if family.kind not in BESIDE:
            moves = family.kind == "q" or k in moving
            plain = {"kind": letter(form.formulation, family.kind), "unit": family.unit, "differential": moves}
            name = family_name(form.formulation, family.name, family.kind)
            found += [{**own, **plain} for own in _each(name, binding.shapes[k], authors)]
    return found


def _rows(form: DescriptorForm, binding: Binding, authors: Authors) -> list[dict[str, Any]]:
    """Rows of the form as written: q' = f first, then the equations in their order."""
    found = []
    for k, family in enumerate(form.families):
        if family.kind == "q":
            found += _labels(family.name, binding.shapes[k], "kinematic", family.place, authors)
    for k, row in enumerate(form.rows):
        if row.block in ("dynamics", "momentum", "phi", "psi", "gamma", "lambda"):
            found += _labels(row.label, binding.row_shapes[k], row.kind, row.place, authors)
    return found


def _labels(name: str, box: Extents, kind: str, place: Place | None, authors: Authors) -> list[dict[str, Any]]:
    """Entries of rows."""
    family, said = owner(name, authors), _each(name, box, authors)
    places = [place] if family is None else [p for _, p in authors[family][box[0][0] : box[0][1] + 1]]
    return [{"label": own.pop("name"), **own, "kind": kind, **where(p)} for own, p in zip(said, places, strict=True)]
