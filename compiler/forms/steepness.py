"""Steep rows and their scales: what a row's residual is judged against at a point.

A law is mild where a small relative change of its arguments changes its value little: sums, products, powers with
constant exponents, sines.  On anything else (exponentials, hyperbolic functions, tables, switches) a correction of
Newton's iteration says nothing about the residual that it leaves.  For the row families that hold such a law the
descriptor form gets a block `<block>_scale` beside each block that adds to them: the sum of the magnitudes of the
row's terms, sums inside products multiplied out in magnitude, so never a difference of terms.
"""

from __future__ import annotations

from dataclasses import replace

from sysdyn.compiler.forms.descriptor import SCALED, Block, DescriptorForm, LoopKernel, Summand
from sysdyn.dsl.model.expression import Node, call, conditional, const, linear, product, topological, variables

MILD = frozenset(("sin", "cos", "atan", "atan2", "hypot", "asinh", "signal"))
"""Functions whose slope has a bound by their arguments."""
NONNEGATIVE = frozenset(("exp", "cosh", "abs", "hypot", "step"))


def steep(root: Node) -> bool:
    """Whether an unknown enters by anything but sums, products, constant powers and mild functions."""
    for node in _live_nodes(root):
        mild = node.op in ("sum", "mul", "var", "reduce") or (node.op == "call" and node.data in MILD)
        if not mild and not _frozen(node) and any(v.op == "var" for v in variables(node)):
            return True
    return False


def _live(node: Node) -> bool:
    """Whether a relation says that a branch is as the text says (frozen.py): while a piece lasts it is not."""
    named = node.op == "cmp" and node.args[0].op == "param" and node.args[0].data.startswith("#branch")
    return named and node.args[1].op == "const" and node.args[1].data == 0.0


def _frozen(node: Node) -> bool:
    """Whether a conditional, or a condition, changes at events alone."""
    met = _live_nodes(node.args[0] if node.op == "cond" else node)
    return node.op in ("cond", "and", "or", "not") and not any(n.op == "var" for n in met)


def _live_nodes(root: Node) -> list[Node]:
    """The nodes below root that count while branches are frozen."""
    found: dict[Node, None] = {}
    stack = [root]
    while stack:
        node = stack.pop()
        if node in found:
            continue
        found[node] = None
        live = node.op in ("cond", "and") and _live(node.args[0])
        stack += node.args if not live else (node.args[2:] if node.op == "cond" else ())
    return list(found)


def magnitude(root: Node) -> Node:
    """The sum of the magnitudes of the terms of an expression."""
    done: dict[Node, Node] = {}
    for node in topological([root]):
        done[node] = _magnitude(node, done)
    return done[root]


def _magnitude(node: Node, done: dict[Node, Node]) -> Node:
    """Sum of the magnitudes of the terms of a node: the size against which round-off counts."""
    match node.op:
        case "const":
            return const(abs(node.data))
        case "sum":
            constant, coefficients = node.data
            pairs = zip(coefficients, node.args, strict=True)
            return linear(abs(constant), ((abs(c), done[a]) for c, a in pairs))
        # factors below are divided by their own value
        case "mul":
            pairs = zip(node.data, node.args, strict=True)
            return product(1.0, ((e, done[a] if e > 0.0 else call("abs", a)) for e, a in pairs))
        # of the branch that holds
        case "cond":
            test, then, other = node.args
            return conditional(test, done[then], done[other])
        case "call" if node.data in NONNEGATIVE:
            return node
    return call("abs", node)


def add_scale_blocks(form: DescriptorForm) -> DescriptorForm:
    """The form with the scale blocks of the row families that hold a steep law; as it is where none does."""
    held = [block for block in form.blocks if block.name in SCALED]
    found = {s.row for block in held for kernel in block.kernels for s in kernel.rows if steep(s.expression)}
    made = []
    for block in held:
        kernels = (LoopKernel(k.nest, tuple(_scale(s) for s in k.rows if s.row in found)) for k in block.kernels)
        kept = tuple(kernel for kernel in kernels if kernel.rows)
        if kept:
            made.append(Block(f"{block.name}_scale", kept))
    return replace(form, blocks=(*form.blocks, *made))


def _scale(summand: Summand) -> Summand:
    return Summand(summand.row, summand.at, magnitude(summand.expression))
