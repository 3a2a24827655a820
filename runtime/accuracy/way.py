"""A way through a simulation: a method on a form of the model, and how long method auto goes it."""

from __future__ import annotations

from sysdyn.runtime.accuracy.laws import Law, law_of
from sysdyn.runtime.integrate.request import LONGEST
from sysdyn.runtime.model.system import System
from sysdyn.values import dataclass

LONG = 1000
"""Steps of the bdf after which method auto tries radau."""
LONG_STEEP = 1_000_000
"""The same of steep laws: where they turn Newton's method holds the steps of any method, and the bdf's are cheap."""
BRIEF, BRIEF_STEEP = 1000, 200_000
"""Steps of rosenbrock after which method auto tries another: where laws are so steep that the equations are nearly of
index 2, its error test holds the steps; those of steep laws that turn often."""
HELD = 100
"""Steps that a dopri which stability holds may still have to take before method auto tries another."""
STIFF = 1e5
"""Steps that a stiff dopri which was asked for still takes."""
SPARE, FACTORED = 1.0 / LONGEST, 100
"""Steps that dopri may still take on a system much faster than its motion: no more than any method takes; unknowns of a
system of which radau's factors are cheap enough for it to take over."""


@dataclass(frozen=True, slots=True)
class Way:
    """A method on a form of the model; index: of the form as the error test takes it, name: as the trace names it;
    reason: why method auto takes it; lasting: stability may hold its steps, for those of another are no longer; smooth:
    the motion is long and smooth, however steep its laws; reduced: equations of index 2 taken at index 1.
    """

    method: str
    system: System
    index: int
    name: str
    reason: str = ""
    lasting: bool = False
    smooth: bool = False
    reduced: bool = False

    @property
    def law(self) -> Law:
        """How its errors follow its tolerance."""
        steep = bool(self.system.form.scales)
        return law_of(self.method, steep=steep, smooth=self.smooth, reduced=self.reduced)
