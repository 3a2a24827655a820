"""What a shell completes: the scenes, models, names and levels of the file on the command line; topics and codes."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import click
from click.shell_completion import CompletionItem

Offer = Iterator[tuple[str, str]]  # a text with its line of help


def complete(context: click.Context, parameter: click.Parameter, begun: str) -> list[CompletionItem]:
    """What may stand for a parameter, each with a line of help; whatever fails offers nothing."""
    offer, reads = OFFERS[parameter.name or ""]
    try:
        document = _document(context) if reads else None
        return [CompletionItem(text, help=said) for text, said in offer(document) if text.startswith(begun)]
    except Exception:  # a text that cannot be read, or none yet: a shell shows no errors
        return []


def _document(context: click.Context) -> Any:
    """The parsed file of the command line."""
    from sysdyn.dsl import load
    from sysdyn.dsl.text.diagnostics import Report

    params = context.params  # behind an option that is not finished yet the file is still among the other words
    words = [params.get("file"), *(params.get("files") or ()), *context.args]
    given = next(word for word in words if word and Path(word).is_file())
    return load.read(Path(given), Report())


def _scenes(document: Any) -> Offer:
    for name, scene in document.scenes.items():
        yield name, _first(scene.doc)


def _models(document: Any) -> Offer:
    for name, model in document.models.items():
        yield name, _first(model.doc)


def _first(doc: str | None) -> str:
    return (doc or "").strip().partition("\n")[0]


def _listings(document: Any) -> Iterator[Any]:
    from sysdyn.dsl import load
    from sysdyn.dsl.model import expression as ex
    from sysdyn.dsl.text.diagnostics import Report

    for model in document.models.values():
        with ex.fresh():
            found = load.listing(document, model, None, Report())
            if found is not None:
                yield found


def _settings(document: Any) -> Offer:
    for listing in _listings(document):
        for name, parameter in listing.parameters.items():
            yield f"{name}=", f"in {parameter.unit.text}"
        for name in listing.inputs:
            if name not in listing.parameters:
                yield f"{name}=", "input"


def _levels(document: Any) -> Offer:
    for listing in _listings(document):
        for instance in listing.instances:
            for level in instance.levels:
                yield f"{instance.path}={level}", "as it is" if level == instance.level else instance.component


def _topics(_: Any) -> Offer:
    from sysdyn.cli.manual import topics

    for topic in topics.topics().values():
        yield topic.name, topic.title


def _library(_: Any) -> Offer:
    from sysdyn.cli.manual import library

    for entry in library.entries():
        yield entry.name, entry.line


def _codes(_: Any) -> Offer:
    from sysdyn.dsl.text import codes

    for code, page in codes.codes().items():
        yield code, page.title


OFFERS: dict[str, tuple[Callable[[Any], Offer], bool]] = {
    "scene": (_scenes, True),
    "model": (_models, True),
    "settings": (_settings, True),
    "levels": (_levels, True),
    "topic": (_topics, False),
    "name": (_library, False),
    "code": (_codes, False),
}
"""By the parameter of a command that is completed; whether the file is read."""
