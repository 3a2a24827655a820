"""EnergyModel -> DescriptorForm of Hamilton (book, chapter 4): semi-explicit form (4.14)-(4.15)."""

from __future__ import annotations

from sysdyn.compiler.forms.descriptor import DescriptorForm
from sysdyn.compiler.forms.lowering import lower
from sysdyn.compiler.model.energies import EnergyModel


def hamiltonian(model: EnergyModel) -> DescriptorForm:
    """Unknowns q f p kappa mu e s; a momentum for every coordinate with a kinetic store, none for the others."""
    return lower(model, "hamiltonian", legendre=True)
