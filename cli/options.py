"""Options that several commands share."""

from __future__ import annotations

import importlib
from collections.abc import Callable
from functools import partial
from typing import TYPE_CHECKING, Any

import click
from sysdyn.cli.console import WHEN, with_console

if TYPE_CHECKING:
    from click.shell_completion import CompletionItem

FORMULATIONS = ["lagrangian", "hamiltonian", "co_lagrangian", "co_hamiltonian", "kane", "co_kane", "auto"]
EVERY = tuple(name for name in FORMULATIONS if name != "auto")
"""What `verify` runs by itself."""
TRIED = tuple(name for name in EVERY if name != "co_kane")
"""What `trade` measures by itself: co_kane has co_lagrangian's rows but those of effort constraints."""
INDICES = ["auto", "3", "2", "2v", "1", "0"]
BACKENDS = ("c", "numpy")
FORMATS = ("full", "concise", "json", "github", "junit", "sarif")
"""Of what `check` finds."""
METHODS = ["auto", "bdf", "radau", "rosenbrock", "dopri", "energy", "euler"]


Decorator = Callable[[Callable[..., Any]], Callable[..., Any]]


class Setting(click.ParamType):  # type: ignore[type-arg]  # generic since click 8.3
    """NAME=VALUE as a pair of texts."""

    name = "NAME=VALUE"

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> tuple[str, str]:
        """Split at the first '='."""
        if isinstance(value, tuple):
            return value
        name, found, text = str(value).partition("=")
        if not found or not name.strip() or not text.strip():
            self.fail(f"'{value}' is not NAME=VALUE", param, ctx)
        return name.strip(), text.strip()


def complete_for_shell(context: click.Context, parameter: click.Parameter, begun: str) -> list[CompletionItem]:
    """What a shell completes; imported only when a shell asks."""
    complete: Callable[..., list[CompletionItem]] = importlib.import_module("sysdyn.cli.shell_completion").complete
    return complete(context, parameter, begun)


def _together(*options: Decorator) -> Decorator:
    """Several options as one."""

    def decorate(function: Callable[..., Any]) -> Callable[..., Any]:
        for option in reversed(options):
            function = option(function)
        return function

    return decorate


_named = partial(click.option, metavar="NAME", shell_complete=complete_for_shell)
_set = partial(click.option, type=Setting(), multiple=True, shell_complete=complete_for_shell)
_number = partial(click.option, type=float)
_SIDE_BY_SIDE = "Processes side by side. Default: one a core, where the work pays for them."
side_by_side = click.option("--jobs", "-j", type=click.IntRange(min=1), metavar="N", help=_SIDE_BY_SIDE)
of_file = _together(
    _named("--scene", help="The scene; needed where the file has several."),
    _named("--model", help="The model; needed where the file has several and no scene."),
)
chosen = _together(
    of_file,
    click.option("--formulation", type=click.Choice(FORMULATIONS), help="Default: the scene's, else auto."),
    click.option("--index", type=click.Choice(INDICES), help="Index form. Default: the scene's, else auto."),
    click.option("--backend", type=click.Choice(BACKENDS), default="c", show_default=True),
    _set("--set", "settings", help="Parameter or input; repeatable."),
    _set("--level", "levels", help="PATH=NAME; repeatable."),
    click.option("--no-prune", is_flag=True, help="Keep what the scene does not need."),
)
"""Which model and scene, and how it is compiled."""
solved = _together(
    click.option("--method", type=click.Choice(METHODS)),
    click.option("--step", metavar="T", help="Length of the steps of --method euler; a bare number in s."),
    click.option("--redundancy", type=click.Choice(["error", "drop", "minimum_norm"])),
    _number("--accuracy", metavar="R", help="Relative accuracy of the traced quantities. Default 1e-4."),
    _number("--rtol", metavar="R", help="The solver's own relative tolerance (no accuracy control)."),
    _number("--atol", metavar="A", help="The solver's own absolute tolerance."),
    click.option("--no-lock", is_flag=True, help="Leave the setting of FILE.lock aside."),
    click.option("--max-steps", type=click.IntRange(min=1), metavar="N"),
    click.option("--max-wall", metavar="T", help="Limit of wall time; a bare number in s."),
    click.option("--progress", type=click.Choice(WHEN), default="auto"),
)
"""How a scene is solved, and for how long."""


def scene_command(name: str, runs: str = "run", at: str | None = None) -> Decorator:
    """How a command that runs a scene of FILE begins: `chosen`, `solved`, --until and, where `at` says what becomes of
    them, --at; runs: how many it makes.
    """

    def decorate(function: Callable[..., Any]) -> Callable[..., Any]:
        if at is not None:
            function = click.option("--at", metavar="T1,T2,...", help=f"Instants that {at} too.")(function)
        said = f"End of the {runs}; an expression, a bare number in s."
        function = click.option("--until", metavar="T", help=said)(function)
        return with_console(name)(click.argument("file")(chosen(solved(function))))

    return decorate
