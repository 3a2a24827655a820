"""The rows of a descriptor form as the book lays them out.

    Lagrange (3.34)   q' = f;  M f' + Phi_q^T kappa + Psi_f^T mu = Y;  0 = Phi;  0 = Psi;  0 = Gamma;  s' = Lambda
    Hamilton (4.14)   q' = f;  p' = U - Phi_q^T kappa - Psi_f^T mu;  0 = U - ... where there is no store;  p = dT*/df

Received: a descriptor form.  Returned: an `Equation` for each row family and range in which it holds.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from sysdyn.compiler.equations.algebra import Algebra
from sysdyn.compiler.equations.joining import collect_terms, shorter
from sysdyn.compiler.equations.order import FactorOrder
from sysdyn.compiler.equations.pieces import EquationPiece, pieces
from sysdyn.compiler.forms.conjugates import negate_conjugates
from sysdyn.compiler.forms.descriptor import BESIDE, DescriptorForm, EquationFamily
from sysdyn.compiler.forms.efforts import PREFIX, effort
from sysdyn.compiler.forms.lowering import whole
from sysdyn.compiler.forms.momenta import momentum, resolve
from sysdyn.compiler.model.energies import EnergyModel, UnknownFamily
from sysdyn.compiler.model.terms import Nest
from sysdyn.dsl.model.calculus import derivative
from sysdyn.dsl.model.expression import Node, add, mul, neg, param, sub, var, variables
from sysdyn.dsl.text.diagnostics import Place
from sysdyn.values import dataclass

FUNCTIONS = ("T*", "T", "V", "V*", "D", "G")
REFLECTED = {"T*": "V*", "T": "V", "V": "T", "V*": "T*", "D": "G", "G": "D", "W": "W", "H": "H"}
"""Names of state functions in the reflected family."""
WORDS = {
    "dynamics": "balance of",
    "momentum": "momentum of",
    "phi": "displacement constraint",
    "psi": "flow constraint",
    "gamma": "effort constraint",
    "lambda": "dynamic of",
}
CO_WORDS = {"momentum": "displacement of", "phi": "momentum constraint", "psi": "effort constraint"}
"""What rows are called, and in the complementary family."""
CLASSES = ("inertial", "potential", "dissipative", "source", "implicit", "constraint")
"""Of efforts."""
BLOCKS = ("dynamics", "momentum", "phi", "psi", "gamma", "lambda")


@dataclass(frozen=True, slots=True)
class Summed:
    """A term, summed over loops."""

    over: Nest
    expression: Node

    @property
    def negated(self) -> Summed:
        """Minus the term."""
        return Summed(self.over, neg(self.expression))


@dataclass(frozen=True, slots=True)
class Equation:
    """left = right for the indices of `where` and at those `fixed`; kind: kinematic, or the block of its row; more: the
    right side is added to that of the equation before, for these indices.
    """

    kind: str
    owner: str
    place: Place | None
    left: tuple[Summed, ...]
    right: tuple[Summed, ...]
    where: Nest = ()
    fixed: tuple[tuple[int, Node], ...] = ()
    more: bool = False


@dataclass(frozen=True, slots=True)
class EffortTerms:
    """Terms of an applied effort times the variation of a displacement, summed over loops."""

    over: Nest
    terms: tuple[Node, ...]
    on: Node


@dataclass(frozen=True, slots=True)
class Function:
    """A state function as a sum of terms (T*, T, V, V*, D, G), or virtual work (W) as a sum of efforts."""

    name: str
    terms: tuple[Summed, ...]
    efforts: tuple[EffortTerms, ...] = ()


def algebra_of(form: DescriptorForm, parameters: Sequence[str]) -> Algebra:
    """Symbols for a form: its unknowns as it lists them, parameters as they were declared."""
    scalars = {owner for owner, shape in form.shapes if not shape} | {o for o, places in form.hulls if not places[0][0]}
    known = [var(f.owner, f.kind) for f in form.families if f.owner in scalars and f.kind not in BESIDE]
    return Algebra(FactorOrder(parameters), [*known, *map(param, parameters)])


def equations(algebra: Algebra, model: EnergyModel, form: DescriptorForm, most: int) -> Iterator[Equation]:
    """Every equation: q' = f, then the rows in their order, of so many families at most."""
    yield from kinematics(model, form)
    rows = [(number, row) for number, row in enumerate(form.rows) if row.block in BLOCKS]
    for number, row in rows[:most]:
        solved = row.block == "momentum" and row.owner in model.solved
        yield from _of_row(algebra, row, [_momentum(model, row.owner)] if solved else pieces(form, number))


def _momentum(model: EnergyModel, owner: str) -> EquationPiece:
    """P - dT*/df of a coordinate whose row is solved for its flow in the residual."""
    own = var(owner, model.mirror.conjugate)
    return EquationPiece((), (), (), sub(own, momentum(model, own)))


def kinematics(model: EnergyModel, form: DescriptorForm) -> Iterator[Equation]:
    """Q' = f of each displacement that is an unknown."""
    coordinates: dict[str, UnknownFamily] = {c.name: c for c in model.coordinates}
    for family in form.families:
        if family.kind == "q":
            nest, at = whole(coordinates[family.owner])
            rate = Summed((), var(family.owner, "q", *at, order=1))
            flow = Summed((), var(family.owner, "f", *at))
            yield Equation("kinematic", family.owner, family.place, (rate,), (flow,), nest)


