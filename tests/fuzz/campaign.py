"""Hostile input to every door: python tests/fuzz/campaign.py [DOOR...] [--cases N] [--seed S] [--keep DIR]

Doors: `check` and `simulate` (two formulations) of written texts, `import` of netlists, damaged traces through `plot`,
`diff`, `animate` and `report` of texts, hostile clients of `lsp`, pairs of signals (signals.py).  Each case runs in a
folder and a process of its own, forked from one that has imported everything.  It has failed where it ends in a fault
(exit 4), by a signal or in a traceback, takes more than CPU seconds of processor time or MEMORY bytes, changes a file
of others, or leaves what it was not asked for.
"""

from __future__ import annotations

import argparse
import json
import os
import random
import resource
import shutil
import signal
import sys
import tempfile
import time
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))
import mutations
import signals
from written import Writer, netlist

CPU, MEMORY, WALL = 10.0, 2 << 30, 120.0
CASES = {"check": 5000, "simulate": 1000, "import": 300, "traces": 200, "lsp": 100, "signals": 100}
FORMULATIONS = ("lagrangian", "hamiltonian")
FOREIGN = b"a file of others\n"
MODEL = """model m {
  coord x: translation = 1 m
  energy T* = 1/2*(1 kg)*x'^2
  energy V = 1/2*(4 N/m)*x^2
}
scene s of m { time 0 s to 1 s; trace x, x.f }
"""
Case = tuple[Sequence[str], bytes]
"""Arguments of the command, and what is on its standard input."""


def _child(arguments: Sequence[str], given: bytes) -> None:
    """Run one command in this folder; the exit code is the command's."""
    from sysdyn.cli.main import run

    Path("stdin").write_bytes(given)
    for number, name, flags in ((0, "stdin", os.O_RDONLY), (1, "stdout", os.O_WRONLY), (2, "stderr", os.O_WRONLY)):
        handle = os.open(name, flags | os.O_CREAT, 0o600)
        os.dup2(handle, number)
        os.close(handle)
    sys.stdin = open(0, encoding="utf-8", closefd=False)  # noqa: SIM115
    sys.stdout = open(1, "w", encoding="utf-8", closefd=False)  # noqa: SIM115
    sys.stderr = open(2, "w", encoding="utf-8", closefd=False)  # noqa: SIM115
    used = resource.getrusage(resource.RUSAGE_SELF)
    spent = int(used.ru_utime + used.ru_stime + CPU) + 1
    resource.setrlimit(resource.RLIMIT_CPU, (spent, spent + 2))
    code = 99
    try:
        code = run(list(arguments))
        sys.stdout.flush()
        sys.stderr.flush()
    except BaseException:
        import traceback

        traceback.print_exc()
        sys.stderr.flush()
    finally:
        os._exit(code)


def wrong(case: Case, folder: Path, *, may: Sequence[str] = ()) -> str | None:
    """What was wrong with a command; None where nothing was.  may: suffixes of files that it may leave."""
    arguments, given = case
    foreign = folder.parent / "foreign"
    foreign.write_bytes(FOREIGN)
    before = {path.name for path in folder.iterdir()}
    pid = os.fork()
    if not pid:
        os.chdir(folder)
        _child(arguments, given)
    end, status = time.monotonic() + WALL, None
    while status is None:
        done, code, used = os.wait4(pid, os.WNOHANG)
        if done:
            status = code
        elif time.monotonic() > end:
            os.kill(pid, signal.SIGKILL)
            os.wait4(pid, 0)
            return f"more than {WALL:g} s"
        else:
            time.sleep(0.002)
    said = (folder / "stderr").read_text(errors="replace") if (folder / "stderr").exists() else ""
    left = {path.name for path in folder.iterdir()} - before - {"stdin", "stdout", "stderr"}
    left = {name for name in left if not name.endswith(tuple(may)) or name.startswith(".")}
    cpu = used.ru_utime + used.ru_stime
    tail = said.strip()[-300:]
    if os.WIFSIGNALED(status):
        return f"died of {signal.Signals(os.WTERMSIG(status)).name}: {tail}"
    if os.WEXITSTATUS(status) in (4, 99) or "Traceback" in said or "a fault in sysdyn" in said:
        return f"exit {os.WEXITSTATUS(status)}: {tail}"
    if cpu > CPU:
        return f"{cpu:.1f} s of processor time: {tail}"
    if used.ru_maxrss << 10 > MEMORY:
        return f"{used.ru_maxrss >> 10} MB: {tail}"
    if foreign.read_bytes() != FOREIGN:
        return "a file of others was written"
    return f"left behind: {sorted(left)}" if left else None


