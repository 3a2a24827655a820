"""The structures of runtime/core/*.h as ctypes sees them.

The layouts mirror the headers field by field; a test compares their sizes with the compiler's.
"""

from __future__ import annotations

import ctypes as c

MAX_ORDER = 5
STAGES = 7
PAIRS = 3
POINTS = 3
DOPRI_STAGES = 16
DOPRI_DENSE = 7
ENERGY_STAGES = 6
ROW_HEAD = 8
CAUSES = ("", "newton", "error_test", "singular", "nonfinite", "step_too_small", "stopped", "memory", "stiff")

ROWS = c.CFUNCTYPE(None, c.c_void_p, c.c_double, c.c_void_p, c.c_void_p, c.c_void_p)
"""sd_rows and sd_entries: frame, t, y, yd, out."""

PROVIDE = c.CFUNCTYPE(c.c_int)
"""provide of sd_settle."""

_D, _I, _L, _P = c.c_double, c.c_int32, c.c_int64, c.c_void_p
_ORDERS = _D * (MAX_ORDER + 2)


class Frame(c.Structure):
    """sd_frame."""

    _fields_ = [("p", _P), ("ix", _P), ("at", _P), ("to", _P), ("spared", _P)]


class Call(c.Structure):
    """sd_call."""

    _fields_ = [
        ("rows", _P),
        ("dy", _P),
        ("dyd", _P),
        ("frame", Frame),
        ("n_dy", _I),
        ("n_dyd", _I),
        ("slot_dy", _P),
        ("slot_dyd", _P),
    ]


class System(c.Structure):
    """sd_system."""

    _fields_ = [
        ("unknowns", _I),
        ("rows", _I),
        ("entries", _I),
        ("calls", _I),
        ("kinematics", _I),
        ("column", _P),
        ("row", _P),
        ("call", _P),
        ("k_row", _P),
        ("k_q", _P),
        ("k_f", _P),
        ("k_slot_q", _P),
        ("k_slot_f", _P),
        ("k_scale", _P),
        ("held", _I),
        ("clear", _I),
        *[(name, _P) for name in ["held_row", "held_unknown", "held_slot", "held_rate", "cleared"]],
        ("scales", _I),
        ("scale", _P),
        ("v", _P),
        ("stop", _P),
        ("residual_evaluations", _L),
        ("jacobian_evaluations", _L),
        ("left", _P),
        ("together", _I),
    ]


class Left(c.Structure):
    """sd_left."""

    _fields_ = [("residual", _P), ("jacobian", _P), ("steep", _P)]


class Span(c.Structure):
    """sd_span."""

    _fields_ = [("full", _I), ("kept", _I), ("number", _I)]


class Straight(c.Structure):
    """sd_straight."""

    _fields_ = [
        *[(name, _I) for name in ["place", "number", "terms", "alike"]],
        *[(name, _P) for name in ["source", "factor", "constant"]],
    ]


class Condensed(c.Structure):
    """sd_condensed."""

    _fields_ = [
        ("left", Left),
        ("full", _P),
        *[(name, _I) for name in ["unknowns", "rows", "unknown_spans", "row_spans", "straights"]],
        ("observed_rates", _I),
        *[(name, _P) for name in ["unknown", "row", "straight"]],
        ("products", _L),
        *[(name, _P) for name in ["from_", "to", "share", "y", "yd", "r", "slope"]],
    ]


class Order(c.Structure):
    """sd_order."""

    _fields_ = [*[(name, _P) for name in ["columns", "own", "otherwise"]], ("most", _L), ("paired", _I)]


class Linear(c.Structure):
    """sd_linear."""

    _fields_ = [
        ("n", _I),
        ("entries", _I),
        ("column", _P),
        ("row", _P),
        ("row_scale", _P),
        ("column_scale", _P),
        ("scaled", _P),
        ("dense", _P),
        ("pivot", _P),
        ("sparse", _P),
        ("work", _P),
        ("work2", _P),
        ("smallest", _D),
        ("bad_row", _I),
        ("bad_column", _I),
        ("factorisations", _L),
        ("pivotings", _L),
        ("null_pivot", _D),
        ("idle", _P),
        ("place", _P),
        ("rank", _I),
        ("null", _P),
        ("null_room", c.c_size_t),
        ("nulls", _I),
        ("pivoted", _I),
        ("replayed", _I),
        ("elimination", _P),
        ("otherwise", _P),
    ]


