"""Where a signal of time alone varies within a small part of the span: an integration that is quiet would step over it.

Every largest expression of time, parameters and loop variables in the rows that are integrated is enclosed (enclosures)
over cells of the span; a cell is halved where its bounds exceed the values at its ends by more than HIDDEN of the
signal's size, or differ by more than VARIES.  So nothing is missed however narrow it is, and a smooth signal costs few
cells, all of the same size where it oscillates.  Where a run of small cells stands between large ones a pulse is there:
steps end at its beginning, within it and at its end; not where it only rises or falls between instants at which they
end anyhow.

Received: a descriptor form and a binding; returned: instants [s].
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

import numpy as np
from sysdyn.compiler.binding.binding import Binding
from sysdyn.compiler.binding.enclosures import Array, Bounds, Outline, Values, enclose
from sysdyn.compiler.binding.instants import ROUND_OFF, distinct, turns
from sysdyn.compiler.forms.descriptor import WITHOUT_ENTRIES, DescriptorForm
from sysdyn.compiler.model.interpret import Value, evaluate, grid
from sysdyn.compiler.model.terms import Nest
from sysdyn.dsl.model.calculus import differential
from sysdyn.dsl.model.expression import Node, const, topological_unbound, variables
from sysdyn.dsl.model.network import Loop, Table

NONE: Array = np.zeros(0)
HIDDEN, VARIES = 3e-3, 0.1
"""Of the signal's size: what a cell may hide, and how far its bounds may differ.  Of a sine both ask the same."""
CELLS = 37
"""Of the span at first: a prime number, so that few signals repeat with them."""
NARROW = 1.0 / 250.0
"""Of the span: cells below it may belong to what a step passes over, be it as long as it may."""
FINE, FINER = 0.25, 0.125
"""Of NARROW: a run of cells below that has one below FINE among them; and NARROW of the next search."""
ISOLATED = 25.0
"""Times NARROW: what lasts longer meets a step whatever its length (runtime/integrate/request.py, LONGEST)."""
DEPTH = 40
MOST = 32768
"""Cells of one signal that are halved at once: one that fills the span with them is no pulse; steps follow it."""
ELEMENTS = 32
"""Iterations of loops that are looked at one by one."""
PULSES = 1000
ASIDE = 1e-6
"""Of a stretch between two instants: what stands aside of them."""
TURNS = 1e-5
"""Of the span: between two extremes of a signal that may be followed."""


def pulses(
    form: DescriptorForm,
    binding: Binding,
    t0: float,
    t1: float,
    tables: Sequence[Table] = (),
    crossed: Sequence[Node] = (),
    known: Array = NONE,
) -> Array:
    """Instants [s] in (t0, t1), ascending, at which steps should end so that no pulse is passed over; crossed: whose
    zeros are events; known: at which steps end anyhow [s].
    """
    outlines = {t.name: _outline(t) for t in tables if len(t.points) == 1}
    found: list[Array] = []
    # each element by itself, up to a number of elements
    for root, nest in _signals(form, crossed):
        columns = grid(nest, binding.parameters.lookup)
        number = len(next(iter(columns.values()))) if columns else 1
        for k in range(min(number, ELEMENTS)):
            held = {name: float(values[k]) for name, values in columns.items()}
            try:
                found += _pulses_of(_outline_of(root, _evaluator_at_rest(binding, held), outlines), t0, t1, known)
            except KeyError:  # a constant that is known at the start only
                break
    times = distinct(np.zeros(0), *found)
    times = times[(times > t0) & (times < t1)]
    return times if times.size <= 5 * PULSES else times[:0]


def quickest(binding: Binding, t0: float, t1: float, read: Sequence[Node], form: DescriptorForm | None = None) -> float:
    """The least time [s] in which a signal of time alone in any of these expressions, and in the rows of the form, goes
    from one extreme to the next, TURNS of the span at least; infinite where none turns twice.
    """
    found = np.inf
    for root, _ in _signals(form, read):
        if any(node.op == "index" for node in topological_unbound([root])):
            continue  # of elements of an array each has its own
        slope = differential(root, {leaf: const(1.0) for leaf in variables(root)})
        times = np.concatenate([[t0], turns(binding, t0, t1, slope), [t1]])
        apart = np.diff(times)[1:-1]  # the ends are no extremes
        found = min(found, float(apart[apart > TURNS * (t1 - t0)].min(initial=np.inf)))
    return found


