"""Program -> C text, after runtime/core/system/model.h: functions sd_<block>_rows, _dy, _dyd.

One loop a kernel, one static function a routine.  The text holds no name of the user's: unknowns are places, rows
numbers (the manifest has the names).  Sizes and parameters are read from ix and p, so arrays of any length give the
same text.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Sequence

from sysdyn.compiler.forms.descriptor import DescriptorForm
from sysdyn.compiler.model.integers import FamilyReference
from sysdyn.compiler.model.mirror import word
from sysdyn.compiler.program.emit_c_rolled import Rolled
from sysdyn.compiler.program.emit_c_support import APART, HEAD, SUPPORT, TURNS
from sysdyn.compiler.program.notation import Notation, bound, factors, number, position, total
from sysdyn.compiler.program.program import Assign, Fold, Operand, Program, Routine, Statement, StoreInstruction
from sysdyn.compiler.program.sharing import share_operations

C = Notation("sqrt", "pow", "sd_whole", "INFINITY", "NAN")

_ARGUMENTS = (
    "const double *restrict p, const int32_t *restrict ix, const int32_t *restrict at, const int32_t *restrict to, "
    "double t, const double *restrict y, const double *restrict yd, double *restrict {out}"
)
_PASSED = "frame->p, frame->ix, frame->at, frame->to, t, y, yd, {out}"
_FUNCTIONS = {
    "ln": "log", "abs": "fabs", "min": "sd_min", "max": "sd_max", "sign": "sd_sign", "step": "sd_step", "mod": "sd_mod",
}  # fmt: skip
_OF_ANGLES = {"sin": "sine", "cos": "cosine"}
RARE = 20
"""Statements to an angle, from which on it is turned anew by each output that reads it."""
_BOOLEAN = ("cmp", "and", "or", "not")


def emit_c(program: Program, form: DescriptorForm, head: str = HEAD) -> str:
    """The C text of a program; head: what declares the contract's frame."""
    angles = _Angles()
    turned = {k: found for k, routine in enumerate(program.routines) if (found := angles.angle_numbers(routine))}
    rolled = Rolled(_ARGUMENTS, _PASSED)
    kept = {k for k, found in turned.items() if RARE * len(found) > len(program.routines[k].body)}
    rolled.outputs(program, _printer, kept)
    left = {k: share_operations(r) for k, r in enumerate(program.routines) if k not in rolled.calls}
    inside = {k: _inside(r, turned.get(k, {})) for k, r in left.items()}
    rolled.loops(program, {k: inside[k] for k, r in left.items() if r.loops})
    number = Counter((routine.block, routine.part) for routine in program.routines)
    own = (
        _function(k, r, form, inside[k], k in turned, number[r.block, r.part] == 1)
        for k, r in left.items()
        if k not in rolled.calls
    )
    text = "\n".join([*rolled.texts, *own])
    used = [code for name, code in SUPPORT if f"{name}(" in text]
    if angles.number:
        used.append(TURNS.replace("@", ", ".join(["{0.0, 0.0, 1.0}"] * angles.number)))
    calls = {k: (_call(k, r, k in turned),) for k, r in left.items()} | rolled.calls
    blocks = [_block(name, part, program, calls) for name in program.blocks() for part in ("rows", "dy", "dyd")]
    return "\n".join([head, APART, *used, text, *(b for b in blocks if b)])


def _loop(k: int) -> str:
    return f"i{k}"


def _operand(value: Operand) -> str:
    return f"a{value}" if isinstance(value, int) else number(value, C)


