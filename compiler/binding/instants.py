"""Instants at which a model's text jumps or has a kink in time alone: where a step ends and the integration restarts.

Watched are the arguments of step, sign, abs, min, max, floor, ceil, mod, of comparisons and of tables, where they
depend on time, parameters and loop variables and on no unknown (language, rule 17), and conditions of events that do.
Each has a label that is constant on smooth pieces: the sign of its argument, the whole number below it, the piece of
its table.  Where the argument is affine in time the candidates are computed; otherwise it is sampled ever more
densely, between the instants of what stands inside it, until the number of changes stays.  Bisection then ends at two
neighbouring doubles, evaluated by the operations that the generated code does, so that the instant is the very double
at which the text changes; where round-off turns it to and fro around there, the first and the last of these are given.

Received: a descriptor form and a binding; returned: `TextInstants`.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace

import numpy as np
from sysdyn.compiler.binding.binding import Binding
from sysdyn.compiler.binding.labels import Array, Label, Labels, TimedOperation, Whole
from sysdyn.compiler.forms.descriptor import WITHOUT_ENTRIES, DescriptorForm
from sysdyn.compiler.model.interpret import grid
from sysdyn.compiler.model.parameters import Parameters
from sysdyn.compiler.model.terms import Nest
from sysdyn.dsl.model.expression import Node, topological, topological_unbound, variables
from sysdyn.dsl.model.network import Loop, Table
from sysdyn.values import dataclass

MOST = 10_000
"""Instants beyond which none is given: restarts would cost more than the steps they save."""
SAMPLES = 4096
"""Of an argument that is not affine, at first; doubled until two countings agree."""
BUDGET = 4_000_000
"""Evaluations of one argument, over all iterations of its loops."""
PER_PIECE = 8
"""Samples at least between two instants of what stands inside an argument."""
ROUND_OFF = 1e-14
"""Of the span: what begins nearer to t0 began at t0."""
LAST = 1e-12
"""Of the span: what is looked at for an event at its end."""


@dataclass(frozen=True, slots=True)
class TextInstants:
    """times [s], ascending; note: a sentence where the text has instants that are not among them."""

    times: Array
    note: str | None = None


class _TooManyError(Exception):
    """More instants than MOST."""


def instants(
    form: DescriptorForm,
    binding: Binding,
    t0: float,
    t1: float,
    tables: Sequence[Table] = (),
    read: Sequence[Node] = (),
    crossed: Sequence[Node] = (),
    closed: Sequence[Node] = (),
) -> TextInstants:
    """All instants in (t0, t1], and t0 where the text jumps behind it; tables: of the network; read: what events read;
    crossed: whose zeros are events, which no step may pass over twice; closed: those of them that happen at the zero
    itself (`t >= T`), so that one at t1, which no step crosses, is an instant.  None of them, with a note, where they
    are more than MOST.
    """
    search = _InstantSearch(binding.parameters, t0, t1)
    try:
        # jumps and kinks of what is integrated and of what events read
        for watched in _watched_operations(form, {t.name: t for t in tables}, read):
            search.add(watched)
        # events at instants: affine ones a step finds by itself
        for node in crossed:
            if _in_time_alone(node) and _degree((node,)) > 1:
                search.add(_zeros(node, (node,)))
        times = search.times()
        if _ends(binding.parameters, t0, t1, closed):
            times = distinct(times, np.array([t1]))
    except _TooManyError:
        text = f"the text jumps or has kinks at more than {MOST} instants: they are integrated through"
        return TextInstants(np.zeros(0), text)
    return TextInstants(times, search.note)


def turns(binding: Binding, t0: float, t1: float, slope: Node) -> Array:
    """Instants (s) in (t0, t1], ascending, at which an expression of time alone passes zero; none beyond MOST."""
    search = _InstantSearch(binding.parameters, t0, t1)
    try:
        search.add(_zeros(slope, (slope,)))
        return search.times()
    except _TooManyError:
        return np.zeros(0)


def changes(
    parameters: Parameters, span: tuple[float, float], root: Node, nest: Nest, tables: Mapping[str, Table]
) -> Array:
    """Instants (s) of a span, ascending, at which an operation of time alone in it changes; none beyond MOST."""
    search = _InstantSearch(parameters, *span)
    try:
        for node in topological_unbound([root]):
            for watched in _watches_of(node, dict(tables)):
                search.add(replace(watched, nest=_trim_nest(watched.arguments, nest)))
        return search.times()
    except _TooManyError:
        return np.zeros(0)


def _ends(parameters: Parameters, t0: float, t1: float, closed: Sequence[Node]) -> bool:
    """Whether one of some expressions, of time alone, passes zero at t1, but for round-off."""
    search = _InstantSearch(parameters, t1 - LAST * (t1 - t0), t1 + ROUND_OFF * max(abs(t0), abs(t1)))
    for node in closed:
        if _in_time_alone(node):
            search.add(_zeros(node, (node,)))
    return bool(search.times().size)


def _zeros(node: Node, arguments: tuple[Node, ...]) -> TimedOperation:
    """The zeros of its one argument."""
    return TimedOperation(node, arguments, lambda v: np.sign(v[0]), np.zeros(1), ())


def _watched_operations(
    form: DescriptorForm, tables: dict[str, Table], read: Sequence[Node]
) -> Iterator[TimedOperation]:
    """Operations of all rows that are integrated, and of what events read, those inside others first."""
    stack: list[tuple[Node, Nest]] = [(node, ()) for node in read]
    for block in form.blocks:
        if block.name not in WITHOUT_ENTRIES and block.name != "initial":
            stack += [(row.expression, kernel.nest) for kernel in block.kernels for row in kernel.rows]
    seen: set[tuple[Node, Nest]] = set()
    while stack:
        root, nest = stack.pop()
        for node in topological_unbound([root]):
            # the body of a reduction under its own loop
            if node.op == "reduce":
                first, last, body = node.args
                stack.append((body, (*nest, Loop(node.data[1], first, last))))
            for watched in _watches_of(node, tables):
                kept = _trim_nest(watched.arguments, nest)
                if (node, kept) not in seen:
                    yield TimedOperation(node, watched.arguments, watched.label, watched.levels, kept)
            seen.add((node, _trim_nest(node.args, nest)))


def _watches_of(node: Node, tables: dict[str, Table]) -> Iterator[TimedOperation]:
    """What is watched of a node; nothing where it does not depend on time alone."""
    if not any(_in_time_alone(a) for a in node.args):
        return
    # kinks at breakpoints, in each argument that follows time
    if node.op == "table":
        table = tables.get(node.data[0])
        for argument, points in zip(node.args, table.points if table else (), strict=False):
            if table is not None and _in_time_alone(argument):
                at = np.asarray(points, dtype=float)
                at = at[[0, -1]] if table.method == "cubic" else at  # a spline is smooth enough inside
                yield TimedOperation(node, (argument,), _piece(at), at, ())
        return
    if not all(_in_time_alone(a) or not variables(a) for a in node.args):
        return
    # where two sides are equal
    if node.op == "cmp" or (node.op == "call" and node.data in ("min", "max")):
        yield TimedOperation(node, node.args, lambda v: np.sign(v[0] - v[1]), np.zeros(1), ())
    elif node.op == "call" and node.data in ("step", "abs", "sign"):
        yield _zeros(node, node.args)
    # at whole numbers
    elif node.op == "call" and node.data in ("floor", "ceil"):
        rounded = np.floor if node.data == "floor" else np.ceil
        yield TimedOperation(node, node.args, lambda v: np.asarray(rounded(v[0])), None, ())
    # at whole quotients
    elif node.op == "call" and node.data == "mod":
        yield TimedOperation(node, node.args, lambda v: np.floor(v[0] / v[1]), None, ())


def _piece(points: Array) -> Label:
    return lambda v: np.searchsorted(points, v[0], side="right").astype(float)


def _in_time_alone(node: Node) -> bool:
    found = variables(node)
    return bool(found) and all(leaf.op == "time" for leaf in found)


def _trim_nest(arguments: tuple[Node, ...], nest: Nest) -> Nest:
    """The loops whose variables the arguments use, and those that these loops' bounds use."""
    used = {n.data for n in topological(arguments) if n.op == "index"}
    kept: list[Loop] = []
    for loop in reversed(nest):
        if loop.index in used:
            kept.append(loop)
            used |= {n.data for n in topological([loop.first, loop.last]) if n.op == "index"}
    return tuple(reversed(kept))


