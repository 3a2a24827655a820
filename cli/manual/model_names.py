"""The names of a model as a table and as JSON: parameters with values, what can be read, components, scenes."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

from sysdyn.cli.page.columns import align
from sysdyn.dsl.format.format import format_expression
from sysdyn.dsl.load import Listing, ParsedFile
from sysdyn.dsl.model.network import Parameter
from sysdyn.dsl.model.values import Values
from sysdyn.dsl.tree import syntax

_FIRST = 3
"""Elements of an array that the table shows."""
_ROUND = 12
"""Digits shown of a value: those that a change of units spoils are left out."""


def account(document: ParsedFile, model: syntax.ModelDefinition, found: Listing) -> dict[str, Any]:
    """Everything about a model as the JSON object of `sysdyn list`."""
    docs = {s.decl.name: s.doc for s in model.body if isinstance(s, (syntax.ParamStatement, syntax.InputStatement))}
    parameters: list[dict[str, Any]] = []
    inputs: list[dict[str, Any]] = []
    # parameters and inputs with their values
    for name, parameter in found.parameters.items():
        values = _values(parameter, found.known)
        entry = {"name": name + _shape(parameter, found.known), "unit": parameter.unit.text, "value": values}
        entry |= {"doc": docs.get(name), "line": parameter.place.start[0], "file": parameter.place.file}
        (inputs if name in found.inputs else parameters).append(entry)
    held = {i["name"] for i in inputs}
    statements = {s.decl.name: s for s in model.body if isinstance(s, syntax.InputStatement)}
    # inputs by formulas
    for name in found.inputs:
        if name not in held:
            value, unit = statements[name].value, statements[name].unit.text
            text = None if value is None else format_expression(value)
            inputs.append({"name": name, "unit": unit, "value": text, "doc": docs.get(name)})
    return {
        "model": model.name.name,
        "doc": model.doc,
        "parameters": parameters,
        "inputs": inputs,
        "readable": [{"name": r.name, "object": r.object, "kind": r.kind, "unit": r.unit} for r in found.readable],
        "components": [
            {"path": i.path, "component": i.component, "levels": list(i.levels), "level": i.level}
            for i in found.instances
        ],
        "scenes": [_scene(s) for s in document.scenes.values() if s.model.names == (model.name.name,)],
    }


def _values(parameter: Parameter, known: Values) -> float | list[float] | None:
    """The value in the parameter's own unit; those of the first elements of an array; None where it has none."""
    if not parameter.values:
        return None
    if not parameter.shape:
        return _in_unit(known.number(parameter.values[0]), parameter)
    # a matrix has no list here
    if len(parameter.shape) > 1:
        return None
    first, last = (known.number(n) for n in parameter.shape[0])
    if not (math.isfinite(first) and math.isfinite(last)):
        return None
    # one more than are shown, so that the reader sees there are more
    indices = range(int(first), min(int(last), int(first) + _FIRST) + 1)
    return [_in_unit(known.element(parameter.name, i), parameter) for i in indices]


def _in_unit(value: float, parameter: Parameter) -> float:
    unit = parameter.unit
    number = (value - float(unit.offset)) / float(unit.scale)
    return float(f"{number:.{_ROUND}g}") if math.isfinite(number) else number


def _shape(parameter: Parameter, known: Values) -> str:
    """Its ranges, as in `m[1..4]`."""
    if not parameter.shape:
        return ""
    bounds = [[known.number(n) for n in pair] for pair in parameter.shape]
    return f"[{', '.join(f'{a:g}..{b:g}' for a, b in bounds)}]"


def _scene(scene: syntax.SceneDefinition) -> dict[str, Any]:
    """Name, span, what is traced, and what is set."""
    found: dict[str, Any] = {"name": scene.name.name, "doc": scene.doc, "time": None, "trace": [], "set": []}
    for s in scene.body:
        if isinstance(s, syntax.TimeStatement):
            found["time"] = f"{format_expression(s.start)} to {format_expression(s.stop)}"
        elif isinstance(s, syntax.TraceStatement):
            found["trace"] += [i.alias.name if i.alias else format_expression(i.expr) for i in s.items]
        elif isinstance(s, syntax.SetStatement):
            found["set"].append(f"{format_expression(s.target)} = {format_expression(s.value)}")
        elif isinstance(s, syntax.SceneLevelStatement):
            found["set"].append(f"level {format_expression(s.target)} = {s.level.name}")
    return found


def table(accounts: list[dict[str, Any]]) -> str:
    """The accounts of a file's models for a person."""
    return "\n\n".join("\n".join(_lines(a)) for a in accounts)


def _lines(a: dict[str, Any]) -> list[str]:
    lines = [f"model {a['model']}" + (f": {_first_line(a['doc'])}" if a["doc"] else "")]
    lines += _section("parameters (--set NAME=VALUE)", [_parameter_row(p) for p in a["parameters"]])
    lines += _section("inputs (--set NAME=EXPRESSION)", [_parameter_row(p) for p in a["inputs"]])
    lines += _section("to trace, and to read in laws and expectations", _readable_rows(a["readable"]))
    some = [c for c in a["components"] if c["levels"]]
    levels = [(c["path"], c["component"], _levels(c)) for c in some]
    lines += _section("levels (--level PATH=NAME; * is chosen)", levels)
    scenes = [(s["name"], s["time"] or "no time", f"traces {', '.join(s['trace'])}") for s in a["scenes"]]
    return lines + _section("scenes (--scene NAME)", scenes)


def _section(title: str, rows: Sequence[tuple[str, ...]]) -> list[str]:
    return ["", title, *(f"  {line}" for line in align(rows).splitlines())] if rows else []


def _parameter_row(p: dict[str, Any]) -> tuple[str, ...]:
    """Name, value with unit, and first line of the text of a parameter."""
    value = p["value"]
    unit = "" if p["unit"] == "1" else f" {p['unit']}"
    if value is None:
        text = f"required, in {p['unit']}" if unit else "required"
    elif isinstance(value, list):
        shown = ", ".join(f"{v:.6g}" for v in value[:_FIRST])
        text = f"[{shown}{', ...' if len(value) > _FIRST else ''}]{unit}"
    else:
        text = value if isinstance(value, str) else f"{value:.{_ROUND}g}{unit}"
    return p["name"], text, _first_line(p["doc"] or "")


def _readable_rows(readable: list[dict[str, str]]) -> list[tuple[str, ...]]:
    """A row for each object: what it is, and what can be read of it with units."""
    rows: dict[tuple[str, str], list[str]] = {}
    for r in readable:
        owner, tail = r["object"], r["name"].removeprefix(r["object"])
        tail = tail if tail.startswith(".") else r["name"]
        unit = "" if r["unit"] == "1" else f" {r['unit']}"
        rows.setdefault((owner, r["kind"]), []).append(f"{tail}{unit}")
    return [(owner, kind, ", ".join(tails)) for (owner, kind), tails in rows.items()]


def _levels(component: dict[str, Any]) -> str:
    return ", ".join(f"{name}*" if name == component["level"] else name for name in component["levels"])


def _first_line(text: str) -> str:
    return text.strip().splitlines()[0] if text.strip() else ""
