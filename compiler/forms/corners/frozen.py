"""Rows with the branch of every switching function frozen between events.

The branch is a parameter (a number that events set), so a row is smooth while a piece lasts:

    LIVE    as the text says               ABOVE, BELOW    the branch of u > 0, of u < 0
    SLIDES  u = 0 is held, and the value lies between its two branches: (1 + s)/2 of the one, (1 - s)/2 of the other
    RESTS   as the text says at u = 0, whatever round-off is left of u: sign(u) is 0, u > 0 does not hold

The sense s is an implicit unknown of its own, closed by the row  s - branch = 0, or u = 0 while it slides: the
sliding of Filippov 1988 (Utkin's equivalent control, the same where rows are affine in s).  Only surfaces at which a
row jumps have one; a form without kinks is handed on as it is.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

from sysdyn.compiler.forms.corners.broken import broken
from sysdyn.compiler.forms.corners.kinks import YES, Surface, roots, surfaces, watched_branches
from sysdyn.compiler.forms.corners.peaks import peaks
from sysdyn.compiler.forms.corners.written import written
from sysdyn.compiler.forms.descriptor import (
    BESIDE,
    BLOCKS,
    Block,
    DescriptorForm,
    EquationFamily,
    Frozen,
    LoopKernel,
    Summand,
    Unknowns,
)
from sysdyn.compiler.forms.steepness import magnitude
from sysdyn.compiler.model.mirror import with_family_letters
from sysdyn.dsl.model.calculus import derivative, time_derivative
from sysdyn.dsl.model.expression import (
    Node,
    add,
    both,
    compare,
    conditional,
    const,
    either,
    is_const,
    linear,
    mul,
    neg,
    param,
    rebuild,
    sub,
    topological,
    var,
    variables,
)
from sysdyn.dsl.model.network import Network, Parameter, Table
from sysdyn.dsl.model.units import NONE, si
from sysdyn.dsl.text.diagnostics import Diagnostic, Place

LIVE, ABOVE, BELOW, SLIDES, RESTS = 0.0, 1.0, -1.0, 2.0, 3.0
READ = ("observe", "observe_rate", "observe_scale", "initial")


def frozen(
    form: DescriptorForm, network: Network
) -> tuple[DescriptorForm, tuple[Parameter, ...], tuple[Diagnostic, ...]]:
    """The form of a network with frozen branches, and the parameters that hold them; notes."""
    tables, place = {t.name: t for t in network.tables}, network.place
    whole, floors = form, _floors(form, network) if tables else frozenset[Node]()
    form = replace(form, blocks=tuple(_expand_tables(b, tables, floors) for b in form.blocks)) if tables else form
    form = written(form, network)
    found = surfaces(form, frozenset(n.data for s in network.switches for n in s.direction), floors)
    passed, notes = peaks(form, whole, network, found)
    found += passed
    if not found:
        return form, (), notes
    freezer = _Freezer(form, found)
    parameters = (Parameter(k.branch, (), si(NONE), (const(LIVE),), (), form.rows[s.row].place or place)
                  for k, s in zip(freezer.kinks, found, strict=True))  # fmt: skip
    return freezer.form(place), tuple(parameters), notes


def _floors(form: DescriptorForm, network: Network) -> frozenset[Node]:
    """What inequalities between displacements keep from being negative, and the text's own conditions do not read."""
    gaps = {s.value for s in network.switches if s.kind == "phi" and s.guard is None}
    block = form.block("observe") if gaps else None
    rows = [s for kernel in (block.kernels if block else ()) if not kernel.nest for s in kernel.rows]
    found = {s.expression for s in rows if form.rows[s.row].label in gaps}
    own = (
        {on.u for root, _ in roots(form) for n in topological([root]) if (on := watched_branches(n)) is not None}
        if found
        else ()
    )
    return frozenset(found - {w for u in own for w in (u, neg(u))})


def _expand_tables(block: Block, tables: Mapping[str, Table], floors: frozenset[Node]) -> Block:
    """A block with its tables of straight pieces written out."""
    kernels = (
        replace(k, rows=tuple(replace(s, expression=broken(s.expression, tables, floors)) for s in k.rows))
        for k in block.kernels
    )
    return replace(block, kernels=tuple(kernels))


