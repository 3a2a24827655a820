"""What the initial conditions of a family say of one of its elements, whose indices may run."""

from __future__ import annotations

from collections.abc import Sequence

from sysdyn.dsl.model.expression import Node, both, compare, conditional, const, is_const, sub, substitute, topological
from sysdyn.dsl.model.network import Initial


def initially(initials: Sequence[Initial], at: tuple[Node, ...]) -> tuple[Node, bool] | None:
    """The value, and whether every statement that may hold there is fixed; None where none can hold.

    Statements are those of one family, their indices constants, loop variables, or these and an offset.  Zero where
    none holds; a fixed one counts before a guess, a later one before an earlier one.
    """
    value: Node = const(0.0)
    fixed: list[bool] = []
    for initial in sorted(initials, key=lambda i: i.fixed):
        found = _there(initial, at)
        if found is None:
            continue
        tests, own = found
        fixed.append(initial.fixed)
        value = conditional(both(*tests), own, value) if tests else own
    return (value, all(fixed)) if fixed else None


def _there(initial: Initial, at: tuple[Node, ...]) -> tuple[list[Node], Node] | None:
    """What must hold for the statement to reach that element, and its value there; None where it cannot."""
    loops = {loop.index: loop for loop in initial.loops}
    change: dict[Node, Node] = {}
    tests: list[Node] = []
    for own, asked in zip(initial.target.args, at, strict=True):
        running = [n for n in topological([own]) if n.op == "index" and n.data in loops]
        if not running:
            pairs = [(own, asked), (asked, own)]
        else:
            loop, offset = loops[running[0].data], sub(own, running[0])
            if len(running) > 1 or any(n is running[0] for n in topological([offset])):
                return None
            change[running[0]] = sub(asked, offset)
            pairs = [(loop.first, change[running[0]]), (change[running[0]], loop.last)]
        for low, high in pairs:
            apart = sub(high, low)
            if is_const(apart):
                if apart.data < 0.0:
                    return None
            else:
                tests.append(compare("<=", low, high))
    return tests, substitute(initial.value, change)
