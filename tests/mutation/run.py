"""Every sign and index mutant of the lowering against `sysdyn verify`: python tests/mutation/run.py [options]

A mutant is dead where verify (or the compiler) refuses one of the MODELS.  At least 95 % of those that can change a
result (EQUIVALENT lists the others, with the reasons) must die; survivors are listed.

A run works on a copy of the package.  One traced run of verify per model tells which statements of the lowering it
carries out; a mutant meets the models that carry out its statement, the fastest first.  Each mutant lives in a process
forked from one that has imported everything but the package's own modules that depend on the lowering.
Options: --sample N (every so many that about N remain), --jobs N, --only FILE, --at LINE, --function NAME, --what TEXT,
--models NAME,..., --uncovered.
"""

from __future__ import annotations

import argparse
import ast
import contextlib
import dataclasses
import functools
import hashlib
import importlib
import importlib.abc
import importlib.util
import io
import json
import os
import resource
import shutil
import signal
import sys
import tempfile
import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from types import FrameType, ModuleType
from typing import Any

sys.path.insert(0, str(Path(__file__).parent))
from mutants import Mutant, mutants

HERE = Path(__file__).resolve().parent
ROOT = HERE.parents[1]
ROOMS = ("dsl", "compiler", "runtime", "cli", "api", "models")
LOWERING = (
    "forms/lowering.py", "forms/efforts.py", "forms/kane.py", "forms/momenta.py", "forms/integration.py",
    "forms/meters/audit.py",
    "model/mirror.py", "network/reflection.py", "network/positions.py", "network/quadratures.py",
    "network/primal/balances.py", "network/primal/choices.py", "network/primal/laws.py", "network/primal/series.py",
    "network/primal/potentials.py", "network/primal/reading.py", "network/primal/contents.py",
    "network/primal/overlaps.py", "network/primal/store_guesses.py",
)  # fmt: skip
SEEDS = (
    "dc_motor", "knife_edge", "pendulum", "lead_filter", "two_link_arm", "bead_rod", "electrical_transformer",
    "lcr_nonlinear", "relativistic_mass", "rack_pinion", "fluid_transformer", "em_suspension", "transactor_vcvs",
    "pi_controller", "co_circuit", "diode_circuit", "two_tank",
)  # fmt: skip
MODELS: Mapping[str, Path] = {
    **{path.stem: path for path in sorted(HERE.glob("*.sd"))},
    **{f"seed/{name}": ROOT / "models" / "seed" / f"{name}.sd" for name in SEEDS},
}
_FORMS = "which laws are rows, states or implicit unknowns: another form of the same equations"
_TEXT = "the text of a message, or the unit of a row in one"
_CARRIERS = "which coordinates carry p as an unknown: it is dT*/df elsewhere, another form of the same equations"
_INTEGRATED = "whether psi is integrated: B f + b = 0 and its primitive from the same start have the same solutions"
EQUIVALENT = (
    ("forms/kane.py", "_pivot", "uses.get(column, 0) + 1", "one pivot; every regular one spans the same motions"),
    ("forms/momenta.py", "inertial", "rates = ", _CARRIERS),
    ("forms/momenta.py", "inertial", "found.add(", _CARRIERS),
    ("forms/lowering.py", "_massless", "for function, kind in", "the start leaves out the rows that have inertia"),
    ("forms/lowering.py", "_massless", "found.update(", "the start leaves out the rows that have inertia"),
    ("forms/momenta.py", "undefined", "yield ", _TEXT),
    ("forms/integration.py", "_touches", "", _INTEGRATED),
    ("forms/integration.py", "_exact", "flows = ", _INTEGRATED),
    ("model/mirror.py", "", "COMPLEMENTARY = ", "nothing reads it"),
    ("forms/integration.py", "_note", "", _TEXT),
    ("forms/integration.py", "_at_start", "", _TEXT),
    ("network/primal/contents.py", "store", "places[", _TEXT),
    ("network/primal/choices.py", "law", "outer = ", _FORMS),
    ("network/primal/choices.py", "", "OWN = ", _FORMS),
    ("network/primal/choices.py", "_inside_out", "OWN[", _FORMS),
    ("network/primal/choices.py", "_kept", "", _TEXT),
    ("network/primal/choices.py", "_said", "", _TEXT),
    ("network/primal/laws.py", "_implicit", 'b.side == "p"', _TEXT),
    ("network/primal/laws.py", "_stem", "", "labels of constraints"),
    ("network/primal/store_guesses.py", "_owners", "", "a store alone in its coordinate has one measure either way"),
    ("network/reflection.py", "_moduli", "rpartition(", _TEXT),
)
"""Mutants that cannot change a result: file, function, what the line holds, and the reason."""
TARGET = 0.95
MOST = 30
"""Models that a mutant changes and verify may accept before it counts as a survivor."""
STRIDE = 5
"""Mutants that are neighbours in the text stand that many parts of a run apart."""
LIMIT = 240.0
"""Wall time [s] of one mutant on all its models; beyond it is dead."""


