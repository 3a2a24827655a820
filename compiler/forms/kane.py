"""EnergyModel -> DescriptorForm of Kane: Lagrange's balances projected on the motions that Psi leaves free.

    q' = f;   B^T (M f' + Phi_q^T kappa - Upsilon) = 0;   0 = Phi;   0 = Psi        where Psi_f B = 0

(book, afterword; Kane, Levinson: Dynamics, 1985, 4.6).  Psi needs no multipliers: its reactions do no work along the
columns of B.  B is found by division where a pivot is a number, else by minors, so that it is regular wherever the
columns of the bound flows are.  A flow constraint whose reaction something reads (that of an inequality its condition
does) keeps its multiplier, as does one that joins flows of several elements of a family, with all that share flows
with it: there is nothing left out, and the balances are Lagrange's own.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import replace

from sysdyn.compiler.forms.assembly import Assembly
from sysdyn.compiler.forms.descriptor import HOME, DescriptorForm, EquationFamily, Pin, Unknowns
from sysdyn.compiler.forms.lagrangian import lagrangian
from sysdyn.compiler.forms.lowering import total_rate
from sysdyn.compiler.forms.minors import determinant
from sysdyn.compiler.forms.speeds import LARGEST, Speeds, definition, kinematics, speeds_of
from sysdyn.compiler.model.energies import EnergyModel, Row, UnknownFamily
from sysdyn.compiler.model.terms import Nest, counter, local_variables
from sysdyn.dsl.model.calculus import derivative, signals_held
from sysdyn.dsl.model.connected_components import Joined
from sysdyn.dsl.model.expression import Node, add, const, is_const, mul, neg, substitute, topological, var, variables
from sysdyn.dsl.model.network import loop_ranges
from sysdyn.dsl.text.diagnostics import Diagnostic, ModelError
from sysdyn.values import dataclass

Entries = dict[str, Node]
"""Coefficients of flows by coordinate, in the counters of the row."""


@dataclass(frozen=True, slots=True)
class Projection:
    """free: B by coordinate that keeps its balance, column by column; bound: coordinates that lose it."""

    free: Mapping[str, Entries]
    bound: frozenset[str]

    def along(self, speeds: Speeds) -> Projection:
        """The projection with partial velocities in the place of the columns of their coordinates."""
        free = {name: column for name, column in self.free.items() if name not in speeds.rest}
        bound = self.bound - set(speeds.rest)
        return Projection({**free, **{u: dict(c) for u, c in speeds.columns.items()}}, bound)


def kane(model: EnergyModel) -> DescriptorForm:
    """Unknowns q f kappa e s, and mu where it is kept.  ModelError E607 where the rows of Psi depend on each other."""
    (rows, joining), form = constraints(model), lagrangian(model)
    read = _coupled_labels(rows, _reactions_read(form) | joining)
    found = projection(model, {label: entries for label, entries in rows.items() if label not in read})
    speeds = speeds_of(model, read)
    if speeds.speeds:
        form = lagrangian(_seen(model, speeds))
    return _Projected(form, found.along(speeds), read, speeds).form()


def _seen(model: EnergyModel, speeds: Speeds) -> EnergyModel:
    """The model with the displacements as unknowns that the partial velocities depend on."""
    roots = [*speeds.rest.values(), *(v for column in speeds.columns.values() for v in column.values())]
    names = {n.data[0] for root in roots for n in variables(root) if n.op == "var" and n.data[1] == "q"}
    coordinates = tuple(replace(c, tangible=c.tangible or c.name in names) for c in model.coordinates)
    return replace(model, coordinates=coordinates)


def repeats(form: DescriptorForm) -> bool:
    """Whether a form of Kane is Lagrange's: it leaves no flow constraint's reaction out, no speed is unknown."""
    if not form.formulation.endswith("kane"):
        return False
    kept = {f.owner for f in form.families if f.kind == "mu"}
    left_out = any(row.block == "psi" and row.owner not in kept for row in form.rows)
    return not left_out and not any(form.is_speed(f) for f in form.families)


def constraints(model: EnergyModel) -> tuple[dict[str, Entries], frozenset[str]]:
    """Psi_f by label, and the labels whose rows join flows of several elements or stand in several pieces."""
    rows: dict[str, Entries] = {}
    joining: set[str] = set()
    families = {c.name: c for c in model.coordinates}
    for row in model.of_kind("psi"):
        entries = _entries(row, families)
        if entries is None or row.name in rows:
            joining.add(row.name)
            entries = rows.get(row.name, {}) | dict.fromkeys(_flows(row), const(1.0))
        rows[row.name] = entries
    return rows, frozenset(joining)


def projection(model: EnergyModel, rows: Mapping[str, Entries]) -> Projection:
    """B of these flow constraints: pivots that are numbers first, by division; of the others by minors."""
    reduced = {name: dict(entries) for name, entries in rows.items()}
    pivots: dict[str, str] = {}
    # division by numbers first: no case in which it fails
    while len(pivots) < len(rows):
        name, column = _pivot(reduced, pivots, model)
        if not is_const(reduced[name][column]):
            break
        pivots[name] = column
        _eliminate(reduced, name, column)
    free: dict[str, Entries] = {}
    bound = set(pivots.values())
    # what is left in parts that share flows, by minors
    for part in _parts({name: entries for name, entries in reduced.items() if name not in pivots}):
        own, columns = _free(part, model)
        bound |= own
        free |= columns
    free = {c.name: free.get(c.name, {c.name: const(1.0)}) for c in model.coordinates if c.name not in bound}
    # the motion of the coordinates that were divided for
    for name, column in pivots.items():
        entries = reduced[name]
        for motion in free.values():
            moved = add(*(mul(value, motion[c]) for c, value in entries.items() if c != column and c in motion))
            if not is_const(moved, 0.0):
                motion[column] = mul(const(-1.0 / entries[column].data), moved)
    return Projection(free, frozenset(bound))


def _parts(rows: Mapping[str, Entries]) -> list[dict[str, Entries]]:
    """Rows that share flows."""
    joined, parts = Joined[str](), dict[str, dict[str, Entries]]()
    firsts = {name: next(iter(entries), "") for name, entries in rows.items()}
    for name, entries in rows.items():
        for flow in entries:
            joined.join(firsts[name], flow)
    for name, entries in rows.items():
        parts.setdefault(joined.first(firsts[name]), {})[name] = entries
    return list(parts.values())


def _free(part: Mapping[str, Entries], model: EnergyModel) -> tuple[set[str], dict[str, Entries]]:
    """Bound coordinates of rows that share flows, and the motion with each other flow: the determinant of the bound
    columns on it, on each of these that with the column in its place (Cramer): no factor vanishes but that one.
    """
    reduced = {name: dict(entries) for name, entries in part.items()}
    pivots: dict[str, str] = {}
    # pivots tell which coordinates are bound
    for _ in part:
        name, column = _pivot(reduced, pivots, model)
        pivots[name] = column
        _eliminate(reduced, name, column)
    bound, free = list(pivots.values()), dict.fromkeys(c for e in part.values() for c in e if c not in pivots.values())
    # determinants of many rows grow too long: columns by elimination
    if len(part) > LARGEST:
        return set(bound), {name: _column(name, reduced, pivots) for name in free}
    columns = {c: [entries.get(c, const(0.0)) for entries in part.values()] for c in (*bound, *free)}

    def whole(columns: list[list[Node]]) -> Node:
        return determinant([list(row) for row in zip(*columns, strict=True)])

    motions: dict[str, Entries] = {}
    # Cramer's rule without the division
    for name in free:
        motions[name] = {name: whole([columns[c] for c in bound])}
        for k, other in enumerate(bound):
            value = neg(whole([columns[c if j != k else name] for j, c in enumerate(bound)]))
            if not is_const(value, 0.0):
                motions[name][other] = value
    return set(bound), motions


def _impossible(row: Row, why: str) -> ModelError:
    help_ = "formulation lagrangian, hamiltonian"
    return ModelError((Diagnostic("E607", f"formulation kane: {why}", row.place, help_),))


def _flows(row: Row) -> list[str]:
    """Coordinates whose flows a row reads."""
    return [flow.data[0] for term in row.terms for flow in local_variables(term.expression, "f")]


def _entries(row: Row, families: Mapping[str, UnknownFamily]) -> Entries | None:
    """Coefficients of the flows of a row, all of the row's own element; None where one is of another."""
    found: Entries = {}
    for term in row.terms:
        held, signals = signals_held(term.expression)
        for flow in local_variables(held, "f"):
            name = flow.data[0]
            whole = loop_ranges(row.nest) == families[name].shape
            if flow.args != row.at or term.loops != row.nest or not whole:
                return None
            slope = substitute(derivative(held, flow), signals)
            found[name] = add(found[name], slope) if name in found else slope
    return {name: value for name, value in found.items() if not is_const(value, 0.0)}


