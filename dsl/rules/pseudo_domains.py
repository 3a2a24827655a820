"""E213: a pseudo domain and another domain in one energy or two-port: their products e f are not the same quantity."""

from __future__ import annotations

from sysdyn.dsl.model.dimensions import POWER
from sysdyn.dsl.model.network import Domain, Network
from sysdyn.dsl.model.paynter import STATE_FUNCTIONS
from sysdyn.dsl.model.units import Dimension, multiply
from sysdyn.dsl.rules.letters import Diagram
from sysdyn.dsl.text.diagnostics import Place, Report

HELP = "couple them by a source: flow(f = R.e*R.f) ground -> hot"


def pseudo_domains(network: Network, report: Report) -> None:
    """Energies, contents and couplings."""
    branches = {b.name: b for b in network.branches}
    for coupling in network.couplings:
        ends = [branches[name].domain for name in (coupling.first, coupling.second) if name in branches]
        _meet(ends, f"the {coupling.kind} '{coupling.first.partition('#')[0]}'", coupling.place, report)
    diagram = Diagram(network)
    for energy in network.energies:
        domains = [domain for _, domain in diagram.domains(energy.expression)]
        if domains and all(d.pseudo and _product(d) != POWER for d in domains):
            unit = "power" if STATE_FUNCTIONS[energy.function].edge == "dissipator" else "energy"
            message = f"{energy.function} is {unit}, but e*f of the pseudo domain '{domains[0].name}' is not"
            report.error("E213", message, energy.place, help="elements with laws: they keep a ledger of their own")
        else:
            _meet(domains, energy.function, energy.place, report)


def _product(domain: Domain) -> Dimension:
    return multiply(domain.effort.dimension, domain.flow.dimension)


def _meet(domains: list[Domain], where: str, place: Place, report: Report) -> None:
    products = {_product(d): d for d in domains}
    if len(products) > 1:
        one, other = sorted(products.values(), key=lambda d: not d.pseudo)[:2]
        word = "pseudo domain" if one.pseudo else "domain"
        message = f"{word} '{one.name}' and domain '{other.name}' meet in {where}"
        report.error("E213", f"{message}; their products e*f are not the same quantity", place, help=HELP)
