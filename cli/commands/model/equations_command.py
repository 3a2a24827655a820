"""`sysdyn equations`: the equations as a book prints them."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import click
from sysdyn.cli.console import Console, with_console
from sysdyn.cli.options import chosen
from sysdyn.cli.run.request.run_request import RunRequest

FORMS = ("descriptor", "matrices", "canonical", "underlying", "linear", "port_hamiltonian", "efforts", "elements")


@with_console("equations")
@click.argument("file")
@chosen
@click.option("--form", type=click.Choice(FORMS), default="descriptor", show_default=True)
@click.option("--text", "alphabet", flag_value="text", default="text", help="For a terminal (the default).")
@click.option("--latex", "alphabet", flag_value="latex", help="As LaTeX.")
@click.option("--html", "alphabet", flag_value="html", help="As a page of its own.")
def command(console: Console, form: str, alphabet: str, no_prune: bool, index: str | None, **options: Any) -> int:
    """Print the equations of a model of FILE: energy functions, then the rows of the formulation.

    descriptor: q' = f, M f' + Phi_q^T kappa + Psi_f^T mu = Y, and so on. matrices: M, Phi_q, Psi_f, Y, Z1, Z2.
    canonical: Hamilton's equations in q and p. underlying: rates and multipliers solved for. linear: about the start.
    efforts: those on each coordinate by class (inertial, potential, dissipative, source, implicit, constraint).
    elements: the law of each store and dissipator with T, T*, V, V*, D, G side by side.
    port_hamiltonian: E z' = (J - R) e + G u with E^T e = dH/dz, J = -J^T, R >= 0 (whether it is, by `check --explain`).
    """
    from sysdyn.cli.analysis.operating_point import compile_target
    from sysdyn.cli.equations.forms import content_of
    from sysdyn.cli.equations.sheet import Sheets
    from sysdyn.cli.equations.typeset import page
    from sysdyn.cli.run.request.targets import still
    from sysdyn.compiler.equations.matrices import NoSuchEquations
    from sysdyn.dsl.model import expression as ex

    with ex.fresh():
        request = RunRequest(index=index, **{**options, "backend": "numpy"})
        # the linear form alone moves inputs
        inputs = None if form == "linear" else ()
        made = compile_target(request, console.report, inputs=inputs, choose=still)
        lagranges = made is not None and made[1].formulation == "lagrangian"
        # Hamilton's equations, where nobody named another formulation
        if form == "canonical" and lagranges and request.formulation in (None, "auto"):  # nobody named them
            made = compile_target(
                replace(request, formulation="hamiltonian"), console.report, inputs=inputs, choose=still
            )
        if made is None:
            return console.finish(1)
        target, prepared = made
        # a form that the model does not have is said as a finding
        try:
            content = content_of(target, prepared, form, request, console.report)
        except NoSuchEquations as error:
            console.report.error("E607", f"--form {form}: {error}", prepared.network.place)
            return console.finish(1)
        if content is None:
            return console.finish(1)
        # the same content as text, LaTeX or a page
        sheet = Sheets(prepared.compiled, [c.name for c in prepared.network.coordinates]).sheet(content)
        if alphabet == "html":
            text = page(f"{target.name}: {prepared.formulation}, {form}", content, prepared.compiled)
        else:
            text = sheet.to_latex() if alphabet == "latex" else sheet.to_text()
    console.result = {
        "formulation": prepared.formulation,
        "form": form,
        "functions": [line.to_json() for line in sheet.functions],
        "equations": [line.to_json() for line in sheet.equations],
        "counted": list(sheet.counted),
        "multipliers": [{"symbol": s, "constraint": owner, "line": line} for s, owner, line in sheet.legend if owner],
        "senses": [{"symbol": s, "of": what, "line": line} for s, what, line in sheet.senses],
    }
    console.data(text)
    return console.finish(0)
