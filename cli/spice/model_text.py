"""A netlist as the text of a model: components for subcircuits, a scene for `.tran`."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass, field

from sysdyn.cli.spice.circuit import Circuit, Netlist, pairs
from sysdyn.cli.spice.devices import DEVICES, LOCAL, Element, Scope
from sysdyn.cli.spice.netlist import Card, Unreadable, value
from sysdyn.cli.spice.windings import Cores, component, coupled
from sysdyn.cli.spice.writing import names, quantity
from sysdyn.dsl.elaborate.files import exported
from sysdyn.dsl.elaborate.instances.instances import BUILTINS
from sysdyn.dsl.text.diagnostics import Report
from sysdyn.dsl.text.source import SourceText

GROUND = ("0", "gnd")
UNITS = {"r": "ohm", "c": "F", "l": "H"}
"""Units of parameters that stand alone as the value of an element."""
MOST, STEPS = 1e5, 1000
"""Rows of a trace at most, and of one whose step would make more."""
SHOWN = 24
"""Nodes that are traced where nothing is asked."""


@dataclass(slots=True)
class _Written:
    """What the whole text needs."""

    uses: set[str] = field(default_factory=set)
    local: list[str] = field(default_factory=list)
    components: list[str] = field(default_factory=list)


class Writer:
    """Writes a netlist; findings with its lines go to the report."""

    def __init__(self, netlist: Netlist, source: SourceText, report: Report) -> None:
        self.netlist, self.source, self.report = netlist, source, report
        self.written = _Written()
        step, end, _ = netlist.tran or (1e-3, 1.0, 0.0)
        self.asked = ("V", step, end)
        library = {name for name, module in exported().items() if module == "electrical"}
        coils = sum(
            c.head.startswith("l") for circuit in (*_depth_first(netlist.top), netlist.top) for c in circuit.elements
        )
        self.taken = library.union(BUILTINS, LOCAL, (f"coils_{n}" for n in range(2, coils + 1)))  # names of parts
        self.components = names(list(_inner(netlist.top)), self.taken, "x_")

    def text(self) -> str:
        """The model's text; its layout is the formatter's."""
        netlist = self.netlist
        taken = self.taken.union(self.components.values())
        model = names([netlist.top.name], taken, "m_")[netlist.top.name]
        for circuit in _depth_first(netlist.top):
            self.written.components.append(self._component(circuit))
        body, nodes = self._body(netlist.top, {})
        scene = self._scene(model, netlist.top, nodes)
        head = [f"## {_told(netlist.title)}"] if _told(netlist.title) else []
        imports = f"from std.electrical import {', '.join(sorted(self.written.uses))}\n" if self.written.uses else ""
        local = "\n".join(self._local(name) for name in dict.fromkeys(self.written.local))
        parts = [*head, imports, local, *self.written.components, f"model {model} {{", *body, "}", "", *scene]
        return "\n".join(parts) + "\n"

    # -- circuits --------------------------------------------------------------------------------------------------

    def _component(self, circuit: Circuit) -> str:
        body, _ = self._body(circuit, circuit.parameters)
        return "\n".join([f"component {self.components[circuit.name]} {{", *body, "}", ""])

    @staticmethod
    def _local(name: str) -> str:
        """The text of a component that std.electrical lacks."""
        return LOCAL[name] if name in LOCAL else component(int(name.removeprefix("coils_")))

    def _body(self, circuit: Circuit, defaults: dict[str, float]) -> tuple[list[str], dict[str, str]]:
        """Lines of a model or component, and its nodes."""
        cards = circuit.elements
        inside = self._inside(circuit)
        units = _units(circuit)
        written, nodes, labels = self._names(circuit)
        labels |= {f"param {name}": text for name, text in written.items()}
        known = {**(self.netlist.top.parameters if circuit is not self.netlist.top else {}), **circuit.parameters}
        scope = Scope(
            lambda n: _node(n, nodes), labels, known, self.netlist.models, self.asked,
            self.netlist.uic, {n: units[n] for n in circuit.parameters if units.get(n)},
        )  # fmt: skip
        said = {n: v for n, v in circuit.parameters.items() if units.get(n)}
        lines = [f"  param {written[n]} = {quantity(v, units[n])}" for n, v in said.items()]
        if circuit.ports:
            lines.append(f"  port {', '.join(nodes[p] for p in circuit.ports)}: electrical")
        if inside:
            lines.append(f"  node {', '.join(nodes[n] for n in inside)}: electrical")
        cores = Cores(cards, _coils(circuit))
        initial: list[str] = []
        for card in cards:
            if card.head in cores.branches:
                continue
            element = self._element(card, scope, cores, circuit)
            lines += [f"  {line}" for line in element.lines]
            initial += [f"  {line}" for line in element.initial]
        if circuit is self.netlist.top and not self.netlist.uic:
            initial = self._asked(initial, cards, scope)
        return [*lines, *initial], nodes

    def _element(self, card: Card, scope: Scope, cores: Cores, circuit: Circuit) -> Element:
        place = card.place
        letter = card.head[0]
        try:
            if letter == "x":
                found = self._instance(card, scope, circuit)
            elif letter == "k":
                found = coupled(card, scope, cores)
            elif letter in DEVICES:
                found = DEVICES[letter](card, scope)
            else:
                raise Unreadable(f"'{card.head}': elements of the letter {letter.upper()} are not known")
        except Unreadable as error:
            self.report.error("E941", str(error), place)
            return Element(())
        if found.left_out:
            text = f"'{card.head}': {', '.join(found.left_out)} of its card or model is left out"
            self.report.warning("W941", text, place, help="the run differs from SPICE's by what they do")
        self.written.uses |= set(found.uses)
        self.written.local += found.local
        return found

    def _instance(self, card: Card, scope: Scope, circuit: Circuit) -> Element:
        """`X1 a b NAME p=1`."""
        name, at, words = _call(card)
        inner = self._found(circuit, name)
        if inner is None:
            raise Unreadable(f"there is no subcircuit '{name}'")
        if len(at) != len(inner.ports):
            raise Unreadable(f"'{name}' has {len(inner.ports)} nodes, {len(at)} are given")
        units = _units(inner)
        written, nodes, _ = self._names(inner)
        given = []
        for key, text in pairs(words):
            if key not in inner.parameters:
                raise Unreadable(f"'{name}' has no parameter '{key}'")
            if not units.get(key):
                raise Unreadable(f"'{key}' of '{name}' is no value of an element by itself: give it a .param instead")
            given.append(f"{written[key]} = {quantity(value(text, scope.known), units[key])}")
        joined = ", ".join(f"{nodes[p]} = {scope.node(n)}" for p, n in zip(inner.ports, at, strict=True))
        return Element((f"{scope.name[card.head]}: {self.components[name]}({', '.join(given)}) {joined}",))

    def _inside(self, circuit: Circuit) -> list[str]:
        """Nodes that are no ports."""
        found = dict.fromkeys(n for card in circuit.elements for n in self._nodes(card, circuit))
        return [n for n in found if n not in circuit.ports and n not in GROUND]

    def _names(self, circuit: Circuit) -> tuple[dict[str, str], dict[str, str], dict[str, str]]:
        """Parameters, nodes, elements in the language's names; where they are alike the earlier keeps its own."""
        written = names(list(circuit.parameters), set(), "p_")
        nodes = names([*circuit.ports, *self._inside(circuit)], set(written.values()), "n")
        taken = {*written.values(), *nodes.values()}
        return written, nodes, names([card.head for card in circuit.elements], taken, "x_")

    def _found(self, circuit: Circuit, name: str) -> Circuit | None:
        return circuit.inner.get(name) or self.netlist.top.inner.get(name)

    def _nodes(self, card: Card, circuit: Circuit) -> list[str]:
        """Nodes of a card."""
        letter, words = card.head[0], [w for w in card.words if w not in ("(", ")", ",")]
        if letter == "x":
            return _call(card)[1]
        count = {"e": 4, "g": 4, "q": 3, "m": 3, "k": 0}.get(letter, 2)
        return words[1 : 1 + count]

    def _asked(self, initial: list[str], cards: list[Card], scope: Scope) -> list[str]:
        """`.ic V(n)=v` where a capacitor to ground holds that node; else the operating point."""
        held = dict(self.netlist.initial)
        for card in cards:
            if card.head[0] == "c" and len(card.words) > 3:
                for node, other, sign in ((card.words[1], card.words[2], 1.0), (card.words[2], card.words[1], -1.0)):
                    if node in held and other in GROUND:
                        name = scope.name[card.head]
                        initial = [line for line in initial if not line.startswith(f"  init {name}.")]
                        initial.append(f"  init {name}.e = {quantity(sign * held.pop(node), 'V')}")
        for node in held:
            text = f".ic of '{node}': no capacitor from it to ground holds its voltage"
            self.report.error("E941", text, self.source.place(0, 0), help="UIC, and C... IC=")
        return initial

    # -- the scene -------------------------------------------------------------------------------------------------

    def _scene(self, model: str, top: Circuit, nodes: dict[str, str]) -> Iterator[str]:
        if self.netlist.tran is None:
            return
        step, end, begin = self.netlist.tran
        if begin > 0.0:
            self.report.note("N941", f"the trace begins at 0 s, not at {begin:g} s", self.source.place(0, 0))
        labels = self._names(top)[2]
        branches = Cores(top.elements, _coils(top)).branches
        labels |= {coil: f"{labels[card]}.{branch}" for coil, (card, branch) in branches.items()}
        traced = [t for text in self.netlist.shown if (t := _read(text, nodes, labels)) is not None]
        traced = traced or [f"{n}.e as v_{_plain(word)}" for word, n in list(nodes.items())[:SHOWN]]
        yield f"scene tran of {model} {{"
        yield f"  time 0 s to {quantity(end, 's')}"
        every = quantity(step if end / step <= MOST else end / STEPS, "s")
        if traced:
            yield f"  trace {', '.join(dict.fromkeys(traced))} every {every}"
        yield "}"


