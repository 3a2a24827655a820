"""Which family of Paynter's diagram a formulation is written in: the names that the mirror exchanges.

Reflecting the diagram exchanges effort and flow, momentum and displacement, T* and V*, T and V, D and G; every arrow
that lowers energies takes these names from a `Mirror` and so exists once.
"""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Mirror:
    """Kinds of unknowns and names of state functions of one family."""

    coordinate: str  # kind of the configuration coordinate: q (p)
    rate: str  # kind of its time derivative: f (e)
    conjugate: str  # kind of what the Legendre transformation introduces: p (q)
    coenergy: str  # function of the rate: T* (V*)
    energy: str  # function of the conjugate: T (V)
    potential: str  # function of the coordinate: V (T)
    content: str  # power function of the rate: D (G)


PRIMAL = Mirror("q", "f", "p", "T*", "T", "V", "D")
COMPLEMENTARY = Mirror("p", "e", "q", "V*", "V", "T", "G")
