"""EnergyModel -> DescriptorForm of Lagrange (book, chapter 3): (3.34), T(p) kept as momentum rows where given."""

from __future__ import annotations

from sysdyn.compiler.forms.descriptor import DescriptorForm
from sysdyn.compiler.forms.lowering import lower
from sysdyn.compiler.model.energies import EnergyModel


def lagrangian(model: EnergyModel) -> DescriptorForm:
    """Unknowns q f kappa mu e s; momenta only of stores that the author gave by T(p)."""
    return lower(model, "lagrangian", legendre=False)
