"""The network as a picture: nodes, elements with their ports, what is read across; families of arrays once.

Network style: a box a family of elements, a dot a family of nodes, grounds where they are used.  Coordinate style: a
dot a coordinate (or unknown, or state), a box a statement that ties them.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field

from sysdyn.cli.page.document import escape
from sysdyn.cli.page.panels import COLOURS
from sysdyn.cli.report.layout import places
from sysdyn.cli.report.report_study import ReportStudy
from sysdyn.dsl.model.expression import Node, topological
from sysdyn.dsl.model.network import Branch, Loop, Shape, Terminal
from sysdyn.dsl.text.diagnostics import Place

MOST = 250
"""Boxes of a picture that can be read."""
STEP, UNIT = 108.0, 50.0
"""Pixels between layers, and of one unit of a layer's length."""
BOX = 86.0
FITS = {"label": 10, "small": 15}
"""Letters that fit into a box as they are; more are drawn together."""
WIDE = 1500.0
"""Pixels from which a picture is scrolled, not shrunk."""
_SIGNS = {
    "kinetic": "p–f",
    "potential": "q–e",
    "dissipator": "e–f",
    "effort": "source e",
    "flow": "source f",
    "field": "in energies",
}


@dataclass(slots=True)
class Vertex:
    """A dot or a box.  ports: (dot, sign and indices at it); grounds: signs of the ports on ground."""

    key: str
    label: str
    small: str
    colour: str
    place: Place | None
    box: bool
    ports: list[tuple[str, str]] = field(default_factory=list)
    grounds: list[str] = field(default_factory=list)
    reads: set[str] = field(default_factory=set)


def section(study: ReportStudy) -> str:
    """The picture and its legend."""
    colours = _Colours()
    vertices = _vertices(study, colours)
    boxes = [v for v in vertices.values() if v.box]
    if len(boxes) > MOST:
        return f'<p class="soft">{len(boxes)} elements and statements: too many for a picture.</p>'
    if not boxes:
        return '<p class="soft">No elements.</p>'
    reads = any(v.reads for v in boxes)
    return f'<div class="schematic">{_draw(study, vertices)}</div><p class="legend">{colours.legend(reads)}</p>'


class _Colours:
    """A colour a domain, in the order of their use."""

    def __init__(self) -> None:
        self._known: dict[str, str] = {}

    def colour_of(self, domain: str) -> str:
        """The colour of a domain."""
        return self._known.setdefault(domain, COLOURS[len(self._known) % len(COLOURS)])

    def legend(self, reads: bool) -> str:
        """Their names as HTML."""
        found = "".join(f'<span><i style="background:{c}"></i>{escape(d)}</span>' for d, c in self._known.items())
        return found + ("<span>dashed: reads</span>" if reads else "")


def _vertices(study: ReportStudy, colours: _Colours) -> dict[str, Vertex]:
    """Vertices of the drawing: nodes, coordinates, unknowns and states as dots, elements and statements as boxes."""
    n = study.network
    found: dict[str, Vertex] = {}

    def dot(name: str, shape: Shape, domain: str, place: Place) -> None:
        found[f"n {name}"] = Vertex(f"n {name}", name + _extent(shape), "", colours.colour_of(domain), place, False)

    for node in n.nodes:
        dot(node.name, node.shape, node.domain.name, node.place)
    for c in n.coordinates:
        dot(c.name, c.shape, c.displacement.text, c.place)
    for u in n.unknowns:
        dot(u.name, u.shape, "implicit", u.place)
    for s in n.states:
        dot(s.name, s.shape, "dynamic variable", s.place)
    kinds = {b.name: c.kind for c in n.couplings for b in n.branches if b.name in (c.first, c.second)}
    # both sides of a coupling in one box
    for branch in n.branches:
        _branch(found, branch, kinds, colours)
    # what a statement ties are its ports, elements that it reads are dashed
    for label, small, loops, place, nodes in _statements(study):
        key = f"s {label} {place.span.start}"
        while key in found:
            key += "'"
        vertex = Vertex(key, label, _ranges(loops), "var(--soft)", place, True)
        vertex.small = small or vertex.small
        owners = _owners(nodes, found)
        vertex.ports = [(o, "") for o in owners if not found[o].box]
        vertex.reads = {o for o in owners if found[o].box}
        found[key] = vertex
    return found


