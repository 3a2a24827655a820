"""The energies of a scene as a picture: a bar for each element's activity, and where the energy went.

Below, a bus for each domain, as high as the energy that went through it: from the left what sources supplied and stores
gave, to the right what was dissipated and stored, and what couplings passed on to the next domain.  Elements of one
component are one stub, and those too thin to be seen are added up.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np
from sysdyn.cli.page.picture import drawing
from sysdyn.cli.reduce.activity import Activities, Activity
from sysdyn.cli.report.balance import WORDS
from sysdyn.dsl.text.render import printable
from sysdyn.values import dataclass

COLOURS = {"held": "#1f5fa8", "out": "#d1495b", "in": "#2f8f6b", "through": "#9aa0a6"}
THIN = 0.01
"""Of the largest bus: what is less is added up."""
BARS = 16
"""Elements whose activity is drawn."""
GAP, STUB = 0.07, 0.30
"""Between stubs, of the largest bus; length of a stub, of the distance of buses."""


@dataclass(frozen=True, slots=True)
class Stub:
    """Energy [J] that enters or leaves a bus; role: held, out, in."""

    label: str
    role: str
    energy: float


@dataclass(frozen=True, slots=True)
class BusTransfer:
    """Energy [J] that a coupling took from one bus to another."""

    label: str
    source: str
    target: str
    energy: float


@dataclass(frozen=True, slots=True)
class Bus:
    """A domain.  size [J]: what went through it; enters, leaves: largest first."""

    name: str
    size: float
    enters: tuple[Stub, ...]
    leaves: tuple[Stub, ...]


@dataclass(frozen=True, slots=True)
class Flows:
    """Where the energy of a scene went; buses from those that feed to those that are fed."""

    buses: tuple[Bus, ...]
    passes: tuple[BusTransfer, ...]


def flows(items: Iterable[Activity]) -> Flows:
    """The energies over the scene by bus, those of one component and role together."""
    enters: dict[str, dict[tuple[str, str], list[float]]] = {}
    leaves: dict[str, dict[tuple[str, str], list[float]]] = {}
    sides: dict[str, list[tuple[str, float]]] = {}
    # what enters and leaves the bus of each domain
    for a in items:
        enters.setdefault(a.domain, {})
        leaves.setdefault(a.domain, {})
        # two-ports pass energy from bus to bus
        if a.role == "through":
            sides.setdefault(a.name.partition("#")[0] or a.label, []).append((a.domain, a.energy))
            continue
        inward = (a.energy > 0.0) == (a.role == "in")
        side = enters if inward else leaves
        side[a.domain].setdefault((_component(a), a.role), []).append(abs(a.energy))
    passes = tuple(p for label, ends in sides.items() for p in _passes(label, ends))
    # a bus is as high as the larger of both sides
    size = {
        name: max(_total(enters[name]) + _passed_energy(passes, name, into=True),
                  _total(leaves[name]) + _passed_energy(passes, name, into=False))
        for name in enters
    }  # fmt: skip
    least = THIN * max(size.values(), default=0.0)
    net = {n: _passed_energy(passes, n, into=True) - _passed_energy(passes, n, into=False) for n in enters}
    # from where energy comes to where it goes
    order = sorted(enters, key=lambda name: (net[name], name))
    buses = (Bus(n, size[n], _stubs(enters[n], least), _stubs(leaves[n], least)) for n in order if size[n] > 0.0)
    return Flows(tuple(buses), tuple(p for p in passes if p.energy > 0.0))


def _component(a: Activity) -> str:
    """The component that an element stands in, else its own label."""
    owner, dot, _ = a.label.rpartition(".")
    return owner if dot and a.name else a.label


def _total(stubs: Mapping[tuple[str, str], Sequence[float]]) -> float:
    return sum(map(sum, stubs.values()))


def _passed_energy(passes: Iterable[BusTransfer], name: str, *, into: bool) -> float:
    return sum(p.energy for p in passes if (p.target if into else p.source) == name and p.source != p.target)


def _passes(label: str, ends: Sequence[tuple[str, float]]) -> Iterable[BusTransfer]:
    """From the sides that absorbed to those that gave, by their parts."""
    given = [(name, -e) for name, e in ends if e < 0.0]
    whole = sum(e for _, e in given)
    for source, e in ((name, e) for name, e in ends if e > 0.0):
        for target, part in given:
            if target != source:
                yield BusTransfer(label, source, target, e * part / whole)


def _stubs(found: Mapping[tuple[str, str], Sequence[float]], least: float) -> tuple[Stub, ...]:
    stubs = [Stub(label, role, sum(e)) for (label, role), e in found.items() if sum(e) > 0.0]
    kept = [s for s in stubs if s.energy >= least]
    for role in dict.fromkeys(s.role for s in stubs):
        thin = [s for s in stubs if s.energy < least and s.role == role]
        if thin:
            kept.append(
                Stub(f"{len(thin)} others" if len(thin) > 1 else thin[0].label, role, sum(s.energy for s in thin))
            )
    return tuple(sorted(kept, key=lambda s: -s.energy))


# --- drawing ----------------------------------------------------------------------------------------------------


def picture(found: Activities, name: str, kind: str) -> bytes:
    """PNG or SVG; kind says which."""
    drawn = found.items[:BARS]
    where = flows(found.items)
    high = 1.1 + 0.24 * len(drawn), 3.6

    def draw(figure: Any) -> None:
        bars, below = figure.subplots(2, 1, height_ratios=high)
        _bars(bars, drawn, name)
        _draw(below, where)

    return drawing((max(8.6, 1.6 + 3.2 * len(where.buses)), sum(high)), kind, draw)


def _bars(axis: Any, drawn: Sequence[Activity], name: str) -> None:
    """Activity by element, the largest on top."""
    places = -np.arange(len(drawn))
    axis.barh(places, [a.activity for a in drawn], color=[COLOURS[a.role] for a in drawn], height=0.62)
    axis.set_yticks(places, [_short(a.label) for a in drawn])
    for y, a in zip(places, drawn, strict=True):
        axis.text(a.activity, y, f" {100.0 * a.share:.2g} %", va="center", fontsize=8)
    axis.grid(visible=False, axis="y")
    axis.set_title(printable(name), fontweight="bold", fontsize=11)
    axis.set_xlabel("activity, integral of absolute power, J")
    from matplotlib.patches import Patch

    roles = dict.fromkeys(a.role for a in drawn)
    axis.legend(handles=[Patch(color=COLOURS[r], label=WORDS[r]) for r in roles], loc="lower right", fontsize=8.5)


def _short(label: str) -> str:
    text = printable(label)
    return text if len(text) <= 26 else f"{text[:25]}…"


def _draw(axis: Any, where: Flows) -> None:
    """The buses side by side, their tops at one height."""
    axis.set_axis_off()
    places = {bus.name: k for k, bus in enumerate(where.buses)}
    most = max((bus.size for bus in where.buses), default=0.0)
    if most <= 0.0:
        axis.text(0.5, 0.5, "no energy moves", ha="center", transform=axis.transAxes)
        return
    left, right = dict.fromkeys(places, 0.0), dict.fromkeys(places, 0.0)
    # ribbons between buses, the largest on top
    for p in sorted(where.passes, key=lambda p: -p.energy):
        size = p.energy / most
        a, b = right[p.source], left[p.target]
        _ribbon(axis, (places[p.source] + 0.02, -a), (places[p.target] - 0.02, -b), size)
        middle = (places[p.source] + places[p.target]) / 2, -(a + b + size) / 2
        axis.text(*middle, f"{_short(p.label)}\n{p.energy:.3g} J", ha="center", va="center", fontsize=8)
        right[p.source] += size
        left[p.target] += size
    lowest = 0.0
    # bars, and stubs of what enters and leaves
    for bus in where.buses:
        x, size = places[bus.name], bus.size / most
        axis.fill([x - 0.02, x + 0.02, x + 0.02, x - 0.02], [0, 0, -size, -size], color="#30343b")
        axis.text(x, 0.03, f"{bus.name or 'model'}\n{bus.size:.4g} J", ha="center", va="bottom", fontsize=9)
        low = (
            _stubs_of(axis, bus.enters, x, left[bus.name], most, -1),
            _stubs_of(axis, bus.leaves, x, right[bus.name], most, 1),
        )
        lowest = min(lowest, -size, *low)
    axis.set_xlim(-0.75, len(places) - 0.25)
    axis.set_ylim(lowest - 0.05, 0.28)


def _stubs_of(axis: Any, stubs: Sequence[Stub], x: float, began: float, most: float, side: int) -> float:
    """What enters (side -1) or leaves (1) a bus below what its couplings pass; the lowest place."""
    at, out = began, began + (GAP if began else 0.0)
    for s in stubs:
        size = s.energy / most
        room = max(size, 2.0 * GAP)  # of two lines of text
        top = max(out + (room - size) / 2, at)
        inner, outer = (x + 0.02 * side, -at), (x + STUB * side, -top)
        _ribbon(axis, inner, outer, size, COLOURS[s.role])
        word = WORDS[s.role] if (s.role != "held" or side > 0) else "given by stores"
        word = "returned" if s.role == "in" and side > 0 else word
        text = f"{_short(s.label)}\n{s.energy:.3g} J {word}"
        axis.text(x + (STUB + 0.02) * side, -top - size / 2, text, ha="left" if side > 0 else "right", va="center",
                  fontsize=8)  # fmt: skip
        at += size
        out = top + (room + size) / 2 + GAP / 2
    return -out


def _ribbon(axis: Any, a: tuple[float, float], b: tuple[float, float], size: float, colour: str = "#9aa0a6") -> None:
    """A band of one height from a to b, level at both ends."""
    s = np.linspace(0.0, 1.0, 40)
    x, y = a[0] + (b[0] - a[0]) * s, a[1] + (b[1] - a[1]) * (3.0 - 2.0 * s) * s**2
    axis.fill_between(x, y, y - size, color=colour, alpha=0.55, linewidth=0.0)
