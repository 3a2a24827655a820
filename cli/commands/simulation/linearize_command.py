"""`sysdyn linearize`: matrices, modes and transfer functions about a state."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

import click
from sysdyn.cli import whole_files
from sysdyn.cli.console import Console, with_console
from sysdyn.cli.failures import SOLVER, UsageError
from sysdyn.cli.options import INDICES, chosen
from sysdyn.cli.page.columns import align, complex_text
from sysdyn.cli.run.request.run_request import RunRequest
from sysdyn.runtime.trace.opening import replaceable

KINDS = ("bode", "nyquist", "step")
DATA = (".h5", ".mat", ".json")
PICTURES = (".png", ".svg", ".html")
MOST = 1000
"""Values of a parameter in a root locus."""


@with_console("linearize")
@click.argument("file")
@chosen
@click.option("--at", metavar="T", help="The instant; an expression, a bare number in s. Default: the scene's start.")
@click.option("--equilibrium", is_flag=True, help="About the state of rest nearest to the initial guesses.")
@click.option("--inputs", metavar="A,B", help="Parameters or inputs. Default: the model's inputs.")
@click.option("--outputs", metavar="X,Y", help="Traced quantities or expressions. Default: what the scene traces.")
@click.option("--response", metavar="KIND,...", help="Tables, and curves in --json: bode, nyquist, step.")
@click.option("--locus", metavar="NAME=FIRST..LAST:N", help="Eigenvalues over a parameter (':log', or a list).")
@click.option(
    "-o",
    "files",
    multiple=True,
    metavar="FILE",
    help="Matrices in .h5, .mat, .json; pictures in .png, .svg, .html; repeatable.",
)
def command(
    console: Console,
    response: str | None,
    locus: str | None,
    files: tuple[str, ...],
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
    # two places at once
    if at is not None and equilibrium:
        raise UsageError("--at together with --equilibrium: an instant of a run, or a state of rest")
    kinds = _kinds(response)
    _check_outputs(files)
    from sysdyn.cli.analysis.linearisation import linearise
    from sysdyn.cli.analysis.states import state_of
    from sysdyn.cli.run.request.run_request import separate
    from sysdyn.dsl.model import expression as ex
    from sysdyn.runtime.linear.tangent import NoLinearisation

    # what is linearised, and where
    form = "3" if index in (None, "auto") else str(index)
    assert form in INDICES
    request = RunRequest(until=at, index=index, **options)
    names = None if outputs is None else tuple(text.strip() for text in separate(outputs))
    moved = None if inputs is None else separate(inputs)
    with ex.fresh():
        found, failure = state_of(request, names, moved, console.report, rest=equilibrium)
        if found is None:
            if failure:
                console.complain(failure, SOLVER)
            return console.finish(SOLVER if failure else 1)
        from sysdyn.cli.analysis.linearisation import inputs_of

        try:
            linear = linearise(found, inputs_of(found.target, found.prepared, moved), form)
        except NoLinearisation as error:
            console.report.error("E607", f"no linearisation: {error}", found.prepared.network.place)
            return console.finish(1)
        from sysdyn.cli.analysis import answers

        over = None
        if locus is not None:
            name, values = _along(locus, found)
            over = answers.locus(request, name, values, rest=equilibrium, found=found)
    # what is told of it
    console.result = _result(linear, found.prepared.formulation, form)
    console.say(_heading(linear, found.target.name, found.prepared.formulation))
    if found.prepared.network.discretes:
        console.say(f"events do not act: {', '.join(sorted(found.prepared.network.discretes)[:6])} held")
    parts = [_table(linear)]
    # curves are computed where a kind or a picture asks for them
    pictures = any(Path(file).suffix in PICTURES for file in files)
    curves = answers.answers(linear) if kinds or pictures else ()
    # in text and in --json
    if kinds:
        console.result["responses"] = [answers.answer_to_json(a, kinds) for a in curves]
        parts += [answers.answer_to_text(a, kinds) for a in curves]
        if not curves:
            console.say(f"no {', '.join(kinds)}: {_missing(linear)}")
    if over is not None:
        console.result["locus"] = answers.locus_to_json(over)
        parts.append(answers.locus_to_text(over))
    console.results("\n\n".join(parts))
    # data and pictures
    for file in files:
        _write(file, linear, curves, over, kinds, found.target.name, console)
    if files:
        console.result["files"] = list(files)
    return console.finish(0)


def _along(text: str, found: Any) -> tuple[str, list[float]]:
    """Name and values (SI) of --locus."""
    from sysdyn.cli.sweep.axes import axis
    from sysdyn.dsl import load
    from sysdyn.dsl.text.diagnostics import Report

    known = {p.name: p.unit.dimension for p in found.prepared.network.parameters}

    # values in the unit of the parameter
    def evaluate(name: str, said: str) -> float | None:
        plain = name.partition("[")[0]
        if plain not in known:
            return None
        report = Report()
        value = load.constant(found.target.document, said, known[plain], "--locus", report)
        report.raise_if_failed()
        return value

    along = axis(text, evaluate)
    values = [v for v in along.values if isinstance(v, float)]
    if along.name.partition("[")[0] not in known:
        raise UsageError(f"--locus: there is no parameter '{along.name}'; there are: {', '.join(known) or 'none'}")
    # a grid or a list of numbers
    if along.drawn or len(values) != len(along.values) or not 2 <= len(values) <= MOST:
        raise UsageError(f"--locus '{text}': NAME=FIRST..LAST:NUMBER, or a list of 2 to {MOST} numbers")
    return along.name, values


def _missing(linear: Any) -> str:
    """What a transfer function wants and there is none of."""
    if linear.inputs:
        return "nothing is traced: --outputs names expressions"
    return "the model has no input; --inputs names parameters, and an 'input' in a source's formula is one"


def _kinds(response: str | None) -> tuple[str, ...]:
    """The kinds of --response."""
    kinds = tuple(dict.fromkeys(part.strip() for part in (response or "").split(",") if part.strip()))
    wrong = [kind for kind in kinds if kind not in KINDS]
    if wrong:
        raise UsageError(f"--response '{wrong[0]}': of {', '.join(KINDS)}")
    return kinds


def _check_outputs(files: Iterable[str]) -> None:
    for file in files:
        if Path(file).suffix not in (*DATA, *PICTURES):
            raise UsageError(f"-o '{file}': one of {', '.join((*DATA, *PICTURES))}")
        if Path(file).is_file() and Path(file).stat().st_size and (replaceable(file) or replaceable(file, sweep=True)):
            raise UsageError(f"-o {file} holds runs: give another name, or remove it")


def _write(file: str, linear: Any, curves: Any, over: Any, kinds: tuple[str, ...], name: str, console: Console) -> None:
    """One file of matrices or one picture."""
    from sysdyn.cli.analysis.linear_files import written
    from sysdyn.cli.analysis.response_plots import page, picture

    kind = Path(file).suffix
    if kind in DATA:
        whole_files.write(file, written(linear, kind, console.result))
        console.say(f"{file}: {len(linear.modes)} states, {len(linear.transfers)} transfer functions")
        return
    asked = kinds or ((*KINDS, "poles") if over is None else ("poles",))
    drawn = [k for k in asked if k == "poles" or curves] + ([] if over is None else ["locus"])
    title = f"{name}, t = {linear.t:g} s" + ("" if linear.moving else _still(linear))
    data = picture(title, linear, curves, over, drawn, "svg" if kind == ".html" else kind.removeprefix("."))
    if kind == ".html":
        data = page(title, data, _tables(linear, over))
    whole_files.write(file, data)
    console.say(f"{file}: {', '.join(drawn)}")


def _tables(linear: Any, over: Any) -> list[tuple[str, list[list[str]]]]:
    """Headings and rows of a page."""
    import numpy as np

    found = [("Modes", _modes(linear))]
    if linear.transfers:
        rows = [["transfer function", "gain", "at rest", "zeros [1/s]", "poles [1/s]"]]
        for t in linear.transfers:
            static = "" if t.static is None else f"{t.static:.6g}"
            ends = [", ".join(map(complex_text, part)) or "none" for part in (t.zeros, t.poles)]
            rows.append([linear.label(t), f"{t.gain:.6g}", static, *ends])
        found.append(("Transfer functions", rows))
    if over is not None:
        rows = [[f"{over.parameter} [{over.unit}]", "eigenvalues [1/s]"]]
        for value, curve in zip(over.values, over.curves, strict=True):
            rows.append([f"{value:.6g}", ", ".join(complex_text(complex(v)) for v in curve if np.isfinite(v))])
        found.append((f"Eigenvalues over {over.parameter}", rows))
    return found


def _pair(value: complex) -> list[float]:
    return [value.real + 0.0, value.imag + 0.0]


def _shares(states: Sequence[str], names: Sequence[str], mode: Any) -> list[float]:
    """Of each unknown in a mode; 0 for those that are none of its states."""
    share = dict(zip(names, mode.participation, strict=True))
    return [float(share.get(name, 0.0)) for name in states]


def _mode(mode: Any, names: Sequence[str], stores: Sequence[str], energies: Sequence[float]) -> dict[str, Any]:
    return {
        "eigenvalue": _pair(mode.eigenvalue),
        "frequency": mode.frequency,
        "damping": mode.damping,
        "participation": {n: float(s) for n, s in zip(names, mode.participation, strict=True)},
        "energy": {n: float(s) for n, s in zip(stores, energies, strict=True)},
        "shape": {n: _pair(complex(v)) for n, v in zip(names, mode.shape, strict=True)},
    }


def _transfer(linear: Any, found: Any) -> dict[str, Any]:
    return {
        "output": linear.outputs[found.output],
        "input": linear.inputs[found.input],
        "poles": [_pair(complex(p)) for p in found.poles],
        "zeros": [_pair(complex(z)) for z in found.zeros],
        "gain": found.gain,
        "static": found.static,
        "improper": list(found.improper),
    }


def _result(linear: Any, formulation: str, index: str) -> dict[str, Any]:
    """The object of --json."""
    form, small = linear.descriptor, linear.reduced
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
        "participation": [_shares(form.states, small.names, mode) for mode in linear.modes],
        "modes": [
            _mode(mode, small.names, linear.stores, shares)
            for mode, shares in zip(linear.modes, linear.energies, strict=True)
        ],
        "reduced": {
            "A": small.a.tolist(),
            "B": small.b.tolist(),
            "C": small.c.tolist(),
            "D": small.d.tolist(),
            "states": list(small.names),
        },
        "transfer": [_transfer(linear, t) for t in linear.transfers],
        "t": linear.t,
        "point": dict(zip(form.states, linear.y.tolist(), strict=False)),
        "moving": linear.moving,
        "formulation": formulation,
        "index": index,
    }
    # outputs by rates: only where there are such
    if form.cd.any():
        result["Cd"] = form.cd.tolist()
    for name, part in (("D1", small.d1), ("D2", small.d2)):
        if part.any():
            result["reduced"][name] = part.tolist()
    return result


def _heading(linear: Any, name: str, formulation: str) -> str:
    where = f"{name}: {formulation}, t = {linear.t:g} s"
    if not linear.moving:
        return where + _still(linear)
    return f"{where}, a moving state: the eigenvalues are of this instant, not of the motion"


def _still(linear: Any) -> str:
    return ", in steady motion" if linear.steady else ", at rest"


def _table(linear: Any) -> str:
    """Modes and transfer functions as text."""
    lines = [align(_modes(linear))] if linear.modes else ["no states"]
    for t in linear.transfers:
        lines += ["", linear.label(t)]
        lines.append(f"  gain   {t.gain:.9g}" + ("" if t.static is None else f", at rest {t.static:.9g}"))
        lines.append(f"  zeros  {', '.join(map(complex_text, t.zeros)) or 'none'}")
        lines.append(f"  poles  {', '.join(map(complex_text, t.poles)) or 'none'}")
        if any(t.improper):
            lines.append(f"  and {t.improper[0]:.9g} s {t.improper[1]:+.9g} s^2: it differentiates its input")
    return "\n".join(lines)


def _modes(linear: Any) -> list[list[str]]:
    rows = [["eigenvalue [1/s]", "damping", "frequency [rad/s]", "participation", "energy in"]]
    for mode, energies in zip(linear.modes, linear.energies, strict=True):
        damping = "" if mode.damping is None else f"{mode.damping:.4g}"
        shares = _largest_shares(linear.reduced.names, mode.participation), _largest_shares(linear.stores, energies)
        rows.append([complex_text(mode.eigenvalue), damping, f"{mode.frequency:.6g}", *shares])
    return rows if linear.stores else [row[:-1] for row in rows]


def _largest_shares(names: Sequence[str], shares: Sequence[float]) -> str:
    """Those that take part most."""
    order = sorted(range(len(names)), key=lambda k: -shares[k])
    return ", ".join(f"{names[k]} {100 * shares[k]:.0f} %" for k in order[:4] if shares[k] >= 0.05)
