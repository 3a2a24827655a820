"""Loops of branches, by families of nodes: what may close one."""

from __future__ import annotations

from collections.abc import Sequence

from sysdyn.dsl.model.network import Branch, Terminal


def family(branch: Branch, terminal: Terminal | None) -> str:
    """The node family at an end of a branch; the ground of its domain has a name of its own."""
    node = None if terminal is None else terminal.node
    return f"#ground {branch.domain.name}" if node is None else node


def closes(branch: Branch, others: Sequence[Branch]) -> bool:
    """Whether other branches lead from one end of a branch to the other."""
    pairs = [{family(b, t) for t in (b.plus, b.minus)} for b in others if b is not branch]
    reached, goal = {family(branch, branch.plus)}, family(branch, branch.minus)
    if goal in reached:
        return reached in pairs
    while found := [pair for pair in pairs if pair & reached and pair - reached]:
        reached.update(*found)
    return goal in reached
