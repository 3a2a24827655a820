"""Laws of branches as energies, works, constraints and implicit unknowns: the primal column of the language's table.

    kinetic p(f)      T* += int p df          kinetic f(p)      inverted, or the momentum is a state
    potential e(q)    V += int e dq           potential q(e)    inverted, or implicit effort; psi f without slope
    dissipator e(f)   D += int e df           dissipator f(e)   inverted, or implicit effort; psi f - f(0) without slope
    effort source     work -e on q            flow source       psi f - f_s, or implicit effort where it is controlled
    transformer       psi f1 - n f2           gyrator           works -r f2 on q1, r f1 on q2; with keep_implicit of
                                                                implicit efforts, closed by gammas

A law that has no antiderivative of ours does work -e on q.  Elements of pseudo domains do works only: efforts times
flows of a domain add up to zero over all its branches (Tellegen), so they leave no trace in the energy audit.
Everything is still said in the branches' own variables; `reading` replaces these.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import field, replace

from sysdyn.compiler.network.primal.bounds import Affine, FamilyBox, WholeNumbers, box_holds, parts, shape_of
from sysdyn.compiler.network.primal.choices import ENERGY, OWN, BranchLaw, Causality, conjugate, own
from sysdyn.compiler.network.primal.fields import field_quantities
from sysdyn.compiler.network.primal.incidence import BranchElement
from sysdyn.compiler.network.primal.reading import FUNCTIONS
from sysdyn.compiler.network.primal.slopes import Slopes
from sysdyn.dsl.model.calculus import derivative, time_derivative
from sysdyn.dsl.model.dimensions import ENERGY as ENERGY_DIMENSION
from sysdyn.dsl.model.expression import (
    Node,
    add,
    const,
    div,
    index,
    mul,
    neg,
    sub,
    substitute,
    var,
    variables,
)
from sysdyn.dsl.model.network import (
    Branch,
    Constraint,
    Coupling,
    Dynamic,
    EnergyTerm,
    InitialCondition,
    Network,
    Slope,
    State,
    Table,
    Unknown,
    VirtualWork,
)
from sysdyn.dsl.model.paynter import STATE_FUNCTIONS
from sysdyn.dsl.model.rewriting import EXPRESSIONS, expressions
from sysdyn.dsl.model.units import Unit, si
from sysdyn.dsl.text.diagnostics import Diagnostic, ModelError
from sysdyn.values import dataclass

JOULE = si(ENERGY_DIMENSION)


@dataclass(slots=True)
class Laws:
    """What all laws say, and by element number the efforts, momenta and (of those that are asked for them) state
    functions of branches, over the element's own loops.
    """

    energies: list[EnergyTerm] = field(default_factory=list)
    works: list[VirtualWork] = field(default_factory=list)
    constraints: list[Constraint] = field(default_factory=list)
    dynamics: list[Dynamic] = field(default_factory=list)
    unknowns: dict[str, Unknown] = field(default_factory=dict)
    states: dict[str, State] = field(default_factory=dict)
    efforts: dict[int, Node] = field(default_factory=dict)
    momenta: dict[int, Node] = field(default_factory=dict)
    notes: list[Diagnostic] = field(default_factory=list)
    initials: list[InitialCondition] = field(default_factory=list)
    functions: dict[int, dict[str, Node]] = field(default_factory=dict)
    slopes: tuple[Slope, ...] = ()
    constant: set[Branch] = field(default_factory=set)  # what they hold is the same whatever their effort
    implicit: set[Branch] = field(default_factory=set)  # their efforts are unknowns
    tables: dict[str, Table] = field(default_factory=dict)


def laws(network: Network, elements: Sequence[BranchElement], sizes: WholeNumbers, *, reflected: bool = False) -> Laws:
    """All laws; reflected: the network is the reflection of the author's, whose letters notes are to say."""
    wanted = _read_efforts(network)
    found = Laws()
    slopes = Slopes(network)
    letters = dict(zip("efqp", "fepq" if reflected else "efqp", strict=True))
    choices = [(e, Causality(e.branch, slopes, network.tables, e.name in wanted, letters)) for e in elements]
    chosen = [(e, choice.law()) for e, choice in choices]
    asked = read_functions(network)
    # state functions that somebody reads
    for (e, choice), (_, law) in zip(choices, chosen, strict=True):
        if e.name in asked:
            found.functions[e.number] = choice.functions(law)
    names: dict[tuple[int, str], FamilyBox] = {}
    # names of unknowns and rows that the laws make
    for suffix, hows in (("e", ("implicit", "state")), ("p", ("state",)), ("law", ("implicit", "state", "row"))):
        kept = [e for e, law in chosen if law.how in hows]
        for e, part in zip(kept, parts([(f"{e.name}.{suffix}", e.named) for e in kept]), strict=True):
            names[e.number, suffix] = part
    # what each law says: works, rows, unknowns
    for element, law in chosen:
        _Statement(element, law, names, found).say()
    integrate_powers([e for e, _ in chosen if e.name in asked], found, reflected=reflected)
    efforts, momenta = field_quantities(network, elements)
    found.efforts.update(efforts)
    found.momenta.update(momenta)
    keep = network.scene is not None and network.scene.keeps("keep_implicit")
    # two-ports
    for coupling, label in _ratios(network, elements, sizes):
        explicit = coupling.kind != "gyrator" or coupling.side == "e"
        divided = explicit or slopes.may_divide(coupling)
        _couple(coupling, label, elements, sizes, found, keep=keep, divided=divided)
    found.slopes = tuple(slopes.decided)
    return found


