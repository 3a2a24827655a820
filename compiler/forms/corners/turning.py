"""Where what events watch may turn, bend, jump or rise at once: between the ends of a step that looks at it.

    abs, max, clip                          at the zero of what they compare
    if, step, sign                          on both sides of it, for they jump there
    floor, mod, frac                        on both sides of whole numbers, zeros of sin(pi x)
    products, even powers                   at zeros of their factors; sin(x)^n at those of cos(x)
    tanh, atan, exp, two or more of them    while their arguments are small

A condition that holds for a moment alone is looked at there: its largest value lies at one of these zeros, or between
two.  They are found as branches of laws are, for they are as smooth as the motion, however narrow the moment.
Received: an expression whose sign is watched; returned: functions whose zeros a step ends at.
"""

from __future__ import annotations

import math
from collections.abc import Iterator

from sysdyn.compiler.forms.corners.kinks import branches_of
from sysdyn.compiler.forms.steepness import magnitude
from sysdyn.dsl.model.expression import Node, call, const, linear, product, scale, topological_unbound, variables

OWN_SIGN = frozenset({"abs", "cosh", "exp", "hypot", "step"})
"""Functions without a zero that they cross."""
PARTNER = {"sin": "cos", "cos": "sin"}
NEAR = 1e-9
"""Of the size of what is compared: a moment before it jumps, and a moment behind."""
STEEP = frozenset({"tanh", "atan", "exp"})
"""Functions that rise at once."""
RISEN = 144.0
"""The square of the argument from which on they are flat, and 1/(1 + exp) is."""


def turning(root: Node) -> Iterator[Node]:
    """Functions at whose zeros it may be largest, or jumps."""
    for node in topological_unbound([root]):
        on = branches_of(node)
        if on is not None:
            jumps = node.op == "cmp" or node.data in ("sign", "step")
            yield from _zeros_nearby(on.u, magnitude(on.u)) if jumps else (on.u,)
        yield from _whole(node)
        if node.op == "mul":
            yield from _factors(node)


def turns_in_conditions(root: Node) -> Iterator[Node]:
    """Turns of floor, mod and frac that conditions of a law read: a window in which it holds may be narrow."""
    conditions = [node for node in topological_unbound([root]) if node.op == "cmp"]
    for node in topological_unbound(conditions):
        yield from _whole(node)


def _whole(node: Node) -> Iterator[Node]:
    if node.op == "call" and node.data in ("floor", "ceil"):
        yield from _zeros_nearby(call("sin", scale(math.pi, node.args[0])), const(1.0))
    elif node.op == "call" and node.data == "mod":
        a, b = node.args
        yield from _zeros_nearby(call("sin", product(math.pi, ((1.0, a), (-1.0, b)))), const(1.0))


def _zeros_nearby(u: Node, size: Node) -> Iterator[Node]:
    """Zeros on both sides of that of u, as near as counts."""
    for side in (-NEAR, NEAR):
        yield linear(0.0, ((1.0, u), (side, size)))


def _factors(node: Node) -> Iterator[Node]:
    moving = [(e, n) for e, n in zip(node.data, node.args, strict=True) if any(v.op == "var" for v in variables(n))]
    for exponent, factor in moving:
        even, named = exponent % 2.0 == 0.0, factor.data if factor.op == "call" else ""
        if even and named in PARTNER:
            yield call(PARTNER[named], factor.args[0])
        if (even or len(moving) > 1) and named not in OWN_SIGN:
            yield factor


def rising(root: Node) -> Iterator[tuple[Node, float]]:
    """Squares of the arguments of what rises at once, and up to where it does; of one alone nothing, for it stays."""
    found = {
        n.args[0]: None
        for n in topological_unbound([root])
        if n.op == "call" and n.data in STEEP and any(v.op == "var" for v in variables(n.args[0]))
    }
    for argument in found if len(found) > 1 else ():
        yield product(1.0, ((2.0, argument),)), RISEN
