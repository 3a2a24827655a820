"""Results for people: what a new record changes, and the page of a check."""

from __future__ import annotations

import json
import math
from collections.abc import Sequence
from html import escape

from sysdyn.cli.compare.diffing import differences, headline, table
from sysdyn.cli.golden.book import GoldenScene
from sysdyn.cli.golden.golden_checks import Case, load_golden, tolerance_of
from sysdyn.cli.golden.recording import GoldenRecord
from sysdyn.cli.golden.structures import describe_change
from sysdyn.cli.page.document import document
from sysdyn.cli.page.document import table as html_table
from sysdyn.runtime.comparison.verdict import Incomparable
from sysdyn.runtime.model.failures import TraceError

BESIDE = ("structure", "meter", "run")
"""Kinds of findings that are not in a case's own page of quantities."""


def what_changed(golden: GoldenScene, wanted: GoldenScene, found: GoldenRecord) -> tuple[str | None, str]:
    """(one line, all of it) of what differs between what is kept and what was found; None: nothing."""
    lines, first = [], None
    # the traces
    try:
        verdict = differences(load_golden(golden), found.trace, tolerance_of(golden))
        if not verdict.equal:
            first = headline(verdict)
            lines += [first, table(verdict)]
    except (Incomparable, TraceError, OSError) as error:
        first = f"{error.filename}: {error.strerror}" if isinstance(error, OSError) else str(error)
        lines.append(first)
    # the facts of structure, formulation by formulation
    try:
        kept = json.loads(golden.structure.read_text(encoding="utf-8"))["formulations"]
    except (OSError, ValueError, KeyError, TypeError) as error:
        kept = {}
        lines.append(f"{golden.structure}: {error}")
    new = json.loads(json.dumps(found.structure))
    # what is new, gone or another
    for name in dict.fromkeys((*kept, *new)):
        if name not in kept or name not in new:
            lines.append(f"formulation {name} is {'new' if name in new else 'gone'}")
            continue
        facts = dict.fromkeys((*kept[name], *new[name]))
        lines += [
            f"{name}: {describe_change(k, kept[name].get(k), new[name].get(k))}"
            for k in facts
            if kept[name].get(k) != new[name].get(k)
        ]
    if wanted.rtol != golden.rtol:
        lines.append(f"rtol {golden.rtol:g} becomes {wanted.rtol:g}")
    # bounds of ledgers that grow a lot
    for name in ("energy", "constraints"):
        before, after = getattr(golden, name), getattr(found, name)
        if after > 10.0 * before:
            lines.append(f"bound of audit.{name}: {before:.2g} becomes {after:.2g}")
    if not lines:
        return None, "nothing changed"
    return first or lines[0], "\n".join(lines)


def page(cases: Sequence[Case]) -> str:
    """One page: what failed, each with pictures of what differs, and what passed."""
    wrong = sorted((c for c in cases if c.exit), key=lambda c: -c.ratio)
    parts = [f"<h1>{len(wrong)} of {len(cases)} checks failed</h1>"]
    if wrong:
        parts.append(_summary([(f'<a href="#case{k}">{escape(_title(c))}</a>', c) for k, c in enumerate(wrong)]))
    for k, case in enumerate(wrong):
        parts.append(f'<h2 id="case{k}">{escape(_title(case))}</h2>')
        # findings that the case's own page of quantities does not have
        beside = [t for name, t in case.cases if t is not None and name.partition(":")[0] in BESIDE]
        if beside:
            parts.append('<ul class="bad">' + "".join(f"<li>{escape(text)}</li>" for text in beside) + "</ul>")
        parts.append(case.page or f'<p class="bad">{escape(case.message)}</p>')
    if len(wrong) < len(cases):
        parts.append("<h2>passed</h2>")
        parts.append(_summary([(escape(_title(c)), c) for c in cases if not c.exit]))
    return document("golden traces", "\n".join(parts))


def _title(case: Case) -> str:
    how = (case.formulation, case.method, f"backend {case.backend}" if case.backend else "")
    return f"{case.golden}: {', '.join(filter(None, how))}".removesuffix(": ")


def _summary(cases: Sequence[tuple[str, Case]]) -> str:
    """A row a check: the quantity that is nearest to its limit, or farthest over it."""
    rows = []
    for title, c in cases:
        ratio = f"{c.ratio:.3g}" if math.isfinite(c.ratio) else "–"
        at = "–" if c.time is None or math.isnan(c.time) else f"{c.time:.6g}"
        rows.append([title, escape(c.variable or "–"), ratio, at, f"{c.seconds:.1f}"])
    return html_table(("check", "worst quantity", "times the limit", "at [s]", "took [s]"), rows, left=(0, 1))
