"""Texts and models under a scene, run to their traces."""

from sysdyn.cli.run.request.run_request import RunRequest
from sysdyn.cli.run.running import run
from sysdyn.dsl.text.diagnostics import Report
from sysdyn.runtime.trace.trace import Trace

FOUR = ("lagrangian", "hamiltonian", "co_lagrangian", "co_hamiltonian")


def attempt(tmp_path, text, **options):
    """What a run of a text (or of a file) came to, and the report; None where it did not start."""
    path = text
    if "\n" in str(text):
        path = tmp_path / "model.sd"
        path.write_text(text)
    report = Report()
    options = {"max_wall": "60", "output": str(tmp_path / "trace.h5"), **options}
    return run(RunRequest(str(path), **options), report), report


def trace_of(tmp_path, text, **options):
    """The trace of a run that must succeed."""
    ran, report = attempt(tmp_path, text, **options)
    assert ran is not None, [f"{d.code} {d.message}" for d in report]
    said = [f"{d.code} {d.message}" for d in report]
    assert ran.exit == 0, (ran.failure, said, [c for c in ran.claims if not c.ok])
    return Trace.open(tmp_path / "trace.h5")
