"""E320: a dissipator in a domain whose effort is the temperature and whose product e f is power.

What it absorbs is heat, which has nowhere to go: energy is destroyed.  A law that reads the effort of another branch
may be one side of a conductor and is left to its author.
"""

from __future__ import annotations

from sysdyn.dsl.model import expression as ex
from sysdyn.dsl.model.network import Domain, Network
from sysdyn.dsl.model.paynter import STATE_FUNCTIONS
from sysdyn.dsl.model.units import Dimension
from sysdyn.dsl.rules.letters import Diagram, letter
from sysdyn.dsl.text.diagnostics import Report

TEMPERATURE: Dimension = (("K", 1),)
HELP = "a two-sided conductor: entropy H/Ta leaves a, H/Tb enters b; or the pseudo domain 'heat'"


def heat(network: Network, report: Report) -> None:
    """Dissipators and contents of true thermal domains."""
    # entropy is no energy: a dissipator between temperatures has to give its heat to somewhere
    for branch in network.branches:
        if branch.kind != "dissipator" or branch.law is None or not _true(branch.domain):
            continue
        others = [n for n in ex.variables(branch.law) if n.op == "var" and n.data[0] != branch.name]
        if not any(letter(n) in ("e", "f") for n in others):
            name = branch.name.partition("#")[0]
            message = f"'{name}': a dissipator in '{branch.domain.name}' loses energy: the heat it absorbs goes nowhere"
            report.error("E320", message, branch.place, help=HELP)
    diagram = Diagram(network)
    # contents of temperature or entropy flow likewise
    for energy in network.energies:
        if STATE_FUNCTIONS[energy.function].edge != "dissipator":
            continue
        own = STATE_FUNCTIONS[energy.function].own
        for node, domain in diagram.domains(energy.expression):
            if _true(domain) and diagram.letter(node) == own:
                message = f"content {energy.function} of {node} in '{domain.name}' loses energy"
                report.error("E320", f"{message}: the heat it absorbs goes nowhere", energy.place, help=HELP)
                break


def _true(domain: Domain) -> bool:
    return domain.effort.dimension == TEMPERATURE and not domain.pseudo