@dataclass(frozen=True)
class Site:
    """A mutant of a file, the function it stands in, and the lines of its statement."""

    name: str
    mutant: Mutant
    function: str
    lines: frozenset[int]
    source: str

    def __str__(self) -> str:
        return f"compiler/{self.name}:{self.mutant.line} {self.function}: {self.mutant.what}"

    @property
    def reason(self) -> str | None:
        """Why it is equivalent; None where it is not."""
        entries = (e for e in EQUIVALENT if e[:2] == (self.name, self.function) and e[2] in self.source)
        return next((why for *_, why in entries), None)


@dataclass(frozen=True)
class Known:
    """Of a model without a mutant: the digest of its forms, and the formulations in which verify ran it."""

    printed: str
    formulations: tuple[str, ...]


@functools.cache
def sites(name: str) -> tuple[Site, ...]:
    """All mutants of a file of the compiler."""
    text = (ROOT / "compiler" / name).read_text()
    tree = ast.parse(text)
    lines = text.splitlines()
    return tuple(Site(name, m, *_around(tree, m.line), lines[m.line - 1]) for m in mutants(text))


def _around(tree: ast.Module, line: int) -> tuple[str, frozenset[int]]:
    function, lines = "", range(line, line + 1)
    for node in ast.walk(tree):  # outer ones first
        if isinstance(node, ast.stmt) and node.lineno <= line <= (node.end_lineno or line):
            if isinstance(node, ast.FunctionDef):
                function = node.name
            inner = getattr(node, "body", None)
            last = inner[0].lineno - 1 if inner else node.end_lineno or line
            lines = range(node.lineno, max(last, node.lineno) + 1)
    return function, frozenset(lines)


# -- the package of a mutant --------------------------------------------------------------------------------


def tree(folder: Path) -> Path:
    """A copy of the installed package, its C core included, in a folder of its own."""
    package = folder / "sysdyn"
    for room in ROOMS:
        spec = importlib.util.find_spec(f"sysdyn.{room}")
        (place,) = spec.submodule_search_locations if spec and spec.submodule_search_locations else [None]
        if place is None:
            raise ModuleNotFoundError(f"sysdyn.{room} is not installed")
        shutil.copytree(place, package / room, ignore=shutil.ignore_patterns("__pycache__"))
    around = importlib.util.find_spec("sysdyn")
    if around is not None and around.origin is not None:  # the package itself: where it is found its rooms are
        for module in Path(around.origin).parent.glob("*.py"):
            shutil.copy(module, package / module.name)
    for name in [n for n in sys.modules if n == "sysdyn" or n.startswith("sysdyn.")]:
        del sys.modules[name]  # looking for the rooms has imported it from where it is installed
    importlib.invalidate_caches()
    return package


class _Mutated(importlib.abc.MetaPathFinder, importlib.abc.Loader):
    """Loads one module of the package from another text."""

    def __init__(self, module: str, text: str) -> None:
        self.module, self.text = module, text

    def find_spec(self, name: str, path: Any = None, target: Any = None) -> Any:
        return importlib.util.spec_from_loader(name, self) if name == self.module else None

    def exec_module(self, module: ModuleType) -> None:
        code = compile(self.text, f"<mutant of {self.module}>", "exec")
        exec(code, module.__dict__)  # noqa: S102


