"""DescriptorForm -> Program: single assignments after common-subexpression elimination, whole numbers as slots.

A `Routine` is one function of the generated module: a loop nest and a body in which every value is assigned once,
before its use.  Routines of scalar kernels are cut at about 50 outputs; what they share is computed again in each.
The Jacobian entries of a kernel are those whose derivative is not zero by structure, in the order of its rows and of
the unknowns' numbers.
"""

from __future__ import annotations

from typing import Any

from sysdyn.compiler.forms.descriptor import WITHOUT_ENTRIES, Block, DescriptorForm, LoopKernel
from sysdyn.compiler.model.integers import FamilyReference, Index, Integers, Slot
from sysdyn.compiler.model.terms import Nest, is_affine, is_constant
from sysdyn.dsl.model.calculus import derivative
from sysdyn.dsl.model.expression import Node, is_const, linear, topological, variables
from sysdyn.values import dataclass

Operand = int | float  # the number of an assignment, or a constant

ROWS_A_ROUTINE = 50  # gcc -O2: 1000 equations 12.1 s in one function, 1.85 s in functions of 50
ENTRIES_A_ROUTINE = 150  # about three entries a row
STATEMENTS_A_ROUTINE = 2000  # of long rows: as many as 50 rows of 40 operations
TERMS_A_PIECE = 50  # terms of one row: each about as long as a row of its own


@dataclass(frozen=True, slots=True)
class Assign:
    """value[target] = op(args); op as in `expression`, or y, yd, p, element, time, index with their place in data."""

    target: int
    op: str
    data: Any
    args: tuple[Operand, ...]


@dataclass(frozen=True, slots=True)
class Fold:
    """value[target] = sum (prod, min, max) of `value` over a loop of its own with this body."""

    target: int
    operator: str
    loop: int
    first: Index
    last: Index
    body: tuple[Assign | Fold, ...]
    value: Operand


@dataclass(frozen=True, slots=True)
class StoreInstruction:
    """r[place] += value, or v[place] = value."""

    place: FamilyReference | int
    value: Operand


Statement = Assign | Fold | StoreInstruction


@dataclass(frozen=True, slots=True)
class Routine:
    """One generated function: block, part (rows dy dyd), loops as (first, last), body."""

    block: str
    part: str
    kernel: int
    loops: tuple[tuple[Index, Index], ...]
    body: tuple[Statement, ...]
    entries: int  # of the whole kernel, 0 for rows
    rows: tuple[int, ...]  # row families, for comments


@dataclass(frozen=True, slots=True)
class KernelPattern:
    """What one kernel adds to: its loops, rows, and the places of its entries; families of unknowns that it reads and
    whose rates it reads; row families to which it adds anything but constants and constants times unknowns; those to
    which it adds anything whose slopes change.
    """

    loops: tuple[tuple[Index, Index], ...]
    rows: tuple[FamilyReference, ...]
    dy: tuple[tuple[FamilyReference, FamilyReference], ...]
    dyd: tuple[tuple[FamilyReference, FamilyReference], ...]
    reads: tuple[int, ...]
    rates: tuple[int, ...]
    curved: tuple[int, ...]
    bent: tuple[int, ...]


@dataclass(frozen=True, slots=True)
class Program:
    """The whole module: routines by block and part, patterns by block, slots of ix."""

    routines: tuple[Routine, ...]
    patterns: tuple[tuple[str, tuple[KernelPattern, ...]], ...]
    slots: tuple[Slot, ...]
    scalars: tuple[str, ...]  # scalar parameters in the order of p
    tables: tuple[str, ...]

    def blocks(self) -> tuple[str, ...]:
        """Names of the blocks in order."""
        return tuple(name for name, _ in self.patterns)


@dataclass(frozen=True, slots=True)
class _PatternEntry:
    row: int
    column: Node
    value: Node


