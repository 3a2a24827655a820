"""The texts of a model, highlighted; every line has an address."""

from __future__ import annotations

import re

from sysdyn.cli.page.document import escape
from sysdyn.cli.page.source_text import highlight
from sysdyn.cli.report.report_study import ReportStudy
from sysdyn.dsl.text.source import SourceText


def section(study: ReportStudy) -> str:
    """The model's own text, then, folded, those it takes components from."""
    parts = []
    for k, source in enumerate(study.sources):
        body = _text(source, k)
        name = escape(source.name)
        parts.append(body if k == 0 else f"<details><summary>{name}</summary>{body}</details>")
    return "\n".join(parts)


def _text(source: SourceText, number: int) -> str:
    lines = source.text.splitlines() if "\r" not in source.text else re.split(r"\r\n|\r|\n", source.text)
    made = (
        f'<span class="line" id="L{number}-{k}" data-n="{k}">{highlight(line) or " "}</span>'
        for k, line in enumerate(lines, 1)
    )
    return f'<pre class="source">{"".join(made)}</pre>'
