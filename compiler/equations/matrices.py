"""The matrices of the descriptor form by name, and what is solved from them.

    Lagrange   M = d2T*/df2,  Phi_q,  Psi_f,  Y,  Z1 = Phi_qq-terms of phi'' (at f' = 0),  Z2 the same of psi'
    Hamilton   U in the place of Y;  p = M f

    underlying (3.64), (4.30)   the rows that are linear in rates and multipliers, solved for these
    canonical (4.20)            f of the momentum rows;  H = p.f - T* + V;  q' = dH/dp,  p' = -dH/dq + ...

Received: a form without families over ranges, of at most LARGEST rates and multipliers where it is solved.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

from sysdyn.compiler.equations.algebra import Algebra
from sysdyn.compiler.equations.book import EffortTerms, Equation, Function, Summed, sides, sum_terms
from sysdyn.compiler.equations.joining import collect_terms, length, shortest, sort_factors, turned_factors
from sysdyn.compiler.forms.descriptor import DescriptorForm
from sysdyn.compiler.forms.momenta import momentum
from sysdyn.compiler.model.energies import EnergyModel
from sysdyn.dsl.model.calculus import derivative
from sysdyn.dsl.model.expression import Node, add, const, neg, product, sub, substitute, var, variables
from sysdyn.dsl.text.diagnostics import Place
from sysdyn.values import dataclass

LARGEST = 12
"""Rates and multipliers that are solved for in symbols."""
FACTORED = 300
"""Operations of a term that is factored."""
LONGEST = 2000
"""Operations of an entry of the solution: twice those of the longest of the book's systems (parallelogram, 1117)."""
MOVING = 3
"""Coordinates whose momenta are, where their inertia moves with displacements."""


class NoSuchEquations(Exception):  # noqa: N818
    """The form does not exist for the model; the message says why."""


@dataclass(frozen=True, slots=True)
class PlainRow:
    """A row without its place in families: the sum that is zero."""

    block: str
    owner: str
    place: Place | None
    expression: Node


@dataclass(frozen=True, slots=True)
class Matrix:
    """Entries [rows][columns] as terms; columns: the unknowns they are of, () of a column."""

    name: str
    rows: tuple[tuple[tuple[Node, ...], ...], ...]


def rows_of(form: DescriptorForm, *blocks: str) -> list[PlainRow]:
    """The rows of some blocks, each block's reactions included.  NoSuchEquations for families over ranges."""
    with_reactions = {"dynamics": ("dynamics", "phi_reaction", "psi_reaction")}
    found: dict[tuple[str, int], list[Node]] = {}
    for name in blocks:
        # constraint forces stand in blocks of their own
        for part in with_reactions.get(name, (name,)):
            block = form.block(part)
            for kernel in block.kernels if block is not None else ():
                if kernel.nest:
                    raise NoSuchEquations("families over ranges are not written out: --form descriptor keeps them")
                for s in kernel.rows:
                    if s.at:
                        raise NoSuchEquations("families over ranges are not written out: --form descriptor keeps them")
                    found.setdefault((name, s.row), []).append(s.expression)
    return [
        PlainRow(name, form.rows[k].owner, form.rows[k].place, add(*parts))
        for (name, k), parts in sorted(found.items(), key=lambda item: (blocks.index(item[0][0]), item[0][1]))
    ]


def unknowns(form: DescriptorForm, kind: str, order: int = 0) -> list[Node]:
    """The unknowns of a kind, or their rates."""
    return [var(f.owner, f.kind, order=order) for f in form.families if f.kind == kind]


def matrices(algebra: Algebra, form: DescriptorForm) -> tuple[Matrix, ...]:
    """M, Phi_q, Psi_f, Y (U of Hamilton's), Z1, Z2, those that are not empty."""
    dynamics = rows_of(form, "dynamics")
    carried = {f.owner for f in form.families if f.kind == "p"}
    coordinates = [row.owner for row in dynamics]
    flows = [var(owner, "f") for owner in coordinates]
    places = [var(owner, "q") for owner in coordinates]
    moving = [n for row in dynamics for n in variables(row.expression) if _driving(n)]
    still = dict.fromkeys(moving, const(0.0))
    rates = [var(owner, "f", order=1) for owner in coordinates]
    found = [] if carried else [Matrix("M", _jacobian(algebra, dynamics, rates))]
    found.append(Matrix("Φ_q", _jacobian(algebra, rows_of(form, "phi"), places)))
    found.append(Matrix("Ψ_f", _jacobian(algebra, rows_of(form, "psi"), flows)))
    rest = [neg(substitute(row.expression, still)) for row in dynamics]
    found.append(Matrix("U" if carried else "Y", tuple((collect_terms(algebra, node),) for node in rest)))
    for name, block in (("Z1", "phi_acceleration"), ("Z2", "psi_rate")):
        rows = rows_of(form, block)
        none = {n: const(0.0) for row in rows for n in variables(row.expression) if _is(n, "f", 1)}
        found.append(Matrix(name, tuple((collect_terms(algebra, substitute(row.expression, none)),) for row in rows)))
    return tuple(m for m in found if m.rows)


