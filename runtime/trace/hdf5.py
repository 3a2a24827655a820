"""Data sets and attributes by HDF5's own calls.

h5py's objects ask again what is known of each: a trace of five quantities and their derivatives takes them 20 ms of
CPU to lay down, fill and close, these 8.  Imported where a file is written, for h5py is slow to import.
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache
from typing import Any

import h5py
import numpy as np
from h5py import h5a, h5d, h5ds, h5o, h5p, h5s, h5t
from numpy.typing import NDArray
from sysdyn.runtime.model.description import Floats

SCALAR = h5s.create(h5s.SCALAR)


@cache
def _number_of(kind: np.dtype[Any]) -> Any:
    """HDF5's type of numbers of NumPy's."""
    return h5t.py_create(kind, logical=True)


@cache
def _text_of(size: int) -> tuple[np.dtype[Any], Any]:
    """Fixed-length UTF-8 of so many bytes: NumPy's type and HDF5's."""
    kind = h5py.string_dtype("utf-8", size)
    return kind, h5t.py_create(kind, logical=True)


def _texts(texts: list[str]) -> tuple[NDArray[Any], Any]:
    """Texts [n] of one length, and its type."""
    data = [text.encode() for text in texts]
    kind, stored = _text_of(max(1, *map(len, data)))
    return np.array(data, dtype=kind), stored


def say(owner: Any, values: Mapping[str, Any]) -> None:
    """Scalar attributes of an object [its identifier] that has none of these names: texts of fixed length, numbers."""
    for name, value in values.items():
        # HDF5 has no empty fixed-length text
        if isinstance(value, str):
            held, kind = _texts([value or " "])
        else:
            held = np.asarray(value)
            kind = _number_of(held.dtype)
        h5a.create(owner, name.encode(), kind, SCALAR).write(held, kind)


def say_again(owner: Any, values: Mapping[str, Any]) -> None:
    """Scalar attributes of an object [its identifier]; what stands there under these names is replaced."""
    for name in values:
        # an attribute cannot be overwritten with another size
        if h5a.exists(owner, name.encode()):
            h5a.delete(owner, name.encode())
    say(owner, values)


def _timeless() -> Any:
    """How a data set is created: it tells no time of day."""
    made = h5p.create(h5p.DATASET_CREATE)
    made.set_obj_track_times(False)
    return made


@cache
def _growing(block: int) -> Any:
    """A creation list of data sets in blocks of so many numbers, nan where nothing is written."""
    made = _timeless()
    made.set_chunk((block,))
    made.set_fill_value(np.array(np.nan))
    return made


@cache
def _path() -> Any:
    """Groups above a name are created with it; names are UTF-8."""
    link = h5p.create(h5p.LINK_CREATE)
    link.set_create_intermediate_group(True)
    link.set_char_encoding(h5t.CSET_UTF8)
    return link


def column(file: Any, name: str, block: int, about: Mapping[str, Any], scale: Any = None) -> Any:
    """An empty data set of float64 that grows; scale: its dimension scale."""
    space = h5s.create_simple((0,), (h5s.UNLIMITED,))
    made = h5d.create(file, name.encode(), h5t.IEEE_F64LE, space, _growing(block), _path())
    say(made, about)
    # time is the scale of all others
    if scale is not None:
        h5ds.attach_scale(made, scale, 0)
    return made


def make_scale(data: Any, name: str) -> None:
    """The data set becomes a dimension scale of this name."""
    h5ds.set_scale(data, name.encode())


def link(file: Any, name: str, data: Any) -> None:
    """Another name of a data set."""
    h5o.link(data, file, name.encode(), _path())


def append(data: Any, first: int, values: Floats) -> None:
    """Writes contiguous values [n] from row `first` on, which is its end."""
    data.set_extent((first + values.size,))
    there = data.get_space()
    there.select_hyperslab((first,), (values.size,))
    data.write(h5s.create_simple((values.size,)), there, values, h5t.NATIVE_DOUBLE)


def template(group: Any, unit: str) -> Any:
    """A data set without a name, which HDF5 removes with its last handle: a scalar in its own header, and its unit."""
    made = _timeless()
    made.set_layout(h5d.COMPACT)
    data = h5d.create(group, None, h5t.IEEE_F64LE, SCALAR, made)
    say(data, {"units": unit})
    return data


def copy(template: Any, group: Any, name: str, value: float) -> None:
    """The template's copy under a name, with a value of its own."""
    template.write(h5s.ALL, h5s.ALL, np.array(value, dtype=np.float64), h5t.IEEE_F64LE)
    h5o.copy(template, b".", group, name.encode())


def scalars(group: Any) -> dict[str, tuple[float, str]]:
    """Every data set of a group of h5py's, which holds one number, and its unit.  TypeError: one holds more, or is no
    data set.
    """
    held, found = np.empty(()), {}
    # one scalar after the other, through one buffer
    for stored in group.id:
        name, data = stored.decode(errors="surrogateescape"), h5o.open(group.id, stored)
        if not isinstance(data, h5d.DatasetID) or data.shape != ():
            raise TypeError(f"'{name}' is no number")
        data.read(h5s.ALL, h5s.ALL, held)
        found[name] = float(held), _text_attribute(data, b"units", "1")
    return found


def _text_attribute(data: Any, name: bytes, without: str) -> str:
    """A text that is an attribute."""
    if not h5a.exists(data, name):
        return without
    attribute = h5a.open(data, name)
    # a text of variable length: by h5py
    if attribute.shape != () or attribute.dtype.kind != "S":
        return str(h5py.Dataset(data).attrs[name])
    text = np.empty((), dtype=attribute.dtype)
    attribute.read(text)
    return bytes(text[()]).decode()


def whole(file: Any, name: str, values: Any) -> Any:
    """A data set of all that it will ever hold: numbers [n] or texts, as fixed-length UTF-8."""
    held, stored = (values, _number_of(values.dtype)) if isinstance(values, np.ndarray) else _texts(values)
    data = h5d.create(file, name.encode(), stored, h5s.create_simple(held.shape), _timeless(), _path())
    data.write(h5s.ALL, h5s.ALL, held, stored)
    return data
