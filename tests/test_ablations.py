"""The table of optional mechanisms names what is there, and each switch still finds what it leaves out."""

import importlib.util
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
spec = importlib.util.spec_from_file_location("ablate", ROOT / "tests" / "bench" / "ablate.py")
ablate = sys.modules["ablate"] = importlib.util.module_from_spec(spec)
spec.loader.exec_module(ablate)


@pytest.mark.parametrize("mechanism", ablate.MECHANISMS, ids=lambda one: one.name)
def test_a_switch_finds_what_it_leaves_out(mechanism):
    assert mechanism.switch
    for file, text, other in mechanism.switch:
        assert (ROOT / file).read_text().count(text) == 1, file
        assert text != other
    assert all((ROOT / file).is_file() for file in (*mechanism.files, *mechanism.tests.split(", ")))


def test_the_runs_are_fifty_four_of_files_that_are_there():
    runs = [run for group in ablate.GROUPS.values() for run in group]
    assert all((ROOT / run.path).is_file() for run in runs)
    assert sum(len(ablate.GROUPS[group]) for group in ablate.RUNS) == 54