def _driving(node: Node) -> bool:
    """A rate or a multiplier."""
    return node.op == "var" and (node.data[2] > 0 or node.data[1] in ("kappa", "mu"))


def _is(node: Node, kind: str, order: int) -> bool:
    return node.op == "var" and node.data[1:] == (kind, order)


def _jacobian(
    algebra: Algebra, rows: Sequence[PlainRow], by: Sequence[Node]
) -> tuple[tuple[tuple[Node, ...], ...], ...]:
    return tuple(tuple(_entry(algebra, derivative(row.expression, v)) for v in by) for row in rows)


def _entry(algebra: Algebra, node: Node) -> tuple[Node, ...]:
    """The terms of an entry in its shortest form."""
    short = shortest(algebra, algebra.object(node))
    parts = algebra.sympy.Add.make_args(short) if short != 0 else ()
    return tuple(sort_factors(algebra, algebra.node(part)) for part in parts)


def underlying(algebra: Algebra, form: DescriptorForm) -> list[Equation]:
    """F' (and p') and the multipliers, each alone on its side."""
    rows = rows_of(form, "dynamics", "momentum_rate", "phi_acceleration", "psi_rate")
    kinds = (("f", 1), ("p", 1), ("kappa", 0), ("mu", 0))
    wanted = [n for kind, order in kinds for n in unknowns(form, kind, order)]
    read = {n for row in rows if row.block != "momentum_rate" for n in variables(row.expression)}
    idle = {row.owner for row in rows if row.block == "momentum_rate" and var(row.owner, "f", order=1) not in read}
    rows = [row for row in rows if row.block != "momentum_rate" or row.owner not in idle]
    wanted = [n for n in wanted if not (_is(n, "f", 1) and n.data[0] in idle)]
    solution = _solve_rows(algebra, rows, wanted)
    found = []
    for node, value in zip(wanted, solution, strict=True):
        right = tuple(Summed((), term) for term in _quotient(algebra, value))
        kind = "dynamics" if node.data[2] else "multiplier"
        if node.data[1] != "f" or not any(f.kind == "p" for f in form.families):
            found.append(Equation(kind, node.data[0], None, (Summed((), node),), right))
    for row in rows_of(form, "gamma", "lambda"):
        left, right = sides(row.block, sum_terms(algebra, [((), row.expression)]))
        found.append(Equation(row.block, row.owner, row.place, left, right))
    return found


def _quotient(algebra: Algebra, value: Any) -> tuple[Node, ...]:
    """A sympy object as terms, or as one term over a denominator that moves."""
    apart = collect_terms(algebra, algebra.node(value))
    above, below = algebra.sympy.fraction(algebra.sympy.factor(algebra.sympy.together(value)))
    if all(algebra.node(s).op == "param" for s in below.free_symbols):
        return collect_terms(algebra, algebra.node(algebra.sympy.expand(above) / below))
    below = turned_factors(algebra.sympy, below)
    factor, rest = above.as_independent(*(s for s in above.free_symbols if algebra.node(s).op != "param"), as_Add=False)
    terms = collect_terms(algebra, algebra.node(rest))
    parts = ((1.0, algebra.node(factor)), (1.0, add(*terms)), (-1.0, algebra.node(below)))
    whole = sort_factors(algebra, product(1.0, parts))
    return apart if length(algebra, apart) <= length(algebra, (whole,)) else (whole,)


def _solve_rows(algebra: Algebra, rows: Sequence[PlainRow], wanted: Sequence[Node]) -> list[Any]:
    """The unknowns from rows that are linear in them.  NoSuchEquations where these are singular, too many, or none."""
    if not 0 < len(wanted) <= LARGEST or len(rows) != len(wanted):
        raise NoSuchEquations(
            f"{len(wanted)} rates and multipliers in {len(rows)} rows: up to {LARGEST} are solved for in symbols"
            if len(rows) == len(wanted)
            else "the rows do not determine the rates and multipliers one by one"
        )
    sympy = algebra.sympy
    still = dict.fromkeys(wanted, const(0.0))
    matrix, right = [], []
    # the matrix of slopes, and the right side where all unknowns are zero
    for row in rows:
        slopes = [derivative(row.expression, n) for n in wanted]
        if any(n in wanted for slope in slopes for n in variables(slope)):
            raise NoSuchEquations(f"the row of {row.owner} is not linear in the rates and multipliers")
        matrix.append([shortest(algebra, algebra.object(slope)) for slope in slopes])
        right.append(_plain(algebra, neg(substitute(row.expression, still))))
    a, b = sympy.Matrix(matrix), sympy.Matrix(right)
    solution = _eliminate(sympy, a, b)
    if solution is None:
        raise NoSuchEquations(
            "there is no underlying equation: rates and multipliers do not follow from the rows differentiated once or"
            " twice (coordinates without inertia)"
        )
    return solution