def _branch(found: dict[str, Vertex], branch: Branch, kinds: dict[str, str], colours: _Colours) -> None:
    """A branch as a box, or as one side of the box of its coupling."""
    own, _, side = branch.name.partition("#")
    key = f"b {own}"
    colour = colours.colour_of(branch.domain.name)
    vertex = found.get(key)
    # the first side makes the box
    if vertex is None:
        small = kinds.get(branch.name, "") or _SIGNS.get(branch.kind, branch.kind)
        label = own + (f"[{_ranges(branch.loops) or '…'}]" if branch.at else "")
        vertex = found[key] = Vertex(key, label, small, colour, branch.place, True)
    # ends at nodes are wires, ends at ground its sign
    for terminal, sign in ((branch.plus, "+"), (branch.minus, "−")):
        mark = sign + side
        if terminal is not None and terminal.node is None:
            if mark not in vertex.grounds:
                vertex.grounds.append(mark)
        elif terminal is not None:
            port = (f"n {terminal.node}", mark + _indices(terminal))
            if port not in vertex.ports and port[0] in found:
                vertex.ports.append(port)
    # along an expression: what that reads
    if branch.on is not None:
        vertex.ports += [(o, "") for o in _owners([branch.on], found) if (o, "") not in vertex.ports]
    # a law that reads what is no port of it
    near = {p for p, _ in vertex.ports} | {key}
    vertex.reads |= {o for o in _owners([branch.law] if branch.law is not None else [], found) if o not in near}


def _statements(study: ReportStudy) -> Iterable[tuple[str, str, tuple[Loop, ...], Place, list[Node]]]:
    n = study.network
    for e in n.energies:
        yield e.function, "content" if e.function in "DG" else "energy", e.loops, e.place, [e.expression]
    for w in n.works:
        yield "work", "", w.loops, w.place, [w.effort, w.on]
    for c in n.constraints:
        yield c.name, c.kind, c.loops, c.place, [c.expression]
    for d in n.dynamics:
        yield f"{d.state.data[0]}′", "dynamic", d.loops, d.place, [d.expression, d.state]


def _owners(roots: Sequence[Node], found: dict[str, Vertex]) -> list[str]:
    """Dots and boxes of the unknowns in expressions."""
    keys: dict[str, None] = {}
    for node in topological(roots):
        if node.op == "var":
            name, kind, _ = node.data
            own = name.partition("#")[0]
            for key in (f"b {own}",) if kind[0] == "b" else (f"n {name}", f"b {own}"):
                if key in found:
                    keys[key] = None
                    break
    return list(keys)


def _extent(shape: Shape) -> str:
    return f"[{', '.join(f'{a}..{b}' for a, b in shape)}]" if shape else ""


def _ranges(loops: Sequence[Loop]) -> str:
    return ", ".join(f"{loop.first}..{loop.last}" for loop in loops)


def _indices(terminal: Terminal) -> str:
    return f" [{', '.join(map(str, terminal.at))}]" if terminal.at else ""


# ---- drawing


def _draw(study: ReportStudy, vertices: dict[str, Vertex]) -> str:
    """The drawing as SVG: vertices in layers, wires under boxes."""
    neighbours: dict[str, list[str]] = {key: [] for key in vertices}
    size: dict[str, float] = {}
    # which dots each box is joined to
    for key, vertex in vertices.items():
        size[key] = (1.35 if vertex.grounds else 1.0) if vertex.box else 0.9
        for dot, _ in vertex.ports:
            if dot not in neighbours[key] and not vertices[dot].box:
                neighbours[key].append(dot)
                neighbours[dot].append(key)
    # dots that nothing touches are left out
    drawn = {k: v for k, v in neighbours.items() if v or vertices[k].box}
    found = places(drawn, size)
    at = {k: (70.0 + layer * STEP, 26.0 + y * UNIT) for k, (layer, y) in found.items()}
    width = max(x for x, _ in at.values()) + 80.0
    height = max(y + (48.0 if vertices[k].grounds else 34.0) for k, (_, y) in at.items())
    parts = [*_wires(vertices, at)]
    for key, (x, y) in at.items():
        parts.append(_box(study, vertices[key], x, y) if vertices[key].box else _dot(study, vertices[key], x, y))
    fit = ' style="max-width:100%;height:auto"' if width < WIDE else ""
    size_ = f'viewBox="0 0 {width:.0f} {height:.0f}" width="{width:.0f}" height="{height:.0f}"{fit}'
    return f'<svg {size_} role="img" aria-label="schematic">{"".join(parts)}</svg>'


