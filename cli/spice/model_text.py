"""A netlist as the text of a model: components for subcircuits, a scene for `.tran`."""

from __future__ import annotations

import re
from collections.abc import Callable, Collection, Iterable, Mapping
from dataclasses import dataclass, field

from sysdyn.cli.spice.calls import CircuitCalls, call
from sysdyn.cli.spice.circuit import GROUND, Circuit, Netlist
from sysdyn.cli.spice.controlled_sources import CONTROLLED
from sysdyn.cli.spice.devices import PLAIN, CircuitScope, DeviceText
from sysdyn.cli.spice.initial_conditions import across_sources, held_nodes
from sysdyn.cli.spice.instances import CircuitInstance, CircuitInstances
from sysdyn.cli.spice.local_components import LOCAL
from sysdyn.cli.spice.netlist import Card, UnreadableCard, pairs, value
from sysdyn.cli.spice.scene_text import scene
from sysdyn.cli.spice.semiconductors import SEMICONDUCTORS
from sysdyn.cli.spice.temperature import Heat
from sysdyn.cli.spice.windings import Cores, component, coupled_coils
from sysdyn.cli.spice.writing import NetlistNames, names, quantity, wrap_lines
from sysdyn.dsl.elaborate.files import library_components
from sysdyn.dsl.elaborate.instances.instances import BUILTINS
from sysdyn.dsl.text.decoding import MAX_BYTES
from sysdyn.dsl.text.diagnostics import Report
from sysdyn.dsl.text.source import SourceText

DEVICES: dict[str, Callable[[Card, CircuitScope], DeviceText]] = {**PLAIN, **CONTROLLED, **SEMICONDUCTORS}
"""By the first letter of a name; X and K are the circuit's."""


@dataclass(slots=True)
class _Names:
    """Of a circuit in the language: parameters, nodes, elements."""

    written: dict[str, str]
    nodes: dict[str, str]
    labels: dict[str, str]

    def node(self, name: str) -> str:
        """A node of the netlist."""
        if name in GROUND:
            return "ground"
        if name not in self.nodes:
            raise UnreadableCard(f"'{name}' stands where a node is wanted")
        return self.nodes[name]


@dataclass(slots=True)
class _Written:
    """What the whole text needs."""

    uses: set[str] = field(default_factory=set)
    local: list[str] = field(default_factory=list)
    components: list[str] = field(default_factory=list)


