"""The cards of a netlist in order: elements, subcircuits, parameters, models, what is asked."""

from __future__ import annotations

import math
from dataclasses import field
from pathlib import Path

from sysdyn.cli.spice.netlist import Card, Unreadable, cards, value
from sysdyn.dsl.text.diagnostics import Report
from sysdyn.dsl.text.source import SourceText, real
from sysdyn.values import dataclass

IGNORED = (".end", ".title", ".options", ".option", ".global", ".width", ".nodeset")
SILENT = (".op", ".ac", ".dc", ".noise", ".tf", ".four", ".meas", ".measure", ".control", ".endc", ".temp")


@dataclass(slots=True)
class Circuit:
    """A circuit or subcircuit.  ports: of a subcircuit; parameters: by name, of a subcircuit its defaults."""

    name: str
    ports: tuple[str, ...] = ()
    parameters: dict[str, float] = field(default_factory=dict)
    elements: list[Card] = field(default_factory=list)
    inner: dict[str, Circuit] = field(default_factory=dict)


@dataclass(frozen=True, slots=True)
class Model:
    """`.model NAME KIND(...)`."""

    kind: str
    values: dict[str, float]


@dataclass(slots=True)
class Netlist:
    """All of a text.  tran: (step, stop, start) s; uic: initial conditions are used as they are."""

    title: str
    top: Circuit
    models: dict[str, Model] = field(default_factory=dict)
    initial: dict[str, float] = field(default_factory=dict)
    tran: tuple[float, float, float] | None = None
    uic: bool = False
    shown: list[str] = field(default_factory=list)


class Reader:
    """Reads a text and what it includes from its own folder; findings go to the report."""

    def __init__(self, source: SourceText, report: Report) -> None:
        self.report = report
        self.folder = real(source.name).parent
        title, found = cards(source)
        self.netlist = Netlist(title, Circuit(Path(source.name).stem))
        self._open = [self.netlist.top]
        self._included = {real(source.name)}
        self._take(source, found)
        if len(self._open) > 1:
            report.error("E941", f"subcircuit '{self._open[-1].name}' has no .ends", source.place(0, 0))

    def _take(self, source: SourceText, found: list[Card]) -> None:
        for card in found:
            try:
                self._card(source, card)
            except Unreadable as error:
                self.report.error("E941", str(error), card.place)

    def _card(self, source: SourceText, card: Card) -> None:
        head, words, netlist = card.head, card.words, self.netlist
        known = self._open[-1].parameters
        if not head.startswith("."):
            if any(other.head == head for other in self._open[-1].elements):
                raise Unreadable(f"'{head}' stands here twice")
            self._open[-1].elements.append(card)
        elif head in (".param", ".params"):
            for name, text in pairs(words[1:]):
                known[name] = value(text, self._known())
        elif head == ".subckt":
            self._begin(card)
        elif head == ".ends":
            if len(self._open) == 1:
                raise Unreadable(".ends without .subckt")
            self._open.pop()
        elif head == ".model":
            self._model(card)
        elif head == ".ic":
            netlist.initial |= dict(_nodes(words[1:], self._known()))
        elif head == ".tran":
            times = [value(w, self._known()) for w in words[1:] if w != "uic"]
            if len(times) < 2:
                raise Unreadable(".tran STEP STOP [START] [UIC]")
            if not (0.0 < times[0] < math.inf and 0.0 < times[1] < math.inf):
                raise Unreadable(f".tran {times[0]:g} {times[1]:g}: a step and an end after 0 s are wanted")
            netlist.tran, netlist.uic = (times[0], times[1], times[2] if len(times) > 2 else 0.0), "uic" in words
        elif head in (".print", ".plot", ".save", ".probe"):
            netlist.shown += _shown(words[1:])
        elif head in (".include", ".inc", ".lib"):
            self._include(source, card)
        elif head in SILENT:
            text = f"'{head}' is left out: .tran alone becomes a scene"
            self.report.note("N941", text, card.place)
        elif head not in IGNORED:
            raise Unreadable(f"'{head}' is not known")

    def _known(self) -> dict[str, float]:
        found: dict[str, float] = {}
        for circuit in self._open:
            found |= circuit.parameters
        return found

    def _begin(self, card: Card) -> None:
        words = [w for w in card.words[1:] if w not in ("params", "params:", ":", "(", ")")]
        if not words:
            raise Unreadable(".subckt NAME NODE ...")
        first = next((k for k, w in enumerate(words[1:], 1) if k + 1 < len(words) and words[k + 1] == "="), len(words))
        given = {name: value(text, self._known()) for name, text in pairs(words[first:])}
        inner = Circuit(words[0], tuple(words[1:first]), given)
        self._open[-1].inner[words[0]] = inner
        self._open.append(inner)

    def _model(self, card: Card) -> None:
        words = [w for w in card.words if w not in ("(", ")", ",")]
        if len(words) < 3:
            raise Unreadable(".model NAME KIND(...)")
        given = {name: value(text, self._known()) for name, text in pairs(words[3:])}
        self.netlist.models[words[1]] = Model(words[2], given)

    def _include(self, source: SourceText, card: Card) -> None:
        """A file of the netlist's own folder or below it."""
        name = card.text.split(None, 1)[1].strip().strip("\"'") if len(card.words) > 1 else ""
        path = real(real(source.name).parent / name)
        if not path.is_relative_to(self.folder) or not path.is_file():
            raise Unreadable(f"'{name}' is no file of the netlist's folder")
        if path in self._included:
            return
        self._included.add(path)
        inner = SourceText.read(path)
        self._take(inner, cards(inner, titled=False)[1])


def pairs(words: tuple[str, ...] | list[str]) -> list[tuple[str, str]]:
    """`a = 1 b = 2` as pairs."""
    plain = [w for w in words if w not in ("(", ")", ",")]
    found = []
    for k in range(0, len(plain), 3):
        if k + 2 >= len(plain) or plain[k + 1] != "=":
            raise Unreadable(f"'{plain[k]}': NAME=VALUE is wanted")
        found.append((plain[k], plain[k + 2]))
    return found


def _nodes(words: tuple[str, ...], known: dict[str, float]) -> list[tuple[str, float]]:
    """`v(a)=1 v(b)=2`."""
    plain = [w for w in words if w not in ("(", ")", "v", "=")]
    if len(plain) % 2:
        raise Unreadable(".ic V(NODE)=VALUE")
    return [(plain[k], value(plain[k + 1], known)) for k in range(0, len(plain), 2)]


def _shown(words: tuple[str, ...]) -> list[str]:
    """`v(a)`, `v(a,b)`, `i(v1)` as `v a`, `v a b`, `i v1`."""
    text = " ".join(w for w in words if w != "tran")
    parts = text.replace("(", " ( ").replace(")", " ) ").split()
    found, k = [], 0
    while k < len(parts):
        if parts[k] in ("v", "i") and k + 1 < len(parts) and parts[k + 1] == "(" and ")" in parts[k:]:
            end = parts.index(")", k)
            found.append(" ".join([parts[k], *(p for p in parts[k + 2 : end] if p != ",")]))
            k = end
        k += 1
    return found
