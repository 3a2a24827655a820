"""A linearisation in a file: HDF5, MATLAB's .mat (version 5), JSON; and as objects of other libraries."""

from __future__ import annotations

import io
import json
from typing import TYPE_CHECKING, Any

import numpy as np
from sysdyn.cli.analysis.linearisation import Linearisation
from sysdyn.cli.console import finite

if TYPE_CHECKING:
    from numpy.typing import NDArray


def arrays(linear: Linearisation) -> dict[str, NDArray[Any]]:
    """Matrices by name: E A B C Cd D of the form, a b c d d1 d2 of the reduction, eigenvalues, participation."""
    form, small = linear.descriptor, linear.reduced
    found: dict[str, NDArray[Any]] = {"E": form.e, "A": form.a, "B": form.b, "C": form.c, "Cd": form.cd, "D": form.d}
    found |= {f"reduced_{n}": getattr(small, n.lower()) for n in ("A", "B", "C", "D", "D1", "D2")}
    found["eigenvalues"] = np.array([m.eigenvalue for m in linear.modes], dtype=complex)
    shares = [m.participation for m in linear.modes]
    found["participation"] = np.array(shares).reshape(len(shares), len(small.names))
    found["energies"] = linear.energies
    found["shapes"] = np.array([m.shape for m in linear.modes], dtype=complex).reshape(len(shares), len(small.names))
    found["point"] = linear.y
    return found


def names(linear: Linearisation) -> dict[str, tuple[str, ...]]:
    """What rows and columns stand for."""
    return {
        "states": linear.descriptor.states,
        "reduced_states": linear.reduced.names,
        "inputs": linear.inputs,
        "outputs": linear.outputs,
        "stores": linear.stores,
    }


def written(linear: Linearisation, kind: str, result: dict[str, Any]) -> bytes:
    """The file's content; result: the object of --json, which is what .json holds."""
    match kind:
        case ".h5":
            return _hdf5(linear)
        case ".mat":
            return _mat(linear)
    return (json.dumps(finite(result), indent=1, allow_nan=False) + "\n").encode()


def _hdf5(linear: Linearisation) -> bytes:
    """Complex numbers as pairs (re, im); names as fixed-length strings; transfer functions in groups by number."""
    import h5py

    data = io.BytesIO()
    with h5py.File(data, "w", libver=("earliest", "v110")) as file:
        for name, value in arrays(linear).items():
            file.create_dataset(name, data=_pairs(value), track_times=False)
        for name, texts in names(linear).items():
            found = np.array([t.encode() for t in texts], dtype=_text_type(texts))
            file.create_dataset(name, data=found, track_times=False)
        for k, t in enumerate(linear.transfers):
            group = file.create_group(f"transfer/{k}")
            group.attrs["output"] = np.bytes_(linear.outputs[t.output].encode())
            group.attrs["input"] = np.bytes_(linear.inputs[t.input].encode())
            group.attrs["gain"] = t.gain
            group.attrs["improper"] = np.array(t.improper)
            for name, value in (("poles", t.poles), ("zeros", t.zeros)):
                group.create_dataset(name, data=_pairs(value), track_times=False)
        file.attrs["t"] = linear.t
        file.attrs["moving"] = int(linear.moving)
    return data.getvalue()


def _text_type(texts: tuple[str, ...]) -> str:
    return f"S{max((len(t.encode()) for t in texts), default=1) or 1}"


def _pairs(value: NDArray[Any]) -> NDArray[np.float64]:
    """Complex numbers with an axis (re, im) behind."""
    if np.iscomplexobj(value):
        return np.stack([value.real, value.imag], axis=-1)
    return np.asarray(value, dtype=np.float64)


def _mat(linear: Linearisation) -> bytes:
    """The linearisation as a MATLAB file of level 5, the same bytes each time."""
    from scipy.io import savemat

    found: dict[str, Any] = dict(arrays(linear))
    found |= {name: np.array(texts, dtype=object) for name, texts in names(linear).items()}
    found |= {"t": linear.t, "moving": int(linear.moving)}
    found["transfer"] = np.array(
        [
            {
                "output": linear.outputs[t.output],
                "input": linear.inputs[t.input],
                "poles": t.poles,
                "zeros": t.zeros,
                "gain": t.gain,
                "improper": np.array(t.improper),
            }
            for t in linear.transfers
        ],
        dtype=object,
    )
    data = io.BytesIO()
    savemat(data, found, do_compression=False, oned_as="column")
    content = data.getvalue()
    return b"MATLAB 5.0 MAT-file, sysdyn".ljust(116) + content[116:]  # without the hour