class _Angles:
    """Angles of sines and cosines in all of a text: one that is made alike of the same unknowns has one number."""

    def __init__(self) -> None:
        self._values: dict[tuple[object, ...], int] = {}
        self._numbers: dict[int, int] = {}

    @property
    def number(self) -> int:
        """How many there are."""
        return len(self._numbers)

    def angle_numbers(self, routine: Routine) -> dict[int, int]:
        """Numbers of the angles by the target of each sine and cosine of a routine: where loops go round there are as
        many angles as turns, and none is kept.
        """
        if routine.loops:
            return {}
        value: dict[int, int] = {}
        found = {}
        for s in routine.body:
            if isinstance(s, Assign):
                own = (s.op, s.data, *((value.get(a, -a - 1),) if isinstance(a, int) else a for a in s.args))
                value[s.target] = self._values.setdefault(own, len(self._values))
                if s.op == "call" and s.data in _OF_ANGLES and isinstance(s.args[0], int) and s.args[0] in value:
                    found[s.target] = self._numbers.setdefault(value[s.args[0]], len(self._numbers))
        return found


def _printer(routine: Routine) -> Callable[[Sequence[Statement]], str]:
    """Lines of statements of a routine that is no loop."""
    writer = _CWriter(routine, {})
    return lambda statements: "\n".join(writer.body(statements, "        "))


def _function(k: int, routine: Routine, form: DescriptorForm, inside: str, turned: bool, alone: bool) -> str:
    """A routine as a function of its own; turned: it keeps angles; alone: no other is called where it is, and it may
    become part of its caller.
    """
    out = "r" if routine.part == "rows" else "v"
    kind = ("" if alone else "SD_APART ") + ("void " if out == "r" else "double *")
    kept = ", sd_turn *restrict w" if turned else ""  # one look for the thread's own ones a routine
    head = f"static {kind}f{k}({_ARGUMENTS.format(out=out)}{kept})\n{{"
    return "\n".join([f"/* {_comment(routine, form)} */", head, inside, "}", ""])


def _call(k: int, routine: Routine, turned: bool) -> str:
    """The statement that calls it."""
    kept = ", sd_turns()" if turned else ""
    call = f"f{k}({_PASSED.format(out='r' if routine.part == 'rows' else 'v')}{kept});"
    if routine.part == "rows":
        return call
    return f"v = {call}" if routine.loops else f"(void){call}"


def _inside(routine: Routine, angles: dict[int, int]) -> str:
    """What stands between the braces of a routine's function."""
    writer = _CWriter(routine, angles)
    body = writer.body(writer.angles_first(), "    " * (len(routine.loops) + 1))
    lines = []
    unused = [n for n in ("p", "ix", "at", "to", "t", "y", "yd") if n not in writer.used]
    lines += [f"    {''.join(f'(void){n}; ' for n in unused).strip()}"] if unused else []
    lines += writer.bases
    lines += [f"    double {name} = 0.0;" for name in writer.sums.values()]
    for depth, (first, last) in enumerate(routine.loops):
        name = _loop(depth)
        head = f"for (ptrdiff_t {name} = {bound(first, _loop)}; {name} <= {bound(last, _loop)}; ++{name}) {{"
        lines.append("    " * (depth + 1) + head)
    lines += body
    if routine.part != "rows" and routine.loops:
        lines.append("    " * (len(routine.loops) + 1) + f"v += {routine.entries};")
    lines += ["    " * (depth + 1) + "}" for depth in reversed(range(len(routine.loops)))]
    lines += [f"    if ({name} != 0.0)\n        {place} += {name};" for place, name in writer.sums.items()]
    if routine.part != "rows":
        lines.append("    return v;")
    return "\n".join(lines)


def _comment(routine: Routine, form: DescriptorForm) -> str:
    rows = []
    for row in routine.rows[:8]:
        equations = form.rows[row]
        line = f" (line {equations.place.start[0]})" if equations.place else ""
        rows.append(f"row {row}: {word(form.formulation, equations.kind)}{line}")
    more = f", and {len(routine.rows) - 8} more" if len(routine.rows) > 8 else ""
    return f"{word(form.formulation, routine.block)}, {routine.part}: {', '.join(rows)}{more}"


def _stands(place: FamilyReference) -> bool:
    """No loop moves it."""
    return all(index.loop < 0 and index.table < 0 for index in place.indices)


