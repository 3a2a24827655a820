"""`.tran` and what is shown as a scene."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping

from sysdyn.cli.spice.circuit import GROUND, Netlist
from sysdyn.cli.spice.writing import quantity

MOST, STEPS = 1e5, 1000
"""Rows of a trace at most, and of one whose step would make more or is not given."""
SHOWN = 24
"""Nodes that are traced where nothing is asked."""


def scene(netlist: Netlist, model: str, nodes: Mapping[str, str], labels: Mapping[str, str]) -> Iterator[str]:
    """Lines of the scene; nodes, labels: names of the language by those of the netlist."""
    if netlist.tran is None:
        return
    step, end, _ = netlist.tran
    traced = [t for text in netlist.shown if (t := _read(text, nodes, labels)) is not None]
    traced = traced or [f"{n}.e as v_{_plain(word)}" for word, n in list(nodes.items())[:SHOWN]]
    yield f"scene tran of {model} {{"
    yield f"  time 0 s to {quantity(end, 's')}"
    every = quantity(step if end <= MOST * step else end / STEPS, "s")
    if traced:
        yield f"  trace {', '.join(dict.fromkeys(traced))} every {every}"
    yield "}"


def _read(text: str, nodes: Mapping[str, str], labels: Mapping[str, str]) -> str | None:
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
