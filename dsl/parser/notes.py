"""What building the tree collects besides nodes: findings, documentation, limits.

The tree's builders add to it what the grammar alone cannot say: a predefined name that is declared
(E108), a number too large for a double (E114), too many terms (E118), a content written as an
energy (E308).
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import field
from fractions import Fraction

from sysdyn.dsl.model.units import exponent_text
from sysdyn.dsl.parser.lexing import EXPONENT
from sysdyn.dsl.text.diagnostics import Edit, Report
from sysdyn.dsl.text.source import SourceText, Span
from sysdyn.dsl.tree.syntax import Decl, Number, QuantityLiteral, UnitExpression, UnitFactor, Word
from sysdyn.values import dataclass

PREDEFINED = frozenset({"t", "pi", "ground", "audit"})
"""Names that every model has and none may declare."""

MAX_TERMS = 50_000
_FACTOR = re.compile(rf"([./]?)([^\W\d]\w*)(?:\^({EXPONENT}|\([^()]*\)))?")
_EXPONENT = re.compile(EXPONENT)
_GROUPED = re.compile(r"([-+]?[0-9]{1,2}(?:\.[0-9]{1,3})?)(?:/([1-9][0-9]?))?")
_WHOLE = "a number, as in m^2, m^1.5 or m^1/3; for a power of the quantity parentheses around it: (2 m)^(n)"


@dataclass(slots=True)
class Notes:
    """Findings of one text while its tree is built."""

    source: SourceText
    report: Report = field(default_factory=Report)
    docs: dict[int, str] = field(default_factory=dict)

    def error(
        self, code: str, message: str, span: Span, help: str | None = None, edit: tuple[Span, str] | None = None
    ) -> None:
        """Add a finding at a span; edit: a span and what is certainly meant there."""
        place = self.source.place(span.start, span.end)
        change = None if edit is None else Edit(self.source.place(*edit[0]), edit[1])
        self.report.error(code, message, place, help=help, edit=change)

    def doc(self, span: Span) -> str | None:
        """The documentation above the statement of that span."""
        return self.docs.get(span.start)

    def check_declared(self, *names: Word | Decl) -> None:
        """Check that names may be declared."""
        for item in names:
            if item.name in PREDEFINED:
                span = Span(item.span.start, item.span.start + len(item.name))
                self.error("E108", f"'{item.name}' is predefined and cannot be declared", span)

    def check_count(self, items: Sequence[object], span: Span, what: str = "terms") -> None:
        """Check the number of parts of one chain."""
        if len(items) > MAX_TERMS:
            message = f"an expression of {len(items)} {what}; the limit is {MAX_TERMS}"
            self.error("E118", message, Span(span.start, min(span.start + 40, span.end)), "sum(i in 1..n: ...)")

    def number(self, text: str, span: Span) -> Number:
        """A number as written."""
        return Number(self._value(text, span), text, span)

    def quantity(self, text: str, span: Span, unit: Span) -> QuantityLiteral:
        """A number with its unit; `text` is the number's."""
        return QuantityLiteral(self._value(text, span), text, self.unit(unit), span)

    def unit(self, span: Span) -> UnitExpression:
        """The unit written inside a quantity."""
        text = self.source.text[span.start : span.end]
        factors = []
        for match in _FACTOR.finditer(text):
            start = span.start + match.start(2)
            place = Span(start, span.start + match.end())
            written = match.group(3) or "1"
            power = self._read_exponent(written, place, span) if written[0] == "(" else self.exponent(written, place)
            factors.append(UnitFactor(match.group(2), power, match.group(1) or ".", place))
        return UnitExpression(tuple(factors), text, span)

    def exponent(self, text: str, span: Span) -> int | Fraction:
        """The exponent of a unit: an integer of one or two digits, a decimal or a fraction."""
        if not _EXPONENT.fullmatch(text):
            message = f"the exponent of a unit is an integer, a decimal or a fraction such as 1/2, not {_short(text)}"
            self.error("E113", message, span)
            return 1
        if len(text.lstrip("-").partition(".")[0]) > 3 or abs(Fraction(text)) > 99:
            self.error("E113", f"the exponent {_short(text)} of a unit is out of range: -99 to 99", span)
            return 1
        exact = Fraction(text).limit_denominator(1000)
        return int(exact) if exact.denominator == 1 else exact

    def _read_exponent(self, written: str, place: Span, unit: Span) -> int | Fraction:
        """E115: an exponent in parentheses, which others would read as one of the whole quantity."""
        text, inner = self.source.text[unit.start : unit.end], "".join(written[1:-1].split())
        found = _GROUPED.fullmatch(inner)
        exact = Fraction(found[1]) / int(found[2] or 1) if found else Fraction(1)
        power = int(exact) if exact.denominator == 1 else exact
        meant = text.replace(f"^{written}", f"^{exponent_text(power)}" if power != 1 else "")
        help_ = f"write '{meant}', or parentheses around the whole quantity whose power is meant"
        certain = found is not None and _EXPONENT.fullmatch(exponent_text(power)) is not None
        message = f"the exponent of a unit stands without parentheses, in {_short(text)}"
        self.error("E115", message, place, help_ if certain else _WHOLE, (unit, meant) if certain else None)
        return power

    def _value(self, text: str, span: Span) -> float:
        """The double nearest to a number's text."""
        value = float(text)
        if value in (float("inf"), 0.0) and text[0] != "-":
            digits = text.lower().partition("e")[0]
            if value != 0.0:
                self.error("E114", f"the number {_short(text)} is too large: the largest is 1.797e308", span, "inf")
                return 1.0  # neither zero nor infinite: nothing follows from it
            if digits.strip("0."):
                self.error("E114", f"the number {_short(text)} is too small: the smallest is 5e-324", span, "0")
        return value


def _short(text: str) -> str:
    """A text for a message, in quotes, shortened in the middle."""
    return f"'{text}'" if len(text) <= 24 else f"'{text[:10]}...{text[-10:]}'"
