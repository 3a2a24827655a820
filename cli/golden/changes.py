"""Results for people: what a new record changes, and the page of a check."""

from __future__ import annotations

import json
from collections.abc import Sequence
from html import escape

from sysdyn.cli.diffing import differences, headline, table
from sysdyn.cli.golden.book import Golden
from sysdyn.cli.golden.checking import Case, loaded, tolerance_of
from sysdyn.cli.golden.recording import Recorded
from sysdyn.cli.golden.structures import changed
from sysdyn.cli.page.document import document
from sysdyn.runtime.comparison.verdict import Incomparable
from sysdyn.runtime.failures import TraceError


def what_changed(golden: Golden, wanted: Golden, found: Recorded) -> tuple[str | None, str]:
    """(one line, all of it) of what differs between what is kept and what was found; None: nothing."""
    lines, first = [], None
    try:
        verdict = differences(loaded(golden), found.trace, tolerance_of(golden))
        if not verdict.equal:
            first = headline(verdict)
            lines += [first, table(verdict)]
    except (Incomparable, TraceError, OSError) as error:
        first = str(error)
        lines.append(first)
    try:
        kept = json.loads(golden.structure.read_text(encoding="utf-8"))["formulations"]
    except (OSError, ValueError, KeyError, TypeError) as error:
        kept = {}
        lines.append(f"{golden.structure}: {error}")
    new = json.loads(json.dumps(found.structure))
    for name in dict.fromkeys((*kept, *new)):
        if name not in kept or name not in new:
            lines.append(f"formulation {name} is {'new' if name in new else 'gone'}")
            continue
        facts = dict.fromkeys((*kept[name], *new[name]))
        lines += [
            f"{name}: {changed(k, kept[name].get(k), new[name].get(k))}"
            for k in facts
            if kept[name].get(k) != new[name].get(k)
        ]
    if wanted.rtol != golden.rtol:
        lines.append(f"rtol {golden.rtol:g} becomes {wanted.rtol:g}")
    for name in ("energy", "constraints"):
        before, after = getattr(golden, name), getattr(found, name)
        if after > 10.0 * before:
            lines.append(f"bound of audit.{name}: {before:.2g} becomes {after:.2g}")
    if not lines:
        return None, "nothing changed"
    return first or lines[0], "\n".join(lines)


def page(cases: Sequence[Case]) -> str:
    """One page: every check, with pictures of what differs."""
    parts = [f"<h1>{sum(c.exit != 0 for c in cases)} of {len(cases)} checks failed</h1>"]
    for case in sorted(cases, key=lambda c: c.exit == 0):
        word = "good" if case.exit == 0 else "bad"
        parts.append(f'<h2>{escape(case.label)}</h2><p class="{word}">{escape(case.message)}</p>')
        wrong = [text for _, text in case.cases if text is not None]
        if wrong:
            parts.append("<ul>" + "".join(f"<li>{escape(text)}</li>" for text in wrong) + "</ul>")
        parts.append(case.page)
    return document("golden traces", "\n".join(parts))
