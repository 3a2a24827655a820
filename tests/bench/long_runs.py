"""Energy over very many periods: python tests/bench/long_runs.py [--periods N] [--others N] [--rtol R] [NAME...]

Oscillations whose solution is known in closed form, by `--method energy` over N periods and by every other method over
fewer.  One row a model, formulation and method: the largest error of the energy, by an expression of the model's own
(no meter), over the energy of the motion, and the same a period; of the constraints; of the phase at the end (rad)
against Jacobi's functions, Kepler's equation or the cosine; steps and CPU time.
"""

from __future__ import annotations

import argparse
import tempfile
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import mpmath
import numpy as np
from sysdyn.api import SolverFailure, Trace, simulate
from sysdyn.runtime.model.failures import NoSuchForm

MODELS = Path(__file__).resolve().parents[2] / "models"
METHODS = ("bdf", "radau", "dopri")
ROWS = 173.3
"""Instants at which a run is looked at, and nowhere at the same phase."""
ANGLE, G = 1.0, 9.81


@dataclass(frozen=True, slots=True)
class Problem:
    """An oscillation.  text: its model; traced: its energy as E and what the phase is read from, in SI units; size (J):
    energy of the motion; period (s); phase: (trace, instants s) -> how far it is ahead (rad); forms: formulations.
    """

    text: str
    model: str
    traced: str
    size: float
    period: mpmath.mpf
    phase: Callable[[Trace, list[mpmath.mpf]], np.ndarray]
    forms: tuple[str, ...]
    settings: str = ""


@dataclass(frozen=True, slots=True)
class Row:
    """One run.  energy: largest error over the energy of the motion; phase: at the last instant (rad)."""

    name: str
    formulation: str
    method: str
    periods: float
    energy: float
    constraints: float
    phase: float
    steps: int
    cpu: float

    def __str__(self) -> str:
        errors = (self.energy, self.energy / self.periods, self.constraints, self.phase)
        return (
            f"| {self.name} | {self.formulation} | {self.method} | {self.periods:.0e} | "
            f"{' | '.join(f'{error:.1e}' for error in errors)} | {self.steps} | {self.cpu:.3g} |"
        )


HEAD = (
    "| system | formulation | method | periods | energy | a period | constraints | phase (rad) | steps | CPU s |\n"
    "|---|---|---|---|---|---|---|---|---|---|"
)


def _swing(length: float, name: Callable[[Trace], np.ndarray]) -> tuple[mpmath.mpf, Callable[..., np.ndarray]]:
    """Period of a pendulum released at ANGLE, and its phase from the angle: time lost times the mean frequency."""
    mpmath.mp.dps = 40
    k = mpmath.sin(mpmath.mpf(ANGLE) / 2)
    quarter, w = mpmath.ellipk(k * k), mpmath.sqrt(mpmath.mpf(G) / mpmath.mpf(length))
    period = 4 * quarter / w

    def phase(trace: Trace, t: list[mpmath.mpf]) -> np.ndarray:
        found = []
        for instant, angle in zip(t, name(trace), strict=True):
            u = w * (instant % period) + quarter
            sn, cn = (mpmath.ellipfun(f, u, m=k * k) for f in ("sn", "cn"))
            exact, rate = 2 * mpmath.asin(k * sn), 2 * k * cn * w  # d/dt 2 asin(k sn) = 2 k w cn
            off = (mpmath.mpf(float(angle)) - exact) / rate if abs(cn) > 0.5 else mpmath.nan
            found.append(float(off * 2 * mpmath.pi / period))
        return np.array(found)

    return period, phase


def _circle(name: Callable[[Trace], np.ndarray], period: mpmath.mpf) -> Callable[..., np.ndarray]:
    """Phase from an angle that grows evenly: that of an oscillator or the mean anomaly."""

    def phase(trace: Trace, t: list[mpmath.mpf]) -> np.ndarray:
        exact = np.array([float(2 * mpmath.pi * (instant % period) / period) for instant in t])
        return np.asarray((name(trace) - exact + np.pi) % (2.0 * np.pi) - np.pi)

    return phase


def _anomaly(trace: Trace) -> np.ndarray:
    """Mean anomaly of an orbit of eccentricity 0.6 about the origin."""
    x, y = np.asarray(trace["x"]), np.asarray(trace["y"])
    eccentric = np.arctan2(y / 0.8, x + 0.6)
    return np.asarray(eccentric - 0.6 * np.sin(eccentric))


