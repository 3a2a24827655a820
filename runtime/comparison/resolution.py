"""How well rows tell a curve between them: by what a row in the middle of two others says against their interpolation.

A cubic through two rows and their rates is off by f''''/24 ((t - a)(b - t))^2, a line by f''/2 (t - a)(b - t); the
derivative is that which the same formula leaves at the row between two cells (Davis, Interpolation and Approximation,
3.5 and 4.3).
"""

from __future__ import annotations

import numpy as np
from sysdyn.runtime.comparison.curve import Curve, bernstein, cells_at, value_at

ROUGH = 4.0
"""Times the estimate that what is between rows may be off by: three rows an oscillation say a quarter of it."""


def untold(curves: tuple[Curve, Curve], at: float, excess: float) -> str:
    """A note where rows are too far apart to say that the curves differ by so much at an instant; else nothing."""
    off = [_between(curve, at) for curve in curves]
    # the rows tell more than the curves differ by
    if ROUGH * sum(o[0] for o in off) < excess:
        return ""
    # the trace whose rows tell less
    which = int(off[1][0] > off[0][0])
    rows = f"rows of the {('reference', 'test')[which]} are {off[which][1]:.3g} s apart there"
    return f"{rows} and do not tell it so well: compare traces at common instants ('every 1 ms', --at)"


def _between(curve: Curve, at: float) -> tuple[float, float]:
    """What the curve may be off by at an instant, and the width of its cell."""
    t = curve.time
    # two rows leave nothing to check by
    if t.size < 3:
        return 0.0, 0.0
    k = int(cells_at(t, np.array([at]))[0])
    derivative = 0.0
    # rows on both sides of the instant: each against its two neighbours
    for i in range(max(k - 1, 0), min(k + 1, t.size - 2)):
        three = slice(i, i + 3, 2)
        known = curve.rates is not None and bool(np.isfinite(curve.rates[i : i + 3]).all())
        pair = Curve(t[three], curve.values[three], curve.rates[three] if known and curve.rates is not None else None)
        widths = float(t[i + 1] - t[i]) * float(t[i + 2] - t[i + 1])
        # a jump, or no number, says nothing
        if widths > 0.0 and np.isfinite(curve.values[i : i + 3]).all():
            b = bernstein(pair, np.zeros(1, dtype=np.int64), t[i : i + 1], t[i + 2 : i + 3])
            middle = float(value_at(b, (t[i + 1 : i + 2] - t[i]) / (t[i + 2] - t[i]))[0])
            # the error of a cubic grows with the fourth power, that of a line with the second
            power = 2 if known else 1
            inside = max(float(at - t[k]) * float(t[k + 1] - at), 0.0)
            derivative = max(derivative, abs(float(curve.values[i + 1]) - middle) * (inside / widths) ** power)
    return derivative, float(t[k + 1] - t[k])
