"""Tables of straight pieces, and the held ends of smooth ones, as conditionals: their nodes are switching functions.

    linear, hold     c0 + c1 (u - x_k) between two nodes
    pchip, cubic     the table between its ends, held outside

An end that an inequality bounds is none: where phi keeps u - x_0 >= 0, the table goes on straight, for a slope that is
zero beyond the end lets a body slide between its two sides, at the stop that it has reached.

A method of higher order crosses a corner at the cost of many small steps; kinks.py watches each node instead.  Tables
of many nodes stay tables, as do bilinear ones and those that stop a run.
"""

from __future__ import annotations

from collections.abc import Mapping, Set
from dataclasses import replace

from sysdyn.compiler.model.tables import evaluate
from sysdyn.dsl.model.expression import (
    Node,
    compare,
    conditional,
    const,
    linear,
    rebuild,
    sub,
    topological,
    variables,
)
from sysdyn.dsl.model.expression import table as looked_up
from sysdyn.dsl.model.network import Table

MOST = 32
"""Nodes of a table that are watched one by one."""


def broken(root: Node, tables: Mapping[str, Table], floors: Set[Node] = frozenset()) -> Node:
    """An expression with its tables of straight pieces written out; floors: what is never negative."""
    if not any(n.op == "table" for n in topological([root])):
        return root
    done: dict[Node, Node] = {}
    for node in topological([root]):
        args = tuple(done[a] for a in node.args)
        table = tables.get(node.data[0]) if node.op == "table" else None
        apart = table is not None and _can_be_broken(table, node)
        # one argument: conditions on it
        if table is not None and apart:
            done[node] = _pieces(table, args[0], node.data[1], floors)
        # a grid of straight pieces in few values
        elif table is not None and len(args) > 1 and len(table.values) <= MOST:
            done[node] = _spread(table, node, args)
        else:
            done[node] = rebuild(node, args)
    return done[root]


def _spread(table: Table, node: Node, args: tuple[Node, ...]) -> Node:
    """A table of two arguments of which some are choices between points of its grid: a choice between its values."""
    for k, choice in enumerate(args):
        if choice.op == "cond":
            condition, *branches = choice.args
            return conditional(condition, *(_spread(table, node, (*args[:k], b, *args[k + 1 :])) for b in branches))
    if node.data[1] != 0 or any(a.op != "const" or a.data not in p for a, p in zip(args, table.points, strict=True)):
        return rebuild(node, args)
    at = [p.index(a.data) for a, p in zip(args, table.points, strict=True)]
    return const(table.values[at[0] * len(table.points[1]) + at[1]])


def _can_be_broken(table: Table, node: Node) -> bool:
    if len(node.args) > 1 or table.outside == "stop" or not isinstance(node.data[1], int):
        return False
    inner = topological(node.args)
    unknown = any(v.op == "var" for v in variables(node.args[0])) and all(n.op != "index" for n in inner)
    straight = table.method in ("linear", "hold") and len(table.points[0]) <= MOST
    return unknown and (straight or (table.method in ("pchip", "cubic") and table.outside == "clamp"))


def _pieces(table: Table, u: Node, order: int, floors: Set[Node]) -> Node:
    """A table with its pieces written out as conditions on its argument, so that corners are operations like others."""
    points, values = table.points[0], table.values
    # an inequality keeps the argument off that end: the end's piece is continued
    bounded = (sub(u, const(points[0])) in floors, sub(const(points[-1]), u) in floors)
    ends = [
        _end(table, k, u, order) if on else const(0.0 if order else values[k])
        for k, on in zip((0, -1), bounded, strict=True)
    ]
    # smooth inside: its ends alone
    if table.method in ("pchip", "cubic"):
        inside = looked_up(table.name, u, order=order)
        below = conditional(compare("<", u, const(points[0])), ends[0], inside)
        return conditional(compare(">", u, const(points[-1])), ends[1], below)
    slopes = [
        0.0 if table.method == "hold" else (b - a) / (y - x)
        for x, y, a, b in zip(points, points[1:], values, values[1:], strict=False)
    ]
    inner = [_line(x, v, s, u, order) for x, v, s in zip(points, values, slopes, strict=False)]
    first, last = (inner[0], inner[-1]) if table.outside == "extend" else ends
    if table.method == "hold":
        last = ends[1]
    pieces = [first, *inner, last]
    found = pieces[-1]
    # nested from the last piece to the first
    for x, piece in zip(reversed(points), reversed(pieces[:-1]), strict=True):
        found = conditional(compare("<", u, const(x)), piece, found)
    return found


def _end(table: Table, k: int, u: Node, order: int) -> Node:
    """How a table goes on straight behind its first or last point (k 0, -1), and derivatives of that."""
    x = table.points[0][k]
    slope = evaluate(replace(table, outside="extend"), [x], (1,)) if table.method != "hold" else 0.0
    return _line(x, table.values[k], float(slope), u, order)


def _line(x: float, value: float, slope: float, u: Node, order: int) -> Node:
    """A straight piece that is `value` at x, or its derivative."""
    if order:
        return const(slope if order == 1 else 0.0)
    return linear(value, ((slope, sub(u, const(x))),))
