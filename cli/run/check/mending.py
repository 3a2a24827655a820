"""The safe changes that findings carry, applied to a text: what `check --fix` writes."""

from __future__ import annotations

from collections.abc import Sequence

from sysdyn.cli.run.request.targets import all_targets
from sysdyn.dsl import load, unused_components
from sysdyn.dsl.model import expression as ex
from sysdyn.dsl.text.diagnostics import Diagnostic, Edit, Report, SourceText

ROUNDS = 50
"""Of mending and reading again, at most: an error of syntax hides those of names behind it."""


def mend(source: SourceText) -> tuple[str, list[Diagnostic]]:
    """The text with every safe change made, and the findings that were mended, in the order of mending."""
    done: list[Diagnostic] = []
    for _ in range(ROUNDS):
        found = _found(source)
        chosen = disjoint_edits([d for d in found if d.edit is not None and d.edit.place.source.text == source.text])
        if not chosen:
            break
        text = _apply_edits(source.text, [d.edit for d in chosen if d.edit is not None])
        after = SourceText(source.name, text)
        if _count_repeated(_found(after), chosen) >= _count_repeated(found, chosen):
            break  # what was said is said again: a change that mends nothing is none
        source, done = after, [*done, *chosen]
    return source.text, done


def _found(source: SourceText) -> list[Diagnostic]:
    """The errors of a text: its syntax, names and units, of every scene and model."""
    report = Report()
    document = load.document(source, report)
    for target in all_targets(document, report):
        with ex.fresh():
            load.network(target.document, target.model, target.scene, report, required=False)
    for _, own in unused_components.check_unused_components(document):
        report.extend(own)
    return [d for d in report if d.severity == "error"]


def _count_repeated(found: list[Diagnostic], chosen: list[Diagnostic]) -> int:
    """How many findings say what one of the chosen says; mending may bring others to light."""
    known = {(d.code, d.message) for d in chosen}
    return sum((d.code, d.message) in known for d in found)


def disjoint_edits(found: Sequence[Diagnostic]) -> list[Diagnostic]:
    """Those whose changes do not overlap, in the order of the text."""
    kept: list[Diagnostic] = []
    end = -1
    for d in sorted(found, key=lambda d: d.edit.place.span if d.edit else (0, 0)):
        assert d.edit is not None
        if d.edit.place.span.start >= end and d.edit not in [k.edit for k in kept]:
            kept.append(d)
            end = d.edit.place.span.end
    return kept


def _apply_edits(text: str, edits: list[Edit]) -> str:
    """The text with the edits made, from its end backwards."""
    for edit in reversed(edits):
        start, end = edit.place.span
        text = text[:start] + edit.text + text[end:]
    return text
