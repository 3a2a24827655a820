"""Checks side by side: one that kills a process of its own costs its own result and no other."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Sequence

from sysdyn.cli.failures import UsageError
from sysdyn.cli.golden.book import GoldenScene
from sysdyn.cli.golden.golden_checks import INPUT_OUTPUT, SOLVER, Case, Mutant, check, mutate, request_of
from sysdyn.cli.golden.recording import GoldenRecord, Refused, record
from sysdyn.cli.golden.runs import Stopped
from sysdyn.cli.run.many.crew import Lost, each
from sysdyn.runtime.comparison.verdict import Incomparable
from sysdyn.values import dataclass


@dataclass(frozen=True, slots=True)
class GoldenJob:
    """A golden, and how it is checked."""

    golden: GoldenScene
    formulations: tuple[str, ...]
    methods: tuple[str, ...]
    backends: tuple[str, ...]
    with_page: bool


def check_golden(asked: GoldenJob) -> list[Case]:
    """The cases of a golden."""
    return list(check(asked.golden, asked.formulations, asked.methods, asked.backends, asked.with_page))


def mutate_golden(golden: GoldenScene) -> tuple[list[Mutant], tuple[int, str] | None]:
    """The mutants of a golden, as many as could be made; exit code and reason where they could not all be."""
    found: list[Mutant] = []
    try:
        found.extend(mutate(golden))
    except Stopped as error:
        return found, (error.code, str(error))
    except Incomparable as error:
        return found, (SOLVER, str(error))
    return found, None


def record_again(golden: GoldenScene) -> tuple[list[str], GoldenRecord | tuple[int, str]]:
    """What is said while a golden is recorded anew, and the record; exit code and reason where there is none."""
    said: list[str] = []
    only = golden.formulations[0] if len(golden.formulations) == 1 else None
    try:
        request = request_of(golden, accuracy=None, formulation=only)
        return said, record(request, golden.rtol, golden.atol, said.append)
    except (Refused, Stopped) as error:
        return said, (getattr(error, "code", 1), f"{golden.label}: {error}")
    except UsageError as error:  # its scene is gone
        return said, (1, f"{golden.label}: {error.message}")
    except OSError as error:
        return said, (INPUT_OUTPUT, f"{golden.label}: {error.filename}: {error.strerror}")


def in_processes(
    asked: Sequence[GoldenJob], jobs: int | None, checked: Callable[[GoldenJob], list[Case]] = check_golden
) -> Iterator[list[Case]]:
    """The cases of each golden, in their order; checked: what makes them, in another process perhaps."""
    began = time.monotonic()
    for one, found in zip(asked, each(checked, asked, jobs), strict=True):
        if not isinstance(found, Lost):
            yield found
            continue
        kind, _, number = found.how.partition(" ")
        how = f"was killed by signal {number}" if kind == "signal" else f"ended with exit {number}"
        message, seconds = f"the check {how}", time.monotonic() - began
        code = int(number) if kind == "exit" and int(number) > 1 else INPUT_OUTPUT
        wrong = (("run", message),)
        yield [Case(one.golden.label, "", "", "", code, message, float("inf"), None, None, seconds, wrong)]