class Stepper(c.Structure):
    """sd_stepper."""

    _fields_ = [
        ("self", _P),
        ("system", _P),
        ("n", _I),
        *[(name, _P) for name in ["t", "t_end", "y", "yd", "taken", "step", "dense", "refine", "start"]],
        ("nodes", _I),
        *[(name, _P) for name in ["node", "node_weight", "node_y", "node_yd", "part_y", "part_yd", "length"]],
        *[(name, _P) for name in ["moves", "part_moves"]],
        ("collocated", _I),
        ("show", _P),
        ("values", _P),
    ]


class Expanded(c.Structure):
    """sd_expanded."""

    _fields_ = [
        ("face", Stepper),
        *[(name, _P) for name in ["inner", "condensed", "y", "yd", "z", "zd", "memory", "met", "magnitude"]],
    ]


class Bdf(c.Structure):
    """sd_bdf."""

    _fields_ = [
        ("system", _P),
        ("linear", _P),
        ("n", _I),
        ("max_order", _I),
        ("tested", _I),
        ("rtol", _D),
        ("t_end", _D),
        ("h_max", _D),
        ("fixed_h", _D),
        ("atol", _P),
        ("magnitude", _P),
        ("met", _P),
        ("test", _P),
        ("power", _P),
        ("common_from", _P),
        ("common", _P),
        ("commons", _I),
        ("t", _D),
        ("h", _D),
        ("h_used", _D),
        ("cj", _D),
        ("cj_factored", _D),
        ("contraction", _D),
        ("order", _I),
        ("order_used", _I),
        ("ns", _I),
        ("rising", _I),
        ("fresh_jacobian", _I),
        ("jacobian_age", _I),
        ("ready", _I),
        ("psi", _ORDERS),
        ("alpha", _ORDERS),
        ("beta", _ORDERS),
        ("sigma", _ORDERS),
        ("gamma", _ORDERS),
        ("phi", _P * (MAX_ORDER + 2)),
        *[
            (name, _P)
            for name in (
                [
                    "y",
                    "yd",
                    "ee",
                    "weight",
                    "newton_weight",
                    "test_weight",
                    "delta",
                    "moved",
                    "moved_d",
                    "scale",
                    "terms",
                    "rate",
                    "jy",
                    "jyd",
                    "g",
                    "memory",
                    "newton_power",
                    "test_power",
                ]
            )
        ],
        ("h_weighed", _D),
        ("powered", _P),
        ("powers", _I),
        ("error_next", _D),
        ("steps", _L),
        ("rejected_steps", _L),
        ("newton_failures", _L),
        ("newton_iterations", _L),
        ("taken", _L),
        ("cause", _I),
        ("bad_row", _I),
        ("bad_column", _I),
        ("project", _P),
        ("stepper", Stepper),
    ]


class RadauMethod(c.Structure):
    """sd_radau_method."""

    _fields_ = [
        ("stages", _I),
        ("pairs", _I),
        *[(name, _D * STAGES) for name in ["c", "b"]],
        ("inverse", _D * STAGES * STAGES),
        ("gamma", _D),
        ("lambda_", _D * 2 * PAIRS),
        *[(name, _D * STAGES) for name in ["column", "row"]],
        *[(name, _D * 2 * STAGES * PAIRS) for name in ["columns", "rows"]],
        ("estimate", _D * STAGES),
        ("lift", _D * (STAGES + 1)),
        ("taylor", _D * STAGES * 2),
        ("constant", _D),
    ]


