"""What may be written at a place: words of the language by its grammar, names in sight, the library, units, members."""

from __future__ import annotations

import re
from collections.abc import Iterator
from typing import Any

from sysdyn.cli.lsp import outline, sight
from sysdyn.cli.lsp.documents import Document
from sysdyn.cli.lsp.hover import LETTERS
from sysdyn.cli.lsp.outline import Declared
from sysdyn.dsl.model import units
from sysdyn.dsl.model.functions import FUNCTIONS
from sysdyn.dsl.names.laws import ONE_PORTS, TWO_PORTS
from sysdyn.dsl.names.names import VALUES
from sysdyn.dsl.parser.parse import expected_words
from sysdyn.dsl.text.source import SourceText, Span
from sysdyn.dsl.tree import syntax

FUNCTION, FIELD, VARIABLE, CLASS, MODULE, PROPERTY, UNIT, KEYWORD, CONSTANT = 3, 5, 6, 7, 9, 10, 11, 14, 21
_BEGUN = re.compile(r"[^\W\d]\w*$")
_FROM = re.compile(r"\s*from\s+((?:\w+\.)*)(?:\w*)$")
_IMPORT = re.compile(r"\s*from\s+([\w.]+)\s+import\s+[\w\s,]*$")
_DECLARED = re.compile(
    r"\s*(param|input|quasi|implicit|state|discrete|node|port|branch|coord|cocoord)\b[^:=]*:\s*[\w./^]*$"
)
_LABEL = re.compile(r"\s*(\w+)(?:\[[^\]]*\])?\s*:\s*\w*$")
_NUMBER = re.compile(r"(?<![\w.])\d[\d.]*(?:[eE][+-]?\d+)?[ \t]+(?:[\w./^]*[./])?\w*$")
_ARGUMENT = re.compile(r"\s*\w+(?:\[[^\]]*\])?\s*:\s*(\w+)(?:\.\w+)?\((?:[^()]|\([^()]*\))*$")
_READ = ("const", "function", "table", "component")
_FIRST = frozenset({"param", "trace", "model"})
"""Words of which one fits wherever a statement or an item begins."""
_DOMAINS = ("node", "port", "branch", "coord", "cocoord")


def complete(document: Document, offset: int) -> list[dict[str, Any]]:
    """What may stand at a place, the nearest first."""
    source = document.source
    # in a remark or a text
    if sight.quiet(document, offset):
        return []
    line, _ = source.position(offset)
    before = source.text[source.line_starts[line - 1] : offset]
    begun = _BEGUN.search(before)
    start = offset - (len(begun[0]) if begun else 0)
    # from M import |
    if (match := _IMPORT.match(before)) is not None:
        module = sight.module_of(source, tuple(match[1].split(".")))
        return [] if module is None else [_item_of(d) for d in outline.items(module)]
    # from |
    if (match := _FROM.match(before)) is not None:
        return _modules(match[1])
    statement = re.split(r"[;{}]", before)[-1]
    # 3 |: a unit
    if _NUMBER.search(statement):
        return _units()
    # motor.|: its members
    if (path := sight.path_before(source, start)) and (owner := sight.owner_of(document, path, offset)) is not None:
        return _members(document, path, owner, offset)
    # coord x: |, param k: |
    if (match := _DECLARED.match(statement)) is not None:
        return _domains(document) if match[1] in _DOMAINS else _units()
    inside = isinstance(sight.item_at(document, offset), (syntax.ModelDefinition, syntax.ComponentDefinition))
    words = expected_words(SourceText(source.name, source.text[:start]))
    # R1: |
    if inside and (match := _LABEL.match(statement)) is not None and match[1] not in words:
        return _components(document)
    # anywhere else: arguments of an element, words and names
    return [*_arguments(document, statement), *_expression(document, offset, words)]


def _item(label: str, kind: int, detail: str = "", doc: str = "") -> dict[str, Any]:
    found: dict[str, Any] = {"label": label, "kind": kind}
    if detail:
        found["detail"] = detail
    if doc:
        found["documentation"] = {"kind": "markdown", "value": doc}
    return found


