"""Kinks and jumps of a text on unknowns: the switching functions whose sign says which branch holds.

    abs(x), sign(x), step(x)     u = x            max(a, b), min(a, b), a > b     u = a - b
    table of straight pieces     u = x - node, one for each node between two pieces (broken.py)

Where u is zero the text has a kink, or jumps; a text with two continuous derivatives of its value there (f abs(f)) has
neither for a method and is left alone, and so is one whose branch ends there (sqrt(max(h, 0)), sign(x) sqrt(abs(x))),
for none can be held across.  Which of the three it is, is asked of the expressions on the surface u = 0, at
sampled values of everything else; of what stands beside other conditions (raw > hi and err > 0) on both sides of these.
Received: a descriptor form; returned: its `Surface`s, in the order of the text.
What stands in a loop is integrated through; written.py writes loops out before.
"""

from __future__ import annotations

import math
import random
import zlib
from collections.abc import Callable, Iterator, Mapping
from contextlib import suppress

from sysdyn.compiler.forms.descriptor import DescriptorForm
from sysdyn.dsl.model.calculus import derivative
from sysdyn.dsl.model.evaluation import evaluate
from sysdyn.dsl.model.expression import (
    Node,
    compare,
    const,
    linear,
    neg,
    param,
    reads,
    rebuild,
    sub,
    topological,
    var,
    variables,
)
from sysdyn.values import dataclass

JUDGED = ("dynamics", "phi_reaction", "psi_reaction", "momentum", "phi", "psi", "gamma", "lambda")
"""Blocks whose rows say how smooth the motion is: others are derivatives of these, or only read."""
JUMPS, KINK, SMOOTH = 0, 1, 2
"""The least derivative that jumps."""
SAMPLES = 5
TOUCHES = 1e-7
"""Of the magnitudes of both sides: what differs by less does not jump."""
BESIDE, NEAR = 0.5, 1e-3
DRAWS, MANY = 8, 8
"""Further samples for each other condition, and of how many conditions at most."""
SIDES = (-1.0, -1.0, 0.0, 1.0, 1.0)
SECANTS = 4
LEAVES = ("var", "param", "time")
MOST = 200
"""Surfaces of one model: more cost each step more than they save."""


@dataclass(frozen=True, slots=True)
class Surface:
    """u = 0: where the branch changes; jumps: whether a row does there; row: the first row family that has it;
    passage: of a peak (peaks.py), which begins where u becomes positive: how far u goes while it is passed.
    """

    u: Node
    jumps: bool
    row: int
    passage: float = 0.0


@dataclass(frozen=True, slots=True)
class Sided:
    """An operation whose branch is the sign of u: values on both sides; turned: u is the negative of its own."""

    u: Node
    above: Node
    below: Node


YES, NO = compare("==", const(0.0), const(0.0)), compare("!=", const(0.0), const(0.0))


def branches_of(node: Node) -> Sided | None:
    """The two branches of an operation; None of one without."""
    # what changes at zero of its argument
    if node.op == "call" and node.data in ("abs", "sign", "step"):
        (x,) = node.args
        pairs = {"abs": (x, neg(x)), "sign": (const(1.0), const(-1.0)), "step": (const(1.0), const(0.0))}
        return Sided(x, *pairs[node.data])
    # what changes where two arguments meet
    if node.op == "call" and node.data in ("max", "min"):
        a, b = node.args
        return Sided(sub(a, b), a, b) if node.data == "max" else Sided(sub(a, b), b, a)
    # a relation: true on one side of left - right = 0
    if node.op == "cmp" and node.data in (">", ">=", "<", "<="):
        a, b = node.args
        return Sided(sub(a, b), YES, NO) if node.data[0] == ">" else Sided(sub(a, b), NO, YES)
    return None


