"""The book's sign of the displacement of a complementary form: q = -dV*/de (5.44).

The reflection's own conjugate is p = dT*/df, which the mirror calls dV*/de; the unknown is its negative, so that the
conservative equations read p' = -dH/dq, q' = dH/dp as in the book.  A traced `x.q` keeps the sign of its element.
"""

from __future__ import annotations

from dataclasses import replace

from sysdyn.compiler.forms.descriptor import HOME, Block, DescriptorForm, Pin
from sysdyn.dsl.model.expression import Node, neg, ordered_variables, substitute, var


def with_book_signs(form: DescriptorForm) -> DescriptorForm:
    """The form with every conjugate's sign changed where it is complementary; the primal ones as they are."""
    if not form.formulation.startswith("co_"):
        return form
    blocks, pins = tuple(_block(b) for b in form.blocks), tuple(_pin(form, p) for p in form.pins)
    return replace(form, blocks=blocks, pins=pins)


def negate_conjugates(root: Node) -> Node:
    """The expression with every conjugate's sign changed."""
    change = {}
    for node in ordered_variables(root):
        if node.op == "var" and node.data[1] == "p":
            owner, kind, order = node.data
            change[node] = neg(var(owner, kind, *node.args, order=order))
    return substitute(root, change) if change else root


def _block(block: Block) -> Block:
    """The rows that define a conjugate change their sign with it: 0 = q + dV*/de."""
    defines = HOME.get(block.name, block.name) == "momentum"
    kernels = []
    for kernel in block.kernels:
        found = ((s, negate_conjugates(s.expression)) for s in kernel.rows)
        rows = tuple(replace(s, expression=neg(e) if defines else e) for s, e in found)
        kernels.append(replace(kernel, rows=rows))
    return replace(block, kernels=tuple(kernels))


def _pin(form: DescriptorForm, pin: Pin) -> Pin:
    return replace(pin, value=neg(pin.value)) if form.families[pin.family].kind == "p" else pin
