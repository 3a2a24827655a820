"""The `sysdyn` command: a group whose commands are imported only when one of them runs."""

from __future__ import annotations

import atexit
import contextlib
import gc
import importlib
import os
import platform
import signal
import sys
import threading
import time
import warnings
from collections.abc import Iterable, Iterator, Sequence
from types import FrameType
from typing import Any, NoReturn

import click
from sysdyn import __version__
from sysdyn.cli.memory_limit import stand_before_numpy
from sysdyn.cli.streams import flush, standing_streams
from sysdyn.dsl.model.collecting import keep

ROOMS = {
    "manual": {
        "doctor": "Look at the machine: compiler, cache, versions, a small run.",
        "explain": "Say what a diagnostic code means.",
        "help": "Explain a topic of the language: units, tables, scenes, events, ...",
        "lsp": "Serve an editor: findings, layout, hover, completion.",
        "new": "Begin a project: model, scenes, golden trace, CI file.",
        "std": "Show the standard library, or a component of it.",
    },
    "model": {
        "check": "Check models: everything that needs no time integration.",
        "compile": "Write the residual module and its manifest.",
        "equations": "Print the equations as a book does.",
        "fmt": "Bring model texts into the canonical layout.",
        "import": "Write a SPICE netlist as a model text.",
        "list": "List the names of a model: parameters, what can be traced, scenes, levels.",
    },
    "simulation": {
        "equilibrium": "States of rest and their stability.",
        "linearize": "Matrices, eigenvalues, poles and zeros about a state.",
        "reduce": "Find what a scene does not need, and leave it out.",
        "simulate": "Run a scene: text in, trace out.",
        "sweep": "Run a scene many times, with other numbers.",
        "trade": "Measure what accuracy costs, and name the cheapest setting.",
        "verify": "Compare the formulations and methods of a scene.",
    },
    "trace": {
        "animate": "Play a trace: points that move, curves with a mark.",
        "diff": "Compare two traces.",
        "golden": "Golden traces of a project: record, check, accept, list.",
        "plot": "Draw quantities of a trace.",
        "report": "Write one page about a model and its run.",
    },
}
"""Of `cli/commands`: the commands of each, and what they do."""
COMMANDS = {name: does for commands in ROOMS.values() for name, does in commands.items()}


