"""Findings placed in a library, shown where the author uses it: the element's line first, the library as a note.

A component's text stands for every instance of it.  What is found there is told at the statement in the author's own
file that made the instance, on the way from the model inwards the last one that the author wrote.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator
from dataclasses import replace

from sysdyn.dsl.elaborate.elaborate import Elaborator
from sysdyn.dsl.names.symbols import Space
from sysdyn.dsl.text.diagnostics import Diagnostic, Place, Related
from sysdyn.dsl.tree import syntax


def point_at_author(elaborator: Elaborator, found: Iterable[Diagnostic]) -> Iterator[Diagnostic]:
    """The findings, those of a library at the author's place."""
    for d in found:
        yield _point_at_author(elaborator, d) if d.place is not None and d.place.source is not elaborator.source else d


def _point_at_author(elaborator: Elaborator, d: Diagnostic) -> Diagnostic:
    """The finding at the author's own text, where a component of the library has its place."""
    assert d.place is not None
    spaces = [s for s, _ in elaborator.instances.bodies if s.path and _contains(elaborator, s, d.place)]
    meant = [s for s in spaces if s.path == d.place.element]
    named = [s for s in spaces if re.search(rf"(?<![\w.]){re.escape(s.path)}(?![\w])", d.message)]
    for space in (*meant, *sorted(named, key=lambda s: -len(s.path)), *spaces):
        place = _author(elaborator, space)
        if place is not None:
            said = f"in component '{space.component}'"
            return replace(d, place=place, related=(Related(said, d.place), *d.related))
    return d


def _contains(elaborator: Elaborator, space: Space, place: Place) -> bool:
    """Whether a place lies in the text of a space's component."""
    if space.source != place.source:
        return False
    body = next(body for s, body in elaborator.instances.bodies if s is space)
    spans = [statement.span for statement, _ in body]
    return any(span.start <= place.span.start and place.span.end <= span.end for span in spans)


def _author(elaborator: Elaborator, space: Space) -> Place | None:
    """The statement in the author's file that a space comes from."""
    labels = [label.partition("[")[0] for label in space.path.split(".")]
    inner: syntax.InstanceStatement | None = None
    for depth, label in enumerate(labels):
        around = ".".join(labels[:depth])
        for outer, body in elaborator.instances.bodies:
            if outer.source is elaborator.source and without_indices(outer.path) == around:
                made = [s for s, _ in body if isinstance(s, syntax.InstanceStatement) and s.decl.name == label]
                inner = made[0] if made else inner
    return None if inner is None else Place(elaborator.source, inner.span)


def without_indices(path: str) -> str:
    """A path of names as a text has it without elements: `a[1].b` is `a.b`."""
    return re.sub(r"\[[^\]]*\]", "", path)