def _degree(roots: tuple[Node, ...]) -> int:
    """Degree in time: 0, 1, or 2 for all that is not affine."""
    found: dict[Node, int] = {}
    for node in topological(roots):
        inside = [found[a] for a in node.args]
        most = max(inside, default=0)
        # t is 1; 2 + 3*t and p*t are still affine; t*t, t^2 and sin(t) are not
        if node.op == "time":
            found[node] = 1
        elif node.op == "sum" or most == 0:
            found[node] = most
        elif node.op == "mul":
            moving = [e for e, d in zip(node.data, inside, strict=True) if d]
            found[node] = most if moving == [1.0] else 2
        else:
            found[node] = 2
    return max(found[r] for r in roots)


def distinct(*found: Array) -> Array:
    """All of some numbers in their order, each once (NumPy's `unique` imports masked arrays: 12 ms of a command)."""
    every = np.sort(np.concatenate(found))
    first = np.ones(every.size, dtype=bool)
    first[1:] = every[1:] != every[:-1]
    return every[first]


class _InstantSearch:
    """Collects instants of one binding in (t0, t1)."""

    def __init__(self, parameters: Parameters, t0: float, t1: float) -> None:
        self._parameters = parameters
        self.t0, self.t1 = t0, t1
        self.note: str | None = None
        self._found: dict[Node, Array] = {}

    def times(self) -> Array:
        """Everything found so far."""
        every = distinct(np.zeros(0), *self._found.values())
        if np.count_nonzero(np.diff(every) > ROUND_OFF * (self.t1 - self.t0)) >= MOST:
            raise _TooManyError
        return every

    def add(self, watched: TimedOperation) -> None:
        """The instants of one operation."""
        columns = grid(watched.nest, self._parameters.lookup)
        number = len(next(iter(columns.values()))) if columns else 1
        if number == 0:
            return
        # arrays of very many elements
        if 2 * number > BUDGET:
            self.note = f"instants in the text of {number} elements are not searched for: they are integrated through"
            return
        labels = Labels(watched, columns, self._parameters.lookup)
        try:
            brackets = self._affine(watched, labels, number) or self._bracket_changes(watched, labels, number)
        except KeyError:  # a constant that is known at the start only
            return
        # what jumps at the start itself is an instant there
        start = self.t0 + ROUND_OFF * (self.t1 - self.t0)
        found = labels.bisect(*brackets, start)
        near = found <= start  # the start lies on its own right side
        found = found[~near & (found <= self.t1)]
        if near.any() and labels.jumps(np.arange(number), self.t0, self.t0 + 1e-6 * (self.t1 - self.t0)):
            found = np.append(found, self.t0)
        # one node may stand under several nests
        found = distinct(found)
        before = self._found.get(watched.node, found)
        self._found[watched.node] = distinct(before, found)
        self.times()

    def _affine(self, watched: TimedOperation, labels: Labels, number: int) -> tuple[Whole, Array, Array] | None:
        """Brackets around the computed crossings; None where the argument is not affine."""
        arguments = watched.arguments
        whole = watched.levels is None and watched.node.data == "mod"
        if _degree(arguments[:1] if whole else arguments) > 1 or (whole and _degree(arguments[1:]) > 0):
            return None
        every = np.arange(number)
        # linear in time: the values at both ends tell all crossings
        ends = [labels.measure(every, np.full(number, t), quotient=whole) for t in (self.t0, self.t1)]
        slope = (ends[1] - ends[0]) / (self.t1 - self.t0)
        low, high = np.minimum(*ends), np.maximum(*ends)
        if not np.isfinite(low).all() or not np.isfinite(high).all():
            return None
        which: list[Whole] = []
        level: list[Array] = []
        # floor, ceil, mod: every whole number between
        if watched.levels is None:
            first, count = np.floor(low), np.maximum(np.ceil(high) - np.floor(low) + 1.0, 0.0)
            if count.sum() > 4 * MOST + 4 * number:
                raise _TooManyError
            for k in range(int(count.max())):
                take = every[k < count]
                which.append(take)
                level.append(first[take] + k)
        # given levels: breakpoints, zero
        else:
            for value in watched.levels:
                take = every[(low <= value) & (value <= high)]
                which.append(take)
                level.append(np.full(take.size, value))
        index, at = np.concatenate([every[:0], *which]), np.concatenate([np.zeros(0), *level])
        moving = slope[index] != 0.0
        index, at = index[moving], at[moving]
        if index.size > 4 * MOST + 4 * number:
            raise _TooManyError
        # by division, then a bracket of some roundings around it
        t = self.t0 + (at - ends[0][index]) / slope[index]
        around = 1e-12 * np.maximum(max(abs(self.t0), abs(self.t1)), np.abs(t))
        return index, np.maximum(t - around, self.t0), np.minimum(t + around, self.t1)

    def _bracket_changes(self, watched: TimedOperation, labels: Labels, number: int) -> tuple[Whole, Array, Array]:
        """Brackets between neighbouring samples of different labels, on pieces smooth inside."""
        inside = [self._found[n] for n in topological(watched.arguments) if n in self._found]
        edges = distinct(np.array([self.t0, self.t1]), *inside)
        left, right = np.nextafter(edges[:-1], np.inf), np.nextafter(edges[1:], -np.inf)
        keep = right > left
        left, right = left[keep], right[keep]
        left[:1], right[-1:] = self.t0, self.t1
        random = np.random.default_rng(7)
        each = max(PER_PIECE, SAMPLES // left.size)
        before = -1
        while True:
            part = (np.arange(each) + random.uniform(0.1, 0.9, (left.size, each))) / each
            t = np.concatenate([left[:, None], left[:, None] + (right - left)[:, None] * part, right[:, None]], axis=1)
            pairs = np.repeat(np.arange(number), t.size), np.tile(t.ravel(), number)
            value = labels.labels_at(*pairs).reshape(number, *t.shape)
            k, piece, place = np.nonzero(value[..., 1:] != value[..., :-1])
            if k.size > 4 * MOST:
                raise _TooManyError
            if k.size == before or 2 * each * left.size * number > BUDGET:
                return k, t[piece, place], t[piece, place + 1]
            before, each = k.size, 2 * each