def _wires(vertices: dict[str, Vertex], at: dict[str, tuple[float, float]]) -> list[str]:
    """Curves from boxes to their dots, signs at their beginning; dashed ones for what is read."""
    parts: list[str] = []
    for key, vertex in vertices.items():
        if not vertex.box or key not in at:
            continue
        x, y = at[key]
        used: dict[tuple[str, float], int] = {}
        for port, mark in vertex.ports:
            if port not in at:
                continue
            u, v = at[port]
            side = 1.0 if u >= x else -1.0
            start = x + side * BOX / 2
            # several wires to one dot leave the box one under the other
            nth = used[(port, side)] = used.get((port, side), -1) + 1
            rise = y + (7.0 * nth if nth % 2 == 0 else -7.0 * nth)
            middle = (start + u) / 2
            colour = vertices[port].colour
            curve = f"M{start:.0f} {rise:.0f}C{middle:.0f} {rise:.0f} {middle:.0f} {v:.0f} {u:.0f} {v:.0f}"
            parts.append(f'<path class="wire" stroke="{colour}" d="{curve}"/>')
            anchor = "start" if side > 0 else "end"
            spot = f'x="{start + 3 * side:.0f}" y="{rise - 3:.0f}" text-anchor="{anchor}"'
            parts.append(f'<text class="small" {spot}>{escape(mark)}</text>' if mark else "")
        # what is read, as an arc above
        for other in sorted(vertex.reads):
            if other in at:
                u, v = at[other]
                bend = (y + v) / 2 - 26.0
                curve = f"M{u:.0f} {v:.0f}Q{(x + u) / 2:.0f} {bend:.0f} {x:.0f} {y - 17:.0f}"
                parts.append(f'<path class="reads" d="{curve}"/>')
    return parts


def _box(study: ReportStudy, vertex: Vertex, x: float, y: float) -> str:
    """A box with its label and kind, its grounds below, linked to its line of the text."""
    shape = f'x="{x - BOX / 2:.0f}" y="{y - 17:.0f}" width="{BOX:.0f}" height="34" rx="4"'
    body = [f'<rect class="box" {shape} stroke="{vertex.colour}"/>']
    for kind, down, text in (("label", -2, _short(vertex.label, 13)), ("small", 11, _short(vertex.small, 17))):
        fit = f' textLength="{BOX - 8:.0f}" lengthAdjust="spacingAndGlyphs"' if len(text) > FITS[kind] else ""
        body.append(f'<text class="{kind}" x="{x:.0f}" y="{y + down:.0f}" text-anchor="middle"{fit}>{text}</text>')
    for k, mark in enumerate(vertex.grounds):
        u = x + 26.0 * (k - (len(vertex.grounds) - 1) / 2)
        bars = "".join(f"M{u - w:.0f} {y + 25 + 3 * j:.0f}h{2 * w:.0f}" for j, w in enumerate((7, 4.5, 2)))
        body.append(f'<path class="wire" stroke="{vertex.colour}" d="M{u:.0f} {y + 17:.0f}v8{bars}"/>')
        body.append(f'<text class="small" x="{u + 4:.0f}" y="{y + 25:.0f}">{escape(mark)}</text>')
    title = f"<title>{escape(vertex.label)}</title>"
    return _link(study, vertex.place, title + "".join(body))


def _dot(study: ReportStudy, vertex: Vertex, x: float, y: float) -> str:
    circle = f'<circle class="node" cx="{x:.0f}" cy="{y:.0f}" r="5.5" fill="{vertex.colour}"/>'
    text = f'<text class="label" x="{x:.0f}" y="{y - 10:.0f}" text-anchor="middle">{_short(vertex.label, 16)}</text>'
    return _link(study, vertex.place, f"<title>{escape(vertex.label)}</title>{circle}{text}")


def _link(study: ReportStudy, place: Place | None, body: str) -> str:
    address = study.address(place)
    return f"<g>{body}</g>" if address is None else f'<a href="{address}">{body}</a>'


def _short(text: str, most: int) -> str:
    return escape(text if len(text) <= most else f"{text[: most - 1]}…")
