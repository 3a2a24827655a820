"""Seeded circuits with steep laws, and what they do by formulations of our own (no word of sysdyn in them).

Each family is a text of the language with its parameters left open, and the same circuit as one or two ordinary
differential equations: the charges of capacitors or the current of a coil are the states, whatever is algebraic beside
them has a closed form or is found by bisection.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

PERIODS = 4
INSTANTS = 160
IMPORT = "from std.electrical import diode, npn, voltage, capacitor, resistor, inductor\n"
HEAD = """model circuit {{
  param A = {A!r} V
  param fr = {f!r} Hz
  param Is = {Is!r} A
  param vT = {vT!r} V
  param R = {R!r} ohm
"""
SCENE = """
}}
scene run of circuit {{
  time 0 s to {end!r} s
  trace {trace} every {every!r} s
}}
"""


@dataclass(frozen=True)
class Circuit:
    """text: the model and its scene `run`; wanted: traced name -> values at `time` [s]."""

    name: str
    text: str
    reference: Callable[[np.ndarray], dict[str, np.ndarray]]
    time: np.ndarray


def junction(v, values):
    """Current of a diode [A] at v [V]."""
    return values["Is"] * np.expm1(np.minimum(v / values["vT"], 600.0))


def sine(t, values):
    return values["A"] * np.sin(2 * np.pi * values["f"] * t)


def integrated(rate, start, time, values, jacobian=None):
    """States [instants, states] by SciPy's Radau at 1e-9; scale: of each state."""
    period = 1.0 / values["f"]
    scale = np.maximum(np.abs(values["scale"]), 1e-300)
    with np.errstate(over="ignore", invalid="ignore"):  # it looks beyond a step that it rejects
        found = solve_ivp(
            rate, (0.0, time[-1]), start, method="Radau", t_eval=time, rtol=1e-9, atol=1e-11 * scale,
            max_step=period / 60, jac=jacobian, first_step=1e-7 * period,
        )  # fmt: skip
    assert found.success, found.message
    return found.y.T


def root(function, low, high):
    """The zero of a monotone function between bounds, widened until they enclose it."""
    width = max(high - low, 1e-12)
    while function(low) > 0.0:
        low -= width
        width *= 2.0
    while function(high) < 0.0:
        high += width
        width *= 2.0
    return brentq(function, low, high, xtol=1e-15, rtol=1e-15, maxiter=500)


# --- half-wave rectifier, the source's resistance zero or not -----------------------------------------------------

RECTIFIER = """  param C = {C!r} F
  node s, out: electrical
  supply: voltage(v = A*sin(2*pi*fr*t)) s -> ground
  D: diode(Is = Is, vT = vT) s -> out
  cap: capacitor(C = C) out -> ground
  load: resistor(R = R) out -> ground
  init cap.e = 0 V"""

RECTIFIER_RS = """  param C = {C!r} F
  param Rs = {Rs!r} ohm
  node s, m, out: electrical
  supply: voltage(v = A*sin(2*pi*fr*t)) s -> ground
  rs: resistor(R = Rs) s -> m
  D: diode(Is = Is, vT = vT) m -> out
  cap: capacitor(C = C) out -> ground
  load: resistor(R = R) out -> ground
  init cap.e = 0 V"""


def rectifier(values):
    def current(t, v):
        u = sine(t, values) - v
        if not values.get("Rs"):
            return float(junction(u, values))
        # the diode's voltage e: its current is that of the resistance
        bound = [min(u, 0.0), max(u, 0.0)]
        e = root(lambda e: junction(e, values) - (u - e) / values["Rs"], *bound)
        return (u - e) / values["Rs"] if u - e > 1e-3 * abs(u) else float(junction(e, values))

    def rate(t, x):
        return [(current(t, x[0]) - x[0] / values["R"]) / values["C"]]

    def reference(time):
        v = integrated(rate, [0.0], time, values)[:, 0]
        return {"v": v, "i": np.array([current(t, x) for t, x in zip(time, v, strict=True)])}

    return reference


# --- clipper: two diodes in opposite directions across a capacitor ------------------------------------------------

