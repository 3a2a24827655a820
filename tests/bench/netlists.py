"""Netlists here and in ngspice, at equal accuracy: python tests/bench/netlists.py [--accuracy A] [NAME...]

Error: largest difference from a run of ours at a thousandth of the accuracy, over the largest value, of everything that
`.print` shows, at the instants of `.tran`.  ngspice: the loosest reltol (by decades, with abstol and vntol that follow)
whose error is within the accuracy; its time is its own "Total analysis time".  Ours: `cpu_integrate_s` of a run with
--accuracy (its draft counts), the least of three of both.
"""

from __future__ import annotations

import argparse
import re
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

import numpy as np
from sysdyn.api import simulate
from sysdyn.cli.main import run

NETLISTS = Path(__file__).parents[1] / "cli" / "netlists"
TIMES = 3
DECADES = range(3, 10)


def shown(text: str) -> list[str]:
    """What a netlist prints."""
    return re.search(r"(?im)^\.print tran (.*)$", text)[1].split()  # type: ignore[index]


def ngspice(text: str, reltol: float, folder: Path) -> tuple[float, Any] | None:
    """Its analysis time [s] and its table; None where it gives up."""
    body = re.sub(r"(?im)^\.(print.*|end)$", "", text).rstrip()
    options = f"reltol={reltol:g} abstol={1e-9 * reltol:g} vntol={1e-3 * reltol:g} chgtol=1e-18 method=gear maxord=4"
    control = "set wr_singlescale\nset wr_vecnames\nset numdgt=12\nrun\nrusage all\nlinearize\n"
    (folder / "n.cir").write_text(
        f"{body}\n.options {options}\n.control\n{control}wrdata n.txt {' '.join(shown(text))}\nquit\n.endc\n.end\n"
    )
    best = np.inf
    (folder / "n.txt").unlink(missing_ok=True)
    for _ in range(TIMES):
        call = subprocess.run(
            ["ngspice", "-b", "n.cir"], cwd=folder, capture_output=True, text=True, errors="replace", check=False
        )
        found = re.search(r"Total analysis time \(seconds\) = ([\d.eE+-]+)", call.stdout + call.stderr)
        if found is None or not (folder / "n.txt").exists():
            return None
        best = min(best, float(found[1]))
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


def row(name: str, accuracy: float, folder: Path) -> str:
    """One line of the table."""
    path, model = NETLISTS / f"{name}.cir", folder / "model.sd"
    text = path.read_text()
    if run(["import", str(path), "-o", str(model), "--quiet"]):
        return f"{name:10s} cannot be imported"
    options = {"scene": "tran", "output": folder / "t.h5"}
    runs = [simulate(model, accuracy=accuracy, **options) for _ in range(TIMES)]
    ours = min(trace.timings["cpu_integrate_s"] for trace in runs)
    finest = simulate(model, accuracy=max(1e-3 * accuracy, 1e-9), unmet="warn", **options)
    theirs, own, nearest = "gives up", np.nan, np.inf
    for decade in DECADES:
        found = ngspice(text, 10.0**-decade, folder)
        if found is None or not np.isclose(found[1][-1, 0], finest.time[-1], rtol=1e-6):
            continue
        reference = values(finest, shown(text), found[1][:, 0])
        own = error(values(runs[0], shown(text), found[1][:, 0]), reference)
        apart = error(found[1][:, 1:], reference)
        met = apart <= max(accuracy, 2.0 * own)
        if met or apart < nearest:
            mark = "" if met else "  (not within)"
            theirs = f"{1e3 * found[0]:9.1f} {apart:8.1e} {10.0**-decade:7.0e}  {found[0] / ours:7.2f}{mark}"
            nearest = apart
        if met:
            break
    return f"{name:10s} {1e3 * ours:9.1f} {own:8.1e}  {theirs}"


def main() -> int:
    """The table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("names", nargs="*", default=sorted(p.stem for p in NETLISTS.glob("*.cir")))
    parser.add_argument("--accuracy", type=float, default=1e-4)
    asked = parser.parse_args()
    head = f"{'netlist':10s} {'ours, ms':>9s} {'error':>8s}"
    print(f"{head}  {'ngspice':>9s} {'error':>8s} {'reltol':>7s}  theirs/ours")
    for name in asked.names:
        with tempfile.TemporaryDirectory() as folder:
            print(row(name, asked.accuracy, Path(folder)), flush=True)
    return 0


if __name__ == "__main__":
    sys.exit(main())
