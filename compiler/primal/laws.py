"""Laws of branches as energies, works, constraints and implicit unknowns: the primal column of the language's table.

    kinetic p(f)      T* += int p df          kinetic f(p)      inverted, or the momentum is a state
    potential e(q)    V += int e dq           potential q(e)    inverted, or implicit effort; psi f without slope
    dissipator e(f)   D += int e df           dissipator f(e)   inverted, or implicit effort; psi f - f(0) without slope
    effort source     work -e on q            flow source       psi f - f_s, or implicit effort where it is controlled
    transformer       psi f1 - n f2           gyrator           works -r f2 on q1, r f1 on q2

A law that has no antiderivative of ours does work -e on q.  Elements of pseudo domains do works only: efforts times
flows of a domain add up to zero over all its branches (Tellegen), so they leave no trace in the energy audit.
Everything is still said in the branches' own variables; `reading` replaces these.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from sysdyn.compiler.primal.bounds import Affine, Part, Sizes, box_holds, parts, shape_of
from sysdyn.compiler.primal.incidence import Element
from sysdyn.compiler.primal.integrals import Rests, antiderivative, line, polynomial
from sysdyn.compiler.primal.inverses import Inverse, inverse
from sysdyn.compiler.primal.slopes import Slopes
from sysdyn.dsl.diagnostics import Diagnostic, ModelError
from sysdyn.dsl.expression import (
    Node,
    add,
    const,
    derivative,
    index,
    mul,
    neg,
    param,
    sub,
    substitute,
    time_derivative,
    to_text,
    var,
    variables,
)
from sysdyn.dsl.network import (
    Branch,
    Constraint,
    Coupling,
    Dynamic,
    Energy,
    Network,
    Slope,
    State,
    Table,
    Unknown,
    Work,
)
from sysdyn.dsl.units import Unit

ENERGY = {"kinetic": "T*", "potential": "V", "dissipator": "D"}
Notes = tuple[tuple[str, str], ...]
OWN = {"kinetic": ("bf", "p"), "potential": ("bq", "e"), "dissipator": ("bf", "e")}


@dataclass(frozen=True, slots=True)
class Law:
    """How a branch enters.

    how: energy (stated), work, implicit (stated = 0 closes its effort), state (stated = 0 closes its momentum), row
    (psi stated = 0), port, field.  stated: the energy, the effort, or the equation.  tables: those made for it.
    """

    how: str
    stated: Node | None = None
    notes: tuple[tuple[str, str], ...] = ()
    tables: tuple[Table, ...] = ()


@dataclass(slots=True)
class Laws:
    """What all laws say, and the efforts and momenta of branches by element number (over the element's own loops)."""

    energies: list[Energy] = field(default_factory=list)
    works: list[Work] = field(default_factory=list)
    constraints: list[Constraint] = field(default_factory=list)
    dynamics: list[Dynamic] = field(default_factory=list)
    unknowns: dict[str, Unknown] = field(default_factory=dict)
    states: dict[str, State] = field(default_factory=dict)
    efforts: dict[int, Node] = field(default_factory=dict)
    momenta: dict[int, Node] = field(default_factory=dict)
    notes: list[Diagnostic] = field(default_factory=list)
    slopes: tuple[Slope, ...] = ()
    tables: dict[str, Table] = field(default_factory=dict)


def own(branch: Branch, kind: str) -> Node:
    """The branch's own variable at its own indices."""
    return var(branch.name, kind, *branch.at)


def laws(network: Network, elements: Sequence[Element], sizes: Sizes, *, reflected: bool = False) -> Laws:
    """All laws; reflected: the network is the reflection of the author's, whose letters notes are to say."""
    wanted = _read_efforts(network)
    found = Laws()
    slopes = Slopes(network)
    letters = dict(zip("efqp", "fepq" if reflected else "efqp", strict=True))
    chosen = [(e, _Choice(e.branch, slopes, network.tables, e.name in wanted, letters).law()) for e in elements]
    found.slopes = tuple(slopes.decided)
    names: dict[tuple[int, str], Part] = {}
    for suffix, hows in (("e", ("implicit", "state")), ("p", ("state",)), ("law", ("implicit", "state", "row"))):
        kept = [e for e, law in chosen if law.how in hows]
        for e, part in zip(kept, parts([(f"{e.name}.{suffix}", e.named) for e in kept]), strict=True):
            names[e.number, suffix] = part
    for element, law in chosen:
        _Statement(element, law, names, found).say()
    for coupling, label in _ratios(network, elements, sizes):
        _couple(coupling, label, elements, sizes, found)
    return found


def _read_efforts(network: Network) -> set[str]:
    """Families whose effort a law or statement (not a trace) reads: a kinetic store's must then be no rate."""
    roots = [root for b in network.branches for root in (b.law, b.on) if root is not None]
    roots += [c.ratio for c in network.couplings] + [e.expression for e in network.energies]
    roots += [w.effort for w in network.works] + [c.expression for c in network.constraints]
    roots += [d.expression for d in network.dynamics]
    return {n.data[0] for root in roots for n in variables(root) if n.op == "var" and n.data[1] == "be"}


class _Choice:
    """How one branch enters."""

    def __init__(
        self, branch: Branch, slopes: Slopes, tables: Sequence[Table], effort_read: bool, letters: Mapping[str, str]
    ) -> None:
        self.branch, self.slopes, self.tables, self.effort_read = branch, slopes, tables, effort_read
        self.letters = letters
        self.kinetic = branch.kind == "kinetic"

    def law(self) -> Law:
        """The branch's law."""
        branch = self.branch
        if branch.kind in ("field", "port"):
            return Law(branch.kind)
        if branch.law is None or branch.side is None:
            raise ModelError([Diagnostic("E409", f"branch {branch.name} has no law", branch.place)])
        if branch.kind == "effort":
            return Law("work", branch.law)
        if branch.kind == "flow":
            outer = [n for n in variables(branch.law) if n.op == "var" and n.data[1] != "s"]
            return Law("implicit" if outer else "row", sub(own(branch, "bf"), branch.law))
        if branch.side == OWN[branch.kind][1]:
            return self._explicit(branch.law)
        return self._turned(branch.law)

    def _explicit(self, law: Node, notes: Notes = (), tables: tuple[Table, ...] = ()) -> Law:
        """A law of the branch's own variable."""
        branch, kinetic = self.branch, self.kinetic
        v, pseudo = own(branch, OWN[branch.kind][0]), branch.domain.pseudo
        stated = sub(_own_of(branch), law)
        if kinetic and (pseudo or self.effort_read or variables(law) - {v}):
            return Law("state", stated, notes, tables)
        energy = None if pseudo or variables(law) - {v} else self._energy(law, v)
        if energy is not None:
            return Law("energy", energy, notes, tables)
        if kinetic:
            text = f"the {self._conjugate} of {branch.name} is kept as a state: its law has no closed integral"
            return Law("state", stated, (*notes, ("N604", text)), tables)
        if branch.kind == "potential" and not pseudo:
            notes = (*notes, ("N604", f"the energy of {branch.name} is counted as the integral of its power"))
        return Law("work", law, notes, tables)

    def _energy(self, law: Node, v: Node) -> Node | None:
        """The integral of a law; of dissipators that of polynomials only: works say theirs as well."""
        if self.branch.kind == "dissipator" and polynomial(law, v) is None:
            return None
        rests: Rests = []
        energy = antiderivative(law, v, rests)
        return energy if energy is not None and self._rest_on(rests) else None

    def _rest_on(self, rests: Sequence[tuple[Node, int]]) -> bool:
        """Keep what a result rests on; False where that is not so."""
        values = [(node, sign, self.slopes.values(self.branch, node)) for node, sign in rests]
        if any(x is None or not ((sign * x if sign else np.abs(x)) > 0.0).all() for _, sign, x in values):
            return False
        for node, sign in rests:
            self.slopes.rest_on(self.branch, node, sign)
        return True

    def _turned(self, law: Node) -> Law:
        """A law of the conjugate variable: inverted, or implicit."""
        branch, kinetic = self.branch, self.kinetic
        v, given = own(branch, OWN[branch.kind][0]), _own_of(branch)
        alone = not variables(law) - {given}
        straight = line(law, given) if alone else None
        if self.slopes.flat(branch, straight.slope) if straight else not kinetic and not variables(law):
            return self._held(law if straight is None else straight.constant)
        if straight is not None:
            note = ("N601", f"the law of {branch.name} was inverted: it is linear")
            return self._explicit(straight.inverse(v), (note,))
        found = inverse(branch, law, given, v, self.slopes, self.tables) if alone else None
        if found is not None:
            tried = self._explicit(found.expression, (self._said(found, v),), found.tables)
            if tried.how != "state" and self._rest_on(found.rests):  # an unknown less, or the law as it is
                return tried
        text = f"{self._side(branch.side)}({self._side(given.data[1][1])}) of {branch.name} stays implicit"
        return Law("state" if kinetic else "implicit", sub(v, law), (("N604", text),))

    def _said(self, found: Inverse, v: Node) -> tuple[str, str]:
        """The note of an inverse."""
        name = self.branch.name.partition("#")[0]
        if not found.symbolic:
            return "N603", f"the law of {name} was inverted: the columns of its table change places"
        text = to_text(substitute(found.expression, {v: param(self._side(v.data[1][1]))}))
        return "N602", f"the law of {name} was inverted: {self._side(_own_of(self.branch).data[1][1])} = {text}"

    def _side(self, letter: str | None) -> str:
        return self.letters[letter or ""]

    @property
    def _conjugate(self) -> str:
        return {"p": "momentum", "q": "displacement"}[self._side("p")]

    def _held(self, value: Node) -> Law:
        """A law without slope: v = value, a constant content has no flow."""
        branch = self.branch
        text = f"{self._side(branch.side)} of {branch.name} is held: its law has no slope"
        rate = const(0.0) if branch.kind == "potential" else value
        return Law("row", sub(own(branch, "bf"), rate), (("N604", text),))


def _own_of(branch: Branch) -> Node:
    """The conjugate of the own variable: p of a kinetic store, else e."""
    return own(branch, "bp" if branch.kind == "kinetic" else "be")


class _Statement:
    """One element's contributions."""

    def __init__(self, element: Element, law: Law, names: dict[tuple[int, str], Part], found: Laws) -> None:
        self.element, self.branch, self.law, self.names, self.found = element, element.branch, law, names, found

    def say(self) -> None:
        """Add everything to the laws found."""
        b, law, found = self.branch, self.law, self.found
        found.notes += [Diagnostic(*note, b.place) for note in law.notes]
        found.tables.update((t.name, t) for t in law.tables)
        if law.how == "energy":
            assert law.stated is not None
            found.energies.append(Energy(ENERGY[b.kind], law.stated, b.loops, b.place))
            self._explicit()
        elif law.how == "work":
            assert law.stated is not None
            self._work(law.stated)
            found.efforts[self.element.number] = law.stated
        elif law.how == "row":
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
        self.found.works.append(Work(neg(effort), own(b, "bq"), b.loops, b.place))

    def _row(self, kind: str, equation: Node | None, unit: Unit) -> None:
        b = self.branch
        assert equation is not None
        self.found.constraints.append(Constraint(kind, self._name("law"), b.at, equation, b.loops, unit, b.place))

    def _implicit(self) -> None:
        """An implicit effort closed by a gamma; with a momentum as state, p' = e."""
        b, number, found = self.branch, self.element.number, self.found
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


def _ratios(network: Network, elements: Sequence[Element], sizes: Sizes) -> Iterator[tuple[Coupling, str]]:
    """Couplings with the label of their constraint."""
    live = [c for c in network.couplings if any(e.name == c.first for e in elements)]
    stems: dict[str, set[str]] = {}
    for c in live:
        stems.setdefault(_stem(c.first), set()).add(c.first)
    families = [c.first if len(stems[_stem(c.first)]) > 1 else _stem(c.first) for c in live]
    boxes = []
    for c in live:
        ranges = {loop.index: sizes.interval(loop.first, loop.last, c.place) for loop in c.loops}
        boxes.append(tuple(sizes.affine(node, ranges, c.place).over(ranges) for node in c.at))
    labels = parts([(f"{name}.ratio", box) for name, box in zip(families, boxes, strict=True)])
    return ((c, label.name) for c, label in zip(live, labels, strict=True))


def _stem(name: str) -> str:
    return name.rpartition(".")[0] or name


def _couple(coupling: Coupling, label: str, elements: Sequence[Element], sizes: Sizes, found: Laws) -> None:
    """Transformer f1 = n f2 or e1 = n e2; gyrator e1 = r f2.  The companion law makes e1 f1 + e2 f2 zero."""
    c = coupling
    first, second = (var(name, "bf", *c.at) for name in (c.first, c.second))
    domain = next(e.branch.domain for e in elements if e.name == c.first)
    if c.kind == "gyrator":
        efforts = mul(c.ratio, second), neg(mul(c.ratio, first))
        for effort, name in zip(efforts, (c.first, c.second), strict=True):
            found.works.append(Work(neg(effort), var(name, "bq", *c.at), c.loops, c.place))
    else:
        multiplier = var(label, "mu", *c.at)
        if c.side == "f":
            equation = sub(first, mul(c.ratio, second))
            efforts = multiplier, neg(mul(c.ratio, multiplier))
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


def _at_element(effort: Node, places: Sequence[Affine], element: Element) -> Node:
    """An effort over the coupling's loops as one over the branch's."""
    pairs = zip(places, element.branch.at, strict=True)
    return substitute(effort, {index(a.loop): sub(node, a.offset.node) for a, node in pairs if a.loop is not None})
