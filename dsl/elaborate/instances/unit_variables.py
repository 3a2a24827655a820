"""Unit variables ($u): each instance solves its own from its arguments and inputs (E209).

`param kp: $y/$u` with an argument in V/rad says $y/$u = V/rad: linear equations in the logarithms, solved over the
rationals.
"""

from __future__ import annotations

from collections.abc import Mapping
from fractions import Fraction
from typing import TYPE_CHECKING

from sysdyn.dsl.elaborate.statements.parameters import Argument
from sysdyn.dsl.model import dimensions as dim
from sysdyn.dsl.model.units import NONE, Dimension, Unit, find_unit, multiply, power_of, si_text
from sysdyn.dsl.names.symbols import Space, Typed
from sysdyn.dsl.text.diagnostics import Place
from sysdyn.dsl.tree import syntax

if TYPE_CHECKING:
    from sysdyn.dsl.elaborate.instances.head import Interface
    from sysdyn.dsl.elaborate.instances.instances import Instances

Equation = tuple[dict[str, Fraction], Dimension, str]  # exponents of the variables, what is left, who says so


def solve_units(
    frame: Instances,
    s: syntax.InstanceStatement,
    space: Space,
    head: Interface,
    arguments: dict[str, Argument],
    inputs: dict[str, syntax.Expr],
) -> None:
    """Enter the instance's unit variables as units of its scope."""
    declared = {n: p.unit for n, p in head.parameters.items() if p.unit} | {n: i.unit for n, i in head.inputs.items()}
    names = {f.name for unit in declared.values() for f in unit.factors if f.name.startswith("$")}
    if not names:
        return
    equations, places = [], dict[str, Place | syntax.Span]()
    # each argument in a unit with variables is an equation: k: $u/m given 3 N/m says $u = N
    for name, unit in declared.items():
        if not any(f.name.startswith("$") for f in unit.factors):
            continue
        if name in arguments:
            value = arguments[name].value
            given, places[name] = value.dimension if isinstance(value, Typed) else None, arguments[name].place
        # of an input its expression tells the dimension
        elif name in inputs:
            given, places[name] = frame.resolver.scalar(inputs[name]).dimension, inputs[name].span
        # defaulted: says nothing of the variables
        else:
            continue
        if given is not None:
            equations.append(_equation(unit, given, name, space))
    for name, dimension in _solve_units(frame, s, names, equations, places).items():
        space.scope.units[name] = Unit(dimension, Fraction(1), si_text(dimension))


def _equation(unit: syntax.UnitExpression, given: Dimension, name: str, space: Space) -> Equation:
    """What a unit with variables says of their exponents, and the dimension left for them."""
    exponents: dict[str, Fraction] = {}
    rest = given
    for factor in unit.factors:
        power = factor.exponent if factor.op == "." else -factor.exponent
        if factor.name.startswith("$"):
            exponents[factor.name] = exponents.get(factor.name, Fraction(0)) + power
        elif factor.name != "1":
            own = space.scope.unit(factor.name)
            found = own.dimension if own else (find_unit(factor.name) or (NONE, 1))[0]
            rest = multiply(rest, found, -power)
    return exponents, rest, name


def _solve_units(
    frame: Instances,
    s: syntax.InstanceStatement,
    names: set[str],
    equations: list[Equation],
    places: Mapping[str, Place | syntax.Span],
) -> dict[str, Dimension]:
    """What the variables are; E209 where equations do not tell, or contradict each other."""
    found = _eliminate(names, equations)
    # no argument has the variable in its unit
    if isinstance(found, str):
        message = f"unit variable {found} of '{s.decl.name}' is not determined"
        raise frame.resolver.fail("E209", message, s.span, help="give an input or parameter that has it")
    if isinstance(found, dict):
        return found
    # a contradiction: leaving out one argument in turn shows whether it alone is odd
    odd = {
        e[2]: rest
        for e in equations
        if isinstance(rest := _eliminate(names, [o for o in equations if o is not e]), dict)
    }
    if len(odd) == 1:  # the others agree
        ((name, rest),) = odd.items()
        exponents, left, _ = next(e for e in equations if e[2] == name)
        for variable, power in exponents.items():
            left = multiply(left, rest[variable], -power)
        missing = dim.show(power_of(left, -1))
        message = f"'{name}' of '{s.decl.name}' contradicts what the others say of its unit"
        raise frame.resolver.fail("E209", message, places.get(name, s.span), help=f"a factor in {missing} is missing")
    message = _contradiction(s.decl.name, *found, equations)
    raise frame.resolver.fail("E209", message, s.span)


def _eliminate(
    names: set[str], equations: list[Equation]
) -> dict[str, Dimension] | tuple[Equation, dict[str, Equation]] | str:
    """Gaussian elimination, one variable after the other: what they are; an equation that contradicts, and what each
    was told by; or the name of one that nothing tells.
    """
    rows = [(dict(e), d, n) for e, d, n in equations]
    solved: list[tuple[str, dict[str, Fraction], Dimension]] = []
    told: dict[str, Equation] = {}
    # forward: one equation tells the variable, the others lose it
    for variable in sorted(names):
        pivot = next((r for r in rows if r[0].get(variable)), None)
        if pivot is None:
            return variable
        rows.remove(pivot)
        told[variable] = pivot
        factor = pivot[0][variable]
        exponents = {k: v / factor for k, v in pivot[0].items() if k != variable and v}
        value = power_of(pivot[1], 1 / factor)
        solved.append((variable, exponents, value))
        rows = [_substitute(r, variable, exponents, value) for r in rows]
    # an equation without variables that is not 1 = 1
    wrong = next((r for r in rows if r[1]), None)
    if wrong is not None:
        return wrong, told
    found: dict[str, Dimension] = {}
    # back substitution
    for variable, exponents, value in reversed(solved):
        for other, power in exponents.items():
            value = multiply(value, found[other], -power)
        found[variable] = tuple((k, int(v) if v == int(v) else v) for k, v in value)
    return found


def _contradiction(label: str, wrong: Equation, told: dict[str, Equation], equations: list[Equation]) -> str:
    """What two arguments make of one unit variable; of several in one, by how much they differ."""
    alone = next(e for e in equations if e[2] == wrong[2])
    variable = next(iter(alone[0]))
    first = told.get(variable)
    if first is None or any(len(e[0]) > 1 or abs(e[0][variable]) != 1 for e in (first, alone)):
        return f"the unit variables of '{label}' contradict each other at '{wrong[2]}' (off by {dim.show(wrong[1])})"
    one, other = (dim.show(power_of(e[1], 1 / e[0][variable])) for e in (first, alone))
    return f"unit variable {variable} of '{label}' is {one} by '{first[2]}' and {other} by '{wrong[2]}'"


def _substitute(row: Equation, variable: str, exponents: dict[str, Fraction], value: Dimension) -> Equation:
    power = row[0].get(variable, Fraction(0))
    if not power:
        return row
    left = {k: v for k, v in row[0].items() if k != variable}
    for other, e in exponents.items():
        left[other] = left.get(other, Fraction(0)) - power * e
    return {k: v for k, v in left.items() if v}, multiply(row[1], value, -power), row[2]