class ModelTextWriter:
    """Writes a netlist; findings with its lines go to the report."""

    def __init__(self, netlist: Netlist, source: SourceText, report: Report) -> None:
        self.netlist, self.source, self.report = netlist, source, report
        self.written = _Written()
        step, end, _ = netlist.tran or (0.0, 1.0, 0.0)
        self.asked = ("V", step, end)
        self.names: dict[Circuit, _Names] = {}

    def text(self) -> str:
        """The model's text; its layout is the formatter's."""
        try:
            calls = CircuitCalls(self.netlist)
        except UnreadableCard as error:
            self.report.error("E941", str(error), (error.card or self._any()).place)
            return ""
        self._tell_of_junctions(calls)
        for node, (_, card) in self.netlist.initial.items():
            if "." not in node and node not in calls.uses[self.netlist.top].nodes:
                self.report.error("E941", f".ic of '{node}': there is no such node", card.place)
        library = {name for name, module in library_components().items() if module == "electrical"}
        coils = max((len(_coils(circuit)) for circuit in calls.uses), default=0)
        given = NetlistNames(library.union(BUILTINS, LOCAL, (f"coils_{n}" for n in range(2, coils + 1))), "x_")
        initial = {node: volt for node, (volt, _) in self.netlist.initial.items()} if self.netlist.uic else {}
        top = CircuitInstance(self.netlist.top, self.netlist.known, "", None, initial)
        instances = CircuitInstances(calls, top, given)
        bodies = []
        for instance in instances.found:  # grows meanwhile
            bodies.append(self._body(instance, instances))
        for instance, body in reversed(list(zip(instances.found[1:], bodies[1:], strict=True))):
            self.written.components.append("\n".join([f"component {instance.name} {{", *body, "}", ""]))
        return self._whole(given.new(names([self.netlist.top.name], (), "m_")[self.netlist.top.name]), bodies[0])

    def _tell_of_junctions(self, calls: CircuitCalls) -> None:
        """Transistors have no diodes to their bulk here: only a coil drives a voltage beyond it in usual circuits."""
        cards = [card for circuit in calls.uses for card in circuit.elements.values()]
        first = next((card for card in cards if card.head.startswith("m")), None)
        if first is not None and any(card.head.startswith("l") for card in cards):
            text = f"'{first.head}' and others: is of their models, the junctions of the bulk, is left out"
            help_ = "a diode D from bulk to drain carries what a coil drives backwards"
            self.report.warning("W941", text, first.place, help=help_)

    def _any(self) -> Card:
        """A card, where none is meant."""
        return next(iter(self.netlist.top.elements.values()))

    def _whole(self, model: str, body: list[str]) -> str:
        """The model's text: imports, components, the top circuit, and the scene that its analysis asks for."""
        netlist, top = self.netlist, self.netlist.top
        asked = scene(netlist, model, self.names[top].nodes, self._read(top))
        if netlist.tran is not None and netlist.tran[2] > 0.0:
            text = f"the trace begins at 0 s, not at {netlist.tran[2]:g} s"
            self.report.note("N941", text, self.source.place(0, 0))
        head = [f"## {_title(netlist.title)}"] if _title(netlist.title) else []
        imports = f"from std.electrical import {', '.join(sorted(self.written.uses))}\n" if self.written.uses else ""
        local = "\n".join(self._local(name) for name in dict.fromkeys(self.written.local))
        parts = [*head, imports, local, *self.written.components, f"model {model} {{", *body, "}", "", *asked]
        text = wrap_lines("\n".join(parts) + "\n")
        if len(text) > MAX_BYTES:
            message = f"the model's text would have {len(text)} characters; the language reads {MAX_BYTES}"
            self.report.error("E941", message, self.source.place(0, 0), help="a subcircuit for what repeats itself")
        return text

    def _read(self, top: Circuit) -> dict[str, str]:
        """Elements whose currents are asked for."""
        labels = self.names[top].labels
        branches = Cores(list(top.elements.values()), _coils(top)).branches
        return labels | {coil: f"{labels[card]}.{branch}" for coil, (card, branch) in branches.items()}

    @staticmethod
    def _local(name: str) -> str:
        """The text of a component that std.electrical lacks."""
        return LOCAL[name] if name in LOCAL else component(int(name.removeprefix("coils_")))

    # -- circuits --------------------------------------------------------------------------------------------------

    def _names_of(self, circuit: Circuit, instances: CircuitInstances) -> _Names:
        """Names of a circuit; where they are alike the earlier keeps its own."""
        if circuit not in self.names:
            use = instances.calls.uses[circuit]
            written = names(list(use.named), (), "p_")
            inside = [n for n in (*use.ports, *use.nodes) if n not in GROUND]
            nodes = names(dict.fromkeys(inside), written.values(), "n")
            labels = names(list(circuit.elements), {*written.values(), *nodes.values()}, "x_")
            labels |= {f"param {name}": text for name, text in written.items()}
            self.names[circuit] = _Names(written, nodes, labels)
        return self.names[circuit]

    def _body(self, instance: CircuitInstance, instances: CircuitInstances) -> list[str]:
        """Lines of a model or component."""
        circuit, netlist = instance.circuit, self.netlist
        cards = list(circuit.elements.values())
        use, named = instances.calls.uses[circuit], self._names_of(circuit, instances)
        lines = [f"  param {named.written[n]} = {quantity(instance.known[n], u)}" for n, u in use.named.items()]
        for kind, which in (("port", use.ports), ("node", [n for n in named.nodes if n not in use.ports])):
            lines += [f"  {kind} {', '.join(named.nodes[n] for n in which)}: electrical"] if which else []
        scope = CircuitScope(
            named.node, named.labels, instance.known, instance.model, self.asked, netlist.uic,
            Heat(netlist.temperature, netlist.nominal), (netlist.width, netlist.length), use.named,
            instance.initial, across_sources(cards),
        )  # fmt: skip
        cores = Cores(cards, _coils(circuit))
        initial: list[str] = []
        held = self._initial_lines(cards, named) if circuit is netlist.top and not netlist.uic else {}
        for card in cards:
            if card.head in cores.branches:
                continue
            element = self._element(card, scope, cores, lambda c: self._call(c, instance, instances, named))
            lines += [f"  {line}" for line in element.lines]
            initial += [f"  {line}" for line in ([held[card.head]] if card.head in held else element.initial)]
        return [*lines, *initial]

    def _initial_lines(self, cards: Iterable[Card], named: _Names) -> dict[str, str]:
        """By capacitor the line of `init` that `.ic` asks without UIC: a capacitor to ground holds the node."""
        held, rest = held_nodes(self.netlist.initial, cards)
        for node in (n for n in rest if n in named.nodes or "." in n):
            text = f".ic of '{node}': no capacitor from it to ground holds its voltage"
            self.report.error("E941", text, self.netlist.initial[node][1].place, help="UIC, and C... IC=")
        return {head: f"init {named.labels[head]}.e = {quantity(volt, 'V')}" for head, volt in held.items()}

    def _element(
        self, card: Card, scope: CircuitScope, cores: Cores, write_call: Callable[[Card], DeviceText]
    ) -> DeviceText:
        """An element of a card; E941 of one that cannot be read, W941 of what is left out."""
        letter = card.head[0]
        try:
            # a subcircuit
            if letter == "x":
                found = write_call(card)
            # coupled inductors
            elif letter == "k":
                found = coupled_coils(card, scope, cores)
            elif letter in DEVICES:
                found = DEVICES[letter](card, scope)
            else:
                raise UnreadableCard(f"'{card.head}': elements of the letter {letter.upper()} are not known")
        except UnreadableCard as error:
            self.report.error("E941", str(error), (error.card or card).place)
            return DeviceText(())
        if found.left_out:
            text = f"'{card.head}': {', '.join(found.left_out)} of its card or model is left out"
            self.report.warning("W941", text, card.place, help="the run differs from SPICE's by what they do")
        self.written.uses |= set(found.uses)
        self.written.local += found.local
        return found

    def _call(self, card: Card, instance: CircuitInstance, instances: CircuitInstances, named: _Names) -> DeviceText:
        """`X1 a b NAME p=1`."""
        name, at, words = call(card)
        inner = instance.circuit.find(name)
        if inner is None:
            raise UnreadableCard(f"there is no subcircuit '{name}'")
        if len(at) != len(inner.ports):
            raise UnreadableCard(f"'{name}' has {len(inner.ports)} nodes, {len(at)} are given")
        given = {}
        for key, text in pairs(words):
            if key not in inner.parameters:
                raise UnreadableCard(f"'{name}' has no parameter '{key}'")
            given[key] = value(text, instance.known)
        found, use = instances.instance_of(instance, card, inner, given, at), instances.calls.uses[inner]
        inside = self._names_of(inner, instances)
        said = (f"{inside.written[n]} = {quantity(v, use.named[n])}" for n, v in given.items() if n in use.named)
        joined = _nodes_by_port(inner, at, use.ports, self.netlist.shared)
        ends = ", ".join(f"{inside.nodes[p]} = {named.node(n)}" for p, n in joined.items())
        return DeviceText((f"{named.labels[card.head]}: {found.name}({', '.join(said)}) {ends}",))


def _nodes_by_port(inner: Circuit, at: list[str], ports: Collection[str], shared: Mapping[str, None]) -> dict[str, str]:
    """Nodes of a call by port.  A node of `.global`, and ground, is that node inside too."""
    given = dict(zip(inner.ports, at, strict=True))
    for port, node in given.items():
        whole = port in GROUND or port in shared
        if whole and port != node and not (port in GROUND and node in GROUND):
            raise UnreadableCard(f"'{port}' is one node everywhere; as a node of '{inner.name}' it cannot be '{node}'")
    return {p: given.get(p, p) for p in ports}


def _coils(circuit: Circuit) -> dict[str, Card]:
    """The coils of a circuit by name."""
    return {head: card for head, card in circuit.elements.items() if head.startswith("l")}


def _title(title: str) -> str:
    """A title as a comment: one line of printable characters."""
    return re.sub(r"[^\x20-\x7e]", " ", title.lstrip("*").strip())[:100]
