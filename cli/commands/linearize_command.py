"""`sysdyn linearize`: matrices, modes and transfer functions about a state."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any

import click
from sysdyn.cli.console import Console, with_console
from sysdyn.cli.failures import SOLVER, UsageError
from sysdyn.cli.options import INDICES, chosen
from sysdyn.cli.run.running import Request


@with_console("linearize")
@click.argument("file")
@chosen
@click.option("--at", metavar="T", help="The instant; an expression, a bare number in s. Default: the scene's start.")
@click.option("--equilibrium", is_flag=True, help="About the state of rest nearest to the initial guesses.")
@click.option("--inputs", metavar="A,B", help="Parameters or inputs. Default: the model's inputs.")
@click.option("--outputs", metavar="X,Y", help="Traced quantities or expressions. Default: what the scene traces.")
def command(
    console: Console,
    at: str | None,
    equilibrium: bool,
    inputs: str | None,
    outputs: str | None,
    index: str | None,
    no_prune: bool,
    **options: Any,
) -> int:
    """Linearise a scene of FILE: E, A, B, C, D, their reduction, eigenvalues, poles, zeros and gain.

    The whole model is taken, also what the scene does not need. The matrices E, A, B, C, D are those of the form as
    written, or of --index; eigenvalues are those of the motion on the constraint manifold.
    """
    if at is not None and equilibrium:
        raise UsageError("--at together with --equilibrium: an instant of a run, or a state of rest")
    from sysdyn.cli.analysis.linear import linearised
    from sysdyn.cli.analysis.states import state_of
    from sysdyn.cli.run.running import separate
    from sysdyn.dsl.model import expression as ex
    from sysdyn.runtime.linear.tangent import NoLinearisation

    form = "3" if index in (None, "auto") else str(index)
    assert form in INDICES
    request = Request(until=at, index=index, **options)
    names = None if outputs is None else tuple(text.strip() for text in separate(outputs))
    with ex.fresh():
        found, failure = state_of(request, names, console.report, rest=equilibrium)
        if found is None:
            if failure:
                console.complain(failure, SOLVER)
            return console.finish(SOLVER if failure else 1)
        from sysdyn.cli.analysis.linear import inputs_of

        chosen_inputs = inputs_of(found.target, found.prepared, None if inputs is None else separate(inputs))
        try:
            linear = linearised(found, chosen_inputs, form)
        except NoLinearisation as error:
            console.report.error("E607", f"no linearisation: {error}", found.prepared.network.place)
            return console.finish(1)
    console.result = _result(linear, found.prepared.formulation, form)
    console.say(_heading(linear, found.target.name, found.prepared.formulation))
    console.data(_table(linear))
    return console.finish(0)


def _pair(value: complex) -> list[float]:
    return [value.real + 0.0, value.imag + 0.0]


def _result(linear: Any, formulation: str, index: str) -> dict[str, Any]:
    """The object of --json."""
    form, small = linear.descriptor, linear.reduced
    wide = [0.0] * len(form.states)
    at = {name: k for k, name in enumerate(form.states)}
    shares = []
    for mode in linear.modes:
        row = list(wide)
        for name, share in zip(small.names, mode.participation, strict=True):
            if name in at:
                row[at[name]] = float(share)
        shares.append(row)
    result = {
        "E": form.e.tolist(),
        "A": form.a.tolist(),
        "B": form.b.tolist(),
        "C": form.c.tolist(),
        "D": form.d.tolist(),
        "states": list(form.states),
        "inputs": list(linear.inputs),
        "outputs": list(linear.outputs),
        "eigenvalues": [_pair(mode.eigenvalue) for mode in linear.modes],
        "participation": shares,
        "modes": [
            {
                "eigenvalue": _pair(mode.eigenvalue),
                "frequency": mode.frequency,
                "damping": mode.damping,
                "participation": {n: float(s) for n, s in zip(small.names, mode.participation, strict=True)},
            }
            for mode in linear.modes
        ],
        "reduced": {
            "A": small.a.tolist(),
            "B": small.b.tolist(),
            "C": small.c.tolist(),
            "D": small.d.tolist(),
            "states": list(small.names),
        },
        "transfer": [
            {
                "output": linear.outputs[t.output],
                "input": linear.inputs[t.input],
                "poles": [_pair(complex(p)) for p in t.poles],
                "zeros": [_pair(complex(z)) for z in t.zeros],
                "gain": t.gain,
                "static": t.static,
                "improper": list(t.improper),
            }
            for t in linear.transfers
        ],
        "t": linear.t,
        "point": dict(zip(form.states, linear.y.tolist(), strict=False)),
        "moving": linear.moving,
        "formulation": formulation,
        "index": index,
    }
    if form.cd.any():
        result["Cd"] = form.cd.tolist()
    return result


def _heading(linear: Any, name: str, formulation: str) -> str:
    where = f"{name}: {formulation}, t = {linear.t:g} s"
    if not linear.moving:
        return f"{where}, at rest"
    return f"{where}, a moving state: the eigenvalues are of this instant, not of the motion"


def _table(linear: Any) -> str:
    """Modes and transfer functions as text."""
    rows = [["eigenvalue [1/s]", "damping", "frequency [rad/s]", "participation"]]
    for mode in linear.modes:
        damping = "" if mode.damping is None else f"{mode.damping:.4g}"
        rows.append([_complex(mode.eigenvalue), damping, f"{mode.frequency:.6g}", _shares(linear, mode)])
    lines = _columns(rows) if linear.modes else ["no states"]
    for t in linear.transfers:
        lines += ["", f"{linear.outputs[t.output]} by {linear.inputs[t.input]}"]
        lines.append(f"  gain   {t.gain:.9g}" + ("" if t.static is None else f", at rest {t.static:.9g}"))
        lines.append(f"  zeros  {', '.join(map(_complex, t.zeros)) or 'none'}")
        lines.append(f"  poles  {', '.join(map(_complex, t.poles)) or 'none'}")
        if any(t.improper):
            lines.append(f"  and {t.improper[0]:.9g} s {t.improper[1]:+.9g} s^2: it differentiates its input")
    return "\n".join(lines)


def _shares(linear: Any, mode: Any) -> str:
    """The states that take part most."""
    order = sorted(range(len(mode.participation)), key=lambda k: -mode.participation[k])
    kept = [k for k in order if mode.participation[k] >= 0.05][:4]
    return ", ".join(f"{linear.reduced.names[k]} {100 * mode.participation[k]:.0f} %" for k in kept)


def _complex(value: complex) -> str:
    value = complex(value.real if abs(value.real) > 1e-12 * abs(value) else 0.0, value.imag)
    return f"{value.real:.9g}" if value.imag == 0.0 else f"{value.real:.9g}{value.imag:+.9g}i"


def _columns(rows: Sequence[Sequence[str]]) -> list[str]:
    wide = [max(len(row[k]) for row in rows) for k in range(len(rows[0]))]
    return [_spaced(row, wide) for row in rows]


def _spaced(row: Iterable[str], wide: Sequence[int]) -> str:
    return "  ".join(text.ljust(n) for text, n in zip(row, wide, strict=True)).rstrip()
