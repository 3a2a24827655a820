"""Answers of a transfer function: over frequency (Bode, Nyquist) and to a step, with the margins of stability.

    G(i w) = gain prod(i w - zeros)/prod(i w - poles) + d1 i w + d2 (i w)^2
    step:    y(t) = sum of residues over the poles of G(s)/s, by the exponential of [A b; 0 0] t

The frequencies shown lie a decade around the poles and zeros that are not at the origin; the times, until the slowest
pole that decays is at rest.
Receives a `Transfer` and the matrices it is of.  Returns arrays.
"""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray
from sysdyn.runtime.linear.modes import Complexes, Transfer
from sysdyn.runtime.linear.tangent import Reduced
from sysdyn.runtime.model.description import Floats
from sysdyn.values import dataclass

POINTS = 401
"""Of a frequency response, spaced evenly in log w, the corners added."""
TIMES = 401
"""Of a step response."""
DECADE = 10.0
DECAYS = 6.0
"""Time constants of the slowest mode that a step response spans: e^-6 is 0.25 percent."""
TURNS = 8.0
"""Periods of the slowest oscillation that does not decay."""


@dataclass(frozen=True, slots=True)
class Frequencies:
    """w [rad/s], G(i w)."""

    w: Floats
    value: Complexes

    @property
    def magnitude(self) -> Floats:
        """20 log10 |G|, dB."""
        with np.errstate(divide="ignore"):
            return np.asarray(20.0 * np.log10(np.abs(self.value)))

    @property
    def phase(self) -> Floats:
        """Degrees, continued over the turns."""
        return np.asarray(np.degrees(np.unwrap(np.angle(self.value))))


@dataclass(frozen=True, slots=True)
class Margins:
    """gain: factor to instability (at w_phase); phase: degrees to it (at w_gain); None where G never crosses."""

    gain: float | None
    w_phase: float | None
    phase: float | None
    w_gain: float | None


def at_frequencies(transfer: Transfer, s: Complexes) -> Complexes:
    """G at complex frequencies [k]; the product is taken pair by pair, so that it does not overflow."""
    value = np.full(s.shape, complex(transfer.gain))
    zeros, poles = list(transfer.zeros), list(transfer.poles)
    with np.errstate(divide="ignore", invalid="ignore"):
        # one zero over one pole after the other
        for k in range(max(len(zeros), len(poles))):
            value = value * (s - zeros[k] if k < len(zeros) else 1.0)
            value = value / (s - poles[k] if k < len(poles) else 1.0)
    return value + transfer.improper[0] * s + transfer.improper[1] * s**2


def span(transfers: Iterable[Transfer]) -> tuple[float, float]:
    """Frequencies between which something happens, rad/s."""
    corners = [abs(c) for t in transfers for c in (*t.poles, *t.zeros) if abs(c) > 0.0]
    # neither poles nor zeros: any decade serves
    if not corners:
        return 0.1, 10.0
    return min(corners) / DECADE, max(corners) * DECADE


def frequencies(transfer: Transfer, low: float, high: float, points: int = POINTS) -> Frequencies:
    """G along the imaginary axis; resonances between the points are not missed: their corners are points too."""
    # at corner frequencies the slope changes
    corners = [abs(c) for c in (*transfer.poles, *transfer.zeros) if low < abs(c) < high]
    # about a resonance as many points as its width needs
    near = [
        abs(p.imag) * (1.0 + k * max(abs(p.real / p.imag), 1e-9))
        for p in transfer.poles
        if p.imag > 0.0
        for k in (-2.0, -1.0, -0.5, 0.0, 0.5, 1.0, 2.0)
    ]
    found = np.unique([*np.geomspace(low, high, points), *corners, *(w for w in near if low < w < high)])
    # on an undamped pole G is infinite
    on = [abs(p.imag) for p in transfer.poles if p.real == 0.0]
    w = np.array([x for x in found if x not in on])
    return Frequencies(w, at_frequencies(transfer, 1j * w))