def watched_branches(node: Node) -> Sided | None:
    """The branches of an operation on unknowns outside all loops."""
    found = branches_of(node)
    if found is None or not any(v.op == "var" for v in variables(found.u)):
        return None
    if any(v.op == "var" and (v.data[1] == "audit" or v.data[2]) for v in variables(found.u)):
        return None
    return None if any(n.op in ("index", "reduce") for n in topological([found.u])) else found


def surfaces(
    form: DescriptorForm, directions: frozenset[str] = frozenset(), floors: frozenset[Node] = frozenset()
) -> tuple[Surface, ...]:
    """All surfaces at which a row is not smooth; none where they are more than MOST.

    directions: parameters of friction in the plane, which the contact itself keeps on one side; floors: what an
    inequality does.
    """
    first: dict[Node, int] = {}
    holding: dict[Node, dict[Node, None]] = {}
    # which expressions hold each switching function; u and -u are one
    for root, row in roots(form):
        for node in topological([root]):
            found = watched_branches(node)
            if found is None or found.u in floors or neg(found.u) in floors:
                continue
            own = reads(found.u, directions)
            u = found.u if neg(found.u) not in first else neg(found.u)
            holding.setdefault(u, {})[root] = None
            if not own:
                first.setdefault(u, row)
    if not 0 < len(first) <= MOST:
        return ()
    kept: list[Surface] = []
    known: dict[tuple[Node, ...], int | None] = {}
    # the least smooth of them decides
    for u, row in first.items():
        level = min(smoothness(root, u, known) for root in holding[u])
        if level < SMOOTH:
            kept.append(Surface(u, level == JUMPS, row))
    return tuple(kept)


def roots(form: DescriptorForm) -> Iterator[tuple[Node, int]]:
    """What rows are made of, and the row family of each."""
    for name in JUDGED:
        block = form.block(name)
        for kernel in block.kernels if block is not None else ():
            for summand in kernel.rows:
                yield summand.expression, summand.row


def side(root: Node, u: Node, above: bool) -> Node:
    """The branch of an expression on one side of u = 0."""

    def branch(node: Node) -> Node | None:
        found = watched_branches(node)
        if found is None or not (found.u is u or found.u is neg(u)):
            return None
        return found.above if (found.u is u) == above else found.below

    return _on_branches(root, branch)


def _on_branches(root: Node, branch: Callable[[Node], Node | None]) -> Node:
    """An expression with operations replaced by the branch of each; None: it stays."""
    done: dict[Node, Node] = {}
    for node in topological([root]):
        taken = branch(node)
        done[node] = rebuild(node, tuple(done[a] for a in node.args)) if taken is None else done_of(taken, done)
    return done[root]


def done_of(branch: Node, done: dict[Node, Node]) -> Node:
    """A branch with what has been done to its parts."""
    for node in topological([branch]):
        if node not in done:
            done[node] = rebuild(node, tuple(done[a] for a in node.args))
    return done[branch]


# -- how smooth ----------------------------------------------------------------------------------------------


def smoothness(root: Node, u: Node, known: dict[tuple[Node, ...], int | None] | None = None) -> int:
    """JUMPS, KINK or SMOOTH: of an expression where u = 0; known: the answers so far, which serve the same text of
    other names (one law of many devices).
    """
    above, below = _unlike(side(root, u, above=True), side(root, u, above=False))
    # max(x, 0) - max(x, 0): the operations cancel
    if above is below:
        return SMOOTH
    known = {} if known is None else known
    key = _number_leaves((u, above, below))
    if key not in known:
        known[key] = _classify_by_samples(u, above, below)
    found = known[key]
    if found is None:
        return KINK if _continuous(root, u) else JUMPS  # what the operation itself does
    return found


def _number_leaves(nodes: tuple[Node, ...]) -> tuple[Node, ...]:
    """Nodes of the same text with leaves numbered as they come."""
    done: dict[Node, Node] = {}
    for node in topological(nodes):
        name = f"#{len(done)}"
        if node.op == "var":
            done[node] = var(name, node.data[1], order=node.data[2])
        elif node.op == "param":
            done[node] = param(name)
        else:
            done[node] = rebuild(node, tuple(done[a] for a in node.args))
    return tuple(done[node] for node in nodes)


