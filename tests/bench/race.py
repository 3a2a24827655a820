"""Ours against SUNDIALS in one run: python tests/bench/race.py [--targets A,...] [--plot FILE] [FAMILY[:n][@END]...]

The models of models/benchmark (n: sections of a line or ladder), each at its end (or END, s): the cheapest run whose
achieved error meets a target.  Ours: over `--accuracy` 10^(-1, -1.5, ..., -12), everything else automatic,
`cpu_integrate_s` with all runs of the control; beside it the cheapest single run with --rtol by any method.  Peers: IDA
and CVODE on the residual and the Jacobian that `sysdyn compile` writes of the same model (peers/peer.c), over index
forms, tolerances by half decades, algebraic unknowns in and out of the error test, two constants of Newton's test, two
policies of refactoring, dense and KLU, BDF and Adams.  Ours locates jumps of laws (tube), as a command does; peers step
over them.  Error: largest of the traced quantities at the end, over their larger value at both ends, against our radau
(dopri where constraints lose rank) near round-off (`reference`: how far that is from our bdf, and from published
values).  Beside the best peers that were recorded: field.py.
Without SUNDIALS (Debian: libsundials-dev, libsuitesparse-dev) it says so and measures ours alone.
"""

from __future__ import annotations

import argparse
import itertools
import json
import math
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parent))
from measuring import MODELS, Bench, Measured
from price import METHODS, TOLERANCES

PEER = Path(__file__).parent / "peers" / "peer.c"
LIBRARIES = (
    "ida", "cvode", "nvecserial", "sunlinsoldense", "sunmatrixdense", "sunlinsolklu", "sunmatrixsparse",
    "sunnonlinsolfixedpoint", "generic",
)  # fmt: skip
ASKED = tuple(10.0 ** (-0.5 * k) for k in range(2, 25))
SPARSE, LARGE = 20, 200
"""Unknowns from which KLU is tried, and above which dense factors are not."""
FORMS = ("auto", "1", "0")
"""Index forms of the peers; the last is an ordinary differential equation, for CVODE too."""
ENOUGH = 1e-11
"""Errors below are those of the reference."""
REPEATED, SHORT = 3, 0.1
"""Runs of which the fastest counts, where one takes less than this (s)."""
POLICIES = (("1", "0.33", "0.25"), ("1", "0.33", "0.01"), ("1", "0.01", "0.25"), ("0", "0.33", "0.25"))
"""Of IDA: algebraic unknowns out of its error test, constant of Newton's test, change of cj that it refactors for."""


def sized(family: str) -> tuple[str, tuple[tuple[str, str], ...], float | None]:
    """NAME[:n][@END]: the model, its settings, its end (s) where it is not its scene's."""
    named, _, end = family.partition("@")
    name, _, n = named.partition(":")
    return name, (("n", n),) if n else (), float(end) if end else None


@dataclass(frozen=True, slots=True)
class Entry:
    """One run: who (settings), CPU time (s), error at the end relative to the largest values."""

    who: str
    cpu: float
    error: float


