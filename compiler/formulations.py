"""Which formulations can express a network, and the one that `auto` takes.

E601 to E604 name the statement in the way: the complementary family needs laws and constraints that do not depend on
displacements (book 5.14), and coordinates of one style serve one family.
"""

from __future__ import annotations

from sysdyn.compiler.network.reflection import unreflectable
from sysdyn.compiler.network.ties import as_transformers
from sysdyn.dsl.model.expression import Node, variables
from sysdyn.dsl.model.network import Network
from sysdyn.dsl.text.diagnostics import Diagnostic, Place, Related

PRIMAL = ("lagrangian", "hamiltonian", "kane")
COMPLEMENTARY = ("co_lagrangian", "co_hamiltonian", "co_kane")


def choose(network: Network, wanted: str, place: Place | None) -> tuple[str, tuple[Diagnostic, ...]]:
    """The formulation to use for `wanted` (auto or a name); diagnostics where it cannot be.

    auto takes Hamilton's form where the author gave kinetic energies T(p), else Lagrange's.
    """
    co = [c for c in network.coordinates if c.complementary]
    # both families in one model: no formulation has the unknowns of both
    if co and len(co) < len(network.coordinates):
        related = (Related(f"cocoordinate {co[0].name}", co[0].place),)
        message = "no formulation satisfies all statements: coordinates and cocoordinates in one model"
        return "lagrangian", (
            Diagnostic("E604", message, network.place, "one system is written in one family", related),
        )
    # cocoordinates alone: the complementary formulations
    if co:
        return _complementary(network, wanted, place)
    # coordinates, and a complementary formulation asked for: the network reflected, if it can be
    if wanted in COMPLEMENTARY:
        found = _of_efforts(network, wanted)
        network = as_transformers(network)
        found = found or _obstacle(network, wanted, place) or unreflectable(network)
        return wanted, ((found,) if found else ())
    if wanted == "auto":
        return ("hamiltonian" if any(e.function == "T" for e in network.energies) else "lagrangian"), ()
    return wanted, ()


def _of_efforts(network: Network, wanted: str) -> Diagnostic | None:
    """The first trace or expect of an effort by its class: displacement coordinates alone have these."""
    asked = [(o.expression, o.place) for o in network.observations] + [
        (side, x.place) for x in network.expectations for side in (x.left, x.right)
    ]
    for root, place in asked:
        classes = (n for n in variables(root) if n.op == "var" and ":" in n.data[1])
        for node in sorted(classes, key=lambda n: n.number):
            member = f"{node.data[0]}.{node.data[1].split(':')[1]}"
            message = f"{member} is not observable in {wanted}: it acts on a displacement coordinate"
            return Diagnostic("E905", message, place, "formulation lagrangian, hamiltonian")
    return None


def _complementary(network: Network, wanted: str, place: Place | None) -> tuple[str, tuple[Diagnostic, ...]]:
    name = next(c for c in network.coordinates if c.complementary)
    if wanted in PRIMAL:
        message = f"{wanted} of a model with the cocoordinate '{name.name}'"
        related = (Related("a momentum coordinate", name.place),)
        return wanted, (Diagnostic("E603", message, place or name.place, "co_lagrangian, co_hamiltonian", related),)
    if wanted == "auto":
        return "co_hamiltonian" if any(e.function == "V" for e in network.energies) else "co_lagrangian", ()
    return wanted, ()


def _unknowns(node: Node, kind: str) -> list[Node]:
    """Unknowns of a kind; those of nodes and branches count as those of coordinates."""
    kinds = (kind, f"n{kind}", f"b{kind}")
    return sorted((n for n in variables(node) if n.op == "var" and n.data[1] in kinds), key=lambda n: n.number)


def _obstacle(network: Network, wanted: str, place: Place | None) -> Diagnostic | None:
    """The first statement that keeps a model with `coord` out of the complementary family."""
    help_ = "formulation lagrangian, hamiltonian"
    # inertia that depends on displacements has no complementary form
    for energy in network.energies:
        rates = _unknowns(energy.expression, "f") + _unknowns(energy.expression, "p")
        displacements = _unknowns(energy.expression, "q")
        if energy.function in ("T*", "T") and rates and displacements:
            message = f"not expressible in {wanted}: {energy.function} depends on displacement {displacements[0]}"
            return Diagnostic("E601", f"{message} and on {rates[0]}", energy.place, help_)
    # a constraint of displacements ties momenta to nothing
    for constraint in network.constraints:
        displacements = _unknowns(constraint.expression, "q")
        if displacements:
            label = f"{constraint.kind} {constraint.name}"
            message = f"not expressible in {wanted}: {label} depends on displacement {displacements[0]}"
            return Diagnostic("E602", message, constraint.place, help_)
    # nodes and elements have both families
    if not network.coordinates:
        return None
    first = network.coordinates[0]
    message = f"{wanted} of a model with 'coord' ('{first.name}')"
    return Diagnostic("E603", message, place or first.place, "lagrangian, hamiltonian; elements of nodes have both")
