"""A trace file is one run's while it is written, and a stranger's file is read for nothing but itself."""

import os

import h5py
import numpy as np
import pytest
from sysdyn.runtime.model.failures import TraceError
from sysdyn.runtime.trace.claim import claim_trace
from sysdyn.runtime.trace.opening import open_regular, regular, replaceable


def test_one_run_at_a_time_writes_a_trace(tmp_path):
    path = tmp_path / "run.h5"
    with claim_trace(path):
        assert (tmp_path / ".run.h5.lock").exists()
        with pytest.raises(TraceError, match="another run is writing this trace"), claim_trace(path):
            pass
        with claim_trace(tmp_path / "other.h5"):  # another trace of the folder is nobody's
            pass
    assert list(tmp_path.iterdir()) == []
    with claim_trace(path):
        pass


def test_a_lock_that_somebody_left_is_taken(tmp_path):
    """A lock dies with its process: its file says nothing."""
    (tmp_path / ".run.h5.lock").write_text("")
    with claim_trace(tmp_path / "run.h5"):
        pass
    assert list(tmp_path.iterdir()) == []


def test_a_lock_follows_no_link(tmp_path):
    """Else a file of the user would be opened, and deleted, in its place."""
    mine = tmp_path / "mine.txt"
    mine.write_text("kept")
    (tmp_path / ".run.h5.lock").symlink_to(mine)
    with pytest.raises(TraceError, match=r"run\.h5"), claim_trace(tmp_path / "run.h5"):
        pass
    assert mine.read_text() == "kept"


def test_only_regular_files_are_opened(tmp_path):
    os.mkfifo(tmp_path / "pipe")
    with pytest.raises(OSError, match="no regular file"):
        regular(tmp_path / "pipe")
    with pytest.raises(IsADirectoryError):
        open_regular(tmp_path)
    with pytest.raises(FileNotFoundError):
        open_regular(tmp_path / "none.h5")


@pytest.fixture
def secret(tmp_path):
    path = tmp_path / "secret.h5"
    with h5py.File(path, "w") as file:
        file["numbers"] = np.arange(3.0)
    return path


def by_link(file, secret):
    file.create_group("deep")["it"] = h5py.ExternalLink(str(secret), "/numbers")


def by_virtual_data(file, secret):
    layout = h5py.VirtualLayout(shape=(3,), dtype="f8")
    layout[:] = h5py.VirtualSource(str(secret), "numbers", shape=(3,))
    file.create_virtual_dataset("it", layout)


def by_raw_numbers(file, secret):
    file.create_dataset("it", shape=(3,), dtype="f8", external=[(str(secret), 0, 24)])


@pytest.mark.parametrize("way", [by_link, by_virtual_data, by_raw_numbers])
def test_no_file_leads_to_another(tmp_path, secret, way):
    path = tmp_path / "sent.h5"
    with h5py.File(path, "w") as file:
        file["time"] = [0.0]
        file.attrs["source"] = np.bytes_("sysdyn")
        way(file, secret)
    with pytest.raises(OSError, match="it' leads to another file: not followed"):
        open_regular(path)
    assert not replaceable(path)


def test_links_within_a_file_are_its_own(tmp_path):
    path = tmp_path / "own.h5"
    with h5py.File(path, "w") as file:
        file["time"] = [0.0, 1.0]
        file["same"] = h5py.SoftLink("/time")
    with open_regular(path) as file:
        assert file["same"][()].tolist() == [0.0, 1.0]


@pytest.mark.parametrize(
    ("content", "lost"), [(None, False), (b"", False), (b"my letter", True)], ids=["none", "empty", "letter"]
)
def test_nothing_of_the_users_is_replaced(tmp_path, content, lost):
    path = tmp_path / "run.h5"
    if content is not None:
        path.write_bytes(content)
    assert replaceable(path) is not lost


@pytest.mark.parametrize(
    ("source", "lost"), [(np.bytes_("sysdyn 1.0"), False), (np.bytes_("another program"), True), (None, True)]
)
def test_traces_of_sysdyn_alone_are_replaced(tmp_path, source, lost):
    path = tmp_path / "run.h5"
    with h5py.File(path, "w") as file:
        file["time"] = [0.0]
        if source is not None:
            file.attrs["source"] = source
    assert replaceable(path) is not lost
