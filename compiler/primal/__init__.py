"""Networks of nodes and branches in displacement coordinates."""

from sysdyn.compiler.primal.account import Step
from sysdyn.compiler.primal.coordinates import primal

__all__ = ["Step", "primal"]
