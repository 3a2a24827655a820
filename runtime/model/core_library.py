"""The stepping core as ctypes sees it: its functions' signatures, and its structures under their own names."""

from __future__ import annotations

import ctypes as c
from typing import Any

import numpy as np
from numpy.typing import NDArray
from sysdyn.runtime import _core  # type: ignore[attr-defined]
from sysdyn.runtime.model.structures.linear import Linear, Order
from sysdyn.runtime.model.structures.run import (
    COUNTERS,
    ROW_HEAD,
    Contact,
    Held,
    Kink,
    Ledgers,
    Many,
    Mode,
    Modes,
    Pass,
    Record,
    Region,
    Run,
    RunClaim,
    RunSamples,
    Transition,
    Watch,
)
from sysdyn.runtime.model.structures.start import Balance, RowsOfStart, Search, Sizing
from sysdyn.runtime.model.structures.steppers import (
    MAX_ORDER,
    PAIRS,
    STAGES,
    Bdf,
    Collocation,
    Dopri,
    Energy,
    Expanded,
    Radau,
    RadauMethod,
    Rosenbrock,
    Stepper,
    Underlying,
)
from sysdyn.runtime.model.structures.system import (
    CAUSES,
    PROVIDE,
    ROWS,
    Call,
    Condensed,
    Frame,
    LeastNorm,
    Left,
    Settle,
    Span,
    Straight,
    System,
)

__all__ = [
    "CAUSES",
    "COUNTERS",
    "MAX_ORDER",
    "PAIRS",
    "PROVIDE",
    "ROWS",
    "ROW_HEAD",
    "STAGES",
    "Balance",
    "Bdf",
    "Call",
    "Collocation",
    "Condensed",
    "Contact",
    "Dopri",
    "Energy",
    "Expanded",
    "Frame",
    "Held",
    "Kink",
    "LeastNorm",
    "Ledgers",
    "Left",
    "Linear",
    "Many",
    "Mode",
    "Modes",
    "Order",
    "Pass",
    "Radau",
    "RadauMethod",
    "Record",
    "Region",
    "Rosenbrock",
    "RowsOfStart",
    "Run",
    "RunClaim",
    "RunSamples",
    "Search",
    "Settle",
    "Sizing",
    "Span",
    "Stepper",
    "Straight",
    "System",
    "Transition",
    "Underlying",
    "Watch",
    "core",
    "pointer",
    "reader",
]

_D, _I, _L, _P = c.c_double, c.c_int32, c.c_int64, c.c_void_p


_address = _core.address


def pointer(array: NDArray[Any] | None) -> int | None:
    """Address of an array's first element; the caller keeps the array alive."""
    return None if array is None else _address(array)


def reader(address: int, number: int) -> NDArray[np.float64]:
    """The core's doubles at an address as an array (a view)."""
    return np.frombuffer(memoryview((c.c_double * number).from_address(address))) if number else np.zeros(0)