def of_check(chance: random.Random, folder: Path) -> str | None:
    """A written text."""
    (folder / "m.sd").write_text(Writer(chance).text())
    return wrong((["check", "m.sd"], b""), folder)


def of_simulate(chance: random.Random, folder: Path) -> str | None:
    """A written text, in each of two formulations."""
    (folder / "m.sd").write_text(Writer(chance).text())
    for formulation in FORMULATIONS:
        asked = [
            "simulate",
            "m.sd",
            "--backend",
            "numpy",
            "--max-wall",
            "5",
            "--formulation",
            formulation,
            "-o",
            "o.h5",
        ]
        found = wrong((asked, b""), folder, may=(".h5",))
        if found is not None:
            return f"{formulation}: {found}"
    return None


def of_import(chance: random.Random, folder: Path) -> str | None:
    """A netlist, and the check of what is written of it."""
    (folder / "n.cir").write_bytes(netlist(chance).encode("utf-8", "surrogatepass"))
    found = wrong((["import", "n.cir", "-o", "n.sd"], b""), folder, may=(".sd",))
    if found is None and (folder / "n.sd").exists():
        found = wrong((["check", "n.sd"], b""), folder)
    return found


def of_traces(chance: random.Random, folder: Path) -> str | None:
    """A damaged trace through what draws and compares it; a damaged text through `report`."""
    kept = Path(tempfile.gettempdir()) / f"sysdyn-campaign-{os.getppid()}.h5"
    kept = _good() if not kept.exists() else kept
    data = bytearray(kept.read_bytes())
    for _ in range(chance.choice((1, 1, 3, 10, 50))):
        at, size = chance.randrange(len(data)), chance.choice((1, 1, 4, 8))
        data[at : at + size] = chance.choice((os.urandom(size), b"\xff" * size, b"\0" * size))[: len(data) - at]
    if chance.random() < 0.2:
        del data[chance.randrange(len(data)) :]
    (folder / "bad.h5").write_bytes(data)
    shutil.copy(kept, folder / "good.h5")
    (folder / "m.sd").write_text(MODEL.replace("time 0 s", 'expect golden "bad.h5" within 1e-3; time 0 s'))
    for asked in (
        ["plot", "bad.h5", "-o", "p.svg"],
        ["diff", "good.h5", "bad.h5"],
        ["diff", "bad.h5", "good.h5"],
        ["animate", "bad.h5", "-o", "a.html"],
        ["report", "m.sd", "-o", "r.html"],
    ):
        found = wrong((asked, b""), folder, may=(".svg", ".html"))
        if found is not None:
            return f"{asked[0]}: {found}"
    return None


_made: list[Path] = []


def _good() -> Path:
    """A trace as `simulate` writes it."""
    if not _made:
        from sysdyn.cli.main import run

        folder = Path(tempfile.mkdtemp())
        (folder / "m.sd").write_text(MODEL)
        run(["simulate", "-q", str(folder / "m.sd"), "-o", str(folder / "good.h5"), "--backend", "numpy"])
        _made.append(folder / "good.h5")
    return _made[0]