def _coils(circuit: Circuit) -> dict[str, Card]:
    """The coils of a circuit by name."""
    return {c.head: c for c in circuit.elements if c.head.startswith("l")}


def _call(card: Card) -> tuple[str, list[str], list[str]]:
    """`X1 a b NAME p=1`: the subcircuit, the nodes, the words of what is given."""
    words = [w for w in card.words if w not in ("params", "params:", ":")]
    first = next((k - 1 for k, w in enumerate(words) if w == "="), len(words))
    return words[first - 1], words[1 : first - 1], words[first:]


def _node(name: str, nodes: dict[str, str]) -> str:
    """A node of a netlist in the language's name."""
    if name in GROUND:
        return "ground"
    if name not in nodes:
        raise Unreadable(f"'{name}' stands where a node is wanted")
    return nodes[name]


def _read(text: str, nodes: dict[str, str], labels: dict[str, str]) -> str | None:
    """`v a b` or `i v1` as something to trace."""
    kind, *at = text.split()
    if kind == "i" and at and at[0] in labels:
        return f"{labels[at[0]]}.f as i_{_plain(at[0])}"
    known = [n for n in at if n not in GROUND]
    if kind != "v" or not known or not all(n in nodes for n in known):
        return None
    sign = "-" if at[0] in GROUND else ""
    read = " - ".join(f"{nodes[n]}.e" for n in known)
    return f"{sign}{read} as v_{'_'.join(map(_plain, known))}"


