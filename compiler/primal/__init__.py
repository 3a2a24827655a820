"""Networks of nodes and branches in displacement coordinates."""

from sysdyn.compiler.primal.coordinates import primal

__all__ = ["primal"]
