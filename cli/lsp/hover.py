"""What is said of the word under the cursor, where it is declared, and where it is read."""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import Any

from sysdyn.cli.lsp import positions, sight
from sysdyn.cli.lsp.documents import Document
from sysdyn.cli.lsp.outline import Declared
from sysdyn.dsl.elaborate.authors import without_indices
from sysdyn.dsl.model import units
from sysdyn.dsl.model.functions import FUNCTIONS
from sysdyn.dsl.names.laws import ONE_PORTS, TWO_PORTS
from sysdyn.dsl.parser.automaton import words
from sysdyn.dsl.parser.notes import PREDEFINED
from sysdyn.dsl.text import codes
from sysdyn.dsl.text.diagnostics import Diagnostic
from sysdyn.dsl.text.source import Place, Span
from sysdyn.dsl.tree import syntax

LETTERS = {
    "e": "effort",
    "f": "flow",
    "q": "displacement, the time integral of the flow",
    "p": "momentum, the time integral of the effort",
    "power": "power into it",
    "energy": "energy stored in it",
    "multiplier": "multiplier of the constraint: its reaction",
    "residual": "residual of the constraint",
}


def hover(document: Document, offset: int, found: Sequence[Diagnostic]) -> dict[str, Any] | None:
    """What a word is: its statement, value, unit and comment; then the codes of the findings there."""
    word = sight.word_at(document, offset)
    parts = [] if word is None else _descriptions(document, word)
    here = [d for d in found if _covers(document, d, offset)]
    parts += [_code(code) for code in dict.fromkeys(d.code for d in here)]
    if not parts:
        return None
    answer: dict[str, Any] = {"contents": {"kind": "markdown", "value": "\n\n---\n\n".join(parts)}}
    if word is not None:
        answer["range"] = positions.range_of(document.source, Span(word.start, word.end))
    return answer


def _covers(document: Document, d: Diagnostic, offset: int) -> bool:
    if d.place is None or d.place.source.text != document.source.text or d.place.file != document.name:
        return False
    return d.place.span.start <= offset <= d.place.span.end


def _code(code: str) -> str:
    page = codes.codes()[code]
    return f"**{code}**: {page.title}\n\n{page.why}\n\n`sysdyn explain {code}`"


def _descriptions(document: Document, word: sight.WordAtCursor) -> list[str]:
    """What is known of a word, one text for each of its declarations."""
    # a unit
    if document.marks.unit(word.start):
        found = units.find_unit(word.name)
        return [] if found is None else [f"`{word.name}`: {float(found[1]):.12g} {units.si_text(found[0])}"]
    declared = sight.find(document, word)
    # a name of the text: its declaration
    if declared:
        return [_describe(document, word, d) for d in declared[:4]]
    # R1.e: the variable of an element
    if word.path:
        owner = sight.owner_of(document, word.path, word.start)
        letter = word.name.rstrip("12")
        if owner is not None and word.name in sight.letters(document, owner) and letter in LETTERS:
            unit = _unit(document, word)
            return [f"`{'.'.join((*word.path, word.name))}`: {LETTERS[letter]}{unit}"]
        return []
    # e, f, q, p in a law
    if word.name.rstrip("12") in sight.OWN and sight.instance_at(document, word.start) is not None:
        return [f"`{word.name}`: {LETTERS[word.name.rstrip('12')]} of the element"]
    # words of the language
    if word.name in (*ONE_PORTS, *TWO_PORTS):
        return [f"`{word.name}`: an element of the language (`sysdyn help elements`)"]
    if word.name in FUNCTIONS:
        return [f"`{word.name}`: a function of the language (`sysdyn help expressions`)"]
    return []


def _describe(document: Document, word: sight.WordAtCursor, d: Declared) -> str:
    parts = [f"```sd\n{d.text}\n```", f"{d.kind}{_unit(document, word)}{_value(document, word)}"]
    if d.kind == "component":
        parts += _component(d)
    elif d.kind == "instance" and (component := sight.component_of(document.tree, d)) is not None:
        first = component.doc.partition("\n")[0]
        parts += [f"`{component.name}`" + (f": {first}" if first else ""), *_component(component)]
    return "\n\n".join([*parts, *([d.doc] if d.doc else [])])