class Programmer:
    """One program under way."""

    def __init__(self, form: DescriptorForm, scalars: tuple[str, ...]) -> None:
        self.form = form
        self.integers = Integers()
        self.scalars = {name: k for k, name in enumerate(scalars)}
        self.families = {(f.owner, f.kind): k for k, f in enumerate(form.families)}
        self.changing = frozenset(kink.branch for kink in form.kinks)
        self.tables: dict[str, None] = {}
        self.routines: list[Routine] = []

    def bounds(self, nest: Nest) -> tuple[tuple[Index, Index], ...]:
        """The loops of a kernel; a bound that no outer loop enters is one slot."""
        loops: dict[str, int] = {}
        found = []
        for depth, loop in enumerate(nest):
            found.append((self.bound(loop.first, loops), self.bound(loop.last, loops)))
            loops[f"#{depth}"] = depth
        return tuple(found)

    def bound(self, node: Node, loops: dict[str, int]) -> Index:
        """A bound: always by a slot unless it follows an outer loop, so that no text depends on a size."""
        if any(n.op == "index" for n in topological([node])):
            return self.integers.index(node, loops)
        return Index(-1, self.integers.value(node), 0)

    def reference(self, column: Node, loops: dict[str, int]) -> FamilyReference:
        """The place of an unknown."""
        owner, kind, _ = column.data
        return self.integers.reference(self.families[owner, kind], owner, column.args, loops)

    def kernel(self, block: str, number: int, kernel: LoopKernel) -> KernelPattern:
        """Routines and pattern of one kernel."""
        loops = {f"#{k}": k for k in range(len(kernel.nest))}
        bounds = self.bounds(kernel.nest)
        places = tuple(self.integers.reference(s.row, self.form.rows[s.row].owner, s.at, loops) for s in kernel.rows)
        rows = [s.row for s in kernel.rows]
        pieces = [(k, piece) for k, s in enumerate(kernel.rows) for piece in _pieces(s.expression)]
        stores: list[tuple[FamilyReference | int, Node]] = [(places[k], piece) for k, piece in pieces]
        self._cut((block, "rows", number), bounds, stores, [rows[k] for k, _ in pieces], 0)
        found: dict[str, tuple[tuple[FamilyReference, FamilyReference], ...]] = {"dy": (), "dyd": ()}
        bent: set[int] = set()
        for part, order in (("dy", 0), ("dyd", 1)):
            entries = [] if block in WITHOUT_ENTRIES else _entries(kernel, order)
            found[part] = tuple((places[e.row], self.reference(e.column, loops)) for e in entries)
            numbered: list[tuple[FamilyReference | int, Node]] = [(k, e.value) for k, e in enumerate(entries)]
            self._cut((block, part, number), bounds, numbered, [rows[e.row] for e in entries], len(entries))
            bent.update(rows[e.row] for e in entries if not is_constant(e.value, self.changing))
        unknowns = {n.data for s in kernel.rows for n in variables(s.expression) if n.op == "var"}
        read = [sorted({self.families[owner, kind] for owner, kind, of in unknowns if of == k}) for k in (0, 1)]
        curved = sorted({s.row for s in kernel.rows if not is_affine(s.expression, self.changing)})
        reads, rates = (tuple(families) for families in read)
        return KernelPattern(
            bounds, places, found["dy"], found["dyd"], reads, rates, tuple(curved), tuple(sorted(bent))
        )

    def formula(self, block: str, number: int, nest: Nest, expression: Node) -> None:
        """One value an iteration, in the order of the iterations (formulas.py)."""
        self._cut((block, "dy", number), self.bounds(nest), [(0, expression)], [-1], 1)

    def _cut(
        self,
        what: tuple[str, str, int],
        bounds: tuple[tuple[Index, Index], ...],
        outputs: list[tuple[FamilyReference | int, Node]],
        rows: list[int],
        entries: int,
    ) -> None:
        """Routines of about 50 rows for scalar kernels, fewer where rows are long; one for a loop."""
        size = ENTRIES_A_ROUTINE if entries else ROWS_A_ROUTINE
        body, touched = _Body(self, len(bounds)), dict[int, None]()
        for k, ((place, root), row) in enumerate(zip(outputs, rows, strict=True), 1):
            body.store(place, root)
            if row >= 0:
                touched[row] = None
            full = not bounds and (k % size == 0 or len(body.statements) >= STATEMENTS_A_ROUTINE)
            if full or k == len(outputs):
                self.routines.append(Routine(*what, bounds, tuple(body.statements), entries, tuple(touched)))
                body, touched = _Body(self, len(bounds)), {}


def _pieces(root: Node) -> list[Node]:
    """A row of very many terms in pieces, each added for itself: no function grows with the number of terms."""
    if root.op != "sum" or len(root.args) <= TERMS_A_PIECE:
        return [root]
    constant, coefficients = root.data
    parts = list(zip(coefficients, root.args, strict=True))
    cuts = range(0, len(parts), TERMS_A_PIECE)
    return [linear(0.0 if k else constant, parts[k : k + TERMS_A_PIECE]) for k in cuts]


