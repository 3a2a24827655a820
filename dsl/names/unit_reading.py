"""From a unit as written to its value: known names, prefixes, aliases, declared bases (E201)."""

from __future__ import annotations

import re
from collections.abc import Container
from fractions import Fraction

from sysdyn.dsl.model.unit_habits import PREFIXED, case_variants, correct_spelling, declaration, expand_suffix
from sysdyn.dsl.model.units import DEGREE_CELSIUS, NONE, PREFIXES, Dimension, Unit, find_unit, multiply, names, si_text
from sysdyn.dsl.names.symbols import Scope, nearest
from sysdyn.dsl.text.diagnostics import Edit, Place, Report, SourceText
from sysdyn.dsl.tree import syntax


def read_unit(
    unit: syntax.UnitExpression, scope: Scope, source: SourceText, report: Report, bound: Container[str] = ()
) -> Unit | None:
    """The value of a unit; None after reporting E201 or E209.  bound: names in sight beside those of the scope."""
    declaring = scope.declaring
    if declaring.read is None:
        declaring.read = {}
    key = unit.text, len(declaring.units)
    found = declaring.read.get(key)
    if found is None:
        found = _read(unit, scope, source, report, bound)
        if found is not None and "$" not in unit.text:
            declaring.read[key] = found
    return found


def _read(
    unit: syntax.UnitExpression, scope: Scope, source: SourceText, report: Report, bound: Container[str]
) -> Unit | None:
    """The unit that a text means, its factors looked up; None after reporting a factor that is no unit (E201)."""
    dimension: Dimension = NONE
    scale = Fraction(1)
    for factor in unit.factors:
        if factor.name == "1":
            continue
        # with an offset, by itself alone
        if factor.name == "degC" and len(unit.factors) == 1 and factor.exponent == 1:
            return DEGREE_CELSIUS
        # units of the text before those of the SI
        declared = scope.unit(factor.name)
        found = (declared.dimension, declared.scale) if declared else find_unit(factor.name)
        if found is None and scope.is_broken(factor.name):
            return None
        if found is None:
            if source.text[unit.span.start - 1 : unit.span.start].isalnum():
                scope.miss()  # grown to its number, as in 10k: that has been said (E114)
                return None
            in_sight = factor.name in bound or scope.find(factor.name) is not None
            _report_factor(unit, factor, in_sight, Place(source, factor.span), report)
            return None
        power = factor.exponent if factor.op == "." else -factor.exponent
        dimension = multiply(dimension, found[0], power)
        # m^1000
        if not -100 <= power <= 100:
            report.error(
                "E201", f"the exponent {factor.exponent} of a unit is out of reason", Place(source, factor.span)
            )
            return None
        # a fractional power of a scale is as exact as a double
        scale *= found[1] ** power if isinstance(power, int) else Fraction(float(found[1]) ** float(power))
    solved = any(factor.name.startswith("$") for factor in unit.factors)  # what the instance has made of $u
    return Unit(dimension, scale, si_text(dimension) if solved else unit.text)


def _report_factor(
    unit: syntax.UnitExpression, factor: syntax.UnitFactor, in_sight: bool, place: Place, report: Report
) -> None:
    """Report a factor of a unit that nobody declared, with what is near."""
    # `$u` outside of a component
    if factor.name.startswith("$"):
        report.error(
            "E209",
            f"unit variable {factor.name} stands outside a component: nothing determines it",
            place,
            help="write the unit itself",
        )
        return
    beside = place.source.text[max(unit.span.start - 40, 0) : unit.span.start]
    number = re.search(r"(?<![\w.])[0-9][\w.+-]*[ \t]+$", beside)
    quantity = (number.group() if number else "") + unit.text
    message = f"'{factor.name}' is not a unit, in '{quantity}'"
    help_: str | None
    edit = None
    alone = number is not None and len(unit.factors) == 1 and factor.exponent == 1
    plain = expand_suffix("1" + factor.name) if alone and factor.name.isalpha() else None
    before = unit.text[: factor.span.start - unit.span.start].rstrip("./")
    # `4 N/V` with a variable V: a quotient was meant
    if in_sight and before:
        sign = "/" if factor.op == "/" else "*"
        verb = "divide" if factor.op == "/" else "multiply"
        before = quantity.removesuffix(unit.text) + before
        help_ = f"to {verb} by the variable {factor.name} write '{before} {sign} {factor.name}'"
    # `2 x`: a product
    elif number is not None and alone and (in_sight or factor.name == "pi"):
        help_ = f"factors are joined by '*': {number.group().strip()}*{factor.name}"
    # `10 k`: a suffix of circuit simulators
    elif number is not None and plain is not None:
        example = PREFIXED.get(plain[1:], "kohm")
        help_ = f"{number.group().strip()}{plain[1:]}, or with its unit, as in '1 {example}'"
    else:
        help_ = _meant(unit, factor)
        # a spelling that is certain can be mended
        right = correct_spelling(unit.text)
        if right is not None:
            edit = Edit(Place(place.source, unit.span), right)
    report.error("E201", message, place, help=help_, edit=edit)


_SPELLED = dict.fromkeys(("celsius", "Celsius", "centigrade"), "degC")


def _meant(unit: syntax.UnitExpression, factor: syntax.UnitFactor) -> str | None:
    """The unit as it is written here: by rewriting; else the line that would declare it, else the nearest name."""
    # from certain to vague: another spelling, upper and lower case, a declaration, a near name
    right = _SPELLED.get(unit.text) or correct_spelling(unit.text)
    if right is not None:
        return f"write '{right}'"
    alone = correct_spelling(factor.name)
    if alone is not None:
        return f"write '{alone}' for '{factor.name}'"
    several = case_variants(factor.name)
    if several:
        return f"write {' or '.join(repr(unit) for unit in several)}"
    line = declaration(factor.name)
    if line is not None:
        return f"declare it at the top of the file: {line}"
    prefix, base = factor.name[:1], factor.name[1:]
    if prefix in PREFIXES and find_unit(base) is not None:
        return f"{base} takes no prefix: 1e{PREFIXES[prefix]} {base}"
    near = nearest(factor.name, (*names(), "mm", "km", "kN", "kohm", "mA", "uF", "degC"))
    return f"nearest unit: '{near}'" if near and len(factor.name) > 1 else "sysdyn help units lists them"
