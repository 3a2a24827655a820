"""`sysdyn help`: the language, page by page."""

from __future__ import annotations

import click
from sysdyn.cli import whole_files
from sysdyn.cli.console import Console, with_console
from sysdyn.cli.failures import UsageError
from sysdyn.cli.options import complete_for_shell


@with_console("help")
@click.argument("topic", required=False, shell_complete=complete_for_shell)
@click.option("--html", "html_file", metavar="FILE", help="Write everything, library and codes too, as one page.")
def command(console: Console, topic: str | None, html_file: str | None) -> int:
    """Explain TOPIC, a page of the language; a command or a code of a finding too. Without TOPIC: the index."""
    from sysdyn.cli.manual import topics

    # all topics as one page
    if html_file is not None:
        if topic is not None:
            raise UsageError("--html writes all topics: leave the topic out")
        from sysdyn.cli.manual.site import site

        whole_files.write(html_file, site())
        if html_file != "-":
            console.say(html_file)
        console.result = {"file": html_file}
        return console.finish()
    # the index
    if topic is None:
        console.result = {"topics": [{"name": t.name, "title": t.title} for t in topics.topics().values()]}
        console.data(f"sysdyn help TOPIC\n\n{topics.index()}\n\n{_OTHER}")
        return console.finish()
    # a topic; else a command, or the code of a finding
    page = topics.find_topic(topic.lower())
    text = topics.page(page) if page else _elsewhere(topic)
    if text is None:
        raise UsageError(_no_such_topic(topic, list(topics.topics())))
    console.result = {"topic": page.name if page else topic, "text": text}
    console.data(text)
    return console.finish()


_OTHER = """  sysdyn COMMAND --help  options of a command
  sysdyn std             the standard library
  sysdyn explain         the codes of findings
  sysdyn list FILE       the names of a model"""


def _elsewhere(topic: str) -> str | None:
    """The help of a command, or the page of a code."""
    from sysdyn.cli.main import COMMANDS, group
    from sysdyn.dsl.text import codes

    if topic.upper() in codes.codes():
        return codes.explain(topic)
    if topic not in COMMANDS:
        return None
    context = click.Context(group, info_name="sysdyn")
    found = group.get_command(context, topic)
    assert found is not None
    return found.get_help(click.Context(found, info_name=topic, parent=context))


def _no_such_topic(topic: str, names: list[str]) -> str:
    from sysdyn.dsl.names.symbols import nearest

    near = nearest(topic, names)
    return f"there is no topic '{topic[:40]}'; " + (f"nearest: '{near}'" if near else "sysdyn help lists them")
