"""`sysdyn.toml`, or `[tool.sysdyn]` of a `pyproject.toml`: how a project's commands are run by default.

The file is looked for in the folder of the first file on the command line (else the current one) and in those above;
the first that has one counts. What a scene says (accuracy, formulation, ...) is no configuration: the text says it.
"""

from __future__ import annotations

import glob
from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from sysdyn.cli.console import WHEN
from sysdyn.cli.failures import UsageError
from sysdyn.cli.options import BACKENDS, FORMATS
from sysdyn.cli.plain_files import UnfitError, inside, tables, text_of
from sysdyn.dsl.text.source import real

FILES = ("sysdyn.toml", "pyproject.toml")
_RUNS = ("simulate", "report", "sweep", "trade", "verify", "reduce")
_JOBS = ("check", "sweep", "trade", "verify")
_ALL: dict[str, tuple[str, Any]] = {
    "color": ("color", WHEN),
    "quiet": ("quiet", bool),
}
_RUN: dict[str, tuple[str, Any]] = {
    "backend": ("backend", BACKENDS),
    "progress": ("progress", WHEN),
    "max-steps": ("max_steps", int),
    "max-wall": ("max_wall", str),
}
KEYS: dict[str, dict[str, tuple[str, Any]]] = {
    "": _ALL | _RUN | {"jobs": ("jobs", int)},
    "check": {
        "files": ("files", list),
        "strict": ("strict", bool),
        "allow-unsupported": ("allow_unsupported", bool),
        "output-format": ("output_format", FORMATS),
        "jobs": ("jobs", int),
    },
    "diff": {"rtol": ("rtol", float), "atol": ("atol", float), "tau": ("tau", float)},
    "golden": {"folder": ("folder", str)},
    "simulate": _RUN,
    "sweep": _RUN | {"jobs": ("jobs", int)},
    "trade": _RUN | {"jobs": ("jobs", int)},
    "verify": _RUN | {"jobs": ("jobs", int)},
    "report": _RUN,
    "reduce": _RUN,
}
"""By table (`[tool.sysdyn]` itself is ""): key, the parameter of the command, type or choices."""
SAID = ("accuracy", "formulation", "index", "level", "method", "redundancy", "scene", "set", "solver", "until")
"""What a scene says, with words of its own or as the scene that is named."""


def project_defaults(arguments: Sequence[str], commands: Iterable[str]) -> dict[str, Any]:
    """What the project's file says, as click's map of defaults for each of the commands; {} where there is none.

    Raises UsageError with file and key where the file says what it cannot.
    """
    found = _found(arguments)
    if found is None:
        return {}
    path, said = found
    everywhere: dict[str, Any] = {}
    own: dict[str, dict[str, Any]] = {}
    for key, value in said.items():
        if key in KEYS and isinstance(value, Mapping):
            own[key] = dict(_read(path, key, name, inner) for name, inner in value.items())
        else:
            name, inner = _read(path, "", key, value)
            everywhere[name] = inner
    return _map(everywhere, own, commands)


def _map(everywhere: dict[str, Any], own: dict[str, dict[str, Any]], commands: Iterable[str]) -> dict[str, Any]:
    """Defaults of each command: those for all, then its own."""
    general = {name: value for name, value in everywhere.items() if name in ("color", "quiet")}
    runs = {name: value for name, value in everywhere.items() if name in {n for n, _ in _RUN.values()}}
    jobs = {name: value for name, value in everywhere.items() if name == "jobs"}
    found: dict[str, Any] = {}
    for command in commands:
        found[command] = general | (runs if command in _RUNS else {}) | (jobs if command in _JOBS else {})
        found[command] |= own.get(command, {})
    inner = general | own.get("golden", {})
    found["golden"] = {name: dict(inner) for name in ("record", "check", "accept", "list")}
    for name in ("record", "check", "accept"):
        found["golden"][name] |= jobs
    return found


