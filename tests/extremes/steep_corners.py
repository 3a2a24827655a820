"""Random motions with steep laws and corners, and their truth by SciPy: text of number k, the same for ever.

Nine families: chains that stick and slip (tanh, and Stribeck's curve), clutches of a tanh, a clutch that is engaged,
slips and locks, play, stops of steep springs, bridges of ideal and of exponential diodes, a converter that is pulsed, a
mass between relays with hysteresis.  Truth: pieces between which rates jump, each by LSODA (steep springs: DOP853)
near round-off.
"""

from __future__ import annotations

import random
from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
from scipy.integrate import solve_ivp

PER_RUN = 400
"""Rows of a trace with an interval."""
MOST = 1000
"""Pieces of a reference: of a motion that knocks without end there is none."""
STEPS = {"LSODA": 400, "DOP853": 2000}
"""Of a reference at least: what a gap closes for within a step is not seen."""


@dataclass(frozen=True)
class Turn:
    """Where `at` (t, y) rises through zero in mode `of`, the motion goes on in mode `to`; rests: the state that is zero
    then; then (y): changes the state, and may say another mode.
    """

    of: int
    at: Callable
    to: int
    rests: int | None = None
    then: Callable | None = None

    def after(self, y):
        """The mode behind it, of a state that is changed in place."""
        if self.rests is not None:
            y[self.rests] = 0.0
        mode = self.then(y) if self.then is not None else None
        return self.to if mode is None else mode


@dataclass(frozen=True)
class Motion:
    """text, with a scene s; rates (t, y, mode) -> y' [states]; y and mode at 0 s; instants (s) at which rates jump:
    time -> mode, a change of the state (y) or None (as it is); read (y [states, k]) -> traced [names, k]; jumps: what
    is traced jumps at turns and instants; method: of SciPy.
    """

    number: int
    family: str
    text: str
    end: float
    rates: Callable
    y: list[float]
    names: tuple[str, ...]
    read: Callable
    mode: int = 0
    turns: tuple[Turn, ...] = ()
    instants: dict = field(default_factory=dict)
    jumps: bool = False
    method: str = "LSODA"

    def truth(self, rtol):
        """times (s, ascending) -> traced quantities [names, k] there."""
        y, t, mode, pieces, begins = np.array(self.y, float), 0.0, self.mode, [], []
        for end in [*sorted(x for x in self.instants if 0.0 < x < self.end), self.end]:
            now = self.instants.get(t)
            if callable(now):
                now(y)
            elif now is not None:
                mode = now
            while t < end:
                for turn in [turn for turn in self.turns if turn.of == mode and turn.at(t, y) > 0.0]:
                    mode = turn.after(y)
                turns = [turn for turn in self.turns if turn.of == mode]
                here = solve_ivp(
                    self.rates, (t, end), y, self.method, args=(mode,), events=[_event(turn) for turn in turns],
                    dense_output=True, rtol=rtol, atol=1e-5 * rtol, max_step=self.end / STEPS[self.method],
                )  # fmt: skip
                assert here.success, here.message
                assert len(begins) < MOST, "knocks without end"
                begins.append(t)
                pieces.append(here.sol)
                y, t = here.y[:, -1].copy(), float(here.t[-1]) if here.status == 1 else end
                if here.status == 1:
                    mode = next(turn for turn, hit in zip(turns, here.t_events, strict=True) if hit.size).after(y)

        def at(times):
            behind = np.diff(times, prepend=-1.0) == 0.0  # of two rows at one instant the second
            place = np.where(behind, np.searchsorted(begins, times, "right"), np.searchsorted(begins, times)) - 1
            place = np.maximum(place, 0)
            found = [pieces[k](times[place == k]) for k in range(len(pieces)) if (place == k).any()]
            return np.atleast_2d(self.read(np.concatenate(found, axis=1)))

        at.begins = np.array(begins)
        return at


def _event(turn):
    def crosses(t, y, mode):
        return turn.at(t, y)

    crosses.terminal, crosses.direction = True, 1.0
    return crosses


def drawn(number):
    """The motion of that number; every second one is traced at an interval, the others at each step."""
    return drawn_of(FAMILIES, number)


