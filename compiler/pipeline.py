"""Network -> CompiledModel: the list of arrows, each timed.

primal -> energies -> integration -> lagrangian | hamiltonian -> program -> C or NumPy text
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import replace
from pathlib import Path
from typing import Any

from sysdyn.compiler.binding import binding as binding_
from sysdyn.compiler.binding import columns as columns_
from sysdyn.compiler.binding import manifest
from sysdyn.compiler.binding import rebinding as again_
from sysdyn.compiler.binding.binding import Binding, Overrides
from sysdyn.compiler.binding.checks import check_energies
from sysdyn.compiler.binding.columns import Floats, ParameterColumns
from sysdyn.compiler.binding.counts import check_counts
from sysdyn.compiler.binding.rebinding import Consequences
from sysdyn.compiler.forms import descriptor
from sysdyn.compiler.forms.conjugates import with_book_signs
from sysdyn.compiler.forms.corners.frozen import frozen
from sysdyn.compiler.forms.descriptor import DescriptorForm
from sysdyn.compiler.forms.hamiltonian import hamiltonian
from sysdyn.compiler.forms.integration import integrate
from sysdyn.compiler.forms.kane import kane
from sysdyn.compiler.forms.lagrangian import lagrangian
from sysdyn.compiler.forms.legendre import legendre_transform
from sysdyn.compiler.forms.meters.default_traces import with_coordinates_observed
from sysdyn.compiler.forms.relative_coordinates import in_relative_coordinates, without_ignorable
from sysdyn.compiler.forms.series_stores import with_efforts_of_stores
from sysdyn.compiler.forms.steepness import add_scale_blocks
from sysdyn.compiler.model import energies
from sysdyn.compiler.model.energies import EnergyModel
from sysdyn.compiler.model.mirror import refusal, word
from sysdyn.compiler.network.alike_elements import gather_families
from sysdyn.compiler.network.along import along
from sysdyn.compiler.network.authors import in_author_names, split_finding
from sysdyn.compiler.network.primal import Step, primal
from sysdyn.compiler.network.primal.precedence import outermost
from sysdyn.compiler.network.quadratures import with_momenta
from sysdyn.compiler.network.reflection import reflect, relabel
from sysdyn.compiler.network.verify import verify_network
from sysdyn.compiler.network.written_energies import FOREIGN, as_elements
from sysdyn.compiler.program import build
from sysdyn.compiler.program import program as program_
from sysdyn.compiler.program.emit_c import emit_c
from sysdyn.compiler.program.emit_numpy import emit_numpy
from sysdyn.compiler.program.program import Program
from sysdyn.compiler.program.program_text import verify_program
from sysdyn.dsl.model import budget
from sysdyn.dsl.model.calculus import NoDerivativeError
from sysdyn.dsl.model.collecting import at_rest
from sysdyn.dsl.model.network import Network, Parameter
from sysdyn.dsl.text.diagnostics import Diagnostic, ModelError
from sysdyn.values import dataclass

FORMULATIONS: dict[str, Callable[[EnergyModel], DescriptorForm]] = {
    "lagrangian": lagrangian,
    "hamiltonian": hamiltonian,
    "kane": kane,
}
"""The primal arrows; `co_` before a name says that they lower the network's reflection."""


@dataclass(frozen=True, slots=True)
class Timing:
    """Wall and CPU seconds of one stage."""

    stage: str
    wall: float
    cpu: float


@dataclass(frozen=True, slots=True)
class CompiledModel:
    """A model in one formulation: every stage's value, the generated text, and how long each stage took.

    family: nodes and branches of the formulation's family; network: the same in coordinates; energies: as said;
    functions: as lowered, with T(p, q) in Hamilton's form; written: the network before what is alike was gathered.
    """

    family: Network
    network: Network
    energies: EnergyModel
    functions: EnergyModel
    form: DescriptorForm
    program: Program
    backend: str
    text: str
    notes: tuple[Diagnostic, ...]
    steps: tuple[Step, ...]
    timings: tuple[Timing, ...]
    written: Network | None = None

    def bind(self, overrides: Overrides | None = None) -> Binding:
        """The numbers for one set of parameter values; never recompiles.  ModelError where they make no model."""
        try:
            return self._bound(overrides)
        except ModelError:
            if self.written is not None:  # at the author's places
                _compile_stages(self.written, self.form.formulation, "numpy", integrating=True, traced=False).bind(
                    overrides
                )
            raise

    def _bound(self, overrides: Overrides | None) -> Binding:
        binding = binding_.bind(self.network, self.energies, self.form, self.program, overrides)
        scene = self.network.scene
        at_times = frozenset(s.label for s in self.network.switches if s.holds is None)
        found = check_counts(self.form, self.program, binding, at_times)
        if scene is not None and scene.redundancy in ("drop", "minimum_norm"):
            found = tuple(d for d in found if d.code != "E517")
        if found:
            raise ModelError(found)
        return binding

    def way(self, binding: Binding, names: frozenset[str]) -> Consequences | None:
        """What follows from scalar parameters; None where more than numbers does."""
        return again_.way(self.network, self.energies, self.form, self.program, binding, names)

    def columns(self, binding: Binding, varied: Mapping[str, Floats]) -> ParameterColumns | None:
        """Bindings of many runs at once; None where each needs its own."""
        return columns_.columns(self.network, self.energies, self.form, self.program, binding, varied)

    def manifest(self, binding: Binding, index: int | None = None) -> dict[str, Any]:
        """The object of manifest.json."""
        return manifest.manifest(self.network, self.form, self.program, binding, index)

    def in_author_letters(self, network: Network) -> Network:
        """A network of this model in the letters of the author's text."""
        return relabel(network) if self.form.formulation.startswith("co_") else network

    def structure(self) -> dict[str, Any]:
        """The manifest's `structure` alone."""
        return manifest.structure(self.form, self.program, self.network)

    def library(self) -> Path:
        """The compiled library of the C text; `build.NoCompilerError` where there is no compiler."""
        return build.build(self.text)


