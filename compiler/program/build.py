"""C text -> shared library, kept by its content.

The library's name is the sha256 of text, flags and compiler version: a rebuilt library at an old path would give the
old code (dlopen), and processes that build the same text at once must not meet half a file: each writes a temporary
file and renames it.  Nothing of the user's text reaches a command line.
"""

from __future__ import annotations

import atexit
import hashlib
import os
import shutil
import subprocess
import tempfile
from functools import cache
from pathlib import Path

# -O1: code as fast as -O2 on the benchmarks (Andrews 0.32 us a residual either way), compiled in 2/3 of the time
FLAGS = ("-O1", "-std=c11", "-fPIC", "-shared", "-ffp-contract=off", "-fno-math-errno")


class BuildError(Exception):
    """The C compiler could not be run, or refused the text; `output` is what it said."""

    def __init__(self, message: str, output: str = "") -> None:
        self.output = output
        super().__init__(message)


class NoCompilerError(BuildError):
    """There is no C compiler: the caller takes the NumPy backend and says so."""


def cache_folder() -> Path:
    """The private folder of compiled models: SYSDYN_CACHE, or sysdyn in XDG_CACHE_HOME or ~/.cache.

    Where it cannot be made, or others could put a library into it, a folder for this process takes its place.
    """
    own = os.environ.get("SYSDYN_CACHE")
    base = os.environ.get("XDG_CACHE_HOME") or str(Path("~").expanduser() / ".cache")
    folder = Path(own) if own else Path(base) / "sysdyn"
    try:
        folder.mkdir(mode=0o700, parents=True, exist_ok=True)
        found = folder.stat()
    except OSError:
        return _folder_of_process()
    private = found.st_uid == os.getuid() and not found.st_mode & 0o022
    return folder if private and os.access(folder, os.W_OK) else _folder_of_process()


@cache
def _folder_of_process() -> Path:
    folder = Path(tempfile.mkdtemp(prefix="sysdyn-"))
    atexit.register(shutil.rmtree, folder, ignore_errors=True)
    return folder


def compiler() -> str:
    """The C compiler: $CC, cc, gcc or clang; NoCompilerError where none is found."""
    wanted = os.environ.get("CC")
    for name in (wanted,) if wanted else ("cc", "gcc", "clang"):
        path = shutil.which(name)
        if path is not None:
            return path
    raise NoCompilerError(f"there is no C compiler ({wanted or 'cc, gcc, clang'})")


@cache
def _version(path: str, _changed: float) -> str:
    try:
        run = subprocess.run([path, "--version"], capture_output=True, text=True, timeout=60, check=False)
    except (OSError, subprocess.TimeoutExpired) as error:
        raise NoCompilerError(f"{path} cannot be run: {error}") from error
    if run.returncode:
        raise NoCompilerError(f"{path} --version fails with status {run.returncode}", run.stderr)
    return run.stdout


def build(text: str, flags: tuple[str, ...] = FLAGS) -> Path:
    """The shared library of a C text; BuildError where the compiler fails, OSError where the folder is not writable."""
    path = compiler()
    version = _version(path, Path(path).stat().st_mtime)
    key = hashlib.sha256("\0".join((path, version, *flags, text)).encode()).hexdigest()
    library = cache_folder() / f"model-{key}.so"
    if not library.exists():
        _compile(path, flags, text, library)
    return library


def _compile(path: str, flags: tuple[str, ...], text: str, library: Path) -> None:
    with tempfile.TemporaryDirectory(dir=library.parent, prefix="build-") as folder:
        source, output = Path(folder) / "model.c", Path(folder) / "model.so"
        source.write_text(text, encoding="ascii")
        command = [path, *flags, "-o", str(output), str(source), "-lm"]
        try:
            run = subprocess.run(command, capture_output=True, text=True, check=False, stdin=subprocess.DEVNULL)
        except OSError as error:
            raise NoCompilerError(f"{path} cannot be run: {error}") from error
        if run.returncode:
            raise BuildError(f"the C compiler failed with status {run.returncode}", run.stderr)
        output.replace(library)
