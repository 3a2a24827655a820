"""Writes the files of `compile`: manifest.json, binding.json, sysdyn_model.h; residual.c, binding.c or residual.py."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from sysdyn.cli import whole_files
from sysdyn.cli.export.binding_c import binding_c, header
from sysdyn.cli.export.binding_json import binding_json
from sysdyn.cli.export.index_parameters import index_parameters
from sysdyn.cli.export.layout import Formed, tables
from sysdyn.cli.export.naming import rows, unknowns
from sysdyn.compiler.binding.following import Following
from sysdyn.compiler.program.emit_numpy import emit_numpy

OUTSIDE = Path(__file__).with_name("outside.py")


def manifest_of(formed: Formed) -> dict[str, Any]:
    """The object of manifest.json for one index form, without `index_parameters`."""
    return {
        **formed.prepared.manifest,
        "index": formed.index,
        "index_form": formed.system.form.name,
        "unknowns": unknowns(formed),
        "rows": rows(formed),
    }


def texts(formed: Formed) -> Iterator[tuple[str, str]]:
    """Names and texts of the files, the manifest first."""
    numbers, following = tables(formed)
    manifest = {**manifest_of(formed), "index_parameters": index_parameters(formed, numbers, following)}
    yield "manifest.json", json.dumps(manifest, indent=1) + "\n"
    yield "binding.json", binding_json(formed, numbers, following)
    yield "sysdyn_model.h", header()
    compiled = formed.prepared.compiled
    if formed.prepared.backend == "c":
        yield "residual.c", compiled.text
        yield "binding.c", binding_c(numbers, following, compiled.form)
    else:
        yield "residual.py", _python(formed, following)


def _python(formed: Formed, following: Following) -> str:
    """The blocks, what follows from parameters, and the one-call functions."""
    compiled = formed.prepared.compiled
    first = len(compiled.program.routines)
    more = emit_numpy(following.program, compiled.form, head="# what follows from given parameters", first=first)
    return "\n\n".join([compiled.text, more, OUTSIDE.read_text(encoding="utf-8")])


def write(formed: Formed, folder: Path) -> dict[str, Any]:
    """Writes all files into a folder, which is made where it is not there; the manifest.  OSError."""
    made = list(texts(formed))
    folder.mkdir(parents=True, exist_ok=True)
    for name, text in made:
        whole_files.write(folder / name, text)
    found: dict[str, Any] = json.loads(made[0][1])
    return found