def _plain(word: str) -> str:
    """A name of the netlist inside one of ours."""
    return re.sub(r"\W", "_", word, flags=re.ASCII)


def _inner(circuit: Circuit) -> Iterator[str]:
    for inner in circuit.inner.values():
        yield from _inner(inner)
        yield inner.name


def _depth_first(circuit: Circuit) -> Iterator[Circuit]:
    """Subcircuits, those that others use first where they are inside them."""
    for inner in circuit.inner.values():
        yield from _depth_first(inner)
        yield inner


def _units(circuit: Circuit) -> dict[str, str]:
    """Units of the parameters that are the value of elements of one kind by themselves."""
    found: dict[str, set[str]] = {}
    for card in circuit.elements:
        if card.head[0] in UNITS and len(card.words) > 3:
            found.setdefault(card.words[3].strip("{}'").strip(), set()).add(UNITS[card.head[0]])
    alone = {name: next(iter(units)) for name, units in found.items() if len(units) == 1}
    kept = (name for name in alone if name in circuit.parameters and not _read_elsewhere(circuit, name))
    return {name: alone[name] for name in kept}


def _read_elsewhere(circuit: Circuit, name: str) -> bool:
    """Whether an expression reads a parameter too: then it is a number in all of them."""
    word = re.compile(rf"\b{re.escape(name)}\b")
    texts = (w for card in circuit.elements for w in card.words[3:])
    return any(word.search(w) and w.strip("{}'").strip() != name for w in texts)


def _told(title: str) -> str:
    """A title as a comment: one line of printable characters."""
    return re.sub(r"[^\x20-\x7e]", " ", title.lstrip("*").strip())[:100]
