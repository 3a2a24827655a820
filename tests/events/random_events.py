"""Random event models, seeded: text of model number k, the same for ever.

Ten families, each with its own random numbers of parts and parameters: masses that bounce, elastic and hard stops,
ideal diodes before loads, switches, dry friction (content and sign), relays, sampled controllers, tables and limits,
stiction with two coefficients, and mixtures of a mechanical and a controlled part.
"""

import random
from dataclasses import dataclass

ACCURACY = 1e-4
DIODE = "component ideal_diode {\n  branch: electrical\n  psi one_way: f >= 0 A\n}"


@dataclass(frozen=True)
class Drawn:
    """Model number, family, text; its scene is `s`."""

    number: int
    family: str
    text: str


def drawn(number):
    """The model of that number."""
    dice = random.Random(20261121 + number)
    family = FAMILIES[number % len(FAMILIES)]
    head, body, traced, span = family(dice)
    lines = [*head, "model m {", *(f"  {line}" for line in body), "}", "scene s of m {", f"  time 0 s to {span:g} s"]
    lines += [f"  trace {', '.join(traced)}", f"  accuracy {ACCURACY:g}", "}"]
    return Drawn(number, family.__name__, "\n".join(lines) + "\n")


def _log(dice, low, high):
    return round(low * (high / low) ** dice.random(), 6)


def bounces(dice):
    """Balls in a column above a floor, or side by side, each with its own restitution."""
    n, stacked = dice.randint(1, 4), dice.random() < 0.5
    body, height = [], 0.0
    for k in range(n):
        height = height + _log(dice, 0.05, 0.5) if stacked else _log(dice, 0.05, 2.0)
        m, r = _log(dice, 0.1, 10), round(dice.uniform(0.0, 0.95), 3)
        body += [f"coord x{k}: translation = {height:g} m", f"energy T* = 1/2*({m} kg)*x{k}'^2"]
        body += [f"work -({m} kg)*g0 on x{k}"]
        below = f"x{k} - x{k - 1}" if stacked and k else f"x{k}"
        body += [f"phi floor{k}: {below} >= 0 m restitution {r}"]
    return (), body, [f"x{k}" for k in range(n)], round(dice.uniform(0.5, 2.5), 3)


def stops(dice):
    """A driven oscillator between two stops, hard with restitution or elastic."""
    m, k, c = _log(dice, 0.2, 5), _log(dice, 10, 1000), _log(dice, 0.05, 2)
    gap, force, w = _log(dice, 0.01, 0.2), _log(dice, 1, 50), _log(dice, 1, 20)
    body = ["coord x: translation = 0 m", f"energy T* = 1/2*({m} kg)*x'^2", f"energy V = 1/2*({k} N/m)*x^2"]
    body += [f"content D = 1/2*({c} N.s/m)*x'^2", f"work ({force} N)*sin(({w} rad/s)*t) on x"]
    if dice.random() < 0.5:
        r = round(dice.uniform(0.0, 0.9), 3)
        body += [f"phi right: {gap} m - x >= 0 m restitution {r}", f"phi left: x + {gap} m >= 0 m restitution {r}"]
    else:
        hard = _log(dice, 20, 500) * k
        body += [f"work -({hard:g} N/m)*(max(x - {gap} m, 0 m) + min(x + {gap} m, 0 m)) on x"]
    return (), body, ["x", "x'"], round(dice.uniform(1, 4), 3)


