"""Ours against the best of the field, one table: python tests/bench/field.py [--long] [--kept FILE] [PROBLEM...]

A row a problem and target: the cheapest run of either side whose achieved error meets it.  Ours with --accuracy (all
its runs and their comparison count), and one run with --rtol.  Peers: of the models of models/benchmark the best that
was recorded (RECORDED), its time multiplied by what SUNDIALS' BDF takes here over what it took there, both on the same
problem (race.py; ladders on a text of one unknown a node, peers/ladder.c) - `~` where it got there on one side only:
by the median of the others; of grids IDA with KLU, of netlists ngspice, measured here in the same minute.  Errors:
race.py's and netlists.py's; of a ladder's last voltage at the end, of a grid's the largest at ten instants.  A row
without a time says who did not get there.  Means: geometric, of ratios of times, with each row's own scale and with
the median for all.
--long: the ring modulator, the beam, the largest ladder, the swing of 1000 s too.  --kept: what was measured before is
read from there and what is new added.
"""

from __future__ import annotations

import argparse
import json
import math
import re
import sys
import tempfile
from dataclasses import asdict, dataclass, replace
from pathlib import Path

import netlists
import numpy as np
from measuring import MODELS, Bench, Measured
from price import TOLERANCES
from race import ASKED, SHORT, Entry, Family, Peers, race, repeated
from steps import GRID, INSTANTS, SIZES, Peer
from sysdyn.api import simulate
from sysdyn.cli.main import run as command

TARGETS = (1e-3, 1e-6)
SECONDS = 2.0
"""Of a run, behind which nothing finer is tried."""
QUARTERS = tuple(10.0 ** (-0.25 * k) for k in range(6, 37))
"""Tolerances of IDA on a line's own text."""
SMALL = 100
"""Unknowns up to which a problem is small."""


@dataclass(frozen=True, slots=True)
class Recorded:
    """Of one problem, by its best formulation: unknowns, then of each target the CPU ms of the best SUNDIALS BDF run
    (nan: none got there, or none here that is alike) and of the best of RADAU5, RADAU, RODAS, MEBDFI, DOP853 and IDA,
    named, all driven by experts on equations reduced by hand.
    """

    n: int
    coarse: tuple[float, float, str]
    fine: tuple[float, float, str]


RECORDED = {
    "pendulum": Recorded(5, (0.99, 0.024, "DOP853"), (2.21, 0.065, "DOP853")),
    "pendulum@1000": Recorded(5, (1020.0, 13.0, "DOP853"), (math.nan, math.nan, "")),
    "andrews": Recorded(27, (1.92, 0.29, "DOP853"), (5.32, 0.69, "DOP853")),
    "caraxis": Recorded(10, (2.7, 0.19, "DOP853"), (10.9, 0.35, "DOP853")),
    "crank": Recorded(24, (16.8, 5.8, "RADAU"), (math.nan, 10.8, "RADAU")),
    "fourbar": Recorded(22, (6.3, 6.3, "IDA"), (math.nan, math.nan, "")),
    "transistor": Recorded(8, (8.82, 0.92, "RODAS"), (27.0, 2.38, "MEBDFI")),
    "ring": Recorded(15, (1460.0, 133.0, "RADAU"), (6940.0, 181.0, "RADAU")),
    "akzo": Recorded(6, (0.14, 0.042, ""), (0.41, 0.066, "")),
    "hires": Recorded(8, (0.58, 0.060, "RODAS"), (1.12, 0.19, "RADAU")),
    "oregonator": Recorded(3, (1.2, 0.22, "RODAS"), (4.7, 0.36, "RADAU")),
    "vdpol": Recorded(2, (1.14, 0.093, "RODAS"), (3.34, 0.27, "RADAU")),
    "rober": Recorded(3, (0.47, 0.050, "RODAS"), (0.97, 0.16, "RADAU5")),
    "tube": Recorded(49, (16.6, 4.1, "RADAU5"), (57.6, 25.0, "MEBDFI")),
    "beam": Recorded(80, (84.5, 8.8, "RADAU"), (929.0, 84.0, "DOP853")),
    "rc_ladder:100": Recorded(100, (0.63, 0.25, "RADAU"), (2.83, 0.42, "RADAU")),
    "rc_ladder:1000": Recorded(1000, (6.67, 2.1, "RADAU5"), (24.1, 5.4, "RADAU5")),
    "rc_ladder:10000": Recorded(10000, (60.8, 25.0, "RADAU"), (239.0, 32.0, "RADAU")),
    "nltl:1000": Recorded(1000, (math.nan, 2.76, "RADAU"), (math.nan, 6.20, "RADAU")),
    "lc_line:100": Recorded(200, (math.nan, 1.34, "RADAU"), (math.nan, 2.7, "RADAU")),
}
HERE = ("IDA-KLU", "ngspice", "SUNDIALS")
"""Peers that are measured here."""
LONG = ("pendulum@1000", "ring", "beam", "rc_ladder:10000", "grid:100")
REACHED = "v[n/2].e as y_mid, v[n].e as y_end", "v[1].e as y_end"
"""What is traced of the nonlinear line: of 1000 sections the current reaches the first ones."""
GRIDS = ("grid:10", "grid:20", "grid:30", "grid:60", "grid:100")
NETLISTS = tuple(f"{path.stem}.cir" for path in sorted(netlists.NETLISTS.glob("*.cir")))


