"""`sysdyn new`: a project that runs."""

from __future__ import annotations

import contextlib
import io
import shlex
from pathlib import Path

import click
import sysdyn
from sysdyn import distribution
from sysdyn.cli.console import Console, with_console
from sysdyn.cli.failures import FAULT
from sysdyn.dsl.text.source import real


@with_console("new")
@click.argument("name", type=click.Path(path_type=Path))
def command(console: Console, name: Path) -> int:
    """Begin a project in the folder NAME: a model with scenes, a golden trace, a file for CI. It passes as it is."""
    from sysdyn.cli.project import skeleton

    folder = real(name)
    written = skeleton.write(folder)
    model = skeleton.model_name(folder)
    said = _record_golden(folder, f"{model}.sd")
    # the golden trace is recorded by a run, not copied
    kept = sorted(p for p in (folder / "golden").rglob("*") if p.is_file()) if said is None else []
    console.result = {"folder": str(name), "files": [str(p.relative_to(folder)) for p in (*written, *kept)]}
    if said is not None:
        console.complain(f"{name}: no golden trace could be recorded: {said}", FAULT)
        return console.finish(FAULT)
    if not console.quiet:
        console.data("\n".join(str(name / p.relative_to(folder)) for p in (*written, *kept)))
    # installed from a folder or a file: CI takes a wheel that the project holds
    if distribution.requirement(sysdyn.__version__).startswith(distribution.WHEELS):
        console.say(f"CI installs {distribution.NAME} from {distribution.WHEELS}/: put a wheel of it there (pip wheel)")
    console.say(f"next: cd {shlex.quote(str(name))}; sysdyn simulate {model}.sd --scene {skeleton.GOLDEN_SCENE}")
    return console.finish()


def _record_golden(folder: Path, file: str) -> str | None:
    """Record the golden trace of a new project; what went wrong, None where nothing did."""
    from sysdyn.cli.main import run
    from sysdyn.cli.project.skeleton import GOLDEN_SCENE

    said, out = io.StringIO(), io.StringIO()
    with contextlib.chdir(folder), contextlib.redirect_stderr(said), contextlib.redirect_stdout(out):
        code = run(["golden", "record", file, "--scene", GOLDEN_SCENE, "--quiet"])
    return None if code == 0 else said.getvalue().strip() or f"exit {code}"