CLIPPER = """  param C = {C!r} F
  param Rs = {Rs!r} ohm
  node s, out: electrical
  supply: voltage(v = A*sin(2*pi*fr*t)) s -> ground
  rs: resistor(R = Rs) s -> out
  D1: diode(Is = Is, vT = vT) out -> ground
  D2: diode(Is = Is, vT = vT) ground -> out
  cap: capacitor(C = C) out -> ground
  load: resistor(R = R) out -> ground
  init cap.e = 0 V"""

CLIPPER_BARE = """  param Rs = {Rs!r} ohm
  node s, out: electrical
  supply: voltage(v = A*sin(2*pi*fr*t)) s -> ground
  rs: resistor(R = Rs) s -> out
  D1: diode(Is = Is, vT = vT) out -> ground
  D2: diode(Is = Is, vT = vT) ground -> out
  load: resistor(R = R) out -> ground"""


def clipper(values):
    def out(v):
        return float(junction(v, values) - junction(-v, values)) + v / values["R"]

    def rate(t, x):
        return [((sine(t, values) - x[0]) / values["Rs"] - out(x[0])) / values["C"]]

    def reference(time):
        if "C" in values:
            v = integrated(rate, [0.0], time, values)[:, 0]
        else:
            both = [(sine(t, values), abs(sine(t, values))) for t in time]
            v = np.array([root(lambda v, u=u: out(v) - (u - v) / values["Rs"], -a, a) if a else 0.0 for u, a in both])
        return {"v": v, "i": (sine(time, values) - v) / values["Rs"]}

    return reference


# --- doubler ------------------------------------------------------------------------------------------------------

DOUBLER = """  param C = {C!r} F
  param C2 = {C2!r} F
  node s, a, out: electrical
  supply: voltage(v = A*sin(2*pi*fr*t)) s -> ground
  c1: capacitor(C = C) s -> a
  D1: diode(Is = Is, vT = vT) ground -> a
  D2: diode(Is = Is, vT = vT) a -> out
  c2: capacitor(C = C2) out -> ground
  load: resistor(R = R) out -> ground
  init c1.e = 0 V
  init c2.e = 0 V"""


def doubler(values):
    def currents(t, x):
        a = sine(t, values) - x[0]
        return junction(-a, values), junction(a - x[1], values)

    def rate(t, x):
        i1, i2 = currents(t, x)
        return [(i2 - i1) / values["C"], (i2 - x[1] / values["R"]) / values["C2"]]

    def reference(time):
        x = integrated(rate, [0.0, 0.0], time, values)
        return {"v": x[:, 1], "i": np.array([currents(t, y)[1] for t, y in zip(time, x, strict=True)])}

    return reference


# --- bridge: the source floats between the diodes -----------------------------------------------------------------

BRIDGE = """  param C = {C!r} F
  param Rs = {Rs!r} ohm
  node a, b, s, out: electrical
  supply: voltage(v = A*sin(2*pi*fr*t)) s -> b
  rs: resistor(R = Rs) s -> a
  D1: diode(Is = Is, vT = vT) a -> out
  D2: diode(Is = Is, vT = vT) b -> out
  D3: diode(Is = Is, vT = vT) ground -> a
  D4: diode(Is = Is, vT = vT) ground -> b
  cap: capacitor(C = C) out -> ground
  load: resistor(R = R) out -> ground
  init cap.e = 0 V"""


def bridge(values):
    """With w = (va - vb)/2 the four laws are a single one: i = 2 Is exp(-p/(2 vT)) sinh(w/vT)."""
    saturation, thermal = values["Is"], values["vT"]

    def current(t, p):
        u = sine(t, values)
        factor = np.log(2.0 * saturation) - p / (2.0 * thermal)

        def through(w):
            x = abs(w) / thermal
            return np.sign(w) * np.exp(min(factor + x, 600.0)) * -np.expm1(-2.0 * x) / 2.0

        bound = abs(u) / 2.0
        w = root(lambda w: through(w) - (u - 2.0 * w) / values["Rs"], -bound, bound) if bound else 0.0
        return float(through(w)), w

    def direct(t, p):
        _, w = current(t, p)
        return float(junction(w - p / 2.0, values) + junction(-w - p / 2.0, values))

    def rate(t, x):
        return [(direct(t, x[0]) - x[0] / values["R"]) / values["C"]]

    def reference(time):
        v = integrated(rate, [0.0], time, values)[:, 0]
        return {"v": v, "i": np.array([current(t, p)[0] for t, p in zip(time, v, strict=True)])}

    return reference