def _pivot(reduced: Mapping[str, Entries], pivots: Mapping[str, str], model: EnergyModel) -> tuple[str, str]:
    """The next row and column: a number rather than a function, of a column in few rows, the shorter expression."""
    uses: dict[str, int] = {}
    for entries in reduced.values():
        for column in entries:
            uses[column] = uses.get(column, 0) + 1
    choices = [
        (not is_const(value), len(entries) > 2, uses[column], len(topological([value])), name, column)
        for name, entries in reduced.items()
        if name not in pivots
        for column, value in entries.items()
    ]
    if not choices:
        row = next(r for r in model.of_kind("psi") if r.name in reduced and r.name not in pivots)
        raise _impossible(row, f"psi {row.name} follows from the others")
    return min(choices)[-2:]


def _eliminate(reduced: dict[str, Entries], pivot_row: str, column: str) -> None:
    """Rows without the column: p * row - a * pivot row; by division where p is a number."""
    entries = reduced[pivot_row]
    pivot = entries[column]
    for name, other in reduced.items():
        if name == pivot_row or column not in other:
            continue
        factor = other[column]
        keep, take = (const(1.0), mul(factor, const(1.0 / pivot.data))) if is_const(pivot) else (pivot, factor)
        mixed = {
            c: add(mul(keep, other.get(c, const(0.0))), neg(mul(take, entries.get(c, const(0.0)))))
            for c in dict.fromkeys((*other, *entries))
            if c != column
        }
        reduced[name] = {c: value for c, value in mixed.items() if not is_const(value, 0.0)}


