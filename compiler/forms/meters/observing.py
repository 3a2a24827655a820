"""What is asked of a solution: traced quantities, sides of expectations, and initial conditions.

An `init` of an unknown pins it; of unknowns that this formulation does not have (intangible displacements) it is
dropped; anything else is an equation on the initial state, a row of block `initial`, and what it reads an unknown.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from sysdyn.compiler.forms.assembly import Assembly
from sysdyn.compiler.forms.descriptor import EquationFamily, Pin, Unknowns
from sysdyn.compiler.forms.efforts import acting, effort
from sysdyn.compiler.forms.momenta import resolve
from sysdyn.compiler.model.energies import EnergyModel, InitialTarget
from sysdyn.compiler.model.terms import counter, local_variables, split, without_nested
from sysdyn.dsl.model.calculus import time_derivative
from sysdyn.dsl.model.expression import Node, add, call, const, sub, substitute, var, variables
from sysdyn.values import dataclass

TURNED = ("kinetic", "potential", "dissipated", "supplied")
"""Members of the audit whose magnitudes make up what went round."""


@dataclass(frozen=True, slots=True)
class InitialEquation:
    """An `init` that pins no unknown: the owner of its row family, target - value = 0."""

    owner: str
    target: InitialTarget


def observed_coordinates(model: EnergyModel, carriers: frozenset[str]) -> frozenset[str]:
    """Coordinates whose displacement a trace or an expect reads."""
    found = set()
    for quantity in model.quantities:
        expression = read(model, carriers, quantity.expression)
        found |= {n.data[0] for n in local_variables(expression, model.mirror.coordinate)}
    return frozenset(found)


def displacement_unknowns(model: EnergyModel, seen: frozenset[str]) -> frozenset[str]:
    """Coordinates whose displacement is an unknown: those seen, and those that an initial value ties to them or to what
    is no displacement.
    """
    found, tied = set(seen), []
    for read in map(_unknowns, model.initials):
        names = {n.data[0] for n in read if n.data[1] == model.mirror.coordinate}
        tied.append((names, any(n.data[1] != model.mirror.coordinate for n in read)))
    while tied := [(names, more) for names, more in tied if not names <= found]:
        reached = [names for names, more in tied if more or names & found]
        if not reached:
            break
        found.update(*reached)
    return frozenset(found)


def _unknowns(target: InitialTarget) -> list[Node]:
    return [n for n in variables(target.target) | variables(target.value) if n.op == "var"]


def read(model: EnergyModel, carriers: frozenset[str], root: Node) -> Node:
    """A quantity with efforts of classes and momenta that are no unknowns replaced by what they are."""
    classes = {n: effort(model, n) for n in acting(root)}
    return resolve(model, carriers, substitute(root, classes) if classes else root)


def add_observations(assembly: Assembly, model: EnergyModel, carriers: frozenset[str]) -> None:
    """observe, observe_rate where the derivative exists, observe_scale: the sum of the terms' magnitudes."""
    for quantity in model.quantities:
        expression = read(model, carriers, quantity.expression)
        try:
            slope: Node | None = time_derivative(expression)
        except ValueError:
            slope = None
        name, known = quantity.name, slope is not None
        unit, place = quantity.unit, quantity.place
        assembly.family(EquationFamily("observe", name, name, "observe", unit, place, known, quantity.stored))
        for term in split(expression, (), place, read=True):
            assembly.add("observe", name, (), term.loops, term.expression)
            assembly.add("observe_scale", name, (), term.loops, _scale(term.expression))
        for term in split(slope, (), place, read=True) if slope is not None else ():
            assembly.add("observe_rate", name, (), term.loops, term.expression)


def _scale(expression: Node) -> Node:
    """The magnitude of a term; that of the audit's balance, and of what is supplied, which it balances and which may
    cancel, is what went round; of norms of scaled rows one.
    """
    read = {
        n: add(*(call("abs", var(k, "audit")) for k in TURNED)) for n in _meters(expression, ("energy", "supplied"))
    }
    read |= {n: const(1.0) for n in _meters(expression, ("constraints", "drift"))}
    return call("abs", substitute(expression, read) if read else expression)


def _meters(expression: Node, names: tuple[str, ...]) -> list[Node]:
    return [n for n in variables(expression) if n.op == "var" and n.data[1] == "audit" and n.data[0] in names]


def pins_and_equations(
    model: EnergyModel, carriers: frozenset[str], families: Sequence[Unknowns]
) -> tuple[tuple[Pin, ...], tuple[InitialEquation, ...]]:
    """Initial values of unknowns, and the initial conditions that are equations."""
    numbers = {(f.owner, f.kind): k for k, f in enumerate(families)}
    pins: list[Pin] = []
    equations: list[InitialEquation] = []
    for target in model.initials:
        node = target.target
        plain = node.op == "var" and node.data[2] == 0 and not variables(target.value)
        own = plain and not target.store and (target.fixed or not _follows(node, target))
        if own and node.data[:2] in numbers:
            family = numbers[node.data[:2]]
            pins.append(Pin(family, node.args, target.value, target.fixed, target.nest, target.place))
            continue
        told = _unknowns(target)
        if told and all(n.data[1] == model.mirror.coordinate and n.data[:2] not in numbers for n in told):
            continue
        equations.append(InitialEquation(f"#init {len(equations)}", target))
    return tuple(pins), tuple(equations)


def _follows(node: Node, target: InitialTarget) -> bool:
    """Whether an unknown holds nothing of what a store does: its guess moves the state, as that of an expression."""
    return node.data[1] in ("kappa", "mu") or (target.apart and node.data[1] == "f")


def missing(equations: Sequence[InitialEquation]) -> Iterator[Unknowns]:
    """What guesses miss: of contents in their unit, of any other expression in one of its own."""
    for owner, target in ((e.owner, e.target) for e in equations if not e.target.fixed):
        kind = "slack" if target.said else "unsaid"
        yield Unknowns(owner, kind, owner, target.unit if target.store else owner, target.place)


def add_initials(
    assembly: Assembly, model: EnergyModel, carriers: frozenset[str], equations: Sequence[InitialEquation]
) -> None:
    """One row family an equation, its shape the ranges of its loops; a guess holds but for what it misses."""
    for equation in equations:
        target, owner, content = equation.target, equation.owner, bool(equation.target.store)
        label = target.store or "initial"
        assembly.family(EquationFamily("initial", label, owner, "initial", target.unit, target.place, content=content))
        at = tuple(counter(k) for k in range(len(target.nest)))
        missed = [var(own.owner, own.kind, *at) for own in missing([equation])]
        residual = resolve(model, carriers, sub(target.target, add(target.value, *missed)))
        for term in without_nested(split(residual, target.nest, target.place), "an initial condition"):
            assembly.add("initial", owner, at, term.loops, term.expression)
