"""What building the tree collects besides nodes: findings, documentation, limits.

The tree's builders add to it what the grammar alone cannot say: a predefined name that is declared
(E108), a number too large for a double (E114), too many terms (E118), a content written as an
energy (E308).
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import field

from sysdyn.dsl.text.diagnostics import Edit, Report
from sysdyn.dsl.text.source import SourceText, Span
from sysdyn.dsl.tree.syntax import Decl, Number, Quantity, Unit, UnitFactor, Word
from sysdyn.values import dataclass

PREDEFINED = frozenset({"t", "pi", "ground", "audit"})
"""Names that every model has and none may declare."""

MAX_TERMS = 50_000
_FACTOR = re.compile(r"([./]?)([^\W\d]\w*)(?:\^(-?[0-9]+))?")


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

    def declared(self, *names: Word | Decl) -> None:
        """Check that names may be declared."""
        for item in names:
            if item.name in PREDEFINED:
                span = Span(item.span.start, item.span.start + len(item.name))
                self.error("E108", f"'{item.name}' is predefined and cannot be declared", span)

    def counted(self, items: Sequence[object], span: Span, what: str = "terms") -> None:
        """Check the number of parts of one chain."""
        if len(items) > MAX_TERMS:
            message = f"an expression of {len(items)} {what}; the limit is {MAX_TERMS}"
            self.error("E118", message, Span(span.start, min(span.start + 40, span.end)), "sum(i in 1..n: ...)")

    def number(self, text: str, span: Span) -> Number:
        """A number as written."""
        return Number(self._value(text, span), text, span)

    def quantity(self, text: str, span: Span, unit: Span) -> Quantity:
        """A number with its unit; `text` is the number's."""
        return Quantity(self._value(text, span), text, self.unit(unit), span)

    def unit(self, span: Span) -> Unit:
        """The unit written inside a quantity."""
        text = self.source.text[span.start : span.end]
        factors = []
        for match in _FACTOR.finditer(text):
            start = span.start + match.start(2)
            place = Span(start, span.start + match.end())
            power = 1 if match.group(3) is None else self.exponent(match.group(3), place)
            factors.append(UnitFactor(match.group(2), power, match.group(1) or ".", place))
        return Unit(tuple(factors), text, span)

    def exponent(self, text: str, span: Span) -> int:
        """The exponent of a unit: an integer of one or two digits."""
        digits = text.lstrip("-")
        if not digits.isdigit():
            self.error("E113", f"the exponent of a unit is an integer, not {_short(text)}", span)
            return 1
        if len(digits) > 2:
            self.error("E113", f"the exponent {_short(text)} of a unit is out of range: -99 to 99", span)
            return 1
        return int(text)

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
