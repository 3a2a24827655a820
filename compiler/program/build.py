"""C text -> shared library, kept by its content (cache.py).

The key is the sha256 of text, flags and the compiler file (asking it for its version takes 5 ms): a rebuilt library at
an old path would give the old code (dlopen), and processes that build the same text at once must not meet half a file:
each builds in a folder of its own.
Nothing of the user's text reaches a command line.
"""

from __future__ import annotations

import hashlib
import os
import platform
import shlex
import shutil
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from functools import cache
from itertools import takewhile
from pathlib import Path
from typing import TYPE_CHECKING, Any

from sysdyn.compiler.program import cache as cache_

if TYPE_CHECKING:
    import subprocess

# -O1: code as fast as -O2 on the benchmarks (Andrews 0.32 us a residual either way), compiled in 2/3 of the time
FLAGS = ("-O1", "-std=c11", "-fPIC", "-shared", "-ffp-contract=off", "-fno-math-errno", "-fno-plt")


PATIENCE = 600.0
"""Seconds after which a compiler is taken for one that hangs: the largest models take two minutes."""
MOST_SAID = 1 << 20
"""Bytes of a compiler's words that are read."""
FEW = 4096
"""Bytes of /proc/cpuinfo that hold the first processor."""


class BuildError(Exception):
    """The C compiler could not be run, or refused the text; `output` is what it said."""

    def __init__(self, message: str, output: str = "") -> None:
        self.output = output
        super().__init__(message)


class NoCompilerError(BuildError):
    """There is no C compiler: the caller takes the NumPy backend and says so."""


def compiler() -> tuple[tuple[str, ...], tuple[str, ...]]:
    """The C compiler's command and its options: of $CC (`ccache gcc -O0`), else cc, gcc or clang.

    The options come after FLAGS and win.  NoCompilerError where none is found.
    """
    wanted = os.environ.get("CC", "").strip()
    try:
        choices = [shlex.split(wanted)] if wanted else [["cc"], ["gcc"], ["clang"]]
    except ValueError as error:
        raise NoCompilerError(f"CC cannot be read: {error}: {wanted}") from error
    for words in choices:
        command = [*takewhile(lambda word: not word.startswith("-"), words)]
        found = [shutil.which(word) for word in command]
        if command and None not in found:
            return tuple(str(path) for path in found), tuple(words[len(command) :])
    raise NoCompilerError(f"there is no C compiler ({wanted or 'cc, gcc, clang'})")


@contextmanager
def _group(command: tuple[str, ...], streams: Mapping[str, Any]) -> Iterator[subprocess.Popen[bytes]]:
    """A process in a group of its own, where there are groups; what is left of the group at the end is killed."""
    import signal
    import subprocess

    run = subprocess.Popen(command, **streams, start_new_session=True)
    try:
        yield run
    finally:
        with suppress(OSError):  # nobody is left
            if hasattr(os, "killpg"):
                os.killpg(run.pid, signal.SIGKILL)
            else:
                run.kill()
        run.wait()


def _run_command(command: tuple[str, ...]) -> tuple[int, str]:
    """The status of a compiler's command and what it said; NoCompilerError where it cannot be run, or does not end.

    Its words go to a file: what it leaves running holds no pipe open that would be waited for.  They may be in any
    encoding, and only their beginning is read.  It has a group of processes of its own, which ends with it.
    """
    import subprocess
    import tempfile

    with tempfile.TemporaryFile() as words:
        streams: dict[str, Any] = {"stdin": subprocess.DEVNULL, "stdout": words, "stderr": words}
        try:
            with _group(command, streams) as run:
                status = run.wait(PATIENCE)
        except (OSError, subprocess.TimeoutExpired) as error:
            raise NoCompilerError(f"{' '.join(command[:1])} cannot be run: {error}") from error
        words.seek(0)
        return status, words.read(MOST_SAID).decode("utf-8", "replace")


def _runs(command: tuple[str, ...]) -> None:
    """Raises NoCompilerError where what is called a compiler is none."""
    status, said = _run_command((*command, "--version"))
    if status:
        raise NoCompilerError(f"{' '.join(command)} --version fails with status {status}", said)


def _identity(path: str) -> str:
    """Which compiler stands at a path: another version is another file."""
    real = Path(path).resolve()
    found = real.stat()
    return f"{real} {found.st_size} {found.st_mtime_ns}"


@cache
def of_this_machine() -> tuple[str, ...]:
    """-mavx where the processor has it: a fifth fewer instructions (three operands each), and the same results."""
    try:
        with Path("/proc/cpuinfo").open("rb") as file:
            words = file.read(FEW).split()
    except OSError:
        return ()
    return ("-mavx",) if platform.machine() == "x86_64" and b"avx" in words else ()


def build(text: str, flags: tuple[str, ...] = FLAGS) -> Path:
    """The shared library of a C text; BuildError where there is no compiler, it fails, or nothing can be written."""
    command, options = compiler()
    flags = (*flags, *of_this_machine())
    said = (*map(_identity, command), *flags, *options, text)
    key = hashlib.sha256("\0".join(said).encode()).hexdigest()
    entry = cache_.path_of(key)
    if cache_.sound(entry, key):
        return entry
    _runs(command)
    try:
        return _compile((*command, *flags, *options), text, entry.parent, key)
    except OSError:  # no room in the cache, or a folder that takes no files: one for this process
        pass
    try:
        return _compile((*command, *flags, *options), text, cache_.folder_of_process(), key)
    except OSError as error:
        raise NoCompilerError(f"a library cannot be written: {error}") from error


def _compile(command: tuple[str, ...], text: str, folder: Path, key: str) -> Path:
    import tempfile

    with tempfile.TemporaryDirectory(dir=folder, prefix="build-") as place:
        source, output = Path(place) / "model.c", Path(place) / "model.so"
        source.write_text(text, encoding="ascii")
        status, said = _run_command((*command, "-o", str(output), str(source), "-lm"))
        if status:
            raise BuildError(f"the C compiler failed with status {status}", said)
        return cache_.put(output, key)
