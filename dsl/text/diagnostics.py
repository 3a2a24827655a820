"""What is wrong with a model, as data: found by rules, collected by a report, shown elsewhere.

A diagnostic names its code, says one sentence in the author's terms, and holds the place and,
where there is one, the text to write instead (`help`). Rules never raise: they add to a `Report`.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import replace
from typing import Any

from sysdyn.dsl.text.remedies import remedy
from sysdyn.dsl.text.source import Place, SourceText, Span
from sysdyn.values import dataclass

__all__ = ["Diagnostic", "Edit", "ModelError", "Place", "Related", "Report", "SourceText", "Span"]

_SEVERITIES = {"E": "error", "W": "warning", "N": "note"}


@dataclass(frozen=True, slots=True)
class Related:
    """A second place that belongs to a diagnostic, with what is to be seen there."""

    message: str
    place: Place

    def to_json(self) -> dict[str, Any]:
        """The object of CONTRACT's `related` list."""
        line, column = self.place.start
        return {"file": self.place.file, "line": line, "column": column, "message": self.message}


@dataclass(frozen=True, slots=True)
class Edit:
    """What can safely be written in a place instead: the meaning that the author had for certain."""

    place: Place
    text: str


@dataclass(frozen=True, slots=True)
class Diagnostic:
    """One finding; `place` is None only for what belongs to no text (a command-line value)."""

    code: str
    message: str
    place: Place | None
    help: str | None = None
    related: tuple[Related, ...] = ()
    label: str | None = None
    """A short text beside the carets, where the message alone does not say what is marked."""
    edit: Edit | None = None
    """The remedy as a change of the text, where there is one without a choice (`check --fix`, SARIF)."""
    subject: str | None = None
    """What it is about, where one slip shows in several places: told once, the other places beside it."""

    @property
    def severity(self) -> str:
        """`error`, `warning` or `note`, by the code's letter."""
        return _SEVERITIES[self.code[0]]

    def to_json(self) -> dict[str, Any]:
        """The object of CONTRACT's `diagnostics` list."""
        line = column = end_line = end_column = None
        if self.place is not None:
            line, column = self.place.start
            end_line, end_column = self.place.end
        return {
            "code": self.code,
            "severity": self.severity,
            "message": self.message,
            "help": self.help,
            "file": None if self.place is None else self.place.file,
            "line": line,
            "column": column,
            "end_line": end_line,
            "end_column": end_column,
            "related": [item.to_json() for item in self.related],
        }


class ModelError(Exception):
    """The model cannot be used; `diagnostics` says why."""

    def __init__(self, diagnostics: Iterable[Diagnostic]) -> None:
        self.diagnostics: tuple[Diagnostic, ...] = tuple(diagnostics)
        told = [item for item in self.diagnostics if item.severity == "error"] or self.diagnostics
        super().__init__("; ".join(f"{item.code}: {item.message}" for item in told))

    def __reduce__(self) -> tuple[type[ModelError], tuple[tuple[Diagnostic, ...]]]:
        return ModelError, (self.diagnostics,)