def _component(d: Declared) -> list[str]:
    """Ports, parameters and inputs of a component, as `sysdyn std` lists them."""
    from sysdyn.cli.manual import library

    span = d.place.span
    item = syntax.ComponentDefinition(syntax.Word(d.name, span), d.body, d.span)
    lines = [f"- {p['kind']} `{p['name']}` {p['domain']}".replace(" ``", "").rstrip() for p in library.ports(item)]
    for p in library.parameters(item):
        default = f" = {p['default']}" if p["default"] else ""
        of = f": {p['unit']}" if p["unit"] else ""
        lines.append(f"- {p['kind']} `{p['name']}{of}{default}` {p['doc']}".rstrip())
    return ["\n".join(lines)] if lines else []


def _model(document: Document, offset: int) -> dict[str, Any] | None:
    """What `sysdyn list` knows of the model around a place."""
    item = sight.item_at(document, offset)
    name = (
        item.model.names[-1]
        if isinstance(item, syntax.SceneDefinition)
        else getattr(getattr(item, "name", None), "name", "")
    )
    return document.accounts.get(name)


def _unit(document: Document, word: sight.WordAtCursor) -> str:
    """The unit of what can be read, where the model has no errors."""
    account = _model(document, word.start)
    path = ".".join((*word.path, word.name))
    if account is not None:
        for entry in account["readable"]:
            if without_indices(entry["name"]) == path:
                return f" in {entry['unit']}"
    return ""


def _value(document: Document, word: sight.WordAtCursor) -> str:
    """The value of a parameter in its own unit."""
    account = _model(document, word.start)
    path = ".".join((*word.path, word.name))
    if account is not None:
        for entry in (*account["parameters"], *account["inputs"]):
            if entry["name"].partition("[")[0] == path and entry["value"] is not None:
                unit = "" if entry["unit"] == "1" else f" {entry['unit']}"
                return f" = {entry['value']}{unit}"
    return ""


def definition(document: Document, offset: int) -> list[dict[str, Any]]:
    """Where the word under the cursor is declared; of an imported module its file."""
    word = sight.word_at(document, offset)
    if word is None:
        return []
    item = sight.item_at(document, offset)
    # on the name of a module: the file
    if isinstance(item, syntax.Import) and item.module.span.start <= offset <= item.module.span.end:
        module = sight.module_of(document.source, item.module.names)
        return [] if module is None else [positions.location(Place(module.source, Span(0, 0)))]
    found = sight.find(document, word)
    if not found and word.path:  # a member of the language's own: what has it
        owner = sight.owner_of(document, word.path, word.start)
        found = [] if owner is None else [owner]
    return [positions.location(d.place) for d in found]


def references(document: Document, offset: int, with_declaration: bool) -> list[dict[str, Any]]:
    """The places of this text where the word under the cursor means the same."""
    word = sight.word_at(document, offset)
    wanted = [] if word is None else [d.place for d in sight.find(document, word)]
    if word is None or not wanted:
        return []
    found = []
    # wherever the word stands as a name, and means the same declaration
    for match in re.finditer(rf"(?<!\w){re.escape(word.name)}(?!\w)", document.source.text):
        other = sight.word_at(document, match.start()) if match.start() in document.marks.names else None
        if other is None:
            continue
        place = document.source.place(match.start(), match.end())
        if not with_declaration and place in wanted:
            continue
        if place in wanted or any(d.place in wanted for d in sight.find(document, other)):
            found.append(positions.location(place))
    return found


def rename_edits(document: Document, offset: int, name: str) -> dict[str, Any]:
    """The change that gives the word under the cursor another name in this text; ValueError where that cannot be."""
    word = sight.word_at(document, offset)
    declared = [] if word is None else sight.find(document, word)
    # nothing of this text under the cursor
    if word is None or not declared:
        raise ValueError("there is no name of the text to be changed here")
    # names in unreadable lines would stay
    if any(d.severity == "error" for d in document.tree_and_problems[1]):
        raise ValueError("the text has errors of syntax: names in what cannot be read would be left")
    # declared in another file
    if any(d.place.source is not document.source for d in declared):
        raise ValueError(f"'{word.name}' is declared in {declared[0].place.file}")
    # no name at all, or one of the language
    if not name.isidentifier() or name in words():
        raise ValueError(f"'{name[:60]}' cannot be a name")
    if name in PREDEFINED:
        raise ValueError(f"'{name}' cannot be a name: the language has it already")
    # a name that is there already
    other = sight.WordAtCursor(word.path, name, declared[0].place.span.start, declared[0].place.span.start)
    if sight.find(document, other):
        raise ValueError(f"'{name}' is declared already")
    found = references(document, offset, True)
    return {"changes": {document.uri: [{"range": r["range"], "newText": name} for r in found]}}
