"""Random motions that events carry, and their truth by SciPy: text of number k, the same for ever.

Eight families: a driven mass that knocks between walls (restitution near 0 and near 1), blocks that dry friction holds
until a slow force is enough, carts that knock one another in a row, a converter that a hysteresis switches beside an
ideal diode, tanks that run dry, rooms with thermostats, a plant under sampled control, rings of relays that set each
other off.  Truth as in steep_corners.py.
"""

from __future__ import annotations

import numpy as np
from steep_corners import Turn, _log, drawn_of

STILL = 1e-7
"""Of the speed that the force gives: what bounces back more slowly rests."""

DRY = 1e-12
"""Level (m) of a tank that is dry."""


def knocks(dice):
    """A driven mass on a spring between walls."""
    m, k, c = _log(dice, 0.2, 5), _log(dice, 1, 100), _log(dice, 0.05, 2)
    gap, force, w = _log(dice, 0.02, 0.3), _log(dice, 5, 50), _log(dice, 2, 10)
    back = round(dice.choice((dice.uniform(0.0, 0.1), dice.uniform(0.9, 1.0))), 4)
    body = ["coord x: translation = 0 m", f"energy T* = 1/2*{m} kg*x'^2", f"energy V = 1/2*{k} N/m*x^2"]
    body += [f"content D = 1/2*{c} N.s/m*x'^2", f"work {force} N*sin({w} rad/s*t) on x", "init x' = 0 m/s"]
    body += [f"phi right: {gap} m - x >= 0 m restitution {back}", f"phi left: x + {gap} m >= 0 m restitution {back}"]
    end = float(f"{dice.uniform(1.5, 4.0) * 2 * np.pi / w:.4g}")

    def push(t, y):
        return force * np.sin(w * t) - k * y[0] - c * y[1]

    def rates(t, y, mode):
        return [0.0, 0.0] if mode else [y[1], push(t, y) / m]

    def struck(sense):
        def hit(y):
            y[0], y[1] = sense * gap, -back * y[1]
            if abs(y[1]) < STILL * force / m / w:
                y[1] = 0.0
                return int(sense)
            return None

        return hit

    turns = []
    for sense in (1, -1):
        turns += [Turn(0, lambda t, y, s=sense: s * y[0] - gap if s * y[1] > 0.0 else -1.0, 0, then=struck(sense))]
        turns += [Turn(sense, lambda t, y, s=sense: -s * push(t, y), 0)]
    rest = {"rates": rates, "y": [0.0, 0.0], "read": lambda y: y, "turns": tuple(turns), "jumps": True}
    return (), body, {"q": "x", "v": "x'"}, end, rest


def creeps(dice):
    """Two blocks with dry friction on a spring between them; a slow spring pulls the first."""
    m, grip = [_log(dice, 0.3, 3) for _ in range(2)], [_log(dice, 1, 5) for _ in range(2)]
    k, pull, b = _log(dice, 20, 300), _log(dice, 10, 100), [_log(dice, 0.1, 1) for _ in range(2)]
    slow, shake, w = _log(dice, 0.02, 0.2), _log(dice, 0.05, 1), _log(dice, 2, 20)
    end = float(f"{dice.uniform(1.5, 4.0) * sum(grip) / pull / slow:.4g}")
    body = [f"coord x{i}: translation = 0 m" for i in range(2)] + [f"init x{i}' = 0 m/s" for i in range(2)]
    body += [f"energy T* = 1/2*{m[0]} kg*x0'^2 + 1/2*{m[1]} kg*x1'^2", f"energy V = 1/2*{k} N/m*(x0 - x1)^2"]
    body += [f"content D = {grip[i]} N*abs(x{i}') + 1/2*{b[i]} N.s/m*x{i}'^2" for i in range(2)]
    body += [f"work {pull} N/m*({slow} m/s*t - x0) + {shake} N*sin({w} rad/s*t) on x0"]

    def forces(t, y):
        between = k * (y[1] - y[0])
        return pull * (slow * t - y[0]) + shake * np.sin(w * t) + between - b[0] * y[2], -between - b[1] * y[3]

    def senses(mode):
        return mode // 3 - 1, mode % 3 - 1

    def rates(t, y, mode):
        now, sense = forces(t, y), senses(mode)
        a = [(now[i] - sense[i] * grip[i]) / m[i] if sense[i] else 0.0 for i in range(2)]
        return [y[2] if sense[0] else 0.0, y[3] if sense[1] else 0.0, *a]

    turns = []
    for mode in range(9):
        for i, place in enumerate((3, 1)):
            sense = senses(mode)[i]
            if sense:
                turns += [Turn(mode, lambda t, y, i=i, s=sense: -s * y[2 + i], mode - sense * place, rests=2 + i)]
            else:
                for s in (1, -1):
                    turns += [Turn(mode, lambda t, y, i=i, s=s: s * forces(t, y)[i] - grip[i], mode + s * place)]
    rest = {"rates": rates, "y": [0.0] * 4, "read": lambda y: y, "turns": tuple(turns), "mode": 4}
    return (), body, {"q0": "x0", "q1": "x1", "v0": "x0'", "v1": "x1'"}, end, rest