def problems() -> dict[str, Problem]:
    """All of them by name."""
    mpmath.mp.dps = 40
    book = (MODELS / "seed" / "pendulum.sd").read_text().split("scene ")[0]
    length, mass = 2.34, 1.13
    period, phase = _swing(length, lambda trace: np.arctan2(np.asarray(trace["q1"]), -np.asarray(trace["q2"])))
    own, own_phase = _swing(1.0, lambda trace: np.asarray(trace["th"]))
    angle = """model angle {
  coord th: rotation = 1 rad
  energy T* = 1/2*(1 kg.m^2)*th'^2
  energy V = -(9.81 N.m)*cos(th)
  init th' = 0 rad/s
}
"""
    kepler = """model kepler {
  param mu = 1 N.m^2
  coord x, y: translation
  energy T* = 1/2*(1 kg)*(x'^2 + y'^2)
  energy V = -mu/sqrt(x^2 + y^2)
  init x = 0.4 m
  init y = 0 m
  init x' = 0 m/s
  init y' = 2 m/s
}
"""
    circuit = """from std.electrical import capacitor, inductor
model circuit {
  node a: electrical
  C: capacitor(C = 4 mF) a -> ground
  L: inductor(L = 0.25 H) a -> ground
  init C.e = 1 V
  init L.f = 0 A
}
"""
    turn, ring = 2 * mpmath.pi, 2 * mpmath.pi * mpmath.sqrt(mpmath.mpf("0.25") * mpmath.mpf("0.004"))
    ringing = _circle(lambda trace: np.arctan2(np.asarray(trace["i"]) * 0.5, np.asarray(trace["v"]) * 0.004**0.5), ring)
    both, four = ("lagrangian", "hamiltonian"), ("lagrangian", "hamiltonian", "co_lagrangian", "co_hamiltonian")
    return {
        "pendulum": Problem(
            book, "pendulum", "1/2*m*(q1'^2 + q2'^2) + m*g*q2 as E, q1, q2", mass * G * length * (1 - np.cos(ANGLE)),
            period, phase, both, f"set th_0 = {ANGLE} rad",
        ),
        "angle": Problem(
            angle, "angle", "1/2*(1 kg.m^2)*th'^2 - (9.81 N.m)*cos(th) as E, th", G * (1 - np.cos(ANGLE)), own,
            own_phase, both,
        ),
        "kepler": Problem(
            kepler, "kepler", "1/2*(1 kg)*(x'^2 + y'^2) - mu/sqrt(x^2 + y^2) as E, x, y", 0.5, turn,
            _circle(_anomaly, turn), both,
        ),
        "circuit": Problem(
            circuit, "circuit", "(1/2*(4 mF)*C.e^2 + 1/2*(0.25 H)*L.f^2) in J as E, C.e as v, L.f as i", 0.002, ring,
            ringing, four,
        ),
    }  # fmt: skip


def measure(name: str, formulation: str, method: str, periods: float, rtol: float) -> Row:
    """One run of a problem."""
    problem = problems()[name]
    end = float(problem.period) * periods
    scene = (
        f"scene long of {problem.model} {{\n  time 0 s to {end!r} s\n  {problem.settings}\n"
        f"  trace {problem.traced}, audit.constraints every {end / ROWS!r} s\n}}\n"
    )
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "long.sd"
        file.write_text(problem.text + scene)
        trace = simulate(
            file, scene="long", formulation=formulation, method=method, rtol=rtol, unmet="warn",
            output=Path(folder) / "long.h5", max_steps=10**10,
        )  # fmt: skip
        energy, time = np.asarray(trace["E"]), [mpmath.mpf(float(t)) for t in trace.time]
        off = problem.phase(trace, time)
        known = off[np.isfinite(off)]
        return Row(
            name, formulation, method, periods, float(np.abs(energy - energy[0]).max() / problem.size),
            float(np.abs(np.asarray(trace["audit.constraints"])).max()), float(known[-1]) if known.size else np.nan,
            int(trace.statistics["steps"]), float(trace.timings["cpu_integrate_s"]),
        )  # fmt: skip


def main() -> None:
    """The table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--periods", type=float, default=1e6)
    parser.add_argument("--others", type=float, default=1e4, help="periods of the other methods")
    parser.add_argument("--rtol", type=float, default=1e-8)
    parser.add_argument("name", nargs="*")
    given = parser.parse_args()
    print(HEAD, flush=True)
    for name, problem in problems().items():
        if given.name and name not in given.name:
            continue
        for formulation in problem.forms:
            for method, periods in (("energy", given.periods), *((m, given.others) for m in METHODS)):
                try:
                    print(measure(name, formulation, method, periods, given.rtol), flush=True)
                except (NoSuchForm, SolverFailure) as error:
                    print(f"| {name} | {formulation} | {method} | {periods:.0e} | {error} |", flush=True)


if __name__ == "__main__":
    main()