# --- coils: freewheeling, and a step on a coil with a diode -------------------------------------------------------

FREEWHEEL = """  param L = {L!r} H
  node s, n, m: electrical
  supply: voltage(v = A*sin(2*pi*fr*t)) s -> ground
  D1: diode(Is = Is, vT = vT) s -> n
  D2: diode(Is = Is, vT = vT) ground -> n
  coil: inductor(L = L) n -> m
  load: resistor(R = R) m -> ground
  init coil.f = 0 A"""


def freewheel(values):
    saturation, thermal = values["Is"], values["vT"]

    def node(t, i):
        """exp(-n/vT) (exp(vs/vT) + 1) = i/Is + 2."""
        return thermal * (np.logaddexp(sine(t, values) / thermal, 0.0) - np.log(max(i / saturation + 2.0, 1e-12)))

    def rate(t, x):
        return [(node(t, x[0]) - values["R"] * x[0]) / values["L"]]

    def reference(time):
        i = integrated(rate, [0.0], time, values)[:, 0]
        return {"i": i, "v": values["R"] * i}

    return reference


COIL_STEP = """  param L = {L!r} H
  node s, n, m: electrical
  supply: voltage(v = if t < {step!r} s then 0 V else A) s -> ground
  load: resistor(R = R) s -> n
  coil: inductor(L = L) n -> m
  D: diode(Is = Is, vT = vT) m -> ground
  init coil.f = 0 A"""


def coil_step(values):
    def rate(t, x):
        source = 0.0 if t < values["step"] else values["A"]
        drop = values["vT"] * np.log1p(max(x[0] / values["Is"], -1.0 + 1e-12))
        return [(source - values["R"] * x[0] - drop) / values["L"]]

    def reference(time):
        before = time[time <= values["step"]]
        shifted = np.concatenate([[0.0], time[time > values["step"]] - values["step"]])
        late = integrated(lambda t, x: rate(t + values["step"], x), [0.0], shifted, values)[1:, 0]
        i = np.concatenate([np.zeros(before.size), late])
        return {"i": i, "v": values["vT"] * np.log1p(i / values["Is"])}

    return reference


# --- a transistor that is driven into saturation and out of it ----------------------------------------------------

STAGE = """  param Vcc = {Vcc!r} V
  param bias = {bias!r} V
  param Rb = {Rb!r} ohm
  param C = {C!r} F
  node vcc, s, b, c: electrical
  feed: voltage(v = Vcc) vcc -> ground
  supply: voltage(v = bias + A*sin(2*pi*fr*t)) s -> ground
  rb: resistor(R = Rb) s -> b
  Q: npn(Ies = Is, Ics = 2*Is, vT = vT) c = c, b = b, e = ground
  rc: resistor(R = R) vcc -> c
  cap: capacitor(C = C) c -> ground
  init cap.e = {Vcc!r} V"""


def stage(values):
    forward, backward = 0.99, 0.495

    def junctions(base, collector):
        to_emitter = float(junction(base, values))
        to_collector = 2.0 * float(junction(base - collector, values))
        return to_emitter, to_collector

    def base(t, c):
        u = values["bias"] + sine(t, values)

        def balance(b):
            f, r = junctions(b, c)
            return (1 - forward) * f + (1 - backward) * r - (u - b) / values["Rb"]

        return root(balance, min(u, -0.1), max(min(u, 1.5), 0.1))

    def rate(t, x):
        f, r = junctions(base(t, x[0]), x[0])
        return [((values["Vcc"] - x[0]) / values["R"] - (forward * f - r)) / values["C"]]

    def reference(time):
        v = integrated(rate, [values["Vcc"]], time, values)[:, 0]
        return {"v": v, "b": np.array([base(t, x) for t, x in zip(time, v, strict=True)])}

    return reference


# --- the generator ------------------------------------------------------------------------------------------------


