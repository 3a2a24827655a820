"""Formulas -> Program: values that are computed once for a set of parameters, by the code that computes rows.

A formula is an expression under a loop nest; its values stand one behind the other, last loop fastest, as entries of a
Jacobian do.  The functions that come of it have the contract's arguments (runtime/core/system/model.h) and write `v`.
"""

from __future__ import annotations

from collections.abc import Sequence

from sysdyn.compiler.forms.descriptor import DescriptorForm
from sysdyn.compiler.model.terms import Nest, counter
from sysdyn.compiler.program.program import Program, Programmer
from sysdyn.dsl.model.expression import Node, index, substitute
from sysdyn.dsl.model.network import Loop
from sysdyn.values import dataclass


@dataclass(frozen=True, slots=True)
class Formula:
    """The values of an expression over a nest, in the group of formulas `block`."""

    block: str
    nest: Nest
    expression: Node


def program_of(form: DescriptorForm, scalars: tuple[str, ...], formulas: Sequence[Formula]) -> Program:
    """The program of formulas; form: of the families that they read, scalars: parameters in the order of p."""
    programmer = Programmer(form, scalars)
    for number, formula in enumerate(formulas):
        nest, (expression,) = canonical(formula.nest, (formula.expression,))
        programmer.formula(formula.block, number, nest, expression)
    blocks = tuple((name, ()) for name in dict.fromkeys(f.block for f in formulas))
    return Program(tuple(programmer.routines), blocks, programmer.integers.slots, scalars, tuple(programmer.tables))


def canonical(nest: Nest, roots: Sequence[Node]) -> tuple[Nest, tuple[Node, ...]]:
    """The nest with loop variables #0, #1, ... and expressions under it."""
    change = {index(loop.index): counter(k) for k, loop in enumerate(nest)}
    loops = tuple(
        Loop(f"#{k}", substitute(loop.first, change), substitute(loop.last, change)) for k, loop in enumerate(nest)
    )
    return loops, tuple(substitute(root, change) for root in roots)
