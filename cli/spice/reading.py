"""The cards of a netlist in order -> a `Netlist`: what is defined first, then what is asked of it."""

from __future__ import annotations

import math
from collections.abc import Mapping
from pathlib import Path
from typing import TypeVar

from sysdyn.cli.spice.circuit import CELSIUS, Circuit, ModelCard, Netlist
from sysdyn.cli.spice.netlist import Card, UnreadableCard, cards, pairs, value
from sysdyn.cli.spice.parameters import ParameterText, evaluate
from sysdyn.cli.spice.temperature import Heat
from sysdyn.dsl.text.diagnostics import Report
from sysdyn.dsl.text.source import SourceText, real

IGNORED = (".title", ".width", ".backanno")
"""Cards that say nothing of a circuit."""
_ANALYSES = """
.op .ac .dc .noise .tf .four .fourier .meas .measure .disto .pz .sens .sp .pss .hb .wave .fft .csparam .control
"""
SKIPPED = frozenset(_ANALYSES.split())
"""Analyses beside `.tran`, and what is done with results."""
_OPTIONS = """
abstol absv accurate acct autostop brief bypass captab chgtol co converge cptime dccap delmax dvdt fast gmin gminsteps
ingold interp itl1 itl2 itl3 itl4 itl5 itl6 keepopinfo klu limit limpts limtim list lvltim maxevtiter maxopalter maxord
measdgt method minbreak noacct node nomod noopac noopiter nopage numdgt numsteps opts pivrel pivtol plotwinsize post
probe ramptime reltol reltran savecurrents seed seedinfo sparse srcsteps trtol trytocompact vntol warn xmu
"""
TOLERATED = frozenset(_OPTIONS.split())
"""Options of SPICE's solver and of its output: none of the circuit."""