def _plain(algebra: Algebra, node: Node) -> Any:
    """The sympy object of the joined terms: differences of angles are one argument."""
    return algebra.sympy.Add(*(algebra.object(term) for term in collect_terms(algebra, node)))


def _eliminate(sympy: Any, a: Any, b: Any) -> list[Any] | None:
    """The solution of a x = b, unknowns with one entry in a row first, each simplified; None where a is singular."""
    rows = [[*a.row(k), b[k]] for k in range(a.rows)]
    n = a.cols
    pivots: list[tuple[int, int]] = []
    left = set(range(n))
    free = set(range(len(rows)))
    # the pivot of the sparsest row, then of the shortest entry (Markowitz's order in symbols)
    while left:
        best = None
        for i in sorted(free):
            entries = [j for j in sorted(left) if rows[i][j] != 0]
            for j in entries:
                cost = (len(entries), rows[i][j].count_ops(), sum(rows[k][j] != 0 for k in free), i, j)
                best = min(best, (cost, i, j)) if best else (cost, i, j)
        if best is None:
            return None
        _, i, j = best
        pivots.append((i, j))
        free.discard(i)
        left.discard(j)
        pivot = rows[i][j]
        rows[i] = [_readable(_divide_terms(sympy, v, pivot)) for v in rows[i]]
        # Gauss-Jordan: above and below
        for k in range(len(rows)):
            factor = rows[k][j]
            if k != i and factor != 0:
                pairs = zip(rows[k], rows[i], strict=True)
                rows[k] = [_readable(_simple(sympy, v - factor * w)) if w != 0 else v for v, w in pairs]
    solution: list[Any] = [None] * n
    for i, j in pivots:
        solution[j] = rows[i][n]
    return solution


def _readable(value: Any) -> Any:
    """The value itself. NoSuchEquations where it is longer than anyone reads: what follows from it takes minutes."""
    if value.count_ops() > LONGEST:
        raise NoSuchEquations(
            f"the solution for rates and multipliers has entries of more than {LONGEST} operations: --form matrices"
            " shows the equations that it solves"
        )
    return value


def _divide_terms(sympy: Any, value: Any, pivot: Any) -> Any:
    """Each term of a value divided, and factored where that takes no minutes."""
    if value == 0:
        return value
    parts = [term / pivot for term in sympy.Add.make_args(value)]
    return sympy.Add(*(part if part.is_Symbol or part.count_ops() > FACTORED else sympy.factor(part) for part in parts))


def _simple(sympy: Any, value: Any) -> Any:
    """Over one denominator, sin^2 + cos^2 = 1."""
    value = sympy.together(value)
    if value.has(sympy.sin, sympy.cos) and value.count_ops() < 300:
        above, below = sympy.fraction(value)
        value = _sines_by_cosines(sympy, sympy.expand(above)) / _sines_by_cosines(sympy, sympy.expand(below))
    return _cancel(sympy, value) if value.count_ops() < 600 else value


def _cancel(sympy: Any, value: Any) -> Any:
    """Without common factors; by sparse polynomials, for in a dozen parameters dense ones take minutes."""
    try:
        _, fraction = sympy.polys.fields.sfield(value)
    except (sympy.polys.polyerrors.BasePolynomialError, NotImplementedError):
        return value
    return fraction.as_expr()