class CommandGroup(click.Group):
    """Knows its commands by name; imports `sysdyn.cli.commands.<room>.<name>_command` when it is called."""

    def list_commands(self, ctx: click.Context) -> list[str]:
        """Names in the order of the alphabet."""
        return sorted(COMMANDS)

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:
        """The command of that name."""
        room = next((room for room, commands in ROOMS.items() if cmd_name in commands), None)
        if room is None:
            return None
        module = importlib.import_module(f"sysdyn.cli.commands.{room}.{cmd_name}_command")
        found = module.command
        assert isinstance(found, click.Command)
        return found

    def format_commands(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """The list of commands, without importing one."""
        with formatter.section("Commands"):
            formatter.write_dl(sorted(COMMANDS.items()))

    def resolve_command(
        self, ctx: click.Context, args: list[str]
    ) -> tuple[str | None, click.Command | None, list[str]]:
        """Name the nearest command where there is none of that name."""
        if args and args[0] not in COMMANDS and not args[0].startswith("-"):
            import difflib

            begun = [name for name in COMMANDS if name.startswith(args[0])]
            near = begun if len(begun) == 1 else difflib.get_close_matches(args[0], COMMANDS, 1)
            hint = f" Did you mean '{near[0]}'?" if near else f" There are {', '.join(sorted(COMMANDS))}."
            raise click.UsageError(f"There is no command '{args[0]}'.{hint}", ctx)
        return super().resolve_command(ctx, args)


@click.group(cls=CommandGroup, context_settings={"help_option_names": ["-h", "--help"]})
@click.version_option(__version__, prog_name="sysdyn")
def group() -> None:
    """Compile and run models of physical systems written in .sd files.

    Exit codes: 0 done, 1 the model has errors or an expectation failed, 2 wrong usage, 3 the solver failed,
    4 a fault in sysdyn, 5 input or output, 130 interrupted.
    """


def main(arguments: Sequence[str] | None = None, *, held: Iterable[int] | None = None) -> None:
    """Run the command line and exit with its code; held: the mask of signals that is the caller's own (`entry.py`).

    Most of what a command makes lives as long as it: cycles are looked for seldom, and not at its end.  The matrices of
    LAPACK are small: threads of its own cost a short command 40 ms, and change last digits.  Python would start a
    process to ask for the processor's name, as h5py does unknowingly.  What is no double is told by findings: NumPy's
    warnings of it are for tests.
    """
    if arguments is None:
        warnings.simplefilter("ignore", RuntimeWarning)
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    vars(platform.uname()).setdefault("processor", "")
    keep()
    stand_before_numpy()
    code = run(arguments, held)
    gc.freeze()
    if arguments is not None:  # called from Python, which goes on
        sys.exit(code)
    _leave(code)


def _leave(code: int) -> NoReturn:
    """Exit as Python does, but without taking its modules apart, a twentieth of a short command.

    Where more than this thread lives, somebody measures or a stream refuses what waits in it, Python has its way.
    """
    if threading.active_count() > 1 or sys.getprofile() is not None or sys.gettrace() is not None:
        sys.exit(code)
    try:
        atexit._run_exitfuncs()
        for stream in (sys.stdout, sys.stderr):
            if stream is not None:
                stream.flush()
    except BaseException:
        sys.exit(code)
    os._exit(code)


def run(arguments: Sequence[str] | None = None, held: Iterable[int] | None = None) -> int:
    """Run the command line; the exit code.  held: the mask of signals from here on, None: as it is."""
    given = list(sys.argv[1:] if arguments is None else arguments)
    with _ended_like_an_interruption(last=held is not None), standing_streams():
        try:
            if held is not None:
                signal.pthread_sigmask(signal.SIG_SETMASK, held)
            code = group.main(given, prog_name="sysdyn", standalone_mode=False, default_map=_defaults(given))
            flush()
            return code if isinstance(code, int) else 0
        except BaseException as error:
            from sysdyn.cli.failures import report_failure

            return report_failure(error, given)


def _defaults(given: Sequence[str]) -> dict[str, Any]:
    """What the project's configuration says, for a command that runs."""
    if not given or given[0] not in COMMANDS or not {"-h", "--help"}.isdisjoint(given):
        return {}
    from sysdyn.cli.project.config import project_defaults

    return project_defaults(given, COMMANDS)


ONCE = 10.0
"""Seconds in which further signals are taken for the one that was heard: what it began, closing a trace and removing
what was hidden, is not interrupted itself."""


@contextlib.contextmanager
def _ended_like_an_interruption(last: bool) -> Iterator[None]:
    """SIGTERM and SIGHUP end a command as Ctrl-C does: what was computed is kept, what was hidden is removed.

    Those that somebody ignores (nohup) or handles already stay so.  last: nothing follows in this process but its exit,
    which a signal that comes late does not change.
    """
    # signals can be set in the main thread alone
    mine = threading.current_thread() is threading.main_thread()
    names = ("SIGINT", "SIGTERM", "SIGHUP") if mine else ()  # Windows has no SIGHUP
    known = {number: signal.getsignal(number) for name in names if (number := getattr(signal, name, None)) is not None}
    # handlers that nobody changed
    own = {
        s: h for s, h in known.items() if h is (signal.default_int_handler if s == signal.SIGINT else signal.SIG_DFL)
    }
    before, until = sys.unraisablehook, 0.0

    def heard(number: int, frame: FrameType | None) -> None:
        """The first one raises KeyboardInterrupt."""
        nonlocal until
        if time.monotonic() >= until:
            until = time.monotonic() + ONCE
            raise KeyboardInterrupt

    def raise_again(lost: sys.UnraisableHookArgs) -> None:
        """Python drops what is raised where an object is taken apart: the interruption comes again, behind that."""
        nonlocal until
        interrupted = lost.exc_type is not None and issubclass(lost.exc_type, KeyboardInterrupt)
        if own and interrupted and hasattr(signal, "pthread_kill"):  # Windows: it is lost there
            until = 0.0
            threading.Timer(0.01, signal.pthread_kill, (threading.get_ident(), next(iter(own)))).start()
        else:
            before(lost)

    for number in own:
        signal.signal(number, heard)
    sys.unraisablehook = raise_again
    try:
        yield
    finally:
        sys.unraisablehook = before
        # as before, or nothing more where the process ends
        for number, handler in own.items():
            signal.signal(number, signal.SIG_IGN if last else handler)
