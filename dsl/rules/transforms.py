"""E312: a state function and its Legendre transform of one store are the same store twice."""

from __future__ import annotations

from sysdyn.dsl.model.network import EnergyTerm, Network
from sysdyn.dsl.model.paynter import STATE_FUNCTIONS
from sysdyn.dsl.rules.letters import Diagram, unknowns_of
from sysdyn.dsl.text.diagnostics import Related, Report


def transforms(network: Network, report: Report) -> None:
    """T and T*, V and V*, D and G over one coordinate, node or branch."""
    diagram = Diagram(network)
    owners: dict[str, dict[str, EnergyTerm]] = {name: {} for name in STATE_FUNCTIONS}
    # which coordinate, node or branch has which function
    for energy in network.energies:
        own = STATE_FUNCTIONS[energy.function].own
        for node in unknowns_of(energy.expression):
            if diagram.letter(node) == own:
                owners[energy.function].setdefault(node.data[0], energy)
    # both T and T* of one store would count it twice
    for name in ("T", "V", "D"):
        transform = STATE_FUNCTIONS[name].transform
        for owner, energy in owners[name].items():
            other = owners[transform].get(owner)
            if other is not None:
                message = f"{name} and {transform} are both given for the store of '{owner}'"
                related = (Related(f"{transform} is given here", other.place),)
                help_ = "give one; the other is its Legendre transform"
                report.error("E312", message, energy.place, related=related, help=help_)
                break
