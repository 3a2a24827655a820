"""Netlists here and in ngspice, at equal error: python tests/bench/netlists.py [--target A] [NAME...]

Error: largest difference from a run of ours at a thousandth of the target, over the largest value, of everything that
`.print` shows, at the instants of `.tran`.  Of either the cheapest run whose error is within the target (`!`: none is):
ours over --accuracy by half decades, `cpu_integrate_s` with all its runs; ngspice's over reltol by decades (abstol and
vntol follow), the CPU of its own "Total analysis time"; the least of three of both.
"""

from __future__ import annotations

import argparse
import re
import resource
import subprocess
import sys
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from sysdyn.api import load, simulate
from sysdyn.cli.main import run
from sysdyn.runtime.model.failures import SolverFailure

NETLISTS = Path(__file__).parents[1] / "cli" / "netlists"
TIMES = 3
DECADES, HALVES = range(3, 10), range(2, 17)


def shown(text: str) -> list[str]:
    """What a netlist prints."""
    return re.search(r"(?im)^\.print tran (.*)$", text)[1].split()  # type: ignore[index]


def ngspice(text: str, reltol: float, folder: Path) -> tuple[float, Any] | None:
    """CPU of its analysis [s] and its table; None where it gives up.  The time that it tells is the clock's, of which
    its process has a part where others work.
    """
    body = re.sub(r"(?im)^\.(print.*|end)$", "", text).rstrip()
    options = f"reltol={reltol:g} abstol={1e-9 * reltol:g} vntol={1e-3 * reltol:g} chgtol=1e-18 method=gear maxord=4"
    control = "set wr_singlescale\nset wr_vecnames\nset numdgt=12\nrun\nrusage all\nlinearize\n"
    (folder / "n.cir").write_text(
        f"{body}\n.options {options}\n.control\n{control}wrdata n.txt {' '.join(shown(text))}\nquit\n.endc\n.end\n"
    )
    best = np.inf
    (folder / "n.txt").unlink(missing_ok=True)
    for _ in range(TIMES):
        clock, cpu = time.perf_counter(), resource.getrusage(resource.RUSAGE_CHILDREN)
        call = subprocess.run(
            ["ngspice", "-b", "n.cir"], cwd=folder, capture_output=True, text=True, errors="replace", check=False
        )
        clock, spent = time.perf_counter() - clock, resource.getrusage(resource.RUSAGE_CHILDREN)
        part = min((spent.ru_utime + spent.ru_stime - cpu.ru_utime - cpu.ru_stime) / clock, 1.0)
        found = re.search(r"Total analysis time \(seconds\) = ([\d.eE+-]+)", call.stdout + call.stderr)
        if found is None or not (folder / "n.txt").exists():
            return None
        best = min(best, part * float(found[1]))
    try:
        table = np.loadtxt(folder / "n.txt", skiprows=1)
    except ValueError:  # values beyond its format
        return None
    return best, table


def values(trace: Any, names: list[str], instants: Any) -> Any:
    """Of a trace at instants [k, names]."""
    columns = []
    for name in names:
        kind, what = re.fullmatch(r"(?i)([vi])\((\w+)\)", name).groups()  # type: ignore[union-attr]
        columns.append(np.interp(instants, trace.time, np.asarray(trace[f"{kind}_{what}".lower()])))
    return np.array(columns).T


def error(found: Any, reference: Any) -> float:
    """Largest difference over the largest value."""
    return float((np.abs(found - reference).max(axis=0) / np.abs(reference).max(axis=0)).max())


@dataclass(frozen=True, slots=True)
class Found:
    """The cheapest run of one side: time (s), error, setting; met: its error is within the target, else the nearest."""

    time: float
    error: float
    setting: float
    met: bool


def cheapest(found: list[Found]) -> Found | None:
    """Of those within the target, else the nearest; None of none."""
    within = [one for one in found if one.met]
    return min(within, key=lambda one: one.time) if within else min(found, key=lambda one: one.error, default=None)


def ours(
    model: Path, names: list[str], finest: Any, target: float, folder: Path, asked: str = "accuracy"
) -> list[Found]:
    """Runs with --accuracy (or --rtol), by half decades, as far as two behind the first that is within."""
    reference, found = values(finest, names, finest.time), []
    loaded = load(model, scene="tran")
    for setting in (10.0 ** (-0.5 * half) for half in HALVES):
        if sum(one.met for one in found) == 3:
            break
        try:
            runs = [loaded.run(unmet="warn", output=folder / "t.h5", **{asked: setting}) for _ in range(TIMES)]
        except SolverFailure:
            continue
        apart = error(values(runs[0], names, finest.time), reference)
        least = min(trace.timings["cpu_integrate_s"] for trace in runs)
        found.append(Found(least, apart, setting, apart <= target))
    return found


def theirs(text: str, finest: Any, target: float, folder: Path) -> list[Found]:
    """Runs of ngspice, by decades, as far as two behind the first that is within."""
    found: list[Found] = []
    for decade in DECADES:
        run_ = ngspice(text, 10.0**-decade, folder)
        if run_ is None or not np.isclose(run_[1][-1, 0], finest.time[-1], rtol=1e-6):
            continue
        apart = error(run_[1][:, 1:], values(finest, shown(text), run_[1][:, 0]))
        found.append(Found(run_[0], apart, 10.0**-decade, apart <= target))
        if sum(one.met for one in found) == 3:
            break
    return found


def row(name: str, target: float, folder: Path) -> tuple[str, float]:
    """One line of the table, and the ratio of times (NaN where one of the two did not get there)."""
    path, model = NETLISTS / f"{name}.cir", folder / "model.sd"
    text = path.read_text()
    if run(["import", str(path), "-o", str(model), "--quiet"]):
        return f"{name:10s} cannot be imported", np.nan
    finest = simulate(model, accuracy=max(1e-3 * target, 1e-9), unmet="warn", scene="tran", output=folder / "f.h5")
    sides = cheapest(ours(model, shown(text), finest, target, folder)), cheapest(theirs(text, finest, target, folder))
    line, both = f"{name:10s}", all(side is not None and side.met for side in sides)
    for side in sides:
        met = "" if side is None or side.met else " !"
        told = "gives up" if side is None else f"{1e3 * side.time:9.1f} {side.error:8.1e} {side.setting:7.1e}{met:2s}"
        line += f"  {told:28s}"
    ratio = sides[1].time / sides[0].time if both else np.nan
    return f"{line} {ratio:7.2f}", ratio


def main() -> int:
    """The table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("names", nargs="*", default=sorted(p.stem for p in NETLISTS.glob("*.cir")))
    parser.add_argument("--target", type=float, default=1e-4)
    asked = parser.parse_args()
    head = f"{'netlist':10s}  {'ours, ms':>9s} {'error':>8s} {'asked':>7s}"
    print(f"{head}    {'ngspice':>9s} {'error':>8s} {'reltol':>7s}   theirs/ours")
    ratios = []
    for name in asked.names:
        with tempfile.TemporaryDirectory() as folder:
            line, ratio = row(name, asked.target, Path(folder))
        ratios.append(ratio)
        print(line, flush=True)
    known = np.array(ratios)[np.isfinite(ratios)]
    print(f"geometric mean of {known.size}: {np.exp(np.log(known).mean()):.2f}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