def _classify_by_samples(u: Node, above: Node, below: Node) -> int | None:
    """By values on u = 0 of the two branches there; None where none are known."""
    others, found, known = _others((above, below), u), SMOOTH, False
    moved = _mover(u, others)
    # no leaf moves u: never crossed
    if moved is None:
        return SMOOTH
    slopes = [derivative(node, moved) for node in (u, above, below)]
    if _ends((above, below), u, slopes[0], moved):
        return SMOOTH
    # points on the surface: some near, some far out
    for k in range(SAMPLES + DRAWS * min(len(others), MANY)):
        asked = k < SAMPLES
        values = _on_surface(u, slopes[0], moved, _drawn((u,), k) if asked else _on_sides(others, u, k))
        if values is None:
            continue
        both = (above, below, slopes[1], slopes[2])
        beside = {**values, moved: values[moved] + BESIDE}
        try:
            here, there = _values(both, values), _values(both, beside)
        except (ArithmeticError, ValueError, KeyError, TypeError):
            # no value at an ordinary point: a pole or the end of a domain
            if asked:
                return JUMPS
            continue
        known = True
        # values differ: a jump; slopes differ: a kink
        if _differ(here[:2], there[:2], asked=asked):
            return JUMPS
        if _differ(here[2:], there[2:], asked=asked):
            found = KINK
    return found if known else None


def _unlike(above: Node, below: Node) -> tuple[Node, Node]:
    """Both without the terms that their sums have in common: these say nothing of a jump, and are no numbers at some of
    the samples ((V0/(V0 - q))^1.4 beyond V0).
    """
    if above.op != "sum" or below.op != "sum":
        return above, below
    terms = [dict(zip(side.args, side.data[1], strict=True)) for side in (above, below)]
    own = [[(c, n) for n, c in mine.items() if other.get(n) != c] for mine, other in (terms, terms[::-1])]
    constants = (0.0, 0.0) if above.data[0] == below.data[0] else (above.data[0], below.data[0])
    return linear(constants[0], own[0]), linear(constants[1], own[1])


def _ends(sides: tuple[Node, Node], u: Node, slope: Node, moved: Node) -> bool:
    """Whether one of the branches (above, below) is no number beyond u = 0 where it is one on its own side, with other
    conditions held as they are there, as a step holds them.
    """
    values = _on_surface(u, slope, moved, _drawn((u,), 0))
    if values is None:
        return False
    up = math.copysign(1.0, evaluate((slope,), lambda node: _look(node, values))[0])
    for branch, own in zip(sides, (up, -up), strict=True):
        within, beyond = ({**values, moved: values[moved] + away} for away in (own * NEAR, -own * NEAR))
        if _finite(branch, within) and not _finite(_all_on_branches(branch, within), beyond):
            return True
    return False


def _all_on_branches(root: Node, values: Mapping[Node, float]) -> Node:
    """An expression with every operation on the branch that it has at these values."""

    def branch(node: Node) -> Node | None:
        found = branches_of(node)
        if found is None:
            return None
        return found.above if _values((found.u,), values)[0] > 0.0 else found.below

    return _on_branches(root, branch)


def _finite(node: Node, values: Mapping[Node, float]) -> bool:
    try:
        return math.isfinite(_values((node,), values)[0])
    except (ArithmeticError, ValueError, KeyError, TypeError):
        return False


def _others(sides: tuple[Node, ...], u: Node) -> tuple[Node, ...]:
    """What the other conditions of both branches compare with zero."""
    found: dict[Node, None] = {}
    for node in topological(sides):
        on = branches_of(node)
        gap = sub(*node.args) if node.op == "cmp" else on.u if on is not None else u
        known = gap is u or neg(gap) is u or neg(gap) in found
        if not known and any(n.op in LEAVES for n in topological([gap])):
            found[gap] = None
    return tuple(found)


