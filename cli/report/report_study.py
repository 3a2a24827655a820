"""What a report is about: a model under a scene, compiled, and its run where there was one."""

from __future__ import annotations

from collections.abc import Sequence

from sysdyn.cli.equations.mathml import Typesetter
from sysdyn.cli.report.balance import Share
from sysdyn.cli.run.prepare import Prepared
from sysdyn.cli.run.request.targets import Target
from sysdyn.cli.run.running import Ran
from sysdyn.cli.run.start.starting import Started
from sysdyn.dsl.model.network import Network
from sysdyn.dsl.text.diagnostics import Place
from sysdyn.dsl.text.source import SourceText
from sysdyn.runtime.trace.trace import Trace
from sysdyn.values import dataclass


@dataclass(frozen=True, slots=True)
class ReportStudy:
    """sources: the texts of the model, its own first; ran, trace: None where there was no run; shares: the energy of
    each element over the run, None where it was not measured; findings: what is to be said first; stages: (stage, wall
    s, CPU s).
    """

    target: Target
    sources: tuple[SourceText, ...]
    network: Network
    prepared: Prepared
    started: Started
    ran: Ran | None
    trace: Trace | None
    shares: tuple[Share, ...] | None
    findings: tuple[str, ...]
    stages: tuple[tuple[str, float, float], ...]

    @property
    def complementary(self) -> bool:
        """Whether the formulation is written in momenta and efforts."""
        return self.prepared.formulation.startswith("co_")

    @property
    def typesetter(self) -> Typesetter:
        """Of the lowered model's expressions."""
        names = (c.name for c in self.prepared.compiled.energies.coordinates)
        elements = (b.name for b in self.network.branches)
        return Typesetter(names, self.network.switches, elements, complementary=self.complementary)

    @property
    def typesetter_of_text(self) -> Typesetter:
        """Of expressions as the text has them."""
        coordinates = self.network.coordinates
        complementary = any(c.complementary for c in coordinates)
        return Typesetter((c.name for c in coordinates), self.network.switches, complementary=complementary)

    def link(self, place: Place | None, label: str) -> str:
        """Label (HTML) as a link to the line of a place; label alone where the page does not show the text."""
        address = self.address(place)
        return label if address is None else f'<a href="{address}">{label}</a>'

    def address(self, place: Place | None) -> str | None:
        """The page's own address of a place."""
        for k, source in enumerate(self.sources if place is not None else ()):
            if place is not None and source.name == place.file:
                return f"#L{k}-{place.start[0]}"
        return None


def sources_of(target: Target, network: Network) -> tuple[SourceText, ...]:
    """The texts that a model is made of: its own first."""
    own = target.document.file.source
    found = {own.name: own}
    groups: Sequence[Sequence[object]] = (
        network.branches,
        network.nodes,
        network.energies,
        network.works,
        network.constraints,
        network.dynamics,
    )
    for group in groups:
        for item in group:
            place = getattr(item, "place", None)
            if isinstance(place, Place):
                found.setdefault(place.file, place.source)
    return tuple(found.values())
