"""The package itself: its version; `python -m sysdyn` is the command.  Everything else is in the packages below it."""

from __future__ import annotations

from typing import Any


def __getattr__(name: str) -> Any:
    """`__version__`, read where it is asked for: an import of the package stays fast."""
    if name == "__version__":
        from importlib.metadata import version

        return version("sysdyn")
    raise AttributeError(f"module 'sysdyn' has no attribute '{name}'")


def __dir__() -> list[str]:
    return ["__version__", "api"]