def on_own_text(problem: str, folder: Path) -> Family:
    """A ladder or grid beside IDA with KLU on a text of one unknown a node, the nonlinear line alone."""
    name, _, n = problem.partition(":")
    written = GRID.read_text() if name == "grid" else (MODELS / "benchmark" / f"{name}.sd").read_text()
    (folder / f"{name}.sd").write_text(written.replace(*REACHED) if name == "nltl" else written)
    text, size = SIZES.get(name, (None, 0.0))
    bench = Bench(str(folder / name), folder, settings=(("n", n),))
    span = bench.options.t_end - bench.options.t_start
    instants = INSTANTS if name == "grid" else INSTANTS[-1:]
    bench.options = replace(bench.options, every=span, at=tuple(instants))

    def values(run: Measured) -> np.ndarray:
        return np.interp(instants, run.time, run.values["y_end"])

    finest = bench.run(accuracy=None, rtol=1e-12, method="radau", max_wall=100.0)
    if finest is None:
        raise RuntimeError("no reference")
    exact, sides = values(finest), ([], [])
    size = size or float(np.abs(exact).max())
    asked = [{"accuracy": a} for a in ASKED], [
        {"accuracy": None, "rtol": rtol, "method": method} for method in ("bdf", "radau") for rtol in TOLERANCES
    ]  # fmt: skip
    for found, settings in zip(sides, asked, strict=True):
        done = None
        for options in settings:
            if done == options.get("method", "auto"):
                continue
            run = repeated(bench, **options)
            if run is None:
                continue
            error = float(np.abs(values(run) - exact).max() / size)
            found.append(Entry(f"{run.method} {options.get('accuracy') or options['rtol']:.1e}", run.cpu, error))
            if run.cpu > SECONDS or error < 0.1 * min(TARGETS):
                done = options.get("method", "auto")
    peer, theirs = Peer(text, folder) if text is not None else None, []
    for policy in ("0.25", "0.01") if peer is not None and peer.program is not None else ():
        for rtol in QUARTERS:
            cpu, steps, ends = peer.run(int(n), rtol, policy, 1)
            if cpu < SHORT:
                cpu = min(cpu, peer.run(int(n), rtol, policy)[0])
            error = float(np.abs(ends[-exact.size :] - exact).max() / size) if steps > 0 else math.inf
            theirs.append(Entry(f"ida own text {rtol:.1e} {policy}", cpu, error))
            if cpu > SECONDS or error < 0.1 * min(TARGETS):
                break
    return Family(problem, math.nan, *sides, theirs)


