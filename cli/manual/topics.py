"""The pages of the language (`dsl/language/*.md`), written once: `sysdyn help` prints them, people read them."""

from __future__ import annotations

import re
from functools import cache
from pathlib import Path

import sysdyn.dsl.load
from sysdyn.cli.page.columns import align
from sysdyn.values import dataclass

FOLDER = Path(sysdyn.dsl.load.__file__).parent / "language"
FIRST = [
    "overview",
    "tutorial",
    "text",
    "units",
    "expressions",
    "parameters",
    "tables",
    "coordinates",
    "constraints",
    "elements",
    "domains",
    "components",
    "levels",
    "arrays",
    "signals",
    "start",
    "scenes",
    "traces",
    "expectations",
    "events",
    "formulations",
    "accuracy",
    "habits",
    "editors",
]
"""The order in which the pages are read."""


@dataclass(frozen=True, slots=True)
class Topic:
    """A page: its name, the rest of its title, and its text below the title, in Markdown."""

    name: str
    title: str
    text: str


@dataclass(frozen=True, slots=True)
class Example:
    """A fenced text of a page: a model (kind sd) or commands (sh), one a line.

    code: what it shows, where it is wrong on purpose; file: the name under which commands behind it find it.
    """

    topic: str
    text: str
    code: str | None
    kind: str = "sd"
    file: str | None = None


@cache
def topics() -> dict[str, Topic]:
    """All pages by name, in their order."""
    found = {}
    for path in sorted(FOLDER.glob("*.md"), key=lambda p: (p.stem not in FIRST, FIRST.index(p.stem), p.stem)):
        if path.stem == "README":
            continue
        head, _, text = path.read_text(encoding="utf-8").partition("\n")
        name, _, title = head.removeprefix("# ").partition(": ")
        found[name] = Topic(name, title, text.strip("\n"))
    return found


def find_topic(word: str) -> Topic | None:
    """The page of that name or beginning, else the only one whose title holds the word."""
    pages = topics()
    if word in pages:
        return pages[word]
    for fitting in (
        [t for t in pages.values() if t.name.startswith(word)],
        [t for t in pages.values() if re.search(rf"\b{re.escape(word)}", t.title)],
    ):
        if len(fitting) == 1:
            return fitting[0]
    return None


def index() -> str:
    """One line a page."""
    return align([(f"  {t.name}", t.title) for t in topics().values()])


def examples() -> list[Example]:
    """Every fenced text of every page."""
    found = []
    for topic in topics().values():
        for kind, said, text in re.findall(r"^```(\w*) ?([\w.]*)\n(.*?)^```$", topic.text, re.M | re.S):
            assert kind in ("sd", "sh"), f"{topic.name}: a fence without a language is not tested"
            file = said if said.endswith(".sd") else None
            found.append(Example(topic.name, text, None if file else said or None, kind, file))
    return found


def page(topic: Topic) -> str:
    """A page for the terminal: fences become indented texts, tables line up."""
    lines = [f"{topic.name}: {topic.title}", ""]
    table: list[list[str]] = []
    fenced = False
    for line in [*topic.text.splitlines(), ""]:
        # rows are kept until the table ends: its columns are as wide as the widest
        if line.startswith("|") and not fenced:
            table.append([_plain(cell) for cell in line.strip().strip("|").split(" | ")])
            continue
        if table:
            lines += [f"  {row}" for row in _rows(table).splitlines()]
            table = []
        # a fence opens or closes; ```sd wall.sd is a file, ```sd E805 a wrong text
        if line.startswith("```"):
            fenced = not fenced
            said = line.removeprefix("```sd").removeprefix("```sh").strip()
            word = "file" if said.endswith(".sd") else "wrong"
            lines += [f"    # {word}: {said}"] if fenced and said else []
        else:
            lines.append(f"    {line}".rstrip() if fenced else line.replace("**", ""))
    return "\n".join(lines).rstrip() + "\n"


def _rows(table: list[list[str]]) -> str:
    """Rows of a Markdown table without its rule; an empty head is left out."""
    rows = [row for k, row in enumerate(table) if k != 1 and any(row[1:] if k == 0 else row)]
    width = max(map(len, rows))
    return align([row + [""] * (width - len(row)) for row in rows])


def _plain(text: str) -> str:
    """Text of a cell without the marks of Markdown."""
    return text.replace("`", "").replace("\\|", "|").strip(" ")