class Radau(c.Structure):
    """sd_radau."""

    _fields_ = [
        ("system", _P),
        ("linear", _P),
        ("complex_linear", _P * PAIRS),
        *[(name, _I) for name in ["n", "tested", "stages", "most_stages"]],
        *[(name, _D) for name in ["rtol", "t_end", "h_max", "fixed_h"]],
        *[(name, _P) for name in ["atol", "magnitude", "met", "test", "power", "smooth"]],
        ("tolerance", _D),
        ("strict", _D * 3),
        *[(name, _D) for name in ["t", "h", "h_used", "h_factored", "h_before", "h_accepted"]],
        *[(name, _D) for name in ["error_accepted", "theta", "state_size", "growth", "longest"]],
        *[(name, _I) for name in ["balances", "pressed", "ready", "old_jacobian", "rejected"]],
        *[(name, _P) for name in ["method", "used"]],
        *[(name, _I) for name in ["since", "hold", "creeping"]],
        *[(name, _P) for name in ["phi", "yd", "last", "before"]],
        ("slope", _P * POINTS),
        ("refined", _I * POINTS),
        *[(name, _P * STAGES) for name in ["z", "kept", "d", "base", "full"]],
        *[(name, _P) for name in ["first", "pull", "gap"]],
        *[(name, _D * POINTS) for name in ["apart", "bend"]],
        *[(name, _P) for name in ["y", "rate", "ee", "weight"]],
        *[(name, _P) for name in ["newton_weight", "scale", "terms", "jy", "jyd", "g", "memory"]],
        ("w", _P * PAIRS),
        ("right", _P),
        *[(name, _P) for name in ["beside", "other", "point_y", "point_rate"]],
        *[(name, _L) for name in ["steps", "rejected_steps", "newton_failures", "newton_iterations"]],
        *[(name, _L) for name in ["factorisations", "taken"]],
        *[(name, _I) for name in ["cause", "bad_row", "bad_column"]],
        ("project", _P),
        ("stepper", Stepper),
    ]


class Underlying(c.Structure):
    """sd_underlying."""

    _fields_ = [
        *[(name, _P) for name in ["system", "matrix", "applied", "position", "velocity", "linear"]],
        *[(name, _I) for name in ["n", "first", "solved", "direct"]],
        *[(name, _P) for name in ["unknown", "rate", "column", "source", "from_rate", "magnitude", "displaced"]],
        *[(name, _P) for name in ["goal_position", "goal_velocity"]],
        ("tolerance", _D),
        *[(name, _P) for name in ["jy", "jyd", "values", "r", "step", "rest", "memory"]],
        *[(name, _I) for name in ["ready", "bad_row", "bad_column"]],
        ("drift", _D),
    ]


class Dopri(c.Structure):
    """sd_dopri."""

    _fields_ = [
        ("system", _P),
        ("underlying", _P),
        ("n", _I),
        ("tested", _I),
        *[(name, _D) for name in ["rtol", "t_end", "h_max", "fixed_h"]],
        *[(name, _P) for name in ["atol", "magnitude", "met", "test", "power"]],
        *[(name, _D) for name in ["patience", "spare", "opening", "t", "h", "h_used", "error_accepted"]],
        *[(name, _I) for name in ["rejected", "dense", "stiff", "smooth", "outrun", "even"]],
        *[(name, _P) for name in ["phi", "yd"]],
        *[(name, _P * DOPRI_STAGES) for name in ["y", "rate"]],
        ("f", _P * DOPRI_DENSE),
        *[(name, _P) for name in ["ee", "weight", "memory"]],
        *[(name, _L) for name in ["steps", "rejected_steps", "newton_failures", "taken"]],
        *[(name, _I) for name in ["cause", "bad_row", "bad_column"]],
        ("stepper", Stepper),
    ]


class Collocation(c.Structure):
    """sd_collocation."""

    _fields_ = [(name, _P * ENERGY_STAGES) for name in ["y", "rate"]]


