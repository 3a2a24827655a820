"""What large models ask for."""

import ctypes
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


LADDER = ROOT / "models" / "benchmark" / "rc_ladder.sd", "--method", "bdf"
SECTIONS = ROOT / "models" / "benchmark" / "lc_line.sd", "--method", "radau"
KEPT = 1050
"""Bytes a section that arrays and objects of Python may take at once, beside what the core allocates: 1004 today."""
TRACED = """
import sys, tracemalloc
from sysdyn.cli.main import run
tracemalloc.start()
run(sys.argv[1:])
print(tracemalloc.get_traced_memory()[1])
"""
HELD = """
import ctypes, sys
from sysdyn.cli.main import run
from sysdyn.runtime.integrate.integrate import Integration

class Info(ctypes.Structure):
    _fields_ = [(f"field{k}", ctypes.c_size_t) for k in range(10)]

library = ctypes.CDLL(None)
library.mallinfo2.restype = Info
advance = Integration._advance

def noted(self, *given):
    try:
        advance(self, *given)
    finally:
        found = library.mallinfo2()
        print(found.field4 + found.field7)  # in pages of their own, and others in use

Integration._advance = noted
run(sys.argv[1:])
"""

CROSSED = """
import ctypes, sys
from sysdyn.cli.main import run
from sysdyn.runtime.integrate import integrate
from sysdyn.runtime.integrate.weights import sizes

class Info(ctypes.Structure):
    _fields_ = [(f"field{k}", ctypes.c_size_t) for k in range(10)]

library = ctypes.CDLL(None)
library.mallinfo2.restype = Info
noise, integrate.STAGED = sizes.noise, 0  # stages as of a larger one

def noted(*given):
    found = library.mallinfo2()
    print(found.field4 + found.field7)
    return noise(*given)

sizes.noise = noted
run(sys.argv[1:])
"""

ENDED = """
import sys, tracemalloc
from sysdyn.cli.main import run
from sysdyn.runtime.integrate.integrate import Integration

advance, whole = Integration._advance, Integration.run

def noted(self, *given):
    found = advance(self, *given)
    tracemalloc.reset_peak()
    return found

def ran(self, *given):
    found = whole(self, *given)
    print(tracemalloc.get_traced_memory()[1])
    return found

Integration._advance, Integration.run = noted, ran
tracemalloc.start()
run(sys.argv[1:])
"""


def _bytes(program, tmp_path, model, *options, sections):
    """What a program says of a run, a section more."""

    def said(number):
        asked = [str(item) for item in ("simulate", model, *options, "--quiet", "--set", f"n={number}")]
        command = [sys.executable, "-c", program, *asked, "-o", str(tmp_path / "t.h5")]
        done = subprocess.run(command, capture_output=True, text=True, check=True)
        return next(int(word) for word in reversed(done.stdout.split()) if word.isdigit())

    return (said(sections[1]) - said(sections[0])) / (sections[1] - sections[0])


@pytest.mark.parametrize("model", [LADDER, SECTIONS, (LINE,)], ids=["ladder", "sections", "line"])
@pytest.mark.long
def test_a_section_of_a_large_line_takes_few_bytes_to_the_first_step(tmp_path, model):
    """What a start, a structure and a form left out hold is let go before the next is made: 4000 bytes without that;
    1920 of a line, 2220 of a ladder where stages keep what they need no more, and lists name each of their places; 1530
    where the start held patterns and masks that its search does not read, and its rows' right sides twice; 1390 where
    it named the column of each entry, and forms that leave unknowns out were made side by side.
    """
    assert _bytes(TRACED, tmp_path, *model, "--max-steps", "1", sections=(10_000, 25_000)) < KEPT


@pytest.mark.skipif(not hasattr(ctypes.CDLL(None), "mallinfo2"), reason="needs glibc's mallinfo2")
@pytest.mark.parametrize(
    ("model", "sections", "most"),
    [(LADDER, (25_000, 50_000), 760), (SECTIONS, (55_000, 75_000), 960)],
    ids=["ladder", "sections"],
)
@pytest.mark.long
def test_a_section_of_a_run_holds_few_bytes(tmp_path, model, sections, most):
    """Of arrays and of the core, while it steps: 671 of a ladder by the bdf, 832 of a line by radau today; 1152 where
    columns of slopes that are alike stood one by one, and rows q' - f; 1239 where factors had orders and places of
    their own; 1633, 2932 where runs kept the start as they saw it, every place of their matrices, and vectors that
    nothing read; 1129, 2273 where matrices stood beside what they are sums of, points were settled in room of their
    own, and a start at rest was held number by number.
    """
    assert _bytes(HELD, tmp_path, *model, "--max-steps", "3", sections=sections) < most


