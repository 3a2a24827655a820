"""The words of this house, looked at by machine: names, docstrings and comments of the rooms' Python.

Each rule is here because a reader who had not written the code stumbled:

    names        A function is called by its name far from its text.  `told(x)`, `held(x)`, `of(x)` say neither what is
                 done nor what is returned; `report_fault(x)`, `stored_momenta(x)` do.  A participle or a preposition
                 alone is no name of a function (a property is read as an attribute and may be one: `run.failed`).
    modules      `asked.py` stood five times.  A module is named by the noun it holds, and once in its room.
    classes      `Run` was four things in four files.  A class has a name of its own in the whole house.
    openings     "The same for ..." sends the reader to another docstring.  Each says what is returned or done.
    docstrings   A private function of ten lines and more says what holds when it returns.
    comments     Where cases are told apart a line says which case it is, with an example.  Counted as lines that are
                 comments, of a hundred lines that are text.

`LIMITS` holds what each room has reached; who makes it better lowers the limit, nobody raises it.

    python tests/data/words.py      prints what is found, room by room
"""

from __future__ import annotations

import ast
import re
from collections import defaultdict
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
ROOMS = ("dsl", "compiler", "runtime", "cli")

LONG = 10
"""Lines of a private function from which on it has a docstring."""

BARE = re.compile(
    r"_*(?:told|held|shown|kept|stated|settled|blurred|astray|beside|behind|apart|asked|said|given|taken|made|begun|left"
    r"|lost|found|met|unmet|of|at|by|in|on|from|with|within|without|anew|alone|again"
    r"|[a-z]+ed|[a-z]+(?:own|orn|ound|ept|elt|ought|aught))"
)
"""Participles and prepositions that are a whole name."""
VERBS = frozenset(
    (
        "accept",
        "bound",
        "compound",
        "embed",
        "exceed",
        "except",
        "feed",
        "found",
        "ground",
        "intercept",
        "need",
        "proceed",
    )
    + ("round", "seed", "shed", "sound", "speed", "succeed")
)
"""Verbs and nouns that end as participles do."""
OF_THE_GRAMMAR = frozenset({"dotted", "fixed", "on"})
"""Builders of trees: each has the name of its rule in dsl/parser/sd.lark."""
EMPTY_MODULES = frozenset({"common", "helpers", "manager", "misc", "utils"})
"""Names of modules that would hold anything."""


@dataclass(frozen=True)
class Limit:
    """What a room may have at most: functions and modules by bare words, modules of one name, "The same", private
    functions without docstring; comments: a hundred lines, at least.
    """

    functions: int
    modules: int
    twins: int
    openings: int
    undocumented: int
    comments: float


LIMITS = {
    "dsl": Limit(0, 0, 0, 0, 0, 3.5),
    "compiler": Limit(0, 0, 0, 0, 0, 3.0),
    "cli": Limit(0, 1, 0, 0, 0, 3.0),  # sysdyn.api.compiled is public
    "runtime": Limit(81, 13, 8, 0, 0, 8.0),
}
SHARED_CLASSES = 8
"""Names of classes that stand in several files, most of them mirrors of structures of the core."""
MIRRORS = "runtime/"
"""Where one of these files is at least: two of other rooms share no name."""


@dataclass
class Found:
    """What one room has, as places `file:line name`; comments and lines are counts."""

    functions: list[str] = field(default_factory=list)
    modules: list[str] = field(default_factory=list)
    twins: list[str] = field(default_factory=list)
    openings: list[str] = field(default_factory=list)
    undocumented: list[str] = field(default_factory=list)
    comments: int = 0
    lines: int = 0

    @property
    def share(self) -> float:
        """Comments a hundred lines."""
        return 100.0 * self.comments / max(1, self.lines)


def is_bare(name: str) -> bool:
    """Whether a name is a participle or a preposition and nothing else."""
    return BARE.fullmatch(name) is not None and name.strip("_") not in VERBS


def look_at_text(found: Found, text: str, place: str) -> None:
    """Enter what the rules on functions and comments say of one file."""
    for line in filter(None, map(str.strip, text.splitlines())):
        found.comments += line.startswith("#")
        found.lines += not line.startswith("#")
    for node in ast.walk(ast.parse(text)):
        if not isinstance(node, (ast.FunctionDef, ast.AsyncFunctionDef)) or node.name.startswith("__"):
            continue
        where, doc = f"{place}:{node.lineno} {node.name}", ast.get_docstring(node)
        is_property = any(isinstance(d, ast.Name) and "property" in d.id for d in node.decorator_list)
        if is_bare(node.name) and not is_property and node.name not in OF_THE_GRAMMAR:
            found.functions.append(where)
        if doc is not None and doc.startswith("The same"):
            found.openings.append(where)
        if doc is None and node.name.startswith("_") and (node.end_lineno or 0) - node.lineno >= LONG:
            found.undocumented.append(where)


def look_at_room(root: Path, room: str) -> Found:
    """What all rules but that on classes find in one room."""
    found, stems = Found(), defaultdict(list)
    for path in sorted((root / room).rglob("*.py")):
        place = path.relative_to(root).as_posix()
        look_at_text(found, path.read_text(encoding="utf-8"), place)
        if not path.stem.startswith("__"):
            stems[path.stem].append(place)
            if is_bare(path.stem) or path.stem in EMPTY_MODULES:
                found.modules.append(place)
    found.twins += [" ".join(places) for places in stems.values() if len(places) > 1]
    return found


def shared_classes(root: Path) -> Iterator[tuple[str, tuple[str, ...]]]:
    """Names of classes that stand in several files, with these files."""
    places: dict[str, set[str]] = defaultdict(set)
    for room in ROOMS:
        for path in (root / room).rglob("*.py"):
            for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
                if isinstance(node, ast.ClassDef):
                    places[node.name].add(path.relative_to(root).as_posix())
    yield from ((name, tuple(sorted(files))) for name, files in sorted(places.items()) if len(files) > 1)


def main() -> None:
    """Print what each rule finds."""
    for room in ROOMS:
        found = look_at_room(ROOT, room)
        print(f"{room}: {found.share:.2f} comments a hundred lines")
        for rule in ("functions", "modules", "twins", "openings", "undocumented"):
            places = getattr(found, rule)
            print(f"  {rule}: {len(places)}", *places, sep="\n    ")
    classes = [f"{name}: {' '.join(files)}" for name, files in shared_classes(ROOT)]
    print(f"classes: {len(classes)}", *classes, sep="\n    ")


if __name__ == "__main__":
    main()
