"""What a word of a text stands for: the names in sight of a place, and those behind a dot."""

from __future__ import annotations

import re
from collections.abc import Iterator
from functools import cache, lru_cache
from pathlib import Path

from sysdyn.cli.lsp import outline
from sysdyn.cli.lsp.documents import Document
from sysdyn.cli.lsp.outline import Declared
from sysdyn.dsl.elaborate.authors import without_indices
from sysdyn.dsl.elaborate.files import LIBRARY, prelude
from sysdyn.dsl.names.laws import ONE_PORTS, TWO_PORTS
from sysdyn.dsl.parser.parse import parse
from sysdyn.dsl.text.diagnostics import ModelError
from sysdyn.dsl.text.source import SourceText
from sysdyn.dsl.tree import syntax
from sysdyn.values import dataclass

_WORD = re.compile(r"[^\W\d]\w*")
_BEFORE = re.compile(r"(?:[^\W\d]\w*(?:\[[^\[\]\n]*\])?\.)+$")
OWN = ("e", "f", "q", "p")
"""Variables of power, of which an element's law is made."""
_DEEPEST = 20
"""Names behind dots that are followed."""


@dataclass(frozen=True, slots=True)
class WordAtCursor:
    """A name in a text with the names and dots before it."""

    path: tuple[str, ...]
    name: str
    start: int
    end: int


def quiet(document: Document, offset: int) -> bool:
    """Whether a place is inside a comment."""
    return any(c.span.start < offset <= c.span.end for c in document.tree.comments)


def word_at(document: Document, offset: int) -> WordAtCursor | None:
    """The word that a place touches; None in comments."""
    source = document.source
    if quiet(document, offset):
        return None
    line, _ = source.position(offset)
    start = source.line_starts[line - 1]
    for match in _WORD.finditer(source.line(line)):
        if start + match.start() <= offset <= start + match.end():
            begin = start + match.start()
            return WordAtCursor(path_before(source, begin), match[0], begin, start + match.end())
    return None


def path_before(source: SourceText, offset: int) -> tuple[str, ...]:
    """The names before a place that ends with a dot, indices left out: `a[1].b.` is a, b."""
    line, _ = source.position(offset)
    match = _BEFORE.search(source.text[source.line_starts[line - 1] : offset])
    if match is None:
        return ()
    return tuple(without_indices(match[0]).split(".")[:-1])


def item_at(document: Document, offset: int) -> syntax.TopLevel | None:
    """The item of the file that a place is in."""
    return next((i for i in document.tree.items if i.span.start <= offset <= i.span.end), None)


def local(document: Document, offset: int) -> Iterator[Declared]:
    """The names that the model, component or scene around a place has in sight."""
    item = item_at(document, offset)
    # in the body of a scene: the names of its model
    if isinstance(item, syntax.SceneDefinition) and offset > item.model.span.end:
        name = item.model.names[-1]
        item = next(
            (i for i in document.tree.items if isinstance(i, syntax.ModelDefinition) and i.name.name == name), None
        )
    if isinstance(item, (syntax.ModelDefinition, syntax.ComponentDefinition)) and not _of_head(item, offset):
        yield from _declarations(document.source, item)
    # in the body of a function or table: its arguments
    elif isinstance(item, (syntax.FunctionDefinition, syntax.TableDefinition)) and not _of_head(item, offset):
        for p in item.params:
            place = document.source.place(p.span.start, p.span.start + len(p.name))
            yield Declared(p.name, "argument", place, p.span, "", p.unit.text)


def _of_head(
    item: syntax.ModelDefinition | syntax.ComponentDefinition | syntax.FunctionDefinition | syntax.TableDefinition,
    offset: int,
) -> bool:
    """Whether a place is at the item's own name."""
    return item.span.start <= offset <= item.name.span.end


def of_file(tree: syntax.File) -> Iterator[Declared]:
    """The names of a file, those that it imports, and those that every file has."""
    yield from _items(tree)
    for item in tree.items:
        if isinstance(item, syntax.Import):
            module = module_of(tree.source, item.module.names)
            wanted = {word.name for word in item.names}
            yield from (d for d in _items(module) if d.name in wanted) if module else ()
    yield from _items(prelude())


def module_of(source: SourceText, names: tuple[str, ...]) -> syntax.File | None:
    """The tree of a module that a text imports; None where there is none to read."""
    inside = names[0] == "std"
    if inside:
        path = LIBRARY.joinpath(*names[1:]).with_suffix(".sd") if len(names) > 1 else LIBRARY
        return _of_library(path) if path.is_file() else None
    path = Path(source.name).parent.joinpath(*names).with_suffix(".sd")
    try:
        return _parse(SourceText.read(path))
    except (OSError, ModelError, ValueError):
        return None


@cache
def _of_library(path: Path) -> syntax.File:
    return parse(SourceText.read(path, f"std/{path.name}"))[0]


@lru_cache(32)
def _parse(source: SourceText) -> syntax.File:
    return parse(source)[0]


@lru_cache(64)
def _items(tree: syntax.File) -> tuple[Declared, ...]:
    return (*outline.items(tree),)


@lru_cache(64)
def _declarations(
    source: SourceText, item: syntax.ModelDefinition | syntax.ComponentDefinition
) -> tuple[Declared, ...]:
    return (*outline.body(source, item.body),)


