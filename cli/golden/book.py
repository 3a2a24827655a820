"""The golden folder on disk: a folder a model with its golden.toml, a thinned trace and a structure for each scene.

- golden/pendulum/golden.toml: tolerances, bounds, reasons, for people to read and edit
- golden/pendulum/swing.h5: the trace, thinned
- golden/pendulum/swing.json: equations, degrees of freedom, index, counts, compared exactly
"""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import field
from pathlib import Path
from typing import Any

import click
from sysdyn.cli import whole_files
from sysdyn.cli.failures import UsageError, instead
from sysdyn.cli.plain_files import UnfitError, inside, project, tables
from sysdyn.cli.whole_files import toml_text
from sysdyn.values import dataclass

BOOK = "golden.toml"
VERSION = 1


@dataclass(frozen=True, slots=True)
class Accepted:
    """One change that somebody accepted, and why."""

    reason: str
    change: str


@dataclass(frozen=True, slots=True)
class GoldenScene:
    """One scene of a model as it is kept.

    folder: of its golden.toml; model: file of the model; scene: "" for a model without one.  rtol, atol, tau [s]: the
    tube; accuracy: of the runs that are checked; error: of the trace itself, relative, measured; energy [J],
    constraints: bounds of the meters; formulations: those that are checked; settings: of the runs, NAME=VALUE.
    """

    folder: Path
    model: Path
    name: str
    scene: str
    rtol: float
    atol: float
    tau: float
    accuracy: float
    error: float
    energy: float
    constraints: float
    formulations: tuple[str, ...]
    settings: tuple[tuple[str, str], ...] = ()
    until: str | None = None
    accepted: tuple[Accepted, ...] = field(default=())

    @property
    def label(self) -> str:
        """For messages: pendulum/swing."""
        return f"{self.folder.name}/{self.name}"

    @property
    def trace(self) -> Path:
        """The thinned trace."""
        return self.folder / f"{self.name}.h5"

    @property
    def structure(self) -> Path:
        """The structure."""
        return self.folder / f"{self.name}.json"


class UnreadableGolden(click.ClickException):
    """A golden.toml that is none (exit 5)."""


def read(folder: Path) -> tuple[GoldenScene, ...]:
    """All goldens of one model's folder.  Raises Unreadable, OSError."""
    path = folder / BOOK
    try:
        data = tables(path)
    except UnfitError as error:
        raise UnreadableGolden(str(error)) from error
    try:
        if data["version"] != VERSION:
            raise UnreadableGolden(f"{path}: version {data['version']!r} is not known: a newer sysdyn wrote it")
        model = Path(os.path.normpath(folder / str(data["model"])))
        if not inside(folder / str(data["model"]), project(folder.parent)):
            raise UnreadableGolden(
                f"{path}: its model {data['model']!r} is outside of the project, {project(folder.parent)}"
            )
        return tuple(_entry(folder, model, name, item) for name, item in data["scenes"].items())
    except KeyError as error:
        raise UnreadableGolden(f"{path}: {error} is missing: sysdyn golden record writes it") from error
    except (TypeError, ValueError, AttributeError) as error:
        raise UnreadableGolden(f"{path}: {error}") from error


def _entry(folder: Path, model: Path, name: str, item: dict[str, Any]) -> GoldenScene:
    """A golden of the book's table; raises ValueError, KeyError or TypeError where it is damaged."""
    if Path(name).name != name or name in ("", ".", ".."):
        raise ValueError(f"'{name}' is no name of a scene")
    numbers = {k: float(item[k]) for k in ("rtol", "atol", "tau", "accuracy", "error", "energy", "constraints")}
    return GoldenScene(
        folder=folder,
        model=model,
        name=name,
        scene=str(item["scene"]),
        formulations=tuple(map(str, item["formulations"])),
        settings=tuple((str(k), str(v)) for k, v in item.get("settings", {}).items()),
        until=str(item["until"]) if "until" in item else None,
        accepted=tuple(Accepted(str(a["reason"]), str(a["change"])) for a in item.get("accepted", ())),
        **numbers,
    )


def find(root: Path, names: Sequence[str] = ()) -> tuple[GoldenScene, ...]:
    """Goldens below a folder: all, or those of the names (pendulum, pendulum/swing, pendulum.sd)."""
    found = [g for path in sorted(root.glob(f"*/{BOOK}")) for g in read(path.parent)]
    if not found:
        raise UsageError(f"{root} holds no golden traces: sysdyn golden record MODEL.sd makes one")
    chosen = []
    for name in names:
        here = [g for g in found if name in (g.label, g.folder.name, g.model.name, str(g.model), str(g.folder))]
        if not here:
            raise UsageError(f"{root} has no golden '{name}'; {instead(name, [g.label for g in found])}")
        chosen += here
    return tuple(dict.fromkeys(chosen)) if names else tuple(found)


def write(golden: GoldenScene) -> None:
    """Put one golden into its folder's golden.toml, the others as they are."""
    path = golden.folder / BOOK
    others = [g for g in (read(golden.folder) if path.is_file() else ()) if g.name != golden.name]
    lines = [
        "# Golden traces: `sysdyn golden check` compares, `sysdyn golden accept --reason ...` renews.",
        f"version = {VERSION}",
        f"model = {toml_text(Path(os.path.relpath(golden.model, golden.folder)).as_posix())}",
    ]
    for g in sorted([*others, golden], key=lambda g: g.name):
        lines += ["", *_lines(g)]
    whole_files.replace(path, "\n".join(lines) + "\n")


def _lines(g: GoldenScene) -> list[str]:
    """Lines of golden.toml about one golden, numbers as they are read back."""
    lines = [
        f"[scenes.{toml_text(g.name)}]",
        f"scene = {toml_text(g.scene)}",
        f"rtol = {g.rtol!r}  # of each quantity's nominal magnitude",
        f"atol = {g.atol!r}",
        f"tau = {g.tau!r}  # s",
        f"accuracy = {g.accuracy!r}  # of the runs that are checked",
        f"error = {float(f'{g.error:.2e}')!r}  # of the trace itself, measured",
        f"energy = {float(f'{g.energy:.2e}')!r}  # J, bound of audit.energy",
        f"constraints = {float(f'{g.constraints:.2e}')!r}  # bound of audit.constraints",
        f"formulations = [{', '.join(map(toml_text, g.formulations))}]",
    ]
    if g.until is not None:
        lines.append(f"until = {toml_text(g.until)}")
    if g.settings:
        lines.append("settings = { " + ", ".join(f"{toml_text(k)} = {toml_text(v)}" for k, v in g.settings) + " }")
    for a in g.accepted:
        lines += ["", f"[[scenes.{toml_text(g.name)}.accepted]]", f"reason = {toml_text(a.reason)}"]
        lines.append(f"change = {toml_text(a.change)}")
    return lines
