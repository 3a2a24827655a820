"""The structures of core/run/*.h."""

from __future__ import annotations

import ctypes as c

from sysdyn.runtime import _core
from sysdyn.runtime.model.structures.c_types import D, I, L, P

ROW_HEAD: int = _core.SD_ROW_HEAD
NODES: int = _core.SD_NODES
"""SD_NODES: of a method, at most."""
PAST: int = _core.SD_PAST
"""SD_PAST: steps before the last one whose powers are known."""
OWN = 2**31 - 1
"""SD_OWN: the mode that the core has found by itself."""


class Record(c.Structure):
    """sd_record."""

    _fields_ = [("t", D), ("value", D), ("ledger", I)]


class Ledgers(c.Structure):
    """sd_ledgers."""

    _fields_ = [
        ("count", I),
        ("elements", I),
        ("families", I),
        *[(name, P) for name in ["contents", "of", "end", "inertia", "gross", "most", "largest", "element", "record"]],
        ("records", I),
        ("room", I),
        *[(name, P) for name in ["stored", "balance", "highest", "dissipated", "supplied", "value", "before"]],
        ("begun", I),
        ("lost", I),
    ]


class Watch(c.Structure):
    """sd_watch."""

    _fields_ = [("row", I), ("side", I), ("tolerance", D)]


class Held(c.Structure):
    """sd_held."""

    _fields_ = [
        *[(name, I) for name in ["held", "clear"]],
        *[(name, P) for name in ["row", "unknown", "slot", "rate", "cleared"]],
    ]


class Mode(c.Structure):
    """sd_mode."""

    _fields_ = [
        *[(name, I) for name in ["watches", "first"]],
        *[(name, P) for name in ["row", "side", "rate", "value", "relation", "holds", "held"]],
    ]


class Strike(c.Structure):
    """sd_strike."""

    _fields_ = [
        *[(name, P) for name in ["system", "linear"]],
        *[(name, I) for name in ["contact", "row", "own", "n", "moves", "besides"]],
        *[(name, P) for name in ["beside", "unknown", "of_row", "integral", "column", "row_of", "slot", "rated"]],
        ("held", Held),
        ("restitution", D),
        *[(name, P) for name in ["jy", "jyd", "r", "value", "scale", "x", "impulse"]],
    ]


class Transition(c.Structure):
    """sd_transition."""

    _fields_ = [
        *[(name, I) for name in ["number", "to", "next", "crossed", "due", "rounds", "moves"]],
        *[(name, P) for name in ["which", "sample", "end", "kind", "place", "read", "sides"]],
        ("entries", L),
        ("soon", D),
        *[(name, P) for name in ["strike", "momenta"]],
    ]


class Contact(c.Structure):
    """sd_contact."""

    _fields_ = [
        *[(name, I) for name in ["kind", "value", "rate", "multiplier", "bound", "guard", "sense", "acceleration"]],
    ]


class Kink(c.Structure):
    """sd_kink."""

    _fields_ = [
        *[(name, I) for name in ["branch", "value", "rate", "above", "below", "inner", "jumps"]],
        ("passage", D),
    ]


class Piece(c.Structure):
    """sd_piece."""

    _fields_ = [(name, D) for name in ["begin", "end", "label"]]