def drawn_of(families, number):
    """The same of these families."""
    dice = random.Random(20261129 + number)
    family = families[number % len(families)]
    head, body, traced, end, rest = family(dice)
    every = f" every {end / PER_RUN:.9g} s" if (number // len(families)) % 2 else ""
    names = tuple(traced)
    lines = [*head, "model m {", *(f"  {line}" for line in body), "}", "scene s of m {", f"  time 0 s to {end:.9g} s"]
    lines += ["  trace " + ", ".join(f"{value} as {name}" for name, value in traced.items()) + every, "}"]
    return Motion(number, family.__name__, "\n".join(lines) + "\n", end, names=names, **rest)


def _log(dice, low, high):
    return float(f"{low * (high / low) ** dice.random():.4g}")


def chains(dice):
    """Two to five masses, springs between them, on a belt that pulls them by friction that falls with the speed."""
    n, belt = dice.randint(2, 5), _log(dice, 0.05, 0.3)
    slip, fall, rubs = belt * _log(dice, 1e-3, 3e-2), _log(dice, 0.3, 2.0) * belt, dice.random() < 0.5
    slip, fall = float(f"{slip:.4g}"), float(f"{fall:.4g}")
    m = [_log(dice, 0.5, 2) for _ in range(n)]
    slide = [_log(dice, 1.0, 4.0) for _ in range(n)]
    stick = [float(f"{c * (dice.uniform(1.2, 2.0) if rubs else 1.0):.4g}") for c in slide]
    k, ground, c = [_log(dice, 20, 200) for _ in range(n - 1)], _log(dice, 20, 100), _log(dice, 0.05, 0.5)
    more = [round(high - low, 4) for high, low in zip(stick, slide, strict=True)]
    body = [f"node {', '.join(f'x{i}' for i in range(n))}, belt: translation = 0 m"]
    body += [f"B: velocity(v = {belt} m/s) belt -> ground"]
    for i in range(n):
        least = f"{slide[i]!r} N" + (f" + {more[i]!r} N*exp(-(f/({fall!r} m/s))^2)" if more[i] else "")
        body += [f"M{i}: mass(m = {m[i]} kg) x{i}", f"C{i}: damper(b = {c} N.s/m) x{i} -> ground"]
        body += [f"R{i}: dissipator(e = ({least})*tanh(f/({slip!r} m/s))) x{i} -> belt", f"init x{i}.f = 0 m/s"]
    body += [f"G: spring(k = {ground} N/m) x0 -> ground"]
    body += [f"K{i}: spring(k = {k[i]} N/m) x{i} -> x{i + 1}" for i in range(n - 1)]
    end = float(f"{dice.uniform(2.0, 6.0) * 2 * np.pi * (sum(m) / n / ground) ** 0.5:.4g}")
    mass, low, high = np.array(m), np.array(slide), np.array(more)

    def rates(t, y, mode):
        x, v = y[:n], y[n:]
        u = v - belt
        force = -(low + high * np.exp(-((u / fall) ** 2))) * np.tanh(u / slip) - c * v
        force[0] -= ground * x[0]
        pull = np.array(k) * (x[1:] - x[:-1])
        force[:-1] += pull
        force[1:] -= pull
        return np.concatenate([v, force / mass])

    traced = {f"x{i}": f"x{i}.q" for i in range(n)} | {f"v{i}": f"x{i}.f" for i in range(n)}
    rest = {"rates": rates, "y": [0.0] * (2 * n), "read": lambda y: y}
    return ("from std.mechanical import mass, spring, damper, velocity",), body, traced, end, rest


def clutches(dice):
    """An engine, a clutch of a tanh, a gearbox and a wheel on a shaft."""
    p = {"e": _log(dice, 0.2, 0.6), "b": _log(dice, 0.02, 0.2), "w": _log(dice, 5, 80), "k": _log(dice, 50, 500)}
    d, a, cap, ramp = _log(dice, 5, 40), _log(dice, 0.01, 0.05), _log(dice, 150, 500), _log(dice, 0.3, 1.2)
    slip, torque, swing = _log(dice, 3e-4, 3e-1), _log(dice, 20, 100), _log(dice, 50, 500)
    w, end, begin = _log(dice, 2, 30), _log(dice, 1, 2.5), _log(dice, 10, 100)
    body = ["node engine, box, wheel: rotation = 0 rad"]
    names = {"e": "engine", "b": "box", "w": "wheel"}
    body += [f"J{x}: inertia(J = {p[x]} kg.m^2) {node}" for x, node in names.items()]
    body += [f"K: torsion(k = {p['k']} N.m/rad) box -> wheel", f"D: rotary_damper(b = {d} N.m.s/rad) box -> wheel"]
    body += [f"A: dissipator(e = {a} N.m.s^2/rad^2*f*abs(f)) wheel -> ground"]
    body += [f"C: dissipator(e = {cap} N.m*min(t/({ramp} s), 1)*tanh(f/({slip} rad/s))) engine -> box"]
    body += [f"M: effort(e = {torque} N.m + {swing} N.m*sin({w} rad/s*t)) ground -> engine"]
    body += [f"init engine.f = {begin} rad/s", "init box.f = 0 rad/s", "init wheel.f = 0 rad/s"]

    def rates(t, y, mode):
        grip = cap * min(t / ramp, 1.0) * np.tanh((y[0] - y[1]) / slip)
        shaft = p["k"] * y[3] + d * (y[1] - y[2])
        drag = a * y[2] * abs(y[2])
        pull = torque + swing * np.sin(w * t)
        return [(pull - grip) / p["e"], (grip - shaft) / p["b"], (shaft - drag) / p["w"], y[1] - y[2]]

    rest = {"rates": rates, "y": [begin, 0.0, 0.0, 0.0], "read": lambda y: y[:3], "instants": {ramp: None}}
    traced = {x: f"{node}.f" for x, node in names.items()}
    return ("from std.mechanical import inertia, torsion, rotary_damper",), body, traced, end, rest


def engaged(dice):
    """A clutch that is closed, slips with dry friction until speeds are equal, locks, and is opened again."""
    one, two = _log(dice, 0.1, 1), _log(dice, 0.3, 3)
    grip, drag, torque, b = _log(dice, 20, 80), _log(dice, 0.5, 3), _log(dice, 2, 10), _log(dice, 0.05, 0.5)
    close, begin = _log(dice, 0.05, 0.3), _log(dice, 20, 200)
    opened = float(f"{close + _log(dice, 0.5, 3):.4g}")
    end = float(f"{opened + 0.3:.4g}")
    body = ["node a, b: rotation = 0 rad", f"A: inertia(J = {one} kg.m^2) a", f"B: inertia(J = {two} kg.m^2) b"]
    body += [f"M: effort(e = {torque} N.m) ground -> a", f"D: rotary_damper(b = {b} N.m.s/rad) a -> ground"]
    body += [
        f"L: dissipator(e = {drag} N.m.s/rad*f) b -> ground",
        "discrete mode = 0",
        "psi lock: a.f = b.f while mode > 1.5",
    ]
    body += [f"C: dissipator(e = if mode > 0.5 and mode < 1.5 then {grip} N.m else 0 N.m) a -> b"]
    body += [f"when t >= {close} s {{ mode := 1 }}", "when mode > 0.5 and a.f <= b.f { mode := 2 }"]
    body += [f"when t >= {opened} s {{ mode := 0 }}", f"init a.f = {begin} rad/s", "init b.f = 0 rad/s"]

    def rates(t, y, mode):
        e, w = torque - b * y[0], -drag * y[1]
        if mode == 2:
            both = (e + w) / (one + two)
            return [both, both]
        c = grip if mode == 1 else 0.0
        return [(e - c) / one, (w + c) / two]

    rest = {"rates": rates, "y": [begin, 0.0], "read": lambda y: y, "instants": {close: 1, opened: 0}}
    rest["turns"] = (Turn(1, lambda t, y: y[1] - y[0], 2),)
    return ("from std.mechanical import inertia, rotary_damper",), body, {"a": "a.f", "b": "b.f"}, end, rest


def _sides(q, gap):
    """Of a gap: free, and beyond it on either side, by a hair more and less."""
    more, less = (1.0 + 1e-12) * gap, (1.0 - 1e-12) * gap
    for side in (1, -1):
        yield Turn(0, lambda t, y, s=side: s * q(y) - more, side)
        yield Turn(side, lambda t, y, s=side: less - s * q(y), 0)


def play(dice):
    """Two wheels whose teeth have play and are steep springs with a little damping."""
    one, two, gap = _log(dice, 5e-3, 5e-2), _log(dice, 5e-3, 5e-2), _log(dice, 2e-3, 2e-2)
    k, c, b = _log(dice, 1e3, 1e5), _log(dice, 0.02, 2), _log(dice, 0.02, 0.3)
    torque, w = _log(dice, 0.3, 3), _log(dice, 3, 20)
    end = float(f"{dice.uniform(1.0, 2.0) * 2 * np.pi / w:.4g}")
    dead = f"(max(q - {gap} rad, 0 rad) + min(q + {gap} rad, 0 rad))"
    body = ["node a, b: rotation = 0 rad", f"A: inertia(J = {one} kg.m^2) a", f"B: inertia(J = {two} kg.m^2) b"]
    body += [f"T: potential(e = {k} N.m/rad*{dead}) a -> b", f"C: rotary_damper(b = {c} N.m.s/rad) a -> b"]
    body += [f"D: rotary_damper(b = {b} N.m.s/rad) b -> ground"]
    body += [f"M: effort(e = {torque} N.m*sin({w} rad/s*t)) ground -> a", "init a.f = 0 rad/s", "init b.f = 0 rad/s"]

    def rates(t, y, mode):
        teeth = k * mode * (mode * (y[0] - y[1]) - gap) + c * (y[2] - y[3])
        return [y[2], y[3], (torque * np.sin(w * t) - teeth) / one, (teeth - b * y[3]) / two]

    rest = {"rates": rates, "y": [0.0] * 4, "read": lambda y: y, "method": "DOP853"}
    rest["turns"] = tuple(_sides(lambda y: y[0] - y[1], gap))
    traced = {"qa": "a.q", "qb": "b.q", "a": "a.f", "b": "b.f"}
    return ("from std.mechanical import inertia, rotary_damper",), body, traced, end, rest


def stops(dice):
    """A driven mass on a spring between steep springs."""
    m, k, c = _log(dice, 0.2, 5), _log(dice, 10, 1000), _log(dice, 0.05, 2)
    gap, force, w = _log(dice, 0.01, 0.1), _log(dice, 5, 50), _log(dice, 3, 20)
    hard = float(f"{_log(dice, 1e2, 1e4) * k:.4g}")
    end = float(f"{dice.uniform(1.5, 4.0) * 2 * np.pi / w:.4g}")
    dead = f"(max(q - {gap} m, 0 m) + min(q + {gap} m, 0 m))"
    body = ["node x: translation = 0 m", f"M: mass(m = {m} kg) x", f"K: spring(k = {k} N/m) x -> ground"]
    body += [f"C: damper(b = {c} N.s/m) x -> ground", f"S: potential(e = {hard!r} N/m*{dead}) x -> ground"]
    body += [f"F: force(F = {force} N*sin({w} rad/s*t)) ground -> x", "init x.f = 0 m/s"]

    def rates(t, y, mode):
        stop = hard * mode * (mode * y[0] - gap)
        return [y[1], (force * np.sin(w * t) - k * y[0] - c * y[1] - stop) / m]

    rest = {"rates": rates, "y": [0.0, 0.0], "read": lambda y: y, "method": "DOP853"}
    rest["turns"] = tuple(_sides(lambda y: y[0], gap))
    return ("from std.mechanical import mass, spring, damper, force",), body, {"q": "x.q", "v": "x.f"}, end, rest


def ideal_bridges(dice):
    """A bridge of ideal diodes behind a resistor, before a capacitor and a load, or behind a coil of its own."""
    hz, v, r = _log(dice, 20, 500), _log(dice, 5, 300), _log(dice, 5, 500)
    rs, coil = float(f"{_log(dice, 0.003, 0.05) * r:.4g}"), dice.random() < 0.5
    c, h = float(f"{_log(dice, 0.1, 20) / (r * hz):.4g}"), float(f"{_log(dice, 0.005, 0.1) * r / hz:.4g}")
    body = [
        "node s, x, a, p, m: electrical",
        f"V: voltage(v = {v} V*sin(2*pi*{hz} Hz*t)) s -> b",
        f"R: resistor(R = {rs!r} ohm) s -> x",
    ]
    body[0] = "node s, x, a, b, p, m: electrical"
    body += [f"L: inductor(L = {h!r} H) x -> a", "init L.f = 0 A"] if coil else ["W: resistor(R = 0 ohm) x -> a"]
    body = body if coil else [body[0].replace(" x,", ""), body[1], body[2].replace("-> x", "-> a")]
    for k, (one, two) in enumerate((("a", "p"), ("b", "p"), ("m", "a"), ("m", "b"))):
        body += [f"D{k}: diode.complementary() {one} -> {two}"]
    body += [
        f"C: capacitor(C = {c!r} F) p -> m",
        "init C.e = 0 V",
        f"Q: resistor(R = {r} ohm) p -> m",
        "G: resistor(R = 1 kohm) m -> ground",
    ]
    end, w = float(f"{dice.uniform(2.0, 4.0) / hz:.4g}"), 2 * np.pi * hz
    turns = ()
    if not coil:

        def rates(t, y, mode):
            return [(max(abs(v * np.sin(w * t)) - y[0], 0.0) / rs - y[0] / r) / c]

        y, read = [0.0], lambda y: y
        instants = {float(k / (2 * hz)): None for k in range(1, 9)}
    else:

        def rates(t, y, mode):
            di = (v * np.sin(w * t) - rs * y[1] - mode * y[0]) / h if mode else 0.0
            return [(abs(y[1]) - y[0] / r) / c, di]

        def driven(sense):
            return lambda t, y: sense * v * np.sin(w * t) - y[0]

        turns = (Turn(0, driven(1), 1), Turn(0, driven(-1), -1))
        turns += (Turn(1, lambda t, y: -y[1], 0, 1), Turn(-1, lambda t, y: y[1], 0, 1))
        y, read, instants = [0.0, 0.0], lambda y: y, {}
    traced = {"vc": "C.e"} | ({"i": "L.f"} if coil else {})
    rest = {"rates": rates, "y": y, "read": read, "instants": instants, "turns": turns, "mode": 1 if coil else 0}
    return ("from std.electrical import resistor, inductor, capacitor, voltage, diode",), body, traced, end, rest


def exponential_bridges(dice):
    """The same of exponential diodes, whose nodes are known: both arms are an arc sinus hyperbolicus."""
    hz, v, r = _log(dice, 20, 500), _log(dice, 2, 25), _log(dice, 20, 2000)
    rs, i0 = float(f"{_log(dice, 0.003, 0.05) * r:.4g}"), _log(dice, 1e-14, 1e-8)
    c, vt = float(f"{_log(dice, 0.1, 20) / (r * hz):.4g}"), 0.02585
    body = [
        "node s, a, b, p, m: electrical",
        f"V: voltage(v = {v} V*sin(2*pi*{hz} Hz*t)) s -> b",
        f"R: resistor(R = {rs!r} ohm) s -> a",
    ]
    for k, (one, two) in enumerate((("a", "p"), ("b", "p"), ("m", "a"), ("m", "b"))):
        body += [f"D{k}: diode(Is = {i0} A, vT = {vt} V) {one} -> {two}"]
    body += [
        f"C: capacitor(C = {c!r} F) p -> m",
        "init C.e = 0 V",
        f"Q: resistor(R = {r} ohm) p -> m",
        "G: resistor(R = 1 kohm) m -> ground",
    ]
    end, w = float(f"{dice.uniform(2.0, 4.0) / hz:.4g}"), 2 * np.pi * hz

    def rates(t, y, mode):
        drive, scale = abs(v * np.sin(w * t)), 2.0 * i0 * np.exp(-y[0] / (2.0 * vt))
        angle = np.arcsinh(drive / (rs * scale))  # of drive = 2 vt angle + rs scale sinh(angle): convex, from above
        for _ in range(200):
            off = 2.0 * vt * angle + rs * scale * np.sinh(angle) - drive
            step = off / (2.0 * vt + rs * scale * np.cosh(angle))
            angle -= step
            if abs(step) <= 1e-15 * abs(angle):
                break
        return [(scale * np.cosh(angle) - 2.0 * i0 - y[0] / r) / c]

    rest = {"rates": rates, "y": [0.0], "read": lambda y: y}
    rest["instants"] = {float(k / (2 * hz)): None for k in range(1, 9)}
    return ("from std.electrical import resistor, capacitor, voltage, diode",), body, {"vc": "C.e"}, end, rest


def converters(dice):
    """A switch that is pulsed, a free-wheeling ideal diode, a coil, a capacitor and a load."""
    period, duty, v, r = _log(dice, 1e-5, 1e-3), round(dice.uniform(0.1, 0.9), 3), _log(dice, 3, 100), _log(dice, 1, 50)
    h = float(f"{_log(dice, 0.05, 20) * r * period:.4g}")
    c, rl, cycles = float(f"{_log(dice, 1, 50) * period / r:.4g}"), float(f"{0.02 * r:.4g}"), dice.randint(5, 20)
    body = ["node in_, sw, l, out: electrical", f"V: voltage(v = {v} V) in_ -> ground"]
    body += [f"P: pwm(period = {period} s) duty = {duty}", "S: switch() in_ -> sw, gate = P.gate"]
    body += ["D: diode.complementary() ground -> sw", f"R: resistor(R = {rl!r} ohm) sw -> l"]
    body += [f"L: inductor(L = {h!r} H) l -> out", f"Q: resistor(R = {r} ohm) out -> ground", "init L.f = 0 A"]
    body += [f"C: capacitor(C = {c!r} F) out -> ground", "init C.e = 0 V"]

    def rates(t, y, mode):
        drive = v if mode == 1 else 0.0
        return [0.0 if mode == 2 else (drive - rl * y[0] - y[1]) / h, (y[0] - y[1] / r) / c]

    instants = {0.0: 1} | {k * period: 1 for k in range(1, cycles)} | {(k + duty) * period: 0 for k in range(cycles)}
    rest = {"rates": rates, "y": [0.0, 0.0], "read": lambda y: y, "instants": instants}
    rest["turns"] = (Turn(0, lambda t, y: -y[0], 2, 0),)
    head = ("from std.electrical import resistor, inductor, capacitor, voltage, switch, pwm, diode",)
    return head, body, {"i": "L.f", "vc": "C.e"}, float(f"{cycles * period:.9g}"), rest


def relays(dice):
    """A mass with a damper that a relay with hysteresis pulls to and fro."""
    m, c, k, pull = _log(dice, 0.3, 3), _log(dice, 0.05, 1), _log(dice, 0.5, 10), _log(dice, 1, 10)
    band, begin = _log(dice, 0.01, 0.3), _log(dice, 0.5, 2)
    end = float(f"{dice.uniform(1.5, 4.0) * 2 * np.pi * (m / k) ** 0.5:.4g}")
    body = ["node x: translation = 0 m", f"M: mass(m = {m} kg) x", f"K: spring(k = {k} N/m) x -> ground"]
    body += [f"C: damper(b = {c} N.s/m) x -> ground", "discrete sense = 1"]
    body += [f"when x.f >= {band} m/s {{ sense := 1 }}", f"when x.f <= -{band} m/s {{ sense := -1 }}"]
    body += [f"F: force(F = -{pull} N*sense) ground -> x", f"init x.f = {begin} m/s"]

    def rates(t, y, mode):
        return [y[1], (-pull * mode - k * y[0] - c * y[1]) / m]

    turns = (Turn(-1, lambda t, y: y[1] - band, 1), Turn(1, lambda t, y: -band - y[1], -1))
    rest = {"rates": rates, "y": [0.0, begin], "read": lambda y: y, "mode": 1, "turns": turns}
    return ("from std.mechanical import mass, spring, damper, force",), body, {"q": "x.q", "v": "x.f"}, end, rest


FAMILIES = (chains, clutches, engaged, play, stops, ideal_bridges, exponential_bridges, converters, relays)