class _CWriter:
    """Statements of one routine as C; places that no loop enters are computed before the loops."""

    def __init__(self, routine: Routine, angles: dict[int, int]) -> None:
        self.routine = routine
        self.angles = angles
        self._turned: set[int] = set()
        self.bases: list[str] = []
        self.used: set[str] = {"ix"} if routine.loops else set()
        self.sums: dict[str, str] = {}
        self._names: dict[str, str] = {}
        stores = [
            s.place for s in routine.body if isinstance(s, StoreInstruction) and isinstance(s.place, FamilyReference)
        ]
        places = {place.family: {other for other in stores if other.family == place.family} for place in stores}
        alone = {family: found.pop() for family, found in places.items() if routine.loops and len(found) == 1}
        self._summed = {family for family, place in alone.items() if _stands(place)}
        """Families of rows of which the loops reach one place."""

    def body(self, statements: Sequence[Statement], indent: str) -> list[str]:
        """Lines of statements."""
        lines: list[str] = []
        for s in statements:
            match s:
                # an angle of which both sine and cosine are read is turned once
                case Assign() if s.target in self.angles:
                    lines += [f"{indent}{line}" for line in self.sine_or_cosine(s)]
                case Assign():
                    kind = "int" if s.op in _BOOLEAN else "double"
                    lines.append(f"{indent}const {kind} a{s.target} = {self.value(s)};")
                case Fold():
                    lines += self.fold(s, indent)
                case StoreInstruction():
                    lines.append(indent + self.store(s))
        return lines

    def angles_first(self) -> list[Statement]:
        """The routine's statements, what angles are made of and their sines and cosines before all others: where those
        are new a function is called, across which no other value is kept then.
        """
        makers = {s.target: s for s in self.routine.body if isinstance(s, Assign)}
        first: set[int] = set()
        left: list[Operand] = list(self.angles)
        while left:
            target = left.pop()
            if isinstance(target, int) and target in makers and target not in first:
                first.add(target)
                left += makers[target].args
        return sorted(self.routine.body, key=lambda s: not (isinstance(s, Assign) and s.target in first))

    def sine_or_cosine(self, s: Assign) -> list[str]:
        """Sine or cosine of an angle that is kept."""
        k = self.angles[s.target]
        lines = [f"const double a{s.target} = w{k}->{_OF_ANGLES[s.data]};"]
        if k not in self._turned:
            self._turned.add(k)
            lines.insert(0, f"const sd_turn *const w{k} = sd_turned(w + {k}, {_operand(s.args[0])});")
        return lines

    def store(self, s: StoreInstruction) -> str:
        """r[place] += value, or v[entry] = value."""
        value = _operand(s.value)
        if isinstance(s.place, FamilyReference):
            place = f"r[{self.place(s.place, 'to')}]"
            return f"{self._sum(place) if s.place.family in self._summed else place} += {value};"
        return f"v[{s.place}] = {value};"

    def _sum(self, place: str) -> str:
        """The variable in which the loops sum what they add to one place: memory would be the slowest part of it."""
        if place not in self.sums:
            self.sums[place] = f"s{len(self.sums)}"
        return self.sums[place]

    def fold(self, s: Fold, indent: str) -> list[str]:
        """A loop that accumulates."""
        start = {"sum": "0.0", "prod": "1.0", "min": "INFINITY", "max": "(-INFINITY)"}[s.operator]
        a, i, value = f"a{s.target}", _loop(s.loop), _operand(s.value)
        self.used.add("ix")
        step = {
            "sum": f"{a} += {value};",
            "prod": f"{a} *= {value};",
            "min": f"{a} = sd_min({a}, {value});",
            "max": f"{a} = sd_max({a}, {value});",
        }[s.operator]
        head = f"for (ptrdiff_t {i} = {bound(s.first, _loop)}; {i} <= {bound(s.last, _loop)}; ++{i}) {{"
        inner = self.body(s.body, indent + "    ")
        return [f"{indent}double {a} = {start};", indent + head, *inner, f"{indent}    {step}", indent + "}"]

    def place(self, place: FamilyReference, table: str) -> str:
        """The position of an element in y, yd (table at) or r (table to)."""
        self.used.add(table)
        fixed, moving = position(place, f"{table}[{place.family}]", _loop, True)
        return self._add_offset(fixed, moving)

    def _add_offset(self, fixed: str, moving: str) -> str:
        if "ix[" in fixed:
            self.used.add("ix")
            if self.routine.loops:
                fixed = self._base(fixed)
        return f"{fixed} + {moving}" if moving else fixed

    def _base(self, text: str) -> str:
        if text not in self._names:
            self._names[text] = f"b{len(self._names)}"
            self.bases.append(f"    const ptrdiff_t {self._names[text]} = {text};")
        return self._names[text]

    def value(self, s: Assign) -> str:
        """The right-hand side of an assignment."""
        args = [_operand(a) for a in s.args]
        match s.op:
            # unknowns and their rates by place
            case "y" | "yd":
                self.used.add(s.op)
                return f"{s.op}[{self.place(s.data, 'at')}]"
            # a scalar parameter; arrays by element
            case "p":
                self.used.add("p")
                return f"p[{s.data}]"
            case "element":
                self.used.update(("p", "ix"))
                return f"p[{self._add_offset(*position(s.data, '', _loop, True))}]"
            case "time":
                self.used.add("t")
                return "t"
            case "index":
                return f"(double){_loop(s.data)}"
            # without factors of one and signs of minus
            case "sum":
                return total(s.data, args, C)
            case "mul":
                return factors(s.data, args, C)
            case "pow":
                return f"pow({args[0]}, {args[1]})"
            case "call":
                return f"{_FUNCTIONS.get(s.data, s.data)}({', '.join(args)})"
            case "cond":
                return f"{args[0]} ? {args[1]} : {args[2]}"
            case "cmp":
                return f"{args[0]} {s.data} {args[1]}"
            case "and" | "or":
                return (" && " if s.op == "and" else " || ").join(args)
            case "not":
                return f"!{args[0]}"
            case "table":
                return self.table(s, args)
        raise AssertionError(s.op)

    def table(self, s: Assign, args: list[str]) -> str:
        """A call of a table's evaluation."""
        orders, start, sizes, clamped = s.data
        self.used.update(("p", "ix"))
        if len(args) == 1:
            return f"sd_table(p + ix[{start}], ix[{sizes[0]}], {args[0]}, {orders[0]})"
        where = f"p + ix[{start}], ix[{sizes[0]}], ix[{sizes[1]}], ix[{clamped}]"
        return f"sd_table2({where}, {args[0]}, {args[1]}, {orders[0]}, {orders[1]})"


def _block(name: str, part: str, program: Program, calls: dict[int, tuple[str, ...]]) -> str:
    """The exported function of a block's part: its routines in order."""
    numbers = [k for k, r in enumerate(program.routines) if r.block == name and r.part == part]
    if not numbers:
        return ""
    out = "r" if part == "rows" else "v"
    head = (
        f"void sd_{name}_{part}(const sd_frame *frame, double t, const double *y, const double *yd, double *{out})\n{{"
    )
    lines = [head]
    for k, later in zip(numbers, [*numbers[1:], -1], strict=True):
        routine = program.routines[k]
        asked = f"if (!frame->spared || !frame->spared[{routine.kernel}]) " if part == "rows" and routine.loops else ""
        lines += [f"    {asked}{call}" for call in calls[k]]
        last = later < 0 or program.routines[later].kernel != routine.kernel
        if part != "rows" and not routine.loops and last:
            lines.append(f"    v += {routine.entries};")
    if part != "rows":
        lines.append("    (void)v;")
    return "\n".join([*lines, "}", ""])
