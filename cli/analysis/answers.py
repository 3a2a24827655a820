"""What a linearisation answers: over frequency, to a step, and its eigenvalues over a parameter.

Received: a Linear and the kinds asked (bode, nyquist, step).  Returned: curves with their tables and --json objects.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from sysdyn.cli.analysis.linearisation import Linearisation, linearise
from sysdyn.cli.analysis.operating_point import Found
from sysdyn.cli.analysis.states import state_of
from sysdyn.cli.page.columns import align, complex_text
from sysdyn.cli.run.request.run_request import RunRequest
from sysdyn.dsl.model import expression as ex
from sysdyn.dsl.model.units import si_text
from sysdyn.dsl.text.diagnostics import Report
from sysdyn.runtime.linear import responses
from sysdyn.runtime.linear.modes import Transfer
from sysdyn.runtime.linear.responses import Frequencies, Margins
from sysdyn.runtime.linear.tangent import NoLinearisation
from sysdyn.values import dataclass

Array = NDArray[np.float64]
ROWS = 13
"""Of a table: what a terminal shows; --json has all."""


@dataclass(frozen=True, slots=True)
class Answer:
    """One output by one input: names, both with units, over frequency, margins, step response (t [s], y)."""

    output: str
    input: str
    label: str
    frequencies: Frequencies
    margins: Margins
    time: Array
    step: Array


@dataclass(frozen=True, slots=True)
class Locus:
    """Eigenvalues [values, n] over a parameter; unit: of the values, SI; failed: values without any, and why."""

    parameter: str
    unit: str
    values: Array
    curves: NDArray[np.complex128]
    failed: tuple[tuple[float, str], ...]


def answers(linear: Linearisation) -> tuple[Answer, ...]:
    """Of every output by every input, over one range of frequencies and one of times."""
    if not linear.transfers:
        return ()
    low, high = responses.span(linear.transfers)
    end = responses.horizon(linear.transfers)
    return tuple(_answer(linear, t, low, high, end) for t in linear.transfers)


def _answer(linear: Linearisation, transfer: Transfer, low: float, high: float, end: float) -> Answer:
    """Frequency response, margins and step response of one transfer function."""
    time, step = responses.step(linear.reduced, transfer, end)
    return Answer(
        linear.outputs[transfer.output],
        linear.inputs[transfer.input],
        linear.label(transfer),
        responses.frequencies(transfer, low, high),
        responses.margins(transfer, low, high),
        time,
        step,
    )


def answer_to_json(answer: Answer, kinds: Sequence[str]) -> dict[str, Any]:
    """The object of --json."""
    f, m = answer.frequencies, answer.margins
    found: dict[str, Any] = {"output": answer.output, "input": answer.input}
    # margins are read off the frequency response, bode or nyquist
    if "bode" in kinds or "nyquist" in kinds:
        found["margins"] = {"gain": m.gain, "w_phase": m.w_phase, "phase": m.phase, "w_gain": m.w_gain}
    if "bode" in kinds:
        found["bode"] = {"w": f.w.tolist(), "magnitude": f.magnitude.tolist(), "phase": f.phase.tolist()}
    if "nyquist" in kinds:
        found["nyquist"] = {"w": f.w.tolist(), "re": f.value.real.tolist(), "im": f.value.imag.tolist()}
    if "step" in kinds:
        found["step"] = {"t": answer.time.tolist(), "y": answer.step.tolist()}
    return found


def answer_to_text(answer: Answer, kinds: Sequence[str]) -> str:
    """Tables of a few rows each."""
    f, parts = answer.frequencies, [answer.label]
    # a few rows spread over the frequencies; --json has all
    places = np.unique(np.linspace(0, f.w.size - 1, ROWS).round().astype(int))
    if "bode" in kinds:
        rows = [[f"{f.w[k]:.5g}", f"{f.magnitude[k]:.5g}", f"{f.phase[k]:.5g}"] for k in places]
        parts += [align([["w [rad/s]", "magnitude [dB]", "phase [deg]"], *rows]), *_margins(answer.margins)]
    if "nyquist" in kinds:
        rows = [[f"{f.w[k]:.5g}", f"{f.value[k].real:.6g}", f"{f.value[k].imag:.6g}"] for k in places]
        parts.append(align([["w [rad/s]", "Re", "Im"], *rows]))
    if "step" in kinds:
        places = np.unique(np.linspace(0, answer.time.size - 1, ROWS).round().astype(int))
        rows = [[f"{answer.time[k]:.5g}", f"{answer.step[k]:.6g}"] for k in places]
        parts.append(align([["t [s]", "step response"], *rows]))
    return "\n".join(parts)


def _margins(m: Margins) -> list[str]:
    found = []
    if m.gain is not None:
        found.append(f"gain margin {m.gain:.6g} at {m.w_phase:.6g} rad/s")
    if m.phase is not None:
        found.append(f"phase margin {m.phase:.6g} deg at {m.w_gain:.6g} rad/s")
    return found


def locus(request: RunRequest, name: str, along: Sequence[float], *, rest: bool, found: Found) -> Locus:
    """Eigenvalues over values (SI) of a parameter: each is compiled in, its state found anew."""
    sets, kept, failed = [], [], []
    for value in along:
        values, why = _eigenvalues(request, name, value, rest=rest)
        if values is None:
            failed.append((value, why))
            continue
        sets.append(values)
        kept.append(value)
    units = {p.name: si_text(p.unit.dimension) for p in found.prepared.network.parameters}
    return Locus(name, units[name.partition("[")[0]], np.array(kept), responses.branches(sets), tuple(failed))


def _eigenvalues(
    request: RunRequest, name: str, value: float, *, rest: bool
) -> tuple[NDArray[np.complex128] | None, str]:
    """Eigenvalues where a parameter has another value, or why there are none."""
    settings = (*((n, v) for n, v in request.settings if n != name), (name, repr(value)))
    report = Report()
    with ex.fresh():
        at, why = state_of(replace(request, settings=settings), None, (), report, rest=rest)
        if at is None:
            errors = [d.message for d in report.diagnostics if d.severity == "error"]
            return None, why or (errors[0] if errors else "no state")
        try:
            return np.array([m.eigenvalue for m in linearise(at, ()).modes]), ""
        except NoLinearisation as error:
            return None, str(error)


def locus_to_json(found: Locus) -> dict[str, Any]:
    """The object of --json: eigenvalues[k][j] of value k on branch j."""
    pairs = [[[v.real, v.imag] if np.isfinite(v) else None for v in row] for row in found.curves]
    failed = [{"value": v, "why": why} for v, why in found.failed]
    return {
        "parameter": found.parameter,
        "unit": found.unit,
        "values": found.values.tolist(),
        "eigenvalues": pairs,
        "failed": failed,
    }


def locus_to_text(found: Locus) -> str:
    """A row a value."""
    heads = [f"{found.parameter} [{found.unit}]", "largest real part [1/s]", "least damping", "eigenvalues [1/s]"]
    rows = [heads]
    for value, curve in zip(found.values, found.curves, strict=True):
        here = curve[np.isfinite(curve)]
        moving = here[np.abs(here) > 0.0]
        damping = min((-v.real / abs(v) + 0.0 for v in moving), default=np.nan)
        shown = ", ".join(complex_text(v, 5) for v in sorted(here, key=lambda v: (-v.real, v.imag))[:4])
        most = f"{here.real.max():.6g}" if here.size else ""
        rows.append([f"{value:.6g}", most, f"{damping:.4g}", shown + (", ..." if here.size > 4 else "")])
    lines = [align(rows)]
    lines += [f"{found.parameter} = {value:.6g}: {why}" for value, why in found.failed]
    return "\n".join(lines)
