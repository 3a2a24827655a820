"""A new project: a model with two scenes, a golden trace of one, a CI file; all of it passes as it is."""

from __future__ import annotations

import platform
import re
from pathlib import Path

import sysdyn
from sysdyn import distribution
from sysdyn.cli import whole_files
from sysdyn.cli.failures import UsageError
from sysdyn.dsl.parser.parse import parse
from sysdyn.dsl.text.diagnostics import SourceText

TEMPLATE = Path(__file__).parent / "template"
FILES = {
    "model.sd": "{name}.sd",
    "workflow.yml": ".github/workflows/models.yml",
    "README.md": "README.md",
    "gitignore": ".gitignore",
}
"""File of the template -> its place in the project."""
GOLDEN_SCENE = "free"


def model_name(folder: Path) -> str:
    """The name of model and file that a project in this folder has; UsageError where no model can be called so."""
    name = re.sub(r"[-. ]", "_", folder.name)
    if parse(SourceText("name", f"model {name} {{\n}}\n"))[1] or not name.isidentifier():
        raise UsageError(f"'{folder.name}' cannot be the name of a model: letters, digits and _, a letter first")
    return name


def write(folder: Path) -> list[Path]:
    """Write the files of a new project; those written.  UsageError where there is something already."""
    name = model_name(folder)
    if folder.exists() and (not folder.is_dir() or any(folder.iterdir())):
        raise UsageError(f"{folder} is there already and not empty: another name, or an empty folder")
    python = ".".join(platform.python_version_tuple()[:2])
    stated = {"NAME": name, "REQUIREMENT": distribution.requirement(sysdyn.__version__), "PYTHON": python}
    written = []
    for source, place in FILES.items():
        path = folder / place.format(name=name)
        path.parent.mkdir(parents=True, exist_ok=True)
        text = (TEMPLATE / source).read_text(encoding="utf-8")
        whole_files.write(path, re.sub(r"\b(?:NAME|REQUIREMENT|PYTHON)\b", lambda word: stated[word[0]], text))
        written.append(path)
    return written
