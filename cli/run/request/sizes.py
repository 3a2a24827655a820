"""Reduced sizes of large models: `ci.toml` in the folder above that of a model's file.

`[FOLDER.FILE]` holds for FOLDER/FILE.sd; each line `name = value` is one --set, its value a number or a text.
"""

from __future__ import annotations

from pathlib import Path

from sysdyn.cli.failures import UsageError
from sysdyn.cli.plain_files import UnfitError, tables
from sysdyn.dsl.text.source import real

NAME = "ci.toml"


def sizes(file: str) -> tuple[Path, tuple[tuple[str, str], ...]]:
    """The file of sizes of a model's file, and its settings for it: () where there is none.  OSError, UsageError."""
    model = real(file)
    path = model.parent.parent / NAME
    if file == "-" or not path.is_file():
        return path, ()
    try:
        listed = tables(path)
    except UnfitError as error:
        raise UsageError(str(error)) from error
    here = listed.get(model.parent.name, {})
    found = here.get(model.stem, {}) if isinstance(here, dict) else {}
    if not isinstance(found, dict):
        raise UsageError(f"{path}: '{model.parent.name}.{model.stem}' is no table of settings")
    return path, tuple((name, _text(path, name, value)) for name, value in found.items())


def _text(path: Path, name: str, value: object) -> str:
    if isinstance(value, str):
        return value
    if isinstance(value, int | float) and not isinstance(value, bool):
        return repr(value)
    raise UsageError(f"{path}: '{name}' is neither a number nor a text")
