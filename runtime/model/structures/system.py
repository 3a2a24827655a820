"""The structures of core/system/*.h."""

from __future__ import annotations

import ctypes as c

from sysdyn.runtime.model.structures.c_types import D, I, L, P

CAUSES = (
    "", "newton", "error_test", "singular", "nonfinite", "step_too_small", "stopped", "memory", "stiff", "outgrown",
)  # fmt: skip

ROWS = c.CFUNCTYPE(None, c.c_void_p, c.c_double, c.c_void_p, c.c_void_p, c.c_void_p)
"""sd_rows and sd_entries: frame, t, y, yd, out."""

PROVIDE = c.CFUNCTYPE(c.c_int)
"""provide of sd_settle."""


class Frame(c.Structure):
    """sd_frame."""

    _fields_ = [("p", P), ("ix", P), ("at", P), ("to", P), ("spared", P)]


class Lines(c.Structure):
    """sd_lines."""

    _fields_ = [("number", I), ("width", I), ("first", P), ("step", P)]


class Shares(c.Structure):
    """sd_shares."""

    _fields_ = [("number", I), ("width", I), *[(name, P) for name in ["from_", "from_step", "to", "to_step", "share"]]]


class Call(c.Structure):
    """sd_call."""

    _fields_ = [
        ("rows", P),
        ("dy", P),
        ("dyd", P),
        ("frame", Frame),
        ("n_dy", I),
        ("n_dyd", I),
        ("slot_dy", P),
        ("slot_dyd", P),
        ("stretches_dy", I),
        ("stretches_dyd", I),
        ("lines_dy", P),
        ("lines_dyd", P),
    ]


class System(c.Structure):
    """sd_system."""

    _fields_ = [
        ("unknowns", I),
        ("rows", I),
        ("entries", I),
        ("calls", I),
        ("kinematics", I),
        ("k_spans", I),
        ("column", P),
        ("row", P),
        ("call", P),
        ("k_q", P),
        ("k_f", P),
        ("k_slot_q", P),
        ("k_slot_f", P),
        ("k_span", P),
        ("k_scale", P),
        ("held", I),
        ("clear", I),
        *[(name, P) for name in ["held_row", "held_unknown", "held_slot", "held_rate", "cleared"]],
        ("scales", I),
        ("scale", P),
        ("v", P),
        ("stop", P),
        ("residual_evaluations", L),
        ("jacobian_evaluations", L),
        ("left", P),
        ("steady", I),
        ("together", I),
    ]


class Left(c.Structure):
    """sd_left."""

    _fields_ = [("residual", P), ("jacobian", P), ("steep", P)]


class PlaceSpan(c.Structure):
    """sd_span."""

    _fields_ = [("full", I), ("kept", I), ("number", I)]


class Straight(c.Structure):
    """sd_straight."""

    _fields_ = [
        *[(name, I) for name in ["place", "number", "terms", "alike", "audited", "rated"]],
        *[(name, P) for name in ["source", "factor", "constant"]],
    ]


class Condensed(c.Structure):
    """sd_condensed."""

    _fields_ = [
        ("left", Left),
        ("full", P),
        *[(name, I) for name in ["unknowns", "rows", "unknown_spans", "row_spans"]],
        *[(name, I) for name in ["rate_spans", "rest_spans", "own_spans", "straights"]],
        ("observed_rates", I),
        *[(name, P) for name in ["unknown", "row", "rate", "rest", "own", "straight"]],
        ("products", L),
        *[(name, P) for name in ["from_", "to", "share"]],
        ("stretches", L),
        *[(name, P) for name in ["shares", "y", "yd", "r", "slope"]],
    ]


class Settle(c.Structure):
    """sd_settle."""

    _fields_ = [
        ("system", P),
        ("linear", P),
        ("unknowns", I),
        ("rates", I),
        ("rows", I),
        *[
            (name, P)
            for name in [
                "rate",
                "slot_y",
                "slot_y_t",
                "slot_yd",
                "slot_yd_t",
                "slot_x",
                "slot_r",
                "state",
                "pair",
                "slot_pair",
                "slot_pair_t",
            ]
        ],
        ("pairs", I),
        ("follows", D),
        ("scale", P),
        ("time", D),
        ("within", D),
        ("sort", P),
        ("k_span", P),
        ("k_spans", I),
        *[(name, P) for name in ["jy", "jyd", "matrix", "row_scale", "r", "x", "x0", "step", "memory", "work", "lent"]],
        ("lent_room", c.c_size_t),
        *[(name, P) for name in ["met", "usual"]],
        ("basis", P),
        ("basis_entries", I),
        *[(name, P) for name in ["basis_column", "basis_row", "basis_value"]],
        ("hold", D),
        ("enough", D),
        ("slack", D),
        ("still", D),
        ("most", D),
        ("ready", I),
        ("refused", I),
        ("determined", I),
        ("residual", D),
        ("own", D),
        ("constraints", D),
        ("calls", L),
        ("failures", L),
        ("seen", P),
        ("room", P),
        ("provide", P),
        ("taken", P),
        ("drift", D),
        ("contracted", D),
        ("floor", D),
        ("told", P),
    ]


class LeastNorm(c.Structure):
    """sd_least_norm."""

    _fields_ = [
        ("system", P),
        ("linear", P),
        *[(name, I) for name in ["multipliers", "coordinates", "entries"]],
        *[(name, P) for name in ["place", "source", "coordinate", "slot", "slot_t", "slot_diagonal"]],
        *[(name, P) for name in ["jy", "jyd", "matrix", "x", "size", "memory"]],
    ]