class Modes(c.Structure):
    """sd_modes."""

    _fields_ = [
        *[(name, P) for name in ["mode", "transition"]],
        ("own", Mode),
        *[(name, I) for name in ["base", "now", "parameters", "places", "relations", "contacts", "kinks"]],
        *[(name, I) for name in ["systems", "samples", "observed", "alikes", "unknowns"]],
        *[(name, P) for name in ["p", "place", "anywhere"]],
        ("here", Transition),
        *[(name, P) for name in ["relation_row", "relation_moves", "contact", "kink", "system"]],
        *[(name, P) for name in ["period", "next", "piece"]],
        *[
            (name, D)
            for name in [
                "first",
                "segment",
                "last",
                "nothing",
                "begin",
                "longest",
                "begun",
                "passed",
                "part",
                "early",
                "at_once",
            ]
        ],
        *[(name, P) for name in ["t_end", "h_max", "largest"]],
        ("known", P),
        *[(name, D) for name in ["small", "still"]],
        *[(name, P) for name in ["alike", "alike_end", "state", "differential", "unnamed"]],
        *[(name, P) for name in ["met", "magnitude", "resolved"]],
        *[(name, D) for name in ["unknown_size", "round_off"]],
        *[(name, P) for name in ["rate", "y", "yd", "before", "before_d", "restart", "restart_d"]],
        *[(name, P) for name in ["values", "low", "high", "p_before", "p_after"]],
        *[(name, P) for name in ["exact", "was", "found", "which", "turning"]],
        *[(name, P) for name in ["thrown", "level", "height", "begins", "flight", "fastest"]],
        *[(name, D) for name in ["rest", "faint"]],
        *[(name, P) for name in ["watch", "log"]],
        *[(name, L) for name in ["left", "stalled", "chatters"]],
        ("differs", D),
        *[(name, I) for name in ["pieces", "at", "struck"]],
        *[(name, I) for name in ["width", "room", "logged", "waits"]],
    ]


class Corners(c.Structure):
    """sd_corners."""

    _fields_ = [
        ("piece", P),
        *[(name, I) for name in ["pieces", "at", "unknowns", "keeps", "groups"]],
        *[
            (name, P)
            for name in ["t_end", "expanded", "kept", "own_magnitude", "own_met", "magnitude", "met", "resolved"]
        ],
        *[(name, P) for name in ["state", "differential", "unnamed", "group", "largest", "system"]],
        *[(name, P) for name in ["constraint", "balance", "multiplier", "flow", "jy", "jyd", "open"]],
        *[(name, P) for name in ["y", "yd", "before", "before_d", "rate", "seen"]],
        *[(name, D) for name in ["still", "differs", "unknown_size", "round_off", "part", "time", "resolves"]],
        ("sweeps", I),
    ]


class Extrema(c.Structure):
    """sd_extrema."""

    _fields_ = [
        *[(name, I) for name in ["number", "columns", "watched"]],
        *[(name, P) for name in ["least", "most"]],
        ("look", P * 3),
        ("settled", P),
        ("time", D * 2),
        ("until", D),
    ]


class Run(c.Structure):
    """sd_run."""

    _fields_ = [
        ("stepper", P),
        ("settle", P),
        ("least_norm", P),
        ("ledgers", P),
        ("written", I),
        ("observed", I),
        ("audited", I),
        ("audit", P),
        ("powers", P),
        ("rated", I),
        *[
            (name, P)
            for name in [
                "observe",
                "observe_rate",
                "observe_scale",
                "audit_at",
                "instant",
                "instant_kind",
            ]
        ],
        ("instants", I),
        ("every_step", I),
        ("glances", I),
        ("glanced", I),
        ("sizes_at_steps", I),
        ("bare", I),
        ("told", I),
        ("unsummed", I),
        ("rough", D),
        ("swift", D),
        ("apart", D),
        ("start_rate", P),
        ("row", P),
        ("room", I),
        ("rows", I),
        ("next", I),
        ("pending", I),
        ("started", I),
        ("fresh", I),
        ("sampled", I),
        *[(name, D) for name in ["stored", "dissipated", "supplied", "step_dissipated", "step_supplied"]],
        ("t_from", D),
        ("t_row", D),
        ("t_begun", D),
        *[(name, P) for name in ["power", "after", "sample", "integral", "end", "middle", "work"]],
        ("past", P * PAST),
        ("t_past", D * PAST),
        ("pasts", I),
        *[(name, P) for name in ["point", "point_d", "values", "largest", "slope", "memory"]],
        ("rows_written", L),
        ("first_energy", D),
        ("watch", P),
        ("watches", I),
        ("end_kind", I),
        ("start_kind", I),
        ("t_to", D),
        ("magnitude", P),
        ("beyond", D),
        ("nothing", P),
        ("projected", P),
        ("modes", P),
        ("corners", P),
        ("extrema", P),
        ("branches", P),
        ("t_clear", D),
        ("t_seen", D),
        ("turns", D),
        ("looked", P),
        ("noded", I),
        ("node", D * NODES),
        ("node_power", D * (2 * NODES)),
        ("difference", D * (2 * NODES + 2)),
        *[(name, I) for name in ["told_here", "divided", "by_past"]],
    ]


