"""Network -> EnergyModel: state functions, virtual work and constraints as terms over loops.

    T*(f, q, t)  T(p, q, t)  V(q, t)  D(f, q, t)      state functions, sums of terms
    deltaW = E delta u(q, t)                          virtual work
    Phi(q, t) = 0   Psi(f, q, t) = 0   Gamma(e, s, f, q, t) = 0   s' = Lambda(e, s, f, q, t)

A coordinate is tangible where its displacement occurs undifferentiated (language, section 5); a psi row with constant
coefficients that touches a tangible coordinate is integrated (`integration`).  Received: a checked Network.
Returned: an EnergyModel and notes.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import field, replace

from sysdyn.compiler.model.mirror import PRIMAL, Mirror, function_name, with_family_letters
from sysdyn.compiler.model.terms import Nest, Term, canonical, counter, local_variables, split, without_nested
from sysdyn.dsl.model.calculus import derivative
from sysdyn.dsl.model.dimensions import TIME
from sysdyn.dsl.model.expression import Node, substitute, topological, var, variables
from sysdyn.dsl.model.network import Loop, Network, Shape
from sysdyn.dsl.model.units import multiply, si_text
from sysdyn.dsl.text.diagnostics import Place
from sysdyn.values import dataclass


@dataclass(frozen=True, slots=True)
class Virtual:
    """Virtual work: the product effort * delta(on), one term each, and its account in the audit (network.Work)."""

    effort: Node
    on: Node
    loops: Nest
    place: Place
    account: str = "supplied"


@dataclass(frozen=True, slots=True)
class Row:
    """Rows `name[at]` for all iterations of `nest`: the sum of the terms is zero (the rate of a state).

    adds: the terms add to rows that another statement declares.
    """

    kind: str  # phi psi gamma lambda
    name: str
    at: tuple[Node, ...]
    terms: tuple[Term, ...]
    nest: Nest
    place: Place
    adds: bool = False


@dataclass(frozen=True, slots=True)
class UnknownFamily:
    """A coordinate, an implicit unknown or a state with its shape and units by kind of unknown.

    balance: of a coordinate, the unit of effort times displacement (J but in pseudo domains).
    less: of a coordinate that is counted from another, that one, as its name is shown with.
    measured: a state that is an integral which something reads.
    """

    name: str
    shape: Shape
    units: Mapping[str, str]
    place: Place
    tangible: bool = False
    less: str = ""
    measured: bool = False

    @property
    def shown(self) -> str:
        """What its unknowns are, e.g. pipe.m - v[1]."""
        return f"{self.name} - {self.less}" if self.less else self.name


@dataclass(frozen=True, slots=True)
class Offset:
    """The constants of an integrated constraint: parameter `name`[at] = sum of terms at the initial displacements."""

    name: str
    label: str
    at: tuple[Node, ...]
    terms: tuple[Term, ...]
    nest: Nest


@dataclass(frozen=True, slots=True)
class InitialTarget:
    """`init`: target = value (fixed) or ~ value, for all iterations; the others: as in `InitialCondition`."""

    target: Node
    value: Node
    fixed: bool
    nest: Nest
    place: Place
    store: str = ""
    unit: str = "1"
    said: bool = True
    apart: bool = False


@dataclass(frozen=True, slots=True)
class TracedQuantity:
    """A traced quantity (stored) or one side of an expect."""

    name: str
    expression: Node
    stored: bool
    unit: str
    place: Place


@dataclass(frozen=True, slots=True)
class EnergyModel:
    """Everything a formulation is lowered from; expressions are canonical (see `terms`)."""

    coordinates: tuple[UnknownFamily, ...]
    unknowns: tuple[UnknownFamily, ...] = ()
    states: tuple[UnknownFamily, ...] = ()
    positions: tuple[UnknownFamily, ...] = ()  # unknowns of the start alone
    functions: Mapping[str, tuple[Term, ...]] = field(default_factory=dict)
    works: tuple[Virtual, ...] = ()
    rows: tuple[Row, ...] = ()
    offsets: tuple[Offset, ...] = ()
    initials: tuple[InitialTarget, ...] = ()
    quantities: tuple[TracedQuantity, ...] = ()
    labels: Mapping[str, str] = field(default_factory=dict)  # unit of each constraint label
    mirror: Mirror = PRIMAL
    quasis: tuple[str, ...] = ()
    speeds: tuple[TracedQuantity, ...] = ()
    switched: frozenset[str] = frozenset()  # labels of constraints that hold at times
    discretes: frozenset[str] = frozenset()  # parameters that events assign
    assigned: frozenset[str] = frozenset()  # states that events assign
    solved: Mapping[str, tuple[Node, Node]] = field(default_factory=dict)  # 0 = dT/dp - f where T* stays; its rate

    def function(self, name: str) -> tuple[Term, ...]:
        """The terms of a state function."""
        return self.functions.get(name, ())

    def of_kind(self, kind: str) -> tuple[Row, ...]:
        """The rows of one kind."""
        return tuple(row for row in self.rows if row.kind == kind)

    def expressions(self) -> Iterator[Node]:
        """What every statement says."""
        yield from (t.expression for terms in self.functions.values() for t in terms)
        yield from (t.expression for row in self.rows for t in row.terms)
        yield from (n for w in self.works for n in (w.effort, w.on))
        yield from (n for i in self.initials for n in (i.target, i.value))
        yield from (q.expression for q in self.quantities)

    def rewritten(self, new: Callable[[Node], Node]) -> EnergyModel:
        """The model with what every statement says changed."""

        def terms(old: tuple[Term, ...]) -> tuple[Term, ...]:
            return tuple(replace(t, expression=new(t.expression)) for t in old)

        return replace(
            self,
            functions={name: terms(pieces) for name, pieces in self.functions.items()},
            works=tuple(replace(w, effort=new(w.effort), on=new(w.on)) for w in self.works),
            rows=tuple(replace(row, terms=terms(row.terms)) for row in self.rows),
            initials=tuple(replace(i, target=new(i.target), value=new(i.value)) for i in self.initials),
            quantities=tuple(replace(q, expression=new(q.expression)) for q in self.quantities),
        )


def energies(network: Network) -> EnergyModel:
    """The energy model of a network; tangibility decided, psi rows not yet integrated."""
    model = EnergyModel(
        coordinates=tuple(
            UnknownFamily(
                c.name,
                c.shape,
                {
                    "q": c.displacement.text,
                    "f": c.flow.text,
                    "p": c.momentum.text,
                    "e": c.effort.text,
                    "balance": si_text(multiply(c.effort.dimension, multiply(c.flow.dimension, TIME))),
                },
                c.place,
            )
            for c in network.coordinates
        ),
        unknowns=tuple(UnknownFamily(u.name, u.shape, {"e": u.unit.text}, u.place) for u in network.unknowns),
        states=tuple(
            UnknownFamily(s.name, s.shape, {"s": s.unit.text}, s.place, measured=s.measured) for s in network.states
        ),
        positions=tuple(UnknownFamily(s.name, s.shape, {"start": s.unit.text}, s.place) for s in network.positions),
        functions=_functions(network),
        works=tuple(_works(network)),
        rows=(*_constraints(network), *_dynamics(network)),
        initials=tuple(_initials(network)),
        quantities=tuple(_quantities(network)),
        labels={c.name: c.unit.text for c in network.constraints},
        quasis=network.quasis,
        speeds=tuple(TracedQuantity(o.name, flows(o.expression), False, o.unit.text, o.place) for o in network.speeds),
        switched=frozenset(s.label for s in network.switches if s.holds is None),
        discretes=frozenset(network.discretes),
        assigned=frozenset(_assigned_states(network)),
    )
    # displacements that a statement reads are tangible: they stay unknowns
    touched = tangible(model)
    coordinates = tuple(replace(c, tangible=c.name in touched) for c in model.coordinates)
    return replace(model, coordinates=coordinates)


def flows(root: Node) -> Node:
    """The expression with q' written as the flow f."""
    change: dict[Node, Node] = {}
    for node in local_variables(root, "q", 1):
        change[node] = var(node.data[0], "f", *node.args)
    return substitute(root, change) if change else root


