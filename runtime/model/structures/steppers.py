"""The structures of core/steppers/*.h."""

from __future__ import annotations

import ctypes as c

from sysdyn.runtime import _core
from sysdyn.runtime.model.structures.c_types import D, I, L, P

MAX_ORDER: int = _core.SD_MAX_ORDER
STAGES: int = _core.SD_STAGES
PAIRS: int = _core.SD_PAIRS
POINTS: int = _core.SD_POINTS
DOPRI_STAGES: int = _core.SD_DOPRI_ALL
DOPRI_DENSE: int = _core.SD_DOPRI_DENSE
ENERGY_STAGES: int = _core.SD_ENERGY_STAGES
ROSENBROCK_STAGES: int = _core.SD_ROSENBROCK_STAGES
ROSENBROCK_DENSE: int = _core.SD_ROSENBROCK_DENSE
_ORDERS = D * (MAX_ORDER + 2)


class Stepper(c.Structure):
    """sd_stepper."""

    _fields_ = [
        ("self", P),
        ("ivp", P),
        ("n", I),
        *[(name, P) for name in ["y", "yd", "step", "dense", "refine", "start"]],
        ("nodes", I),
        *[(name, P) for name in ["node", "node_weight", "node_y", "node_yd", "part_y", "part_yd", "length"]],
        *[(name, P) for name in ["moves", "part_moves"]],
        ("collocated", I),
        ("show", P),
        ("values", P),
        ("onto", P),
        ("spare", P),
    ]


class Expanded(c.Structure):
    """sd_expanded."""

    _fields_ = [
        ("face", Stepper),
        *[(name, P) for name in ["inner", "condensed", "z"]],
        ("room", c.c_size_t),
        *[(name, P) for name in ["y", "met", "magnitude"]],
    ]


class Ivp(c.Structure):
    """sd_ivp: what all methods have in common; each has these fields under their own names."""

    _fields_ = [
        ("system", P),
        ("n", I),
        *[(name, D) for name in ["rtol", "t_end", "h_max", "fixed_h"]],
        *[(name, P) for name in ["atol", "magnitude", "met", "test", "power", "project"]],
        ("tested", I),
        *[(name, D) for name in ["t", "h", "h_used"]],
        *[(name, P) for name in ["ee", "weight"]],
        *[(name, L) for name in ["steps", "rejected_steps", "newton_failures", "taken"]],
        *[(name, I) for name in ["orientation", "outgrown", "resting"]],
        *[(name, I) for name in ["cause", "bad_row", "bad_column"]],
        ("stepper", Stepper),
    ]


class Bdf(c.Structure):
    """sd_bdf."""

    _anonymous_ = ("ivp",)
    _fields_ = [
        ("ivp", Ivp),
        ("linear", P),
        ("max_order", I),
        *[(name, P) for name in ["common_from", "common"]],
        ("commons", I),
        *[(name, D) for name in ["cj", "cj_factored", "cj_last", "cj_slopes", "contraction"]],
        *[(name, I) for name in ["order", "order_used", "ns", "rising"]],
        *[(name, I) for name in ["fresh_jacobian", "jacobian_age", "ready", "extra"]],
        *[(name, _ORDERS) for name in ["psi", "alpha", "beta", "sigma", "gamma"]],
        ("phi", P * (MAX_ORDER + 2)),
        *[(name, P) for name in ["y", "yd", "delta", "moved", "moved_d"]],
        *[(name, P) for name in ["terms", "rate", "jy", "jyd", "g", "memory"]],
        *[(name, P) for name in ["own", "newton_power", "test_power"]],
        ("h_weighed", D),
        ("powered", P),
        ("powers", I),
        ("apart", P),
        ("aparts", I),
        ("error_next", D),
        ("orders", L),
    ]


class RadauMethod(c.Structure):
    """sd_radau_method."""

    _fields_ = [
        ("stages", I),
        ("pairs", I),
        *[(name, D * STAGES) for name in ["c", "b"]],
        ("inverse", D * STAGES * STAGES),
        ("gamma", D),
        ("lambda_", D * 2 * PAIRS),
        *[(name, D * STAGES) for name in ["column", "row"]],
        *[(name, D * 2 * STAGES * PAIRS) for name in ["columns", "rows"]],
        ("estimate", D * STAGES),
        ("lift", D * (STAGES + 1)),
        ("taylor", D * STAGES * 2),
        ("constant", D),
    ]