def _column(name: str, reduced: Mapping[str, Entries], pivots: Mapping[str, str]) -> Entries:
    """The motion with this flow: Prod p on it, - c Prod' p on each bound flow that follows."""
    touched = [row for row, entries in reduced.items() if name in entries]
    column = {name: mul(*(reduced[row][pivots[row]] for row in touched))} if touched else {name: const(1.0)}
    for row in touched:
        others = [reduced[r][pivots[r]] for r in touched if r != row]
        column[pivots[row]] = neg(mul(reduced[row][name], *others))
    return column


def _reactions_read(form: DescriptorForm) -> frozenset[str]:
    """Labels whose mu stands elsewhere than in the balances."""
    nodes = (
        node
        for block in form.blocks
        if block.name not in ("psi_reaction", "dynamics_rate")
        for kernel in block.kernels
        for summand in kernel.rows
        for node in variables(summand.expression)
    )
    read = {node.data[0] for node in nodes if node.op == "var" and node.data[1] == "mu"}
    pinned = {form.families[pin.family] for pin in form.pins}
    return frozenset(read | {f.owner for f in pinned if f.kind == "mu"})


def _coupled_labels(rows: Mapping[str, Entries], read: frozenset[str]) -> frozenset[str]:
    """These labels, and all whose rows share flows with them."""
    columns = {c for label in read for c in rows[label]}
    more = frozenset(label for label, entries in rows.items() if columns & set(entries))
    return read if more <= read else _coupled_labels(rows, read | more)