def _entries(kernel: LoopKernel, order: int) -> list[_PatternEntry]:
    """The structurally nonzero derivatives by unknowns (order 0) or their rates (order 1)."""
    found = []
    for k, summand in enumerate(kernel.rows):
        columns = (n for n in variables(summand.expression) if n.op == "var" and n.data[2] == order)
        for column in sorted(columns, key=lambda n: n.number):
            if column.data[1] != "audit":
                value = derivative(summand.expression, column)
                if not is_const(value, 0.0):
                    found.append(_PatternEntry(k, column, value))
    return found


class _Body:
    """One routine's statements under way; a scope a reduction."""

    def __init__(self, programmer: Programmer, depth: int) -> None:
        self.programmer = programmer
        self.depth = depth
        self.count = 0
        self.loops = {f"#{k}": k for k in range(depth)}
        self.statements: list[Statement] = []
        self.values: dict[Node, Operand] = {}

    def store(self, place: FamilyReference | int, root: Node) -> None:
        """Compute and store one output."""
        self.statements += self._compute(root, self.values)
        self.statements.append(StoreInstruction(place, self.values[root]))

    def _compute(self, root: Node, values: dict[Node, Operand]) -> list[Assign | Fold]:
        """Assignments for what is not known yet; values of reductions' bodies stay in their own scope."""
        body: list[Assign | Fold] = []
        stack = [(root, False)]
        while stack:
            node, ready = stack.pop()
            if node in values:
                continue
            if node.op == "const":
                values[node] = node.data
            elif ready or not node.args or node.op in ("reduce", "var", "param"):
                statement = self._fold(node, values) if node.op == "reduce" else self._assign(node, values)
                body.append(statement)
                values[node] = statement.target
            else:
                stack.append((node, True))
                stack.extend((a, False) for a in reversed(node.args) if a not in values)
        return body

    def _next(self) -> int:
        self.count += 1
        return self.count - 1

    def _fold(self, node: Node, values: dict[Node, Operand]) -> Fold:
        operator, name = node.data
        first, last, inner = node.args
        own = self.depth + sum(1 for k in self.loops if k.startswith("#r"))
        bounds = self.programmer.bound(first, self.loops), self.programmer.bound(last, self.loops)
        self.loops[name] = own
        scope = dict(values)
        body = tuple(self._compute(inner, scope))
        del self.loops[name]
        return Fold(self._next(), operator, own, *bounds, body, scope[inner])

    def _assign(self, node: Node, values: dict[Node, Operand]) -> Assign:
        """Assignment of a node's value; unknowns, parameters and indices by their places."""
        integers = self.programmer.integers
        op, data, args = node.op, node.data, node.args
        # y or y' by place
        if op == "var":
            reference = self.programmer.reference(node, self.loops)
            return Assign(self._next(), "yd" if data[2] else "y", reference, ())
        # a number of its own, or an element of an array
        if op == "param":
            if args or data not in self.programmer.scalars:  # the constant of an integrated row lies among the arrays
                return Assign(self._next(), "element", integers.element(data, args, self.loops), ())
            return Assign(self._next(), "p", self.programmer.scalars[data], ())
        if op == "index":
            return Assign(self._next(), "index", self.loops[data], ())
        # operations on values that are there
        operands = tuple(values[a] for a in args)
        if op == "table":
            return Assign(self._next(), "table", self._table(data, len(args)), operands)
        return Assign(self._next(), op, data, operands)

    def _table(self, data: tuple[str, Any], arguments: int) -> tuple[Any, ...]:
        """(orders, slot of its numbers, slots of its sizes, slot of the clamp flag)."""
        name, order = data
        slot = self.programmer.integers.slot
        self.programmer.tables.setdefault(name)
        orders = order if isinstance(order, tuple) else (order,) if arguments == 1 else (order,) * arguments
        sizes = tuple(slot("points", name, k) for k in range(arguments))
        return orders, slot("table", name), sizes, slot("clamped", name) if arguments > 1 else -1


def program(form: DescriptorForm, scalars: tuple[str, ...]) -> Program:
    """The program of a form; scalars: names of the scalar parameters in the order of p."""
    programmer = Programmer(form, scalars)
    patterns = tuple((b.name, _patterns(programmer, b)) for b in form.blocks)
    return Program(tuple(programmer.routines), patterns, programmer.integers.slots, scalars, tuple(programmer.tables))


def _patterns(programmer: Programmer, block: Block) -> tuple[KernelPattern, ...]:
    return tuple(programmer.kernel(block.name, k, kernel) for k, kernel in enumerate(block.kernels))
