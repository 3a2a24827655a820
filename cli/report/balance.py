"""Energy balance by element: what each stored, dissipated and supplied over the run.

Elements: the integral of e f of each branch.  Statements: T*, T, V, V* by their value at start and end (T of T* by
f.dT*/df - T*), content by f.dD/df, work by effort times the rate of its displacement.  Families are summed.  The powers
are integrated by the solver in a run of their own.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np
from sysdyn.cli.page.document import escape, table
from sysdyn.compiler.model.energies import flows
from sysdyn.compiler.model.terms import canonical, local_variables, split, terms
from sysdyn.dsl.model import dimensions as dim
from sysdyn.dsl.model.calculus import differential, rate
from sysdyn.dsl.model.expression import Node, add, const, index, mul, neg, sub, substitute, var
from sysdyn.dsl.model.network import (
    Branch,
    Dynamic,
    EnergyTerm,
    InitialCondition,
    Loop,
    Network,
    Observation,
    State,
    VirtualWork,
)
from sysdyn.dsl.model.rewriting import sum_over_loops
from sysdyn.dsl.model.units import si
from sysdyn.dsl.text.diagnostics import ModelError, Place
from sysdyn.runtime.trace.trace import Trace
from sysdyn.values import dataclass

MOST = 400
"""Elements and statements whose power is observed."""
ROLES = {"kinetic": "held", "potential": "held", "dissipator": "out", "effort": "in", "flow": "in", "port": "through"}
WORDS = {"held": "stored", "out": "dissipated", "in": "supplied", "through": "passed on"}
"""Of roles, for a reader."""
_RATES = {"T*": ("f", "nf", "bf"), "D": ("f", "nf", "bf"), "V*": ("f", "ne", "be"), "G": ("f", "ne", "be")}
_KINDS = ("q", "f", "p", "e")
REST = 1e-6
"""Of the largest energy: what is left below that is round-off and the solver's error."""


@dataclass(frozen=True, slots=True)
class BalancePart:
    """An element or statement.  name: of its observation; power: expression is integrated, else an energy; domain: of
    the branch, or of the first coordinate that a statement reads.
    """

    name: str
    label: str
    role: str  # held out in through
    power: bool
    expression: Node
    place: Place
    domain: str

    @property
    def branch(self) -> str:
        """Name of the branch; "" of a statement (the number behind its kind stands apart)."""
        name = self.name.removeprefix("power of ")
        return "" if " " in name else name


@dataclass(frozen=True, slots=True)
class Share:
    """Energy in J of an element over the run: held: change of what is stored, out: dissipated, in: supplied, through:
    absorbed by one side of a coupling.
    """

    label: str
    role: str
    energy: float
    place: Place | None


def add_observations(network: Network) -> tuple[Network, tuple[BalancePart, ...]]:
    """The network with a quadrature and an observation of each part; what cannot be written is left out."""
    parts: list[BalancePart] = []
    for found in (*_of_branches(network.branches), *_of_statements(network)):
        parts += found
        if len(parts) > MOST:
            return network, ()
    unit = si(dim.ENERGY)
    states, dynamics, initials, extra = [], [], [], []
    # a power is integrated by a state, an energy is observed as it is
    for part in parts:
        value = part.expression
        if part.power:
            states.append(State(part.name, (), unit, part.place))
            value = var(part.name, "s")
            dynamics.append(Dynamic(value, part.expression, (), part.place))
            initials.append(InitialCondition(value, const(0.0), True, (), part.place))
        extra.append(Observation(part.name, value, unit, part.label, part.place))
    richer = replace(
        network,
        states=(*network.states, *states),
        dynamics=(*network.dynamics, *dynamics),
        initials=(*network.initials, *initials),
        observations=(*network.observations, *extra),
        expectations=(),
        statics=(),
        goldens=(),
    )
    return richer, tuple(parts)


def shares(trace: Trace, parts: Sequence[BalancePart]) -> tuple[Share, ...]:
    """The energies of a run."""
    found = []
    if not trace.time.size:
        return ()
    for part in parts:
        first, last = trace[part.name].values[[0, -1]]
        found.append(
            Share(part.label, part.role, float(first - last if part.role == "in" else last - first), part.place)
        )
    return (*found, *_of_jumps(trace, parts))