def compile_network(
    network: Network,
    formulation: str = "lagrangian",
    backend: str = "c",
    *,
    integrating: bool = True,
    traced: bool = False,
    gather: bool = False,
) -> CompiledModel:
    """Lower a checked network; ModelError with everything the energies' rules found.

    gather: what is written out by hand and alike as families (network/alike_elements.py).
    traced: where the text traces nothing, every coordinate and every dynamic variable is.
    """
    try:
        with at_rest(), budget.drawn(network.place.source.text):
            families = gather_families(network, irregular=not formulation.startswith("co_")) if gather else network
            if families is not network:
                # families of alike elements first, the text as it is where they fail
                with suppress(ModelError):  # what is wrong is said of what the author wrote
                    found = _compile_stages(families, formulation, backend, integrating=integrating, traced=traced)
                    return _restore_author_names(found, network)
            return _compile_stages(network, formulation, backend, integrating=integrating, traced=traced)
    except (budget.SpentError, NoDerivativeError) as spent:
        raise ModelError([spent.diagnostic(network.place)]) from spent


def _compile_stages(
    network: Network, formulation: str, backend: str, *, integrating: bool, traced: bool
) -> CompiledModel:
    """Compile a network by all stages, each timed; ModelError where one of them refuses."""
    timings: list[Timing] = []
    reflected = formulation.startswith("co_")
    # nodes and branches become coordinates
    with _time_stage("primal", timings):
        network = along(outermost(network), complementary=reflected)
        family = reflect(network) if reflected else with_momenta(as_elements(network, FOREIGN))
        verify_network(family)
        network, inverted, steps = primal(family, reflected=reflected)
        verify_network(network, coordinates=True)
    # the energy model: functions, works, rows
    with _time_stage("energies", timings):
        model, cut = energies.energies(network), tuple[Diagnostic, ...]()
        if traced and not network.traced:
            model, cut = with_coordinates_observed(model, network)
        model = in_relative_coordinates(model)
        # a run: what it reads, in coordinates that hide nothing
        if traced:
            model = with_efforts_of_stores(without_ignorable(model))
        energies.verify_energies(model)
        as_written = network.scene is not None and network.scene.keeps("keep_flow")
        model, notes = integrate(model) if integrating and not as_written else (model, ())
        found = check_energies(model, network)
        if any(d.severity == "error" for d in found):
            raise ModelError(found)
    # rows of the formulation
    with _time_stage("descriptor", timings):
        legendre = formulation.endswith("hamiltonian")
        own, rests = legendre_transform(model, network.parameters) if legendre else (model, ())
        network = replace(network, slopes=(*network.slopes, *rests))
        lowered = _lower(own, formulation)
        titles = tuple(replace(r, label=word(formulation, r.label)) if r.block == "audit" else r for r in lowered.rows)
        lowered = replace(lowered, formulation=formulation, rows=titles)
        form, branches, many = with_book_signs(lowered), tuple[Parameter, ...](), tuple[Diagnostic, ...]()
        # corners frozen by pieces, for events
        if traced:
            form, branches, many = frozen(form, network)
        network = replace(network, parameters=(*network.parameters, *branches))
        form = add_scale_blocks(form)
        descriptor.verify_descriptor(form)
    # operations in the order of their values
    with _time_stage("program", timings):
        program = program_.program(form, tuple(p.name for p in network.parameters if not p.shape))
        verify_program(program)
    with _time_stage("emit", timings):
        text = emit_c(program, form) if backend == "c" else emit_numpy(program, form)
    said = (*inverted, *notes, *cut, *found, *many)
    return CompiledModel(family, network, model, own, form, program, backend, text, said, steps, tuple(timings))


def _lower(model: EnergyModel, formulation: str) -> DescriptorForm:
    """The rows of a formulation; ModelError in its own name where they cannot be."""
    try:
        return FORMULATIONS[formulation.removeprefix("co_")](model)
    except ModelError as refused:
        found = refused.diagnostics
        texts = [(refusal(formulation, d.message), d.help and refusal(formulation, d.help)) for d in found]
        told_ = [replace(d, message=m, help=h) for d, (m, h) in zip(found, texts, strict=True)]
        raise ModelError(told_) from refused


def _restore_author_names(found: CompiledModel, written: Network) -> CompiledModel:
    """What is said of gathered families in the words of the network as it was written."""
    own = found.network.authors
    notes = tuple(n for note in found.notes for n in split_finding(note, own))
    steps = tuple(Step(s.rule, in_author_names(s.what, own), in_author_names(s.became, own)) for s in found.steps)
    return replace(found, notes=notes, steps=steps, written=written)


@contextmanager
def _time_stage(stage: str, timings: list[Timing]) -> Iterator[None]:
    wall, cpu = time.perf_counter(), time.process_time()
    yield
    timings.append(Timing(stage, time.perf_counter() - wall, time.process_time() - cpu))