@pytest.mark.skipif(not hasattr(ctypes.CDLL(None), "mallinfo2"), reason="needs glibc's mallinfo2")
@pytest.mark.long
def test_between_two_pieces_of_a_run_a_section_holds_few_bytes(tmp_path):
    """Where the matrix of all unknowns is looked at behind a jump of the text: 1481 of a line by radau today; 1940
    where points were copied for it, beside room that nobody read meanwhile; 2400 where factors kept their numbers and
    the settling its room; 2870 to 3380 where both had more of their own, 3785 where the method kept the vectors that
    its next start makes anew, and the points on both sides were held.
    """
    options = "--method", "radau", "--accuracy", "0.1"
    assert _bytes(CROSSED, tmp_path, LINE, *options, sections=(27_000, 33_000)) < 1700


@pytest.mark.long
def test_the_end_of_a_run_takes_few_bytes_a_section(tmp_path):
    """Of arrays and objects of Python: 639 of a ladder today; 805 where the start and magnitudes were held while it
    stepped, 400 more where magnitudes were confirmed with the pattern of the whole matrix and copies of what was met.
    """
    assert _bytes(ENDED, tmp_path, *LADDER, "--accuracy", "0.1", sections=(21_000, 30_000)) < 680


CHOSEN = """
import sys
from sysdyn.cli.main import run
from sysdyn.runtime.integrate.integrate import Integration

advance = Integration._advance

def noted(self, *given):
    settle, system = self.settler.core.contents, self.settler._left.core
    print(settle.ready, system.jacobian_evaluations)
    try:
        return advance(self, *given)
    finally:
        print(settle.ready, system.jacobian_evaluations)

Integration._advance = noted
run(sys.argv[1:])
"""


def test_a_large_line_chooses_what_settles_its_rows_before_it_steps(tmp_path):
    """The basis of what follows from the state stands when the first step begins, and no row within a step asks for
    slopes, where vectors and factors of the method leave no room: 200 bytes a section more while it steps.
    """
    options = "simulate", str(LINE), "--set", "n=21000", "--rtol", "1e-3", "--method", "radau", "--max-steps", "6"
    command = [sys.executable, "-c", CHOSEN, *options, "--quiet", "-o", str(tmp_path / "t.h5")]
    before, behind = subprocess.run(command, capture_output=True, text=True, check=False).stdout.split("\n")[:2]
    assert before == behind
    assert before.split()[0] == "2"  # SD_BY_BASIS


OPENED = """
import sys, tracemalloc
from sysdyn.cli.main import run
from sysdyn.runtime.integrate.weights import round_off
from sysdyn.runtime.integrate.integrate import Integration

whole = Integration.run

def ran(self, *given):
    found = whole(self, *given)
    point, met = found.last
    tracemalloc.reset_peak()
    round_off.left_open(self.system, found.reached, (*point(), met), 1e-3)
    print(tracemalloc.get_traced_memory()[1])
    return found

Integration.run = ran
tracemalloc.start()
run(sys.argv[1:])
"""


@pytest.mark.long
def test_what_round_off_leaves_open_takes_few_bytes_a_section(tmp_path):
    """Of arrays and objects of Python, between two runs: 1251 of a ladder today; 1924 where each part of the Jacobian
    was held beside what it goes into, and all errors that are tried at once.
    """
    assert _bytes(OPENED, tmp_path, *LADDER, "--accuracy", "0.1", sections=(21_000, 30_000)) < 1300


OWN = """
import ctypes
import numpy as np
from sysdyn.cli.run.many import memory
from sysdyn.dsl.model import collecting
from sysdyn.runtime.model import core_library as lib

class Info(ctypes.Structure):
    _fields_ = [(f"field{k}", ctypes.c_size_t) for k in range(10)]

library = ctypes.CDLL(None)
library.mallinfo2.restype = Info
collecting.keep()
memory.keep_pages()
for huge in (False, True):
    lib.core.sd_trim(huge)
    before = library.mallinfo2().field4
    array = np.ones(1 << 18)
    print((library.mallinfo2().field4 - before) >> 20)
"""


@pytest.mark.skipif(not hasattr(ctypes.CDLL(None), "mallinfo2"), reason="needs glibc's mallinfo2")
def test_arrays_of_huge_models_have_pages_of_their_own_in_a_command():
    """Pages stay with a command's process, but for those of a model so large that gaps would count: 2 MB of an array.
    Of a ladder of a million sections they took 0.26 GB, of a line by radau 0.36 GB; of one of 220000 sections, of which
    an array has 2 MB, 0.05 GB of 0.36.
    """
    done = subprocess.run([sys.executable, "-c", OWN], capture_output=True, text=True, check=True)
    assert done.stdout.split() == ["0", "2"]


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
    monkeypatch.setattr(budget, "memory_limit", lambda: 8 << 20)
    assert run(["check", str(path)]) == 0
    capsys.readouterr()
    assert run(["simulate", str(path), "-o", str(tmp_path / "t.h5")]) == 1
    said = capsys.readouterr().err
    assert "E119" in said
    assert f"needs {budget.format_bytes(5002 * budget.STEPPED)}" in said
