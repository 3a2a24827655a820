"""What is asked of a simulation, and what follows from it: index form, method, instants."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from sysdyn.runtime.events.plan import Plan
from sysdyn.runtime.integrate.request import OF_INDEX_ONE, ON_UNDERLYING, STEP, TRACE
from sysdyn.runtime.model.description import Floats, Ints
from sysdyn.runtime.model.failures import NoSuchForm, WrongOption
from sysdyn.runtime.numerics.points import distinct
from sysdyn.runtime.structure.structure import Structure
from sysdyn.runtime.trace.trace import TraceParameter
from sysdyn.values import dataclass

METHODS = ("bdf", "radau", "rosenbrock", "dopri", "energy", "euler")
"""What may be named instead of auto."""
ROUNDED = 4.0 * float(np.finfo(np.float64).eps)
"""Of the larger end of the span: an instant beyond it by no more is that end."""

Progress = Callable[[float, float | None], None]
"""Fraction of the span done, seconds left (None: not known yet)."""
Watch = Callable[[tuple[str, ...]], Callable[[Floats, Floats], NDArray[np.bool_]]]
"""Names of block observe -> a watcher of one run: instants [k] (s), values [k, observed] -> the rows that it wants."""


@dataclass(frozen=True, slots=True)
class Options:
    """What `sysdyn simulate` asks for.  Times in s.

    output: the trace's file, None: it stays in memory; every: interval of the trace (None: accepted steps); at:
    further instants of the trace; sampled_at: instants of samples alone; accuracy relative to the largest value of
    each traced quantity, accuracy_on: (name, accuracy) of single ones (the others are then free if `accuracy` is
    None), to_range: of these relative to the largest less the least value; rtol, atol: the solver's own, switch the
    control off; accuracy_check: a second run by another method must agree; first: tolerance with which the control of
    the accuracy begins; euler_step: of method "euler"; longest: step [s]; order: of bdf at most, of radau (5, 9, 13)
    at every step; stops: ascending instants at which the text jumps or has kinks: a step ends and the integration
    restarts there; redundancy: what becomes of redundant constraints: drop (the last written of each dependent group is
    left out), minimum_norm (the least multipliers), error (the caller has seen to it); sample_steps: the watcher sees
    accepted steps and what is within them too; extrema: least and largest values are sought within steps; watch: what
    of a run the samples are to hold.
    """

    output: str | Path | None
    t_start: float
    t_end: float
    every: float | None = None
    at: tuple[float, ...] = ()
    sampled_at: tuple[float, ...] = ()
    accuracy: float | None = 1e-4
    accuracy_on: tuple[tuple[str, float], ...] = ()
    to_range: tuple[str, ...] = ()
    rtol: float | None = None
    atol: float | None = None
    accuracy_check: bool = False
    first: float | None = None
    method: str = "auto"
    index: str = "auto"
    euler_step: float | None = None
    longest: float | None = None
    order: int | None = None
    stops: Floats | None = None
    redundancy: str = "error"
    events: Plan | None = None
    max_steps: int | None = None
    max_wall: float | None = None
    sample_steps: bool = False
    extrema: bool = False
    watch: Watch | None = None
    timings: bool = True
    cpu_compile: float = 0.0
    wall_began: float | None = None
    progress: Progress | None = None
    attributes: Mapping[str, str] = field(default_factory=dict)
    parameters: tuple[TraceParameter, ...] = ()


HIGHEST = 3
"""Index as written up to which a form is integrated: a step of length h divides round-off by h^(index - 1)."""


def above_highest(index: int) -> str:
    """Why a model of that index is not integrated, and the remedy."""
    return (
        f"the index is {index}, and nothing above {HIGHEST} is integrated: a store lies between what a constraint"
        " prescribes and the effort that enforces it; prescribe the displacement that this effort acts on"
    )


def choose_index(wanted: str, facts: Structure, method: str = "auto") -> tuple[str, int, tuple[str, ...]]:
    """Form of the runtime, its index, warnings.  Raises NoSuchForm for a method that cannot integrate the form."""
    written = facts.index
    # explicit methods integrate the underlying equation
    if wanted == "auto" and method in ON_UNDERLYING:
        wanted = "0"
    if method in ON_UNDERLYING and wanted != "0":
        raise NoSuchForm(
            f"method {method} integrates the underlying equation, index 0, and index {wanted} was asked for"
        )
    # index 0: an explicit equation for the rates
    if wanted == "0":
        return "0", 1, ()
    # higher indices have no form here
    if written is not None and written > HIGHEST:
        raise NoSuchForm(above_highest(written))
    # rosenbrock serves index 1 at most
    if method in OF_INDEX_ONE:
        if wanted not in ("auto", "1") and (written is None or written > 1):
            raise NoSuchForm(f"method {method} integrates equations of index 1, and index {wanted} was asked for")
        return ("3", written, ()) if written is not None and written <= 1 else ("1", 1, ())
    # nothing known of the index: as written
    if written is None:
        return "3", 2, ("the model's index could not be determined: integrated as written",)
    # index 3 is stabilised to 2 (Gear, Gupta, Leimkuhler), others stay as written
    if wanted == "auto":
        return ("2", 2, ()) if written == 3 else ("3", written, ())
    # constraints of positions as they are
    if wanted == "3":
        note = ("index 3 integrated directly: about 100 times less accurate than the stabilised form",)
        return "3", written, note if written >= 3 else ()
    # stabilised: positions and velocities
    if wanted == "2":
        return ("2", 2, ()) if written >= 3 else ("3", written, ())
    # constraints by velocities
    if wanted == "2v":
        return "2v", min(written, 2), ()
    # constraints by accelerations
    if wanted == "1":
        return "1", min(written, 1), ()
    raise WrongOption(f"index {wanted}: auto, 3, 2, 2v, 1 or 0")


def own_tolerances(options: Options) -> bool:
    """Whether the solver's own tolerances are given: nothing estimates the error."""
    return options.rtol is not None or options.atol is not None