def read_functions(network: Network) -> set[str]:
    """Families of branches a state function of which is read."""
    roots = expressions(network, *EXPRESSIONS)
    return {n.data[0] for root in roots for n in variables(root) if n.op == "var" and n.data[1] in FUNCTIONS}


def integrate_powers(elements: Sequence[BranchElement], found: Laws, *, reflected: bool) -> None:
    """Energies of stores whose laws have no closed integral: the integral of the power, zero at the start (language,
    section 11, 32).  E102 for dissipators, whose content is no integral by time.
    """
    open_ = [e for e in elements if e.branch.kind in OWN and not found.functions[e.number]]
    for e, part in zip(open_, parts([(f"{e.name}.stored", e.named) for e in open_]), strict=True):
        b = e.branch
        if b.kind == "dissipator":
            text = f"the contents of '{e.name.partition('#')[0]}' are not known: its law has no closed integral"
            raise ModelError([Diagnostic("E102", text, b.place, "its power is known")])
        found.states.setdefault(part.name, State(part.name, shape_of(part.box), JOULE, b.place, measured=True))
        stored, v = var(part.name, "s", *b.at), own(b, OWN[b.kind][0])
        found.dynamics.append(Dynamic(stored, mul(own(b, "be"), own(b, "bf")), b.loops, b.place))
        found.initials.append(InitialCondition(stored, const(0.0), True, b.loops, b.place))
        own_variable = var(b.name, "bq" if b.kind == "potential" else "bp", *b.at)
        name = {"kinetic": "T", "potential": "V"}[b.kind]
        product = mul(own_variable, conjugate(b) if b.kind == "potential" else v)
        found.functions[e.number] = {name: stored, STATE_FUNCTIONS[name].transform: sub(product, stored)}


def _read_efforts(network: Network) -> set[str]:
    """Families whose effort a law or statement (not a trace) reads: a kinetic store's must then be no rate."""
    sorts = "branches.law", "branches.on", "couplings", "energies", "works.effort", "constraints", "dynamics"
    roots = expressions(network, *sorts)
    return {n.data[0] for root in roots for n in variables(root) if n.op == "var" and n.data[1] == "be"}


