"""What the initial conditions of a family say of one of its elements, whose indices may run."""

from __future__ import annotations

from collections.abc import Sequence

from sysdyn.dsl.model.expression import Node, both, compare, conditional, const, is_const, sub, substitute, topological
from sysdyn.dsl.model.network import Initial


def initially(initials: Sequence[Initial], at: tuple[Node, ...]) -> Node | None:
    """The value; None where no statement can hold, zero where none does.

    Statements are those of one family, of which no two are about one element (`precedence`); their indices are
    constants, loop variables, or these and an offset.
    """
    value: Node | None = None
    for initial in initials:
        found = _there(initial, at)
        if found is not None:
            tests, own = found
            value = conditional(both(*tests), own, value or const(0.0)) if tests else own
    return value


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
