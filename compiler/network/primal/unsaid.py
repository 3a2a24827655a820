"""Contents of stores that nothing is said of: guesses of zero, where no coordinate alone tells them.

Where a store stands between coordinates (an ungrounded capacitor in the complementary family, an inductor in two
meshes) the least change of these coordinates is not the least change of what it holds.  All stores that share a
coordinate with such a one are then measured by their contents.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence

from sysdyn.compiler.network.primal.bounds import Sizes
from sysdyn.compiler.network.primal.overlaps import beside, meeting, narrowed, ranges_of
from sysdyn.compiler.network.primal.reading import Reader
from sysdyn.dsl.model.expression import Node, const, var, variables
from sysdyn.dsl.model.network import Branch, Energy, Initial, Loop, Network

_CONTENT = {"potential": "bq", "kinetic": "bp"}
_SAYING = {"potential": ("be", "bq"), "kinetic": ("bf", "bp")}


def unsaid(
    network: Network, initials: Sequence[Initial], sizes: Sizes, reader: Reader, *, reflected: bool
) -> Iterator[Initial]:
    """One guess for the stores of a statement whose contents follow from several coordinates, or beside those.

    Between common-flow nodes of the author's network positions are guessed, not lengths.
    """
    found: list[tuple[Initial, set[str]]] = []
    shared: set[str] = set()
    known = {initial.store for initial in initials}
    for b in network.branches:
        if b.kind not in _CONTENT or (b.kind == "potential" and b.domain.common == "flow" and not reflected):
            continue
        unit = b.domain.displacement if b.kind == "potential" else b.domain.effort
        for _, content in _contents(b, b.loops, reader):
            read = _unknowns(content)
            if len(read) > 1:
                shared |= _owners(read)
        for part in () if b.name in known else _parts(b, initials, sizes):
            for loops, content in _contents(b, part, reader):
                guess = Initial(content, const(0.0), False, loops, b.place, b.name, unit.text)
                found.append((guess, _owners(_unknowns(content))))
    shared -= _written(network.energies)
    yield from (initial for initial, owners in found if owners & shared)


def _parts(b: Branch, initials: Sequence[Initial], sizes: Sizes) -> Iterator[tuple[Loop, ...]]:
    """The loops over the elements of a statement but for those whose content is guessed: a fixed one stays anyway."""
    within = ranges_of(b.loops, sizes, b.place)
    said = [i for i in initials if not i.fixed and i.target.op == "var" and i.target.data[0] == b.name]
    said = [i for i in said if i.target.data[1] in _SAYING[b.kind] and not i.target.data[2]]
    holes = [found[0] for i in said if (found := meeting(i, b.at, within, sizes)) is not None]
    yield from (narrowed(b.loops, rest) for rest in beside(within, holes))


def _contents(b: Branch, loops: tuple[Loop, ...], reader: Reader) -> Iterator[tuple[tuple[Loop, ...], Node]]:
    """The contents of the elements of a statement over these loops, in coordinates."""
    content = var(b.name, _CONTENT[b.kind], *b.at)
    return reader.cut(loops, b.place, lambda ranges: reader.resolve(content, ranges))


def _unknowns(root: Node) -> set[Node]:
    return {n for n in variables(root) if n.op == "var"}


def _owners(read: Iterable[Node]) -> set[str]:
    return {n.data[0] for n in read}


def _written(energies: Iterable[Energy]) -> set[str]:
    """Coordinates that energies of the text read: what these hold is no store's content."""
    return _owners(n for e in energies for n in variables(e.expression) if n.op == "var")