class Radau(c.Structure):
    """sd_radau."""

    _anonymous_ = ("ivp",)
    _fields_ = [
        ("ivp", Ivp),
        ("linear", P),
        ("complex_linear", P * PAIRS),
        *[(name, I) for name in ["stages", "most_stages"]],
        *[(name, P) for name in ["smooth", "common_from", "common"]],
        ("commons", I),
        ("tolerance", D),
        ("strict", D * 3),
        ("strict_first", D),
        *[(name, D) for name in ["h_factored", "h_before", "h_accepted"]],
        *[(name, D) for name in ["error_accepted", "theta", "state_size", "growth", "longest", "follows"]],
        *[(name, I) for name in ["behind", "balances", "pressed", "ready", "old_jacobian", "rejected", "lasting"]],
        *[(name, P) for name in ["method", "used"]],
        *[(name, I) for name in ["since", "hold", "creeping", "strained", "turned"]],
        ("lead", (D * STAGES) * STAGES),
        ("h_lead", D),
        ("of_lead", P),
        *[(name, P) for name in ["phi", "yd", "last", "before"]],
        ("slope", P * POINTS),
        ("refined", I * POINTS),
        *[(name, P * STAGES) for name in ["z", "kept", "d", "base", "full", "moved"]],
        *[(name, P) for name in ["first", "led", "gap"]],
        *[(name, D * POINTS) for name in ["apart", "bend"]],
        *[(name, P) for name in ["at_zero", "open"]],
        *[(name, P) for name in ["y", "rate", "terms", "jy", "jyd", "g", "work", "at"]],
        *[(name, P) for name in ["newton_weight", "scale", "powered"]],
        ("w", P * PAIRS),
        ("in_place", I),
        ("coupled", P),
    ]


class Underlying(c.Structure):
    """sd_underlying."""

    _fields_ = [
        *[(name, P) for name in ["system", "matrix", "applied", "position", "velocity", "linear"]],
        *[(name, I) for name in ["n", "first", "solved", "direct"]],
        *[(name, P) for name in ["unknown", "rate", "column", "source", "from_rate", "magnitude", "displaced"]],
        *[(name, P) for name in ["goal_position", "goal_velocity"]],
        ("tolerance", D),
        *[(name, P) for name in ["values", "r", "step", "rest", "memory", "place_y", "place_yd", "list"]],
        *[(name, P) for name in ["written", "from", "more"]],
        *[(name, I) for name in ["lists", "mores", "flows", "ready", "placed", "bad_row", "bad_column"]],
        ("factored", P),
        ("factored_at", c.c_int64),
        ("drift", D),
    ]


class Dopri(c.Structure):
    """sd_dopri."""

    _anonymous_ = ("ivp",)
    _fields_ = [
        ("ivp", Ivp),
        ("underlying", P),
        *[(name, D) for name in ["patience", "spare", "opening", "error_accepted", "speed"]],
        *[(name, I) for name in ["rejected", "dense", "stiff", "smooth", "outrun", "even"]],
        *[(name, P) for name in ["phi", "yd"]],
        *[(name, P * DOPRI_STAGES) for name in ["y", "rate"]],
        ("f", P * DOPRI_DENSE),
        *[(name, P) for name in ["moved", "moved_d", "memory"]],
    ]


class Rosenbrock(c.Structure):
    """sd_rosenbrock."""

    _anonymous_ = ("ivp",)
    _fields_ = [
        ("ivp", Ivp),
        ("linear", P),
        ("opening", D),
        *[(name, D) for name in ["h_accepted", "power_accepted", "h_refused", "error_refused"]],
        *[(name, I) for name in ["rejected", "jumped"]],
        *[(name, P) for name in ["phi", "yd", "last", "y", "rate", "known", "drift", "begin"]],
        *[(name, P) for name in ["end", "within", "within_d", "inner"]],
        ("u", P * ROSENBROCK_STAGES),
        ("bend", P * ROSENBROCK_DENSE),
        *[(name, P) for name in ["jy", "jyd", "g", "e", "memory", "jy_end", "jyd_end", "begin_end"]],
        *[(name, I) for name in ["sloped", "lasting"]],
        *[(name, P) for name in ["rate_row", "rate_column"]],
        ("rates", I),
        ("settle", P),
    ]


class Collocation(c.Structure):
    """sd_collocation."""

    _fields_ = [(name, P * ENERGY_STAGES) for name in ["y", "rate"]]


class Energy(c.Structure):
    """sd_energy."""

    _anonymous_ = ("ivp",)
    _fields_ = [
        ("ivp", Ivp),
        ("underlying", P),
        ("patience", D),
        ("audit", P),
        ("audited", I),
        *[(name, D) for name in ["wanted", "anchor", "anchor_end"]],
        *[(name, L) for name in ["count", "done"]],
        *[(name, D) for name in ["rough", "before", "rough_before"]],
        *[(name, L) for name in ["window", "since", "held"]],
        *[(name, I) for name in ["limited", "grown"]],
        *[(name, D) for name in ["frequency", "energy", "lost", "content"]],
        *[(name, I) for name in ["finding", "guessed"]],
        ("dense_t", D),
        ("inner_ready", I),
        *[(name, P) for name in ["phi", "yd", "rest", "from", "from_d", "from_rest"]],
        ("from_t", D),
        ("from_energy", D),
        *[(name, Collocation) for name in ["stage", "side"]],
        *[(name, P) for name in ["raw", "half", "half_rest", "inner", "inner_d", "trial", "old_y", "old_rate"]],
        *[(name, P) for name in ["begin", "position", "velocity"]],
        *[(name, P) for name in ["base", "sample", "work", "moves", "inner_moves", "memory"]],
    ]