def diodes(dice):
    """A half-wave rectifier, a bridge, or a doubler, into R, RC, RL or RLC."""
    f, v, r = _log(dice, 20, 500), _log(dice, 2, 300), _log(dice, 5, 500)
    bridge, load = dice.random() < 0.5, dice.choice(("R", "RC", "RL", "RLC"))
    far = "n" if bridge else "ground"
    body = ["node s, a, p: electrical", *(["node n: electrical"] if bridge else [])]
    body += [f"Vs: voltage(v = {v} V*sin(2*pi*({f} Hz)*t)) s -> ground"]
    body += [f"Ri: resistor(R = {_log(dice, 0.01, 0.05) * r:g} ohm) s -> a"]
    arms = (("a", "p"), ("ground", "p"), ("n", "a"), ("n", "ground")) if bridge else (("a", "p"),)
    body += [f"D{k}: ideal_diode() {x} -> {y}" for k, (x, y) in enumerate(arms)]
    c, h = _log(dice, 0.1, 20) / (r * f), _log(dice, 0.02, 2) * r / f
    if load == "R":
        body += [f"R: resistor(R = {r} ohm) p -> {far}"]
    elif load == "RC":
        body += [f"R: resistor(R = {r} ohm) p -> {far}", f"C: capacitor(C = {c:g} F) p -> {far}"]
    else:
        body += ["node x: electrical", f"L: inductor(L = {h:g} H) p -> x", f"R: resistor(R = {r} ohm) x -> {far}"]
        if load == "RLC":
            body += [f"C: capacitor(C = {c:g} F) x -> {far}"]
    head = ("from std.electrical import resistor, inductor, capacitor, voltage", DIODE)
    return head, body, ["R.e", "Ri.f"], round(2.5 / f, 6)


def switches(dice):
    """A switch that is pulsed, a free-wheeling diode, a coil and a load."""
    period, duty, v = _log(dice, 1e-5, 1e-3), round(dice.uniform(0.1, 0.9), 3), _log(dice, 3, 100)
    r = _log(dice, 1, 50)
    h, c = _log(dice, 0.2, 20) * r * period, _log(dice, 1, 50) * period / r
    body = ["node in_, sw, out: electrical", f"Vs: voltage(v = {v} V) in_ -> ground"]
    body += [f"P: pwm(period = {period} s) duty = {duty}", "S: switch() in_ -> sw, gate = P.gate"]
    body += ["D: ideal_diode() ground -> sw", f"L: inductor(L = {h:g} H) sw -> out"]
    body += [f"R: resistor(R = {r} ohm) out -> ground", "init L.f = 0 A"]
    body += [f"C: capacitor(C = {c:g} F) out -> ground", "init C.e = 0 V"] if dice.random() < 0.7 else []
    head = ("from std.electrical import resistor, inductor, capacitor, voltage, switch, pwm", DIODE)
    return head, body, ["L.f", "R.e"], round(dice.randint(5, 20) * period, 9)


def friction(dice):
    """Blocks joined by springs, each with dry friction; the first is driven."""
    n, body = dice.randint(1, 4), []
    kind = dice.choice(("content", "sign"))
    for k in range(n):
        m, c = _log(dice, 0.2, 5), _log(dice, 0.2, 5)
        body += [f"coord x{k}: translation = 0 m", f"energy T* = 1/2*({m} kg)*x{k}'^2"]
        body += [f"content D = ({c} N)*abs(x{k}')" if kind == "content" else f"work -({c} N)*sign(x{k}') on x{k}"]
        if k:
            body += [f"energy V = 1/2*({_log(dice, 20, 2000)} N/m)*(x{k} - x{k - 1})^2"]
    body += [f"init x0' = {round(dice.uniform(-2, 2), 3)} m/s"]
    body += [f"work ({_log(dice, 0.5, 20)} N)*sin(({_log(dice, 1, 20)} rad/s)*t) on x0"]
    return (), body, [f"x{k}" for k in range(n)], round(dice.uniform(1, 3), 3)


def relays(dice):
    """A store that a relay heats: with hysteresis, or without, so that it slides."""
    low = round(dice.uniform(15, 22), 2)
    high, out, tau = low + _log(dice, 0.2, 3), round(dice.uniform(-10, 10), 2), _log(dice, 2, 50)
    power = round(2.0 * (high - out) / tau, 6)
    body = [f"state T: K = {round(low - 3 * dice.random(), 3)} K"]
    if dice.random() < 0.5:
        body += ["discrete heating = true", f"when T > {high:g} K {{ heating := false }}"]
        body += [f"when T < {low} K {{ heating := true }}"]
        on = "heating"
    else:
        on = f"T < {high:g} K"
    body += [f"dynamic T' = -(T - ({out} K))/({tau} s) + (if {on} then {power:g} K/s else 0 K/s)"]
    return (), body, ["T"], round(4.0 * tau, 3)