def _found(arguments: Sequence[str]) -> tuple[Path, Mapping[str, Any]] | None:
    """The file that counts, and its table."""
    given = next((Path(a) for a in arguments[1:] if not a.startswith("-") and Path(a).exists()), Path())
    start = given if given.is_dir() else given.parent
    folder = real(start)
    for level in (folder, *folder.parents):
        for name in FILES:
            path = level / name
            try:
                text = text_of(path)
            except OSError:
                continue
            except UnfitError as error:
                raise UsageError(str(error)) from None
            if name == "pyproject.toml" and "[tool.sysdyn" not in text:
                continue
            return path, _table(path, text)
    return None


def _table(path: Path, text: str) -> Mapping[str, Any]:
    try:
        whole: Any = tables(path, text)
    except UnfitError as error:
        raise UsageError(str(error)) from None
    for key in ("tool", "sysdyn") if path.name == "pyproject.toml" else ():
        whole = whole.get(key, {}) if isinstance(whole, Mapping) else None
    if not isinstance(whole, Mapping):
        raise UsageError(f"{path}: [tool.sysdyn] is a table")
    return whole


def _read(path: Path, table: str, key: str, value: Any) -> tuple[str, Any]:
    """The parameter of a command that a key sets, and its value."""
    where = f"{path}: [{'.'.join(filter(None, ('tool.sysdyn' if path.name == 'pyproject.toml' else '', table)))}]"
    where = where.replace(" []", "")
    known = KEYS[table]
    if key not in known:
        raise UsageError(f"{where} has no key '{key}'{_instead(table, key)}")
    name, kind = known[key]
    # one of several words
    if isinstance(kind, tuple):
        if value not in kind:
            raise UsageError(f"{where} {key} = {value!r}: one of {', '.join(kind)}")
    # files, relative to the project's file
    elif kind is list:
        if not isinstance(value, list) or not all(isinstance(item, str) for item in value):
            raise UsageError(f"{where} {key} = {value!r}: a list of texts")
        value = [item for said in value for item in _files(path.parent, said, f"{where} {key}")]
    # a folder, likewise
    elif key == "folder" and isinstance(value, str):
        if "\0" in value:
            raise UsageError(f"{where} {key} = {value!r}: no name of a folder")
        value = str(_relative(path.parent / value))
    # true is no number, and a whole number is one
    elif isinstance(value, bool) != (kind is bool) or not isinstance(value, (kind, int) if kind is float else kind):
        names = {bool: "true or false", int: "a whole number", float: "a number", str: "a text"}
        raise UsageError(f"{where} {key} = {value!r}: {names[kind]}")
    return name, value


def _files(project: Path, said: str, where: str) -> Iterator[str]:
    """What an item of `files` names, inside the project's folder, links followed; UsageError where it is outside."""
    found = [project / said] if "\0" not in said else []
    # a pattern, unless a file has that very name
    if any(sign in said for sign in "*?[") and found and not found[0].exists():
        found = [Path(name) for name in sorted(glob.glob(str(found[0]), recursive=True))]  # noqa: PTH207
        found = found or [project / said]  # nothing fits: the command says so
    # a folder: links in it must not lead out of the project
    elif found and found[0].is_dir():
        links = (p for p in sorted(found[0].rglob("*.sd")) if p.is_symlink())
        found += [p for p in links if not inside(p, project)]
    outside = next((p for p in found if not inside(p, project)), None)
    if outside is not None or not found:
        raise UsageError(f"{where}: {str(outside or said)!r} is outside of {project}, the project's folder")
    return (str(_relative(p)) for p in found)


def _instead(table: str, key: str) -> str:
    """What could be meant by a key that there is not."""
    if key in SAID:
        return ": a scene says it"
    for other, keys in KEYS.items():
        if other != table and key in keys:
            return f": it belongs in [{other}]" if other else ": it stands above the tables"
    import difflib

    near = difflib.get_close_matches(key, [*KEYS[table], *(KEYS if not table else ())], 1, 0.5)
    return f"; nearest: '{near[0]}'" if near and near[0] else f"; there are {', '.join(KEYS[table])}"


def _relative(path: Path) -> Path:
    """A path from the current folder, where it lies below."""
    try:
        return real(path).relative_to(Path.cwd())
    except ValueError:
        return path