class Report:
    """Collects diagnostics; reading it gives them sorted by place, each once."""

    def __init__(self, diagnostics: Iterable[Diagnostic] = ()) -> None:
        self._found: dict[Diagnostic, None] = dict.fromkeys(diagnostics)
        self._sorted: tuple[int, tuple[Diagnostic, ...]] = 0, ()  # how many they were, and these

    def add(self, diagnostic: Diagnostic) -> None:
        """Add one diagnostic (an error gets the general remedy where it has none); an equal one changes nothing."""
        if diagnostic.help is None and diagnostic.severity == "error":
            diagnostic = replace(diagnostic, help=remedy(diagnostic.code))
        self._found.setdefault(diagnostic)

    def extend(self, diagnostics: Iterable[Diagnostic]) -> None:
        """Add several diagnostics."""
        for diagnostic in diagnostics:
            self.add(diagnostic)

    def retold(self, tell: Callable[[Iterable[Diagnostic]], Iterable[Diagnostic]]) -> None:
        """Tell what was found in another way, in the same order."""
        self._found = dict.fromkeys(tell(self._found))
        self._sorted = 0, ()

    def error(
        self,
        code: str,
        message: str,
        place: Place | None,
        *,
        help: str | None = None,
        related: Iterable[Related] = (),
        label: str | None = None,
        edit: Edit | None = None,
        subject: str | None = None,
    ) -> None:
        """Add a finding; its severity follows from the code's letter."""
        self.add(Diagnostic(code, message, place, help, tuple(related), label, edit, subject))

    warning = error
    note = error

    def __iter__(self) -> Iterator[Diagnostic]:
        return iter(self.diagnostics)

    def __len__(self) -> int:
        return len(self._found)

    @property
    def diagnostics(self) -> tuple[Diagnostic, ...]:
        """Everything found: by file (in the order of their first finding), errors (and CAUSE) before warnings before
        notes, by class (1 names and text, 2 units, ...: what others follow from comes first), then place.
        """
        if self._sorted[0] != len(self._found):
            files: dict[str, int] = {}
            for item in self._found:
                files.setdefault("" if item.place is None else item.place.file, len(files))
            found = tuple(_told_once(sorted(self._found, key=lambda item: _order(item, files))))
            self._sorted = len(self._found), found
        return self._sorted[1]

    @property
    def failed(self) -> bool:
        """Whether there is at least one error."""
        return any(item.severity == "error" for item in self._found)

    def raise_if_failed(self) -> None:
        """Raise ModelError with everything found if there is an error among it."""
        if self.failed:
            raise ModelError(self.diagnostics)


CAUSE = "W101"
"""A warning that is told before errors, for units and members that do not fit follow from it."""
HERE_TOO = "here too"
"""Beside the other places of one slip."""


def _told_once(found: list[Diagnostic]) -> list[Diagnostic]:
    """Findings, those of one subject in a file told at the first place, with the other places beside it."""
    told: dict[object, Diagnostic] = {}
    for k, item in enumerate(found):
        if item.subject is None or item.place is None:
            told[k] = item
            continue
        key = item.subject, item.place.file
        first = told.get(key)
        if first is None:
            told[key] = item
            continue
        known = {r.place for r in first.related} | {first.place}
        more = [Related(HERE_TOO, item.place), *(r for r in item.related if r.message == HERE_TOO)]
        told[key] = replace(first, related=(*first.related, *(r for r in more if r.place not in known)))
    return list(told.values())


MOST = 200
"""Findings of one severity in one file that are shown."""


def limit_findings(found: Iterable[Diagnostic]) -> list[Diagnostic]:
    """Findings without those of a file and a severity beyond MOST, whose number the note N101 gives."""
    kept: list[Diagnostic] = []
    seen: dict[tuple[str, str], list[Diagnostic]] = {}
    for item in found:
        same = seen.setdefault(("" if item.place is None else item.place.file, item.severity), [])
        same.append(item)
        if len(same) <= MOST:
            kept.append(item)
    for (_, severity), same in seen.items():
        if len(same) > MOST:
            rest = len(same) - MOST
            message = f"{rest} more {severity}{'s' * (rest > 1)} of this file are not shown"
            kept.append(Diagnostic("N101", message, same[MOST].place, help=f"the first {MOST} come before this place"))
    return kept


def _order(item: Diagnostic, files: dict[str, int]) -> tuple[int, int, str, int, int, str, str]:
    """Sort key: file, severity, class, span, code, message."""
    rank = 0 if item.code == CAUSE else tuple(_SEVERITIES).index(item.code[0]), item.code[1]
    if item.place is None:
        return files[""], *rank, -1, -1, item.code, item.message
    span = item.place.span
    return files[item.place.file], *rank, span.start, span.end, item.code, item.message
