"""Shapes of sources: what V and I are over time.

A shape gives an expression of the language; PULSE and PWL are components.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from itertools import pairwise

from sysdyn.cli.spice.netlist import UnreadableCard
from sysdyn.cli.spice.writing import plain, quantity
from sysdyn.values import dataclass


@dataclass(frozen=True, slots=True)
class Shape:
    """expression: of the language; or component with its arguments; local: one that std.electrical lacks."""

    expression: str = ""
    component: str = ""
    arguments: str = ""
    local: bool = False


EXACT = 1e-12
"""Share by which a sum of decimal times may be off; std.electrical's `pulse` grants it too."""
Asked = tuple[str, float, float]
"""Unit, step (0 where none is given) and end of `.tran`."""
STEEP = 1e-3
"""Share of a pulse that an edge takes where neither it nor a step is given."""


def _value_or(values: list[float], k: int, default: float) -> float:
    return values[k] if k < len(values) else default


def direct(number: float, unit: str) -> Shape:
    """A constant."""
    return Shape(quantity(number, unit))


def _check_count(v: list[float], most: int, form: str) -> None:
    """No value behind those of a shape."""
    if any(v[most:]):
        raise UnreadableCard(f"{form}: a value more than these, {v[most]:g}, is not known")


def _sine(v: list[float], asked: Asked) -> Shape:
    """SIN(VO VA FREQ TD THETA PHASE)."""
    unit, _, end = asked
    _check_count(v, 6, "SIN(VO VA FREQ TD THETA PHASE)")
    offset, size = _value_or(v, 0, 0.0), _value_or(v, 1, 0.0)
    rate, delay, damping, phase = (
        _value_or(v, 2, 0.0) or 1.0 / end,
        _value_or(v, 3, 0.0),
        _value_or(v, 4, 0.0),
        _value_or(v, 5, 0.0),
    )
    time = "t" if delay == 0.0 else f"(t - {quantity(delay, 's')})"
    angle = f"2*pi*{_as_factor(quantity(rate, 'Hz'))}*{time}" + (f" + {plain(phase)}*pi/180" if phase else "")
    wave = f"{_as_factor(quantity(size, unit))}*sin({angle})"
    if damping:
        wave += f"*exp(-{_as_factor(quantity(damping, 'Hz'))}*{time})"
    begin = size * math.sin(math.radians(phase))
    if delay > 0.0:
        still = quantity(offset + begin, unit)
        moving = wave if offset == 0.0 else f"{quantity(offset, unit)} + {wave}"
        return Shape(f"if t < {quantity(delay, 's')} then {still} else {moving}")
    return Shape(wave if offset == 0.0 else f"{quantity(offset, unit)} + {wave}")


def _as_factor(text: str) -> str:
    """A quantity as a factor."""
    return text if text.replace(".", "").isdigit() else f"({text})"


def _pulse(v: list[float], asked: Asked) -> Shape:
    """PULSE(V1 V2 TD TR TF PW PER); a period shorter than its pulse begins again in the midst of it."""
    unit, step, end = asked
    _check_count(v, 7, "PULSE(V1 V2 TD TR TF PW PER)")
    low, high, delay = _value_or(v, 0, 0.0), _value_or(v, 1, 0.0), _value_or(v, 2, 0.0)
    width = _value_or(v, 5, 0.0) or end
    edge = step or STEEP * min(width, _value_or(v, 6, 0.0) or end, end)
    rise, fall = _value_or(v, 3, 0.0) or edge, _value_or(v, 4, 0.0) or edge
    if not (rise > 0.0 and fall > 0.0 and width >= 0.0):
        raise UnreadableCard("PULSE: times of rising, falling and between them from 0 s on are wanted")
    whole = rise + width + fall
    period = _value_or(v, 6, 0.0) or 2.0 * end + whole
    period = max(period, whole) if delay + period >= end else period
    s = {"rise": rise, "fall": fall, "width": width, "period": period, "delay": delay}
    if unit == "V" and period >= whole * (1.0 - EXACT):
        times = ", ".join(f"{name} = {quantity(value, 's')}" for name, value in s.items() if value or name != "delay")
        return Shape("", "pulse", f"lo = {quantity(low, 'V')}, hi = {quantity(high, 'V')}, {times}")
    at = f"mod(t - {quantity(delay, 's')}, {quantity(period, 's')})"
    down = f"({quantity(whole, 's')} - {at})/({quantity(fall, 's')})"
    shape = f"clip(min({at}/({quantity(rise, 's')}), {down}), 0, 1)"
    moving = f"{quantity(low, unit)} + {_as_factor(quantity(high - low, unit))}*{shape}"
    return Shape(f"if t < {quantity(delay, 's')} then {quantity(low, unit)} else {moving}" if delay else moving)


def _exponential(v: list[float], asked: Asked) -> Shape:
    """EXP(V1 V2 TD1 TAU1 TD2 TAU2)."""
    unit, step, _ = asked
    _check_count(v, 6, "EXP(V1 V2 TD1 TAU1 TD2 TAU2)")
    low, high = _value_or(v, 0, 0.0), _value_or(v, 1, 0.0)
    one, tau = _value_or(v, 2, 0.0), _value_or(v, 3, 0.0) or step
    two, fade = _value_or(v, 4, 0.0) or one + step, _value_or(v, 5, 0.0) or step
    if not (tau > 0.0 and fade > 0.0):
        raise UnreadableCard("EXP: time constants above 0 s are wanted")
    size = _as_factor(quantity(high - low, unit))

    def side(delay: float, time: float, sign: str) -> str:
        behind = f"max(t - {quantity(delay, 's')}, 0 s)" if delay else "t"
        return f"{sign} {size}*(1 - exp(-{behind}/({quantity(time, 's')})))"

    return Shape(f"{quantity(low, unit)} {side(one, tau, '+')} {side(two, fade, '-')}")


def _lines(v: list[float], asked: Asked) -> Shape:
    """PWL(T1 V1 T2 V2 ...): constant before the first and behind the last."""
    unit = asked[0]
    times, values = v[0::2], v[1::2]
    if len(times) != len(values) or len(times) < 2 or any(b <= a for a, b in pairwise(times)):
        raise UnreadableCard("PWL(T1 V1 T2 V2 ...): at least two points at ascending instants")
    kind, letter = ("piecewise_voltage", "v") if unit == "V" else ("piecewise_current", "i")
    at, levels = (", ".join(quantity(x, u) for x in w) for w, u in ((times, "s"), (values, unit)))
    return Shape("", kind, f"n = {len(times)}, at = [{at}], {letter} = [{levels}]", unit != "V")


SHAPES: dict[str, Callable[[list[float], Asked], Shape]] = {
    "sin": _sine,
    "pulse": _pulse,
    "exp": _exponential,
    "pwl": _lines,
}