class Energy(c.Structure):
    """sd_energy."""

    _fields_ = [
        ("system", _P),
        ("underlying", _P),
        ("n", _I),
        ("tested", _I),
        *[(name, _D) for name in ["rtol", "t_end", "h_max", "fixed_h"]],
        *[(name, _P) for name in ["atol", "magnitude", "met", "test", "power"]],
        ("patience", _D),
        ("audit", _P),
        ("audited", _I),
        *[(name, _D) for name in ["t", "h", "h_used", "wanted", "anchor", "anchor_end"]],
        *[(name, _L) for name in ["count", "done"]],
        *[(name, _D) for name in ["rough", "before", "rough_before"]],
        *[(name, _L) for name in ["window", "since", "held"]],
        *[(name, _I) for name in ["limited", "grown"]],
        *[(name, _D) for name in ["frequency", "energy", "lost", "content"]],
        *[(name, _I) for name in ["finding", "guessed"]],
        ("dense_t", _D),
        ("inner_ready", _I),
        *[(name, _P) for name in ["phi", "yd", "rest", "from", "from_d", "from_rest"]],
        ("from_t", _D),
        ("from_energy", _D),
        *[(name, Collocation) for name in ["stage", "side"]],
        *[(name, _P) for name in ["raw", "half", "half_rest", "inner", "inner_d", "trial", "old_y", "old_rate"]],
        *[(name, _P) for name in ["begin", "position", "velocity"]],
        *[(name, _P) for name in ["base", "sample", "work", "moves", "inner_moves", "ee", "weight", "memory"]],
        *[(name, _L) for name in ["steps", "rejected_steps", "newton_failures", "taken"]],
        *[(name, _I) for name in ["cause", "bad_row", "bad_column"]],
        ("stepper", Stepper),
    ]


class Settle(c.Structure):
    """sd_settle."""

    _fields_ = [
        ("system", _P),
        ("linear", _P),
        ("unknowns", _I),
        ("rates", _I),
        ("rows", _I),
        *[
            (name, _P)
            for name in [
                "rate",
                "slot_y",
                "slot_y_t",
                "slot_yd",
                "slot_yd_t",
                "slot_x",
                "slot_r",
                "weight",
                "scale",
            ]
        ],
        ("sort", _P),
        ("k_q", _P),
        ("k_f", _P),
        ("kinematics", _I),
        *[(name, _P) for name in ["jy", "jyd", "matrix", "row_scale", "r", "x", "x0", "step", "met", "memory"]],
        *[(name, _P) for name in ["basis", "basis_column", "basis_row", "basis_y", "basis_yd"]],
        *[(name, _P) for name in ["lift", "basis_value"]],
        ("hold", _D),
        ("enough", _D),
        ("slack", _D),
        ("ready", _I),
        ("refused", _I),
        ("determined", _I),
        ("residual", _D),
        ("own", _D),
        ("constraints", _D),
        ("calls", _L),
        ("failures", _L),
        ("seen", _P),
        ("room", _P),
        ("provide", _P),
        ("taken", _P),
        ("drift", _D),
        ("contracted", _D),
    ]


class LeastNorm(c.Structure):
    """sd_least_norm."""

    _fields_ = [
        ("system", _P),
        ("linear", _P),
        *[(name, _I) for name in ["multipliers", "coordinates", "entries"]],
        *[(name, _P) for name in ["place", "source", "coordinate", "slot", "slot_t", "slot_diagonal"]],
        *[(name, _P) for name in ["jy", "jyd", "matrix", "x", "size", "memory"]],
    ]


class Record(c.Structure):
    """sd_record."""

    _fields_ = [("t", _D), ("value", _D), ("ledger", _I)]


class Ledgers(c.Structure):
    """sd_ledgers."""

    _fields_ = [
        ("count", _I),
        ("elements", _I),
        *[(name, _P) for name in ["contents", "of", "inertia", "gross", "most", "largest", "element", "record"]],
        ("records", _I),
        ("room", _I),
        *[(name, _P) for name in ["stored", "balance", "highest", "dissipated", "supplied", "value", "before"]],
        ("begun", _I),
        ("lost", _I),
    ]


class Watch(c.Structure):
    """sd_watch."""

    _fields_ = [("row", _I), ("side", _I), ("tolerance", _D)]


class Held(c.Structure):
    """sd_held."""

    _fields_ = [
        *[(name, _I) for name in ["held", "clear"]],
        *[(name, _P) for name in ["row", "unknown", "slot", "rate", "cleared"]],
    ]


