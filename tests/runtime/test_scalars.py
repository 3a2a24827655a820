"""/parameters as laid down by `runtime.trace.scalars`, read and changed by HDF5's own library."""

import random

import h5py
import numpy as np
import pytest
from sysdyn.runtime.trace import scalars

UNITS = ["ohm", "1", "", "kg.m2/s2", "Ω"]
"""Of one, two and three words of a header; an empty one is stored as a blank, as other attributes are."""


def laid_down(path, number):
    """Names out of order, of all lengths up to two words; their values and units."""
    order = random.Random(number).sample(range(number), number)
    names = [f"b{k}{'é' * (k % 6)}[1,{k}]" for k in order]
    values = [k / 3.0 for k in order]
    units = [UNITS[k % len(UNITS)] for k in order]
    scalars.begin(path, names, values, units)
    return dict(zip(names, zip(values, units, strict=True), strict=True))


def read(group, name):
    data = group[name]
    assert data.shape == ()
    assert data.dtype == np.float64
    assert h5py.check_string_dtype(data.attrs.get_id("units").dtype).length is not None
    return data[()], data.attrs["units"].decode().strip()


@pytest.mark.parametrize("number", [1, 8, 9, 256, 257, 8192, 8193])
def test_the_library_reads_every_scalar_at_each_edge_of_the_tree(tmp_path, number):
    """8 symbols a leaf, 32 children a node: 256 in one node, 8192 below two levels."""
    wanted = laid_down(tmp_path / "o.h5", number)
    with h5py.File(tmp_path / "o.h5") as file:
        group = file["parameters"]
        assert list(file) == ["parameters"]
        assert list(group) == sorted(wanted, key=str.encode)
        assert {name: read(group, name) for name in wanted} == wanted


@pytest.mark.parametrize("number", [1, 9, 8193])
def test_the_library_adds_to_such_a_file_and_takes_from_it(tmp_path, number):
    wanted = laid_down(tmp_path / "o.h5", number)
    gone = list(wanted)[::2]
    with h5py.File(tmp_path / "o.h5", "r+", libver=("earliest", "v110")) as file:
        file.attrs["title"] = "t" * 500
        group = file["parameters"]
        for k in range(300):
            group[f"c{k}"] = float(k)
            file[f"deep/{k}"] = np.arange(3.0) + k
        for name in gone:
            del group[name]
    with h5py.File(tmp_path / "o.h5") as file:
        group = file["parameters"]
        assert len(group) == 300 + len(wanted) - len(gone)
        assert {name: read(group, name) for name in set(wanted) - set(gone)} == {
            name: found for name, found in wanted.items() if name not in gone
        }
        assert all(group[f"c{k}"][()] == k and file[f"deep/{k}"][2] == k + 2 for k in range(300))


def test_a_header_is_the_librarys_own_message_by_message(tmp_path):
    """The same type, space and attribute as a scalar that the library makes."""
    scalars.begin(tmp_path / "o.h5", ["m"], [1.13], ["kg"])
    with h5py.File(tmp_path / "o.h5", "r+") as file:
        own = file["parameters/m"]
        theirs = file.create_dataset("m", data=1.13, dtype="f8", track_times=False)
        theirs.attrs["units"] = np.array(b"kg", dtype=h5py.string_dtype("utf-8", 2))
        assert own.id.get_type().encode() == theirs.id.get_type().encode()
        assert own.id.get_space().encode() == theirs.id.get_space().encode()
        kinds = [d.attrs.get_id("units").get_type().encode() for d in (own, theirs)]
        assert kinds[0] == kinds[1]


def test_a_file_that_is_there_stays(tmp_path):
    (tmp_path / "o.h5").write_text("mine")
    with pytest.raises(FileExistsError):
        scalars.begin(tmp_path / "o.h5", ["m"], [1.13], ["kg"])
    assert (tmp_path / "o.h5").read_text() == "mine"
