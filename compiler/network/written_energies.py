"""Written energies and contents as the elements that they are.

An energy over one node, over the difference of two, or over branches without a law stands for laws (Paynter's diagram):

    V(q) e = dV/dq      T*(f) p = dT*/df      D(f) e = dD/df
    T(p) f = dT/dp      V*(e) q = dV*/de      G(e) f = dG/de

The primal family lowers V, T* and D over nodes and over several branches as they stand, so there only functions of the
other three become elements, and those of one branch; the reflection needs all of them.  An energy over several branches
gives each of them a law that reads the others, and is kept for the audit: each port keeps its own q or p (language,
section 11, 16).
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable
from dataclasses import replace

from sysdyn.compiler.model.terms import summands, vanishes
from sysdyn.dsl.model import expression as ex
from sysdyn.dsl.model.calculus import derivative
from sysdyn.dsl.model.expression import Node
from sysdyn.dsl.model.network import Branch, Domain, EnergyTerm, Network, Terminal, loop_indices
from sysdyn.dsl.model.paynter import STATE_FUNCTIONS, StateFunction

ALL = frozenset(STATE_FUNCTIONS)
FOREIGN = frozenset(("T", "V*", "G"))
"""Functions of variables that the primal family does not have as unknowns of nodes and branches."""
_AT_NODES = {"V": "nq", "T*": "nf", "D": "nf", "T": "np", "V*": "ne", "G": "ne"}
_QUANTITIES = ("be", "bf", "bq", "bp")


def as_elements(network: Network, functions: frozenset[str]) -> Network:
    """The network with the written state functions of those names as branches, as far as they are such."""
    if not network.nodes and not network.branches:
        return network
    network = _on_branches(network, functions)
    if functions == FOREIGN:  # momenta of points are unknowns of the primal family
        functions = functions - {"T"}
    nodes = {n.name: n.domain for n in network.nodes}
    kept, made = [], []
    # summand by summand, or else the whole: an element each, or the statement stays
    for number, energy in enumerate(network.energies):
        for pieces in (summands(energy.expression), [energy.expression]) if energy.function in functions else ():
            names = [f"{energy.function} {number}.{k}" for k in range(len(pieces))]
            found = [element(energy, piece, name, nodes) for piece, name in zip(pieces, names, strict=True)]
            branches = [b for b in found if b is not None]
            if len(branches) == len(pieces):
                made += branches
                break
        else:
            kept.append(energy)
    network = replace(network, energies=tuple(kept), branches=(*network.branches, *made))
    return _with_sources(network, nodes) if functions == ALL else network


def _with_sources(network: Network, nodes: dict[str, Domain]) -> Network:
    """Works along one point, or from one to another, as sources of effort: deltaW = E delta(q(a) - q(b))."""
    kept, made = [], []
    for number, work in enumerate(network.works):
        ends = _ends(work.on)
        if ends is None or any(n.op == "var" and n.data[1] in ("nq", "bq") for n in ex.variables(work.effort)):
            kept.append(work)
            continue
        domain, at = nodes[next(end.node for end in ends if end.node is not None)], loop_indices(work.loops)
        name = f"work {number}"
        made.append(Branch(name, at, work.loops, domain, "effort", "e", work.effort, *ends, None, work.place))
    return replace(network, works=tuple(kept), branches=(*network.branches, *made))


def _ends(on: Node) -> tuple[Terminal, Terminal] | None:
    """(b, a) of a displacement q(a) - q(b) of points, the ground where one is missing; None of any other."""
    ends = {1.0: Terminal(None, ()), -1.0: Terminal(None, ())}
    points = [n for n in ex.variables(on) if n.op == "var"]
    signs = {n: derivative(on, n) for n in points}
    for n, sign in signs.items():
        if n.data[1:] != ("nq", 0) or sign.op != "const" or ends.get(sign.data) != Terminal(None, ()):
            return None
        ends[sign.data] = Terminal(n.data[0], n.args)
    whole = ex.substitute(on, {n: ex.const(0.0) for n in points})
    return (ends[-1.0], ends[1.0]) if points and ex.is_const(whole, 0.0) else None


def element(energy: EnergyTerm, piece: Node, name: str, nodes: dict[str, Domain]) -> Branch | None:
    """The branch whose law is the slope of an energy over u = x(a) - x(b), or None."""
    function = STATE_FUNCTIONS[energy.function]
    used = sorted(
        (n for n in ex.variables(piece) if n.op == "var" and not _is_parameter(n, function)), key=lambda n: n.number
    )
    if not 1 <= len(used) <= 2 or any(n.data[1] != _AT_NODES[function.name] or n.data[2] for n in used):
        return None
    a, b = used[0], used[1] if len(used) == 2 else None
    slope = derivative(piece, a)
    if b is not None and (function.name == "T" or not vanishes(slope, derivative(piece, b))):
        return None
    at = loop_indices(energy.loops)
    own = ex.var(name, f"b{function.own}", *at)
    law = ex.substitute(slope, {a: own} if b is None else {a: own, b: ex.const(0.0)})
    minus = Terminal(None, ()) if b is None else Terminal(b.data[0], b.args)
    plus = Terminal(a.data[0], a.args)
    domain = nodes[a.data[0]]
    side = function.conjugate
    return Branch(name, at, energy.loops, domain, function.edge, side, law, plus, minus, None, energy.place)


# -- over branches without a law ---------------------------------------------------------------------------


def _on_branches(network: Network, functions: frozenset[str]) -> Network:
    """Branches without a law whose only statements are state functions of one name, with the laws that these give."""
    fields = {b.name: b for b in network.branches if b.kind == "field"}
    said = _statements(network, fields)
    chosen = [
        e
        for e in network.energies
        if _over_fields(e, fields, said) and (e.function in functions or len(ex.variables(e.expression)) == 1)
    ]
    chosen = _closed_statements(network, chosen, fields, said)
    if not chosen:
        return network
    rest, chosen = [e for e in network.energies if e not in chosen], _merge_by_branches(chosen)
    laws: dict[str, Branch] = {}
    for name in dict.fromkeys(n for e in chosen for n in _owners(e)):
        laws[name] = _with_law(fields[name], [e for e in chosen if name in _owners(e)])
    several = [e for e in chosen if any(laws[name].stated for name in _owners(e))]
    return replace(
        network,
        branches=tuple(laws.get(b.name, b) for b in network.branches),
        energies=(*rest, *(_stored_function(e) for e in several if _is_store(e))),
    )


def _is_store(energy: EnergyTerm) -> bool:
    return STATE_FUNCTIONS[energy.function].edge != "dissipator"


def _is_parameter(node: Node, function: StateFunction) -> bool:
    """Whether an unknown stands in a state function as a parameter: signals, and in contents what gammas close."""
    return node.data[1] == "s" or (node.data[1] == "e" and function.edge == "dissipator")


def _owners(energy: EnergyTerm) -> list[str]:
    """The branches that an energy reads."""
    return list(dict.fromkeys(n.data[0] for n in _read(energy.expression)))


def _read(root: Node) -> list[Node]:
    found = (n for n in ex.variables(root) if n.op == "var" and n.data[1] in _QUANTITIES)
    return sorted(found, key=lambda n: n.number)


def _statements(network: Network, fields: dict[str, Branch]) -> dict[str, set[str]]:
    """What is said of each branch: names of state functions, and `other` for works and constraints."""
    said: dict[str, set[str]] = {name: set() for name in fields}
    roots: list[tuple[str, Node]] = [(e.function, e.expression) for e in network.energies]
    roots += [("other", n) for w in network.works for n in (w.on,)]
    roots += [("other", c.expression) for c in network.constraints if c.kind != "gamma"]
    for what, root in roots:
        for node in _read(root):
            if node.data[0] in said:
                said[node.data[0]].add(what)
    return said


def _over_fields(energy: EnergyTerm, fields: dict[str, Branch], said: dict[str, set[str]]) -> bool:
    """Whether an energy is a function of own variables of branches without a law, each at its own indices."""
    function = STATE_FUNCTIONS[energy.function]
    unknowns = [n for n in ex.variables(energy.expression) if n.op == "var" and not _is_parameter(n, function)]
    if not unknowns or any(n.data[1:] != (f"b{function.own}", 0) or n.data[0] not in fields for n in unknowns):
        return False
    branches = [fields[n.data[0]] for n in unknowns]
    placed = all(b.at == n.args and b.loops == energy.loops for b, n in zip(branches, unknowns, strict=True))
    return placed and all(said[b.name] == {function.name} for b in branches)


def _closed_statements(
    network: Network, chosen: Iterable[EnergyTerm], fields: dict[str, Branch], said: dict[str, set[str]]
) -> list[EnergyTerm]:
    """Statements all of whose branches stand in such statements only."""
    kept, written = list(chosen), Counter(n for e in network.energies for n in _owners(e))
    while True:
        count = Counter(n for e in kept for n in _owners(e))
        whole = {name for name in fields if len(said[name]) == 1 and count[name] == written[name]}
        rest = [e for e in kept if set(_owners(e)) <= whole]
        if len(rest) == len(kept):
            return kept
        kept = rest


def _merge_by_branches(energies: Iterable[EnergyTerm]) -> list[EnergyTerm]:
    """Those that share branches as one sum each: what these hold is its transform."""
    found: list[EnergyTerm] = []
    for e in energies:
        shared = [other for other in found if set(_owners(other)) & set(_owners(e))]
        whole = replace(e, expression=ex.add(*(other.expression for other in shared), e.expression))
        found = [*(other for other in found if other not in shared), replace(whole, place=(*shared, e)[0].place)]
    return found


def _with_law(branch: Branch, energies: list[EnergyTerm]) -> Branch:
    """The branch with the slope of its energies as law."""
    function = STATE_FUNCTIONS[energies[0].function]
    own = ex.var(branch.name, f"b{function.own}", *branch.at)
    law = ex.add(*(derivative(e.expression, own) for e in energies))
    stated = any(len(_owners(e)) > 1 for e in energies)
    energy = None if stated else ex.add(*(e.expression for e in energies))
    return replace(branch, kind=function.edge, side=function.conjugate, law=law, stated=stated, energy=energy)


def _stored_function(energy: EnergyTerm) -> EnergyTerm:
    """What stores of several branches hold: T or V, also where their transform is written."""
    function = STATE_FUNCTIONS[energy.function]
    held = energy.expression
    if function.name in ("T*", "V*"):
        products = [ex.mul(n, ex.var(n.data[0], f"b{function.conjugate}", *n.args)) for n in _read(energy.expression)]
        held = ex.sub(ex.add(*products), held)
    return replace(energy, function=f"kept {function.edge}", expression=held)
