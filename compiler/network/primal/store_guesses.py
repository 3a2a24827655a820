"""Guesses of what stores hold, where no coordinate alone tells it: zero, or what the text guesses.

Where a store stands between coordinates (an ungrounded capacitor in the complementary family, an inductor in two
meshes), or several stores on one (capacitors in parallel there), the least change of these coordinates is not the least
change of what is held.  All stores that share a coordinate with such a one are then measured by their contents.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence, Set
from dataclasses import replace

from sysdyn.compiler.network.primal.bounds import Box, WholeNumbers, meet
from sysdyn.compiler.network.primal.contents import TELLING, contents_by_text
from sysdyn.compiler.network.primal.cycles import in_loops
from sysdyn.compiler.network.primal.integrals import line
from sysdyn.compiler.network.primal.overlaps import ranges_of, restrict_loops, untold
from sysdyn.compiler.network.primal.reading import Rewriter
from sysdyn.dsl.model.expression import Node, const, var, variables
from sysdyn.dsl.model.network import Branch, EnergyTerm, InitialCondition, Loop, Network


def guess_contents(
    network: Network,
    constant: Set[Branch],
    initials: Sequence[InitialCondition],
    sizes: WholeNumbers,
    reader: Rewriter,
    *,
    reflected: bool,
) -> tuple[tuple[InitialCondition, ...], frozenset[str]]:
    """One guess for the stores of a statement that are measured by their contents; the stores all of whose guesses by
    the text are among them.  constant: those that hold the same whatever happens.

    Between common-flow nodes of the author's network positions are guessed, not lengths, but where the text guesses
    lengths that close a loop, or all of them.
    """
    found: list[tuple[InitialCondition, set[tuple[str, str]]]] = []
    shared: set[tuple[str, str]] = set()
    held: dict[tuple[str, str], list[Box]] = {}
    known = {initial.store for initial in initials}
    lengths = [b for b in network.branches if b.kind == "potential" and b.domain.common == "flow" and not reflected]
    positions = set[Branch]() if _lengths_guessed(lengths, initials) else set(lengths)
    # stores whose contents follow from coordinates
    for b in network.branches:
        if b.kind not in TELLING or b in constant or b in positions:
            continue
        unit = b.domain.displacement if b.kind == "potential" else b.domain.effort
        for loops, content, read in _contents(b, b.loops, reader):
            # by several coordinates: none of them is measured alone
            if len(read) > 1 or (
                b.kind == "kinetic" and any(line(content, n) is None for n in read & _unknowns(content))
            ):
                shared |= _owners(read)
                continue
            # two stores measured by one coordinate share it
            for node in read:
                others = held.setdefault((node.data[0], node.data[1]), [])
                box = sizes.reach(node.args, ranges_of(loops, sizes, b.place), b.place)
                shared |= _owners((node,)) if any(meet(box, other) for other in others) else set()
                others.append(box)
        for part in () if b.name in known else _parts(b, initials, sizes):
            for loops, content, moving in _contents(b, part.loops, reader):
                guess = replace(part, target=content, loops=loops, store=b.name, unit=unit.text)
                found.append((guess, _owners(moving)))
    written, names = _written(network.energies), set[str]()
    shared -= written
    # what shares a coordinate with a shared one is shared
    while more := {initial.store for initial, owners in found if owners & shared} - names:
        names |= more
        shared |= {owner for initial, owners in found if initial.store in more for owner in owners} - written
    kept = tuple(initial for initial, _ in found if initial.store in names)
    return kept, frozenset(i.store for i in kept if i.said)


def _lengths_guessed(lengths: Sequence[Branch], initials: Sequence[InitialCondition]) -> bool:
    """Whether the text tells the contents of such stores that close a loop, where guesses may miss each other, or of
    all: guesses of positions are none then.
    """
    told = [b for b in lengths if b.plus and b.minus and any(_tells(i, b) for i in initials)]
    guessed = any(_tells(i, b) and not i.fixed for b in told for i in initials)
    return guessed and (
        len(told) == len(lengths)
        or bool(in_loops([(b.plus.node or "", b.minus.node or "", 1) for b in told if b.plus and b.minus]))
    )


def _parts(b: Branch, initials: Sequence[InitialCondition], sizes: WholeNumbers) -> Iterator[InitialCondition]:
    """Guesses of the contents of a statement's elements: by the text, fixed or not, and zero where it says nothing, or
    in words of which only the start can tell a content.
    """
    telling = list[InitialCondition]()
    for i, loops, content in contents_by_text(b, [i for i in initials if _tells(i, b)], sizes):
        telling.append(i)
        yield replace(i, value=content, loops=loops, fixed=False, said=not i.fixed)
    within = ranges_of(b.loops, sizes, b.place)
    zero = InitialCondition(const(0.0), const(0.0), False, b.loops, b.place, said=False)
    yield from (replace(zero, loops=restrict_loops(b.loops, ranges)) for ranges in untold(telling, b.at, within, sizes))


def _tells(i: InitialCondition, b: Branch) -> bool:
    """Whether an initial condition is about what a store holds."""
    if i.target.op != "var" or i.target.data[0] != b.name:
        return False
    return i.target.data[1] in TELLING[b.kind] and not i.target.data[2]


def _contents(
    b: Branch, loops: tuple[Loop, ...], reader: Rewriter
) -> Iterator[tuple[tuple[Loop, ...], Node, set[Node]]]:
    """The contents of the elements of a statement over these loops, in coordinates, and those that move them: of a
    content that is a state of its own those of its law.
    """
    flow, held = TELLING[b.kind]
    for at, content in reader.cut(loops, b.place, lambda ranges: reader.resolve(var(b.name, held, *b.at), ranges)):
        moving = _unknowns(content)
        if b.kind == "kinetic" and moving and all(n.data[1] == "s" for n in moving):
            law = reader.cut(at, b.place, lambda ranges: reader.resolve(var(b.name, flow, *b.at), ranges))
            moving = {n for _, told in law for n in _unknowns(told)}
        yield at, content, moving


def _unknowns(root: Node) -> set[Node]:
    return {n for n in variables(root) if n.op == "var"}


def _owners(read: Iterable[Node]) -> set[tuple[str, str]]:
    """Names and kinds: contents of efforts and of flows that one node integrates share nothing."""
    return {(n.data[0], n.data[1]) for n in read}


def _written(energies: Iterable[EnergyTerm]) -> set[tuple[str, str]]:
    """Coordinates that energies of the text read: what these hold is no store's content."""
    return _owners(n for e in energies for n in variables(e.expression) if n.op == "var")
