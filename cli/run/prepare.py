"""From a target to a model that can be evaluated: front end, lowering, binding, carrier.

The one place where what the compiler makes is handed to the runtime.
"""

from __future__ import annotations

import time
from dataclasses import field
from typing import Any

from sysdyn.compiler.binding.binding import Binding, places_of
from sysdyn.compiler.formulations import choose
from sysdyn.compiler.network.pruning import Removal, prune_network
from sysdyn.compiler.pipeline import CompiledModel, compile_network
from sysdyn.compiler.program import build
from sysdyn.dsl import load
from sysdyn.dsl.model.collecting import at_rest
from sysdyn.dsl.model.expression import Node
from sysdyn.dsl.model.network import Network
from sysdyn.dsl.text.diagnostics import ModelError, Place, Report
from sysdyn.runtime.model import carrier
from sysdyn.runtime.model.carrier import Carrier
from sysdyn.runtime.model.description import position_of
from sysdyn.values import dataclass


@dataclass(frozen=True, slots=True)
class Prepared:
    """A compiled model with its numbers bound; backend says which carrier it has.

    network: what was compiled; whole: what was written; left_out: the parts that the scene does not need;
    unasked: quantities observed for an analysis alone; structure: of the manifest, which is what runs ask of it.
    """

    network: Network
    compiled: CompiledModel
    binding: Binding
    structure: dict[str, Any]
    carrier: Carrier
    formulation: str
    backend: str
    cpu_compile_s: float
    whole: Network
    left_out: tuple[Removal, ...] = ()
    unasked: frozenset[str] = frozenset()
    layouts: dict[Any, dict[Any, Any]] = field(default_factory=dict, compare=False, repr=False)
    """What the runtime finds of the structure of index forms, by sizes: other numbers have the same."""
    alone: bool = False
    """Nothing of a run but its trace is asked for: the next one may take its structures."""

    @property
    def manifest(self) -> dict[str, Any]:
        """The object of manifest.json, made when asked: it names what the author wrote one by one, and its numbers."""
        return self.compiled.manifest(self.binding)

    @property
    def arrays(self) -> dict[str, Any]:
        """The binding as the contract's plain arrays."""
        b = self.binding
        sizes = b.ix.tobytes(), b.shapes, b.row_shapes
        stand = not (self.network.events or self.network.switches or self.compiled.form.kinks)
        holds = [self.place(s.holds) for s in self.compiled.network.switches if s.holds is not None]
        found = {**self.arrays_of(b), "stand": stand, "holds": holds}
        return {**found, "layouts": self.layouts.setdefault(sizes, {}), "alone": self.alone}

    @property
    def begin(self) -> float:
        """Where the time of the scene begins [s]; 0 where it says nothing."""
        scene = self.network.scene
        return 0.0 if scene is None or scene.start is None else self.binding.evaluate(scene.start)

    def place(self, node: Node) -> int:
        """The place in p of a parameter, or of an element of one."""
        compiled, binding = self.compiled, self.binding
        if not node.args:
            return compiled.program.scalars.index(node.data)
        boxes = binding.parameters.boxes[node.data]
        where = places_of(compiled.network, compiled.form, compiled.program, binding)[1][node.data]
        return where + position_of(boxes, self.indices(node))

    def indices(self, node: Node) -> tuple[int, ...]:
        """The indices of an element: numbers, or sizes (the last one of an array that is declared by itself)."""
        return tuple(round(self.binding.evaluate(n)) for n in node.args)

    @staticmethod
    def arrays_of(b: Binding) -> dict[str, Any]:
        """Another binding of the same model as plain arrays."""
        return {
            "p": b.p,
            "ix": b.ix,
            "shapes": b.shapes,
            "row_shapes": b.row_shapes,
            "offsets": b.offsets,
            "initial": [s.to_json() for s in b.initial],
        }


@at_rest()
def prepare(
    network: Network,
    report: Report,
    *,
    formulation: str | None = None,
    backend: str = "c",
    traced: bool = False,
    prune: bool = False,
    gather: bool = True,
) -> Prepared | None:
    """Compile and bind a network; None where the report says why not.

    traced: a run is asked, which traces every coordinate where the text traces nothing.
    gather: what is written out by hand and alike may be lowered as families: not where the equations are to be read.
    prune: leave out what the scene does not need; that the rest is well-formed is judged of the whole all the same.
    formulation None: the scene's, else auto.  A missing C compiler is reported as a note and NumPy takes over.
    """
    cpu = time.process_time()
    whole, place = network, None
    # what is left out must be well-formed all the same
    network, left_out = prune_network(whole) if prune else (whole, ())
    if left_out and not _well_formed(whole, report):
        return None
    # the scene's own, with its place for findings
    if formulation is None:
        formulation = (network.scene.formulation if network.scene else None) or "auto"
        place = network.scene.formulation_place if network.scene else None
    chosen, found = choose(network, formulation, place)
    report.extend(load.at_authors(network, found))
    if found:
        return None
    # lowering may find what the rules of the text did not
    try:
        compiled, made, backend = _compile_and_load(network, chosen, backend, report, traced, gather)
        binding = compiled.bind()
    except ModelError as error:
        report.extend(load.at_authors(network, error.diagnostics))
        return None
    report.extend(compiled.notes)
    structure = compiled.structure()
    spent = time.process_time() - cpu
    return Prepared(network, compiled, binding, structure, made, chosen, backend, spent, whole, left_out)


def _well_formed(network: Network, report: Report) -> bool:
    """Whether the structure of a whole network is right (language, section 9); its findings go to the report."""
    formulation, found = choose(network, "auto", None)
    try:
        if not found:
            compile_network(network, formulation, "numpy").bind()
    except ModelError as error:
        found = load.at_authors(network, error.diagnostics)
    report.extend(found)
    return not any(d.severity == "error" for d in found)


def _compile_and_load(
    network: Network, formulation: str, backend: str, report: Report, traced: bool, gather: bool
) -> tuple[CompiledModel, Carrier, str]:
    """Compile and load a network by C, or by NumPy where there is no compiler, which N609 notes."""
    if backend == "c":
        compiled = compile_network(network, formulation, "c", traced=traced, gather=gather)
        try:
            return compiled, carrier.load(compiled.library()), "c"
        except (build.BuildError, OSError) as error:  # no compiler, one that cannot build, a file that may not be run
            first = getattr(error, "output", "").strip().splitlines()[:1]
            said = ": ".join([str(error), *first])
            report.note("N609", f"{said}: the NumPy backend takes over", network.place, help="--backend numpy")
    from sysdyn.cli.run.numpy_module import module_of

    compiled = compile_network(network, formulation, "numpy", traced=traced, gather=gather)
    return compiled, carrier.load(module_of(compiled.text)), "numpy"


def place_at(network: Network, file: str, line: int) -> Place:
    """The statement of the network that begins on a line; the model's name where there is none."""
    groups = (
        network.constraints,
        network.branches,
        network.works,
        network.energies,
        network.dynamics,
        network.initials,
        network.unknowns,
        network.states,
        network.coordinates,
    )
    for group in groups:
        for item in group:
            if item.place.file == file and item.place.start[0] == line:
                return item.place
    return network.place
