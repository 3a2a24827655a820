"""The checked network: what a model says, names bound, values in SI units, arrays kept as families.

Received by the compiler.  Every expression is a node of `expression`; every statement keeps its place in the text.
A *family* is a name with a shape: `coord x[1..n]` is one family, its shape the range 1..n.  A statement inside
`for i in ..` (or under a sum) is one value here with its loops; nothing is unrolled but arrays written as literals.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import field

from sysdyn.dsl.model.expression import Node, index, is_const
from sysdyn.dsl.model.paynter import REFLECTED
from sysdyn.dsl.model.units import Unit
from sysdyn.dsl.text.diagnostics import Place
from sysdyn.values import dataclass


@dataclass(frozen=True, slots=True)
class Loop:
    """`for index in first..last`: bounds are whole numbers made of parameters and outer loop variables."""

    index: str
    first: Node
    last: Node


Shape = tuple[tuple[Node, Node], ...]  # (first, last) of each index of a family; () is a scalar


def loop_indices(loops: Iterable[Loop]) -> tuple[Node, ...]:
    """The variables of loops as nodes."""
    return tuple(index(loop.index) for loop in loops)


def loop_ranges(loops: Iterable[Loop]) -> Shape:
    """The shape of what is written once for each turn of loops."""
    return tuple((loop.first, loop.last) for loop in loops)


@dataclass(frozen=True, slots=True)
class Domain:
    """A domain: the units of its four variables, and what its nodes have in common (effort or flow)."""

    name: str
    effort: Unit
    flow: Unit
    momentum: Unit
    displacement: Unit
    common: str
    pseudo: bool
    place: Place
    kinetic: bool = True  # whether kinetic stores exist: the domain has a momentum


@dataclass(frozen=True, slots=True)
class NodeFamily:
    """Nodes of a domain.  Quantities in expressions: var kinds ne (common effort), nq nf np (common flow)."""

    name: str
    shape: Shape
    domain: Domain
    place: Place


@dataclass(frozen=True, slots=True)
class Terminal:
    """One end of a branch: an element of a node family, or the domain's ground (node None)."""

    node: str | None
    at: tuple[Node, ...]


@dataclass(frozen=True, slots=True)
class Branch:
    """A branch plus -> minus, or along a displacement expression (`on`).

    Its effort, flow, displacement, momentum are var kinds be bf bq bp of its name at `at` (loop variables of `loops`,
    or constants).  kind: kinetic, potential, dissipator, effort, flow (sources), field (no law: it stands in energies
    and constraints), port (one side of a coupling).  law: side = law, side one of e f q p; law holds the branch's own
    conjugate variable, and others where it is modulated.  Its state functions are var kinds bT bT* bV bV* bD bG.
    """

    name: str
    at: tuple[Node, ...]
    loops: tuple[Loop, ...]
    domain: Domain
    kind: str
    side: str | None
    law: Node | None
    plus: Terminal | None
    minus: Terminal | None
    on: Node | None
    place: Place
    stated: bool = False  # its energy stands among the state functions, kept for the audit
    energy: Node | None = None  # the state function of its own variable, where the author wrote that instead of the law


@dataclass(frozen=True, slots=True)
class Coupling:
    """A two-port of two branches: transformer f1 = ratio*f2 (side f) or e1 = ratio*e2 (side e); gyrator f1 = ratio*e2
    (side f) or e1 = ratio*f2 (side e).

    The companion law follows from e1 f1 + e2 f2 = 0.
    """

    kind: str
    first: str
    second: str
    at: tuple[Node, ...]
    loops: tuple[Loop, ...]
    side: str
    ratio: Node
    place: Place

    @property
    def stem(self) -> str:
        """The two-port's own name."""
        return self.first.rpartition(".")[0] or self.first

    @property
    def read(self) -> str:
        """The side of the second branch that the law reads."""
        return self.side if self.kind == "transformer" else REFLECTED[self.side]


@dataclass(frozen=True, slots=True)
class Slope:
    """What a branch's inverted law rests on: an expression of parameters that is not zero and has the sign
    1 or -1, where one is given; where flat, it was zero with the values of the text.
    """

    name: str
    expression: Node
    loops: tuple[Loop, ...]
    flat: bool
    place: Place
    sign: int = 0


@dataclass(frozen=True, slots=True)
class Parameter:
    """A run-time constant; value holds one node, one per element of a literal array, or one over `loops`.

    A parameter that is an array by a formula (`param x[1..n] = i*l`) has one value over the loop variables `indices`.
    """

    name: str
    shape: Shape
    unit: Unit
    values: tuple[Node, ...]
    indices: tuple[str, ...]
    place: Place
    whole: bool = False  # used as a size or an index: its value must be a whole number


@dataclass(frozen=True, slots=True)
class ElementSetting:
    """`set m[2] = value`: one element of a parameter array."""

    name: str
    at: tuple[Node, ...]
    value: Node
    place: Place