def margins(transfer: Transfer, low: float, high: float) -> Margins:
    """Of the loop closed with -1: smallest gain margin, smallest phase margin."""
    from scipy.optimize import brentq

    found = frequencies(transfer, low, high, 4 * POINTS)
    g = found.value

    def roots(values: Floats, function: object) -> list[float]:
        # where a sign changes between two points
        places = np.flatnonzero((values[:-1] < 0.0) != (values[1:] < 0.0))
        return [float(brentq(function, found.w[k], found.w[k + 1], xtol=1e-300, rtol=1e-13)) for k in places]

    def one(w: float) -> complex:
        return complex(at_frequencies(transfer, np.array([1j * w]))[0])

    # G is real and negative: the phase is -180 degrees
    real = [w for w in roots(g.imag, lambda w: one(w).imag) if one(w).real < 0.0 and np.isfinite(one(w))]
    # |G| = 1: the gain is one
    even = roots(np.abs(g) - 1.0, lambda w: abs(one(w)) - 1.0)
    # of several crossings that nearest to |G| = 1, and to -180 degrees
    w_phase = min(real, key=lambda w: abs(np.log(abs(one(w)))), default=None)
    turned = {w: (float(np.degrees(np.angle(one(w)))) + 360.0) % 360.0 - 180.0 for w in even}
    w_gain = min(turned, key=lambda w: abs(turned[w]), default=None)
    gain = None if w_phase is None else -1.0 / one(w_phase).real
    return Margins(gain, w_phase, None if w_gain is None else turned[w_gain], w_gain)


def horizon(transfers: Iterable[Transfer]) -> float:
    """Seconds after which step responses have settled, or have turned TURNS times."""
    longest = 0.0
    # poles at the origin never settle
    for p in (p for t in transfers for p in t.poles if abs(p) > 0.0):
        # undamped: as many turns as are shown
        decays = DECAYS / abs(p.real) if abs(p.real) > 1e-9 * abs(p) else np.inf
        turns = TURNS * 2.0 * np.pi / abs(p)
        # an unstable pole is shown for half as long
        longest = max(longest, min(decays, turns) if p.real <= 0.0 or np.isinf(decays) else min(decays / 2.0, turns))
    return longest or 1.0


def step(small: Reduced, transfer: Transfer, end: float, points: int = TIMES) -> tuple[Floats, Floats]:
    """Instants and the output after a unit step of the input at 0; impulses at 0 are left out."""
    from scipy.linalg import expm

    time = np.linspace(0.0, end, points)
    j, i = transfer.input, transfer.output
    n = small.a.shape[0]
    # the input as a state that stays at 1: one exponential for every step
    wide = np.zeros((n + 1, n + 1))
    wide[:n, :n], wide[:n, n] = small.a, small.b[:, j]
    one = np.asarray(expm(wide * (time[1] - time[0])))
    out = np.append(small.c[i], small.d[i, j])
    state, values = np.append(np.zeros(n), 1.0), np.zeros(points)
    for k in range(points):
        values[k] = out @ state
        state = one @ state
    return time, values


def branches(sets: list[Complexes]) -> NDArray[np.complex128]:
    """Eigenvalues over a parameter as curves [values, n]: each goes on with the nearest; nan where there are fewer."""
    from scipy.optimize import linear_sum_assignment

    n = max((s.size for s in sets), default=0)
    found = np.full((len(sets), n), np.nan + 0j)
    for k, values in enumerate(sets):
        # the first set, or one after a gap
        if k == 0 or not np.isfinite(found[k - 1]).any():
            found[k, : values.size] = values
            continue
        last = found[k - 1]
        # aim: where the curve goes on to, by its last two points
        ahead = last + (last - found[k - 2]) if k > 1 else last
        aim = np.where(np.isfinite(ahead), ahead, last)
        cost = np.abs(np.where(np.isfinite(aim), aim, 0.0)[:, None] - values[None, :])
        # a curve without a past is matched last
        cost[~np.isfinite(aim)] = cost.max(initial=0.0) * 2.0 + 1.0
        rows, columns = linear_sum_assignment(cost)
        found[k, rows] = values[columns]
    return found