class _Statement:
    """One element's contributions."""

    def __init__(
        self, element: BranchElement, law: BranchLaw, names: dict[tuple[int, str], FamilyBox], found: Laws
    ) -> None:
        self.element, self.branch, self.law, self.names, self.found = element, element.branch, law, names, found
        self.place = replace(self.branch.place, element=self.branch.name)

    def say(self) -> None:
        """Add everything to the laws found."""
        b, law, found = self.branch, self.law, self.found
        found.notes += [Diagnostic(*note, b.place) for note in law.notes]
        found.tables.update((t.name, t) for t in law.tables)
        if law.how == "energy":
            assert law.stated is not None
            found.energies.append(EnergyTerm(ENERGY[b.kind], law.stated, b.loops, self.place))
            self._explicit()
        elif law.how == "work":
            assert law.stated is not None
            self._work(law.stated)
            found.efforts[self.element.number] = law.stated
        elif law.how == "row":
            found.constant.add(b)
            self._row("psi", law.stated, b.domain.flow)
            found.efforts[self.element.number] = var(self._name("law"), "mu", *b.at)
        elif law.how in ("implicit", "state"):
            self._implicit()

    def _name(self, suffix: str) -> str:
        return self.names[self.element.number, suffix].name

    def _explicit(self) -> None:
        """Effort and momentum of an element whose energy is stated: its derivative."""
        assert self.law.stated is not None
        kind = OWN[self.branch.kind][0]
        slope = derivative(self.law.stated, own(self.branch, kind))
        if self.branch.kind == "kinetic":
            self.found.momenta[self.element.number] = slope
            slope = time_derivative(slope)
        self.found.efforts[self.element.number] = slope

    def _work(self, effort: Node) -> None:
        b = self.branch
        stored = self.law.kept is not None or (b.stated and b.kind != "dissipator")
        if self.law.kept is not None:
            self.found.energies.append(EnergyTerm(f"kept {b.kind}", self.law.kept, b.loops, self.place))
        account = "stored" if stored else "dissipated" if b.kind == "dissipator" else "supplied"
        self.found.works.append(VirtualWork(neg(effort), own(b, "bq"), b.loops, self.place, account))

    def _row(self, kind: str, equation: Node | None, unit: Unit) -> None:
        b = self.branch
        assert equation is not None
        self.found.constraints.append(Constraint(kind, self._name("law"), b.at, equation, b.loops, unit, b.place))

    def _implicit(self) -> None:
        """An implicit effort closed by a gamma; with a momentum as state, p' = e."""
        b, number, found = self.branch, self.element.number, self.found
        found.implicit.add(b)
        part = self.names[number, "e"]
        found.unknowns.setdefault(part.name, Unknown(part.name, shape_of(part.box), b.domain.effort, b.place))
        effort = var(part.name, "e", *b.at)
        found.efforts[number] = effort
        self._work(effort)
        if self.law.how == "state":
            held = self.names[number, "p"]
            found.states.setdefault(held.name, State(held.name, shape_of(held.box), b.domain.momentum, b.place))
            momentum = var(held.name, "s", *b.at)
            found.momenta[number] = momentum
            found.dynamics.append(Dynamic(momentum, effort, b.loops, b.place))
        unit = {"potential": b.domain.displacement}.get(b.kind, b.domain.flow)
        if b.kind == "kinetic" and b.side == "p":
            unit = b.domain.momentum
        self._row("gamma", self.law.stated, unit)


def _ratios(
    network: Network, elements: Sequence[BranchElement], sizes: WholeNumbers
) -> Iterator[tuple[Coupling, FamilyBox]]:
    """Couplings with the label of their constraint."""
    live = [c for c in network.couplings if any(e.name == c.first for e in elements)]
    stems: dict[str, set[str]] = {}
    for c in live:
        stems.setdefault(c.stem, set()).add(c.first)
    families = [c.first if len(stems[c.stem]) > 1 else c.stem for c in live]
    boxes = []
    for c in live:
        ranges = {loop.index: sizes.interval(loop.first, loop.last, c.place) for loop in c.loops}
        boxes.append(tuple(sizes.affine(node, ranges, c.place).over(ranges) for node in c.at))
    labels = parts([(f"{name}.ratio", box) for name, box in zip(families, boxes, strict=True)])
    return zip(live, labels, strict=True)


