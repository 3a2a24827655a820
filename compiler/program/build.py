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
from functools import cache
from itertools import takewhile
from pathlib import Path

from sysdyn.compiler.program import cache as cache_

# -O1: code as fast as -O2 on the benchmarks (Andrews 0.32 us a residual either way), compiled in 2/3 of the time
FLAGS = ("-O1", "-std=c11", "-fPIC", "-shared", "-ffp-contract=off", "-fno-math-errno", "-fno-plt")


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


def _runs(command: tuple[str, ...]) -> None:
    """Raises NoCompilerError where what is called a compiler is none."""
    import subprocess

    name = " ".join(command)
    try:
        run = subprocess.run([*command, "--version"], capture_output=True, text=True, timeout=60, check=False)
    except (OSError, subprocess.TimeoutExpired) as error:
        raise NoCompilerError(f"{name} cannot be run: {error}") from error
    if run.returncode:
        raise NoCompilerError(f"{name} --version fails with status {run.returncode}", run.stderr)


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
    import subprocess
    import tempfile

    with tempfile.TemporaryDirectory(dir=folder, prefix="build-") as place:
        source, output = Path(place) / "model.c", Path(place) / "model.so"
        source.write_text(text, encoding="ascii")
        try:
            run = subprocess.run(
                [*command, "-o", str(output), str(source), "-lm"],
                capture_output=True,
                text=True,
                check=False,
                stdin=subprocess.DEVNULL,
            )
        except OSError as error:
            raise NoCompilerError(f"{command[0]} cannot be run: {error}") from error
        if run.returncode:
            raise BuildError(f"the C compiler failed with status {run.returncode}", run.stderr)
        return cache_.put(output, key)
