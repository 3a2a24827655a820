"""Sign and index mutants of a Python text: one change each, by its syntax tree.

sign      neg(x) -> x;  sub(a, b) -> add(a, b);  a - b -> a + b and back;  -x -> x;  a if c else b -> b if c else a
          where both are numbers of opposite sign
index     0 <-> 1 as a subscript;  + 1, - 1 left out;  rate <-> coordinate, conjugate -> rate of the mirror;
          "q" <-> "f", "p" -> "f" (bq, bf, bp, nq, nf likewise)

Left alone because no result depends on them: texts (f-strings, what is raised) and units of display (`units["q"]`).
"""

from __future__ import annotations

import ast
from collections.abc import Iterator
from dataclasses import dataclass

KINDS = {"q": "f", "f": "q", "p": "f", "bq": "bf", "bf": "bq", "bp": "bf", "nq": "nf", "nf": "nq", "kappa": "mu"}
MIRROR = {"rate": "coordinate", "coordinate": "rate", "conjugate": "rate"}


@dataclass(frozen=True)
class Mutant:
    """A changed text and where it was changed."""

    line: int
    what: str
    text: str


def mutants(text: str) -> list[Mutant]:
    """All mutants of a module, in the order of its text."""
    whole = ast.parse(text)
    still = set(_said(whole))
    sites = [(node, what, node in still) for node in ast.walk(whole) for what, _ in _changes(node)]
    found = []
    for number, (node, what, idle) in enumerate(sites):
        if idle:
            continue
        tree = ast.parse(text)
        changed = _Change(number).visit(tree)
        found.append(Mutant(node.lineno, what, ast.unparse(ast.fix_missing_locations(changed))))
    unique = {m.text: m for m in found}
    return sorted(unique.values(), key=lambda m: m.line)


def _said(tree: ast.AST) -> Iterator[ast.AST]:
    """Nodes below texts, raised errors and units of display."""
    for node in ast.walk(tree):
        units = isinstance(node, ast.Subscript) and isinstance(node.value, ast.Attribute) and node.value.attr == "units"
        if units or isinstance(node, ast.JoinedStr | ast.Raise):
            yield from ast.walk(node)


class _Change(ast.NodeTransformer):
    """Carries out the change of one number, counted in the order of `ast.walk`."""

    def __init__(self, number: int) -> None:
        self.number = number

    def visit(self, tree: ast.AST) -> ast.AST:
        count = 0
        for parent in ast.walk(tree):
            for _, made in _changes(parent):
                if count == self.number:
                    return _replaced(tree, parent, made)
                count += 1
        raise IndexError(self.number)


def _replaced(tree: ast.AST, old: ast.AST, new: ast.AST) -> ast.AST:
    class Swap(ast.NodeTransformer):
        def generic_visit(self, node: ast.AST) -> ast.AST:
            return ast.copy_location(new, old) if node is old else super().generic_visit(node)

    return Swap().visit(tree)


def _changes(node: ast.AST) -> Iterator[tuple[str, ast.AST]]:
    """What can be made of a node."""
    match node:
        case ast.Call(func=ast.Name(id="neg") | ast.Attribute(attr="neg"), args=[value]):
            yield "neg left out", value
        case ast.Call(func=ast.Name(id="sub") | ast.Attribute(value=ast.Name(id="ex"), attr="sub"), args=[a, b]):
            yield "sub -> add", ast.Call(ast.Attribute(ast.Name("ex_", ast.Load()), "add", ast.Load()), [a, b], [])
        case ast.BinOp(op=ast.Add() | ast.Sub(), right=ast.Constant(value=1)):
            yield "1 left out", node.left
        case ast.BinOp(op=ast.Sub()) if not _sets(node):
            yield "- -> +", ast.BinOp(node.left, ast.Add(), node.right)
        case ast.UnaryOp(op=ast.USub(), operand=value):
            yield "minus left out", value
        case ast.IfExp(test=test, body=body, orelse=orelse) if _signs(body, orelse):
            yield "signs exchanged", ast.IfExp(test, orelse, body)
        case ast.Subscript(slice=ast.Constant(value=0 | 1 as k)) if isinstance(k, int):
            yield f"[{k}] -> [{1 - k}]", ast.Subscript(node.value, ast.Constant(1 - k), node.ctx)
        case ast.Attribute(value=ast.Name(id="m" | "mirror"), attr=name) if name in MIRROR:
            yield f"{name} -> {MIRROR[name]}", ast.Attribute(node.value, MIRROR[name], node.ctx)
        case ast.Attribute(value=ast.Attribute(attr="mirror"), attr=name) if name in MIRROR:
            yield f"{name} -> {MIRROR[name]}", ast.Attribute(node.value, MIRROR[name], node.ctx)
        case ast.Constant(value=str() as name) if name in KINDS:
            yield f'"{name}" -> "{KINDS[name]}"', ast.Constant(KINDS[name])


def _signs(one: ast.AST, other: ast.AST) -> bool:
    values = []
    for node in (one, other):
        try:
            values.append(ast.literal_eval(node))
        except ValueError:
            return False
    return all(isinstance(v, int | float) for v in values) and values[0] == -values[1] != 0


def _sets(node: ast.BinOp) -> bool:
    """Differences of sets are no signs."""
    return any(isinstance(side, ast.Set | ast.SetComp | ast.Call) for side in (node.left, node.right))
