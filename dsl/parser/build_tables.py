"""How the parser's tables come into a distribution: `build_py` of setuptools, which lets lark build them first.

`pyproject.toml` names the class.  It is read while a distribution is built, and never where sysdyn runs.
"""

from __future__ import annotations

import runpy
from pathlib import Path

from setuptools.command.build_py import build_py


class BuildTables(build_py):
    """Writes the tables beside the grammar, then copies modules and data as setuptools does."""

    def run(self) -> None:
        """An editable install finds them there, a wheel takes a copy."""
        runpy.run_path(str(Path(__file__).with_name("grammar.py")))["write_tables"]()  # no package has a name yet
        super().run()