def _decades(random, low, high):
    return float(f"{10.0 ** random.uniform(np.log10(low), np.log10(high)):.4g}")


def _values(random):
    return {
        "A": _decades(random, 1.0, 325.0),
        "f": _decades(random, 10.0, 2000.0),
        "Is": _decades(random, 1e-14, 1e-8),
        "vT": float(f"{0.02585 * random.uniform(1.0, 2.0):.5g}"),
        "R": _decades(random, 100.0, 100e3),
    }


def _capacity(random, values, over):
    """A time constant of 0.1 to 30 periods with the resistance."""
    return float(f"{_decades(random, 0.1, 30.0) / (values['f'] * over):.4g}")


def _made(name, body, make, values, trace, end):
    every = end / INSTANTS
    scene = SCENE.format(end=end, every=every, trace=trace)
    text = IMPORT + HEAD.format(**values) + body.format(**values) + scene
    return Circuit(name, text, make(values), np.minimum(every * np.arange(INSTANTS + 1), end))


def circuit(seed):
    """The circuit of a number."""
    random = np.random.default_rng(1000 + seed)
    values = _values(random)
    end = PERIODS / values["f"]
    kind = seed % 8
    if kind in (0, 1):
        values |= {"C": _capacity(random, values, values["R"]), "scale": values["A"]}
        if kind:
            values["Rs"] = _decades(random, 1e-4, 1e-1) * values["R"]
        body, name = (RECTIFIER_RS, "rectifier_rs") if kind else (RECTIFIER, "rectifier")
        return _made(f"{name}_{seed}", body, rectifier, values, "cap.e as v, D.f as i", end)
    if kind == 2:
        values |= {"Rs": _decades(random, 1e-3, 1.0) * values["R"], "scale": 1.0}
        if random.uniform() < 0.5:
            return _made(f"clipper_bare_{seed}", CLIPPER_BARE, clipper, values, "D1.e as v, rs.f as i", end)
        values["C"] = float(f"{_decades(random, 1e-3, 0.3) / (values['f'] * values['Rs']):.4g}")
        return _made(f"clipper_{seed}", CLIPPER, clipper, values, "D1.e as v, rs.f as i", end)
    if kind == 3:
        values |= {"C": _capacity(random, values, values["R"]), "scale": values["A"]}
        values["C2"] = float(f"{_decades(random, 0.1, 10.0) * values['C']:.4g}")
        return _made(f"doubler_{seed}", DOUBLER, doubler, values, "c2.e as v, D2.f as i", end)
    if kind == 4:
        values |= {"C": _capacity(random, values, values["R"]), "scale": values["A"]}
        values["Rs"] = _decades(random, 1e-4, 1e-1) * values["R"]
        return _made(f"bridge_{seed}", BRIDGE, bridge, values, "cap.e as v, rs.f as i", end)
    if kind == 5:
        values |= {"L": float(f"{_decades(random, 0.03, 10.0) * values['R'] / values['f']:.4g}")}
        values["scale"] = min(values["A"] / values["R"], values["A"] / (values["L"] * 6 * values["f"]))
        return _made(f"freewheel_{seed}", FREEWHEEL, freewheel, values, "coil.f as i, load.e as v", end)
    if kind == 6:
        values |= {"L": float(f"{_decades(random, 0.01, 1.0) * values['R'] / values['f']:.4g}")}
        values |= {"scale": values["A"] / values["R"], "step": float(f"{end / 7:.4g}")}
        return _made(f"coil_step_{seed}", COIL_STEP, coil_step, values, "coil.f as i, D.e as v", end)
    values |= {"Vcc": _decades(random, 3.0, 30.0), "bias": float(f"{random.uniform(0.0, 2.0):.3g}"), "A": 3.0}
    values["Is"] = _decades(random, 1e-16, 1e-12)
    values |= {"A": _decades(random, 0.3, 10.0), "Rb": _decades(random, 1.0, 100.0) * values["R"]}
    values |= {"C": float(f"{_decades(random, 1e-3, 0.3) / (values['f'] * values['R']):.4g}"), "scale": values["Vcc"]}
    return _made(f"stage_{seed}", STAGE, stage, values, "cap.e as v, Q.vbe as b", end)