class _Projected:
    """The Lagrangian form with its balances mixed."""

    def __init__(self, lagrange: DescriptorForm, found: Projection, read: frozenset[str], speeds: Speeds) -> None:
        self.lagrange, self.found, self.read, self.speeds = lagrange, found, read, speeds
        self.flows = {var(n, "f"): speeds.flow(n) for n in speeds.rest}
        self.change = {var(n, "f", order=1): total_rate(speeds.flow(n)) for n in speeds.rest}
        self.assembly = Assembly()
        self.rated = self._massless_coordinates()

    def _massless_coordinates(self) -> frozenset[str]:
        """Coordinates whose mixed balances are algebraic (see `lowering`), with their rates."""
        block = self.lagrange.block("dynamics_rate")
        rows = {s.row for kernel in block.kernels for s in kernel.rows} if block else set()
        massless = {self.lagrange.rows[k].owner for k in rows}
        return frozenset(name for name, column in self.found.free.items() if set(column) <= massless)

    def form(self) -> DescriptorForm:
        """The projected form."""
        # balances of bound coordinates go, those of given speeds become kinematic
        for row in self.lagrange.rows:
            if row.block == "dynamics" and row.owner in self.speeds.rest:
                unit = next(f.unit for f in self.lagrange.families if (f.owner, f.kind) == (row.owner, "f"))
                self.assembly.family(replace(row, unit=unit, kind="kinematic"))
            elif (row.block != "dynamics" or row.owner not in self.found.bound) and not self._left_out(row):
                self.assembly.family(row)
        # a balance along each speed
        for speed in self.speeds.speeds:
            unit = f"W/({speed.unit})"
            self.assembly.family(EquationFamily("dynamics", speed.name, speed.name, "dynamics", unit, speed.place))
        if self.lagrange.block("phi_reaction") is not None:
            for row in self.lagrange.rows:
                if row.block == "dynamics":
                    self.assembly.family(replace(row, block="phi_normal", kind="phi_normal"))
        self._copy()
        # coordinates whose flow the speeds give
        for name in self.speeds.rest:
            zero = kinematics(self.speeds, name)
            self.assembly.add("dynamics", name, (), (), zero)
            self.assembly.add("dynamics_rate", name, (), (), total_rate(zero))
        # multipliers of flow constraints are gone, unless something reads them
        kept = [f for f in self.lagrange.families if f.kind != "mu" or f.owner in self.read]
        last = 1 + max(k for k, f in enumerate(kept) if f.kind == "f") if self.speeds.speeds else 0
        own = [Unknowns(s.name, "f", s.name, s.unit, s.place) for s in self.speeds.speeds]
        families = [*kept[:last], *own, *kept[last:]]
        number = {(f.owner, f.kind): k for k, f in enumerate(families)}
        held = [(p, self.lagrange.families[p.family]) for p in self.lagrange.pins]
        pins = [replace(p, family=number[f.owner, f.kind]) for p, f in held if (f.owner, f.kind) in number]
        return replace(
            self.lagrange,
            formulation="kane",
            families=tuple(families),
            rows=tuple(self.assembly.rows),
            blocks=self.assembly.blocks(),
            pins=(*pins, *self._pins(number)),
            shapes=(*self.lagrange.shapes, *((s.name, ()) for s in self.speeds.speeds)),
        )

    def _pins(self, number: Mapping[tuple[str, str], int]) -> Iterator[Pin]:
        """Guesses of speeds by what the text says of displacements and flows."""
        owners = [(p, self.lagrange.families[p.family]) for p in self.lagrange.pins if not p.at]
        values = {var(f.owner, f.kind): p.value for p, f in owners}
        for speed in self.speeds.speeds:
            value = definition(speed, values)
            if value is not None and speed.place is not None:
                yield Pin(number[speed.name, "f"], (), value, False, (), speed.place)

    def _left_out(self, row: EquationFamily) -> bool:
        return row.block == "psi" and row.owner in self.speeds.left_out

    def _is_read(self, reaction: Node) -> bool:
        """Whether a summand of reactions is of a constraint that keeps its multiplier."""
        return any(n.data[0] in self.read for n in local_variables(reaction, "mu"))

    def _copy(self) -> None:
        """Add all rows of Lagrange's form, balances projected on the free motions, without what projection removes."""
        for block in self.lagrange.blocks:
            if block.name == "dynamics_rate":
                continue
            for kernel in block.kernels:
                for summand in kernel.rows:
                    row = self.lagrange.rows[summand.row]
                    value = substitute(summand.expression, self.change) if self.change else summand.expression
                    if self._left_out(row) or (block.name == "psi_reaction" and not self._is_read(value)):
                        continue
                    # no balance: as it is
                    if HOME.get(block.name, block.name) != "dynamics":
                        self.assembly.add(block.name, row.owner, summand.at, kernel.nest, value)
                        continue
                    # reactions of displacement constraints do not vanish under the projection of flows
                    if block.name == "phi_reaction":
                        self.assembly.add("phi_normal", row.owner, summand.at, kernel.nest, value)
                    self._balance(block.name, row.owner, summand.at, kernel.nest, value)

    def _balance(self, block: str, owner: str, at: tuple[Node, ...], nest: Nest, value: Node) -> None:
        """A summand of the balance of one coordinate, in the mixed balances."""
        for name, column in self.found.free.items():
            if owner in column:
                mixed = mul(_here(column[owner], at), value)
                mixed = substitute(mixed, self.flows) if name in self.speeds.columns else mixed
                self.assembly.add(block, name, at, nest, mixed)
                rates = [n for n in variables(mixed) if n.op == "var" and n.data[2]]
                if name in self.rated and all(n.data[1] == "f" for n in rates):
                    acting = substitute(mixed, dict.fromkeys(rates, const(0.0)))
                    self.assembly.add("dynamics_rate", name, at, nest, total_rate(acting))


def _here(value: Node, at: tuple[Node, ...]) -> Node:
    """A coefficient at an element."""
    change = {counter(k): node for k, node in enumerate(at)}
    return substitute(value, {old: new for old, new in change.items() if old is not new})