def sampled(dice):
    """A mass that a sampled PI controller with limits moves to its set point."""
    m, ts = _log(dice, 0.5, 5), _log(dice, 5e-3, 5e-2)
    kp, kd, ki = 4.0 * m, 3.0 * m, 0.5 * m
    body = ["coord x: translation = 0 m", f"energy T* = 1/2*({m} kg)*x'^2"]
    body += ["discrete F: N = 0 N", "discrete I: N = 0 N"]
    body += [f"every {ts} s {{"]
    body += [f"  I := clip(I + ({ki * ts:g} N/m)*(1 m - x), -1 N, 1 N)"]
    body += [f"  F := clip(({kp:g} N/m)*(1 m - x) - ({kd:g} N.s/m)*x' + I, -{m:g} N, {m:g} N)", "}"]
    body += ["work F on x", f"content D = 1/2*({_log(dice, 0.01, 0.5)} N.s/m)*x'^2"]
    return (), body, ["x", "x'"], round(dice.uniform(1, 3), 3)


def limits(dice):
    """A mass on a table of straight pieces, pushed by a controller with limits."""
    points = sorted({round(dice.uniform(-1, 1), 2) for _ in range(dice.randint(3, 8))} | {-1.5, 0.0, 1.5})
    forces = [round(x * _log(dice, 2, 20) + 0.0, 3) for x in points]
    rows = ", ".join(f"({x}, {y})" for x, y in zip(points, sorted(forces), strict=True))
    head = (f"table F(x: m) -> N linear extend [ {rows} ]",)
    most = _log(dice, 0.5, 5)
    body = [f"coord x: translation = {round(dice.uniform(-1.2, 1.2), 3)} m", "energy T* = 1/2*(1 kg)*x'^2"]
    body += ["work -F(x) on x", f"work clip(-({_log(dice, 0.5, 5)} N.s/m)*x', -{most} N, {most} N) on x"]
    return head, body, ["x", "x'"], round(dice.uniform(2, 6), 3)


def stiction(dice):
    """A block on a belt or a driven oscillator with two coefficients of friction."""
    m, k, belt = _log(dice, 0.2, 5), _log(dice, 5, 200), round(dice.uniform(0.05, 0.5), 3)
    slow = _log(dice, 0.2, 3)
    fast = round(slow * dice.uniform(1.1, 2.0), 6)
    body = ["coord x: translation = 0 m", f"energy T* = 1/2*({m} kg)*x'^2", f"energy V = 1/2*({k} N/m)*x^2"]
    body += ["discrete stuck = true", f"init x' = {belt} m/s", f"psi hold: x' = {belt} m/s while stuck"]
    body += [f"content D = (if stuck then 0 N else {slow} N)*abs(x' - {belt} m/s)"]
    body += [f"when abs(hold.multiplier) > {fast} N {{ stuck := false }}"]
    body += [f"when x' >= {belt} m/s and abs(({k} N/m)*x) < {fast} N and not stuck {{ stuck := true }}"]
    return (), body, ["x", "x'"], round(dice.uniform(1, 6), 3)


def mixed(dice):
    """A ball, a block with friction on a spring with play, and a relay that pulls it."""
    ball = bounces(dice)
    m, c, k, play = _log(dice, 0.3, 3), _log(dice, 0.1, 1), _log(dice, 50, 500), _log(dice, 0.01, 0.1)
    pull = _log(dice, 1.5, 5)
    body = [*ball[1], "coord y: translation = 0.2 m", f"energy T* = 1/2*({m} kg)*y'^2", f"content D = ({c} N)*abs(y')"]
    body += [f"work -({k} N/m)*(max(y - {play} m, 0 m) + min(y + {play} m, 0 m)) on y"]
    body += [f"work (if y > 0 m then -{pull} N else {pull} N) on y"]
    return (), body, [*ball[2], "y"], min(ball[3], 2.0)


FAMILIES = (bounces, stops, diodes, switches, friction, relays, sampled, limits, stiction, mixed)