class Peers:
    """Builds and runs peers/peer.c for a machine (an option of the compiler); `missing`: why it cannot."""

    def __init__(self, folder: Path, machine: str = "-march=native") -> None:
        self.folder, self.machine = folder, machine
        check = folder / "check.c"
        check.write_text("#include <ida/ida.h>\n#include <cvode/cvode.h>\nint main(void) { return 0; }\n")
        command = ["cc", "-I/usr/include/suitesparse", str(check), "-o", str(folder / "check"), *self._libraries()]
        try:
            done = subprocess.run(command, capture_output=True, text=True, check=False)
            self.missing = "" if done.returncode == 0 else done.stderr.strip().splitlines()[0]
        except OSError as error:
            self.missing = str(error)

    @staticmethod
    def _libraries() -> list[str]:
        return [*(f"-lsundials_{name}" for name in LIBRARIES), "-lklu", "-lm"]

    def build(self, family: str, index: str) -> tuple[Path, int, list[str]] | None:
        """The program of one index form, its number of unknowns, its outputs; None where the model has no such form."""
        here = self.folder / f"{family}-{index}"
        sysdyn = Path(sys.executable).parent / "sysdyn"
        name, settings, _ = sized(family)
        model = MODELS / "benchmark" / f"{name}.sd"
        given = [word for key, value in settings for word in ("--set", f"{key}={value}")]
        written = subprocess.run(
            [str(sysdyn), "compile", str(model), "--scene", "reference", "--index", index, *given, "-o", str(here)],
            capture_output=True, text=True, check=False,
        )  # fmt: skip
        if written.returncode:
            return None
        sources = [str(PEER), str(here / "residual.c"), str(here / "binding.c")]
        program = here / "peer"
        subprocess.run(
            ["cc", "-O2", self.machine, "-fno-math-errno", "-w", "-I/usr/include/suitesparse", f"-I{here}",
             *sources, "-o", str(program), *self._libraries()],
            check=True,
        )  # fmt: skip
        binding = json.loads((here / "binding.json").read_text())
        return program, len(binding["y0"]), [output["name"] for output in binding["outputs"]]

    def runs(self, family: str, end: float, seconds: float) -> Iterator[tuple[str, float, dict[str, float]]]:
        """(settings, CPU s, outputs at the end by name) of every run that got there."""
        for index in FORMS:
            built = self.build(family, index)
            if built is None:
                continue
            program, n, outputs = built
            kinds = [k for k, fits in (("dense", n <= LARGE), ("klu", n >= SPARSE)) if fits]
            settings = [("ida", k, *policy) for k, policy in itertools.product(kinds, POLICIES)]
            if index == "0":
                settings = [("ida", k, "0", "0.33", "0.25") for k in kinds]
                settings += [("bdf", k, "0", "0", "0") for k in kinds] + [("adams", kinds[0], "0", "0", "0")]
            for setting in settings:
                command = [str(program), *setting, repr(end), repr(seconds)]
                try:
                    done = subprocess.run(command, capture_output=True, text=True, timeout=4 * seconds, check=False)
                    found = done.stdout
                except subprocess.TimeoutExpired as late:
                    found = (late.stdout or b"").decode()
                name = f"{setting[0]} index {index} {' '.join(setting[1:])}"
                for line in found.splitlines():
                    numbers = line.split()
                    if len(numbers) > 4 and int(numbers[1]) >= 0:
                        yield name, float(numbers[3]), dict(zip(outputs, map(float, numbers[4:]), strict=False))


@dataclass(frozen=True, slots=True)
class Family:
    """All runs of one family.  doubt: of the reference."""

    name: str
    doubt: float
    ours: list[Entry]
    single: list[Entry]
    peers: list[Entry]

    def best(self, runs: list[Entry], target: float) -> Entry | None:
        """The cheapest that meets a target."""
        return min((run for run in runs if run.error <= target), key=lambda run: run.cpu, default=None)


def repeated(bench: Bench, **options: object) -> Measured | None:
    """A run, and its least CPU time where it is short."""
    run = bench.run(**options)
    return bench.run(REPEATED, **options) if run is not None and run.cpu < SHORT else run


def finest(bench: Bench, method: str) -> Measured | None:
    """The run with the smallest tolerance that gets there."""
    for rtol in (1e-14, 1e-13, 1e-12, 1e-11, 1e-10):
        run = bench.run(accuracy=None, rtol=rtol, method=method, max_wall=60.0)
        if run is not None:
            return run
    return None


def race(family: str, peers: Peers, seconds: float) -> Family | None:
    """Everybody on one family; None where nothing is exact enough to judge by."""
    with tempfile.TemporaryDirectory() as folder:
        name, settings, end = sized(family)
        bench = Bench(f"benchmark/{name}", Path(folder), settings=settings)
        end = bench.options.t_end if end is None else end
        bench.options = replace(bench.options, t_end=end, every=end - bench.options.t_start)
        exact, other = finest(bench, "radau") or finest(bench, "dopri"), finest(bench, "bdf")
        if exact is None:
            return None
        names = list(exact.values)
        size = np.array([np.abs(exact.values[name]).max() or exact.nominal[name] for name in names])
        wanted = np.array([exact.values[name][-1] for name in names])

        def error(values: dict[str, float]) -> float:
            worst = float(np.max(np.abs(np.array([values[name] for name in names]) - wanted) / size))
            return worst if math.isfinite(worst) else math.inf

        def ends(run: Measured) -> float:
            return error({name: float(run.values[name][-1]) for name in names})

        ours, single = [], []
        for asked in ASKED:
            run = repeated(bench, accuracy=asked)
            if run is None:
                continue
            ours.append(Entry(f"{run.method} {asked:.1e}", run.cpu, ends(run)))
            if run.cpu > 5.0 * seconds or ours[-1].error < ENOUGH:
                break
        for method in METHODS:
            for rtol in TOLERANCES:
                run = repeated(bench, accuracy=None, rtol=rtol, method=method, max_wall=5.0 * seconds)
                if run is None:
                    continue
                single.append(Entry(f"{method} {rtol:.1e}", run.cpu, ends(run)))
                if run.cpu > seconds or single[-1].error < ENOUGH:
                    break
        found = [] if peers.missing else [
            Entry(who, cpu, error(values)) for who, cpu, values in peers.runs(family, end, seconds)
        ]  # fmt: skip
        return Family(family, ends(other) if other is not None else math.nan, ours, single, found)