def _load() -> Any:
    core = c.CDLL(str(_core.__file__))
    signatures: dict[str, tuple[Any, list[Any]]] = {
        "sd_residual": (None, [_P, _D, _P, _P, _P]),
        "sd_slopes": (None, [_P, _D, _P, _P, c.c_int, _P]),
        "sd_first_bad": (c.c_int32, [_I, _P]),
        "sd_jacobian": (c.c_int32, [_P, _D, _P, _P, _P, _P, _P]),
        "sd_linear_new": (c.POINTER(Linear), [_I, _P, _P, _P]),
        "sd_linear_ordered": (c.POINTER(Linear), [_I, _P, _P, _P]),
        "sd_linear_free": (None, [_P]),
        "sd_linear_factor": (c.c_int, [_P, _P, _P]),
        "sd_linear_solve": (None, [_P, _P]),
        "sd_bdf_new": (c.POINTER(Bdf), [_P, _P]),
        "sd_bdf_free": (None, [_P]),
        "sd_bdf_start": (None, [_P, _D, _P, _P, _D]),
        "sd_bdf_stepper": (_P, [_P]),
        "sd_bdf_step": (c.c_int, [_P]),
        "sd_bdf_dense": (None, [_P, _D, _P, _P]),
        "sd_linear_z_new": (_P, [_I, _P, _P, _P]),
        "sd_linear_z_ordered": (_P, [_I, _P, _P, _P]),
        "sd_linear_z_free": (None, [_P]),
        "sd_radau_new": (c.POINTER(Radau), [_P, _P, _P, c.c_int32]),
        "sd_radau_free": (None, [_P]),
        "sd_radau_stepper": (_P, [_P]),
        "sd_radau_start": (None, [_P, _D, _P, _P, _D]),
        "sd_radau_dense": (None, [_P, _D, _P, _P]),
        "sd_underlying_new": (c.POINTER(Underlying), [_P, _P]),
        "sd_underlying_free": (None, [_P]),
        "sd_underlying_slopes": (c.c_int, [_P, _D, _P, _P]),
        "sd_underlying_project": (c.c_int, [_P, _D, _P, _P]),
        "sd_dopri_new": (c.POINTER(Dopri), [_P, _P]),
        "sd_dopri_free": (None, [_P]),
        "sd_dopri_stepper": (_P, [_P]),
        "sd_dopri_start": (None, [_P, _D, _P, _P, _D]),
        "sd_rosenbrock_new": (c.POINTER(Rosenbrock), [_P, _P]),
        "sd_rosenbrock_free": (None, [_P]),
        "sd_rosenbrock_stepper": (_P, [_P]),
        "sd_rosenbrock_start": (None, [_P, _D, _P, _P, _D]),
        "sd_energy_new": (c.POINTER(Energy), [_P, _P, _I, _I]),
        "sd_energy_free": (None, [_P]),
        "sd_energy_stepper": (_P, [_P]),
        "sd_energy_start": (None, [_P, _D, _P, _P, _D]),
        "sd_settle_new": (c.POINTER(Settle), [_P, _P, _I]),
        "sd_settle_take": (c.c_int, [_P, _P]),
        "sd_settle_widen": (c.c_int, [*[_P] * 6, _I]),
        "sd_settle_pivoted": (_P, [_P]),
        "sd_condensed_bind": (None, [_P, _P]),
        "sd_expanded_new": (c.POINTER(Expanded), [_P, _P, _I]),
        "sd_expanded_show": (None, [_P, _P, _P]),
        "sd_expanded_free": (None, [_P]),
        "sd_expanded_stepper": (_P, [_P]),
        "sd_expanded_start": (None, [_P, _D, _P, _P, _D]),
        "sd_settle_free": (None, [_P]),
        "sd_settle_point": (c.c_int, [_P, _D, _P, _P]),
        "sd_least_norm_new": (c.POINTER(LeastNorm), [_P, _P, _I, _I]),
        "sd_least_norm_free": (None, [_P]),
        "sd_least_norm_apply": (c.c_int, [_P, _D, _P, _P]),
        "sd_run_new": (c.POINTER(Run), [_P, _P, _I, _I, _I, _I]),
        "sd_ledgers_clear": (None, [_P]),
        "sd_run_free": (None, [_P]),
        "sd_run_restart": (None, [_P, _D, _D, _P, _P, _P, _P]),
        "sd_run_advance": (c.c_int, [_P, _L, _D]),
        "sd_run_accept": (c.c_int, [_P, _D, _I]),
        "sd_run_drain": (c.c_int, [_P]),
        "sd_linear_pivoted": (_P, [_P]),
        "sd_linear_replayed": (None, [_P]),
        "sd_code_allow": (None, [_I]),
        "sd_linear_z_pivoted": (_P, [_P]),
        "sd_linear_again": (None, [_P]),
        "sd_linear_z_replayed": (None, [_P]),
        "sd_linear_z_again": (None, [_P]),
        "sd_linear_z_factor": (_I, [_P, _P, _P]),
        "sd_linear_z_solve": (None, [_P, _P]),
        "sd_firsts": (None, [_I, _P, _P]),
        "sd_pairs": (_L, [_I, _I, _I, _P, _P, _P, _P, _P]),
        "sd_column_order": (c.c_int, [_I, _I, _P, _P, _P, _P]),
        "sd_both_ends": (c.c_int, [_I, _P, _P, _P]),
        "sd_trim": (None, []),
        "sd_threads": (c.c_int, []),
        "sd_threads_use": (None, [c.c_int]),
        "sd_determined": (c.c_int, [_I, _I, *[_P] * 4, _D, _L, _P, _P]),
        "sd_substituted": (c.c_int, [_I, _I, *[_P] * 3, _D, _P, _P]),
        "sd_add_sizes": (None, [_I, *[_P] * 5]),
        "sd_to_size_one": (c.c_int, [_I, _I, _P, _D, _P, _P]),
        "sd_add_product": (None, [_I, *[_P] * 5]),
        "sd_left_open": (c.c_int, [_I, _I, *[_P] * 4, _D, _L, _P]),
        "sd_match": (_I, [_I, _I, _P, _P, _I, _P, _P]),
        "sd_peel": (_I, [_I, _I, _I, _P, _P, _P, _D, _P]),
        "sd_propagate": (c.c_int, [_P, _P, _P, _P, _I, _P]),
        "sd_excitation": (_D, [_P, _D, _D, _P, _P, _P, _I, _D, _P]),
        "sd_row_sizes": (c.c_int, [_P, _D, _I, _I, _P, _P, _I, _P, _P, _I, _P]),
        "sd_relaxed": (c.c_int, [_P, _P, _I, *[_P] * 4, _D, _P]),
        "sd_response": (c.c_int, [_P, _P, _P, _D, _D, _D, *[_P] * 4]),
        "sd_magnitudes": (c.c_int, [_P, _P, _D, _D, *[_P] * 6, c.c_int, _P, _P]),
        "sd_compliance": (c.c_int, [_P] * 4),
        "sd_confirmed": (c.c_int, [_P, _P, _D, _P, _P, _P]),
        "sd_unresolved": (c.c_int, [*[_P] * 5]),
        "sd_noise": (c.c_int, [*[_P] * 7, _D, _I, _D, _P]),
        "sd_scale": (c.c_int, [_P, _P, _I, _P, _P, _I, _P, _P, _P, _I, _P]),
        "sd_sparse_factors": (None, [_I, _I, _I, *[_P] * 5]),
        "sd_factors": (None, [_I, _I, _P, _P, _P, _P]),
        "sd_rank": (c.c_int, [_I, _I, _P, _D]),
        "sd_nearest": (c.c_int, [_I, _I, _P, _P, _D, _P]),
        "sd_graded": (c.c_int, [_I, _I, _P, _P, _P]),
        "sd_regular": (c.c_int, [_I, _P, _P, _P, _D]),
        "sd_pencil_index": (c.c_int, [_I, _P, _P, _P, _P, _I]),
        "sd_start_residual": (c.c_int, [_P, _D, _P, _P]),
        "sd_start_jacobian": (c.c_int, [_P, _D, _P, _P]),
        "sd_search_measure": (c.c_int, [_P]),
        "sd_search_solve": (c.c_int, [_P]),
        "sd_many_runs": (None, [_P, _I, *[_P] * 10]),
        "sd_run_observe": (None, [_P, _D, _P]),
    }
    for name, (result, arguments) in signatures.items():
        function = getattr(core, name)
        function.restype = result
        function.argtypes = arguments
    return core


core: Any = _load()
