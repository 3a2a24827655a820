"""Traces in files: what is broken is refused by a message, what is read is read in pieces."""

import h5py
import numpy as np
import pytest
from corpus import bouncing, oscillator
from sysdyn.cli.golden.trace_file import write_trace
from sysdyn.runtime.comparison import quantities
from sysdyn.runtime.comparison.compare import compare
from sysdyn.runtime.comparison.recorded import Recorded
from sysdyn.runtime.comparison.verdict import Incomparable, Tolerance
from sysdyn.runtime.model.failures import TraceError


@pytest.fixture(scope="module")
def file(tmp_path_factory):
    path = tmp_path_factory.mktemp("traces") / "right.h5"
    write_trace(path, oscillator().arrays(), {"model": "o"}, 1e9)
    return path


def verdict(one, two):
    with Recorded(one) as ref, Recorded(two) as test:
        return compare(ref, test, Tolerance())


@pytest.mark.parametrize("most", [1e9, 30e3])
def test_what_is_written_is_read(tmp_path, most):
    for make in (oscillator, bouncing):
        source = make().arrays()
        size = write_trace(tmp_path / "a.h5", source, {}, most)
        assert size <= most
        with Recorded(tmp_path / "a.h5") as read:
            assert compare(source, read, Tolerance(0.0)).equal
            assert read.events == source.events
            assert read.quantities == source.quantities


def test_the_same_content_gives_the_same_bytes(tmp_path):
    for name in ("a", "b"):
        write_trace(tmp_path / f"{name}.h5", bouncing().arrays(), {"title": "t"}, 1e9)
    assert (tmp_path / "a.h5").read_bytes() == (tmp_path / "b.h5").read_bytes()


def test_blocks_do_not_change_the_verdict(file, tmp_path, monkeypatch):
    other = oscillator().rows(np.sort(np.random.default_rng(1).choice(501, 300, replace=False)))
    other = other.rows(np.unique(np.r_[0, np.arange(300)]))
    write_trace(tmp_path / "other.h5", other.arrays(), {}, 1e9)
    whole = [(c.name, c.worst) for c in verdict(file, tmp_path / "other.h5").quantities]
    for block in (7, 64):
        monkeypatch.setattr(quantities, "BLOCK", block)
        pieces = [(c.name, c.worst) for c in verdict(file, tmp_path / "other.h5").quantities]
        for (name, one), (_, two) in zip(whole, pieces, strict=True):
            assert one.ratio == pytest.approx(two.ratio, rel=1e-9), name


@pytest.mark.long
def test_cut_files_are_refused(file, tmp_path):
    data = file.read_bytes()
    for size in [0, 1, 7, 100, *range(512, len(data), len(data) // 60)]:
        path = tmp_path / "cut.h5"
        path.write_bytes(data[:size])
        with pytest.raises((TraceError, Incomparable)):
            verdict(file, path)


@pytest.mark.long
def test_flipped_bits_never_raise_anything_else(file, tmp_path):
    data = bytearray(file.read_bytes())
    random = np.random.default_rng(0)
    places = np.concatenate([random.integers(0, 3000, 150), random.integers(0, len(data), 100)])
    outcomes = set()
    for place in places:
        broken = bytearray(data)
        broken[place] ^= 1 << random.integers(8)
        path = tmp_path / "flipped.h5"
        path.write_bytes(broken)
        try:
            outcomes.add(verdict(file, path).equal)
        except (TraceError, Incomparable):
            outcomes.add("refused")
    assert "refused" in outcomes


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda f: f.__delitem__("time"), "no data set 'time'"),
        (lambda f: f.create_dataset("grid", data=np.zeros((3, 3))), "no row of numbers"),
        (lambda f: f.create_dataset("text", data=np.array([b"a"] * 501)), "no row of numbers"),
        (lambda f: f.create_dataset("events", data=np.zeros(3)), "no time and name"),
        (lambda f: f.create_group("events").create_dataset("time", data=np.zeros(3)), "no time and name"),
    ],
)
@pytest.mark.one_in(3)
def test_what_is_no_trace_says_why(file, tmp_path, change, message):
    path = tmp_path / "no.h5"
    path.write_bytes(file.read_bytes())
    with h5py.File(path, "a") as found:
        change(found)
    with pytest.raises(Incomparable, match=message):
        verdict(file, path)


def test_a_run_that_was_killed_is_shorter(file, tmp_path):
    path = tmp_path / "killed.h5"
    path.write_bytes(file.read_bytes())
    with h5py.File(path, "a") as found:
        values = found["v"][:400]
        del found["v"]
        found.create_dataset("v", data=values).attrs["units"] = "m/s"
    found = verdict(file, path)
    assert not found.equal
    assert found.traces[1].status == "coverage"
