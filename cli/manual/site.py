"""The whole reference as one page of HTML: the language, the standard library, the codes; nothing is loaded."""

from __future__ import annotations

import re
from collections.abc import Sequence

from sysdyn import __version__
from sysdyn.cli.manual import library, topics
from sysdyn.cli.page.document import document, escape, table
from sysdyn.cli.page.source_text import block
from sysdyn.dsl.text import codes
from sysdyn.dsl.tree import syntax

_CODE = re.compile(r"\b([EWN]\d{3})\b")
_PAGE = re.compile(r"page <code>(\w+)</code>")
MOST_COLUMNS = 200
"""Of an example's line: those at a limit are cut."""


def site() -> str:
    """The page."""
    pages = topics.topics().values()
    links = [(t.name, t.name) for t in pages] + [("std", "library"), ("codes", "codes")]
    bar = "".join(f'<a href="#{target}">{escape(name)}</a>' for target, name in links)
    parts = [
        f"<h1>sysdyn {escape(__version__)}</h1>",
        "<p>A model compiler for physical systems: the language, its library, and what the findings mean.</p>",
        f"<nav>{bar}</nav>",
        *(
            f'<section id="{t.name}"><h2>{escape(t.name)}: {_inline(t.title)}</h2>{_prose(t.text)}</section>'
            for t in pages
        ),
        f'<section id="std"><h2>The standard library</h2>{_library()}</section>',
        f'<section id="codes"><h2>Codes of findings</h2>{_codes()}</section>',
    ]
    return document("sysdyn: reference", '<main class="prose">' + "\n".join(parts) + "</main>")


def _inline(text: str) -> str:
    """A line of Markdown: code, bold, and links to pages and codes."""
    made = re.sub(r"`([^`]*)`", r"<code>\1</code>", escape(text, quote=False).replace("\\|", "|"))
    made = re.sub(r"\*\*(.+?)\*\*", r"<b>\1</b>", made)
    made = re.sub(r"(?<![\w*])\*([^*<\s][^*<]*)\*(?![\w*])", r"<em>\1</em>", made)
    known = topics.topics()
    made = _PAGE.sub(lambda m: f'page <a href="#{m[1]}">{m[1]}</a>' if m[1] in known else m[0], made)
    return _CODE.sub(lambda m: f'<a href="#{m[1]}">{m[1]}</a>' if m[1] in codes.codes() else m[0], made)


def _prose(text: str) -> str:
    """Paragraphs, tables and fenced texts."""
    made: list[str] = []
    lines: list[str] = []
    fence: str | None = None
    for line in [*text.splitlines(), ""]:
        # a fence opens or closes
        if line.startswith("```"):
            if fence is not None:
                made.append(_code_block(fence, lines))
            fence, lines = (line.removeprefix("```") if fence is None else None), []
        # inside of a fence or paragraph
        elif fence is not None or line.strip():
            lines.append(line)
        # an empty line ends a paragraph or table
        elif lines:
            made.append(_table(lines) if lines[0].startswith("|") else f"<p>{_inline(' '.join(lines))}</p>")
            lines = []
    return "\n".join(made)


def _code_block(said: str, lines: Sequence[str]) -> str:
    kind, _, what = said.partition(" ")
    text = "\n".join(lines)
    shown = block(text) if kind == "sd" else f'<pre class="source plain">{escape(text)}</pre>'
    if what.endswith(".sd"):
        return f'<p class="soft">{escape(what)}</p>{shown}'
    return f'<p class="soft">wrong, <a href="#{what}">{what}</a>:</p>{shown}' if what else shown


def _table(lines: Sequence[str]) -> str:
    rows = [
        [_inline(cell.strip()) for cell in line.strip().strip("|").split(" | ")]
        for k, line in enumerate(lines)
        if k != 1
    ]
    width = max(map(len, rows))
    rows = [row + [""] * (width - len(row)) for row in rows]
    return table(rows[0], rows[1:], left=range(width))


def _library() -> str:
    parts = []
    for module, said in (library.modules() | {library.PRELUDE: "Known in every file without an import."}).items():
        name = "Always there" if module == library.PRELUDE else f"std.{module}"
        parts.append(f"<h3>{escape(name)}</h3><p>{escape(said)}</p>")
        parts += [_entry(e) for e in library.entries() if e.module == module]
    return "\n".join(parts)


def _entry(entry: library.LibraryEntry) -> str:
    """HTML of a library's entry: picture, parameters, text and example."""
    parts = [f'<h4 id="{_anchor(entry)}"><code>{escape(entry.name)}</code></h4><p>{escape(entry.doc)}</p>']
    # domains, bundles and constants have a text alone
    if isinstance(entry.item, syntax.ComponentDefinition):
        parts.append(f"<pre>{escape(library.picture(entry))}</pre>")
        rows = [[p["name"], p["unit"], p["default"] or "required", p["doc"]] for p in library.parameters(entry.item)]
        if rows:
            parts.append(table(["", "unit", "default", ""], [[escape(c) for c in r] for r in rows], left=range(4)))
    parts.append(f"<details><summary>text</summary>{block(entry.text)}</details>")
    example = library.example(entry)
    if example is not None:
        parts.append(f"<details><summary>example</summary>{block(example)}</details>")
    return "\n".join(parts)


def _anchor(entry: library.LibraryEntry) -> str:
    return f"std-{entry.module}-{entry.name}"


def _codes() -> str:
    parts = []
    for digit, said in codes.CLASSES.items():
        parts.append(f"<h3>{digit}xx: {escape(said)}</h3>")
        for page in codes.codes().values():
            if page.code[1] == digit:
                parts.append(_code(page))
    return "\n".join(parts)


def _code(page: codes.Code) -> str:
    wrong = "wrong" if page.by == codes.CHECK else f"wrong, as <code>{escape(page.by)}</code> finds"
    examples = "".join(
        f"<details><summary>{word}</summary>{block(_short(text))}</details>"
        for word, text in ((wrong, page.bad), ("right", page.good))
    )
    return f'<h4 id="{page.code}">{page.code} {escape(page.title)}</h4><p>{_inline(page.why)}</p>{examples}'


def _short(text: str) -> str:
    """An example, cut where it is one at a limit."""
    lines = [line if len(line) <= MOST_COLUMNS else line[:MOST_COLUMNS] + "..." for line in text.splitlines()]
    return "\n".join(lines if len(lines) <= 60 else [*lines[:40], f"... ({len(lines) - 40} more lines)"])