def carts(dice):
    """Three to five carts on springs with gaps between them, the first of which comes in."""
    n, gap, begin = dice.randint(3, 5), _log(dice, 1e-3, 3e-2), _log(dice, 0.2, 2)
    m, k, c = ([_log(dice, *of) for _ in range(n)] for of in ((0.5, 2), (2, 20), (0.02, 0.3)))
    back = [round(dice.uniform(0.7, 1.0), 4) for _ in range(n - 1)]
    body = [f"coord x{i}: translation = 0 m" for i in range(n)]
    body += [f"init x{i}' = {begin if i == 0 else 0} m/s" for i in range(n)]
    for i in range(n):
        body += [f"energy T* = 1/2*{m[i]} kg*x{i}'^2", f"energy V = 1/2*{k[i]} N/m*x{i}^2"]
        body += [f"content D = 1/2*{c[i]} N.s/m*x{i}'^2"]
    body += [f"phi g{i}: x{i + 1} - x{i} >= -{gap} m restitution {back[i]}" for i in range(n - 1)]
    end = float(f"{dice.uniform(0.8, 2.0) * 2 * np.pi * (sum(m) / sum(k)) ** 0.5:.4g}")
    mass, stiff, damp = np.array(m), np.array(k), np.array(c)

    def rates(t, y, mode):
        return np.concatenate([y[n:], (-stiff * y[:n] - damp * y[n:]) / mass])

    def struck(i):
        def hit(y):
            u = y[n + i] - y[n + i + 1]
            impulse = (1.0 + back[i]) * u / (1.0 / m[i] + 1.0 / m[i + 1])
            y[n + i] -= impulse / m[i]
            y[n + i + 1] += impulse / m[i + 1]

        return hit

    def closes(i):
        return lambda t, y: y[i] - y[i + 1] - gap if y[n + i] > y[n + i + 1] else -1.0

    turns = tuple(Turn(0, closes(i), 0, then=struck(i)) for i in range(n - 1))
    rest = {"rates": rates, "y": [0.0] * n + [begin] + [0.0] * (n - 1), "read": lambda y: y, "turns": turns}
    rest["jumps"] = True
    traced = {f"q{i}": f"x{i}" for i in range(n)} | {f"v{i}": f"x{i}'" for i in range(n)}
    return (), body, traced, end, rest


def choppers(dice):
    """A coil between two currents that a switch keeps, a free-wheeling ideal diode, a capacitor and a load."""
    v, r = _log(dice, 5, 100), _log(dice, 1, 20)
    mean = v / r * dice.uniform(0.2, 0.8)
    high, low = float(f"{mean * 1.2:.4g}"), float(f"{mean * dice.uniform(0.5, 0.95):.4g}")
    h = _log(dice, 1e-4, 1e-2)
    c, rl = float(f"{h / r / r * _log(dice, 0.3, 30):.4g}"), float(f"{0.02 * r:.4g}")
    body = ["node in_, sw, l, out: electrical", f"V: voltage(v = {v} V) in_ -> ground", "discrete on = true"]
    body += ["S: switch(gate = if on then 1 else 0) in_ -> sw", "D: diode.complementary() ground -> sw"]
    body += [f"R: resistor(R = {rl!r} ohm) sw -> l", f"L: inductor(L = {h} H) l -> out", "init L.f = 0 A"]
    body += [f"C: capacitor(C = {c!r} F) out -> ground", "init C.e = 0 V", f"Q: resistor(R = {r} ohm) out -> ground"]
    body += [f"when L.f >= {high!r} A {{ on := false }}", f"when L.f <= {low!r} A {{ on := true }}"]

    def rates(t, y, mode):
        return [((v if mode else 0.0) - rl * y[0] - y[1]) / h, (y[0] - y[1] / r) / c]

    turns = (Turn(1, lambda t, y: y[0] - high, 0), Turn(0, lambda t, y: low - y[0], 1))
    end = float(f"{dice.uniform(2.0, 6.0) * h / r:.4g}")
    rest = {"rates": rates, "y": [0.0, 0.0], "read": lambda y: y, "mode": 1, "turns": turns}
    head = ("from std.electrical import resistor, inductor, capacitor, voltage, switch, diode",)
    return head, body, {"i": "L.f", "vc": "C.e"}, end, rest