def _item_of(d: Declared) -> dict[str, Any]:
    kinds = {"component": CLASS, "function": FUNCTION, "table": FUNCTION, "const": CONSTANT, "parameter": CONSTANT}
    return _item(d.name, kinds.get(d.kind, VARIABLE), f"{d.kind} {d.of}".strip(), d.doc)


def _modules(head: str) -> list[dict[str, Any]]:
    from sysdyn.cli.manual import library

    if head == "std.":
        return [_item(name, MODULE, "std", said) for name, said in library.modules().items()]
    return [] if head else [_item("std", MODULE, "the standard library")]


def _units() -> list[dict[str, Any]]:
    return [_item(name, UNIT, units.si_text(found[0])) for name in units.names() if (found := units.find_unit(name))]


def _domains(document: Document) -> list[dict[str, Any]]:
    named = [d for d in sight.of_file(document.tree) if d.kind in ("domain", "bundle")]
    return [_item_of(d) for d in named]


def _members(document: Document, path: tuple[str, ...], owner: Declared, offset: int) -> list[dict[str, Any]]:
    """What follows a dot: the inside of a component, and the variables of power."""
    inner = [_item_of(d) for d in sight.members(document, path, offset) if d.kind not in ("index", "energy", "content")]
    own = [_item(name, PROPERTY, LETTERS.get(name.rstrip("12"), "")) for name in sight.letters(document, owner)]
    return _once([*own, *inner])


def _components(document: Document) -> list[dict[str, Any]]:
    """What may be an element: of the language, of this file, of the library with the import that it needs."""
    from sysdyn.cli.manual import library

    found = [_item(name, KEYWORD, "element of the language") for name in (*ONE_PORTS, *TWO_PORTS)]
    found += [_item_of(d) for d in sight.of_file(document.tree) if d.kind == "component"]
    known = {item["label"] for item in found}
    for entry in library.entries():
        if entry.kind == "component" and entry.name not in known and entry.module != library.PRELUDE:
            item = _item(entry.name, CLASS, f"std.{entry.module}", entry.doc)
            found.append(item | {"additionalTextEdits": [_import(document, entry.module, entry.name)]})
    return found


def _import(document: Document, module: str, name: str) -> dict[str, Any]:
    """The change that imports a name: behind those of the same module, or in a line of its own."""
    from sysdyn.cli.lsp.findings import text_edit

    imports = [i for i in document.tree.items if isinstance(i, syntax.Import)]
    for item in imports:
        if item.module.names == ("std", module) and item.names:
            end = item.names[-1].span.end
            return text_edit(document.source, Span(end, end), f", {name}")
    ends = [document.source.position(i.span.start)[0] for i in imports]
    first = min((i.span.start for i in document.tree.items), default=0)
    line = ends[-1] + 1 if ends else 1
    at = document.source.line_starts[line - 1] if line <= len(document.source.line_starts) else first
    return text_edit(document.source, Span(at, at), f"from std.{module} import {name}\n")


def _arguments(document: Document, statement: str) -> Iterator[dict[str, Any]]:
    """The parameters and inputs of the component whose parentheses are open."""
    match = _ARGUMENT.match(statement)
    if match is None:
        return
    component = next((d for d in sight.of_file(document.tree) if d.name == match[1] and d.kind == "component"), None)
    if component is not None:
        for d in outline.body(component.place.source, component.body):
            if d.kind in ("parameter", "input"):
                yield _item_of(d) | {"insertText": f"{d.name} = "}


def _expression(document: Document, offset: int, words: frozenset[str]) -> list[dict[str, Any]]:
    """Words of the language that fit, and where no statement begins the names in sight."""
    found = []
    if _FIRST.isdisjoint(words):
        found += [_item_of(d) for d in sight.local(document, offset)]
        found += [_item_of(d) for d in sight.of_file(document.tree) if d.kind in _READ]
        found += [_item(name, FUNCTION, "function") for name in FUNCTIONS if name.isidentifier()]
        found += [_item(name, CONSTANT, "value") for name in VALUES]
    return _once([*found, *(_item(word, KEYWORD) for word in sorted(words))])


def _once(found: list[dict[str, Any]]) -> list[dict[str, Any]]:
    return list({item["label"]: item for item in reversed(found)}.values())[::-1]