def changed(text: str) -> str:
    """A mutant's text with the import that its changes need."""
    head, mark, rest = text.partition("from __future__ import annotations\n")
    line = "import sysdyn.dsl.model.expression as ex_\n"
    return head + mark + line + rest if mark else line + text


def judged(models: Iterable[str], known: Mapping[str, Known]) -> str:
    """The first model at which verify failed, or refused a formulation that it ran before; "" where all pass.

    A model whose compiled forms are those known of the unchanged lowering would pass as it did: it is not run.
    """
    tried = 0
    for model in models:
        if print_of(model) == known[model].printed:
            continue
        tried += 1
        if tried > MOST:  # it has passed many that it changed: it counts as a survivor
            break
        code, formulations = verified(model)
        if code or not set(known[model].formulations) <= formulations:
            return f"{model} {code or 'refused'}"
    return ""


def verified(model: str) -> tuple[int | str, set[str]]:
    """Exit code of verify, or the name of what it raised; the formulations that it ran."""
    run, said = importlib.import_module("sysdyn.cli.main").run, io.StringIO()
    try:
        with contextlib.redirect_stdout(said):
            options = ["--json", "--progress", "never", "--max-wall", "30", "--no-prune", "--jobs", "1"]  # traced here
            code = run(["verify", *options, str(MODELS[model])])
    except BaseException as error:  # what a mutant may do
        return type(error).__name__, set()
    return code, {r["formulation"] for r in json.loads(said.getvalue())["result"]["runs"]} if not code else set()


def print_of(model: str) -> str:
    """A digest of all that verify makes runs of: lowered network, energies, form and program in every formulation."""
    get = importlib.import_module
    running, targets = get("sysdyn.cli.run.running"), get("sysdyn.cli.run.request.targets")
    ex = get("sysdyn.dsl.model.expression")
    load, pipeline = get("sysdyn.dsl.load"), get("sysdyn.compiler.pipeline")
    choose, said = get("sysdyn.compiler.formulations").choose, get("sysdyn.dsl.text.diagnostics")
    wrong, report = said.ModelError, said.Report
    whole = hashlib.sha256()
    try:
        request = running.Request(str(MODELS[model]))
        document = targets.read(request.file, report())
        target = targets.one(document, request.file, None, None, report())
        for name in (None, "lagrangian", "hamiltonian", "co_lagrangian", "co_hamiltonian", "kane"):
            with ex.fresh():
                network = load.network(target.document, target.model, target.scene, report(), (), levels=())
                asked = name or (network.scene.formulation if network.scene else None) or "auto"
                chosen, found = choose(network, asked, None)
                whole.update(repr((chosen, found)).encode())
                if found:
                    continue
                try:
                    made = pipeline.compile_network(network, chosen, "numpy")
                    parts = [made.network, made.energies, made.form, made.program, made.text, made.notes]
                except wrong as error:
                    parts = [repr(error.diagnostics)]
                _digest(parts, whole, {})
    except Exception as error:
        return f"{type(error).__name__} {error}"
    return whole.hexdigest()


def _digest(value: Any, whole: Any, seen: dict[int, int]) -> None:
    """Everything in a value, the nodes of its expressions by what they are and not by when they were made."""
    if type(value).__name__ == "Node":
        if id(value) in seen:
            whole.update(f"@{seen[id(value)]}".encode())
            return
        seen[id(value)] = len(seen)
        whole.update(f"<{value.op}".encode())
        _digest(value.data, whole, seen)
        _digest(value.args, whole, seen)
    elif dataclasses.is_dataclass(value):
        whole.update(type(value).__name__.encode())
        for field in dataclasses.fields(value):
            _digest(getattr(value, field.name), whole, seen)
    elif isinstance(value, Mapping):
        _digest(list(value.items()), whole, seen)
    elif isinstance(value, set | frozenset):
        _digest(sorted(map(repr, value)), whole, seen)
    elif isinstance(value, list | tuple):
        whole.update(b"(")
        for item in value:
            _digest(item, whole, seen)
        whole.update(b")")
    else:
        whole.update(f"{type(value).__name__} {value!r};".encode())


