"""The two carriers of a compiled model: a C library, or a Python module on NumPy arrays.

`load` gives a carrier; `bind` makes of one block and its tables the three function pointers of a call.
A Python callback that raises is remembered with its exception; the core stops at its flag and `Failure.check`
raises the exception where Python is reached again.
"""

from __future__ import annotations

import ctypes as c
from collections.abc import Callable
from dataclasses import field
from pathlib import Path
from types import ModuleType
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray
from sysdyn.runtime import _core
from sysdyn.runtime.model.core_library import ROWS, reader
from sysdyn.runtime.model.description import Floats, Ints
from sysdyn.runtime.model.failures import ContractError
from sysdyn.values import dataclass

CONTRACT: int = _core.SD_CONTRACT
_VIEWS = 256
"""Addresses whose views a callback remembers: a few buffers recur for ever, others are passing."""


class Failure:
    """The first exception of a callback.  flag [1]: nonzero after it, read by the core."""

    def __init__(self) -> None:
        self.flag: NDArray[np.int32] = np.zeros(1, dtype=np.int32)
        self.exception: BaseException | None = None

    def note(self, exception: BaseException) -> None:
        """Remembers the exception and tells the core to stop."""
        # the first exception counts: what follows comes of it
        if self.exception is None:
            self.exception = exception
        self.flag[0] = 1

    def check(self) -> None:
        """Raises what a callback raised; afterwards the system can be used again."""
        # the core has stopped: the exception goes on in Python
        if self.exception is not None:
            exception, self.exception = self.exception, None
            self.flag[0] = 0
            raise exception


@dataclass(frozen=True, slots=True)
class Tables:
    """What a call's functions read: p, ix, at, to."""

    p: Floats
    ix: Ints
    at: Ints
    to: Ints


@dataclass(frozen=True, slots=True)
class Extent:
    """Lengths of the arrays a call sees: y and yd, r, entries of dy and dyd."""

    y: int
    r: int
    dy: int
    dyd: int


@dataclass(frozen=True, slots=True)
class Pointers:
    """Addresses of the three functions of a call (None: it has none), and what must stay alive."""

    rows: int
    dy: int | None
    dyd: int | None
    keep: tuple[Any, ...] = field(default=())


class Carrier(Protocol):
    """A loaded compiled model."""

    def bind(self, block: str, tables: Tables, extent: Extent, failure: Failure) -> Pointers:
        """Function pointers of one call of a block."""
        ...


class LibraryCarrier:
    """A C library that exports sd_contract and sd_<block>_rows, _dy, _dyd.  OSError where it cannot be loaded (a folder
    from which nothing may be run); ContractError where it is no compiled model.
    """

    def __init__(self, path: str | Path) -> None:
        self.path = Path(path)
        # a file that is no library, or has no contract
        try:
            self._library = c.CDLL(str(self.path.resolve()))
            version = c.c_int.in_dll(self._library, "sd_contract").value
        except ValueError as error:
            raise ContractError(f"{self.path}: not a compiled model: {error}") from error
        # compiled for another version of the contract
        if version != CONTRACT:
            raise ContractError(f"{self.path}: contract {version}, this runtime reads {CONTRACT}")

    def _address(self, name: str) -> int:
        # a block without its function: compiled by another compiler
        try:
            address = c.cast(getattr(self._library, name), c.c_void_p).value
        except AttributeError as error:
            raise ContractError(f"{self.path}: function {name} is missing") from error
        assert address is not None
        return address

    def bind(self, block: str, tables: Tables, extent: Extent, failure: Failure) -> Pointers:
        """Addresses in the library: the tables come with the frame."""
        return Pointers(
            self._address(f"sd_{block}_rows"),
            self._address(f"sd_{block}_dy") if extent.dy else None,
            self._address(f"sd_{block}_dyd") if extent.dyd else None,
            (self._library,),
        )


class ModuleCarrier:
    """A Python module with CONTRACT and <block>_rows, _dy, _dyd on NumPy arrays."""

    def __init__(self, module: ModuleType | Any) -> None:
        self._module = module
        version = getattr(module, "CONTRACT", None)
        if version != CONTRACT:
            raise ContractError(f"contract {version}, this runtime reads {CONTRACT}")

    def _function(self, name: str) -> Callable[..., None]:
        function = getattr(self._module, name, None)
        if function is None:
            raise ContractError(f"function {name} is missing")
        return function  # type: ignore[no-any-return]

    def bind(self, block: str, tables: Tables, extent: Extent, failure: Failure) -> Pointers:
        """Callbacks that look at the core's arrays through NumPy."""
        # residuals, then slopes where there are entries
        made = [_callback(self._function(f"{block}_rows"), tables, extent.y, extent.r, failure)]
        for part, number in (("dy", extent.dy), ("dyd", extent.dyd)):
            if number:
                made.append(_callback(self._function(f"{block}_{part}"), tables, extent.y, number, failure))
        address = [c.cast(callback, c.c_void_p).value for callback in made]
        assert address[0] is not None
        # addresses in the order of `made`
        rest = iter(address[1:])
        return Pointers(address[0], next(rest) if extent.dy else None, next(rest) if extent.dyd else None, tuple(made))


def _callback(function: Callable[..., None], tables: Tables, inputs: int, outputs: int, failure: Failure) -> Any:
    """A C function pointer to function(p, ix, at, to, t, y, yd, out)."""
    views: dict[tuple[int, int], Floats] = {}

    # arrays over the core's memory, made once for each address
    def view(address: int, number: int) -> Floats:
        found = views.get((address, number))
        if found is None:
            # addresses that come and go must not fill the memory
            if len(views) > _VIEWS:
                views.clear()
            found = reader(address, number)
            views[address, number] = found
        return found

    # no exception may cross C: noted, and the run stops
    def call(frame: int, t: float, y: int, yd: int, out: int) -> None:
        try:
            with np.errstate(all="ignore"):
                function(
                    tables.p,
                    tables.ix,
                    tables.at,
                    tables.to,
                    t,
                    view(y, inputs),
                    view(yd, inputs),
                    view(out, outputs),
                )
        except BaseException as exception:
            failure.note(exception)

    return ROWS(call)


def load(source: str | Path | ModuleType | Any) -> Carrier:
    """A carrier for a library's path or a Python module (any object with its attributes).

    Raises ContractError where it is no compiled model of this contract.
    """
    if isinstance(source, str | Path):
        return LibraryCarrier(source)
    return ModuleCarrier(source)
