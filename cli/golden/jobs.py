"""Checks side by side: one that kills its process costs its own result and no other."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Sequence

from sysdyn.cli.golden.book import Golden
from sysdyn.cli.golden.checking import INPUT_OUTPUT, Case, check
from sysdyn.cli.run.crew import Lost, each
from sysdyn.values import dataclass


@dataclass(frozen=True, slots=True)
class Asked:
    """A golden, and how it is checked."""

    golden: Golden
    formulations: tuple[str, ...]
    methods: tuple[str, ...]
    backends: tuple[str, ...]
    with_page: bool


def checked(asked: Asked) -> list[Case]:
    """The cases of a golden."""
    return list(check(asked.golden, asked.formulations, asked.methods, asked.backends, asked.with_page))


def in_processes(
    asked: Sequence[Asked], jobs: int, checked: Callable[[Asked], list[Case]] = checked
) -> Iterator[list[Case]]:
    """The cases of each golden as they come in; checked: what makes them, in another process."""
    began = time.monotonic()
    for k, found in each(checked, asked, jobs):
        if not isinstance(found, Lost):
            yield found
            continue
        kind, _, number = found.how.partition(" ")
        how = f"was killed by signal {number}" if kind == "signal" else f"ended with exit {number}"
        message, seconds = f"the check {how}", time.monotonic() - began
        code = int(number) if kind == "exit" and int(number) > 1 else INPUT_OUTPUT
        wrong = (("run", message),)
        label = asked[k].golden.label
        yield [Case(label, "", "", "", code, message, float("inf"), None, None, seconds, wrong)]
