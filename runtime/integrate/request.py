"""What is asked of one integration, and what it hands back."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import field

import numpy as np
from numpy.typing import NDArray
from sysdyn.runtime import _core
from sysdyn.runtime.events.plan import Happened, Plan
from sysdyn.runtime.integrate.rows.ledgers import LedgerBalance, Ledgers
from sysdyn.runtime.model import core_library as lib
from sysdyn.runtime.model.description import Floats, Ints
from sysdyn.values import dataclass

LONGEST = 0.05
"""Longest step as part of the span: short events of sources are met, and the dense output stays honest."""

ON_UNDERLYING = ("dopri", "energy")
"""Methods that integrate the underlying equation (form 0)."""

OF_INDEX_ONE = ("rosenbrock",)
"""Methods that integrate equations of index 1 alone, as written or with constraints differentiated twice (form 1)."""

TRACE: int = _core.SD_TRACE
STEP: int = _core.SD_SAMPLE
COMPARED: int = _core.SD_COMPARED
RELAXING: int = _core.SD_RELAXING
"""Kinds of rows (their second column, a sum); RELAXING: compared, where something relaxes at once behind a
restart; in the place of energies these have what core/run/compared.c (`relaxes`) tells."""


@dataclass(frozen=True, slots=True)
class Request:
    """What an integration shall do.

    t_end [s]; instants [s] ascending: where rows are wanted, instant_kinds: their kinds
    (TRACE, COMPARED or both; None: all TRACE), every_step: at each accepted step too; rtol; atol:
    absolute tolerance of all unknowns in SI units, None: rtol times the magnitude of each; method: bdf, radau,
    rosenbrock (index at most 1), dopri or energy (form 0);
    fixed_step [s]: no error test (bdf with max_order 1: the implicit Euler method); h_max
    [s]: longest step, None: LONGEST of the span; stops [s] ascending: instants at which a step ends and the
    integration restarts (jumps/segments.py); least_norm: rows hold the least multipliers of redundant constraints;
    stiff_steps: dopri and energy give up
    where stability holds it to more steps than these, dopri also where a system that is much faster than its motion
    takes it more than spare_steps and those it took (0: never); settled_to: scaled residual that will do for rows
    by which runs are compared and nothing else, of a draft for all, 0: round-off; audited: they are compared by the
    audit's members too;
    condense: what constant sums define leaves the system (condense/);
    stages: of radau, in the first step and at most, None: chosen;
    opening: of dopri, rosenbrock: first step as an earlier run found it fit (steppers/explicit/dopri.h), 0: chosen;
    ceiling [unknowns]: what guessed sizes of states are no larger than, as an earlier run met them, None: any;
    unstrained: steps, with a quarter of those before, in which Newton may not fail in nearly every second one, else it
    is given up (cause strained); 0: it goes on whatever fails; tried: another method follows where it creeps;
    apart: part of a step; instants within it that are nearer to the row before are passed over;
    extrema: what is observed is looked at within steps for its least and largest values.
    """

    t_end: float
    instants: Floats
    instant_kinds: Ints | None = None
    every_step: bool = True
    sample_steps: bool = False
    extrema: bool = False
    rtol: float = 1e-6
    atol: float | None = None
    max_steps: int | None = None
    max_wall: float | None = None
    index: int = 3
    method: str = "bdf"
    max_order: int = lib.MAX_ORDER
    fixed_step: float | None = None
    h_max: float | None = None
    stops: Floats | None = None
    least_norm: bool = False
    events: Plan | None = None
    begin: tuple[Floats, NDArray[np.bool_]] | None = None
    stiff_steps: float = 1e5
    spare_steps: float = 0.0
    settled_to: float = 0.0
    draft: bool = False
    audited: bool = False
    apart: float = 0.0
    condense: bool = True
    valued: bool = True
    stages: tuple[int, int] | None = None
    unstrained: int = 0
    tried: bool = False
    opening: float = 0.0
    ceiling: Floats | None = None

    @property
    def tolerance(self) -> float:
        """What the error test compares with: radau's estimate is of a lower order (core/steppers/radau/radau.h)."""
        return 0.1 * self.rtol ** (2.0 / 3.0) if self.method == "radau" else self.rtol

    @property
    def switched(self) -> bool:
        """Whether which constraints hold changes, or something is assigned; laws that change their branches alone leave
        constant sums as they are.
        """
        return bool(self.events and not self.events.of_laws)


@dataclass(frozen=True, slots=True)
class Statistics:
    """Deterministic counters of one or more runs."""

    steps: int = 0
    rejected_steps: int = 0
    residual_evaluations: int = 0
    jacobian_evaluations: int = 0
    factorisations: int = 0
    newton_failures: int = 0

    def __add__(self, other: Statistics) -> Statistics:
        return Statistics(*(getattr(self, name) + getattr(other, name) for name in self.__slots__))


@dataclass(frozen=True, slots=True)
class Finished:
    """An integration that reached its end.

    magnitude [kinds and units]: the largest, as the run confirmed it; largest [observed]: of the values and of the
    terms of their expressions; cpu [s]; ledgers: what came of them is read of the run that is kept; beyond: the largest
    unknown of a row within a step, in magnitudes that it has at steps; last: what gives y and yd at its end
    [unknowns], the largest |y| of each kind and unit; opening, ceiling: for the next run's request; extrema: least and
    largest values within steps [2, observed] (infinite where there are none), where these were looked into;
    peaks: largest |y| met [unknowns] (None: of a large system);
    open: rows of block observe that nothing determined at times, and the contacts between which they floated.
    """

    reached: float
    statistics: Statistics
    magnitude: Floats
    largest: Floats
    cpu: float
    unsettled: int
    ledgers: Ledgers | None = None
    events: tuple[Happened, ...] = ()
    beyond: float = 0.0
    last: tuple[Callable[[], tuple[Floats, Floats]], Floats] | None = None
    opening: float = 0.0
    ceiling: Floats | None = None
    extrema: Floats | None = None
    peaks: Floats | None = None
    open: dict[int, tuple[str, ...]] = field(default_factory=dict)

    @property
    def balances(self) -> tuple[LedgerBalance, ...]:
        """What came of each ledger."""
        return () if self.ledgers is None else self.ledgers.balances()
