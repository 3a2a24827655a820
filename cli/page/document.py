"""A page around a body of HTML, and its tables.  Cells and bodies are HTML: texts of users pass through `escape`."""

from __future__ import annotations

import base64
import hashlib
from collections.abc import Collection, Sequence
from functools import cache
from html import escape
from importlib import resources

__all__ = ["document", "escape", "table"]


@cache
def _file(name: str) -> str:
    return resources.files(__package__).joinpath(name).read_text(encoding="utf-8")


def document(title: str, body: str, *, script: str | None = None) -> str:
    """The whole page.  script: a file of this room; the page's policy lets no other script run and loads nothing."""
    code = "" if script is None else _file(script)
    digest = base64.b64encode(hashlib.sha256(code.encode()).digest()).decode()
    allowed = f"script-src 'sha256-{digest}'; " if code else ""
    policy = f"default-src 'none'; {allowed}style-src 'unsafe-inline'; base-uri 'none'"
    return (
        '<!doctype html>\n<html lang="en"><head><meta charset="utf-8">'
        f'<meta http-equiv="Content-Security-Policy" content="{policy}">'
        '<meta name="viewport" content="width=device-width,initial-scale=1">'
        f"<title>{escape(title)}</title><style>{_file('style.css')}</style></head>\n<body>\n{body}\n"
        + (f"<script>{code}</script>\n" if code else "")
        + "</body></html>\n"
    )


def table(heads: Sequence[str], rows: Sequence[Sequence[str]], *, left: Collection[int] = ()) -> str:
    """A table; the columns `left` begin at one place, the others, numbers, end at one."""
    lines = []
    for tag, cells in (("th", heads), *(("td", row) for row in rows)):
        made = (f"<{tag}{' class=left' if k in left else ''}>{cell}</{tag}>" for k, cell in enumerate(cells))
        lines.append(f"<tr>{''.join(made)}</tr>")
    return '<div class="wide"><table>' + "\n".join(lines) + "</table></div>"
