"""A network as text, for `--dump network`, `reflected` and `coordinates`."""

from __future__ import annotations

from collections.abc import Iterator

from sysdyn.dsl.model.expression import Node
from sysdyn.dsl.model.network import Branch, Coupling, Loop, Network, Shape, Terminal
from sysdyn.dsl.model.units import si_text


def show(network: Network) -> str:
    """One line a statement, in SI units, loops behind."""
    return "\n".join(_lines(network)) + "\n"


def _lines(n: Network) -> Iterator[str]:
    """A line for each statement of the network, in the order in which it holds them."""
    scene = f" under scene {n.scene.name}" if n.scene else ""
    yield f"model {n.model}{scene}"
    for p in n.parameters:
        values = ", ".join(map(str, p.values)) or "no value"
        yield f"  param {p.name}{_shape(p.shape)} = {values} [{si_text(p.unit.dimension)}]"
    for t in n.tables:
        yield f"  table {t.name}: {len(t.values)} values, {t.method}, {t.outside}"
    for node in n.nodes:
        yield f"  node {node.name}{_shape(node.shape)}: {node.domain.name}, common {node.domain.common}"
    for b in n.branches:
        yield f"  {_branch(b)}{_loops(b.loops)}"
    for two in n.couplings:
        yield f"  {_coupling(two)}{_loops(two.loops)}"
    for s in n.elements:
        yield f"  set {s.name}[{', '.join(map(str, s.at))}] = {s.value}"
    for c in n.coordinates:
        yield f"  {'cocoord' if c.complementary else 'coord'} {c.name}{_shape(c.shape)} [{c.displacement.text}]"
    for u in n.unknowns:
        yield f"  implicit {u.name}{_shape(u.shape)} [{u.unit.text}]"
    for s_ in n.states:
        yield f"  state {s_.name}{_shape(s_.shape)} [{s_.unit.text}]"
    for e in n.energies:
        yield f"  {e.function} += {e.expression}{_loops(e.loops)}"
    for w in n.works:
        yield f"  work {w.effort} on {w.on}{_loops(w.loops)}"
    for k in n.constraints:
        at = f"[{', '.join(map(str, k.at))}]" if k.at else ""
        yield f"  {k.kind} {k.name}{at}: {k.expression} {'added' if k.adds else '= 0'}{_loops(k.loops)}"
    for d in n.dynamics:
        yield f"  dynamic {d.state}' = {d.expression}{_loops(d.loops)}"
    for i in n.initials:
        yield f"  init {i.target} {'=' if i.fixed else '~'} {i.value}{_loops(i.loops)}"
    for o in n.observations:
        yield f"  trace {o.name} = {o.expression} [{o.unit.text}]"
    for x in (*n.expectations, *n.statics):
        yield f"  {x.text}"


def _branch(b: Branch) -> str:
    ends = f"on {b.on}" if b.on is not None else f"{_terminal(b, b.plus)} -> {_terminal(b, b.minus)}"
    name = b.name + _index_text(b.at)
    law = "" if b.law is None else f": {name}.{b.side} = {b.law}"
    return f"{b.kind} {name} {ends}{law}"


def _terminal(b: Branch, end: Terminal | None) -> str:
    if end is None or end.node is None:
        return f"ground of {b.domain.name}"
    return end.node + _index_text(end.at)


def _coupling(c: Coupling) -> str:
    first, second = c.first + _index_text(c.at), c.second + _index_text(c.at)
    return f"{c.kind} {first}.{c.side} = ({c.ratio})*{second}.{c.read}"


def _index_text(at: tuple[Node, ...]) -> str:
    return f"[{', '.join(map(str, at))}]" if at else ""


def _shape(shape: Shape) -> str:
    return f"[{', '.join(f'{a}..{b}' for a, b in shape)}]" if shape else ""


def _loops(loops: tuple[Loop, ...]) -> str:
    return "".join(f" for {loop.index} in {loop.first}..{loop.last}" for loop in loops)