def tanks(dice):
    """Two tanks above one another that run dry; a pump fills the upper one at times."""
    h, c = [_log(dice, 0.3, 2) for _ in range(2)], [_log(dice, 0.05, 0.3) for _ in range(2)]
    fill, low, high = _log(dice, 0.05, 0.4), _log(dice, 0.05, 0.2), _log(dice, 0.4, 1.0)
    pumped = dice.random() < 0.5
    body = [f"state h{i}: m = {h[i]} m" for i in range(2)]
    out = [f"{c[i]} s^-1*sqrt(max(h{i}, 0 m)*1 m)" for i in range(2)]
    if pumped:
        body += ["discrete on = false", f"when h1 <= {low} m {{ on := true }}"]
        body += [f"when h1 >= {high} m {{ on := false }}"]
    body += [f"dynamic h0' = {f'(if on then {fill} m/s else 0 m/s) ' if pumped else ''}- {out[0]}"]
    body += [f"dynamic h1' = {out[0]} - {out[1]}"]
    end = float(f"{dice.uniform(1.2, 3.0) * 2 * (h[0] ** 0.5 / c[0] + h[1] ** 0.5 / c[1]):.4g}")

    def rates(t, y, mode):
        one, two = (0.0 if mode & bit else c[i] * max(y[i], 0.0) ** 0.5 for i, bit in enumerate((2, 4)))
        return [(fill if mode & 1 else 0.0) - one, one - two]

    turns = [Turn(0, lambda t, y: DRY - y[0], 2, rests=0), Turn(2, lambda t, y: DRY - y[1], 6, rests=1)]
    turns += [Turn(3, lambda t, y: 1.0, 1)]
    if pumped:
        turns += [Turn(1, lambda t, y: y[1] - high, 0)] + [
            Turn(mode, lambda t, y: low - y[1], mode + 1) for mode in (0, 2)
        ]
    rest = {"rates": rates, "y": list(h), "read": lambda y: y, "turns": tuple(turns)}
    return (), body, {"h0": "h0", "h1": "h1"}, end, rest


def rooms(dice):
    """Two or three rooms side by side, each with a thermostat of its own."""
    n = dice.randint(2, 3)
    cold, wall, side = 5.0, [_log(dice, 30, 100) for _ in range(n)], _log(dice, 10, 100)
    c, heat = [_log(dice, 5e4, 2e5) for _ in range(n)], [_log(dice, 2000, 4000) for _ in range(n)]
    low = [round(dice.uniform(17, 20), 2) for _ in range(n)]
    high = [round(x + _log(dice, 0.2, 2), 2) for x in low]
    body = [f"state T{i}: K = 15 K" for i in range(n)] + [f"discrete on{i} = true" for i in range(n)]
    for i in range(n):
        beside = "".join(f" + {side} W/K*(T{j} - T{i})" for j in (i - 1, i + 1) if 0 <= j < n)
        given = f"(if on{i} then {heat[i]} W else 0 W)"
        body += [f"dynamic T{i}' = ({wall[i]} W/K*({cold} K - T{i}){beside} + {given})/({c[i]} J/K)"]
        body += [f"when T{i} >= {high[i]} K {{ on{i} := false }}", f"when T{i} <= {low[i]} K {{ on{i} := true }}"]
    end = float(f"{dice.uniform(0.1, 0.5) * 7200:.4g}")
    full = np.array([[side if abs(i - j) == 1 else 0.0 for j in range(n)] for i in range(n)])

    def rates(t, y, mode):
        on = np.array([mode >> i & 1 for i in range(n)])
        return (np.array(wall) * (cold - y) + full @ y - full.sum(axis=1) * y + on * heat) / c

    turns = _relays(n, lambda i, y: y[i] - high[i], lambda i, y: low[i] - y[i])
    rest = {"rates": rates, "y": [15.0] * n, "read": lambda y: y, "turns": turns, "mode": 2**n - 1}
    return (), body, {f"T{i}": f"T{i}" for i in range(n)}, end, rest


