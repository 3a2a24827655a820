"""Networks of nodes and branches in displacement coordinates."""

from sysdyn.compiler.network.primal.account import Step
from sysdyn.compiler.network.primal.coordinates import primal

__all__ = ["Step", "primal"]