def _sines_by_cosines(sympy: Any, value: Any) -> Any:
    """A value with squares of sines written by cosines: equal expressions become equal. A sine that stands inside
    another function, sin(w*t + a*sin(t)), stays.
    """
    if not value.has(sympy.sin):
        return value
    sines = {s: 1 - sympy.cos(s.args[0]) ** 2 for s in value.atoms(sympy.sin)}
    found = value
    for sine, square in sines.items():
        try:
            polynomial = sympy.Poly(found, sine)
        except sympy.PolynomialError:
            continue
        found = sum(c * square ** (k // 2) * sine ** (k % 2) for (k,), c in polynomial.terms())
        found = sympy.expand(found)
    return found


def variation(algebra: Algebra, function: Function, form: DescriptorForm) -> Function:
    """Delta H: the conservative efforts dH/dq with the virtual displacements, the flows dH/dp with the virtual momenta.

    (dH/dq, dH/dp) is normal to the trajectory of a conservative system in its phase space (book, 2.5).
    """
    whole = add(*(t.expression for t in function.terms))
    on = [n for kind in ("q", "p") for n in unknowns(form, kind)]
    slopes = ((n, collect_terms(algebra, derivative(whole, n))) for n in on)
    return Function(function.name, (), tuple(EffortTerms((), terms, n) for n, terms in slopes if terms))


def canonical(algebra: Algebra, model: EnergyModel, form: DescriptorForm) -> tuple[Function, list[Equation]]:
    """H(q, p) and Hamilton's equations without the flows of coordinates that carry a momentum."""
    if form.formulation != "hamiltonian":
        raise NoSuchEquations("the canonical equations are Hamilton's: --formulation hamiltonian")
    rows = [_momentum_row(model, row) for row in rows_of(form, "momentum")]
    carriers = [row.owner for row in rows]
    if not carriers:
        raise NoSuchEquations("no coordinate carries a momentum: there is no kinetic store")
    flows = [var(owner, "f") for owner in carriers]
    # moving inertia of many coordinates has no short inverse
    if len(model.solved) > MOVING and any(
        n.op == "var"
        for r in rows
        for f in flows
        for n in variables(derivative(r.expression, f))
        if r.owner in model.solved
    ):
        raise NoSuchEquations(
            f"the inertia of {', '.join(model.solved)} moves: up to {MOVING} such coordinates are solved in symbols;"
            " --form descriptor has p = dT*/df"
        )
    try:
        solution = _solve_rows(algebra, rows, flows)
    except NoSuchEquations as error:
        raise NoSuchEquations(f"the flows do not follow from the momenta in symbols: {error}") from error
    values = {flow: algebra.node(value) for flow, value in zip(flows, solution, strict=True)}
    # T and V with flows by momenta: H
    energy = _energy(algebra, model, [owner for owner in carriers if _reads_flow(model, owner, "T*")], values)
    function = Function("H", tuple(Summed((), t) for t in energy))
    found = [_rate(algebra, owner, values) for owner in _displacements(form)]
    # the other rows without flows
    for row in rows_of(form, "dynamics", "phi", "psi", "gamma", "lambda"):
        left, right = sides(row.block, [Summed((), t) for t in _without_flows(algebra, row.expression, values)])
        found.append(Equation(row.block, row.owner, row.place, left, right))
    return function, found


def _momentum_row(model: EnergyModel, row: PlainRow) -> PlainRow:
    """P - dT*/df where the residual solves for the flow."""
    if row.owner not in model.solved:
        return row
    own = var(row.owner, model.mirror.conjugate)
    return replace(row, expression=sub(own, momentum(model, own)))


def _energy(
    algebra: Algebra, model: EnergyModel, carriers: Sequence[str], values: dict[Node, Node]
) -> tuple[Node, ...]:
    """p.f - T* + T at the flows of the momenta, and V."""
    sympy = algebra.sympy
    flows = {algebra.symbol(flow): algebra.object(value) for flow, value in values.items()}
    kinetic = sympy.Add(*(algebra.symbol(var(o, "p")) * algebra.symbol(var(o, "f")) for o in carriers))
    for name, sign in (("T*", -1), ("T", 1)):
        whole = add(*(t.expression for t in model.function(name)))
        kinetic += sign * _plain(algebra, whole)
    kinetic = _simple(sympy, kinetic.xreplace(flows))
    potential = collect_terms(algebra, add(*(t.expression for t in model.function("V"))))
    return (*_quotient(algebra, kinetic), *potential)


def _without_flows(algebra: Algebra, row: Node, values: dict[Node, Node]) -> tuple[Node, ...]:
    """The terms of a row, those with flows over one denominator."""
    flows = {algebra.symbol(flow): algebra.object(value) for flow, value in values.items()}
    found: list[Node] = []
    moved: list[Any] = []
    for term in collect_terms(algebra, row):
        whole = algebra.object(term)
        if whole.has(*flows):
            moved.append(whole.xreplace(flows))
        else:
            found.append(term)
    short = _simple(algebra.sympy, algebra.sympy.Add(*moved)) if moved else 0
    return (*found, *(_quotient(algebra, short) if short != 0 else ()))


def _reads_flow(model: EnergyModel, owner: str, name: str) -> bool:
    """Whether a state function reads the flow of a coordinate."""
    return any(
        n.data[:2] == (owner, "f") for t in model.function(name) for n in variables(t.expression) if n.op == "var"
    )


def _displacements(form: DescriptorForm) -> list[str]:
    return [f.owner for f in form.families if f.kind == "q"]


def _rate(algebra: Algebra, owner: str, values: dict[Node, Node]) -> Equation:
    flow = var(owner, "f")
    right = tuple(Summed((), t) for t in _quotient(algebra, algebra.object(values.get(flow, flow))))
    return Equation("kinematic", owner, None, (Summed((), var(owner, "q", order=1)),), right)
