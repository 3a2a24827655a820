"""What large models ask for."""

import subprocess
import sys

import pytest
from reduced import ROOT
from sysdyn.api import compile_model
from sysdyn.cli.main import run
from sysdyn.dsl.model import budget

LINE = ROOT / "models" / "gallery" / "transmission_line.sd"
ROOM = 2 << 30
"""Bytes of address space: the first step of 10000 sections takes a fifth of a gigabyte, of memory, libraries apart."""


PROGRAM = f"""
import resource, sys
resource.setrlimit(resource.RLIMIT_AS, ({ROOM}, {ROOM}))
from sysdyn.cli.main import run
sys.exit(run(sys.argv[1:]))
"""


def test_a_step_of_ten_thousand_sections_is_no_matter_of_gigabytes(tmp_path):
    """A basis of the projection that filled far more than its matrix took 3.3 GB here, and 22 GB of 100000 sections."""
    asked = ["simulate", str(LINE), "--set", "n=10000", "--max-steps", "1", "--json", "-o", str(tmp_path / "t.h5")]
    done = subprocess.run([sys.executable, "-c", PROGRAM, *asked], capture_output=True, text=True, check=False)
    assert done.returncode == 3
    assert "the limit of steps is reached" in done.stdout


KEPT = 3200
"""Bytes a section that arrays and objects of Python may take at once, beside what the core allocates: 2500 today."""
TRACED = """
import sys, tracemalloc
from sysdyn.cli.main import run
tracemalloc.start()
run(sys.argv[1:])
print(tracemalloc.get_traced_memory()[1])
"""


def test_a_section_of_a_large_line_takes_few_bytes_to_the_first_step(tmp_path):
    """What a start, a structure and a form left out hold is let go before the next is made: 4000 bytes without that."""

    def peak(sections):
        step = ("--set", f"n={sections}", "--max-steps", "1", "-o", str(tmp_path / "t.h5"))
        asked = [sys.executable, "-c", TRACED, "simulate", str(LINE), "--quiet", *step]
        done = subprocess.run(asked, capture_output=True, text=True, check=True)
        return int(done.stdout.split()[-1])

    assert peak(50_000) - peak(25_000) < KEPT * 25_000


@pytest.mark.parametrize("sections", [10, 60])
def test_the_index_does_not_depend_on_the_size(tmp_path, sections):
    """2, by singular values and by growth: of sections as fast as 1e10 rad/s."""
    path = tmp_path / "line.sd"
    path.write_text(LINE.read_text().replace("param n = 100000", f"param n = {sections}"))
    module = compile_model(str(path), backend="numpy")
    assert module.manifest["index"] == 2
    assert not any(unknown["kind"] == "nu" for unknown in module.manifest["unknowns"])


def test_a_run_that_there_is_no_memory_for_is_not_begun(tmp_path, capsys, monkeypatch):
    """E119 with what it needs."""
    path = tmp_path / "line.sd"
    path.write_text(LINE.read_text().replace("param n = 100000", "param n = 1000"))
    monkeypatch.setattr(budget, "there", lambda: 8 << 20)
    monkeypatch.setattr(budget, "granted", lambda: 8 << 20)
    assert run(["check", str(path)]) == 0
    capsys.readouterr()
    assert run(["simulate", str(path), "-o", str(tmp_path / "t.h5")]) == 1
    said = capsys.readouterr().err
    assert "E119" in said
    assert f"needs {budget.shown(5002 * budget.STEPPED)}" in said