def of_lsp(chance: random.Random, folder: Path) -> str | None:
    """A client that says anything, in any order."""
    uri, bodies = "file:///m.sd", []
    methods = ["initialize", "initialized", "shutdown", "exit", "workspace/didChangeWatchedFiles", "x"]
    words = ("formatting", "hover", "definition", "references", "rename", "documentSymbol", "completion", "codeAction")
    methods += [f"textDocument/{word}" for word in (*words, "didOpen", "didChange", "didSave", "didClose")]
    numbers = (0, 1, 7, -1, 10**20, 10**400, None, "x", 1.5, True)
    for k, method in enumerate(["initialize", "initialized", "textDocument/didOpen", *chance.choices(methods, k=20)]):
        text = chance.choice((MODEL, Writer(chance).text(), "\ud800", "\0", "((((" * 300, ""))
        at = {"line": chance.choice(numbers), "character": chance.choice(numbers)}
        params = {
            "textDocument": chance.choice(
                ({"uri": uri, "text": text, "version": k}, {"uri": "file:///a%00b"}, None, [])
            ),
            "position": at,
            "range": {"start": at, "end": chance.choice((at, {}, None))},
            "contentChanges": chance.choice(([{"text": text}], [{"text": text, "range": {"start": at, "end": at}}], 3)),
            "newName": chance.choice(("t", "pi", "a b", "\0", "y", 3)),
            "context": chance.choice(({"only": ["quickfix"]}, None, 3)),
        }
        message = {"jsonrpc": "2.0", "method": method, "params": chance.choice((params, params, params, None, [1]))}
        if not method.startswith(("initialized", "exit")) and "did" not in method:
            message["id"] = chance.choice((k, k, str(k), None, []))
        body = json.dumps(message).encode()
        if chance.random() < 0.1:
            body = body[: chance.randrange(len(body))]
        size = chance.choice((len(body),) * 20 + (0, -1, 10**9))
        bodies.append(b"Content-Length: %d\r\n\r\n" % size + body)
    return wrong((["lsp", "--stdio"], b"".join(bodies)), folder)


def of_signals(chance: random.Random, folder: Path) -> str | None:
    """A pair of signals."""
    return signals.wrong(chance)


DOORS: dict[str, Callable[[random.Random, Path], str | None]] = {
    "check": of_check,
    "simulate": of_simulate,
    "import": of_import,
    "traces": of_traces,
    "lsp": of_lsp,
    "signals": of_signals,
}


def failures(door: str, cases: int, seed: str, keep: Path | None) -> Iterator[str]:
    """What was wrong at a door, as it comes."""
    for number in range(cases):
        own = f"{seed} {door} {number}"
        with tempfile.TemporaryDirectory() as outer:
            folder = Path(outer) / "case"
            folder.mkdir()
            found = DOORS[door](random.Random(own), folder)
            if found is not None and keep is not None:
                shutil.copytree(folder, keep / own.replace(" ", "-"), dirs_exist_ok=True)
        if found is not None:
            yield f"{own}: {found}"


def _warm() -> None:
    """Everything that a command imports is there before the first fork; one thread each."""
    import contextlib
    import importlib
    import io

    for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"):
        os.environ[name] = "1"
    from sysdyn.cli.main import ROOMS, run

    for room, commands in ROOMS.items():
        for command in commands:
            importlib.import_module(f"sysdyn.cli.commands.{room}.{command}_command")
    with contextlib.redirect_stderr(io.StringIO()), contextlib.redirect_stdout(io.StringIO()):
        run(["check", str(mutations.MODELS / "seed" / "pendulum.sd")])
        _good()


def main() -> int:
    """Exit 1 where a case failed."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("doors", nargs="*", choices=[*DOORS, []])
    parser.add_argument("--cases", type=int, help="of each door; without it the whole campaign")
    parser.add_argument("--seed", default="doors")
    parser.add_argument("--keep", type=Path)
    options = parser.parse_args()
    _warm()
    wrong_ = 0
    for door in options.doors or DOORS:
        cases = options.cases if options.cases is not None else CASES[door]
        found = 0
        for said in failures(door, cases, options.seed, options.keep):
            print(said, flush=True)
            found += 1
        print(f"{door}: {cases} cases, {found} failed", flush=True)
        wrong_ += found
    return 1 if wrong_ else 0


if __name__ == "__main__":
    sys.exit(main())
