"""Findings as the protocol's diagnostics, and their safe changes as code actions."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from typing import Any

from sysdyn.cli.lsp import positions
from sysdyn.cli.lsp.documents import Document
from sysdyn.dsl.text.diagnostics import Diagnostic, Edit
from sysdyn.dsl.text.source import SourceText, Span

SEVERITIES = {"error": 1, "warning": 2, "note": 3}


def diagnostic(d: Diagnostic) -> dict[str, Any]:
    """A finding with its help and the other places that belong to it."""
    related = [{"location": positions.location(r.place), "message": r.message} for r in d.related]
    return {
        "range": positions.START if d.place is None else positions.range_of(d.place.source, d.place.span),
        "severity": SEVERITIES[d.severity],
        "code": d.code,
        "source": "sysdyn",
        "message": d.message + (f" ({d.label})" if d.label else "") + (f"\nhelp: {d.help}" if d.help else ""),
        "relatedInformation": related,
    }


def unread(said: str) -> dict[str, Any]:
    """Why a text could not be judged."""
    return {"range": positions.START, "severity": 1, "source": "sysdyn", "message": said, "relatedInformation": []}


def by_uri(found: Iterable[Diagnostic], own: str, uri_of: Callable[[str], str]) -> dict[str, list[dict[str, Any]]]:
    """Diagnostics by the document that they are in; own: that which was checked, where those without a place go."""
    listed: dict[str, list[dict[str, Any]]] = {own: []}
    for d in found:
        uri = own if d.place is None else uri_of(d.place.file)
        listed.setdefault(uri, []).append(diagnostic(d))
    return listed


def actions(document: Document, found: Sequence[Diagnostic], asked: Span, only: Sequence[str]) -> list[dict[str, Any]]:
    """Quick fixes of findings that touch a range, and all safe changes at once where there is one."""
    fixes = [d for d in found if _fits(document, d.edit)]
    listed: list[dict[str, Any]] = []
    if _is_wanted("quickfix", only):
        for d in fixes:
            assert d.edit is not None
            spans = [d.edit.place.span, *([d.place.span] if d.place is not None else [])]
            if any(s.start <= asked.end and asked.start <= s.end for s in spans):
                listed.append(_action(document, _title(d.edit), "quickfix", [d.edit], [diagnostic(d)]))
    # the same fixes that `check --fix` makes
    if fixes and _is_wanted("source.fixAll", only):
        from sysdyn.cli.run.check.mending import disjoint_edits

        edits = [d.edit for d in disjoint_edits(fixes) if d.edit is not None]
        listed.append(_action(document, "All safe changes (check --fix)", "source.fixAll", edits, []))
    return listed


def _fits(document: Document, edit: Edit | None) -> bool:
    """Whether a change is one of the text as it is now."""
    source = None if edit is None else edit.place.source
    return source is not None and source.name == document.name and source.text == document.source.text


def _is_wanted(kind: str, only: Sequence[str]) -> bool:
    return not only or any(kind == k or kind.startswith(f"{k}.") for k in only)


def _title(edit: Edit) -> str:
    """What a change does, in words."""
    start, end = edit.place.span
    before, after = (" ".join(t.split()) for t in (edit.place.source.text[start:end], edit.text))
    if not before:
        return f"Write '{after}'"
    return f"Replace '{before}' by '{after}'" if after else f"Remove '{before}'"


def _action(
    document: Document, title: str, kind: str, edits: list[Edit], mends: list[dict[str, Any]]
) -> dict[str, Any]:
    changes = [text_edit(document.source, e.place.span, e.text) for e in edits]
    action = {"title": title, "kind": kind, "edit": {"changes": {document.uri: changes}}}
    return action | ({"diagnostics": mends, "isPreferred": True} if mends else {})


def text_edit(source: SourceText, span: Span, text: str) -> dict[str, Any]:
    """The protocol's change of a text."""
    return {"range": positions.range_of(source, span), "newText": text}


def format_edits(document: Document) -> list[dict[str, Any]] | None:
    """The change into the canonical layout, of the lines that differ; None where the text does not parse."""
    from sysdyn.dsl.format.format import format_text

    tree, problems = document.tree_and_problems
    if any(d.severity == "error" for d in problems):
        return None
    before, after = document.source.text, format_text(tree)
    if before == after:
        return []
    old, new = (text.splitlines(keepends=True) for text in (before, after))
    head = _alike(old, new)
    tail = _alike(old[head:][::-1], new[head:][::-1])
    start = sum(map(len, old[:head]))
    end = len(before) - sum(map(len, old[len(old) - tail :]))
    return [text_edit(document.source, Span(start, end), "".join(new[head : len(new) - tail]))]


def _alike(old: list[str], new: list[str]) -> int:
    """How many lines are the same from the first on."""
    for k, (a, b) in enumerate(zip(old, new, strict=False)):
        if a != b:
            return k
    return min(len(old), len(new))
