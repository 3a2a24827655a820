"""The whole of `check`, its start included, on mutated models: python tests/fuzz/run.py [--cases N] [--seed S]

Each text is checked in a process of its own, forked from one that has imported everything.  A text has failed where
`check` ends with a fault (exit 4), dies, takes more than CPU seconds of processor time, more than MEMORY bytes, or
where anything but findings reaches the streams (a warning of NumPy, a line of LAPACK).  Failures are printed with the
seed of their text; `--keep DIR` writes the texts.
"""

from __future__ import annotations

import argparse
import os
import random
import re
import resource
import signal
import sys
import tempfile
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))
import mutations

CPU = 20.0
"""Seconds of processor time that one text may take: several times the worst one's on a busy machine."""
MEMORY = 1 << 30
"""Bytes of resident memory that one text may take."""
FINDING = re.compile(r"(error|warning|note) [EWN]\d+: |sysdyn: |\d+ errors|help: | *--> | *\d* *\||[^ ]+\.sd: ")


@dataclass(frozen=True)
class Failed:
    """A text that `check` did not take: its seed, the model it was made of, and what happened."""

    seed: str
    model: str
    text: str
    what: str


def _child(path: str, log: str) -> None:
    """Check one text; the exit code is the command's."""
    from sysdyn.cli.main import run

    handle = os.open(log, os.O_WRONLY | os.O_CREAT | os.O_TRUNC)
    os.dup2(handle, 1)
    os.dup2(handle, 2)
    sys.stdout = open(1, "w", encoding="utf-8", closefd=False)  # noqa: SIM115
    sys.stderr = open(2, "w", encoding="utf-8", closefd=False)  # noqa: SIM115
    used = resource.getrusage(resource.RUSAGE_SELF)
    spent = int(used.ru_utime + used.ru_stime)
    resource.setrlimit(resource.RLIMIT_CPU, (spent + int(CPU) + 1, spent + int(CPU) + 3))
    code = 99
    try:
        code = run(["check", path])
        sys.stdout.flush()
        sys.stderr.flush()
    finally:
        os._exit(code)


def _judged(status: int, log: Path, memory: int, cpu: float) -> str | None:
    """What was wrong with a child; None where nothing was."""
    said = log.read_text(encoding="utf-8", errors="replace")
    if os.WIFSIGNALED(status):
        name = signal.Signals(os.WTERMSIG(status)).name
        return f"more than {CPU:g} s of processor time" if name in ("SIGXCPU", "SIGKILL") else f"died of {name}"
    code = os.WEXITSTATUS(status)
    if code not in (0, 1):
        return f"exit {code}: {said.strip()[-300:]}"
    if cpu > CPU:
        return f"{cpu:.1f} s of processor time"
    if memory > MEMORY:
        return f"{memory >> 20} MB"
    strange = next((line for line in said.splitlines() if line.strip() and not FINDING.match(line)), None)
    if strange is not None and not any(sign in strange for sign in ("|", "^", "  ...")):
        return f"on the streams: {strange[:200]}"
    control = next((c for c in said if ord(c) < 32 and c != "\n"), None)
    return None if control is None else f"a control character on the streams: {control!r}"


def _text(own: str, sources: dict[str, str]) -> tuple[str, str, str]:
    """A mutated text: its seed, its model, itself."""
    chance = random.Random(own)
    name = chance.choice(list(sources))
    return own, name, mutations.mutated(chance, sources[name], list(sources.values()))


def _kept(path: Path) -> tuple[str, str, str]:
    """A text of a file, in the same form."""
    return path.stem, path.stem, path.read_bytes().decode("utf-8", "surrogatepass")


def failures(cases: int, jobs: int, seed: str, files: Sequence[Path] = ()) -> Iterator[Failed]:
    """Texts that failed, as they come; files: instead of mutated models."""
    _warm()
    sources = mutations.texts()
    running: dict[int, tuple[str, str, str, Path]] = {}
    number = 0
    with tempfile.TemporaryDirectory() as folder:
        while number < cases or running:
            while number < cases and len(running) < jobs:
                own, name, text = _text(f"{seed} {number}", sources) if not files else _kept(files[number])
                place = Path(folder) / str(number)
                place.mkdir()
                (place / "model.sd").write_bytes(text.encode("utf-8", "surrogatepass"))
                pid = os.fork()
                if not pid:
                    os.chdir(place)
                    _child("model.sd", str(place / "log"))
                running[pid] = (own, name, text, place)
                number += 1
            if not running:
                break
            pid, status, used = os.wait4(-1, 0)
            own, name, text, place = running.pop(pid)
            what = _judged(status, place / "log", used.ru_maxrss << 10, used.ru_utime + used.ru_stime)
            for path in place.iterdir():
                path.unlink()
            place.rmdir()
            if what is not None:
                yield Failed(own, name, text, what)


def _warm() -> None:
    """Everything that a check imports is there before the first fork; one thread each."""
    for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"):
        os.environ[name] = "1"
    import contextlib
    import io

    from sysdyn.cli.main import run

    with contextlib.redirect_stderr(io.StringIO()), contextlib.redirect_stdout(io.StringIO()):
        for name in ("seed/pendulum.sd", "gallery/ebers_moll_amp.sd", "gallery/fluid_tank.sd"):
            run(["check", str(mutations.MODELS / name)])


def main() -> int:
    """Exit 1 where a text failed."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--cases", type=int, default=20_000)
    parser.add_argument("--jobs", type=int, default=os.cpu_count() or 1)
    parser.add_argument("--seed", default="check")
    parser.add_argument("--keep", type=Path)
    parser.add_argument("--file", type=Path, action="append", default=[], help="this text instead of mutated ones")
    options = parser.parse_args()
    kinds: dict[str, int] = {}
    cases = len(options.file) or options.cases
    for failed in failures(cases, options.jobs, options.seed, options.file):
        print(f"{failed.seed}: {failed.model}: {failed.what}", flush=True)
        kind = re.sub(r"[\d.]+", "N", failed.what)[:80]
        kinds[kind] = kinds.get(kind, 0) + 1
        if options.keep:
            options.keep.mkdir(parents=True, exist_ok=True)
            (options.keep / f"{failed.seed.replace(' ', '-')}.sd").write_text(failed.text, errors="surrogatepass")
    for kind, count in sorted(kinds.items(), key=lambda item: -item[1]):
        print(f"{count:6d}  {kind}")
    print(f"{cases} texts, {sum(kinds.values())} failed")
    return 1 if kinds else 0


if __name__ == "__main__":
    sys.exit(main())