def of_netlist(problem: str, folder: Path) -> tuple[Family, int]:
    """A netlist beside ngspice, and its number of nodes."""
    path, model = netlists.NETLISTS / problem, folder / "model.sd"
    text = path.read_text()
    if command(["import", str(path), "-o", str(model), "--quiet"]):
        raise RuntimeError("it cannot be imported")
    nodes = sum(len(line.split(",")) for line in re.findall(r"(?m)^ *node (.*):", model.read_text()))
    least = min(TARGETS)
    finest = simulate(model, accuracy=max(1e-3 * least, 1e-8), unmet="warn", scene="tran", output=folder / "f.h5")
    names = netlists.shown(text)
    sides = [
        [Entry(f"{one.setting:.1e}", one.time, one.error) for one in found]
        for found in (
            netlists.ours(model, names, finest, least, folder),
            netlists.ours(model, names, finest, least, folder, "rtol"),
            netlists.theirs(text, finest, least, folder),
        )
    ]
    return Family(problem, math.nan, *sides), nodes


@dataclass(frozen=True, slots=True)
class Measurement:
    """What one problem was measured to take.  n: unknowns; failed: why nothing was."""

    family: Family
    n: int
    failed: str = ""


def measured(problem: str, peers: Peers) -> Measurement:
    """Everybody on one problem."""
    n = RECORDED[problem].n if problem in RECORDED else 0
    with tempfile.TemporaryDirectory() as folder:
        try:
            if problem in NETLISTS:
                return Measurement(*of_netlist(problem, Path(folder)))
            if problem.startswith(("grid:", "rc_ladder:", "nltl:")):
                side = int(problem.partition(":")[2])
                return Measurement(on_own_text(problem, Path(folder)), n or side * side)
            family = race(problem, peers, SECONDS)
            if family is not None:
                return Measurement(family, n)
            why = "no reference is exact enough to judge by"
        except Exception as error:  # a row that fails is told
            why = f"{type(error).__name__}: {error}"
    return Measurement(Family(problem, math.nan, [], [], []), n, why)


def read(text: str) -> dict[str, Measurement]:
    """What was kept."""
    found = {}
    for name, one in json.loads(text).items():
        runs = {side: [Entry(**run) for run in one["family"][side]] for side in ("ours", "single", "peers")}
        found[name] = Measurement(Family(name, one["family"]["doubt"], **runs), one["n"], one["failed"])
    return found


@dataclass(frozen=True, slots=True)
class Row:
    """One line of the table, times in ms (nan: nobody got there).  recorded: of the best peer in the record, or here;
    sundials, then: of SUNDIALS' BDF here and in the record (nan: not to be compared).
    """

    one: Measurement
    target: float
    peer: str
    recorded: float
    sundials: float
    then: float
    accuracy: float
    single: float

    @property
    def scale(self) -> float:
        """Of this machine over the record's, by SUNDIALS."""
        return self.sundials / self.then if self.peer not in HERE else 1.0

    def best(self, usual: float, *, own: bool) -> float:
        """The best peer's time here; usual: scale of rows without one, and of all where own ones are not wanted."""
        if self.peer in HERE:
            return self.recorded
        return self.recorded * (self.scale if own and math.isfinite(self.scale) else usual)


def row(one: Measurement, target: float) -> Row:
    """Of one problem and target."""
    family = one.family

    def least(runs: list[Entry]) -> float:
        found = family.best(runs, target)
        return 1e3 * found.cpu if found is not None else math.nan

    ours = least(family.ours), least(family.single)
    sundials = least([run for run in family.peers if not run.who.startswith("adams")])
    record = RECORDED.get(family.name)
    if record is None:
        who = "ngspice" if family.name in NETLISTS else "IDA-KLU"
        return Row(one, target, who, sundials, math.nan, math.nan, *ours)
    then, best, who = record.coarse if target == TARGETS[0] else record.fine
    if math.isnan(best):  # nobody was recorded
        return Row(one, target, "SUNDIALS", sundials, sundials, math.nan, *ours)
    return Row(one, target, who, best, sundials, then, *ours)