def _terms(root: Node, loops: Iterable[Loop], place: Place) -> tuple[Term, ...]:
    nest, (expression,) = canonical(tuple(loops), flows(root))
    return split(expression, nest, place)


def _functions(network: Network) -> dict[str, tuple[Term, ...]]:
    found: dict[str, list[Term]] = {}
    for energy in network.energies:
        pieces = _terms(energy.expression, energy.loops, energy.place)
        pieces = without_nested(pieces, f"a state function {energy.function}")
        found.setdefault(energy.function, []).extend(pieces)
    return {name: tuple(pieces) for name, pieces in found.items()}


def _works(network: Network) -> Iterator[Virtual]:
    """One summand of the effort times one summand of the displacement each, under both nests."""
    for work in network.works:
        nest, (effort, on) = canonical(work.loops, flows(work.effort), flows(work.on))
        for outer in without_nested(split(effort, nest, work.place), "an effort"):
            for inner in without_nested(split(on, nest, work.place), "the displacement of a work"):
                own = inner.loops[len(nest) :]
                added, moved = _renumber_loops(own, len(nest), len(outer.loops))
                moving, loops = substitute(inner.expression, moved), (*outer.loops, *added)
                yield Virtual(outer.expression, moving, loops, work.place, work.account)


def _renumber_loops(own: Nest, start: int, depth: int) -> tuple[Nest, dict[Node, Node]]:
    """Loops numbered from `start` numbered from `depth` instead."""
    change = {counter(start + k): counter(depth + k) for k in range(len(own))}
    nest = tuple(
        Loop(f"#{depth + k}", substitute(loop.first, change), substitute(loop.last, change))
        for k, loop in enumerate(own)
    )
    return nest, change


