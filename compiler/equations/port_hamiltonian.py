"""The port-Hamiltonian view of a model: E z' = (J - R) e + G u with E^T e = dH/dz, J = -J^T, R = R^T >= 0.

    z = (q, f or p, kappa, mu, e_g)      H = f.dT*/df - T* + T + V
    e = (dH/dq, f, kappa, mu, e_g)       H' = -e^T R e + e^T G u

        q     q' = f
        f     M f' = -dH/dq + J22 f - R22 f - Phi_q^T kappa - Psi_f^T mu + B e_g + G u
        p     the same with 1 for M where p is the unknown: dH/dq at fixed p, J22 without the curl of p
        kappa 0 = Phi_q f + Phi_t;   mu  0 = Psi_f f + b;   e_g  0 = -B^T f - R33 e_g

M = dp/df and, of p = dT*/df, J22 = dp_j/dq_i - dp_i/dq_j, which holds Coriolis' and gyroscopic efforts; two-ports that
give efforts by flows add the skew part of their matrix.  R22: second derivatives of D where they are free of f, else
the secant dD/df over f (van der Schaft and Jeltsema 2014, section 4.2; of several flows the matrix of rank one that
does the same).  Descriptor form: Beattie, Mehrmann, Xu and Zwart 2018.
Dynamic variables are signals: they stand in u and in the matrices, their own rows in none.
Received: an EnergyModel without families over ranges.  Returned: a PortHamiltonian; NoSuchEquations with the reason.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from sysdyn.compiler.equations.algebra import Algebra
from sysdyn.compiler.equations.book import Function, sum_terms
from sysdyn.compiler.equations.joining import collect_terms, length, shortest, sort_factors
from sysdyn.compiler.equations.matrices import Matrix, NoSuchEquations
from sysdyn.compiler.forms.descriptor import DescriptorForm
from sysdyn.compiler.forms.momenta import coordinates_by_energy
from sysdyn.compiler.model.energies import EnergyModel, Virtual
from sysdyn.compiler.model.terms import local_variables, summands
from sysdyn.dsl.model.calculus import derivative, signals_held
from sysdyn.dsl.model.expression import (
    Node,
    add,
    const,
    div,
    is_const,
    mul,
    neg,
    scale,
    sub,
    substitute,
    var,
    variables,
)
from sysdyn.values import dataclass

LARGEST = 24
"""Unknowns up to which matrices are written out."""
Entries = dict[tuple[int, int], list[Node]]


@dataclass(frozen=True, slots=True)
class PortHamiltonian:
    """z, e [n]; entries of E, J, R [n, n] and G [n, inputs] that are not zero; u [inputs]; H."""

    z: tuple[Node, ...]
    e: tuple[Node, ...]
    mass: Mapping[tuple[int, int], Node]
    skew: Mapping[tuple[int, int], Node]
    loss: Mapping[tuple[int, int], Node]
    gain: Mapping[tuple[int, int], Node]
    u: tuple[Node, ...]
    energy: Node


def written(algebra: Algebra, view: PortHamiltonian) -> tuple[Function, tuple[Matrix, ...]]:
    """H and the matrices as they are printed."""
    n, m = len(view.z), len(view.u)

    def matrix(name: str, entries: Mapping[tuple[int, int], Node], columns: int) -> Matrix:
        rows = (tuple(_entry(algebra, entries.get((i, j), const(0.0))) for j in range(columns)) for i in range(n))
        return Matrix(name, tuple(rows))

    def column(name: str, nodes: Sequence[Node]) -> Matrix:
        return Matrix(name, tuple((_entry(algebra, node),) for node in nodes))

    parts = [column("z", view.z), matrix("E", view.mass, n), matrix("J", view.skew, n), matrix("R", view.loss, n)]
    parts += [matrix("G", view.gain, m), column("u", view.u)] if m else []
    parts.append(column("e", view.e))
    return Function("H", sum_terms(algebra, [((), view.energy)], whole=True)), tuple(parts)


def _entry(algebra: Algebra, node: Node) -> tuple[Node, ...]:
    """The terms of an entry in its shortest form."""
    short = shortest(algebra, algebra.object(node))
    parts = algebra.sympy.Add.make_args(short) if short != 0 else ()
    found = tuple(sort_factors(algebra, algebra.node(part)) for part in parts)
    other = collect_terms(algebra, node)  # knows differences of angles
    return other if length(algebra, other) < length(algebra, found) else found


def port_hamiltonian(model: EnergyModel, form: DescriptorForm) -> PortHamiltonian:
    """The view in the unknowns of the form: momenta where it carries them, flows elsewhere."""
    return _View(model, form).assemble()


class _View:
    """One view under way: matrices as sums of entries."""

    def __init__(self, model: EnergyModel, form: DescriptorForm) -> None:
        self.model, self.m = model, model.mirror
        if any(c.shape for c in model.coordinates):
            raise NoSuchEquations("families over ranges are not written out")
        m = self.m
        # what carries energy: displacements, momenta or flows
        self.stores = coordinates_by_energy(model)
        self.carriers = {f.owner for f in form.families if f.kind == m.conjugate} & {c.name for c in model.coordinates}
        names = [c.name for c in model.coordinates]
        kept = {f.owner for f in form.families if f.kind == m.coordinate}
        self.places = [n for n in names if n in kept or self._moves(n)]
        self.names = names
        self.given = {u.name for u in model.unknowns}
        self.closed = self._explicit_unknowns()
        self.implicit = [u.name for u in model.unknowns if u.name not in self.closed]
        constraints = [(row.kind, row.name, row.at) for row in model.rows if row.kind in ("phi", "psi")]
        if any(at for _, _, at in constraints):
            raise NoSuchEquations("families over ranges are not written out")
        # the unknowns z: displacements, momenta or flows, multipliers, implicit efforts
        self.labels = list(dict.fromkeys((kind, name) for kind, name, _ in constraints))
        self.z = [var(n, m.coordinate) for n in self.places]
        self.first = len(self.z)
        self.z += [var(n, m.conjugate if n in self.carriers else m.rate) for n in names]
        self.z += [var(name, "kappa" if kind == "phi" else "mu") for kind, name in self.labels]
        self.z += [var(name, "e") for name in self.implicit]
        if len(self.z) > LARGEST:
            raise NoSuchEquations(f"{len(self.z)} unknowns are more than {LARGEST}")
        self.at = {node: k for k, node in enumerate(self.z)}
        self.mass: Entries = {}
        self.skew: Entries = {}
        self.loss: Entries = {}
        self.gain: dict[tuple[int, Node], list[Node]] = {}

    # -- parts ---------------------------------------------------------------------------------------------------

    def assemble(self) -> PortHamiltonian:
        """All parts put together."""
        energy = self._energy()
        self._kinetic()
        self._contents()
        self._works()
        self._constraints()
        e = (*self._gradients(), *(self._flow(n) for n in self.names), *self.z[self.first + len(self.names) :])
        inputs = list(dict.fromkeys(node for _, node in self.gain))
        gain = {(k, inputs.index(node)): add(*parts) for (k, node), parts in self.gain.items()}
        return PortHamiltonian(
            tuple(self.z),
            e,
            _sum_entries(self.mass),
            _sum_entries(self.skew),
            _sum_entries(self.loss),
            {key: node for key, node in gain.items() if not is_const(node, 0.0)},
            tuple(inputs),
            energy,
        )

    def _function(self, name: str) -> Node:
        if any(t.loops for t in self.model.function(name)):
            raise NoSuchEquations("sums over ranges are not written out")
        return add(*(t.expression for t in self.model.function(name)))

    def _moves(self, name: str) -> bool:
        """Whether H depends on the displacement."""
        node = var(name, self.m.coordinate)
        functions = (self.m.coenergy, self.m.energy, self.m.potential)
        return any(node in variables(t.expression) for f in functions for t in self.model.function(f))

    def _flow(self, name: str) -> Node:
        """The rate of a coordinate, as a function of z where its store is given by T(p)."""
        if name not in self.stores:
            return var(name, self.m.rate)
        return derivative(self._function(self.m.energy), var(name, self.m.conjugate))

    def _momenta(self) -> dict[str, Node]:
        """dT*/df of the coordinates that have one."""
        coenergy = self._function(self.m.coenergy)
        if any(n.op == "time" for n in variables(coenergy)):
            raise NoSuchEquations(f"{self.m.coenergy} depends on time")
        found = {n: derivative(coenergy, var(n, self.m.rate)) for n in self.names}
        return {n: p for n, p in found.items() if not is_const(p, 0.0)}

    def _energy(self) -> Node:
        """H = f.dT*/df - T* + T + V."""
        m, coenergy = self.m, self._function(self.m.coenergy)
        if any(w.account == "stored" for w in self.model.works):
            raise NoSuchEquations("the energy of a store has no closed form")
        legendre = [mul(var(n, m.rate), p) for n, p in self._momenta().items()]
        return add(*legendre, neg(coenergy), self._function(m.energy), self._function(m.potential))

    def _gradients(self) -> list[Node]:
        """dH/dq: at fixed f, or at fixed p where that is the unknown."""
        m = self.m
        coenergy, rest = self._function(m.coenergy), add(self._function(m.energy), self._function(m.potential))
        found = []
        for name in self.places:
            q = var(name, m.coordinate)
            moved = [
                mul(var(n, m.rate), derivative(p, q)) for n, p in self._momenta().items() if n not in self.carriers
            ]
            found.append(add(*moved, neg(derivative(coenergy, q)), derivative(rest, q)))
        return found

    def _kinetic(self) -> None:
        """Q' = f and M f' or p'; the curl of the momenta."""
        m, momenta = self.m, self._momenta()
        # q' = f: a pair of skew entries
        for name in self.places:
            q, row = self.at[var(name, m.coordinate)], self.first + self.names.index(name)
            _add(self.mass, q, q, const(1.0))
            self._add_skew(q, row, const(1.0))
        # momenta as unknowns have a rate of their own, others M f'
        for i, name in enumerate(self.names):
            if name in self.carriers:
                _add(self.mass, self.first + i, self.first + i, const(1.0))
                continue
            for j, other in enumerate(self.names):
                if name in momenta:
                    if other in self.carriers and not is_const(derivative(momenta[name], var(other, m.rate)), 0.0):
                        raise NoSuchEquations(f"{name} has no momentum beside that of {other}")
                    _add(self.mass, self.first + i, self.first + j, derivative(momenta[name], var(other, m.rate)))
                # the gyroscopic terms of moving inertia
                if j > i and other not in self.carriers:
                    curl = sub(
                        derivative(momenta.get(other, const(0.0)), var(name, m.coordinate)),
                        derivative(momenta.get(name, const(0.0)), var(other, m.coordinate)),
                    )
                    self._add_skew(self.first + i, self.first + j, curl)

    def _contents(self) -> None:
        """R22 of D, term by term."""
        for term in self.model.function(self.m.content):
            if term.loops:
                raise NoSuchEquations("sums over ranges are not written out")
            rates = local_variables(term.expression, self.m.rate)
            slopes = [derivative(term.expression, v) for v in rates]
            self._add_dissipation([(n.data[0], s) for n, s in zip(rates, slopes, strict=True)])

    def _add_dissipation(self, efforts: Sequence[tuple[str, Node]]) -> None:
        """Efforts against flows as a symmetric matrix times the flows."""
        rates = [var(n, self.m.rate) for n, _ in efforts]
        second = [[derivative(s, v) for v in rates] for _, s in efforts]
        still = dict.fromkeys(rates, const(0.0))
        free = all(not set(rates) & variables(x) for row in second for x in row)
        if free and all(is_const(substitute(s, still), 0.0) for _, s in efforts):
            parts = second
        elif len(efforts) == 1:
            parts = [[div(efforts[0][1], rates[0])]]
        else:
            power = add(*(mul(v, s) for v, (_, s) in zip(rates, efforts, strict=True)))
            parts = [[div(mul(a, b), power) for _, b in efforts] for _, a in efforts]
        for (one, _), row in zip(efforts, parts, strict=True):
            for (other, _), value in zip(efforts, row, strict=True):
                _add(self.loss, self._row(one), self._row(other), value)

    def _works(self) -> None:
        """Implicit efforts, what is given by flows, and ports."""
        m = self.m
        linear: dict[str, list[Node]] = {}
        for work in self.model.works:
            if work.loops:
                raise NoSuchEquations("sums over ranges are not written out")
            on = {n.data[0]: derivative(work.on, n) for n in local_variables(work.on, m.coordinate)}
            for effort in summands(substitute(work.effort, self._explicit())):
                read = {n for n in variables(effort) if n.op == "var"}
                # an implicit effort is an unknown
                if any(n.data[1] == "e" and n.data[0] in self.given for n in read):
                    self._implicit(effort, on, work)
                # by flows: dissipation or exchange
                elif any(n.data[1] == m.rate for n in read):
                    self._by_flows(effort, on, linear)
                # of time and displacements: an input
                else:
                    for name, slope in on.items():
                        self.gain.setdefault((self._row(name), effort), []).append(slope)
        self._exchange(linear)
        self._closing()

    def _by_flows(self, effort: Node, on: Mapping[str, Node], linear: dict[str, list[Node]]) -> None:
        """Linear in the flows: to a matrix; else along the work's own displacement."""
        rates = local_variables(effort, self.m.rate)
        if all(not set(rates) & variables(derivative(effort, v)) for v in rates):
            for name, slope in on.items():
                linear.setdefault(name, []).append(mul(effort, slope))
            return
        rate = add(*(mul(slope, var(name, self.m.rate)) for name, slope in on.items()))
        for one, a in on.items():
            for other, b in on.items():
                _add(self.loss, self._row(one), self._row(other), neg(mul(a, b, div(effort, rate))))

    def _exchange(self, linear: Mapping[str, Sequence[Node]]) -> None:
        """The skew part of dQ/df goes to J, the symmetric one to R."""
        names = list(dict.fromkeys([*linear, *(n for n in self.names if n not in linear)]))
        matrix = {(a, b): derivative(add(*linear.get(a, ())), var(b, self.m.rate)) for a in names for b in names}
        for k, a in enumerate(names):
            for b in names[k:]:
                one, other = matrix[a, b], matrix[b, a]
                if a != b:
                    self._add_skew(self._row(a), self._row(b), scale(0.5, sub(one, other)))
                    _add(self.loss, self._row(b), self._row(a), scale(-0.5, add(one, other)))
                _add(self.loss, self._row(a), self._row(b), scale(-0.5, add(one, other)))

    def _implicit(self, effort: Node, on: Mapping[str, Node], work: Virtual) -> None:
        own = [n for n in variables(effort) if n.op == "var" and n.data[1] == "e" and n.data[0] in self.given]
        part = derivative(effort, own[0])
        if len(own) != 1 or own[0] in variables(part):
            raise NoSuchEquations("an effort is no multiple of one implicit effort")
        for name, slope in on.items():
            self._add_skew(self._row(name), self.at[own[0]], mul(part, slope))

    def _explicit_unknowns(self) -> dict[str, Node]:
        """Implicit unknowns that a gamma gives by what is none."""
        found: dict[str, Node] = {}
        for row in self.model.of_kind("gamma"):
            gamma = add(*(t.expression for t in row.terms))
            own = [n for n in variables(gamma) if n.op == "var" and n.data[1] == "e" and n.data[0] in self.given]
            if len(own) == 1 and not variables(derivative(gamma, own[0])) and own[0].data[0] not in found:
                rest = substitute(gamma, {own[0]: const(0.0)})
                value = neg(div(rest, derivative(gamma, own[0])))
                if not self._own_flow(own[0], gamma):
                    found[own[0].data[0]] = value
        return found

    def _own_flow(self, own: Node, gamma: Node) -> bool:
        """Whether the unknown is an effort along the flow that the gamma reads: the law of a dissipator."""
        for work in self.model.works:
            if own in variables(work.effort):
                read = {n.data[0] for n in local_variables(work.on, self.m.coordinate)}
                if read & {n.data[0] for n in local_variables(gamma, self.m.rate)}:
                    return True
        return False

    def _explicit(self) -> dict[Node, Node]:
        return {var(name, "e"): value for name, value in self.closed.items()}

    def _closing(self) -> None:
        """0 = -B^T f - R33 e_g of every implicit effort that is an unknown."""
        m = self.m
        rows = [add(*(t.expression for t in row.terms)) for row in self.model.of_kind("gamma")]
        for name in self.implicit:
            own = var(name, "e")
            k = self.at[own]
            column = {i: add(*parts) for (i, j), parts in self.skew.items() if j == k}
            found = [g for g in rows if own in variables(g)]
            # two unknown efforts in one gamma: neither's law alone
            if len(found) != 1 or not column:
                raise NoSuchEquations(f"no effort constraint is the law of {name} alone")
            gamma = substitute(found[0], self._explicit())
            others = {n.data[0] for n in variables(gamma) if n.op == "var" and n.data[0] in self.given} - {name}
            slopes = {n.data[0]: derivative(gamma, n) for n in local_variables(gamma, m.rate)}
            if others or {self._row(n) for n in slopes} != set(column):
                raise NoSuchEquations(f"the effort constraint of {name} is no relation to its own flow")
            first = next(iter(slopes))
            # the multiple of gamma in which the first flow has the coefficient of -B^T f
            factor = neg(div(column[self._row(first)], slopes[first]))
            if any(set(local_variables(s, m.rate)) for s in slopes.values()):
                raise NoSuchEquations(f"the effort constraint of {name} is not linear in its flow")
            # what is left without flows, R33 e, is divided by e
            still = {n: const(0.0) for n in local_variables(gamma, m.rate)}
            _add(self.loss, k, k, neg(div(mul(factor, substitute(gamma, still)), own)))

    def _constraints(self) -> None:
        """Reactions, and the constraints' rates."""
        m = self.m
        for row in self.model.rows:
            if row.kind not in ("phi", "psi"):
                continue
            k = self.at[var(row.name, "kappa" if row.kind == "phi" else "mu")]
            kind = m.coordinate if row.kind == "phi" else m.rate
            # the gradient stands in the balance and, against it, in the constraint's rate
            for term in row.terms:
                if term.loops:
                    raise NoSuchEquations("sums over ranges are not written out")
                held, signals = signals_held(term.expression)
                nodes = local_variables(held, kind)
                for node in nodes:
                    slope = substitute(derivative(held, node), signals)
                    self._add_skew(k, self._row(node.data[0]), slope)
                # what moves it without flows: an input of the constraint
                if row.kind == "psi":
                    moving = substitute(term.expression, {n: const(0.0) for n in nodes})
                else:
                    times = [n for n in variables(term.expression) if n.op == "time"]
                    moving = add(*(derivative(term.expression, n) for n in times))
                if not is_const(moving, 0.0):
                    self.gain.setdefault((k, moving), []).append(const(1.0))

    def _row(self, name: str) -> int:
        return self.first + self.names.index(name)

    def _add_skew(self, i: int, j: int, value: Node) -> None:
        _add(self.skew, i, j, value)
        _add(self.skew, j, i, neg(value))


def _add(entries: Entries, i: int, j: int, value: Node) -> None:
    if not is_const(value, 0.0):
        entries.setdefault((i, j), []).append(value)


def _sum_entries(entries: Entries) -> dict[tuple[int, int], Node]:
    found = {key: add(*parts) for key, parts in entries.items()}
    return {key: node for key, node in found.items() if not is_const(node, 0.0)}