HEAD = (
    f"{'problem':16s} {'n':>6s} {'target':>6s} {'best peer':>10s} {'ms':>8s} {'SUNDIALS':>9s} {'accuracy':>9s}"
    f" {'single':>8s} {'ratio':>7s} {'single':>7s}"
)


def shown(row: Row, usual: float) -> str:
    """One line."""
    best = row.best(usual, own=True)
    about = "~" if math.isfinite(best) and not math.isfinite(row.scale) else " "

    def cell(value: float, width: int) -> str:
        return f"{value:{width}.3g}" if math.isfinite(value) else f"{'-':>{width}s}"

    lacking = [
        who
        for who, ms in ((row.peer or "no peer", best), ("--accuracy", row.accuracy), ("a run with --rtol", row.single))
        if not math.isfinite(ms)
    ]
    told = f"  {row.one.failed or ', '.join(lacking) + ': none gets there'}" if lacking else ""
    return (
        f"{row.one.family.name:16s} {row.one.n:6d} {row.target:6.0e} {row.peer:>10s} {cell(best, 8)}{about}"
        f"{cell(row.sundials, 9)} {cell(row.accuracy, 9)} {cell(row.single, 8)}"
        f" {cell(best / row.accuracy, 7)} {cell(best / row.single, 7)}{told}"
    )


def mean(ratios: list[float]) -> str:
    """Geometric, of those that there are, and their number."""
    known = [ratio for ratio in ratios if math.isfinite(ratio)]
    return f"{math.exp(np.log(known).mean()):.2f} ({len(known)})" if known else "none"


def means(rows: list[Row], usual: float) -> list[str]:
    """Lines of geometric means: of groups of rows, with each row's own scale, then with the median for all."""
    groups = {
        "all": lambda row: True,
        f"up to {SMALL} unknowns": lambda row: row.one.n <= SMALL,
        f"above {SMALL}": lambda row: row.one.n > SMALL,
        "recorded peers": lambda row: row.one.family.name in RECORDED,
        "grids": lambda row: row.peer == "IDA-KLU",
        "netlists": lambda row: row.peer == "ngspice",
        "all but netlists": lambda row: row.peer != "ngspice",
    }
    lines = [f"{'geometric mean':22s} {'accuracy':>12s} {'single':>12s} {'one scale':>12s} {'single':>12s}"]
    for name, within in groups.items():
        some = [row for row in rows if within(row)]
        cells = [
            mean([row.best(usual, own=own) / getattr(row, side) for row in some])
            for own in (True, False)
            for side in ("accuracy", "single")
        ]
        lines.append(f"{name:22s} " + " ".join(f"{cell:>12s}" for cell in cells))
    return lines


def main() -> None:
    """The table and the means."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--long", action="store_true")
    parser.add_argument("--kept", type=Path)
    parser.add_argument("problem", nargs="*")
    given = parser.parse_args()
    every = (*RECORDED, *GRIDS, *NETLISTS)
    asked = given.problem or [name for name in every if given.long or name not in LONG]
    known = read(given.kept.read_text()) if given.kept and given.kept.exists() else {}
    with tempfile.TemporaryDirectory() as folder:
        peers = Peers(Path(folder))
        if peers.missing:
            print(f"no SUNDIALS (libsundials-dev, libsuitesparse-dev): {peers.missing}", file=sys.stderr)
        for name in asked:
            if name in known:
                continue
            print(f"{name} ...", file=sys.stderr, flush=True)
            known[name] = measured(name, peers)
            if given.kept:
                given.kept.write_text(json.dumps({name: asdict(one) for name, one in known.items()}))
    for target in TARGETS:
        rows = [row(known[name], target) for name in asked]
        scales = [row.scale for row in rows if row.peer not in HERE and math.isfinite(row.scale)]
        usual = float(np.median(scales)) if scales else 1.0
        print(HEAD, *(shown(row, usual) for row in rows), sep="\n")
        least, most = min(scales, default=1.0), max(scales, default=1.0)
        print(f"SUNDIALS here over the record: median {usual:.2f}, {least:.2f} to {most:.2f}")
        print(*means(rows, usual), "", sep="\n")


if __name__ == "__main__":
    main()
