"""The texts of a model, highlighted; every line has an address."""

from __future__ import annotations

import re

from sysdyn.cli.page.document import escape
from sysdyn.cli.report.study import Study
from sysdyn.dsl.text.source import SourceText

WORDS = (
    "accuracy|as|at|branch|cocoord|component|const|content|coord|discrete|domain|dynamic|energy|every|expect|extends|fn"
    "|for|formulation|from|gamma|if|then|else|implicit|import|in|init|input|law|let|level|limit|model|node|on|output"
    "|param|phi|port|psi|quasi|redundancy|require|scene|set|solver|state|table|time|to|trace|unit|when|while|within|work"
    "|and|or|not|true|false|always|finally|golden"
)
_TOKEN = re.compile(rf"(#.*)|(\"[^\"]*\"?)|(\b[0-9]+(?:\.[0-9]+)?(?:[eE][+-]?[0-9]+)?)|\b((?:{WORDS})\b)|[^\W\d]\w*")
_CLASSES = {1: "c", 2: "s", 3: "n", 4: "w"}


def section(study: Study) -> str:
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
        f'<span class="line" id="L{number}-{k}" data-n="{k}">{_line(line) or " "}</span>'
        for k, line in enumerate(lines, 1)
    )
    return f'<pre class="source">{"".join(made)}</pre>'


def _line(line: str) -> str:
    found, end = [], 0
    for match in _TOKEN.finditer(line):
        found.append(escape(line[end : match.start()]))
        text, kind = escape(match[0]), _CLASSES.get(match.lastindex or 0)
        found.append(text if kind is None else f'<span class="{kind}">{text}</span>')
        end = match.end()
    return "".join([*found, escape(line[end:])])