class _Freezer:
    """One form under way."""

    def __init__(self, form: DescriptorForm, found: tuple[Surface, ...]) -> None:
        self.before, self.surfaces = form, found
        self.number = {s.u: k for k, s in enumerate(found)}
        self.branch = [param(f"#branch {k}") for k in range(len(found))]
        self.sense: list[Node | None] = [var(f"#sense {k}", "e") if s.jumps else None for k, s in enumerate(found)]
        self.done: dict[Node, Node] = {}
        self._settle_senses()
        self.kinks = tuple(self._kink(k, s) for k, s in enumerate(found))

    def _settle_senses(self) -> None:
        """No sense where u has no rate, or where a row is not affine in it: sliding could not be solved for."""
        for k in range(len(self.surfaces)):
            if self._rate(k) is None:
                self.sense[k] = None
        for name in ("dynamics", "gamma", "lambda", "momentum", "phi", "psi", "phi_reaction", "psi_reaction"):
            block = self.before.block(name)
            for kernel in block.kernels if block else ():
                for summand in kernel.rows:
                    self._affine(summand.expression)

    def _affine(self, root: Node) -> None:
        for k, sense in enumerate(self.sense):
            if sense is None or not any(self._surface_number(n) == k for n in topological([root])):
                continue
            self.done = {}
            if not is_const(derivative(derivative(self.freeze(root, held=True), sense), sense), 0.0):
                self.sense[k] = None
        self.done = {}

    def _surface_number(self, node: Node) -> int:
        """The number of the surface of an operation; -1 of any other."""
        found = watched_branches(node)
        if found is None:
            return -1
        return self.number.get(found.u, self.number.get(neg(found.u), -1))

    def _kink(self, k: int, s: Surface) -> Frozen:
        row = self.before.rows[s.row]
        text = repr(with_family_letters(self.before.formulation, s.u))
        rate = f"#rate {k}" if self._rate(k) is not None else None
        slide = (f"#above {k}", f"#below {k}") if self.sense[k] is not None else ()
        inner = any(n.op == "var" and n.data[1] in ("q", "f", "p") for n in variables(s.u))
        return Frozen(f"#branch {k}", text, row.label, row.place, f"#value {k}", rate, slide, s.jumps, inner, s.passage)

    def _rate(self, k: int) -> Node | None:
        try:
            return time_derivative(self.surfaces[k].u)
        except ValueError:
            return None

    # -- expressions -----------------------------------------------------------------------------------------

    def freeze(self, root: Node, *, held: bool = False) -> Node:
        """An expression with its branches frozen; held: as it is while everything slides."""
        done = self.done
        for node in topological([root]):
            if node not in done:
                done[node] = self._frozen(node, held)
        return done[root]

    def _rebuild_branch(self, branch: Node) -> Node:
        """A branch of a frozen operation, rebuilt of frozen parts."""
        for node in topological([branch]):
            if node not in self.done:
                self.done[node] = rebuild(node, tuple(self.done[a] for a in node.args))
        return self.done[branch]

    def _frozen(self, node: Node, held: bool) -> Node:
        """A node whose branch is chosen by the surface's number, as it is where no surface watches it; held: by senses
        alone.
        """
        args = tuple(self.done[a] for a in node.args)
        live = rebuild(node, args)
        # a condition has no surface of its own: those it reads have
        if node.op == "cond":
            return self._conditional(node, live, held)
        k = self._surface_number(node)
        found = watched_branches(node)
        if k < 0 or found is None:
            return live
        mine = found.u in self.number
        # true on one side, and at rest on it where it says so
        if node.op == "cmp":
            level = ABOVE if (found.above is YES) == mine else BELOW
            as_said = both(compare("==", self.branch[k], const(LIVE)), live)
            levels = (level, RESTS) if self.surfaces[k].jumps and node.data in (">=", "<=") else (level,)
            return either(as_said, *(compare("==", self.branch[k], const(b)) for b in levels))
        # abs, sign, max, ...: both branches, frozen in turn
        above, below = (
            self._rebuild_branch(n) for n in ((found.above, found.below) if mine else (found.below, found.above))
        )
        at_rest = const(0.0) if node.data == "sign" else self._rebuild_branch(found.above)
        return self._branches(k, (above, at_rest, below), live, held)

    def _branches(self, k: int, sides: tuple[Node, Node, Node], live: Node, held: bool) -> Node:
        """The branch that a surface stands on: above, below, at rest, live, or between where it slides."""
        (above, at_rest, below), branch, sense = sides, self.branch[k], self.sense[k]
        lower = below
        # it may slide: a convex combination of both sides
        if sense is not None:
            part = linear(0.5, ((0.5, sense),))
            between = add(mul(part, above), mul(sub(const(1.0), part), below))
            if held:
                return between
            lower = conditional(compare("==", branch, const(BELOW)), below, between)
        if self.surfaces[k].jumps:
            lower = conditional(compare("==", branch, const(RESTS)), at_rest, lower)
        either_ = conditional(compare("==", branch, const(ABOVE)), above, lower)
        return conditional(compare("==", branch, const(LIVE)), live, either_)

    def _conditional(self, node: Node, live: Node, held: bool) -> Node:
        """A conditional: between its branches while a relation in its condition slides."""
        test, then, other = node.args
        slides = [
            k
            for k in dict.fromkeys(map(self._surface_number, topological([test])))
            if k >= 0 and self.sense[k] is not None
        ]
        if not slides:
            return live
        weight = self._weight(test, held)
        between = add(mul(weight, self.done[then]), mul(sub(const(1.0), weight), self.done[other]))
        if held:
            return between
        now = either(*(compare("==", self.branch[k], const(SLIDES)) for k in slides))
        return conditional(now, between, live)

    def _weight(self, test: Node, held: bool) -> Node:
        """How much of a condition is true: 1 or 0, (1 + s)/2 of a relation that slides."""
        one = const(1.0)
        # s in -1..1 makes a weight in 0..1: `and` is a product, `or` its complement's, `not` the complement
        if test.op == "and":
            return mul(*(self._weight(a, held) for a in test.args))
        if test.op == "or":
            return sub(one, mul(*(sub(one, self._weight(a, held)) for a in test.args)))
        if test.op == "not":
            return sub(one, self._weight(test.args[0], held))
        k = self._surface_number(test)
        sense = self.sense[k] if k >= 0 else None
        plain = conditional(self.done[test], one, const(0.0))
        found = watched_branches(test)
        # a relation that cannot slide: 1 or 0
        if sense is None or found is None:
            return plain
        # a relation that can: (1 + s)/2, the other way round where it is true below
        up = (found.above is YES) == (found.u in self.number)
        part = linear(0.5, ((0.5 if up else -0.5, sense),))
        return part if held else conditional(compare("==", self.branch[k], const(SLIDES)), part, plain)

    # -- the form --------------------------------------------------------------------------------------------

    def form(self, place: Place) -> DescriptorForm:
        """Everything frozen, with the rows that events watch and the senses."""
        rows, added, senses = list(self.before.rows), dict[str, list[Summand]](), list[Unknowns]()
        shapes = list(self.before.shapes)

        def add_to(block: str, row: int, expression: Node) -> None:
            added.setdefault(block, []).append(Summand(row, (), expression))

        def observe(name: str, expression: Node) -> None:
            rows.append(EquationFamily("observe", name, name, "observe", "1", place, rate=False))
            add_to("observe", len(rows) - 1, expression)
            add_to("observe_scale", len(rows) - 1, magnitude(expression))

        # each surface is watched, by its rate too where it has one
        for k, (surface, kink) in enumerate(zip(self.surfaces, self.kinks, strict=True)):
            self.done = {}
            u = self.freeze(surface.u)
            observe(kink.value, u)
            rate = self._rate(k)
            if kink.rate is not None and rate is not None:
                observe(kink.rate, self.freeze(rate))
            sense = self.sense[k]
            # it cannot slide
            if sense is None or rate is None:
                continue
            owner = f"#sense {k}"
            senses.append(Unknowns(f"sense of {kink.text}", "e", owner, "1", kink.place))
            shapes.append((owner, ()))
            rows.append(EquationFamily("gamma", f"sense of {kink.text}", owner, "gamma", "1", kink.place))
            # a gamma for the sense: the surface itself while it slides, else the side
            slides = compare("==", self.branch[k], const(SLIDES))
            # a length is no number: its own scale makes it one (Newton judges a row by its terms)
            add_to("gamma", len(rows) - 1, conditional(slides, u, sub(sense, self.branch[k])))
            moves = var(owner, "e", order=1)
            add_to("gamma_rate", len(rows) - 1, conditional(slides, self.freeze(rate), moves))
            for name, sign in zip(kink.slide, (-1.0, 1.0), strict=True):
                observe(name, linear(1.0, ((sign, sense),)))
        self.done = {}
        families = self.before.families
        last = next((k for k, f in enumerate(families) if f.kind in BESIDE), len(families))
        blocks = tuple(self._block(b, added.pop(b.name, [])) for b in self.before.blocks)
        made = (*blocks, *(Block(name, (LoopKernel((), tuple(new)),)) for name, new in added.items()))
        # blocks in the order of the contract, senses before what is observed
        order = {name: number for number, name in enumerate(BLOCKS)}
        ordered = sorted(made, key=lambda b: order.get(b.name, len(order)))
        with_senses = (*families[:last], *senses, *families[last:])
        pins = (replace(p, family=p.family + len(senses)) if p.family >= last else p for p in self.before.pins)
        form = replace(self.before, families=with_senses, rows=tuple(rows), shapes=tuple(shapes), kinks=self.kinks)
        return replace(form, blocks=tuple(ordered), pins=tuple(pins))

    def _block(self, block: Block, new: list[Summand]) -> Block:
        kernels = []
        for kernel in block.kernels:
            rows = tuple(replace(s, expression=self.freeze(s.expression)) for s in kernel.rows)
            if not kernel.nest and new:
                rows, new = (*rows, *new), []
            kernels.append(LoopKernel(kernel.nest, rows))
        return Block(block.name, (*kernels, *((LoopKernel((), tuple(new)),) if new else ())))