def samplers(dice):
    """A mass on a spring under sampled control whose output jumps and has a bound, one step late."""
    m, c, k = _log(dice, 0.3, 3), _log(dice, 0.05, 1), _log(dice, 0.5, 10)
    period = float(f"{_log(dice, 0.03, 0.5) * (m / k) ** 0.5:.4g}")
    p, d = float(f"{k * _log(dice, 0.5, 5):.4g}"), float(f"{(m * k) ** 0.5 * _log(dice, 0.1, 1.5):.4g}")
    bound, aim = float(f"{k * _log(dice, 0.7, 3):.4g}"), 1.0
    cycles = dice.randint(20, 80)
    end = float(f"{(cycles - 0.5) * period:.9g}")
    body = ["coord x: translation = 0 m", f"energy T* = 1/2*{m} kg*x'^2", f"energy V = 1/2*{k} N/m*x^2"]
    body += [f"content D = 1/2*{c} N.s/m*x'^2", "discrete u: N = 0 N", "discrete next: N = 0 N", "init x' = 0 m/s"]
    body += [f"every {period} s {{", "  u := next"]
    body += [f"  next := max(min({p} N/m*({aim} m - x) - {d} N.s/m*x', {bound} N), -{bound} N)", "}", "work u on x"]

    def rates(t, y, mode):
        return [y[1], (y[2] - k * y[0] - c * y[1]) / m, 0.0, 0.0]

    def sample(y):
        y[2:] = y[3], max(min(p * (aim - y[0]) - d * y[1], bound), -bound)

    instants = dict.fromkeys((j * period for j in range(cycles)), sample)
    rest = {"rates": rates, "y": [0.0] * 4, "read": lambda y: y[:3], "instants": instants, "jumps": True}
    return (), body, {"q": "x", "v": "x'", "u": "u"}, end, rest


def _relays(n, off, on):
    """The turns of n switches, a bit of the mode each: off(i, y), on(i, y) rise through zero where switch i is."""
    return tuple(
        Turn(mode, lambda t, y, i=i, value=off if mode >> i & 1 else on: value(i, y), mode ^ 1 << i)
        for mode in range(2**n)
        for i in range(n)
    )


def rings(dice):
    """Three to five stores in a ring, each charged while the one before it is switched on, and switched at a level."""
    n = dice.choice((3, 5))
    slow = [_log(dice, 0.02, 0.2) for _ in range(n)]
    high, low = ([round(dice.uniform(*of), 3) for _ in range(n)] for of in ((0.5, 0.85), (0.15, 0.45)))
    body = [f"state y{i}: V = {0.1 * i:.2g} V" for i in range(n)] + [f"discrete s{i} = false" for i in range(n)]
    for i in range(n):
        body += [f"dynamic y{i}' = ((if s{i - 1 if i else n - 1} then 0 V else 1 V) - y{i})/({slow[i]} s)"]
        body += [f"when y{i} >= {high[i]} V {{ s{i} := true }}", f"when y{i} <= {low[i]} V {{ s{i} := false }}"]
    end = float(f"{dice.uniform(3.0, 10.0) * sum(slow):.4g}")

    def rates(t, y, mode):
        return [((0.0 if mode >> (i - 1) % n & 1 else 1.0) - y[i]) / slow[i] for i in range(n)]

    turns = _relays(n, lambda i, y: low[i] - y[i], lambda i, y: y[i] - high[i])
    rest = {"rates": rates, "y": [0.1 * i for i in range(n)], "read": lambda y: y, "turns": turns}
    return (), body, {f"y{i}": f"y{i}" for i in range(n)}, end, rest


FAMILIES = (knocks, creeps, carts, choppers, tanks, rooms, samplers, rings)


def drawn(number):
    """The motion of that number."""
    return drawn_of(FAMILIES, number)
