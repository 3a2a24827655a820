"""A lock: the setting that `trade --lock` chose for each scene of a file, taken where nothing else is said.

`<model>.sd.lock` (TOML) holds hashes of the text, of the files that it imports and of its tables, the version that
wrote it, and for each scene formulation, index, method, levels and the tolerance with which the accuracy control
begins.  The command line wins over the scene, the scene over the lock.  Index and method were measured together: they
are taken together, in the formulation in which they were.  A lock that is out of date is ignored, with W921.
"""

from __future__ import annotations

import hashlib
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from sysdyn.cli import whole_files
from sysdyn.cli.options import FORMULATIONS, INDICES
from sysdyn.cli.plain_files import tables
from sysdyn.cli.run.request.targets import Target
from sysdyn.cli.whole_files import toml_text
from sysdyn.dsl.parser.parse import parse
from sysdyn.dsl.text.diagnostics import Place, Report, SourceText
from sysdyn.dsl.text.source import real
from sysdyn.dsl.tree import syntax
from sysdyn.values import dataclass

SUFFIX = ".lock"
FORMAT = 1
METHODS = ("bdf", "radau", "rosenbrock", "dopri")
UNREADABLE = (OSError, ValueError, TypeError, KeyError, AttributeError)
"""What reading a lock that is no lock may raise (those of TOML and of decoding are ValueErrors)."""


@dataclass(frozen=True, slots=True)
class Lock:
    """What was chosen for one scene.  levels: (path, name); tolerance: of the solver, with which the accuracy control
    begins; accuracy: for which it was measured.
    """

    formulation: str
    index: str
    method: str
    levels: tuple[tuple[str, str], ...]
    tolerance: float
    accuracy: float


@dataclass(frozen=True, slots=True)
class Taken:
    """What a run takes of a lock; None where the command line or the scene says otherwise.  text: for the trace."""

    formulation: str | None
    index: str | None
    method: str | None
    levels: tuple[tuple[str, str], ...]
    tolerance: float | None
    accuracy: float
    text: str


def path_of(file: str) -> Path:
    """Where the lock of a model's file is."""
    return Path(file + SUFFIX)


def hashes(target: Target) -> dict[str, str]:
    """sha256 of the text, of what it imports from its own folder, and of its tables' files, by name beside it."""
    found: dict[str, str] = {}
    file = target.document.file
    top = real(file.source.name).parent

    def name(path: Path) -> str:
        return path.relative_to(top).as_posix() if path.is_relative_to(top) else str(path)

    def take(path: Path, items: tuple[syntax.TopLevel, ...]) -> None:
        # two files that import each other
        if name(path) in found:
            return
        found[name(path)] = hashlib.sha256(path.read_bytes()).hexdigest()
        for other in _files(path.parent, items):
            # an import, with what it imports; else a table's file
            if other.is_file() and other.suffix == ".sd":
                take(other, parse(SourceText.read(other))[0].items)
            elif other.is_file():
                found[name(other)] = hashlib.sha256(other.read_bytes()).hexdigest()

    take(real(file.source.name), file.items)
    return dict(sorted(found.items()))


def _files(folder: Path, items: tuple[syntax.TopLevel, ...]) -> Iterator[Path]:
    """Files that the statements of a file read, without the library."""
    for item in items:
        if isinstance(item, syntax.Import) and item.module.names[0] != "std":
            yield real(folder.joinpath(*item.module.names).with_suffix(".sd"))
        elif isinstance(item, syntax.TableDefinition) and item.file is not None:
            path = real(folder / item.file)
            if path.is_relative_to(folder):
                yield path


# --- reading ------------------------------------------------------------------------------------------------------


def read(file: str, target: Target, version: str, report: Report) -> Lock | None:
    """The lock of a scene; None where there is none, or where W921 says why it is ignored."""
    path = path_of(file)
    if file == "-" or not path.is_file():
        return None
    try:
        held = tables(path)
        stale = _stale(held, target, version)
        found = None if stale else _scene(held, target)
    except UNREADABLE as error:
        stale, found = f"it cannot be read: {str(error) or type(error).__name__}", None
    if stale:
        source = target.document.file.source
        span = target.scene.name.span if target.scene else target.model.name.span
        help_ = "sysdyn trade --lock measures anew; --no-lock leaves it aside"
        report.warning("W921", f"{path.name} is ignored: {stale}", Place(source, span), help=help_)
    return found


def _stale(held: Mapping[str, Any], target: Target, version: str) -> str:
    """Why a lock no longer holds; "" where it does."""
    if held["version"] != FORMAT or held["sysdyn"] != version:
        return f"sysdyn {held['sysdyn']} wrote it, this is {version}"
    now = hashes(target)
    changed = sorted(name for name in now.keys() | held["files"].keys() if now.get(name) != held["files"].get(name))
    return f"{', '.join(changed)} changed since it was measured" if changed else ""


