"""Summands over loops: the pieces that everything in the compiler is made of.

A `Term` is a local expression under a loop nest.  Loop variables have canonical names, `#0` for the outermost loop,
`#1` for the next, so that equal nests are equal values and their expressions may share nodes.  A sum over a range is
linear, so `k*sum(i in 1..n: g)` at the top level of an expression becomes the term `k*g` with one loop more; a sum
inside a nonlinear expression stays a node (`reduce`), its loop variable named `#r1`, `#r2`, ... by its height.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable, Sequence

from sysdyn.dsl.model.expression import (
    Node,
    add,
    combine_terms,
    const,
    index,
    is_const,
    linear,
    mul,
    product,
    reads,
    rebuild,
    reduction,
    scale,
    substitute,
    topological,
    variables,
)
from sysdyn.dsl.model.network import Loop
from sysdyn.dsl.text.diagnostics import Diagnostic, ModelError, Place
from sysdyn.values import dataclass

Nest = tuple[Loop, ...]
LARGEST_LITERAL = 64  # elements of a sum that is written out: more is an array, and wants a loop


@dataclass(frozen=True, slots=True)
class Term:
    """One summand: `expression` summed (or one row each) over `loops`."""

    expression: Node
    loops: Nest
    place: Place


def counter(depth: int) -> Node:
    """The loop variable of the loop at that depth."""
    return index(f"#{depth}")


def canonical_reductions(root: Node) -> Node:
    """Rename the loop variables of all reductions below root by their height: `#r1` innermost."""
    nodes = topological([root])
    if all(node.op != "reduce" for node in nodes):
        return root
    done: dict[Node, Node] = {}
    height: dict[Node, int] = {}
    for node in nodes:
        args = tuple(done[a] for a in node.args)
        level = max((height[a] for a in node.args), default=0)
        if node.op == "reduce":
            level += 1
            operator, name = node.data
            own = f"#r{level}"
            done[node] = reduction(operator, own, args[0], args[1], substitute(args[2], {index(name): index(own)}))
        else:
            done[node] = rebuild(node, args)
        height[node] = level
    return done[root]


def canonical(loops: Sequence[Loop], *roots: Node) -> tuple[Nest, tuple[Node, ...]]:
    """The nest with canonical loop variables, and the expressions under it likewise; sums inside stay nodes."""
    change: dict[Node, Node] = {}
    nest = []
    for depth, loop in enumerate(loops):
        nest.append(Loop(f"#{depth}", substitute(loop.first, change), substitute(loop.last, change)))
        change[index(loop.index)] = counter(depth)
    return tuple(nest), tuple(substitute(canonical_reductions(root), change) for root in roots)


def has_reduction(root: Node) -> bool:
    """Whether a sum (product, minimum, maximum) over a range occurs anywhere below."""
    return any(node.op == "reduce" for node in topological([root]))


def split(root: Node, loops: Nest, place: Place, *, read: bool = False) -> tuple[Term, ...]:
    """The terms of a canonical expression: top-level sums taken apart, top-level sums over ranges made loops.

    A product of two sums over ranges becomes a double loop, because its terms are differentiated; where the expression
    is only `read`, it stays a product.
    """
    found: list[Term] = []
    work: deque[tuple[float, Node, Node, Nest]] = deque([(1.0, const(1.0), root, loops)])
    while work:
        factor, by, node, nest = work.popleft()
        # a term each
        if node.op == "sum":
            constant, coefficients = node.data
            work.extend((factor * c, by, a, nest) for c, a in zip(coefficients, node.args, strict=True))
            if constant:
                found.append(Term(linear(0.0, ((factor * constant, by),)), nest, place))
        # a sum over a range: a loop more
        elif node.op == "reduce" and node.data[0] == "sum":
            first, last, body = node.args
            own = counter(len(nest))
            deeper = (*nest, Loop(f"#{len(nest)}", first, last))
            work.append((factor, by, substitute(body, {index(node.data[1]): own}), deeper))
        # a product with one sum: the sum's terms, the rest as their factor
        elif node.op == "mul" and (parts := _linear_factor(node)) and not (read and has_reduction(parts[0])):
            work.append((factor, mul(by, parts[0]), parts[1], nest))
        # the product of two sums: a double loop
        elif has_reduction(by) and not read:
            work.append((factor, const(1.0), mul(by, node), nest))
        # nothing more to be split
        else:
            found.append(Term(product(factor, ((1.0, by), (1.0, node))), nest, place))
    return tuple(t for t in found if not (t.expression.op == "const" and t.expression.data == 0.0))


def _linear_factor(node: Node) -> tuple[Node, Node] | None:
    """(rest, factor) where one factor of a product holds a sum over a range that may be multiplied out."""
    for k, (exponent, factor) in enumerate(zip(node.data, node.args, strict=True)):
        whole = exponent > 0 and exponent == int(exponent)
        linear_sum = factor.op == "reduce" and factor.data[0] == "sum"
        if whole and (linear_sum or (factor.op == "sum" and has_reduction(factor))):
            exponents = [(e - (j == k), a) for j, (e, a) in enumerate(zip(node.data, node.args, strict=True))]
            return product(1.0, exponents), factor
    return None


def terms(expression: Node, loops: Sequence[Loop], place: Place) -> tuple[Term, ...]:
    """The terms of an expression as the network holds it."""
    nest, (root,) = canonical(loops, expression)
    return split(root, nest, place)


def without_nested(found: Iterable[Term], what: str) -> tuple[Term, ...]:
    """The terms with every sum inside a nonlinear expression written out, for they will be differentiated.

    Only ranges of literal bounds can be: of others the text would depend on a size (ModelError N608).
    """
    result: list[Term] = []
    for term in found:
        if has_reduction(term.expression):
            result += split(_written_out(term, what), term.loops, term.place)
        else:
            result.append(term)
    return tuple(result)


def _written_out(term: Term, what: str) -> Node:
    done: dict[Node, Node] = {}
    for node in topological([term.expression]):
        args = tuple(done[a] for a in node.args)
        if node.op == "reduce":
            done[node] = _elements(node, args, term.place, what)
        else:
            done[node] = rebuild(node, args)
    return done[term.expression]


def _elements(node: Node, args: tuple[Node, ...], place: Place, what: str) -> Node:
    """A reduction inside of a nonlinear function, written out over bounds that are numbers; N608 of others."""
    operator, name = node.data
    first, last, body = args
    if first.op != "const" or last.op != "const" or last.data - first.data >= LARGEST_LITERAL:
        text = f"a {operator} over a range inside a nonlinear expression is not supported yet in {what}"
        help_ = f"bounds that follow no loop variable are written out, {LARGEST_LITERAL} elements at most"
        raise ModelError([Diagnostic("N608", text, place, help_)])
    parts = [substitute(body, {index(name): const(k)}) for k in range(int(first.data), int(last.data) + 1)]
    if not parts and operator not in ("sum", "prod"):
        raise ModelError([Diagnostic("N608", f"the {operator} over an empty range", place)])
    return combine_terms(operator, parts)


def summands(root: Node) -> list[Node]:
    """The summands of an expression; a factor before a sum is carried to its terms."""
    if root.op == "mul":
        pairs = list(zip(root.data, root.args, strict=True))
        sums = [a for e, a in pairs if e == 1.0 and a.op == "sum"]
        if len(sums) == 1:
            rest = product(1.0, ((e, a) for e, a in pairs if a is not sums[0]))
            return [mul(rest, piece) for piece in summands(sums[0])]
    if root.op != "sum":
        return [root]
    found = [scale(c, piece) for c, a in zip(root.data[1], root.args, strict=True) for piece in summands(a)]
    return [*found, const(root.data[0])] if root.data[0] else found


def vanishes(*roots: Node) -> bool:
    """Whether a sum is zero, by its summands."""
    return is_const(add(*(piece for root in roots for piece in summands(root))), 0.0)


def local_variables(root: Node, kinds: str | Sequence[str], order: int | None = 0) -> list[Node]:
    """The unknowns of those kinds that occur, in the order they were made."""
    found = (n for n in variables(root) if n.op == "var" and n.data[1] in kinds)
    return sorted((n for n in found if order is None or n.data[2] == order), key=lambda n: n.number)


def is_constant(root: Node, changing: frozenset[str]) -> bool:
    """Whether neither unknowns nor time nor the parameters `changing` enter the expression."""
    return not variables(root) and not reads(root, changing)


def is_affine(root: Node, changing: frozenset[str]) -> bool:
    """Whether the expression is a constant plus constants times unknowns: neither unknowns nor time nor the parameters
    `changing` enter a constant.
    """
    affine: dict[Node, bool] = {}
    # bottom up: each node is affine where its moving arguments are, one of them in a product
    for node in topological([root]):
        if node.op == "param" and node.data in changing:
            return False
        moving = [a for a in node.args if variables(a)]
        if not variables(node) or node.op == "var":
            affine[node] = True
        elif node.op == "sum":
            affine[node] = all(affine[a] for a in moving)
        elif node.op == "mul":
            powers = [e for e, a in zip(node.data, node.args, strict=True) if variables(a)]
            affine[node] = powers == [1.0] and affine[moving[0]]
        else:
            affine[node] = False
    return affine[root]