class Workers:
    """Processes forked from this one, each of which hands back a text."""

    def __init__(self, package: Path) -> None:
        for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"):
            os.environ[name] = "1"
        os.environ["SYSDYN_CACHE"] = str(package.parent / "cache")
        sys.path.insert(0, str(package.parent))
        foreign = self.call(_foreign)
        for name in json.loads(foreign):
            with contextlib.suppress(ImportError):
                importlib.import_module(name)

    def call(self, work: Callable[[], str], limit: float = 4 * LIMIT) -> str:
        """What `work` hands back in a process of its own."""
        return next(iter(self.all([work], 1, limit)))[1]

    def all(self, works: Sequence[Callable[[], str]], jobs: int, limit: float = LIMIT) -> Iterable[tuple[int, str]]:
        """Numbers and answers as they come; "died" and "time" where there is none."""
        ahead, running = list(range(len(works)))[::-1], {}
        while ahead or running:
            while ahead and len(running) < jobs:
                number = ahead.pop()
                handle, answer = tempfile.mkstemp(prefix="mutant-")
                os.close(handle)
                pid = os.fork()
                if not pid:
                    _child(works[number], answer)
                running[pid] = number, answer, time.monotonic()
            pid, _ = os.waitpid(-1, os.WNOHANG)
            late = next((p for p, (_, _, began) in running.items() if time.monotonic() - began > limit), None)
            if pid in running:
                number, place, _ = running.pop(pid)
                text = Path(place).read_text()
                yield number, text.removeprefix("=") if text else "died"
            elif late is not None:
                os.killpg(late, signal.SIGKILL)
                os.waitpid(late, 0)
                number, place, _ = running.pop(late)
                yield number, "time"
            else:
                time.sleep(0.01)
                continue
            Path(place).unlink()


def _child(work: Callable[[], str], answer: str) -> None:
    os.setpgid(0, 0)
    resource.setrlimit(resource.RLIMIT_AS, (4 << 30, 4 << 30))
    silent = os.open(os.devnull, os.O_RDWR)
    for stream in (0, 1, 2):
        os.dup2(silent, stream)
    try:
        Path(answer).write_text("=" + work())
    finally:
        os._exit(0)


def _foreign() -> str:
    """Modules that verify needs and that no mutant changes."""
    before = set(sys.modules)
    verified(next(m for m in MODELS if m.startswith("seed/")))
    names = [n for n in sys.modules if n not in before]
    return json.dumps([n for n in names if not n.startswith("sysdyn") or n.startswith("sysdyn.dsl")])


def _mutated(site: Site, models: Sequence[str], known: Mapping[str, Known]) -> Callable[[], str]:
    def work() -> str:
        module = "sysdyn.compiler." + site.name.removesuffix(".py").replace("/", ".")
        sys.meta_path.insert(0, _Mutated(module, changed(site.mutant.text)))
        return judged(models, known)

    return work


# -- what a model carries out -------------------------------------------------------------------------------


def _traced(model: str, package: Path) -> Callable[[], str]:
    def work() -> str:
        folder = f"{package / 'compiler'}/"
        seen: dict[str, set[int]] = {name: set() for name in LOWERING}

        def trace(frame: FrameType, event: str, _: Any) -> Any:
            found = seen.get(frame.f_code.co_filename.removeprefix(folder))
            if found is None:
                return None
            found.add(frame.f_lineno)

            def line(inner: FrameType, event: str, _: Any) -> Any:
                found.add(inner.f_lineno)
                return line

            return line

        sys.settrace(trace)
        began = time.monotonic()
        code, formulations = verified(model)
        sys.settrace(None)
        fact = {"verdict": f"{model} {code}" if code else "", "seconds": time.monotonic() - began}
        fact |= {"lines": {name: sorted(found) for name, found in seen.items()}}
        return json.dumps({**fact, "print": print_of(model), "formulations": sorted(formulations)})

    return work


