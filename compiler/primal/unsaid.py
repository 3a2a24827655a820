"""Contents of stores that nothing is said of: guesses of zero, where no coordinate alone tells them.

Where a store stands between coordinates (an ungrounded capacitor in the complementary family, an inductor in two
meshes) the least change of these coordinates is not the least change of what it holds.  All stores that share a
coordinate with such a one are then measured by their contents.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence

from sysdyn.compiler.primal.reading import Reader
from sysdyn.dsl.expression import Node, const, var, variables
from sysdyn.dsl.network import Branch, Energy, Initial, Loop, Network

_CONTENT = {"potential": "bq", "kinetic": "bp"}


def unsaid(network: Network, initials: Sequence[Initial], reader: Reader, *, reflected: bool) -> Iterator[Initial]:
    """One guess for the stores of a statement whose contents follow from several coordinates, or beside those; where
    the text says something of them that counts a million times as much.

    Between common-flow nodes of the author's network positions are guessed, not lengths.
    """
    found: list[tuple[Initial, set[str]]] = []
    shared: set[str] = set()
    known = {initial.store for initial in initials}
    for b in network.branches:
        if b.kind not in _CONTENT or (b.kind == "potential" and b.domain.common == "flow" and not reflected):
            continue
        unit = b.domain.displacement if b.kind == "potential" else b.domain.effort
        for loops, content in _contents(b, reader):
            read = {n for n in variables(content) if n.op == "var"}
            if len(read) > 1:
                shared |= _owners(read)
            if b.name not in known:
                guess = Initial(content, const(0.0), False, loops, b.place, b.name, unit.text)
                found.append((guess, _owners(read)))
    shared -= _written(network.energies)
    yield from (initial for initial, owners in found if owners & shared)


def _contents(b: Branch, reader: Reader) -> Iterator[tuple[tuple[Loop, ...], Node]]:
    """The contents of the elements of a statement, in coordinates, over the loops in which they are alike."""
    content = var(b.name, _CONTENT[b.kind], *b.at)
    return reader.cut(b.loops, b.place, lambda ranges: reader.resolve(content, ranges))


def _owners(read: Iterable[Node]) -> set[str]:
    return {n.data[0] for n in read}


def _written(energies: Iterable[Energy]) -> set[str]:
    """Coordinates that energies of the text read: what these hold is no store's content."""
    return _owners(n for e in energies for n in variables(e.expression) if n.op == "var")
