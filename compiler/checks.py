"""Rules that need energies: dependence on unknowns, and structure (bipartite matching)."""

from __future__ import annotations

from sysdyn.compiler.energies import EnergyModel
from sysdyn.dsl.diagnostics import Diagnostic
from sysdyn.dsl.network import Network


def check_energies(model: EnergyModel, network: Network) -> tuple[Diagnostic, ...]:
    """All findings."""
    return ()
