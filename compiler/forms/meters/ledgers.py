"""Ledgers: for each connected part of a model, what its elements store, dissipate and are supplied with.

Coordinates are of one part where an energy, a content, the displacement of a work or a constraint reads both; works of
one statement (a gyrator's) join theirs.  A part's ledger is in joules, or in what effort times displacement is in a
pseudo domain.  Combinations with constant coefficients whose rate vanishes identically are ledgers too (kind
`invariant`): of dynamic variables, and of momenta dT*/df + p, the efforts on whose coordinates cancel (a cyclic
coordinate has none; the displacement of several alike leaves the energies as they are).

Received: an EnergyModel and the audit's entries.  Returned: ledgers, each with its own entries.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from fractions import Fraction
from typing import TypeVar

from sysdyn.compiler.forms.efforts import Effort
from sysdyn.compiler.model.energies import EnergyModel, Row, UnknownFamily
from sysdyn.compiler.model.terms import Nest, local_variables, summands
from sysdyn.dsl.model.calculus import derivative
from sysdyn.dsl.model.connected_components import Joined
from sysdyn.dsl.model.expression import Node, add, const, is_const, scale, var, variables
from sysdyn.dsl.text.diagnostics import Place
from sysdyn.values import dataclass

MOST = 200
"""Dynamic variables, or coordinates, among which linear invariants are sought."""
SHOWN = 4
"""Names of a part that its title says."""
K = TypeVar("K")
STORED, POWERS = ("kinetic", "potential"), ("dissipated", "supplied")


@dataclass(frozen=True, slots=True)
class Entry:
    """One term of the audit.  account: kinetic, potential (stored), dissipated, supplied, or exchanged between the
    coordinates of an invariant; owners: the coordinates whose part it belongs to.
    """

    account: str
    owners: tuple[str, ...]
    nest: Nest
    expression: Node
    place: Place


@dataclass(frozen=True, slots=True)
class EnergyAccount:
    """What one statement stores, dissipates or is supplied with, for all iterations of a nest.  account: as of its
    entries, `stored` where these are kinetic and potential.
    """

    account: str
    nest: Nest
    expression: Node
    place: Place


@dataclass(frozen=True, slots=True)
class Ledger:
    """The entries of one part.  kind: energy or invariant; unit of what is stored; names: coordinates or states;
    title: what is kept, for a reader.
    """

    kind: str
    unit: str
    entries: tuple[Entry, ...]
    names: tuple[str, ...]
    title: str

    def elements(self) -> tuple[EnergyAccount, ...]:
        """What is stored, dissipated and supplied by statement; of an invariant term by term, for these may cancel."""
        if self.kind == "invariant":
            kept = (e for e in self.entries if e.account in STORED)
            return tuple(EnergyAccount("stored", e.nest, e.expression, e.place) for e in kept)
        return elements(self.entries)

    def label(self, element: EnergyAccount) -> str:
        """A name for an element that no component or branch names: the unknown that it reads first."""
        nodes = [n for n in variables(element.expression) if n.op == "var" and n.data[0] in self.names]
        rates = [n for n in nodes if n.data[1] in ("f", "p")]
        found = min(rates or nodes, key=lambda n: n.number, default=None)
        return self.names[0] if found is None else str(found.data[0])


def ledgers(model: EnergyModel, entries: Sequence[Entry], acting: Iterable[Effort]) -> tuple[Ledger, ...]:
    """The ledgers of all parts that have stores, dissipators or sources, then the linear invariants of states and of
    momenta.
    """
    head = _parts(model, entries)
    units = {c.name: c.units.get("balance", "J") for c in model.coordinates}
    found: dict[str, list[Entry]] = {}
    for entry in entries:
        kept = _varying(entry)
        if kept is not None and entry.owners:
            found.setdefault(head[entry.owners[0]], []).append(kept)
    members: dict[str, list[str]] = {}
    for name, first in head.items():
        members.setdefault(first, []).append(name)
    parts = [
        Ledger("energy", units[first], tuple(own), tuple(members[first]), _label_of(members[first]))
        for first, own in found.items()
    ]
    return (*parts, *_of_states(model), *_of_momenta(model, acting))


def _label_of(names: Sequence[str]) -> str:
    more = f" and {len(names) - SHOWN} more" if len(names) > SHOWN else ""
    return f"energy of {', '.join(names[:SHOWN])}{more}"


def elements(entries: Iterable[Entry]) -> tuple[EnergyAccount, ...]:
    """Entries of one statement, account and nest added up."""
    found: dict[tuple[str, int, int, str, str, Nest], list[Entry]] = {}
    for entry in entries:
        account = "stored" if entry.account in STORED else entry.account
        place = entry.place
        key = (account, place.span.start, place.span.end, place.file, place.element, entry.nest)
        found.setdefault(key, []).append(entry)
    made = (
        EnergyAccount(_account(own), key[-1], add(*(e.expression for e in own)), own[0].place)
        for key, own in found.items()
    )
    return tuple(e for e in made if not is_const(e.expression, 0.0))


def _account(entries: Sequence[Entry]) -> str:
    accounts = {entry.account for entry in entries}
    return accounts.pop() if len(accounts) == 1 else "stored"


def _varying(entry: Entry) -> Entry | None:
    """The entry without additive constants of what is stored; None where nothing is left.  Of a power none is left out:
    its integral grows.
    """
    pieces = summands(entry.expression)
    kept = add(*(piece for piece in pieces if entry.account not in STORED or variables(piece)))
    return None if is_const(kept, 0.0) else replace(entry, expression=kept)


def _parts(model: EnergyModel, entries: Sequence[Entry]) -> dict[str, str]:
    """The first coordinate of each coordinate's part."""
    parts = Joined[str]()

    def join(names: Sequence[str]) -> None:
        for name in names[1:]:
            parts.join(names[0], name)

    kinds = (model.mirror.coordinate, model.mirror.rate)
    # coordinates of one constraint exchange energy
    for row in model.rows:
        if row.kind in ("phi", "psi"):
            join([n.data[0] for t in row.terms for n in local_variables(t.expression, kinds)])
    statements: dict[tuple[int, int, str, str], list[str]] = {}
    # and those of one statement
    for entry in entries:
        place = entry.place
        owners = statements.setdefault((place.span.start, place.span.end, place.file, place.element), [])
        owners += entry.owners
    for owners in statements.values():
        join(owners)
    return {c.name: parts.first(c.name) for c in model.coordinates}


