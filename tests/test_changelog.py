"""The changelog is short enough to be read, names every command, and no page, option or code that there is not."""

import re
from collections.abc import Iterator
from pathlib import Path

import click
from sysdyn.cli.main import COMMANDS, group
from sysdyn.cli.manual.topics import topics
from sysdyn.dsl.text.codes import codes

TEXT = (Path(__file__).resolve().parents[1] / "CHANGELOG.md").read_text(encoding="utf-8")


def options(command: click.Command) -> Iterator[str]:
    """Names of the options of a command and of those below it."""
    for param in command.params:
        yield from param.opts
    if isinstance(command, click.Group):
        for name in command.list_commands(click.Context(command)):
            below = command.get_command(click.Context(command), name)
            assert below is not None
            yield from options(below)


def test_the_changelog_is_a_page():
    lines = TEXT.splitlines()
    assert len(lines) <= 400
    assert max(map(len, lines)) <= 120
    assert [line for line in lines if line.startswith("### ")] == ["### Added", "### Changed", "### Fixed"]


def test_the_changelog_names_what_there_is():
    named = set(re.findall(r"\(`(?:sysdyn )?help (\w+)`\)", TEXT))
    assert named
    assert named <= set(topics())
    assert set(re.findall(r"\b[ENW]\d{3}\b", TEXT)) <= set(codes())
    for name in COMMANDS:
        assert re.search(rf"`(?:sysdyn )?{name}\b", TEXT), name
    assert set(re.findall(r"--[a-z][a-z-]*", TEXT)) <= {*options(group), "--help"}