def _of_row(algebra: Algebra, row: EquationFamily, found: Sequence[EquationPiece]) -> Iterator[Equation]:
    """One equation where the pieces hold alike, else 0 = their sum, range by range."""
    groups: dict[tuple[Nest, tuple[tuple[int, Node], ...]], list[EquationPiece]] = {}
    for piece in found:
        groups.setdefault((piece.where, piece.fixed), []).append(piece)
    wide = sorted(groups or {((), ()): []}, key=lambda key: (len(key[1]), -len(key[0])))
    for number, (where, fixed) in enumerate(wide):
        terms = sum_terms(algebra, [(p.over, p.expression) for p in groups.get((where, fixed), [])])
        left, right = sides(row.block, terms) if len(groups) <= 1 else ((), terms)
        if row.kind == "kinematic":  # f = S u + s of Kane's form
            flow = var(row.owner, "f")
            own = [t for t in terms if t.expression is flow or t.expression is neg(flow)]
            right = tuple(t if own[0].expression is not flow else t.negated for t in terms if t is not own[0])
            left = (Summed((), flow),)
        kind = "kinematic" if row.kind == "kinematic" else row.block
        yield Equation(kind, row.owner, row.place, left, right, where, fixed, number > 0)


def sum_terms(algebra: Algebra, parts: Sequence[tuple[Nest, Node]], *, whole: bool = False) -> tuple[Summed, ...]:
    """Terms under one nest joined; whole: squares of differences stay where that is shorter."""
    nests: dict[Nest, list[Node]] = {}
    for over, expression in parts:
        nests.setdefault(over, []).append(expression)
    join = shorter if whole else collect_terms
    return tuple(Summed(over, term) for over, some in nests.items() for term in join(algebra, add(*some)))


def sides(block: str, terms: Sequence[Summed]) -> tuple[tuple[Summed, ...], tuple[Summed, ...]]:
    """The sides of a row "sum of terms = 0"."""
    leading = [_class(term.expression) for term in terms]
    # constraints have everything on the right: 0 = ...
    if block in ("phi", "psi", "gamma"):
        return (), tuple(terms)
    # p on the left, or f where it stands alone: f = p/m
    if block == "momentum":
        bare = ("var" in (t.expression.op, t.negated.expression.op) for t in terms)
        alone = any(k == "f" and own for k, own in zip(leading, bare, strict=True))
        kept = ["f"] if alone and "p" in leading else ["p"] if "p" in leading else ["f"]
    # the balance of an element: p' = efforts, s' = power
    elif "p'" in leading or "s'" in leading:
        kept = ["p'", "s'"]
    else:
        kept = ["f'", "multiplier"]
    pairs = list(zip(terms, leading, strict=True))
    left = tuple(t for t, kind in pairs if kind in kept)
    # multipliers last
    rest = sorted((pair for pair in pairs if pair[1] not in kept), key=lambda pair: pair[1] == "multiplier")
    right = tuple(t.negated for t, _ in rest)
    # -p' = e reads p' = -e
    if left and _negative(left[0].expression):
        return tuple(t.negated for t in left), tuple(t.negated for t in right)
    return left, right


def _negative(term: Node) -> bool:
    return term.op == "sum" and not term.data[0] and len(term.args) == 1 and term.data[1][0] < 0.0


def _class(term: Node) -> str:
    """What leads a term: a rate, a multiplier, or a momentum that stands alone."""
    found = {n.data[1] + "'" * n.data[2] for n in variables(term) if n.op == "var"}
    for kind in ("p'", "s'", "f'"):
        if kind in found:
            return kind
    if found & {"kappa", "mu"}:
        return "multiplier"
    return next(iter(found)) if len(found) == 1 and found <= {"p", "f"} else ""


def classes(algebra: Algebra, model: EnergyModel, form: DescriptorForm) -> Iterator[Equation]:
    """The efforts of every coordinate by class (2.10), of complementary forms the flows; they add up to zero."""
    complementary = form.formulation.startswith("co_")
    carriers = frozenset(f.owner for f in form.families if f.kind == model.mirror.conjugate)
    for family in model.coordinates:
        nest, at = whole(family)
        for name in CLASSES:
            acting = resolve(model, carriers, effort(model, var(family.name, f"{PREFIX}{name}", *at)))
            found = collect_terms(algebra, negate_conjugates(acting) if complementary else acting)
            if found:
                left = param(f"{'f' if complementary else 'e'}_{name}_{family.name}", *at)
                right = tuple(Summed((), term) for term in found)
                yield Equation("class", family.name, family.place, (Summed((), left),), right, nest)


def functions(algebra: Algebra, model: EnergyModel) -> Iterator[Function]:
    """State functions in the letters of the reflection, and virtual work as sum of Q_j delta q_j."""
    for name in FUNCTIONS:
        if model.function(name):
            parts = [(t.loops, t.expression) for t in model.function(name)]
            yield Function(name, sum_terms(algebra, parts, whole=True))
    works: dict[tuple[Nest, Node], list[Node]] = {}
    # efforts along each coordinate that the work moves
    for work in model.works:
        for node in sorted(variables(work.on), key=lambda n: n.number):
            if node.op == "var":
                effort = mul(work.effort, derivative(work.on, node))
                works.setdefault((work.loops, node), []).append(effort)
    efforts = {key: collect_terms(algebra, add(*found)) for key, found in works.items()}
    if any(efforts.values()):
        yield Function("W", (), tuple(EffortTerms(loops, terms, on) for (loops, on), terms in efforts.items() if terms))
