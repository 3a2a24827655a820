"""binding.json: what binding.c holds as C, with the names and units that C text never has (all numbers in SI)."""

from __future__ import annotations

import json
from dataclasses import fields, is_dataclass
from typing import Any

import numpy as np
from sysdyn.cli.export.naming import outputs, rows, unknowns
from sysdyn.cli.export.tables import ExportTables
from sysdyn.cli.export.tabulation import Formed
from sysdyn.compiler.binding.following import Following
from sysdyn.dsl.model.network import Network
from sysdyn.dsl.model.units import si_text

VERSION = 1


def binding_json(formed: Formed, tables: ExportTables, following: Following) -> str:
    """The text of binding.json: one line a key."""
    prepared = formed.prepared
    network = prepared.compiled.network
    pattern = tables.state or tables.system
    found: dict[str, Any] = {
        "version": VERSION,
        "model": network.model,
        "scene": network.scene.name if network.scene else None,
        "formulation": prepared.formulation,
        "index": formed.index,
        "form": tables.form,
        "t0": tables.t0,
        "parameters": parameters(network, following, prepared.binding.parameters.boxes),
        "unknowns": unknowns(formed, si=True),
        "rows": rows(formed),
        "outputs": outputs(tables),
        "p": tables.p,
        "y0": tables.y0,
        "yd0": tables.yd0,
        "scale": tables.scale,
        "differential": tables.differential,
        "sd_colptr": pattern.column,
        "sd_rowind": pattern.row,
        "tables": {f.name: getattr(tables, f.name) for f in fields(tables) if f.name not in _ABOVE},
    }
    # a line for each key: differences are read line by line
    lines = [f"{json.dumps(key)}: {_text(value)}" for key, value in found.items()]
    return "{\n" + ",\n".join(lines) + "\n}\n"


_ABOVE = ("form", "t0", "p", "y0", "yd0", "scale", "differential", "outputs")


def parameters(
    network: Network, following: Following, boxes: dict[str, tuple[tuple[int, int], ...]]
) -> list[dict[str, Any]]:
    """Each parameter: place in p, SI unit, shape, what it follows from, whether sizes depend on it."""
    found, place = [], 0
    # p holds scalars first, then arrays
    for scalar in (p for p in network.parameters if not p.shape):
        found.append((scalar, place, 1))
        place += 1
    for array in (p for p in network.parameters if p.shape):
        size = int(np.prod([max(last - first + 1, 0) for first, last in boxes[array.name]]))
        found.append((array, place, size))
        place += size
    return [
        {
            "name": p.name,
            "unit": si_text(p.unit.dimension),
            "place": first,
            "size": size,
            **({"shape": [list(pair) for pair in boxes[p.name]]} if p.shape else {}),
            "follows": list(following.follows.get(p.name, ())),
            "structural": p.name in following.structural,
        }
        for p, first, size in found
    ]


def plain(value: Any) -> Any:
    """Dataclasses, tuples and arrays as mappings and lists."""
    if isinstance(value, np.ndarray):
        return value.tolist()
    if is_dataclass(value) and not isinstance(value, type):
        return {f.name: plain(getattr(value, f.name)) for f in fields(value)}
    if isinstance(value, dict):
        return {key: plain(item) for key, item in value.items()}
    return [plain(item) for item in value] if isinstance(value, tuple | list) else value


def _text(value: Any) -> str:
    return json.dumps(plain(value), allow_nan=False)