def find(document: Document, word: WordAtCursor) -> list[Declared]:
    """The declarations that a word may mean, the nearest first; of one name all in one scope (levels, statements)."""
    if document.marks.unit(word.start):
        return []
    around = instance_at(document, word.start)
    # inside of an element's statement
    if around is not None and not word.path:
        of = ".".join(around.component.names)
        if of in ONE_PORTS and word.name in OWN and any(_is_inside(word, arg) for arg in around.args or ()):
            return []  # the element's own variable
        # names of arguments of the language
        if of in TWO_PORTS and any(arg.span.start == word.start for arg in around.args or ()):
            return []
        # names of arguments are the component's
        if any(word.start == start for start in inner_names(around)):
            inside = members(document, (around.decl.name,), word.start)
            return [d for d in inside if d.name == word.name]
    # a.b: among the members of a
    if word.path:
        return [d for d in members(document, word.path, word.start) if d.name == word.name]
    marks = document.marks
    # the name of a level
    if word.start in marks.levels:
        target = marks.levels[word.start]
        among = local(document, word.start) if target is None else _inside(document, target)
        return [d for d in among if d.name == word.name and d.kind == "level"]
    # local names before those of the file
    near = [d for d in local(document, word.start) if d.name == word.name and d.kind != "level"]
    if word.start in marks.domains or (around is not None and around.component.span.start == word.start):
        near = []  # labels and values do not hide it
    return near or [d for d in of_file(document.tree) if d.name == word.name][:1]


def _inside(document: Document, target: syntax.Expr) -> list[Declared]:
    """What is declared in the component that an expression leads to."""
    text = document.source.text[target.span.start : target.span.end]
    path = "".join(without_indices(text).split()).split(".")
    return members(document, tuple(path), target.span.start)


def _is_inside(word: WordAtCursor, arg: syntax.Arg) -> bool:
    return arg.span.start <= word.start < arg.span.end


def inner_names(instance: syntax.InstanceStatement) -> Iterator[int]:
    """Where an instance's arguments and connections name what is inside its component."""
    yield from (arg.span.start for arg in instance.args or () if arg.name is not None)
    for c in instance.connections:
        if isinstance(c, (syntax.Bind, syntax.BindAcross)):
            yield c.name.span.start


def instance_at(document: Document, offset: int) -> syntax.InstanceStatement | None:
    """The element or component statement around a place."""
    item = item_at(document, offset)
    stack = list(item.body) if isinstance(item, (syntax.ModelDefinition, syntax.ComponentDefinition)) else []
    while stack:
        s = stack.pop()
        if s.span.start <= offset <= s.span.end:
            if isinstance(s, syntax.InstanceStatement):
                return s
            stack += s.body if isinstance(s, (syntax.ForStatement, syntax.LevelStatement)) else ()
    return None


def members(document: Document, path: tuple[str, ...], offset: int) -> list[Declared]:
    """What is declared inside the component that a path of names leads to; nothing behind elements of the language."""
    # std.thermal.
    if path[0] == "std":
        module = module_of(document.source, path)
        return [] if module is None else [*outline.items(module)]
    tree, among = document.tree, [*local(document, offset), *of_file(document.tree)]
    # house.wall.: an instance, its component's body, and so on
    for name in path[:_DEEPEST]:
        owner = next((d for d in among if d.name == name), None)
        if owner is None:
            return []
        component = owner if owner.kind in ("component", "model") else component_of(tree, owner)
        if component is None:
            return []
        tree = tree_of(tree, component)
        among = [*outline.body(component.place.source, component.body)]
    return among


def component_of(tree: syntax.File, owner: Declared) -> Declared | None:
    """The component that an instance is of; tree: of the file that the instance stands in."""
    name = owner.of.partition(".")[0]
    if owner.kind != "instance":
        return None
    return next((d for d in of_file(tree) if d.kind == "component" and d.name == name), None)


def tree_of(tree: syntax.File, component: Declared) -> syntax.File:
    """The tree of the file that a component stands in."""
    source = component.place.source
    if source is tree.source:
        return tree
    for item in tree.items:
        if isinstance(item, syntax.Import):
            module = module_of(tree.source, item.module.names)
            if module is not None and module.source.name == source.name:
                return module
    return tree


def owner_of(document: Document, path: tuple[str, ...], offset: int) -> Declared | None:
    """What the last name of a path is."""
    if len(path) == 1:
        return next((d for d in [*local(document, offset), *of_file(document.tree)] if d.name == path[0]), None)
    return next((d for d in members(document, path[:-1], offset) if d.name == path[-1]), None)


def letters(document: Document, owner: Declared) -> tuple[str, ...]:
    """The members that the language itself gives to what has power: e, f, q, p, ..."""
    # e1, f1, q1, p1, e2, ...
    if owner.of in TWO_PORTS:
        return tuple(f"{letter}{k}" for k in (1, 2) for letter in "efqp")
    if owner.kind in ("element", "branch") or owner.of in ONE_PORTS:
        return (*OWN, "power", "energy")
    # a component of one branch stands for it: spring.e
    if owner.kind == "instance" and (component := component_of(document.tree, owner)) is not None:
        single = any(isinstance(s, syntax.BranchStatement) and not s.decls for s in component.body)
        return (*OWN, "power", "energy") if single else ()
    return {
        "node": OWN,
        "port": ("e", "f"),
        "coordinate": ("e", "p"),
        "constraint": ("multiplier", "residual"),
    }.get(owner.kind, ())
