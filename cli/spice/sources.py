"""Shapes of sources: what V and I are over time.

A shape gives an expression of the language; PULSE and PWL of voltages are components of std.electrical.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from itertools import pairwise

from sysdyn.cli.spice.netlist import Unreadable
from sysdyn.cli.spice.writing import plain, quantity
from sysdyn.values import dataclass


@dataclass(frozen=True, slots=True)
class Shape:
    """expression: of the language; or component with its arguments; start: value at t = 0."""

    start: float
    expression: str = ""
    component: str = ""
    arguments: str = ""


Asked = tuple[str, float, float]
"""Unit, step and end of `.tran`."""


def _at(values: list[float], k: int, default: float) -> float:
    return values[k] if k < len(values) else default


def direct(number: float, unit: str) -> Shape:
    """A constant."""
    return Shape(number, quantity(number, unit))


def _sine(v: list[float], asked: Asked) -> Shape:
    """SIN(VO VA FREQ TD THETA PHASE)."""
    unit, _, end = asked
    offset, size = _at(v, 0, 0.0), _at(v, 1, 0.0)
    rate, delay, damping, phase = _at(v, 2, 1.0 / end), _at(v, 3, 0.0), _at(v, 4, 0.0), _at(v, 5, 0.0)
    time = "t" if delay == 0.0 else f"(t - {quantity(delay, 's')})"
    angle = f"2*pi*{_held(quantity(rate, 'Hz'))}*{time}" + (f" + {plain(phase)}*pi/180" if phase else "")
    wave = f"{_held(quantity(size, unit))}*sin({angle})"
    if damping:
        wave += f"*exp(-{_held(quantity(damping, 'Hz'))}*{time})"
    begin = size * math.sin(math.radians(phase))
    if delay > 0.0:
        still = quantity(offset + begin, unit)
        moving = wave if offset == 0.0 else f"{quantity(offset, unit)} + {wave}"
        return Shape(offset + begin, f"if t < {quantity(delay, 's')} then {still} else {moving}")
    return Shape(offset + begin, wave if offset == 0.0 else f"{quantity(offset, unit)} + {wave}")


def _held(text: str) -> str:
    """A quantity as a factor."""
    return text if text.replace(".", "").isdigit() else f"({text})"


def _pulse(v: list[float], asked: Asked) -> Shape:
    """PULSE(V1 V2 TD TR TF PW PER)."""
    unit, step, end = asked
    low, high, delay = _at(v, 0, 0.0), _at(v, 1, 0.0), _at(v, 2, 0.0)
    rise, fall = _at(v, 3, 0.0) or step, _at(v, 4, 0.0) or step
    width, period = _at(v, 5, 0.0) or end, _at(v, 6, 0.0) or max(end, 0.0) * 2.0 + rise + fall + _at(v, 5, 0.0)
    period = max(period, rise + width + fall)
    s = {"rise": rise, "fall": fall, "width": width, "period": period, "delay": delay}
    if unit == "V":
        times = ", ".join(f"{name} = {quantity(value, 's')}" for name, value in s.items() if value or name != "delay")
        return Shape(low, "", "pulse", f"lo = {quantity(low, 'V')}, hi = {quantity(high, 'V')}, {times}")
    at = f"mod(t - {quantity(delay, 's')}, {quantity(period, 's')})"
    down = f"({quantity(rise + width + fall, 's')} - {at})/({quantity(fall, 's')})"
    shape = f"clip(min({at}/({quantity(rise, 's')}), {down}), 0, 1)"
    whole = f"{quantity(low, unit)} + {_held(quantity(high - low, unit))}*{shape}"
    return Shape(low, f"if t < {quantity(delay, 's')} then {quantity(low, unit)} else {whole}" if delay else whole)


def _exponential(v: list[float], asked: Asked) -> Shape:
    """EXP(V1 V2 TD1 TAU1 TD2 TAU2)."""
    unit, step, _ = asked
    low, high = _at(v, 0, 0.0), _at(v, 1, 0.0)
    one, tau = _at(v, 2, 0.0), _at(v, 3, step)
    two, fade = _at(v, 4, one + step), _at(v, 5, step)
    size = _held(quantity(high - low, unit))

    def side(delay: float, time: float, sign: str) -> str:
        behind = f"max(t - {quantity(delay, 's')}, 0 s)" if delay else "t"
        return f"{sign} {size}*(1 - exp(-{behind}/({quantity(time, 's')})))"

    return Shape(low, f"{quantity(low, unit)} {side(one, tau, '+')} {side(two, fade, '-')}")


def _lines(v: list[float], asked: Asked) -> Shape:
    """PWL(T1 V1 T2 V2 ...): constant before the first and behind the last."""
    unit = asked[0]
    times, values = v[0::2], v[1::2]
    if len(times) != len(values) or len(times) < 2 or any(b <= a for a, b in pairwise(times)):
        raise Unreadable("PWL(T1 V1 T2 V2 ...): at least two points at ascending instants")
    if unit == "V":
        at = ", ".join(quantity(x, "s") for x in times)
        levels = ", ".join(quantity(x, "V") for x in values)
        return Shape(values[0], "", "piecewise_voltage", f"n = {len(times)}, at = [{at}], v = [{levels}]")
    text = quantity(values[0], unit)
    for a, b, x, y in zip(times, times[1:], values, values[1:], strict=False):
        text += f" + {_held(quantity(y - x, unit))}*clip((t - {quantity(a, 's')})/({quantity(b - a, 's')}), 0, 1)"
    return Shape(values[0], text)


SHAPES: dict[str, Callable[[list[float], Asked], Shape]] = {
    "sin": _sine,
    "pulse": _pulse,
    "exp": _exponential,
    "pwl": _lines,
}
