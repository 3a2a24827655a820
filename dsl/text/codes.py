"""Every code that a diagnostic can have, with its page: `sysdyn explain CODE`.

The pages are data (`codes.toml`): a title, the reason, a bad and a good file, and the command that
finds it where that is not `check`. A test proves that each bad file raises its code and no other
error, and that the good one is free of it. A code that is twice in the file is an error of TOML, so codes are unique.
"""

from __future__ import annotations

import tomllib
from collections.abc import Mapping
from functools import cache
from pathlib import Path
from types import MappingProxyType

from sysdyn.values import dataclass

_SEVERITIES = {"E": "error", "W": "warning", "N": "note"}
CHECK = "sysdyn check FILE"
CLASSES = {
    "1": "names and text",
    "2": "units and dimensions",
    "3": "laws and state functions: Paynter's diagram",
    "4": "elements and networks",
    "5": "coordinates and constraints",
    "6": "formulations and what the compiler makes of laws",
    "7": "events",
    "8": "components, levels and arrays",
    "9": "scenes and runs",
}
"""What the first digit of a code says."""
_MOST_LINES, _MOST_COLUMNS = 40, 100


@dataclass(frozen=True, slots=True)
class Code:
    """A code's page; `bad` and `good` are whole files; by: the command that finds it in the bad one."""

    code: str
    title: str
    why: str
    bad: str
    good: str
    by: str = CHECK

    @property
    def severity(self) -> str:
        """`error`, `warning` or `note`."""
        return _SEVERITIES[self.code[0]]


@cache
def codes() -> Mapping[str, Code]:
    """All codes, in the order of their numbers."""
    text = (Path(__file__).parent / "codes.toml").read_text(encoding="utf-8")
    generated = _long_examples()
    found = {}
    for code, page in tomllib.loads(text).items():
        bad, good = generated[code] if code in generated else (page["bad"], page["good"])
        found[code] = Code(code, page["title"], page["why"], bad, good, page.get("by", CHECK))
    return MappingProxyType(found)


def explain(code: str) -> str:
    """The page of a code as text; raises KeyError where there is no such code."""
    page = codes()[code.upper()]
    parts = [f"{page.severity} {page.code}: {page.title}", _wrap(page.why)]
    wrong = "Wrong:" if page.by == CHECK else f"Wrong, as '{page.by}' finds:"
    parts += [wrong, _format_example(page.bad), "Right:", _format_example(page.good)]
    return "\n\n".join(parts) + "\n"


def index() -> str:
    """One line a code, by class."""
    parts = []
    for digit, said in CLASSES.items():
        pages = sorted((c for c in codes().values() if c.code[1] == digit), key=lambda c: (c.code[1:], c.code[0]))
        parts.append("\n".join([f"{digit}xx: {said}", *(f"  {c.code}  {c.title}" for c in pages)]))
    return "\n\n".join(parts) + "\n\nE error, W warning, N note; sysdyn explain CODE shows one.\n"


def _long_examples() -> dict[str, tuple[str, str]]:
    """Examples too long to be kept."""
    return {
        "E116": (f"# {'a long line ' * 1000}\n", "# a short line\n"),
        "E117": (f"const a = {'(' * 201}1{')' * 201}\n", "const a = ((1))\n"),
        "N101": (
            "model m {\n" + "".join(f"  let y{k} = x{k}\n" for k in range(201)) + "}\n",
            "model m {\n  let y = 1\n}\n",
        ),
        "E118": ("const a = 0" + " +\n  1" * 50_000 + "\n", "const a = sum(i in 1..50000: 1)\n"),
    }


def _wrap(text: str, width: int = 96) -> str:
    """Words in lines."""
    import textwrap

    return textwrap.fill(text, width)


def _format_example(text: str) -> str:
    """An example, indented; very long ones are cut."""
    lines = text.splitlines()
    shown = [line if len(line) <= _MOST_COLUMNS else line[:_MOST_COLUMNS] + "..." for line in lines[:_MOST_LINES]]
    if len(lines) > _MOST_LINES:
        shown.append(f"... ({len(lines) - _MOST_LINES} more lines)")
    return "\n".join(f"    {line}".rstrip() for line in shown)