def _couple(
    coupling: Coupling,
    part: FamilyBox,
    elements: Sequence[BranchElement],
    sizes: WholeNumbers,
    found: Laws,
    *,
    keep: bool,
    divided: bool,
) -> None:
    """Transformer f1 = n f2 or e1 = n e2; gyrator e1 = r f2 or f1 = g e2.  The companion law makes e1 f1 + e2 f2 zero.

    keep: the efforts of a gyrator are unknowns, and where g cannot be `divided` by.
    """
    label = part.name
    c = coupling
    first, second = (var(name, "bf", *c.at) for name in (c.first, c.second))
    domain = next(e.branch.domain for e in elements if e.name == c.first)
    # efforts by flows: works, or unknowns closed by gammas
    if c.kind == "gyrator":
        ratio = c.ratio if c.side == "e" else neg(div(const(1.0), c.ratio))
        efforts = mul(ratio, second), neg(mul(ratio, first))
        if keep or not divided:
            efforts = _gyrator_by_efforts(c, part, efforts, elements, found, divided=divided)
        for effort, name in zip(efforts, (c.first, c.second), strict=True):
            place = replace(c.place, element=c.stem)
            found.works.append(VirtualWork(neg(effort), var(name, "bq", *c.at), c.loops, place))
    else:
        multiplier = var(label, "mu", *c.at)
        # f1 = n f2: a flow constraint, its multiplier the effort of the first side
        if c.side == "f":
            equation = sub(first, mul(c.ratio, second))
            efforts = multiplier, neg(mul(c.ratio, multiplier))
        # e1 = n e2: the companion f2 = -n f1
        else:
            equation = add(second, mul(c.ratio, first))
            efforts = mul(c.ratio, multiplier), multiplier
            domain = next(e.branch.domain for e in elements if e.name == c.second)
        found.constraints.append(Constraint("psi", label, c.at, equation, c.loops, domain.flow, c.place))
    ranges = {loop.index: sizes.interval(loop.first, loop.last, c.place) for loop in c.loops}
    places = [sizes.affine(node, ranges, c.place) for node in c.at]
    held = tuple(a.over(ranges) for a in places)
    for name, effort in zip((c.first, c.second), efforts, strict=True):
        for e in elements:
            if e.name == name and box_holds(held, e.named):
                found.efforts[e.number] = _at_element(effort, places, e)


def _gyrator_by_efforts(
    coupling: Coupling,
    part: FamilyBox,
    efforts: tuple[Node, Node],
    elements: Sequence[BranchElement],
    found: Laws,
    *,
    divided: bool,
) -> tuple[Node, Node]:
    """Both efforts of a gyrator as unknowns, each closed by its gamma: one of flows where g is not divided by."""
    c, made = coupling, []
    flows = [var(name, "bf", *c.at) for name in (c.second, c.first)]
    domains = [next(e.branch.domain for e in elements if e.name == name) for name in (c.first, c.second)]
    for port, (effort, domain, other) in enumerate(zip(efforts, domains, reversed(domains), strict=True), start=1):
        unit = domain.effort
        unknown = f"{part.name.removesuffix('.ratio').replace('#1', '')}.e{port}"
        found.unknowns.setdefault(unknown, Unknown(unknown, shape_of(part.box), unit, c.place))
        own_effort = var(unknown, "e", *c.at)
        equation = sub(own_effort, effort)
        # f1 = g e2 as it is written
        if not divided:
            equation, unit = (add, sub)[port - 1](flows[port - 1], mul(c.ratio, own_effort)), other.flow
        found.constraints.append(Constraint("gamma", f"{unknown}.law", c.at, equation, c.loops, unit, c.place))
        made.append(own_effort)
    return made[0], made[1]


def _at_element(effort: Node, places: Sequence[Affine], element: BranchElement) -> Node:
    """An effort over the coupling's loops as one over the branch's."""
    pairs = zip(places, element.branch.at, strict=True)
    return substitute(effort, {index(a.loop): node for a, node in pairs if a.loop is not None})
