"""Narrow pulses at random places: python tests/bench/pulses.py [NUMBER]

A mass at rest is pushed by a pulse whose impulse is known in closed form; its last speed says whether the run saw it.
Three shapes (a Gaussian, a difference of tanh, a smooth table), relative widths 1e-6 to 1e-2, every method.  A line for
what was missed, then shares.
"""

from __future__ import annotations

import random
import sys
import tempfile
from dataclasses import dataclass
from pathlib import Path

from sysdyn.cli.run.request.run_request import RunRequest
from sysdyn.cli.run.running import run
from sysdyn.dsl.text.diagnostics import Report

SPAN = 10.0
ACCURACY = 1e-3
METHODS = ("auto", "bdf", "radau", "dopri")
TEXT = """
{table}
model pushed {{
  param m = 2 kg
  param b = 0.001 N.s/m
  input F: N = 0 N
  coord x: translation = 0 m
  energy T* = 1/2*m*x'^2
  work F on x
  init x' = 0 m/s
}}
scene shot of pushed {{
  time 0 s to {span} s
  set F = {signal}
  trace x' as v
  accuracy {accuracy}
}}
"""


@dataclass(frozen=True, slots=True)
class Shot:
    """One pulse: its place [s], width [s], shape and height [N]; impulse [N.s] in closed form."""

    shape: str
    place: float
    width: float
    height: float
    method: str

    @property
    def impulse(self) -> float:
        """What it hands to the mass."""
        return self.height * self.width * {"gauss": 3.141592653589793**0.5, "tanh": 4.0, "table": 2.0}[self.shape]

    @property
    def text(self) -> str:
        """The model."""
        x, table = f"((t - {self.place!r} s)/({self.width!r} s))", ""
        if self.shape == "gauss":
            signal = f"{self.height!r} N*exp(-{x}^2)"
        elif self.shape == "tanh":
            signal = f"{self.height!r} N*(tanh({x} + 1) - tanh({x} - 1))"
        else:  # the integral of pchip through (-1, 0), (0, 1), (1, 0) is 1, twice the width is two of them
            rows = ", ".join(f"({self.place + k * 2 * self.width!r}, {h})" for k, h in ((-1, 0), (0, 1), (1, 0)))
            table = f"table shape(t: s) -> 1 pchip clamp [ ({-1.0}, 0), {rows}, ({SPAN + 1.0}, 0) ]"
            signal = f"{self.height!r} N*shape(t)"
        return TEXT.format(table=table, span=SPAN, signal=signal, accuracy=ACCURACY)


def shots(number: int, seed: int = 12) -> list[Shot]:
    """Random pulses."""
    draw = random.Random(seed)
    found = []
    for k in range(number):
        width = SPAN * 10.0 ** draw.uniform(-6.0, -2.0)
        place = draw.uniform(0.05 * SPAN, 0.95 * SPAN)
        shape = ("gauss", "tanh", "table")[k % 3]
        found.append(Shot(shape, place, width, draw.uniform(0.5, 2.0) / width, METHODS[k % len(METHODS)]))
    return found


def missed(shot: Shot, folder: Path) -> tuple[bool, float]:
    """(the run is met and wrong, the relative error of the speed)."""
    path = folder / "pushed.sd"
    path.write_text(shot.text, encoding="utf-8")
    report = Report()
    ran = run(RunRequest(str(path), method=shot.method, output=str(folder / "trace.h5"), max_wall="60"), report)
    assert ran is not None, [d.message for d in report.diagnostics]
    if ran.outcome.failure is not None:
        return False, float("nan")
    speed = float(ran.outcome.traced["v"][-1])
    error = abs(speed / (shot.impulse / 2.0) - 1.0)
    return ran.outcome.met and error > 3.0 * ACCURACY, error


def main() -> None:
    """What was missed in silence, and what was refused."""
    number = int(sys.argv[1]) if len(sys.argv) > 1 else 1000
    silent = refused = 0
    worst = 0.0
    with tempfile.TemporaryDirectory() as folder:
        for shot in shots(number):
            wrong, error = missed(shot, Path(folder))
            if wrong:
                silent += 1
                print(f"missed: {shot} error {error:.2g}", flush=True)
            elif not error <= 3.0 * ACCURACY:
                refused += 1
            else:
                worst = max(worst, error)
    print(f"{number} pulses: {silent} missed in silence, {refused} refused, largest error of the others {worst:.1e}")


if __name__ == "__main__":
    main()
