"""A network as text, for `--dump network`."""

from __future__ import annotations

from collections.abc import Iterator

from sysdyn.dsl.model.network import Loop, Network, Shape


def show(network: Network) -> str:
    """One line a statement, in SI units, loops behind."""
    return "\n".join(_lines(network)) + "\n"


def _lines(n: Network) -> Iterator[str]:
    scene = f" under scene {n.scene.name}" if n.scene else ""
    yield f"model {n.model}{scene}"
    for p in n.parameters:
        values = ", ".join(map(str, p.values)) or "no value"
        yield f"  param {p.name}{_shape(p.shape)} = {values} [{p.unit.text}]"
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
        yield f"  {k.kind} {k.name}{at}: {k.expression} = 0{_loops(k.loops)}"
    for d in n.dynamics:
        yield f"  dynamic {d.state}' = {d.expression}{_loops(d.loops)}"
    for i in n.initials:
        yield f"  init {i.target} {'=' if i.fixed else '~'} {i.value}{_loops(i.loops)}"
    for o in n.observations:
        yield f"  trace {o.name} = {o.expression} [{o.unit.text}]"


def _shape(shape: Shape) -> str:
    return f"[{', '.join(f'{a}..{b}' for a, b in shape)}]" if shape else ""


def _loops(loops: tuple[Loop, ...]) -> str:
    return "".join(f" for {loop.index} in {loop.first}..{loop.last}" for loop in loops)
