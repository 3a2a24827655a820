"""The expressions of a network's statements, collected and replaced."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace
from typing import Any

from sysdyn.dsl.model.expression import Node, const, rebuild, reduction, substitute, topological
from sysdyn.dsl.model.network import Loop, Network

EXPRESSIONS = {
    "energies": ("expression",),
    "works": ("effort", "on"),
    "constraints": ("expression",),
    "dynamics": ("expression",),
    "initials": ("target", "value"),
    "observations": ("expression",),
    "speeds": ("expression",),
    "expectations": ("left", "right", "within"),
    "branches": ("law", "on", "energy"),
    "couplings": ("ratio",),
}
"""Of each sort of statement the fields that hold what it says."""
TRACED = ("observations", "speeds", "expectations")
"""What reads the motion and leaves it as it is."""


def expressions(said: Any, *sorts: str) -> list[Node]:
    """What statements of these sorts say, or one field of them (`works.on`); said: a Network, or the parts of one."""
    found = []
    for sort in sorts:
        name, _, one = sort.partition(".")
        for field in (one,) if one else EXPRESSIONS[name]:
            found += [getattr(statement, field) for statement in getattr(said, name)]
    return [node for node in found if node is not None]


def following(network: Network, names: Iterable[str]) -> frozenset[str]:
    """These parameters, and those whose values are formulas in them, by others too."""
    given = [(p.name, value) for p in network.parameters for value in p.values]
    given += [(s.name, s.value) for s in network.elements]
    read = [(name, {n.data for n in topological([value]) if n.op == "param"}) for name, value in given]
    found = {p.name for p in network.parameters}.intersection(names)
    while more := {name for name, others in read if name not in found and others & found}:
        found |= more
    return frozenset(found)


def rewritten(network: Network, change: Callable[[Node], Node], sorts: Iterable[str] = EXPRESSIONS) -> Network:
    """The network with every expression of these statements changed."""

    def new(statement: Any, fields: tuple[str, ...]) -> Any:
        old = {field: getattr(statement, field) for field in fields}
        return replace(statement, **{field: change(node) for field, node in old.items() if node is not None})

    changed: dict[str, Any] = {s: tuple(new(x, EXPRESSIONS[s]) for x in getattr(network, s)) for s in sorts}
    return replace(network, **changed)


def everywhere(said: Any, change: Callable[[Node], Node]) -> Any:
    """A network, or a part of one, with every expression changed: indices, ranges and loops too."""
    if isinstance(said, Node):
        return change(said)
    if isinstance(said, tuple):
        parts = tuple(everywhere(part, change) for part in said)
        return said if all(a is b for a, b in zip(parts, said, strict=True)) else parts
    if type(said).__module__ != Network.__module__:
        return said
    fields = {name: getattr(said, name) for name in said.__dataclass_fields__}
    new = {name: everywhere(value, change) for name, value in fields.items()}
    return replace(said, **{name: value for name, value in new.items() if value is not fields[name]})


def with_common_sizes(network: Network) -> Network:
    """The sizes that a component in an array has of its own, as one number where they are the same in each element.

    An index that is affine in its loop variable stays so: `v[L.n[i] - j]` is `v[n - j]`.
    """
    set_alone = {setting.name for setting in network.elements}
    sizes = [p for p in network.parameters if p.whole and p.shape and len(p.values) == 1 and p.name not in set_alone]
    common: dict[str, Node] = {}

    def change(root: Node) -> Node:
        found = {n: common[n.data] for n in topological([root]) if n.op == "param" and n.data in common}
        return substitute(root, found) if found else root

    for _ in sizes:  # one may be another one's argument
        before = len(common)
        for p in sizes:
            value = change(p.values[0])
            if p.name not in common and all(n.op != "index" for n in topological([value])):
                common[p.name] = value
        if len(common) == before:
            break
    return everywhere(network, change) if common else network


DIFFERENTIATED = ("energies", "works", "constraints", "dynamics", "branches", "couplings")
"""Statements whose sums within nonlinear functions are written out, for they are differentiated."""


def with_literal_ranges(network: Network, number: Callable[[Node], float]) -> Network:
    """The network with numbers as the bounds of reductions within nonlinear functions, where these follow no loop
    variable: tanh(sum(i in 1..n: x[i])) is written out, so that n is part of the text.

    number: the value of an expression of parameters, NaN of another.
    """
    # most texts have no reduction there
    if all(node.op != "reduce" for node in topological(expressions(network, *DIFFERENTIATED))):
        return network
    done: dict[Node, Node] = {}

    # bounds by parameters become their numbers
    def literal(node: Node, args: tuple[Node, ...]) -> Node:
        if node.op == "reduce" and not (args[0].op == args[1].op == "const"):
            bounds = [number(a) for a in args[:2]]
            if not any(map(math.isnan, bounds)):
                args = (*map(const, bounds), args[2])
        return rebuild(node, args)

    def change(root: Node) -> Node:
        found = {n: _rebuild(n, literal) for n in _nonlinear(root)}
        found = {n: new for n, new in found.items() if new is not n}
        done.update(found)
        return substitute(root, found) if found else root

    new = rewritten(network, change, DIFFERENTIATED)
    return replace(new, literal=True) if done else network


def _rebuild(root: Node, change: Callable[[Node, tuple[Node, ...]], Node]) -> Node:
    made: dict[Node, Node] = {}
    for node in topological([root]):
        made[node] = change(node, tuple(made[a] for a in node.args))
    return made[root]


def _nonlinear(root: Node) -> list[Node]:
    """The largest parts with a reduction in which no sum over a range can be taken apart into terms over a loop."""
    reduced = dict[Node, bool]()
    # which parts have a reduction below them
    for node in topological([root]):
        reduced[node] = node.op == "reduce" or any(reduced[a] for a in node.args)
    found, left = dict[Node, None](), [root] if reduced[root] else []
    # down from the root, through what is linear in its parts
    while left:
        node = left.pop()
        # a + b: each by itself
        if node.op == "sum":
            left += [a for a in node.args if reduced[a]]
        # a sum over a range: its body
        elif node.op == "reduce" and node.data[0] == "sum":
            left += [node.args[2]] if reduced[node.args[2]] else []
        # factors: whole powers of sums multiply out, others are nonlinear
        elif node.op == "mul":
            for exponent, factor in zip(node.data, node.args, strict=True):
                whole = exponent > 0 and exponent == int(exponent)
                apart = factor.op == "sum" or (factor.op == "reduce" and factor.data[0] == "sum")
                if reduced[factor]:
                    if whole and apart:
                        left.append(factor)
                    # tanh(sum(...)): the sum cannot leave the function
                    else:
                        found[factor] = None
        else:
            found[node] = None
    return list(found)


def sum_over_loops(body: Node, loops: Sequence[Loop]) -> Node:
    """The sum of what stands under loops, over all of them."""
    for loop in reversed(loops):
        body = reduction("sum", loop.index, loop.first, loop.last, body)
    return body


def nodes_read(said: Any) -> frozenset[str]:
    """Common-effort nodes whose effort a statement (not a trace) reads; said: a Network, or the parts of one."""
    roots = expressions(said, "energies", "constraints", "works", "dynamics", "branches.law", "couplings")
    return frozenset(n.data[0] for n in topological(roots) if n.op == "var" and n.data[1] == "ne")