def _of_jumps(trace: Trace, parts: Sequence[BalancePart]) -> Iterator[Share]:
    """What is stored less, and more, behind the instants that stand twice: impacts, and what events assign."""
    held = [trace[part.name].values for part in parts if part.role == "held"]
    if not held:
        return
    gained = np.sum([np.diff(values) for values in held], axis=0)[np.diff(trace.time) == 0.0]
    for role, energy in (("out", -gained[gained < 0.0].sum()), ("in", gained[gained > 0.0].sum())):
        if energy > REST * max(np.abs(values).max() for values in held):
            yield Share("impacts and events", role, float(energy), None)


def _of_branches(branches: Sequence[Branch]) -> Iterator[list[BalancePart]]:
    """One part a family of branches (its pieces added)."""
    families: dict[str, list[Branch]] = {}
    for branch in branches:
        families.setdefault(branch.name, []).append(branch)
    for name, pieces in families.items():
        first = pieces[0]
        if first.kind not in ROLES or first.domain.pseudo:
            continue
        power = [
            sum_over_loops(mul(var(b.name, "be", *b.at), var(b.name, "bf", *b.at)), b.loops)
            for b in pieces
            if b.kind in ROLES
        ]
        label = f"{author_name(name)}{_ranges(pieces)}"
        yield [
            BalancePart(f"power of {name}", label, ROLES[first.kind], True, add(*power), first.place, first.domain.name)
        ]


def author_name(name: str) -> str:
    """The name of a branch as an author knows it: `emf#2` is side 2 of emf."""
    own, _, side = name.partition("#")
    return f"{own}, side {side}" if side else own


def _ranges(pieces: Sequence[Branch]) -> str:
    """The indices of a family in brackets, but for those that its name holds (of one of several statements)."""
    first = pieces[0]
    named = sum(part.count(",") + 1 for part in re.findall(r"\[([^\]]*)\]", first.name))
    loops = {loop.index: f"{loop.first}..{loop.last}" for loop in first.loops}
    own = [loops.get(at.data, str(at)) if at.op == "index" else str(at) for at in first.at[named:]]
    return f"[{'…' if len(pieces) > 1 else ', '.join(own)}]" if own else ""


def _of_statements(network: Network) -> Iterator[list[BalancePart]]:
    """Parts of energies and works, named by their line; those whose power cannot be written are left out."""
    counts: dict[str, int] = {}
    domains = {c.name: c.domain.name for c in network.coordinates if c.domain is not None}
    statements: tuple[EnergyTerm | VirtualWork, ...] = (*network.energies, *network.works)
    for statement in statements:
        kind = statement.function if isinstance(statement, EnergyTerm) else "work"
        counts[kind] = counts.get(kind, 0) + 1
        label = f"{kind} (line {statement.place.start[0]})"
        try:
            role, power, value = _measure(statement)
        # that statement is missing from the balance, not the page
        except (ModelError, ValueError):  # a product over a range has no derivative here
            continue
        domain = next((domains[n.data[0]] for n in local_variables(value, _KINDS) if n.data[0] in domains), "")
        yield [BalancePart(f"power of {kind} {counts[kind]}", label, role, power, value, statement.place, domain)]


def _measure(statement: EnergyTerm | VirtualWork) -> tuple[str, bool, Node]:
    """Role, whether it is a power, and the expression."""
    if isinstance(statement, VirtualWork):
        return "in", True, neg(_work(statement))
    if statement.function in ("D", "G"):
        return "out", True, _content(statement)
    return "held", False, _stored_energy(statement)


def _sum_with_own_names(loops: Sequence[Loop], body: Node) -> Node:
    """A sum over canonical loops, whose variables get names of their own."""
    change = {index(loop.index): index(f"of{loop.index}") for loop in loops}
    renamed = [Loop(f"of{loop.index}", substitute(loop.first, change), substitute(loop.last, change)) for loop in loops]
    return sum_over_loops(substitute(body, change), renamed)


def _along(expression: Node, kinds: Sequence[str]) -> Node:
    """The sum of f d/df, elements under sums within functions among them."""
    return differential(expression, {f: f for f in local_variables(expression, kinds)})


def _stored_energy(statement: EnergyTerm) -> Node:
    pieces = []
    for term in terms(flows(statement.expression), statement.loops, statement.place):
        kinds = _RATES.get(statement.function)
        value = term.expression if kinds is None else sub(_along(term.expression, kinds), term.expression)
        pieces.append(_sum_with_own_names(term.loops, value))
    return add(*pieces)


