"""The documents that an editor holds: their text, changed as it is typed, and their tree."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from functools import cached_property
from pathlib import Path
from typing import Any

from sysdyn.cli.lsp import positions
from sysdyn.cli.lsp.marks import Marks, marks
from sysdyn.dsl.parser.parse import parse
from sysdyn.dsl.text.diagnostics import Diagnostic
from sysdyn.dsl.text.source import UNSAVED, SourceText, real
from sysdyn.dsl.tree import syntax

LONGEST = 300_000
"""Characters of a text that the server itself reads (a second); of longer ones the check tells, in its process."""
_IMPORT = re.compile(r"^\s*from\s+([\w.]+)\s+import\b", re.MULTILINE)


class Document:
    """One text of an editor; version: as the editor counts."""

    def __init__(self, uri: str, text: str, version: int | None) -> None:
        self.uri = uri
        self.name = positions.name_of(uri)
        self.key = str(real(self.name))
        """Of its file, whatever links lead there."""
        self.version = version
        self.source = SourceText(self.name, text)
        self.accounts: dict[str, dict[str, Any]] = {}
        """What `sysdyn list` tells of each model that has no errors, once the check has found it."""

    def apply_changes(self, changes: Sequence[dict[str, Any]], version: int | None) -> Document:
        """The document with changes made, each of the text that the one before it left."""
        source = self.source
        for change in changes:
            text = str(change["text"])
            if (where := change.get("range")) is not None:
                start, end = (positions.offset(source, where[side]) for side in ("start", "end"))
                text = source.text[:start] + text + source.text[max(start, end) :]
            source = SourceText(self.name, text)
        return Document(self.uri, source.text, version)

    @cached_property
    def tree_and_problems(self) -> tuple[syntax.File, tuple[Diagnostic, ...]]:
        """The tree, and what is wrong with its syntax; of a text that is too long an empty one."""
        return parse(SourceText(self.name, "") if self.long else self.source)

    @property
    def long(self) -> bool:
        """Whether the server leaves the text to the check."""
        return len(self.source.text) > LONGEST

    @property
    def tree(self) -> syntax.File:
        """The tree of what could be read."""
        return self.tree_and_problems[0]

    @cached_property
    def marks(self) -> Marks:
        """Where names and units are."""
        return marks(self.tree)

    def imports(self) -> Iterator[str]:
        """The real paths of the files of the author's that it imports."""
        for found in _IMPORT.finditer(self.source.text):
            names = [name for name in found[1].split(".") if name]
            if names and names[0] != "std":
                yield str(real(Path(self.name).parent.joinpath(*names).with_suffix(".sd")))


class Documents:
    """The open documents by URI; their texts stand for the files wherever those are read."""

    def __init__(self) -> None:
        self._open: dict[str, Document] = {}

    def get(self, uri: str) -> Document | None:
        """The document, if it is open."""
        return self._open.get(uri)

    def put(self, document: Document) -> None:
        """Open a document, or hold its newer text."""
        self._open[document.uri] = document
        UNSAVED[document.key] = document.source.text

    def close(self, uri: str) -> None:
        """The file stands for itself again."""
        document = self._open.pop(uri, None)
        if document is not None:
            UNSAVED.pop(document.key, None)

    def find_by_name(self, name: str) -> Document | None:
        """The open document of that name."""
        return next((d for d in self._open.values() if d.name == name), None)

    def all(self) -> list[Document]:
        """Every open document."""
        return [*self._open.values()]

    def uri_of(self, name: str) -> str:
        """The URI of a text, as the editor wrote it where it holds the text."""
        document = self.find_by_name(name)
        return positions.uri_of(name) if document is None else document.uri

    def dependent(self, document: Document) -> list[Document]:
        """The open documents that read a text: itself, those that import it, and those that import these."""
        found, reached = [document], {document.key}
        while more := [d for d in self._open.values() if d not in found and not reached.isdisjoint(d.imports())]:
            found += more
            reached |= {d.key for d in more}
        return [d for d in found if self._open.get(d.uri) is d]
