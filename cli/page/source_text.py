"""Texts of the language, highlighted."""

from __future__ import annotations

import re

from sysdyn.cli.page.document import escape

WORDS = (
    "accuracy|as|at|branch|cocoord|component|const|content|coord|discrete|domain|dynamic|energy|every|expect|extends|fn"
    "|for|formulation|from|gamma|if|then|else|implicit|import|in|init|input|law|let|level|limit|model|node|on|output"
    "|param|phi|port|psi|quasi|redundancy|require|scene|set|solver|state|table|time|to|trace|unit|when|while|within|work"
    "|and|or|not|true|false|always|finally|golden"
)
_TOKEN = re.compile(rf"(#.*)|(\"[^\"]*\"?)|(\b[0-9]+(?:\.[0-9]+)?(?:[eE][+-]?[0-9]+)?)|\b((?:{WORDS})\b)|[^\W\d]\w*")
_CLASSES = {1: "c", 2: "s", 3: "n", 4: "w"}


def block(text: str) -> str:
    """A whole text as HTML, without numbers of lines."""
    lines = "\n".join(highlight(line) for line in text.rstrip("\n").split("\n"))
    return f'<pre class="source plain">{lines}</pre>'


def highlight(line: str) -> str:
    """One line as HTML: comments, texts, numbers and words of the language marked."""
    found, end = [], 0
    for match in _TOKEN.finditer(line):
        found.append(escape(line[end : match.start()]))
        text, kind = escape(match[0]), _CLASSES.get(match.lastindex or 0)
        found.append(text if kind is None else f'<span class="{kind}">{text}</span>')
        end = match.end()
    return "".join([*found, escape(line[end:])])
