"""`sysdyn equilibrium`: states of rest and their stability."""

from __future__ import annotations

from typing import Any

import click
from sysdyn.cli.console import Console, with_console
from sysdyn.cli.failures import SOLVER
from sysdyn.cli.options import chosen
from sysdyn.cli.progress import SEARCH
from sysdyn.cli.run.request.run_request import RunRequest


@with_console("equilibrium")
@click.argument("file")
@chosen
@click.option(
    "--tries",
    type=click.IntRange(min=0),
    default=40,
    show_default=True,
    help="Random points around it; none beyond 20000 unknowns.",
)
def command(console: Console, tries: int, no_prune: bool, index: str | None, **options: Any) -> int:
    """States of rest of a model of FILE, from its guesses and from random points around them, and their stability.

    Every rate is zero but those of displacements that nothing depends on, alone or as they move together: these may
    go on steadily. Time is held at the scene's start. Stability by eigenvalues and, where the efforts have a potential,
    by its stiffness.
    """
    from sysdyn.cli.analysis.resting import equilibria
    from sysdyn.cli.analysis.states import NO_REST
    from sysdyn.dsl.model import expression as ex

    with console.progress(ahead=SEARCH) as line, ex.fresh():
        made = equilibria(RunRequest(index=index, **options), tries, console.report, line)
    if made is None:
        return console.finish(1)
    found, states, why = made
    console.result = {
        "t": found.state.t,
        "formulation": found.prepared.formulation,
        "equilibria": [state.to_json() for state in states],
    }
    # not found is the solver's exit code
    if not states:
        console.complain(NO_REST.format(f" and {tries} points around them", found.state.t) + why, SOLVER)
        return console.finish(SOLVER)
    name, formulation = found.target.name, found.prepared.formulation
    console.say(f"{name}: {formulation}, {len(states)} found, time held at {found.state.t:g} s")
    console.results("\n\n".join(state.to_text(number) for number, state in enumerate(states, 1)))
    return console.finish(0)