@dataclass(frozen=True, slots=True)
class Table:
    """An interpolation table in SI units; points: breakpoints of each argument, values row-major."""

    name: str
    method: str  # linear pchip cubic hold
    outside: str  # clamp extend stop
    points: tuple[tuple[float, ...], ...]
    values: tuple[float, ...]
    place: Place


@dataclass(frozen=True, slots=True)
class Coordinate:
    """A displacement coordinate (a momentum coordinate where complementary) with its domain's units."""

    name: str
    shape: Shape
    complementary: bool
    displacement: Unit  # of q (of p where complementary)
    flow: Unit  # of q' (of p')
    momentum: Unit  # conjugate of the displacement
    effort: Unit
    asserted: bool | None  # tangible, intangible, or not said
    place: Place
    domain: Domain | None = None


@dataclass(frozen=True, slots=True)
class Unknown:
    """An implicit effort (or flow) closed by a gamma."""

    name: str
    shape: Shape
    unit: Unit
    place: Place


@dataclass(frozen=True, slots=True)
class State:
    """A dynamic variable s; measured: an integral that is kept because something reads it, no content of the system."""

    name: str
    shape: Shape
    unit: Unit
    place: Place
    measured: bool = False


@dataclass(frozen=True, slots=True)
class EnergyTerm:
    """One summand of a state function: function is T* T V V* (J) or D G (W).

    `kept kinetic`, `kept potential` (J): what stores hold whose laws stand beside the state functions; for the audit.
    """

    function: str
    expression: Node
    loops: tuple[Loop, ...]
    place: Place


@dataclass(frozen=True, slots=True)
class VirtualWork:
    """Virtual work: effort * delta(on), and the account that the audit enters it in: supplied, dissipated or stored.

    stored: it is that of a store whose energy the audit counts.
    """

    effort: Node
    on: Node
    loops: tuple[Loop, ...]
    place: Place
    account: str = "supplied"


@dataclass(frozen=True, slots=True)
class Constraint:
    """`kind name[at]: left = right` as left - right = 0; at: indices in the family of that label.

    adds: it adds to rows that another statement declares, to one of them as often as its loops come by.
    """

    kind: str  # phi psi gamma
    name: str
    at: tuple[Node, ...]
    expression: Node
    loops: tuple[Loop, ...]
    unit: Unit
    place: Place
    adds: bool = False


@dataclass(frozen=True, slots=True)
class Dynamic:
    """state' = expression."""

    state: Node  # var of kind s
    expression: Node
    loops: tuple[Loop, ...]
    place: Place


@dataclass(frozen=True, slots=True)
class InitialCondition:
    """target = value (fixed) or ~ value (a guess) at the start; target may be any expression of the unknowns.

    Where target is an unknown itself (var q, f, p, s, e) it pins that unknown; otherwise it is an equation.
    store: whose content a guess is about, by which it is measured; said: whether the text guesses it; unit: of target,
    but of a momentum that of its rate; apart: a guess of what no store holds, which pins no flow that a store has.
    depth: 0 of a scene, 1 of the model, 2 of its components, ...: what has less goes before what has more.
    """

    target: Node
    value: Node
    fixed: bool
    loops: tuple[Loop, ...]
    place: Place
    store: str = ""
    unit: str = "1"
    depth: int = 1
    said: bool = True
    apart: bool = False


@dataclass(frozen=True, slots=True)
class Observation:
    """A traced quantity in the unit asked for: value = (expression - offset)/scale of that unit, already applied."""

    name: str
    expression: Node
    unit: Unit
    text: str  # as the author wrote it, formatted
    place: Place
    stored: bool = True  # not so: what an event reads


@dataclass(frozen=True, slots=True)
class Action:
    """`target := value`: target is the param of a discrete variable, a state (kind s) or a flow (kind f).

    value: name of the observation that holds it.
    """

    target: Node
    value: str
    place: Place


@dataclass(frozen=True, slots=True)
class Event:
    """`when condition { .. }` or `every period { .. }`.

    condition: made of and, or, not, comparisons of params, and comparisons `observation > 0` (or >=, <, <=, ==), each
    over a var that names an observation, of kind `moves` where it does between events, else `rests`; None of `every`.
    """

    name: str
    condition: Node | None
    period: Node | None
    actions: tuple[Action, ...]
    place: Place


@dataclass(frozen=True, slots=True)
class Switch:
    """A constraint that holds at times: an inequality, one under a guard, or dry friction's sticking.

    kind: phi or psi (with a multiplier >= 0 where it holds, and value >= 0 elsewhere), guarded (while), friction (the
    multiplier bounded by `bound` on both sides where it holds; elsewhere the param `sense` is the sign of the value),
    relation (friction whose multiplier is what the rest of a relation leaves: the relation reads value = 0 where the
    param `holds` is 1, and has no row beside it; aim: c of its c*setsign(u), where a reaction tells it),
    planar (friction in the plane: value is the speed along the params `direction`, less half the speed, rate that
    of the former; aim: names of both flows, both multipliers and the speed),
    follows (holds where the one before it does).
    at: indices in the family of the label.  value, rate, acceleration, multiplier, bound, bound - multiplier
    (upper), bound + multiplier (lower), guard: names of observations.  moves: whether the bound changes between events.
    dual: what holds of the effort is free of the flow, of which the text says it.
    """

    name: str
    label: str
    at: tuple[int, ...]
    kind: str
    place: Place
    value: str
    rate: str
    multiplier: str
    element: str = ""  # the branch whose effort holds the multiplier while it sticks
    acceleration: str | None = None
    bound: str | None = None
    upper: str | None = None
    lower: str | None = None
    sense: Node | None = None
    guard: str | None = None
    restitution: Node | None = None
    aim: tuple[str, ...] = ()
    direction: tuple[Node, ...] = ()
    holds: Node | None = None
    moves: bool = False
    dual: bool = False