def _constraints(network: Network) -> Iterator[Row]:
    for c in network.constraints:
        nest, (expression, *at) = canonical(c.loops, flows(c.expression), *c.at)
        pieces = without_nested(split(expression, nest, c.place), f"{c.kind} '{c.name}'")
        yield Row(c.kind, c.name, tuple(at), pieces, nest, c.place, c.adds)


def _dynamics(network: Network) -> Iterator[Row]:
    for d in network.dynamics:
        nest, (expression, state) = canonical(d.loops, flows(d.expression), d.state)
        pieces = without_nested(split(expression, nest, d.place), f"the dynamic of '{state.data[0]}'")
        yield Row("lambda", state.data[0], state.args, pieces, nest, d.place)


def _assigned_states(network: Network) -> Iterator[str]:
    """States that events assign."""
    for event in network.events:
        for action in event.actions:
            yield from (n.data[0] for n in variables(action.target) if n.op == "var" and n.data[1] == "s")


def _initials(network: Network) -> Iterator[InitialTarget]:
    for i in network.initials:
        nest, (target, value) = canonical(i.loops, flows(i.target), flows(i.value))
        yield InitialTarget(target, value, i.fixed, nest, i.place, i.store, i.unit, i.said, i.apart)


def _quantities(network: Network) -> Iterator[TracedQuantity]:
    """Traced quantities, each name once, then the sides of each expectation."""
    first = {o.name: o for o in reversed(network.observations)}
    for o in (o for o in network.observations if first[o.name] is o):
        _, (expression,) = canonical((), flows(o.expression))
        yield TracedQuantity(o.name, expression, o.stored, o.unit.text, o.place)
    for k, e in enumerate(network.expectations):
        for side, node in (("left", e.left), ("right", e.right), ("within", e.within)):
            if node is not None:
                _, (expression,) = canonical((), flows(node))
                yield TracedQuantity(f"expect {k} {side}", expression, False, e.unit.text, e.place)


def reading(model: EnergyModel) -> Iterator[tuple[Node, Nest, Place]]:
    """Every expression whose undifferentiated displacements make a coordinate tangible, under its loops."""
    m = model.mirror
    for function in (m.potential, m.coenergy, m.energy, m.content):
        for term in model.function(function):
            yield term.expression, term.loops, term.place
    for row in model.rows:
        for term in row.terms:
            yield term.expression, term.loops, term.place
    for work in model.works:
        yield work.effort, work.loops, work.place
        for node in local_variables(work.on, m.coordinate):
            yield derivative(work.on, node), work.loops, work.place


def tangible(model: EnergyModel) -> dict[str, Place]:
    """Coordinates whose displacement occurs undifferentiated, with the first place where it does."""
    found: dict[str, Place] = {}
    for expression, _, place in reading(model):
        for node in local_variables(expression, model.mirror.coordinate):
            found.setdefault(node.data[0], place)
    return found


def show(model: EnergyModel, formulation: str = "lagrangian") -> str:
    """The energy model as text in the letters of the formulation's family, for --dump energies.

    What golden traces compare is in the letters of the reflection, which no release has changed.
    """

    def text(root: Node) -> str:
        return repr(with_family_letters(formulation, root))

    kind = "cocoordinate" if formulation.startswith("co_") else "coordinate"
    lines = [f"{kind} {c.name}{_extent(c.shape)}{' tangible' if c.tangible else ''}" for c in model.coordinates]
    lines += [f"implicit {u.name}{_extent(u.shape)}" for u in model.unknowns]
    lines += [f"state {s.name}{_extent(s.shape)}" for s in model.states]
    for name in model.functions:
        shown = function_name(formulation, name)
        lines += [f"{shown} += {over(t.loops)}{text(t.expression)}" for t in model.function(name)]
    lines += [f"work {over(w.loops)}({text(w.effort)}) on {text(w.on)}" for w in model.works]
    for row in model.rows:
        at = f"[{', '.join(map(repr, row.at))}]" if row.at else ""
        body = " + ".join(f"{over(t.loops[len(row.nest) :])}({text(t.expression)})" for t in row.terms) or "0"
        lines.append(f"{row.kind} {row.name}{at}: {over(row.nest)}{body}")
    return "\n".join(lines) + "\n"


def _extent(shape: Shape) -> str:
    return f"[{', '.join(f'{a!r}..{b!r}' for a, b in shape)}]" if shape else ""


def over(nest: Nest) -> str:
    """The loops as text."""
    return "".join(f"for {loop.index} in {loop.first!r}..{loop.last!r}: " for loop in nest)


def verify_energies(model: EnergyModel) -> None:
    """AssertionError where a term uses a loop variable that no loop of it binds."""
    pieces = [t for name in model.functions for t in model.function(name)]
    pieces += [t for row in model.rows for t in row.terms]
    pieces += [Term(w.effort, w.loops, w.place) for w in model.works]
    pieces += [Term(w.on, w.loops, w.place) for w in model.works]
    for term in pieces:
        bound = {loop.index for loop in term.loops}
        for node in topological([term.expression]):
            assert node.op != "index" or node.data in bound or node.data.startswith("#r"), (node, term.loops)
