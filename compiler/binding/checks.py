"""Rules that need energies: what depends on which unknown (language, section 9: E506, E513, E516, E606).

Purely syntactic rules are the front end's; those that count array elements are in `counts`.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator

from sysdyn.compiler.forms.momenta import coordinates_by_energy, inertial, undefined_momenta
from sysdyn.compiler.model.energies import EnergyModel, tangible
from sysdyn.compiler.model.integers import Integers
from sysdyn.compiler.network.primal.bounds import WholeNumbers
from sysdyn.dsl.model.affine import AFFINE
from sysdyn.dsl.model.expression import Node, topological, variables
from sysdyn.dsl.model.network import Network
from sysdyn.dsl.text.diagnostics import Diagnostic, ModelError, Place, Related


def check_energies(model: EnergyModel, network: Network) -> tuple[Diagnostic, ...]:
    """All findings, in the order of the rules' codes."""
    return (
        *_idle_efforts(model),
        *_assertions(model, network),
        *_find_undetermined(model, WholeNumbers(network)),
        *_missing_momenta(model),
        *_indices(model),
    )


def _idle_efforts(model: EnergyModel) -> Iterator[Diagnostic]:
    """E506: an implicit effort that does no work and stands in no gamma."""
    used = _owners([w.effort for w in model.works], "e") | _owners(_of_rows(model, ("gamma",)), "e")
    for unknown in model.unknowns:
        if unknown.name not in used:
            message = f"implicit effort '{unknown.name}' appears in no work and in no gamma"
            help_ = f"delete it, or 'work {unknown.name} on' a coordinate"
            yield Diagnostic("E506", message, unknown.place, help_)


def _assertions(model: EnergyModel, network: Network) -> Iterator[Diagnostic]:
    """E513: `tangible` or `intangible` against what the statements say."""
    touched = tangible(model)
    for c in network.coordinates:
        if c.asserted is False and c.name in touched:
            message = f"{c.name} is declared intangible but its displacement occurs undifferentiated"
            related = (Related("occurs here", touched[c.name]),)
            yield Diagnostic("E513", message, c.place, "delete 'intangible'", related)
        if c.asserted is True and c.name not in touched:
            message = f"{c.name} is declared tangible but its displacement occurs nowhere undifferentiated"
            yield Diagnostic("E513", message, c.place, "delete 'tangible'")


def _find_undetermined(model: EnergyModel, sizes: WholeNumbers) -> Iterator[Diagnostic]:
    """E516: no store, dissipator, constraint or law contains the coordinate, and there is one (no empty range)."""
    roots = [t.expression for name in model.functions for t in model.function(name)]
    roots += _of_rows(model, ("phi", "psi", "gamma")) + [w.effort for w in model.works]
    m = model.mirror
    present = _owners(roots, m.coordinate) | _owners(roots, m.rate) | _owners(roots, m.conjugate)
    # an implicit effort on it is a reaction: what it is closed by may hold another coordinate
    for work in model.works:
        if _owners([work.effort], "e"):
            present |= _owners([work.on], m.coordinate)
    for c in model.coordinates:
        if c.name not in present and all(sizes.value(a) <= sizes.value(b) for a, b in c.shape):
            message = f"coordinate {c.name} has no inertia, stiffness, dissipation or constraint: it is undetermined"
            yield Diagnostic("E516", message, c.place, "give it an energy, a content or a constraint")


def _missing_momenta(model: EnergyModel) -> Iterator[Diagnostic]:
    """E606: x.p is read, and no kinetic store moves with x."""
    carriers = coordinates_by_energy(model) | inertial(model)
    for expression, place in _written(model):
        for name in dict.fromkeys(undefined_momenta(model, carriers, expression)):
            message = f"{name} has no momentum variable: T* has no second derivative in {name}'"
            yield Diagnostic("E606", message, place, "dT*/df is zero there")


def _indices(model: EnergyModel) -> Iterator[Diagnostic]:
    """E806: an index that is not i + c; each once."""
    seen: set[Node] = set()
    energies = ((t.expression, t.place) for name in model.functions for t in model.function(name))
    for expression, place in (*energies, *_written(model)):
        for node in topological([expression]):
            for at in node.args if node.op in ("var", "param") and node not in seen else ():
                try:
                    Integers().index(at, defaultdict(int))
                except ModelError as error:
                    yield Diagnostic("E806", error.diagnostics[0].message, place, AFFINE)
            seen.add(node)


def _written(model: EnergyModel) -> list[tuple[Node, Place]]:
    """Everything but the energies that a statement says, with its place."""
    asked = [(q.expression, q.place) for q in model.quantities]
    asked += [(i.target, i.place) for i in model.initials]
    asked += [(t.expression, t.place) for row in model.rows for t in row.terms]
    return asked + [(w.effort, w.place) for w in model.works]


def _of_rows(model: EnergyModel, kinds: tuple[str, ...]) -> list[Node]:
    return [t.expression for row in model.rows if row.kind in kinds for t in row.terms]


def _owners(roots: list[Node], kind: str) -> set[str]:
    return {n.data[0] for root in roots for n in variables(root) if n.op == "var" and n.data[1] == kind}
