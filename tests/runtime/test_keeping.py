"""Runs in memory and in files hold the same rows; what stands beside a trace is taken away."""

import re
from pathlib import Path

import h5py
import numpy as np
import pytest
from sysdyn.runtime.model import core_library as lib
from sysdyn.runtime.trace.keeping import Files, MemoryKeeping, keeping
from sysdyn.runtime.trace.trace import Trace, TraceError
from sysdyn.runtime.trace.trace_store import BEFORE, Column, Layout, TraceParameter, clear, input_output

LAYOUT = Layout((Column("x", 1, "m", "the way", True), Column("e", 0, "V", "e", False)), 2, {"title": "t"}, ())


def rows(times):
    """x = t^2 in the second place of block observe, its rate behind the values; e = -t."""
    found = np.zeros((len(times), BEFORE + 4))
    found[:, 0] = times
    found[:, BEFORE] = -np.asarray(times)
    found[:, BEFORE + 1] = np.asarray(times) ** 2
    found[:, BEFORE + 3] = 2.0 * np.asarray(times)
    return found


def written(kept, *chunks, first=True):
    writer = kept.writer(LAYOUT, first)
    for times in chunks:
        writer.append(rows(times))
    writer.flush()
    return writer


@pytest.mark.parametrize("path", [None, "trace.h5"])
def test_a_run_is_what_was_written_in_memory_as_in_a_file(path, tmp_path):
    kept = keeping(None if path is None else tmp_path / path)
    with kept.claim():
        writer = written(kept, [0.0, 1.0], [], [3.0])
        writer.finish({"x": 9.0}, {"met": 1}, True)
    found = Trace.open(tmp_path / path) if path else writer.trace
    assert found.time.tolist() == [0.0, 1.0, 3.0]
    assert found["x"].values.tolist() == [0.0, 1.0, 9.0]
    assert found["x"].derivative.tolist() == [0.0, 2.0, 6.0]
    assert (found["x"].units, found["x"].nominal) == ("m", 9.0)
    assert found["e"].values.tolist() == [0.0, -1.0, -3.0]
    assert found["e"].derivative is None
    assert found.attributes["met"] == 1
    assert found.attributes["title"] == "t"
    assert found.final
    assert writer.seen()["x"] == 9.0


def test_a_run_in_memory_is_let_go():
    kept = MemoryKeeping()
    one, two = written(kept, [0.0, 1.0]), written(kept, [0.0, 2.0], first=False)
    kept.take(two, one)
    assert one.closed
    assert one.trace is None
    two.finish({}, {}, True)
    two.finish({}, {"met": 0}, False)  # once only
    assert two.trace.attributes["final"] == 1
    kept.drop(two)
    assert two.closed


def test_a_finer_run_takes_the_place_of_the_one_before_it(tmp_path):
    kept = Files(tmp_path / "trace.h5")
    with kept.claim():
        draft = written(kept, [0.0, 1.0])
        finer = written(kept, [0.0, 0.5, 1.0], first=False)
        assert Trace.open(kept.path).time.size == 2
        kept.take(finer, draft)
        finer.finish({}, {}, True)
    assert Trace.open(kept.path).time.size == 3
    assert [p.name for p in tmp_path.glob("*.part")] == []


def test_a_run_that_failed_beside_a_finished_one_leaves_nothing(tmp_path):
    kept = Files(tmp_path / "trace.h5")
    with kept.claim():
        draft = written(kept, [0.0, 1.0])
        finer = written(kept, [0.0], first=False)
        kept.drop(finer)
        draft.finish({}, {}, True)
    assert Trace.open(kept.path).time.size == 2
    assert {p.name for p in tmp_path.iterdir() if p.name.endswith(".part")} == set()


def test_stores_of_killed_runs_go_and_others_stay(tmp_path):
    trace = tmp_path / "t.h5"
    left = [".t.h5.0123abcd.a", ".t.h5.0123abcd.b", ".t.h5.0123abcd.a.link"]
    others = ["t.h5", ".t.h5.0123abcd.c", ".u.h5.0123abcd.a", ".t.h5.0123abcg.a"]
    for name in (*left, *others):
        (tmp_path / name).touch()
    clear(trace)
    assert sorted(p.name for p in tmp_path.iterdir()) == sorted(others)


def test_faults_of_files_are_told_with_their_path(tmp_path):
    path = tmp_path / "no" / "t.h5"
    with pytest.raises(TraceError, match=r"t\.h5"), input_output(path):
        path.read_bytes()


def test_the_head_of_a_row_is_as_long_in_the_core_as_in_what_reads_it():
    header = Path(__file__).parents[2] / "runtime" / "core" / "run" / "run.h"
    counted = int(re.search(r"SD_ROW_HEAD = (\d+)", header.read_text(encoding="utf-8"))[1])
    assert counted == lib.ROW_HEAD == BEFORE


def test_parameters_of_one_unit_and_of_several_come_back(tmp_path):
    given = (TraceParameter("m", 2.0, "kg"), TraceParameter("a/b", 3.0, "kg"), TraceParameter("k", 4.0, "N/m"))
    kept = Files(tmp_path / "trace.h5")
    with kept.claim():
        writer = kept.writer(Layout(LAYOUT.columns, 2, {}, given), True)
        writer.append(rows([0.0]))
        writer.finish({}, {}, True)
    assert Trace.open(kept.path).parameters == {"m": (2.0, "kg"), "a\u2215b": (3.0, "kg"), "k": (4.0, "N/m")}


@pytest.mark.long
def test_each_of_many_parameters_keeps_its_own_number_and_unit(tmp_path):
    units = ("F", "ohm", "kg*m^2/s^2")
    given = tuple(TraceParameter(f"C{k}.C", (-1.0) ** k * np.exp(0.37 * k), units[k % 3]) for k in range(300))
    kept = Files(tmp_path / "trace.h5")
    with kept.claim():
        writer = kept.writer(Layout(LAYOUT.columns, 2, {}, given), True)
        writer.append(rows([0.0]))
        writer.finish({}, {}, True)
    with h5py.File(kept.path) as file:
        group = file["parameters"]
        assert sorted(group) == sorted(p.name for p in given)
        for p in given:
            assert (group[p.name][()], group[p.name].attrs["units"].decode()) == (p.value, p.unit)
            assert group[p.name].shape == ()
            assert group[p.name].dtype == np.float64
