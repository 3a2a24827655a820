"""Names of quantities in traces, for all rooms."""

from __future__ import annotations


def trace_name(name: str) -> str:
    """A name as a trace holds it: '/' in a quotient is U+2215 there, for a slash would make groups of HDF5."""
    return name.replace("/", "\u2215")
