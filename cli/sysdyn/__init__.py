"""The package itself: its version; `python -m sysdyn` is the command.  Everything else is in the packages below it."""

from sysdyn.distribution import warn_of_other

__version__ = "0.2.0"
"""As `pyproject.toml` has it (a test compares them): reading it from the installed metadata costs 12 ms a command."""

warn_of_other()


def __dir__() -> list[str]:
    return ["__version__", "api"]