def _evaluator_at_rest(binding: Binding, held: Mapping[str, float]) -> Values:
    """Values of what does not depend on time, in one iteration of the loops around it."""

    def look(node: Node, args: list[Value]) -> Value:
        own = node.op == "index" and node.data in held
        return held[node.data] if own else binding.parameters.lookup(node, args)

    return lambda nodes: evaluate(nodes, look)


def _signals(form: DescriptorForm | None, crossed: Sequence[Node]) -> Iterator[tuple[Node, Nest]]:
    """The largest expressions of time alone, with the loops around them."""
    stack: list[tuple[Node, Nest]] = [(node, ()) for node in crossed]
    for block in form.blocks if form is not None else ():
        if block.name not in WITHOUT_ENTRIES and block.name != "initial" and not block.name.endswith("_rate"):
            stack += [(row.expression, kernel.nest) for kernel in block.kernels for row in kernel.rows]
    seen: set[tuple[Node, Nest]] = set()
    while stack:
        root, nest = stack.pop()
        if (root, nest) in seen:
            continue
        seen.add((root, nest))
        alone = variables(root)
        # of time alone, and curved: of a straight line no pulse can be missed
        if alone and all(leaf.op == "time" for leaf in alone):
            curved = any(n.op in ("call", "pow", "table", "mul") for n in topological_unbound([root]))
            if curved and root.op != "reduce":
                yield root, nest
            continue
        # its body may be of time alone
        if root.op == "reduce":
            first, last, body = root.args
            stack.append((body, (*nest, Loop(root.data[1], first, last))))
        # mixed: look at its parts
        elif alone:
            stack += [(a, nest) for a in root.args]


def _outline_of(root: Node, fixed: Values, outlines: Mapping[str, Outline]) -> Outline:
    """Bounds by the expression itself and, from both ends of an interval, by its slope.

    A sum of terms that rise and fall is bounded by the first as if they were independent; where the slope has one sign
    the second gives the ends themselves.  (Jumps and kinks, which the slope knows nothing of, are found elsewhere.)
    """
    slope = differential(root, {leaf: const(1.0) for leaf in variables(root)})

    def bounds(low: Array, high: Array) -> Bounds:
        least, most = enclose(root, low, high, fixed, outlines)
        if (low == high).all():
            return least, most
        first, last = (enclose(root, t, t, fixed, outlines)[0] for t in (low, high))
        with np.errstate(all="ignore"):
            falls, rises = ((high - low) * s for s in enclose(slope, low, high, fixed, outlines))
            below = np.fmax(first + np.minimum(falls, 0.0), last - np.maximum(rises, 0.0))
            above = np.fmin(first + np.maximum(rises, 0.0), last - np.minimum(falls, 0.0))
        return np.fmax(least, below), np.fmin(most, above)

    return bounds


def _outline(table: Table) -> Outline:
    """Bounds of a table's values between its points, taken as straight lines there."""
    points, values = np.asarray(table.points[0]), np.asarray(table.values)

    def bounds(low: Array, high: Array) -> Bounds:
        ends = np.interp(low, points, values), np.interp(high, points, values)
        least, most = np.minimum(*ends), np.maximum(*ends)
        first, last = np.searchsorted(points, low), np.searchsorted(points, high)
        for k in np.flatnonzero(last > first):
            inside = values[first[k] : last[k]]
            least[k], most[k] = min(least[k], inside.min()), max(most[k], inside.max())
        return least, most

    return bounds


