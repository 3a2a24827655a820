"""How the extension module of this room is built: `build_ext` of setuptools, with one compiler a core of the machine.

`pyproject.toml` names the class.  It is read while a distribution is built, and never where sysdyn runs.
"""

from __future__ import annotations

import os
from concurrent.futures import ThreadPoolExecutor
from typing import Any

from setuptools.command.build_ext import build_ext


class BuildCore(build_ext):
    """Compiles the sources of an extension side by side; setuptools itself compiles them one after the other."""

    def build_extensions(self) -> None:
        """Build as setuptools does, but each source file by a compiler process of its own."""
        compile_one_by_one = self.compiler.compile

        def compile_side_by_side(sources: list[str], **options: Any) -> list[str]:
            with ThreadPoolExecutor(os.cpu_count() or 1) as pool:
                built = pool.map(lambda source: compile_one_by_one([source], **options), sources)
                return [path for objects in built for path in objects]

        self.compiler.compile = compile_side_by_side
        super().build_extensions()