def _scene(held: Mapping[str, Any], target: Target) -> Lock | None:
    """The lock of a scene; None where there is none, ValueError where it names what there is not."""
    said = held.get("scene", {}).get(target.scene.name.name if target.scene else "")
    if said is None:
        return None
    found = Lock(
        said["formulation"],
        said["index"],
        said["method"],
        tuple((str(path), str(name)) for path, name in said.get("level", {}).items()),
        float(said["tolerance"]),
        float(said["accuracy"]),
    )
    known = found.formulation in FORMULATIONS and found.index in INDICES and found.method in METHODS
    if not known or not 0.0 < found.tolerance < 1.0:
        raise ValueError(f"{found.formulation}, index {found.index}, {found.method} at {found.tolerance:g}")
    return found


def settings_from_lock(
    lock: Lock,
    target: Target,
    formulation: str | None,
    index: str | None,
    method: str | None,
    levels: tuple[tuple[str, str], ...],
) -> Taken:
    """What is left of a lock beside the command line and the scene; nothing where that names another level."""
    # another level was asked for: nothing measured holds
    if any(dict(levels).get(path, name) != name for path, name in lock.levels):
        return Taken(None, None, None, (), None, lock.accuracy, "")
    body = target.scene.body if target.scene else ()
    scene = next((s.name.name for s in body if isinstance(s, syntax.FormulationStatement)), None)
    solver = next((s for s in body if isinstance(s, syntax.SolverStatement)), None)
    # what the command line and the scene say already
    here = formulation or scene
    same = here in (None, lock.formulation)
    by_scene = any(a.name == "index" for a in (solver.args or ())) if solver else False
    # index, method and tolerance were measured together: all of them or none
    both = same and index in (None, lock.index) and method in (None, lock.method)
    both = both and not by_scene and (solver is None or method is not None)
    source = target.document.file.source
    said = [_path(source, s.target) for s in body if isinstance(s, syntax.SceneLevelStatement)]
    above = {*(path for path, _ in levels), *said}
    # levels that nobody names
    rest = tuple((path, name) for path, name in lock.levels if path not in above)
    parts = [f"formulation {lock.formulation}"] if here is None else []
    parts += [f"index {lock.index}", f"method {lock.method}", f"tolerance {lock.tolerance:g}"] if both else []
    parts += [f"level {path} = {name}" for path, name in rest]
    return Taken(
        lock.formulation if here is None else None,
        lock.index if both else None,
        lock.method if both else None,
        rest,
        lock.tolerance if both else None,
        lock.accuracy,
        ", ".join(parts),
    )


def _path(source: SourceText, target: syntax.Expr) -> str:
    """The path of a scene's `level PATH = NAME` as the command line writes it."""
    return "".join(source.text[target.span.start : target.span.end].split())


# --- writing ------------------------------------------------------------------------------------------------------


def write(file: str, target: Target, lock: Lock, version: str) -> Path:
    """The lock of a scene into the file's lock; other scenes of it stay where they still hold."""
    path = path_of(file)
    held: dict[str, Any] = {}
    if path.is_file():
        try:
            held = tables(path)
            held = {} if _stale(held, target, version) else held
        except UNREADABLE:
            held = {}
    scenes: dict[str, dict[str, Any]] = dict(held.get("scene", {}))
    scenes[target.scene.name.name if target.scene else ""] = {
        "formulation": lock.formulation,
        "index": lock.index,
        "method": lock.method,
        "tolerance": lock.tolerance,
        "accuracy": lock.accuracy,
        "level": dict(lock.levels),
    }
    whole_files.replace(path, _text(hashes(target), version, scenes))
    return path


def _text(files: Mapping[str, str], version: str, scenes: Mapping[str, Mapping[str, Any]]) -> str:
    """Text of the lock file."""
    lines = ["# Written by sysdyn trade --lock, read by sysdyn simulate; out of date once a file below changes."]
    lines += [f"version = {FORMAT}", f"sysdyn = {toml_text(version)}", "", "[files]"]
    lines += [f"{toml_text(name)} = {toml_text(value)}" for name, value in files.items()]
    for name, said in sorted(scenes.items()):
        lines += ["", f"[scene.{toml_text(name)}]"]
        for key in ("formulation", "index", "method"):
            lines.append(f"{key} = {toml_text(str(said[key]))}")
        for key in ("tolerance", "accuracy"):
            lines.append(f"{key} = {float(said[key])!r}")
        levels = ", ".join(
            f"{toml_text(path)} = {toml_text(str(level))}" for path, level in said.get("level", {}).items()
        )
        lines.append(f"level = {{ {levels} }}" if levels else "level = {}")
    return "\n".join(lines) + "\n"