class Mode(c.Structure):
    """sd_mode."""

    _fields_ = [
        *[(name, _I) for name in ["watches", "first"]],
        *[(name, _P) for name in ["row", "side", "rate", "value", "relation", "holds", "held"]],
    ]


class Transition(c.Structure):
    """sd_transition."""

    _fields_ = [
        *[(name, _I) for name in ["to", "next", "crossed", "due", "rounds", "moves"]],
        *[(name, _P) for name in ["which", "sample", "end", "kind", "place", "read", "sides"]],
        ("entries", _L),
    ]


class Contact(c.Structure):
    """sd_contact."""

    _fields_ = [(name, _I) for name in ["kind", "value", "rate", "multiplier", "bound", "guard", "sense"]]


class Kink(c.Structure):
    """sd_kink."""

    _fields_ = [(name, _I) for name in ["branch", "value", "rate", "above", "below"]]


class Modes(c.Structure):
    """sd_modes."""

    _fields_ = [
        *[(name, _P) for name in ["mode", "transition"]],
        *[(name, _I) for name in ["now", "parameters", "places", "relations", "contacts", "kinks"]],
        *[(name, _I) for name in ["systems", "samples", "observed", "alikes", "unknowns"]],
        *[(name, _P) for name in ["p", "place", "relation_row", "relation_moves", "contact", "kink", "system"]],
        *[(name, _P) for name in ["period", "next"]],
        *[(name, _D) for name in ["first", "segment", "last", "nothing", "begin", "longest"]],
        *[(name, _P) for name in ["t_end", "h_max", "largest"]],
        *[(name, _D) for name in ["small", "still"]],
        *[(name, _P) for name in ["alike", "alike_end", "state", "differential", "unnamed"]],
        *[(name, _P) for name in ["met", "magnitude", "resolved"]],
        *[(name, _D) for name in ["unknown_size", "round_off"]],
        *[(name, _P) for name in ["rate", "y", "yd", "before", "before_d", "restart", "restart_d"]],
        *[(name, _P) for name in ["values", "low", "high", "p_before", "p_after"]],
        *[(name, _P) for name in ["exact", "found", "which", "watch", "log"]],
        ("left", _L),
        *[(name, _I) for name in ["width", "room", "logged", "waits"]],
    ]


class Run(c.Structure):
    """sd_run."""

    _fields_ = [
        ("stepper", _P),
        ("settle", _P),
        ("least_norm", _P),
        ("ledgers", _P),
        ("written", _I),
        ("observed", _I),
        ("audited", _I),
        ("audit", _P),
        ("powers", _P),
        ("rated", _I),
        *[
            (name, _P)
            for name in [
                "observe",
                "observe_rate",
                "observe_scale",
                "audit_at",
                "instant",
                "instant_kind",
            ]
        ],
        ("instants", _I),
        ("every_step", _I),
        ("sample_steps", _I),
        ("bare", _I),
        ("unsummed", _I),
        ("rough", _D),
        ("apart", _D),
        ("start_rate", _P),
        ("row", _P),
        ("room", _I),
        ("rows", _I),
        ("next", _I),
        ("pending", _I),
        ("started", _I),
        ("fresh", _I),
        ("sampled", _I),
        *[(name, _D) for name in ["stored", "dissipated", "supplied", "step_dissipated", "step_supplied"]],
        ("t_from", _D),
        ("t_row", _D),
        *[(name, _P) for name in ["power", "after", "sample", "integral", "end"]],
        *[(name, _P) for name in ["point", "point_d", "values", "largest", "slope", "memory"]],
        ("rows_written", _L),
        ("first_energy", _D),
        ("watch", _P),
        ("watches", _I),
        ("end_kind", _I),
        ("start_kind", _I),
        ("t_to", _D),
        ("magnitude", _P),
        ("beyond", _D),
        ("projected", _P),
        ("modes", _P),
    ]


class Region(c.Structure):
    """sd_region."""

    _fields_ = [("at", _P), ("copy", _P), ("size", _L)]


COUNTERS = 8
"""Of the work of a pass."""