def _cells(signal: Outline, t0: float, t1: float) -> Array:
    """Edges of cells that hide nothing; none where the signal fills the span."""
    edges = np.linspace(t0, t1, CELLS + 1)
    done: list[Array] = [edges[-1:]]
    low, high = edges[:-1], edges[1:]
    size = 0.0
    # halve each cell whose bounds allow more than its ends show
    for _ in range(DEPTH):
        ends = [signal(t, t)[0] for t in (low, high)]
        size = max(size, *(float(np.abs(e[np.isfinite(e)]).max(initial=0.0)) for e in ends))
        least, most = signal(low, high)
        with np.errstate(invalid="ignore"):
            hidden = np.maximum(most - np.maximum(*ends), np.minimum(*ends) - least)
            varies = most - least
        # what is bounded by nothing hides anything; a pulse that no end met yet is measured by its own bounds
        whole = np.where(np.isfinite(varies), np.maximum(np.abs(least), np.abs(most)), np.inf)
        # hides little and varies little
        plain = (hidden <= HIDDEN * size) & (varies <= VARIES * size)
        open_ = ~plain & ~(whole <= HIDDEN * size)
        done.append(low[~open_])
        low, high = low[open_], high[open_]
        if not low.size:
            return distinct(*done)
        # a signal that varies everywhere is no pulse
        if low.size > MOST:
            return np.zeros(0)
        middle = low + 0.5 * (high - low)
        low, high = np.concatenate([low, middle]), np.concatenate([middle, high])
    return distinct(*done, low)


def _pulses_of(signal: Outline, t0: float, t1: float, known: Array) -> Iterator[Array]:
    """Instants of each pulse of one signal: the edges of its small cells, thinned to five.

    What is small is asked again and again, each time FINER, so that a pulse is found on a signal that varies by itself.
    """
    edges, stops = _cells(signal, t0, t1), distinct(known, np.array([t0, t1]))
    width = np.diff(edges)
    taken = np.zeros(width.size, dtype=bool)
    narrow, number = NARROW * (t1 - t0), 0
    # each round with a larger notion of what is narrow
    while width.size and width.min() < FINE * narrow:
        change = np.diff(np.concatenate([[0], (width < narrow).astype(int), [0]]))
        runs = []
        # runs of neighbouring narrow cells, short as a whole
        for first, last in zip(np.flatnonzero(change == 1), np.flatnonzero(change == -1), strict=True):
            fine = width[first:last].min() < FINE * narrow
            short = edges[last] - edges[first] <= ISOLATED * narrow
            if fine and short and not taken[first:last].any():
                taken[first:last] = True
                runs.append(edges[first : last + 1])
        # monotone runs are edges between two levels: steps see them
        yield from (
            _quartiles(signal, run)
            for run, told in zip(runs, _is_monotone(signal, runs, stops), strict=True)
            if not told
        )
        number += len(runs)
        narrow *= FINER
        if number > PULSES:
            return


def _is_monotone(signal: Outline, runs: Sequence[Array], stops: Array) -> Sequence[bool]:
    """Of each run of cells whether the signal only rises or falls between stops in it, and rests before and behind."""
    if not runs:
        return ()
    ends = [distinct(run[[0, -1]], stops[(stops > run[0]) & (stops < run[-1])]) for run in runs]
    low, high = (np.concatenate(side) for side in ([e[:-1] for e in ends], [e[1:] for e in ends]))
    aside = ASIDE * (high - low)  # it may jump at either end
    low, high = low + aside, high - aside
    first, last = np.split(signal(*2 * (np.concatenate([low, high]),))[0], 2)
    least, most = signal(low, high)
    begins = np.cumsum([0, *(e.size - 1 for e in ends)])
    with np.errstate(invalid="ignore"):
        hidden = np.maximum(most - np.maximum(first, last), np.minimum(first, last) - least)
        small = HIDDEN * np.maximum.reduceat(np.maximum(np.abs(first), np.abs(last)), begins[:-1])
        worst, varies = np.maximum.reduceat(hidden, begins[:-1]), most - least
    told, near = (small < np.inf) & (worst <= small), ROUND_OFF * (stops[-1] - stops[0])
    for outer, end in ((begins[:-1], 0), (begins[1:] - 1, -1)):
        told &= (varies[outer] <= small) | np.array([np.abs(stops - e[end]).min() <= near for e in ends])
    return list(told)


def _quartiles(signal: Outline, edges: Array) -> Array:
    """The ends of a pulse, and where it changes most: quarters of its total variation."""
    value = signal(edges, edges)[0]
    travelled = np.concatenate([[0.0], np.cumsum(np.abs(np.diff(np.nan_to_num(value))))])
    if not travelled[-1] > 0.0:
        return edges[[0, -1]]
    inside = np.searchsorted(travelled, travelled[-1] * np.array([0.25, 0.5, 0.75]))
    return distinct(edges[[0, *np.minimum(inside, edges.size - 1), edges.size - 1]])