def coverage(workers: Workers, package: Path, names: Sequence[str], jobs: int) -> dict[str, Any]:
    """Verdict, time and lines of each model without a mutant; those known from an earlier run are kept."""
    store = Path(tempfile.gettempdir()) / "sysdyn-mutation"
    store.mkdir(exist_ok=True)
    sources = hashlib.sha256(Path(__file__).read_bytes())
    for path in sorted(package.rglob("*.py")):
        sources.update(path.read_bytes())
    keys = {n: store / hashlib.sha256(sources.digest() + MODELS[n].read_bytes()).hexdigest() for n in names}
    missing = [n for n in names if not keys[n].exists()]
    for number, answer in workers.all([_traced(n, package) for n in missing], jobs):
        if not answer.startswith("{"):
            answer = json.dumps({"verdict": answer, "seconds": 0.0, "lines": {}})
        elif not json.loads(answer)["verdict"]:
            keys[missing[number]].write_text(answer)
        print(f"\rmodel {missing[number]}: {json.loads(answer)['seconds']:.1f} s", file=sys.stderr)
        if not keys[missing[number]].exists():
            return {missing[number]: json.loads(answer)}
    return {n: json.loads(keys[n].read_text()) for n in names}


def main() -> int:
    parser = argparse.ArgumentParser()
    parser.add_argument("--sample", type=int)
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--only")
    parser.add_argument("--at", type=int)
    parser.add_argument("--function")
    parser.add_argument("--what")
    parser.add_argument("--models")
    parser.add_argument("--uncovered", action="store_true", help="list the mutants that no model carries out, and stop")
    options = parser.parse_args()
    chosen = options.models.split(",") if options.models else list(MODELS)
    found = [s for name in LOWERING if options.only in (None, name) for s in sites(name)]
    found = [s for s in found if options.at in (None, s.mutant.line)]
    found = [s for s in found if options.function in (None, s.function) and options.what in (None, s.mutant.what)]
    equivalent = [s for s in found if s.reason]
    found = [s for s in found if not s.reason]
    step = max(1, len(found) // options.sample) if options.sample else 1
    found = [s for first in range(STRIDE) for s in found[::step][first::STRIDE]]  # what is done is always a fair sample
    with tempfile.TemporaryDirectory() as scratch:
        package = tree(Path(scratch))
        workers = Workers(package)
        known = coverage(workers, package, chosen, options.jobs)
        broken = [fact["verdict"] for fact in known.values() if fact["verdict"]]
        if broken:
            print(f"the models do not pass without a mutant: {broken[0]}")
            return 2
        chosen.sort(key=lambda n: known[n]["seconds"])
        meets = [[n for n in chosen if s.lines & set(known[n]["lines"][s.name])] for s in found]
        if options.uncovered:
            for s, models in zip(found, meets, strict=True):
                if len(models) < 2:
                    print(f"{s}  {models}")
            return 0
        began, survivors = time.monotonic(), []
        facts = {n: Known(known[n]["print"], tuple(known[n]["formulations"])) for n in chosen}
        works = [_mutated(s, models, facts) for s, models in zip(found, meets, strict=True)]
        for done, (number, verdict) in enumerate(workers.all(works, options.jobs), 1):
            if not verdict:
                survivors.append(found[number])
            how = "dead" if verdict else "SURVIVES"
            print(f"{how}: {found[number]}  [{verdict or len(meets[number])}]", flush=True)
            left = (time.monotonic() - began) / done * (len(found) - done)
            print(f"\r{done} of {len(found)}, {len(survivors)} survive, {left:.0f} s left ", end="", file=sys.stderr)
    dead = 1.0 - len(survivors) / max(len(found), 1)
    print(f"\n{len(found)} mutants, {100 * dead:.1f} % dead; {len(equivalent)} equivalent left out")
    for site in sorted(survivors, key=str):
        print(f"survives: {site}")
    return 0 if dead >= TARGET else 1


if __name__ == "__main__":
    if os.environ.get("PYTHONHASHSEED") != "0":  # digests of sets of names are compared between runs
        os.execve(sys.executable, [sys.executable, *sys.argv], {**os.environ, "PYTHONHASHSEED": "0"})
    sys.exit(main())
