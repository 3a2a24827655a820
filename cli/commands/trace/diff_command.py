"""`sysdyn diff`: are two traces equal within a tube?"""

from __future__ import annotations

import math
import time

import click
from sysdyn.cli import whole_files
from sysdyn.cli.console import Console, with_console
from sysdyn.cli.failures import SOLVER, UsageError


@with_console("diff")
@click.argument("ref")
@click.argument("test")
@click.option("--rtol", type=float, default=1e-3, show_default=True, metavar="R", help="Times the nominal magnitude.")
@click.option("--atol", type=float, default=0.0, show_default=True, metavar="A", help="In each quantity's own unit.")
@click.option("--tau", metavar="T", help="Time tolerance; a bare number in s. Default: 1e-9 of the span.")
@click.option("--junit", "junit_file", metavar="FILE", help="Write the verdict as JUnit XML.")
@click.option("--html", "html_file", metavar="FILE", help="Write one page with pictures of what differs.")
def command(
    console: Console,
    ref: str,
    test: str,
    rtol: float,
    atol: float,
    tau: str | None,
    junit_file: str | None,
    html_file: str | None,
) -> int:
    """Compare the trace TEST with the trace REF.

    Equal where abs(test - ref) <= atol + rtol * nominal within the time tolerance, in both directions, at all
    instants of both and between them. Exit 0 equal, 1 different, 3 not comparable.
    """
    # options that can be told wrong before files are read
    for name, value in (("--rtol", rtol), ("--atol", atol)):
        if not 0.0 <= value < math.inf:
            raise UsageError(f"{name} {value:g}: it must be a number that is not negative")
    wide = None if tau is None else _seconds(tau)
    if ref == "-" and test == "-":
        raise UsageError("only one of the traces can be standard input")
    pages = [f for f in (junit_file, html_file) if f == "-"]
    if pages and (console.as_json or len(pages) > 1):
        raise UsageError("only one thing can go to standard output")
    from sysdyn.cli.compare.diffing import as_json, cases, differences, headline, open_trace, table
    from sysdyn.cli.page.junit import junit
    from sysdyn.runtime.comparison.verdict import Incomparable, Tolerance

    began = time.monotonic()
    try:
        # both open at once: pages read them in parts
        with open_trace(ref) as one, open_trace(test) as two:
            verdict = differences(one, two, Tolerance(rtol, atol, wide))
            if html_file:
                from sysdyn.cli.compare.comparison_page import page

                whole_files.write(html_file, page(f"{test} against {ref}", [(one, two, verdict)]))
            # traces of runs that stopped or are not met
            unfinished = [(t.path, "did not end as asked") for t in (one, two) if not t.final]
            unfinished += [(t.path, "is not met") for t in (one, two) if t.final and not t.met]
    # no common quantity, or units of another dimension
    except Incomparable as error:
        console.complain(f"the traces cannot be compared: {error}", SOLVER)
        if junit_file:
            whole_files.write(junit_file, junit([(f"{test} against {ref}", 0.0, [("comparable", str(error))])]))
        return console.finish(SOLVER)
    if junit_file:
        whole_files.write(junit_file, junit([(f"{test} against {ref}", time.monotonic() - began, cases(verdict))]))
    console.result = as_json(verdict)
    for path, why in unfinished:
        console.complain(f"{path} is of a run that {why}", 1)
    if console.quiet and not console.as_json and not verdict.equal:
        console.complain(headline(verdict), 1)
    if not (console.quiet or pages):
        console.data(headline(verdict) + "\n" + table(verdict))
    return console.finish(0 if verdict.equal and not unfinished else 1)


def _seconds(text: str) -> float:
    """A time tolerance: a number in s, or a number with a unit of time."""
    from sysdyn.cli.page.unit_text import conversion

    number, _, unit = text.strip().partition(" ")
    try:
        value = float(number)
    except ValueError:
        value = math.nan
    scale = conversion(unit.strip(), "s") if unit.strip() else (1.0, 0.0)
    found = value * scale[0] if scale else math.nan
    if not 0.0 <= found < math.inf:
        raise UsageError(f"--tau {text}: a time that is not negative is wanted, a bare number in s")
    return found