def _mover(u: Node, others: tuple[Node, ...]) -> Node | None:
    """The unknown that takes u to zero: the one that fewest other conditions read, so that these keep their sides."""
    read = [set(variables(gap)) for gap in others]
    own = [n for n in topological([u]) if n.op == "var"]
    return min(own, key=lambda n: sum(n in names for names in read), default=None)


def _values(nodes: tuple[Node, ...], values: Mapping[Node, float]) -> list[float]:
    return evaluate(nodes, lambda node: _look(node, values))


def _differ(here: list[float], there: list[float], *, asked: bool) -> bool:
    """Whether two values differ on the surface, against those there and beside it; asked: where there are none."""
    known = [abs(x) for x in (*here, *there) if math.isfinite(x)]
    if not all(map(math.isfinite, here)):
        return asked
    return abs(here[0] - here[1]) > TOUCHES * sum(known)


def _continuous(root: Node, u: Node) -> bool:
    """Whether the operations at u = 0 are continuous there themselves."""
    on = [n for n in topological([root]) if (s := watched_branches(n)) is not None and (s.u is u or s.u is neg(u))]
    return all(n.op == "call" and n.data in ("abs", "min", "max") for n in on)


def _drawn(roots: tuple[Node, ...], number: int) -> dict[Node, float]:
    return {n: _sample(n, number) for n in topological(roots) if n.op in LEAVES}


def _on_sides(gaps: tuple[Node, ...], u: Node, number: int) -> dict[Node, float]:
    """Values of the leaves at which each gap (difference of a condition) is above, below or on zero, at random."""
    chance = random.Random(number)
    values = _drawn((u, *gaps), number)
    for gap in chance.sample(gaps, len(gaps)):
        leaf = chance.choice([n for n in topological([gap]) if n.op in LEAVES])
        away = chance.choice(SIDES) * chance.uniform(BESIDE, 2.0 * BESIDE)
        with suppress(ArithmeticError, KeyError, TypeError, ValueError):
            values[leaf] = _root_by_secants(gap, leaf, values, away)
    return values


def _root_by_secants(gap: Node, leaf: Node, values: Mapping[Node, float], away: float) -> float:
    """The value of a leaf at which a gap is zero, by secants, or beside it on the side of `away`."""

    def gap_at(x: float) -> float:
        return evaluate((gap,), lambda node: _look(node, {**values, leaf: x}))[0]

    x = values[leaf]
    for _ in range(SECANTS):
        here = gap_at(x)
        x -= here / (gap_at(x + BESIDE) - here) * BESIDE
    x = float(f"{x:.12g}")
    return x + away if gap_at(x + away) * away >= 0.0 else x - away


def _on_surface(u: Node, slope: Node, moved: Node, values: dict[Node, float]) -> Mapping[Node, float] | None:
    """Values of the leaves with u = 0, by Newton on one unknown; None where it finds none."""
    for _ in range(50):
        try:
            at, by = evaluate((u, slope), lambda n: _look(n, values))
        except (ArithmeticError, ValueError, TypeError):
            return None
        if not math.isfinite(at) or not math.isfinite(by) or by == 0.0:
            return None
        change = at / by
        values[moved] -= change
        if abs(change) <= 1e-15 * max(abs(values[moved]), 1e-300):
            return values
    return values if abs(change) <= 1e-12 * (abs(values[moved]) + 1.0) else None


def _sample(leaf: Node, number: int) -> float:
    """A value of a leaf, the same wherever the text is compiled."""
    said = leaf.data[:2] if leaf.op == "var" else leaf.data
    known = zlib.crc32(repr((leaf.op, said)).encode()) % 10007
    return 0.3 + (known * 0.6180339887 + number * 0.7548776662) % 1.0


def _look(node: Node, values: Mapping[Node, float]) -> float:
    """A leaf's value: sampled; of a table, a smooth function's."""
    if node.op == "table":
        return 0.7
    return values[node] if node in values else _sample(node, 0)
