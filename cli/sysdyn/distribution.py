"""The name of this project on the package index, and the other project that is called `sysdyn` there.

The command and the import are `sysdyn`; the distribution is NAME.  TAKEN belongs to strangers, whose files go into the
same folder `sysdyn`: nothing here may advise to install it, and an installation of both is told.
"""

from __future__ import annotations

import functools
import re
import warnings
from pathlib import Path

NAME = "sysdyn-compiler"
TAKEN = "sysdyn"
WHEELS = "wheels"
"""Folder of a user's project for a wheel of this distribution, where no index and no repository has it."""
_METADATA = re.compile(rf"{TAKEN}-\d[^-]*(?:-.*)?\.(?:dist|egg)-info")


def find_other(site: Path) -> str | None:
    """Name of the metadata of a distribution called TAKEN in a folder of packages; None where there is none."""
    try:
        return next((path.name for path in site.iterdir() if _METADATA.fullmatch(path.name)), None)
    except OSError:
        return None


def advise(other: str) -> str:
    """The remedy for an installation beside the other project's."""
    return (
        f"another distribution called '{TAKEN}' ({other}) is installed into the same folder: "
        f"pip uninstall {TAKEN} {NAME}, then install {NAME} again, or keep them in two environments"
    )


@functools.cache
def warn_of_other() -> None:
    """Warn, once, where the other project is installed beside this one; looks into one folder, in 0.1 ms."""
    if other := find_other(Path(__file__).parents[1]):
        warnings.warn(advise(other), RuntimeWarning, stacklevel=2)


def requirement(version: str) -> str:
    """What `pip install` is given to get this very project, by where pip found this installation (PEP 610).

    From the index: name and version.  From a repository: its address and commit.  From a folder or a file: a wheel
    that the project itself holds in WHEELS, for a name that nobody has published may be a stranger's tomorrow.
    """
    import json
    from importlib.metadata import PackageNotFoundError, distribution

    try:
        found = distribution(NAME).read_text("direct_url.json")
    except PackageNotFoundError:  # run from the sources
        found = "{}"
    if found is None:
        return f"{NAME}=={version}"
    origin = json.loads(found)
    if vcs := origin.get("vcs_info"):
        return f'"{NAME} @ {vcs["vcs"]}+{origin["url"]}@{vcs["commit_id"]}"'
    return f"{WHEELS}/{NAME.replace('-', '_')}-*"
