"""Runs that a command compares among themselves stay in memory: a file for each names every parameter of the model."""

import shutil

import pytest
from sysdyn.cli.main import run
from sysdyn.runtime.trace.trace_store import Store
from texts import ROOT

LADDER = str(ROOT / "models" / "benchmark" / "rc_ladder.sd")


@pytest.mark.parametrize(
    "asked",
    [
        ("report", LADDER, "-o", "r.html"),
        ("verify", LADDER, "--jobs", "1"),
        ("golden", "record", "ladder.sd", "--folder", "g"),
        ("trade", LADDER, "--jobs", "1", "--accuracy", "1e-2"),
    ],
    ids=lambda item: item[0],
)
def test_no_trace_is_written_for_a_run_that_is_compared(tmp_path, monkeypatch, asked):
    made, create = [], Store.__init__
    monkeypatch.setattr(Store, "__init__", lambda own, path, *given: (made.append(path), create(own, path, *given))[1])
    monkeypatch.chdir(tmp_path)
    shutil.copy(LADDER, "ladder.sd")
    assert run([*asked, "--set", "n=20"] if asked[0] != "golden" else [*asked]) == 0
    assert [path.name for path in made if "reference" not in path.name] == []  # which a journal of trade keeps
