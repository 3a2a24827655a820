"""E520: what is differentiated by time must not jump, for the derivative of a jump is a pulse that no rate tells.

The derivatives of step, sign, floor, mod, of `if` and of tables that hold leave it out.  Where an operation changes its
branch the expression is evaluated on both sides, at two neighbouring doubles: on lines through random points of the
unknowns, each of them moved through all magnitudes, and at every instant of the span at which time alone does it.  An
expression whose branches meet there has a kink, and a rate.  What events assign jumps whenever they do.

Received: a network, its parameters, the span of a run.  Returned: findings.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping

import numpy as np
from numpy.typing import NDArray
from sysdyn.compiler.binding.instants import changes
from sysdyn.compiler.model.interpret import Value, evaluate, grid
from sysdyn.compiler.model.magnitudes import magnitudes
from sysdyn.compiler.model.parameters import Parameters
from sysdyn.dsl.model.calculus import without_signals
from sysdyn.dsl.model.expression import Node, call, rebuild, time, topological, topological_unbound, variables
from sysdyn.dsl.model.expression_text import to_text
from sysdyn.dsl.model.network import Derived, Loop, Network
from sysdyn.dsl.text.diagnostics import Diagnostic, Span

Array = NDArray[np.float64]
STEPPING = ("step", "sign", "setsign", "floor", "ceil", "mod")
POINTS, FEW, MOST = 24, 6, 600
"""Random points for each iteration of the loops, at an instant, and of all together: of either sign, of one magnitude
each between 1e-3 and 1e3.
"""
LINE = np.sinh(np.linspace(-np.arcsinh(1e9), np.arcsinh(1e9), 601)) * 1e-3
"""Values that one unknown takes on a line: both signs of all magnitudes up to 1e6, densest about zero."""
EDGES = 24
"""Changes of one operation that are looked at on the lines of one unknown."""
INSTANTS = 200
"""Instants that are looked at, the first and the last ones of a span with more."""
MEETS = 1e-6
"""Of the terms of an expression: what two branches may differ by and meet, for numbers of the text are rounded."""
_HALVINGS = 1200
HELP = (
    "a ramp in place of the jump (clip, smoothstep, a linear table), or the rate itself: a source of flow,"
    " a state with 'dynamic'"
)


def jumps(network: Network, parameters: Parameters, span: tuple[float, float]) -> tuple[Diagnostic, ...]:
    """E520 for each expression that is differentiated by time and may jump within a span [s] of time."""
    targets = [a.target for e in network.events for a in e.actions]
    assigned = frozenset(
        n.data if n.op == "param" else n.data[0] for n in targets if n.op == "param" or n.data[1] == "s"
    )
    found: dict[tuple[str, Span], Diagnostic] = {}
    for derived in network.derived:
        place = derived.place
        for one in _parts(derived):
            what = _by_event(one.expression, assigned)
            if what is None and any(_steps(n, network) for n in topological_unbound([one.expression])):
                what = _Jumping(one, network, parameters, span).what()
            if what:
                owner = f", in {place.element}" if "." in place.element else ""
                text = (
                    f"what is differentiated by time here jumps {what}{owner}: its rate is a pulse there, which is lost"
                )
                found.setdefault((place.file, place.span), Diagnostic("E520", text, place, HELP))
    return tuple(found.values())


def _by_event(root: Node, assigned: frozenset[str]) -> str | None:
    """What an event assigns of an expression, in words."""
    for node in topological([root]):
        name = node.data if node.op == "param" else node.data[0] if node.op == "var" and node.data[1] == "s" else None
        if name in assigned:
            return f"when an event assigns '{name}'"
    return None


def _steps(node: Node, network: Network) -> bool:
    if node.op == "table":
        return any(t.name == node.data[0] and t.method == "hold" for t in network.tables)
    return node.op == "cmp" or (node.op == "call" and node.data in STEPPING)


def _parts(derived: Derived) -> Iterator[Derived]:
    """The expression, and what is summed in it over ranges, under their loops."""
    plain = _plain(derived.expression)
    stack = [Derived(plain, derived.loops, derived.place)]
    while stack:
        one = stack.pop()
        yield one
        for node in topological_unbound([one.expression]):
            if node.op == "reduce":
                first, last, body = node.args
                stack.append(Derived(body, (*one.loops, Loop(node.data[1], first, last)), one.place))


def _plain(root: Node) -> Node:
    """The expression as functions of numbers."""
    done: dict[Node, Node] = {}
    for node in topological([without_signals(root)]):
        args = tuple(done[a] for a in node.args)
        done[node] = call("sign", *args) if node.op == "call" and node.data == "setsign" else rebuild(node, args)
    return done[without_signals(root)]


class _Jumping:
    """One expression under its loops, at random points: values of its leaves [points] by node."""

    def __init__(self, derived: Derived, network: Network, parameters: Parameters, span: tuple[float, float]) -> None:
        self.root, self.nest = derived.expression, derived.loops
        self.network, self.parameters, self.span = network, parameters, span
        self._tables = {t.name: t for t in network.tables}
        self._random = np.random.default_rng(7)
        self._columns = grid(self.nest, parameters.lookup)

    def what(self) -> str | None:
        """Where it jumps, in words; None where it does not."""
        for t in self._instants():
            if self._jumps_between(self._points(FEW), time(), *_adjacent_doubles(t)):
                return f"at t = {t:.9g} s"
        for node in (n for n in topological_unbound([self.root]) if _steps(n, self.network)):
            moving = sorted((n for n in variables(node) if n.op == "var"), key=lambda n: n.number)
            if any(self._breaks(node, leaf) for leaf in moving):
                return f"where '{to_text(node)}' changes"
        return None

    def _instants(self) -> Array:
        """Where operations of time alone change, those inside and behind the span left out."""
        found = changes(self.parameters, self.span, self.root, self.nest, self._tables)
        half = INSTANTS // 2
        return found if found.size <= INSTANTS else np.concatenate([found[:half], found[-half:]])

    def _points(self, number: int) -> dict[Node | str, Array]:
        """Leaves at random points, so many for each iteration of the loops, or as many iterations as that."""
        size = len(next(iter(self._columns.values()))) if self._columns else 1
        which = np.repeat(np.arange(size), number)
        if which.size > MOST:
            which = self._random.integers(size, size=MOST)
        sizes = 10.0 ** self._random.uniform(-3.0, 3.0, which.size)
        leaves = (n for n in variables(self.root) if n.op == "var")
        found: dict[Node | str, Array] = {name: values[which] for name, values in self._columns.items()}
        for leaf in sorted(leaves, key=lambda n: n.number):
            found[leaf] = sizes * self._random.normal(size=which.size)
        found[time()] = self._random.uniform(*self.span, which.size)
        return found

    def _breaks(self, node: Node, leaf: Node) -> bool:
        """Whether the expression jumps where an operation changes with one of its unknowns."""
        points, label = self._points(POINTS), self._label(node)
        size = points[leaf].size
        which, line = np.repeat(np.arange(size), LINE.size), np.tile(LINE, size)
        # each random point with the leaf moved along LINE: where the branch's label changes, an edge lies between
        labels = self._labels(label, points, which, leaf, line).reshape(size, LINE.size)
        point, place = np.nonzero(labels[:, 1:] != labels[:, :-1])
        # more edges than need be looked at: a sample of them
        if point.size > EDGES * POINTS:
            take = np.sort(self._random.choice(point.size, EDGES * POINTS, replace=False))
            point, place = point[take], place[take]
        if not point.size:
            return False
        low, high, first = LINE[place], LINE[place + 1], labels[point, place]
        # halve until low and high are adjacent doubles on the two sides
        for _ in range(_HALVINGS):
            middle = low + 0.5 * (high - low)
            inside = (middle > low) & (middle < high)
            if not inside.any():
                break
            same = self._labels(label, points, point, leaf, middle) == first
            low, high = np.where(inside & same, middle, low), np.where(inside & ~same, middle, high)
        return self._jumps_between({name: values[point] for name, values in points.items()}, leaf, low, high)

    def _label(self, node: Node) -> tuple[tuple[Node, ...], Callable[..., Array]]:
        """The arguments of an operation, and what is constant on its branches."""
        if node.op == "table":
            points = np.asarray(self._tables[node.data[0]].points[0], dtype=float)
            return node.args, lambda x: np.searchsorted(points, x, side="right").astype(float)
        if node.op == "cmp":
            return node.args, lambda a, b: np.sign(a - b)
        whole = node.data in ("floor", "ceil")
        if node.data == "mod":
            return node.args, lambda a, b: np.floor(a / b)
        return node.args, (np.floor if node.data == "floor" else np.ceil) if whole else np.sign

    def _labels(
        self,
        label: tuple[tuple[Node, ...], Callable[..., Array]],
        points: Mapping[Node | str, Array],
        which: NDArray[np.int64],
        leaf: Node,
        values: Array,
    ) -> Array:
        """Labels at points [which] with one leaf at values [which]."""
        here = {name: held[which] for name, held in points.items()} | {leaf: values}
        found = evaluate(label[0], self._look(here))
        with np.errstate(all="ignore"):
            full = [np.broadcast_to(np.asarray(v, dtype=float), values.shape) for v in found]
            return np.nan_to_num(label[1](*full))

    def _look(self, here: Mapping[Node | str, Array]) -> Callable[[Node, list[Value]], Value]:
        """Values of leaves at points."""

        def look(node: Node, args: list[Value]) -> Value:
            own = here.get(node.data if node.op == "index" else node)
            return self.parameters.lookup(node, args) if own is None else own

        return look

    def _jumps_between(self, points: Mapping[Node | str, Array], leaf: Node, *sides: Array | float) -> bool:
        """Whether the expression differs at any points where one leaf has the values of two sides."""
        shape = points[leaf].shape
        looks = [self._look({**points, leaf: np.broadcast_to(side, shape)}) for side in sides]
        with np.errstate(all="ignore"):
            found = [np.asarray(evaluate([self.root], look)[0], dtype=float) for look in looks]
            sizes = [magnitudes([self.root], look, self.parameters.table_size)[0] for look in looks]
            return bool((np.abs(found[0] - found[-1]) > MEETS * np.maximum(*sizes)).any())


def _adjacent_doubles(t: float) -> tuple[float, float]:
    """The doubles before and behind an instant."""
    return float(np.nextafter(t, -np.inf)), float(np.nextafter(t, np.inf))
