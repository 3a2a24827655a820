"""Ledgers: for each connected part of a model, what its elements store, dissipate and are supplied with.

Coordinates are of one part where an energy, a content, the displacement of a work or a constraint reads both; works of
one statement (a gyrator's) join theirs.  A part's ledger is in joules, or in what effort times displacement is in a
pseudo domain.  A linear combination of dynamic variables whose rate vanishes identically is a ledger too: of what
nobody dissipates or supplies (kind `invariant`).

Received: an EnergyModel and the audit's entries.  Returned: ledgers, each with its own entries.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction

from sysdyn.compiler.model.energies import EnergyModel, Row
from sysdyn.compiler.model.terms import Nest, local_variables, summands
from sysdyn.dsl.model.expression import Node, add, is_const, scale, var, variables
from sysdyn.dsl.text.diagnostics import Place

MOST_STATES = 200
"""Dynamic variables among which linear invariants are sought."""
STORED, POWERS = ("kinetic", "potential"), ("dissipated", "supplied")


@dataclass(frozen=True, slots=True)
class Entry:
    """One term of the audit.  account: kinetic, potential (stored), dissipated, supplied; owners: the coordinates
    whose part it belongs to.
    """

    account: str
    owners: tuple[str, ...]
    nest: Nest
    expression: Node
    place: Place


@dataclass(frozen=True, slots=True)
class Element:
    """What one statement stores, dissipates or is supplied with, for all iterations of a nest.  account: as of its
    entries, `stored` where these are kinetic and potential.
    """

    account: str
    nest: Nest
    expression: Node
    place: Place


@dataclass(frozen=True, slots=True)
class Ledger:
    """The entries of one part.  kind: energy or invariant; unit of what is stored; names: coordinates or states."""

    kind: str
    unit: str
    entries: tuple[Entry, ...]
    names: tuple[str, ...]

    def label(self, element: Element) -> str:
        """A name for an element that no component or branch names: the unknown that it reads first."""
        nodes = [n for n in variables(element.expression) if n.op == "var" and n.data[0] in self.names]
        rates = [n for n in nodes if n.data[1] in ("f", "p")]
        found = min(rates or nodes, key=lambda n: n.number, default=None)
        return self.names[0] if found is None else str(found.data[0])


def ledgers(model: EnergyModel, entries: Sequence[Entry]) -> tuple[Ledger, ...]:
    """The ledgers of all parts that have stores, dissipators or sources, then the linear invariants of states."""
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
    parts = [Ledger("energy", units[first], tuple(own), tuple(members[first])) for first, own in found.items()]
    return (*parts, *_invariants(model))


def elements(entries: Iterable[Entry]) -> tuple[Element, ...]:
    """Entries of one statement, account and nest added up."""
    found: dict[tuple[str, int, int, str, str, Nest], list[Entry]] = {}
    for entry in entries:
        account = "stored" if entry.account in STORED else entry.account
        place = entry.place
        key = (account, place.span.start, place.span.end, place.file, place.element, entry.nest)
        found.setdefault(key, []).append(entry)
    made = (
        Element(_account(own), key[-1], add(*(e.expression for e in own)), own[0].place) for key, own in found.items()
    )
    return tuple(e for e in made if not is_const(e.expression))


def _account(entries: Sequence[Entry]) -> str:
    accounts = {entry.account for entry in entries}
    return accounts.pop() if len(accounts) == 1 else "stored"


def _varying(entry: Entry) -> Entry | None:
    """The entry without additive constants; None where nothing is left."""
    kept = add(*(piece for piece in summands(entry.expression) if variables(piece)))
    return None if is_const(kept) else replace(entry, expression=kept)


def _parts(model: EnergyModel, entries: Sequence[Entry]) -> dict[str, str]:
    """The first coordinate of each coordinate's part."""
    head = {c.name: c.name for c in model.coordinates}

    def find(name: str) -> str:
        while head[name] != name:
            head[name] = head[head[name]]
            name = head[name]
        return name

    def join(names: Sequence[str]) -> None:
        for name in names[1:]:
            head[find(name)] = find(names[0])

    kinds = (model.mirror.coordinate, model.mirror.rate)
    for row in model.rows:
        if row.kind in ("phi", "psi"):
            join([n.data[0] for t in row.terms for n in local_variables(t.expression, kinds)])
    statements: dict[tuple[int, int, str, str], list[str]] = {}
    for entry in entries:
        place = entry.place
        owners = statements.setdefault((place.span.start, place.span.end, place.file, place.element), [])
        owners += entry.owners
    for owners in statements.values():
        join(owners)
    return {name: find(name) for name in head}


def _invariants(model: EnergyModel) -> tuple[Ledger, ...]:
    """Linear combinations of scalar dynamic variables whose rates add up to nothing, term by term."""
    rows = _single(model.of_kind("lambda"))
    names = list(rows)
    places = {s.name: s.place for s in model.states}
    units = {s.name: s.units["s"] for s in model.states}
    found = []
    for combination in _null_space([_coefficients(rows[name]) for name in names]):
        entries = tuple(
            Entry("potential", (), (), scale(float(c), var(name, "s")), places[name])
            for name, c in zip(names, combination, strict=True)
            if c
        )
        own = tuple(name for name, c in zip(names, combination, strict=True) if c)
        if len(entries) > 1:
            found.append(Ledger("invariant", units[own[0]], entries, own))
    return tuple(found)


def _single(rows: Sequence[Row]) -> dict[str, Row]:
    """Dynamics of scalars that are said once; none where they are too many."""
    counted: dict[str, list[Row]] = {}
    for row in rows:
        counted.setdefault(row.name, []).append(row)
    once = {name: found[0] for name, found in counted.items() if len(found) == 1 and not found[0].nest}
    single = {name: row for name, row in once.items() if all(not t.loops for t in row.terms)}
    return single if len(single) <= MOST_STATES else {}


def _coefficients(row: Row) -> dict[Node | None, Fraction]:
    """The rate as a combination of terms that hold no sums."""
    found: dict[Node | None, Fraction] = {}
    for term in row.terms:
        for piece in summands(term.expression):
            factor, node = (piece.data, None) if is_const(piece) else _split(piece)
            found[node] = found.get(node, Fraction(0)) + Fraction(factor)
    return {node: c for node, c in found.items() if c}


def _split(piece: Node) -> tuple[float, Node]:
    """Coefficient and node of one summand."""
    if piece.op == "sum" and piece.data[0] == 0.0 and len(piece.args) == 1:
        return piece.data[1][0], piece.args[0]
    return 1.0, piece


def _null_space(rows: Sequence[dict[Node | None, Fraction]]) -> list[list[Fraction]]:
    """Combinations c of sparse rows with sum c_i rows_i = 0, by elimination in exact numbers."""
    size = len(rows)
    pivots: list[tuple[Node | None, dict[Node | None, Fraction], list[Fraction]]] = []
    found: list[list[Fraction]] = []
    for k, row in enumerate(rows):
        left = dict(row)
        weights = [Fraction(int(i == k)) for i in range(size)]
        for column, values, combination in pivots:
            factor = left.get(column, Fraction(0))
            if factor:
                factor /= values[column]
                for node, value in values.items():
                    left[node] = left.get(node, Fraction(0)) - factor * value
                left = {node: value for node, value in left.items() if value}
                weights = [a - factor * b for a, b in zip(weights, combination, strict=True)]
        if left:
            pivots.append((next(iter(left)), left, weights))
        elif any(weights):
            found.append(weights)
    return found