def _content(statement: EnergyTerm) -> Node:
    found = terms(flows(statement.expression), statement.loops, statement.place)
    return add(*(_sum_with_own_names(t.loops, _along(t.expression, _RATES[statement.function])) for t in found))


def _work(statement: VirtualWork) -> Node:
    nest, (effort, on) = canonical(statement.loops, flows(statement.effort), flows(statement.on))
    pieces = []
    for term in split(on, nest, statement.place):
        moving = local_variables(term.expression, ("q", "nq", "bq"))
        speed = differential(term.expression, {q: r for q in moving if (r := rate(q)) is not None})
        pieces.append(_sum_with_own_names(term.loops[len(nest) :], speed))
    return _sum_with_own_names(nest, mul(effort, add(*pieces)))


# ---- the section


def section(found: Sequence[Share] | None, link: Sequence[str], balance: float) -> str:
    """Bars and a table.  link: labels of the shares as HTML; balance: audit.energy at the end, J."""
    if not found:
        why = "there is no power in it, or its run failed or took long"
        return f'<p class="soft">The energies of the elements were not measured: {why}.</p>'
    rows = []
    # a share stands in the column of its role
    for share, label in zip(found, link, strict=True):
        rows.append([label, *(joules(share.energy) if share.role == c else "" for c in WORDS)])
    sums = {c: sum(s.energy for s in found if s.role == c) for c in WORDS}
    rest = sums["held"] + sums["out"] - sums["in"]
    # what no element accounts for, beyond the errors of integration
    if abs(rest) > max(REST * max(abs(s.energy) for s in found), 10.0 * abs(balance)):
        rows.append(["constraints and statements that move in time", "", "", joules(rest), ""])
        sums["in"] += rest
    rows.append(["<b>sum</b>", *(f"<b>{joules(sums[c])}</b>" if c != "through" else "" for c in WORDS)])
    heads = ["element or statement", *(f"{word} [J]" for word in WORDS.values())]
    line = f'<p class="soft">Stored + dissipated − supplied over the run: {joules(balance)} J (audit.energy).'
    if any(s.role == "through" for s in found):
        line += " A coupling passes on what its first side absorbs: its sides add up to nothing."
    return _bars(found) + table(heads, rows, left=(0,)) + line + "</p>"


def joules(value: float) -> str:
    """An energy to four digits."""
    return "–" if not np.isfinite(value) else f"{value:.4g}".replace("-", "−")


def _bars(parts: Sequence[Share]) -> str:
    """The largest as bars about zero."""
    # the largest, in either direction
    drawn = sorted((p for p in parts if p.role != "through" and np.isfinite(p.energy)), key=lambda p: -abs(p.energy))
    drawn = [p for p in drawn[:24] if abs(p.energy) > 0.0]
    if not drawn:
        return ""
    low, high = min(0.0, *(p.energy for p in drawn)), max(0.0, *(p.energy for p in drawn))
    wide, left, step = 460.0, 190.0, 20
    scale = wide / (high - low)
    zero = left - low * scale
    height = step * len(drawn) + 8
    body = []
    # a bar about zero, its name on the left and its number at its end
    for k, p in enumerate(drawn):
        x, w = zero + min(p.energy, 0.0) * scale, max(abs(p.energy) * scale, 0.5)
        y = 4 + step * k
        body.append(f'<text x="{left - 8:.0f}" y="{y + 13}" text-anchor="end">{escape(_short(p.label))}</text>')
        body.append(f'<rect class="{p.role}" x="{x:.1f}" y="{y + 3}" width="{w:.1f}" height="{step - 7}"/>')
        end = x + w if p.energy >= 0 else max(zero, x + w)
        body.append(f'<text x="{end + 5:.1f}" y="{y + 13}">{joules(p.energy)} J</text>')
    body.append(f'<line class="axis" x1="{zero:.1f}" x2="{zero:.1f}" y1="0" y2="{height}"/>')
    key = (("held", "stored", "--ref"), ("out", "dissipated", "--bad"), ("in", "supplied", "--good"))
    legend = "".join(f'<span><i style="background:var({c})"></i>{word}</span>' for _, word, c in key)
    size = f'viewBox="0 0 780 {height}" width="780" height="{height}"'
    svg = f'<svg class="bars" {size} role="img">{"".join(body)}</svg>'
    return f'<div class="wide">{svg}</div><p class="legend">{legend}</p>'


def _short(label: str) -> str:
    return label if len(label) <= 28 else f"{label[:27]}…"