HEAD = (
    "| family | target | ours ms (error, method) | one run of ours ms | best SUNDIALS ms (error, settings) | ratio |\n"
    "|---|---|---|---|---|---|"
)


def line(family: Family, target: float) -> tuple[str, float]:
    """One row, and the time of the best peer over ours (nan where one of them has none)."""
    mine, alone, peer = (family.best(runs, target) for runs in (family.ours, family.single, family.peers))

    def cell(run: Entry | None) -> str:
        return "none" if run is None else f"{1e3 * run.cpu:.3g} ({run.error:.0e}, {run.who})"

    ratio = peer.cpu / mine.cpu if mine is not None and peer is not None else math.nan
    return (
        f"| {family.name} | {target:.0e} | {cell(mine)} | {cell(alone)} | {cell(peer)} | {ratio:.2g} |",
        ratio,
    )


def picture(families: list[Family], file: str) -> None:
    """Error over CPU time, one panel a family."""
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot

    columns = min(4, len(families))
    rows = -(-len(families) // columns)
    figure, axes = pyplot.subplots(rows, columns, figsize=(3.6 * columns, 3.0 * rows), squeeze=False)
    for panel in axes.flat[len(families) :]:
        panel.set_visible(False)
    for panel, family in zip(axes.flat, families, strict=False):
        marks = ((family.peers, ".", "SUNDIALS"), (family.single, "x", "ours, --rtol"), (family.ours, "o", "ours"))
        for runs, mark, label in marks:
            good = [run for run in runs if math.isfinite(run.error)]
            error = [max(run.error, 1e-14) for run in good]
            panel.loglog([1e3 * run.cpu for run in good], error, mark, ms=4, label=label)
        panel.set_title(family.name, fontsize=9)
        panel.tick_params(labelsize=7)
    axes[0, 0].legend(fontsize=7)
    figure.supxlabel("CPU (ms)", fontsize=9)
    figure.supylabel("error at the end", fontsize=9)
    figure.tight_layout()
    figure.savefig(file, dpi=110)


def main() -> None:
    """Table, means and picture."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--targets", default="1e-3,1e-6,1e-9")
    parser.add_argument("--seconds", type=float, default=2.0, help="of a run, behind which nothing finer is tried")
    parser.add_argument("--plot")
    parser.add_argument("family", nargs="*")
    given = parser.parse_args()
    targets = [float(a) for a in given.targets.split(",")]
    with tempfile.TemporaryDirectory() as folder:
        peers = Peers(Path(folder))
        if peers.missing:
            print(f"no SUNDIALS (libsundials-dev, libsuitesparse-dev): {peers.missing}; ours alone", file=sys.stderr)
        names = given.family or sorted(p.stem for p in (MODELS / "benchmark").glob("*.sd"))
        found, ratios = [], {target: [] for target in targets}
        print(HEAD, flush=True)
        for name in names:
            family = race(name, peers, given.seconds)
            if family is None:
                print(f"<!-- {name}: no reference -->", flush=True)
                continue
            found.append(family)
            for target in targets:
                text, ratio = line(family, target)
                print(text, flush=True)
                ratios[target].append(ratio)
            print(f"<!-- {name}: reference within {family.doubt:.0e} of our bdf -->", flush=True)
        for target in targets:
            both = np.array([ratio for ratio in ratios[target] if math.isfinite(ratio)])
            if both.size:
                mean = math.exp(np.log(both).mean())
                slower = int((both < 1).sum())
                print(f"{target:.0e}: geometric mean {mean:.2f} over {both.size} families, slower on {slower}")
    if given.plot:
        picture(found, given.plot)


if __name__ == "__main__":
    main()
