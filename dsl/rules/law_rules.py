"""Rules on the finished network: Paynter's diagram, state functions and laws.  One rule, one file, one code."""

from __future__ import annotations

from sysdyn.dsl.model.network import Network
from sysdyn.dsl.model.values import Values
from sysdyn.dsl.rules.counted_twice import counted_twice
from sysdyn.dsl.rules.dependent_stores import dependent_stores
from sysdyn.dsl.rules.heat import heat
from sysdyn.dsl.rules.passivity import passivity
from sysdyn.dsl.rules.pseudo_domains import pseudo_domains
from sysdyn.dsl.rules.reciprocity import reciprocity
from sysdyn.dsl.rules.state_functions import state_functions
from sysdyn.dsl.rules.transforms import transforms
from sysdyn.dsl.text.diagnostics import Report


def run(network: Network, known: Values, report: Report) -> None:
    """All of them."""
    for rule in (state_functions, transforms, counted_twice, heat, pseudo_domains):
        rule(network, report)
    reciprocity(network, known, report)
    passivity(network, known, report)
    if not report.failed:
        dependent_stores(network, report)
