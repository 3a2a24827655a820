"""Loops whose rows have corners, element by element: events hold the branch of each by itself.

A row of an array is one expression under its loops, and a branch is a number that events set: of an array's rows with
corners there are as many as it has elements.  Up to MOST surfaces in all are written out; arrays of more stay loops,
and are integrated through.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from itertools import product

from sysdyn.compiler.forms.corners.kinks import JUDGED, MOST, SMOOTH, branches_of, smoothness, watched_branches
from sysdyn.compiler.forms.descriptor import Block, DescriptorForm, LoopKernel, Summand
from sysdyn.dsl.model.expression import Node, neg, substitute, topological
from sysdyn.dsl.model.network import Network
from sysdyn.dsl.model.values import Values, as_constants

Iteration = dict[Node, Node]
"""A number for each loop variable."""


def written(form: DescriptorForm, network: Network) -> DescriptorForm:
    """The form with the loops written out whose rows have corners at unknowns of their own element."""
    nested = [(b, k) for b in form.blocks for k in b.kernels if k.nest and any(map(_has_corner, k.rows))]
    if not nested:
        return form
    known = Values({p.name: p for p in network.parameters}, network.elements)
    corners: set[Node] = set()
    for block, kernel in nested:
        if block.name in JUDGED:
            corners.update(_corners(kernel, known))
            if len(corners) > MOST:
                return form
    return replace(form, blocks=tuple(_block(b, corners, known) for b in form.blocks)) if corners else form


def _has_corner(summand: Summand) -> bool:
    return any(_own(n) for n in topological([summand.expression]))


def _own(node: Node) -> bool:
    """Whether an operation changes its branch where a quantity of its element does."""
    found = branches_of(node)
    return found is not None and any(n.op == "index" for n in topological([found.u]))


def _iterations(kernel: LoopKernel, known: Values) -> Iterator[Iteration]:
    """The elements of a nest."""
    for at in known.iterations(kernel.nest):
        yield as_constants(at)


def _corners(kernel: LoopKernel, known: Values) -> set[Node]:
    """The switching functions of all elements at which a row of the first is not smooth."""
    # all elements have one text: the first tells which operations are corners
    first = next(_iterations(kernel, known), None)
    if first is None:
        return set()
    kept = set()
    for summand in kernel.rows:
        root = substitute(summand.expression, first)
        for node in topological([summand.expression]):
            if _own(node):
                here = watched_branches(substitute(node, first))
                if here is not None and smoothness(root, here.u) < SMOOTH:
                    kept.add(node)
    found: set[Node] = set()
    # those of every element
    for at in _iterations(kernel, known) if kept else ():
        for node in kept:
            here = watched_branches(substitute(node, at))
            if here is not None and neg(here.u) not in found:
                found.add(here.u)
        if len(found) > MOST:
            break
    return found


def _block(block: Block, corners: set[Node], known: Values) -> Block:
    """A block whose kernels with corners are written out element by element."""
    kernels: list[LoopKernel] = []
    for kernel in block.kernels:
        first = next(_iterations(kernel, known), None) if kernel.nest and any(map(_has_corner, kernel.rows)) else None
        if first is None or not any(_meets(s, first, corners) for s in kernel.rows):
            kernels.append(kernel)
            continue
        rows = [
            Summand(s.row, tuple(substitute(n, at) for n in s.at), substitute(s.expression, at))
            for at, s in product(_iterations(kernel, known), kernel.rows)
        ]
        kernels.append(LoopKernel((), tuple(rows)))
    return Block(block.name, tuple(kernels))


def _meets(summand: Summand, at: Iteration, corners: set[Node]) -> bool:
    for node in topological([summand.expression]):
        if _own(node):
            here = watched_branches(substitute(node, at))
            if here is not None and (here.u in corners or neg(here.u) in corners):
                return True
    return False