def _of_states(model: EnergyModel) -> Iterator[Ledger]:
    """Combinations of scalar dynamic variables whose rates add up to nothing, term by term."""
    rows = _single(model.of_kind("lambda"))
    states = {s.name: s for s in model.states}
    rates = {name: _coefficients(t.expression for t in row.terms) for name, row in rows.items()}
    for combination in _null_space(rates):
        entries = tuple(
            Entry("potential", (), (), scale(float(c), var(name, "s")), states[name].place)
            for name, c in combination.items()
        )
        if len(entries) > 1:
            unit = states[next(iter(combination))].units["s"]
            yield Ledger("invariant", unit, entries, tuple(combination), _sum(combination))


def _of_momenta(model: EnergyModel, acting: Iterable[Effort]) -> Iterator[Ledger]:
    """Combinations of momenta of scalar coordinates, of one unit, on which the efforts add up to nothing."""
    scalars = {c.name: c for c in model.coordinates if not c.shape}
    if len(scalars) > MOST:
        return
    found: dict[str, list[Effort]] = {name: [] for name in scalars}
    for effort in acting:
        found.setdefault(effort.on.data[0], []).append(effort)
    # efforts in loops are not added up symbolically
    free = [name for name in scalars if not any(e.nest or e.on.args for e in found[name])]
    # sums of unlike units mean nothing
    for unit in dict.fromkeys(scalars[name].units["p"] for name in free):
        alike = {n: _coefficients(e.value for e in found[n]) for n in free if scalars[n].units["p"] == unit}
        # combinations on which all efforts cancel: conserved momenta
        for combination in _null_space(alike):
            entries = [e for name, c in combination.items() for e in _momentum(model, scalars[name], float(c))]
            if not entries:
                continue
            passed: dict[Node | None, Fraction] = {}
            for name, c in combination.items():
                for node, factor in alike[name].items():
                    passed[node] = passed.get(node, Fraction(0)) + abs(c * factor)
            place = scalars[next(iter(combination))].place
            gross = [
                Entry("exchanged", (), (), scale(float(c), const(1.0) if node is None else node), place)
                for node, c in passed.items()
            ]
            moving = {name: combination[name] for name in alike if any(e.owners == (name,) for e in entries)}
            title = f"momentum of {_sum(moving)}"
            yield Ledger("invariant", unit, (*entries, *gross), tuple(moving), title)


