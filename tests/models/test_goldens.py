"""The project's own goldens (tests/golden): every seed and benchmark model against its kept trace.

Always: each golden in one of its formulations, in turn.  SYSDYN_LONG=1: every formulation by both methods, and by the
NumPy backend.
"""

import json
import os
from pathlib import Path

import pytest
from sysdyn.cli.golden import book
from sysdyn.cli.main import run

ROOT = Path(__file__).resolve().parents[2]
FOLDER = ROOT / "tests" / "golden"
LONG = bool(os.environ.get("SYSDYN_LONG"))
GOLDENS = book.find(FOLDER) if FOLDER.is_dir() else ()
CHECKED = {p.stem for p in ROOT.glob("models/benchmark/*.sd")} - {"andrews"}
"""Families whose published ends are checked instead (test_benchmark.py, tests/extremes): a golden of a stiff one takes
minutes."""
JUMPS = ("bouncing_ball", "coulomb_planar_stop")
"""Traced flows or efforts jump at instants that depend on the run: kept by references.json (test_event_seed.py)."""
SIZE = 3_000_000
"""Bytes of all goldens together."""


@pytest.fixture(autouse=True)
def _at_the_root(monkeypatch):
    monkeypatch.chdir(ROOT)


def checked(capsys, *arguments):
    """The exit code and what `golden check` found."""
    code = run(["golden", "check", *arguments, "--folder", str(FOLDER), "--json"])
    return code, json.loads(capsys.readouterr().out)


def test_every_model_has_one():
    known = {g.model.resolve() for g in GOLDENS}
    wanted = {*ROOT.glob("models/seed/*.sd"), *ROOT.glob("models/benchmark/*.sd")}
    wanted -= {ROOT / f"models/benchmark/{name}.sd" for name in CHECKED}
    wanted -= {ROOT / f"models/seed/{name}.sd" for name in JUMPS}
    assert wanted <= known, sorted(p.stem for p in wanted - known)


def test_they_are_small():
    files = [p for p in FOLDER.rglob("*") if p.is_file()]
    assert sum(p.stat().st_size for p in files) < SIZE


@pytest.mark.parametrize(("golden", "turn"), [(g, k) for k, g in enumerate(GOLDENS)], ids=[g.label for g in GOLDENS])
@pytest.mark.one_in(77)
def test_golden(golden, turn, capsys):
    runs = [["--formulation", golden.formulations[turn % len(golden.formulations)]]]
    if LONG:
        runs = [["--method", "bdf", "--method", "radau"], ["--backend", "numpy"]]
    for options in runs:
        code, found = checked(capsys, golden.label, *options)
        assert code == 0, json.dumps(found["result"], indent=1)[:4000]
        assert found["result"]["checks"]