class Pass(c.Structure):
    """sd_pass."""

    _fields_ = [
        ("run", _P),
        ("region", _P),
        *[(name, _I) for name in ["regions", "n"]],
        *[(name, _P) for name in ["y", "yd", "start_rate", "differential"]],
        *[(name, _P) for name in ["magnitude", "met", "least", "project", "rtol", "h_max", "opening"]],
        ("longest", _D),
        ("counter", _P * COUNTERS),
    ]


class RunClaim(c.Structure):
    """sd_claim."""

    _fields_ = [*[(name, _I) for name in ["moment", "op", "left", "right", "within"]], ("at", _D)]


class RunSamples(c.Structure):
    """sd_samples."""

    _fields_ = [("time", _P), ("value", _P), ("late", _P), ("number", _I), ("room", _I)]


class Many(c.Structure):
    """sd_many."""

    _fields_ = [
        ("p", _P),
        *[(name, _I) for name in ["parameters", "written", "columns", "observed"]],
        *[(name, _P) for name in ["start", "region"]],
        ("regions", _I),
        *[(name, _P) for name in ["y0", "yd0", "anchored", "guessed", "guess", "size"]],
        ("smallest", _D),
        *[(name, _P) for name in ["jy0", "jyd0", "counts", "jy", "jyd"]],
        *[(name, _I) for name in ["flows", "inertias"]],
        *[(name, _P) for name in ["inertia_row", "inertia_column", "inertia_entry", "inertia_rate"]],
        *[(name, _P) for name in ["inertia_sign", "inertia"]],
        *[(name, _D) for name in ["t0", "t1"]],
        *[(name, _P) for name in ["system", "sizing", "order", "form_jy", "form_jyd", "found"]],
        ("tau", _D),
        ("passes", Pass * 2),
        *[(name, _P) for name in ["column", "target", "unit", "unit_of"]],
        *[(name, _I) for name in ["units", "known"]],
        *[(name, _D) for name in ["late", "power", "credit", "finest", "far"]],
        *[(name, _D) for name in ["ratio", "little", "growth", "few_steps", "many_steps"]],
        ("tolerance", _D * 2),
        ("max_steps", _L),
        ("energy", _D),
        ("claim", _P),
        *[(name, _I) for name in ["claims", "keep"]],
        ("thin", _P),
        ("thins", _I),
        ("sample", RunSamples * 3),
        *[(name, _I) for name in ["stride", "seen", "rows", "thinned", "broken", "judged"]],
        ("last_time", _D),
        *[(name, _P) for name in ["end", "least", "most", "thick", "work", "kind"]],
        ("held", _I),
        ("spent", _D),
        ("counted", _L * COUNTERS),
    ]


class Balance(c.Structure):
    """sd_balance."""

    _fields_ = [
        ("unknowns", _I),
        ("rows", _I),
        ("entries", _I),
        ("kinds", _I),
        ("row", _P),
        ("column", _P),
        ("kind", _P),
    ]



class Sizing(c.Structure):
    """sd_sizing."""

    _fields_ = [
        *[(name, _P) for name in ["balance", "nominal", "kind", "partner"]],
        ("own", _P * 4),
        ("owns", _I * 4),
        ("efforts", _I),
        *[(name, _P) for name in ["effort", "moved"]],
        ("parts", _I),
        ("rungs", _I),
        *[(name, _P) for name in ["part", "rung"]],
    ]

class RowsOfStart(c.Structure):
    """sd_rows_of_start."""

    _fields_ = [
        ("system", _P),
        ("balance", Balance),
        ("written", _I),
        ("rates", _I),
        ("rated", _I),
        ("kinematics", _I),
        ("rate", _P),
        ("entry", _P),
        ("k_q", _P),
        ("k_f", _P),
        ("extended", _I),
    ]


class Search(c.Structure):
    """sd_search."""

    _fields_ = [
        ("start", _P),
        ("use", _P),
        ("free", _P),
        ("guess", _P),
        ("scale", _P),
        ("weight", _P),
        ("t", _D),
        ("most", _I),
        ("folds", _I),
        ("share", _D),
        ("spent", _D),
        ("largest", _D),
        ("x", _P),
        ("scaled", _P),
        ("residual", _D),
    ]