def choose_method(options: Options) -> str:
    """The method of the core, or euler, with which a simulation begins; WrongOption for what does not exist.

    auto: radau, with the solver's own tolerances bdf; the underlying equation (index 0) is begun with dopri.  (The
    explicit method may come first: `alternatives`.)  CPU of
    radau over that of bdf at equal error, geometric mean over the 23 seed and benchmark models without the explicit
    method: 1.17 at 1e-3, 1.09 at 1e-4, 1.02 at 1e-6.
    """
    if options.method == "auto" and options.index == "0":
        return "dopri"
    # own tolerances: bdf, whose error test they are made for
    if options.method == "auto":
        own = options.rtol is not None or options.atol is not None
        return "bdf" if own else "radau"
    # a method named by the user
    if options.method in METHODS:
        return options.method
    raise WrongOption(f"method {options.method}: auto, {', '.join(METHODS[:-1])} or {METHODS[-1]}")


def instants(options: Options) -> tuple[Floats, Ints]:
    """Instants and kinds of rows: grid, --at, samples.  Raises WrongOption for instants outside the span."""
    t0, t1 = options.t_start, options.t_end
    beyond = ROUNDED * max(abs(t0), abs(t1))  # 400*1e-9 is more than 400 ns
    outside = [t for t in options.at if not t0 - beyond <= t <= t1 + beyond]
    if outside:
        raise WrongOption(f"instant {outside[0]:g} s lies outside {t0:g} .. {t1:g} s")
    # instants that rounding put outside are moved to the ends
    wanted = np.clip(np.asarray(options.at, dtype=np.float64), t0, t1)
    if options.every is not None:
        # 1 s by 0.1 s is ten steps, though 10 * 0.1 rounds
        number = int(np.floor((t1 - t0) / options.every * (1.0 + 1e-12)))
        grid = np.minimum(t0 + options.every * np.arange(number + 1), t1)
        if t1 - grid[-1] < 1e-9 * options.every:
            grid[-1] = t1
        wanted = np.concatenate([wanted, grid])
    # both ends are always there
    wanted = distinct(np.concatenate([wanted, [t0, t1]]))
    if not options.sampled_at:
        return wanted, np.full(wanted.size, TRACE, dtype=np.int32)
    # samples of `every` are rows too, not shown in the trace
    sampled = np.asarray(options.sampled_at, dtype=np.float64)
    every = distinct(np.concatenate([wanted, sampled]))
    return every, (TRACE * np.isin(every, wanted) + STEP * np.isin(every, sampled)).astype(np.int32)