def _momentum(model: EnergyModel, family: UnknownFamily, factor: float) -> Iterator[Entry]:
    """The summands of p + dT*/df: p of stores given by T(p)."""
    m = model.mirror
    own = [(t, n) for t in model.function(m.energy) for n in local_variables(t.expression, m.conjugate)]
    if any(n.data[0] == family.name for _, n in own):
        yield Entry("potential", (family.name,), (), scale(factor, var(family.name, m.conjugate)), family.place)
    for term in model.function(m.coenergy):
        for node in local_variables(term.expression, m.rate):
            if node.data[0] == family.name:
                for piece in summands(derivative(term.expression, node)):
                    yield Entry("potential", (family.name,), term.loops, scale(factor, piece), term.place)


def _sum(combination: Mapping[str, Fraction]) -> str:
    """A combination as text."""
    text = ""
    for name, c in combination.items():
        size = "" if abs(c) == 1 else f"{float(abs(c)):g}*"
        text += f"{' - ' if c < 0 else ' + ' if text else ''}{size}{name}"
    return text.strip()


def _single(rows: Sequence[Row]) -> dict[str, Row]:
    """Dynamics of scalars that are said once; none where they are too many."""
    counted: dict[str, list[Row]] = {}
    for row in rows:
        counted.setdefault(row.name, []).append(row)
    once = {name: found[0] for name, found in counted.items() if len(found) == 1 and not found[0].nest}
    single = {name: row for name, row in once.items() if all(not t.loops for t in row.terms)}
    return single if len(single) <= MOST else {}


def _coefficients(expressions: Iterable[Node]) -> dict[Node | None, Fraction]:
    """The sum as a combination of terms that hold no sums."""
    found: dict[Node | None, Fraction] = {}
    for expression in expressions:
        for piece in summands(expression):
            factor, node = (piece.data, None) if is_const(piece) else _split(piece)
            if not math.isfinite(factor):  # what the start says is no number: no part of a combination
                factor, node = 1.0, piece
            found[node] = found.get(node, Fraction(0)) + Fraction(factor)
    return {node: c for node, c in found.items() if c}


def _split(piece: Node) -> tuple[float, Node]:
    """Coefficient and node of one summand."""
    if piece.op == "sum" and piece.data[0] == 0.0 and len(piece.args) == 1:
        return piece.data[1][0], piece.args[0]
    return 1.0, piece


def _null_space(rows: Mapping[str, dict[Node | None, Fraction]]) -> list[dict[str, Fraction]]:
    """Combinations c of sparse rows with sum c_i rows_i = 0, by elimination in exact numbers."""
    pivots: list[tuple[Node | None, dict[Node | None, Fraction], dict[str, Fraction]]] = []
    found: list[dict[str, Fraction]] = []
    for name, row in rows.items():
        left, weights = dict(row), {name: Fraction(1)}
        for column, values, combination in pivots:
            if column in left:
                factor = left[column] / values[column]
                left, weights = _less(left, factor, values), _less(weights, factor, combination)
        if left:
            pivots.append((next(iter(left)), left, weights))
        else:
            found.append(weights)
    return found


def _less(left: Mapping[K, Fraction], factor: Fraction, right: Mapping[K, Fraction]) -> dict[K, Fraction]:
    """Left - factor right, without zeros."""
    result = {**left, **{k: left.get(k, Fraction(0)) - factor * c for k, c in right.items()}}
    return {k: c for k, c in result.items() if c}