@dataclass(frozen=True, slots=True)
class Expectation:
    """`expect moment: left op right within d`; moment is always, finally, at (an instant) or static."""

    moment: str
    at: Node | None
    operator: str
    left: Node
    right: Node
    within: Node | None
    unit: Unit
    text: str
    place: Place


@dataclass(frozen=True, slots=True)
class Golden:
    """`expect golden "file" within r`."""

    file: str
    within: Node
    place: Place


@dataclass(frozen=True, slots=True)
class Scene:
    """What is asked of a model; None where the scene does not say."""

    name: str
    place: Place
    start: Node | None = None
    end: Node | None = None
    every: Node | None = None
    accuracy: Node | None = None
    accuracy_on: tuple[tuple[str, Node], ...] = ()
    to_range: tuple[str, ...] = ()  # of these the accuracy is relative to the largest less the least value
    formulation: str | None = None
    formulation_place: Place | None = None
    solver: str | None = None
    solver_options: tuple[tuple[str, Node], ...] = ()
    velocities: bool = False  # the index form 2 is that of velocity constraints alone, 2v
    redundancy: str | None = None
    limits: tuple[tuple[str, Node], ...] = ()

    def index(self, value: Callable[[Node], float]) -> str | None:
        """The index form that the solver is asked for, as the command line names it; None: it is not said."""
        node = dict(self.solver_options).get("index")
        return None if node is None else "2v" if self.velocities else f"{value(node):g}"

    def keeps(self, option: str) -> bool:
        """Whether the solver's option, keep_flow or keep_implicit, is said to be true."""
        return any(name == option and is_const(node, 1.0) for name, node in self.solver_options)


@dataclass(frozen=True, slots=True)
class LevelChoice:
    """A component with several levels of detail.  chosen: one of names; free: neither scene, command line nor the
    instance itself says which.
    """

    path: str
    chosen: str
    names: tuple[str, ...]
    free: bool


@dataclass(frozen=True, slots=True)
class Derived:
    """What a statement differentiates by time: it must not jump (E520)."""

    expression: Node
    loops: tuple[Loop, ...]
    place: Place


@dataclass(frozen=True, slots=True)
class Network:
    """A model under a scene, checked: names bound, dimensions agree, SI units everywhere."""

    model: str
    place: Place
    parameters: tuple[Parameter, ...]
    tables: tuple[Table, ...]
    coordinates: tuple[Coordinate, ...]
    unknowns: tuple[Unknown, ...]
    states: tuple[State, ...]
    energies: tuple[EnergyTerm, ...]
    works: tuple[VirtualWork, ...]
    constraints: tuple[Constraint, ...]
    dynamics: tuple[Dynamic, ...]
    initials: tuple[InitialCondition, ...]
    observations: tuple[Observation, ...]
    expectations: tuple[Expectation, ...]
    statics: tuple[Expectation, ...]  # on static quantities, parameters `static dof` etc.
    goldens: tuple[Golden, ...]
    scene: Scene | None
    elements: tuple[ElementSetting, ...] = ()
    nodes: tuple[NodeFamily, ...] = ()
    branches: tuple[Branch, ...] = ()
    couplings: tuple[Coupling, ...] = ()
    derived: tuple[Derived, ...] = ()
    slopes: tuple[Slope, ...] = ()  # of laws that the compiler has inverted
    quasis: tuple[str, ...] = ()  # families of quasi-velocities
    speeds: tuple[Observation, ...] = ()  # the scalar ones of the model itself
    discretes: frozenset[str] = frozenset()  # parameters that events assign
    events: tuple[Event, ...] = ()
    switches: tuple[Switch, ...] = ()
    levels: tuple[LevelChoice, ...] = ()
    authors: Mapping[str, tuple[tuple[str, Place], ...]] = field(default_factory=dict)  # elements of gathered families
    read: frozenset[str] = frozenset()  # common-effort nodes whose effort a law or statement reads (not a trace)
    positions: tuple[State, ...] = ()  # of points, at the start alone
    literal: bool = False  # numbers of sizes are part of it: reductions written out, elements that indices mean

    @property
    def traced(self) -> tuple[str, ...]:
        """Names of the observations that a trace stores; the others are what conditions of events read."""
        return tuple(o.name for o in self.observations if o.stored)