class Reader:
    """Reads a text and what it includes from its own folder; findings go to the report."""

    def __init__(self, source: SourceText, report: Report) -> None:
        self.report = report
        self.folder = real(source.name).parent
        title, found = cards(source)
        self.netlist = Netlist(title, Circuit(Path(source.name).stem))
        self._open = [self.netlist.top]
        self._included = {real(source.name)}
        self._asked: list[Card] = []
        self._skipped: list[Card] = []
        self._take(source, found)
        if len(self._open) > 1:
            report.error("E941", f"subcircuit '{self._open[-1].name}' has no .ends", source.place(0, 0))
        self._finish()

    def _take(self, source: SourceText, found: list[Card]) -> None:
        for card in found:
            if card.head == ".end":
                return  # what follows is another circuit
            try:
                self._card(source, card)
            except UnreadableCard as error:
                self._refuse(error, card)

    def _refuse(self, error: UnreadableCard, card: Card) -> None:
        self.report.error("E941", str(error), (error.card or card).place)

    def _card(self, source: SourceText, card: Card) -> None:
        """Take a card into the circuit that is open; Unreadable where the card is wrong or not known."""
        head, words, inside = card.head, card.words, self._open[-1]
        # an element
        if not head.startswith("."):
            _enter(inside.elements, head, card)
        elif head in (".param", ".params"):
            inside.parameters |= {name: ParameterText(text, card) for name, text in pairs(words[1:])}
        elif head == ".subckt":
            self._begin(card)
        # back to the circuit around
        elif head == ".ends":
            if len(self._open) == 1:
                raise UnreadableCard(".ends without .subckt")
            self._open.pop()
        # parentheses and commas separate as blanks do
        elif head == ".model":
            plain = [w for w in words if w not in ("(", ")", ",")]
            if len(plain) < 3:
                raise UnreadableCard(".model NAME KIND(...)")
            _enter(inside.models, plain[1], ModelCard(plain[2], dict(pairs(plain[3:])), card))
        elif head == ".global":
            self.netlist.shared |= dict.fromkeys(words[1:])
        # initial values name nodes of the top circuit
        elif head == ".ic" and inside is not self.netlist.top:
            raise UnreadableCard("'.ic' inside a subcircuit: IC= at its capacitors, or '.ic v(x1.node)=...' outside")
        # analyses and options are read when all parameters are known
        elif head in ASKED:
            self._asked.append(card)
        elif head in (".print", ".plot", ".save", ".probe"):
            self.netlist.shown += _output_names(words[1:])
        elif head in (".include", ".inc", ".lib"):
            self._include(source, card)
        # of analyses that are not made: named once
        elif head in SKIPPED:
            self._skipped.append(card)
        elif head not in IGNORED:
            raise UnreadableCard(f"'{head}' is not known")

    def _begin(self, card: Card) -> None:
        """Open a subcircuit: its ports up to the first NAME=VALUE, then its parameters."""
        words = [w for w in card.words[1:] if w not in ("params", "params:", ":", "(", ")", ",")]
        if not words:
            raise UnreadableCard(".subckt NAME NODE ...")
        first = next((k for k, w in enumerate(words[1:], 1) if k + 1 < len(words) and words[k + 1] == "="), len(words))
        outer = self._open[-1]
        inner = Circuit(words[0], outer, tuple(words[1:first]))
        self._open.append(inner)  # also where it is refused below: its .ends is its own
        inner.parameters |= {name: ParameterText(text, card) for name, text in pairs(words[first:])}
        # one node under two names would be two
        if len(set(inner.ports)) < len(inner.ports):
            raise UnreadableCard(f"a node stands twice among those of '{words[0]}'")
        _enter(outer.inner, words[0], inner)

    def _include(self, source: SourceText, card: Card) -> None:
        """A file of the netlist's own folder or below it."""
        name = card.text.split(None, 1)[1].strip().strip("\"'") if len(card.words) > 1 else ""
        path = real(real(source.name).parent / name)
        if not path.is_relative_to(self.folder) or not path.is_file():
            raise UnreadableCard(f"'{name}' is no file of the netlist's folder")
        if path in self._included:
            return
        self._included.add(path)
        inner = SourceText.read(path)
        self._take(inner, cards(inner, titled=False)[1])

    def _finish(self) -> None:
        """What is asked, by parameters wherever they stand."""
        netlist, top = self.netlist, self.netlist.top
        try:
            netlist.known = evaluate(top.parameters, {})
        except UnreadableCard as error:
            self._refuse(error, next(iter(top.parameters.values())).card)
            netlist.top = Circuit(top.name)  # nothing else is known then
            return
        for card in self._asked:
            try:
                ASKED[card.head](self, card, netlist.known)
            except UnreadableCard as error:
                self._refuse(error, card)
        if self._skipped:
            heads = ", ".join(f"'{head}'" for head in dict.fromkeys(card.head for card in self._skipped))
            text = f"{heads} {'is' if len(self._skipped) == 1 else 'are'} left out: .tran alone becomes a scene"
            remedy = None if netlist.tran else "'.tran STEP STOP' outside of .control makes a scene"
            self.report.note("N941", text, self._skipped[0].place, help=remedy)

    # -- cards that ask ----------------------------------------------------------------------------------------------

    def _initial(self, card: Card, known: Mapping[str, float]) -> None:
        self.netlist.initial |= {node: (volt, card) for node, volt in _nodes(card.words[1:], known)}

    def _nodeset(self, card: Card, known: Mapping[str, float]) -> None:
        text = "'.nodeset' is left out: of several states of rest the start may be another"
        self.report.warning("W941", text, card.place, help="IC= at capacitors and UIC say where a run begins")

    def _tran(self, card: Card, known: Mapping[str, float]) -> None:
        """Read `.tran STEP STOP [START] [UIC]`, all in s."""
        words = [w for w in card.words[1:] if w not in ("(", ")", ",")]
        times = [value(w, known) for w in words if w != "uic"]
        if len(times) < 2:
            raise UnreadableCard(".tran STEP STOP [START] [UIC]")
        step, end = times[:2]
        if not (0.0 <= step < math.inf and 0.0 < end < math.inf):
            raise UnreadableCard(f".tran {step:g} {end:g}: a step and an end after 0 s are wanted")
        if self.netlist.tran is not None:
            raise UnreadableCard("'.tran' stands here twice")
        start = times[2] if len(times) > 2 else 0.0
        self.netlist.tran, self.netlist.uic = (step, end, start), "uic" in words

    def _temperature(self, card: Card, known: Mapping[str, float]) -> None:
        """`.temp T`, in Celsius."""
        words = [w for w in card.words[1:] if w not in ("=", ",")]
        if len(words) != 1:
            raise UnreadableCard(".temp T: one temperature makes one circuit")
        self.netlist.temperature = _kelvin(words[0], known)

    def _options(self, card: Card, known: Mapping[str, float]) -> None:
        words, k = [w for w in card.words[1:] if w != ","], 0
        while k < len(words):
            name, given = words[k], k + 2 < len(words) and words[k + 1] == "="
            self._option(name, words[k + 2] if given else "", known, card)
            k += 3 if given else 1

    def _option(self, name: str, text: str, known: Mapping[str, float], card: Card) -> None:
        """Those that tell of the circuit are done or named; those of the solver have no counterpart."""
        # degrees Celsius, as all of SPICE
        if name == "temp":
            self.netlist.temperature = _kelvin(text, known)
        elif name == "tnom":
            self.netlist.nominal = _kelvin(text, known)
        elif name == "defw":
            self.netlist.width = value(text, known)
        elif name == "defl":
            self.netlist.length = value(text, known)
        # lengths of all devices
        elif name == "scale":
            if value(text, known) != 1.0:
                raise UnreadableCard(f"the option scale={text}: lengths as they are, without it, are wanted")
        # what it does is not known here
        elif name not in TOLERATED:
            text = f"the option '{name}' is not known and left out"
            self.report.warning("W941", text, card.place, help="the run differs from SPICE's by what it does")


ASKED = {
    ".ic": Reader._initial,
    ".nodeset": Reader._nodeset,
    ".tran": Reader._tran,
    ".temp": Reader._temperature,
    ".options": Reader._options,
    ".option": Reader._options,
    ".opt": Reader._options,
}
"""Cards whose values may be parameters of lines below them."""


T = TypeVar("T")


def _enter(known: dict[str, T], name: str, what: T) -> None:
    """What has a name of its own."""
    if name in known:
        raise UnreadableCard(f"'{name}' stands here twice")
    known[name] = what


def _kelvin(text: str, known: Mapping[str, float]) -> float:
    """A temperature that is said in Celsius."""
    return Heat(value(text, known) + CELSIUS).now


def _nodes(words: tuple[str, ...], known: Mapping[str, float]) -> list[tuple[str, float]]:
    """`v(a)=1 v(b)=2`."""
    found, rest = [], list(words)
    while rest:
        if rest[:2] != ["v", "("] or rest[3:5] != [")", "="] or len(rest) < 6:
            raise UnreadableCard(".ic V(NODE)=VALUE")
        found.append((rest[2], value(rest[5], known)))
        del rest[: 7 if rest[6:7] == [","] else 6]
    return found


def _output_names(words: tuple[str, ...]) -> list[str]:
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