class Region(c.Structure):
    """sd_region."""

    _fields_ = [("at", P), ("copy", P), ("size", L)]


COUNTERS: int = _core.SD_MANY_COUNTERS
"""Of the work of a pass."""


class Pass(c.Structure):
    """sd_pass."""

    _fields_ = [
        ("run", P),
        ("region", P),
        *[(name, I) for name in ["regions", "n"]],
        *[(name, P) for name in ["y", "yd", "start_rate", "differential"]],
        *[(name, P) for name in ["magnitude", "met", "least", "project", "rtol", "h_max", "opening"]],
        ("longest", D),
        ("counter", P * COUNTERS),
    ]


class RunClaim(c.Structure):
    """sd_claim."""

    _fields_ = [*[(name, I) for name in ["moment", "op", "left", "right", "within"]], ("at", D)]


class RunSamples(c.Structure):
    """sd_samples."""

    _fields_ = [("time", P), ("value", P), ("late", P), ("number", I), ("room", I)]


class Rules(c.Structure):
    """sd_rules."""

    _fields_ = [
        *[
            (name, D)
            for name in ["safety", "aim", "left", "slowest", "stretch", "unseen", "short_credit", "first_drop"]
        ],
        *[(name, D) for name in ["loose", "tame", "beyond", "hidden", "parted", "much", "bend"]],
        *[(name, I) for name in ["few", "runs", "instants"]],
    ]


class Many(c.Structure):
    """sd_many."""

    _fields_ = [
        ("p", P),
        *[(name, I) for name in ["parameters", "written", "columns", "observed"]],
        *[(name, P) for name in ["start", "region"]],
        ("regions", I),
        *[(name, P) for name in ["y0", "yd0", "anchored", "guessed", "guess", "size"]],
        ("smallest", D),
        *[(name, P) for name in ["jy0", "jyd0", "counts", "jy", "jyd"]],
        *[(name, I) for name in ["flows", "inertias"]],
        *[(name, P) for name in ["inertia_row", "inertia_column", "inertia_entry", "inertia_rate"]],
        *[(name, P) for name in ["inertia_sign", "inertia"]],
        *[(name, D) for name in ["t0", "t1"]],
        *[(name, P) for name in ["system", "sizing", "order", "form_jy", "form_jyd", "found", "ceiling"]],
        ("tau", D),
        ("passes", Pass * 2),
        *[(name, P) for name in ["column", "target", "unit", "unit_of"]],
        *[(name, I) for name in ["units", "known"]],
        *[(name, D) for name in ["late", "power", "credit", "finest", "far"]],
        *[(name, D) for name in ["ratio", "little", "growth", "fall", "few_steps", "many_steps"]],
        ("rules", Rules),
        ("tolerance", D * 2),
        ("max_steps", L),
        ("energy", D),
        ("claim", P),
        *[(name, I) for name in ["claims", "keep"]],
        ("thin", P),
        ("thins", I),
        ("sample", RunSamples * 3),
        *[(name, I) for name in ["stride", "seen", "rows", "thinned", "broken", "judged"]],
        ("last_time", D),
        *[(name, P) for name in ["end", "least", "most", "thick", "work", "kind"]],
        ("held", I),
        ("spent", D),
        ("counted", L * COUNTERS),
    ]
