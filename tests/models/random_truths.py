"""Random runs whose truth is known by itself: a closed form, or SciPy on equations written here.

`python tests/models/random_truths.py NUMBER [FIRST_SEED]` runs NUMBER texts of SORTS in turn, each by a formulation, a
method that the user names and an accuracy at random; it prints each run that is met and more than TIMES off, each
refusal with its reason, then a table.  No run may be met and off.
"""

import sys
import tempfile
import time
import warnings
from collections import Counter
from pathlib import Path

import numpy as np
from scipy.integrate import solve_ivp
from scipy.special import lambertw
from sysdyn import api

TIMES = 3.0
"""Of the accuracy asked, of the largest value in the run."""
FOUR = ("lagrangian", "hamiltonian", "co_lagrangian", "co_hamiltonian")
METHODS = ("auto", "bdf", "radau", "rosenbrock", "dopri")
THERMAL, SATURATION = 0.025852, 1e-14
"""V, A: of the diodes here."""
EXACT = {"rtol": 1e-12, "atol": 1e-14}
LIMIT = 20.0
"""s of wall time a run."""


def power(random, low, high):
    """A number with five digits between two powers of ten: as written and as read are one."""
    return float(f"{10.0 ** random.uniform(low, high):.5g}")


def integrated(rates, begin, grid, **options):
    """States [states, instants] of rates(t, y) by SciPy."""
    return solve_ivp(rates, (grid[0], grid[-1]), begin, t_eval=grid, **{"method": "Radau", **EXACT, **options}).y


def across_a_source(random):
    """A diode straight across a source, beside it a capacitor behind a cubic resistor."""
    u, w, c, g = random.uniform(0.5, 5.0), power(random, 0, 3), power(random, -7, -4), power(random, -5, -2)
    kind = str(random.choice(["diode()", "diode.complementary()"]))
    source = f"-{u!r} V*abs(sin({w!r} rad/s*t))" if kind != "diode()" else f"{u!r} V*sin({w!r} rad/s*t)"
    end = float(f"{power(random, 0, 1.5) / w:.5g}")
    text = f"""from std.electrical import capacitor, diode, voltage
model m {{
  node a, b: electrical
  U: voltage(v = {source}) a -> ground
  J: {kind} a -> ground
  C: capacitor(C = {c!r} F) a -> b
  P: dissipator(f = {g!r} A*(e/(1 V))^3) b -> ground
  init C.e = 0 V
}}
scene s of m {{ time 0 s to {end!r} s; trace C.e, C.energy }}
"""

    def truth(t):
        def voltage(t):
            return u * np.sin(w * t) if kind == "diode()" else -u * abs(np.sin(w * t))

        v = integrated(lambda t, v: g * (voltage(t) - v) ** 3 / c, [0.0], t, max_step=0.05 / w)[0]
        return {"C.e": v, "C.energy": 0.5 * c * v**2}

    return text, FOUR, truth


def rectifier(random):
    """A sine through a resistor and an exponential diode into a capacitor with a load; the current by Lambert's W."""
    u, w, c = random.uniform(1.0, 20.0), power(random, 1, 4), power(random, -7, -4)
    r, load = power(random, 0, 3), power(random, 2, 5)
    end = float(f"{power(random, 0.5, 1.5) / w:.5g}")
    text = f"""from std.electrical import capacitor, diode, resistor, voltage
model m {{
  node a, b, k: electrical
  U: voltage(v = {u!r} V*sin({w!r} rad/s*t)) a -> ground
  R: resistor(R = {r!r} ohm) a -> b
  J: dissipator(f = {SATURATION!r} A*(exp(e/({THERMAL!r} V)) - 1)) b -> k
  C: capacitor(C = {c!r} F) k -> ground
  L: resistor(R = {load!r} ohm) k -> ground
  init C.e = 0 V
}}
scene s of m {{ time 0 s to {end!r} s; trace C.e }}
"""

    def current(e):
        x = np.log(SATURATION * r / THERMAL) + (e + SATURATION * r) / THERMAL
        found = x - np.log(max(x, 1e-300)) if x > 500.0 else float(lambertw(np.exp(x)).real)
        for _ in range(20):
            if found > 1e-12:
                found -= (found + np.log(found) - x) / (1.0 + 1.0 / found)
        return found * THERMAL / r - SATURATION

    def truth(t):
        rates = lambda t, v: [(current(u * np.sin(w * t) - v[0]) - v[0] / load) / c]  # noqa: E731
        return {"C.e": integrated(rates, [0.0], t, max_step=0.02 / w, rtol=1e-11, atol=1e-12)[0]}

    return text, FOUR, truth


def inverse(random):
    """Which force makes a mass on a spring and a damper, or one behind a spring, follow a prescribed path?"""
    m, k, c, w = power(random, -1, 2), power(random, 0, 4), power(random, -1, 1), power(random, -0.5, 1)
    behind = random.random() < 0.3
    one = f"""energy T* = 1/2*({m!r} kg)*b'^2
  energy V = 1/2*({k!r} N/m)*b^2
  content D = 1/2*({c!r} N.s/m)*b'^2
  work F on b"""
    two = f"""energy T* = 1/2*({m!r} kg)*(a'^2 + b'^2)
  energy V = 1/2*({k!r} N/m)*(a - b)^2
  work F on a"""
    text = f"""model m {{
  coord {"a, b" if behind else "b"}: translation ~ 0 m
  implicit F: N
  {two if behind else one}
  gamma follow: b = 1 m*sin({w!r} rad/s*t)
}}
scene s of m {{ time 0 s to 3 s; trace b, F every 10 ms }}
"""

    def truth(t):
        b, v = np.sin(w * t), w * np.cos(w * t)
        if behind:  # m b'' = k (a - b);  F = m a'' + k (a - b)
            share = 1.0 - m * w**2 / k
            return {"b": b, "F": -m * w**2 * share * b - m * w**2 * b}
        return {"b": b, "F": (k - m * w**2) * b + c * v}

    return text, ("lagrangian", "hamiltonian"), truth


def crank(random):
    """A crank whose rod is hardly longer turns freely through its dead centres."""
    rod, inertia, mass = 1.0 + power(random, -7, -1), power(random, 0, 3), power(random, -2, 0)
    text = f"""model m {{
  coord a: rotation = 1 rad
  coord x: translation ~ 1.5 m
  energy T* = 1/2*({inertia!r} kg.m^2)*a'^2 + 1/2*({mass!r} kg)*x'^2
  init a' = 1 rad/s
  phi rod: (x - 1 m*cos(a))^2 + (1 m*sin(a))^2 = ({rod!r} m)^2
}}
scene s of m {{ time 0 s to 10 s; trace a, x }}
"""

    def slider(a):
        along = np.sqrt((rod - np.sin(a)) * (rod + np.sin(a)))
        return np.cos(a) + along, -np.sin(a) - np.sin(a) * np.cos(a) / along

    def truth(t):
        whole = lambda a: inertia + mass * slider(a)[1] ** 2  # noqa: E731
        rate = lambda _, a: np.sqrt(whole(1.0) / whole(a))  # noqa: E731
        a = integrated(rate, [1.0], t, method="DOP853", max_step=0.05)[0]
        return {"a": a, "x": slider(a)[0]}

    return text, ("lagrangian", "hamiltonian"), truth


def timer(random):
    """A state that decays is lifted by a timer, in pulses a microsecond to a tenth of a period long."""
    period, width, decay = power(random, -2, 0), power(random, -6, -1), power(random, -1, 1)
    width, late = float(f"{width * period:.5g}"), power(random, 0, 7)
    times = int(random.integers(5, 60))
    end = float(f"{late + (times + 0.5) * period:.12g}")
    text = f"""model m {{
  discrete next = {late!r} s
  discrete on = 0
  discrete n = 0
  state y = 1
  dynamic y' = -y*({decay!r} Hz)*on
  when t >= next {{
    on := (if on < 0.5 then 1 else 0)
    n := n + 1
    next := next + (if on < 0.5 then {width!r} s else {period - width!r} s)
  }}
}}
scene s of m {{ time 0 s to {end!r} s; trace y, n }}
"""

    def truth(t):
        starts = late + period * np.arange(times + 2)
        since = np.clip(t[:, None] - starts, 0.0, width)
        passed = (t[:, None] >= starts).sum(axis=1) + (t[:, None] >= starts + width).sum(axis=1)
        return {"y": np.exp(-decay * since.sum(axis=1)), "n": passed.astype(float)}

    return text, ("lagrangian",), truth


def tank(random):
    """A tank runs empty through an orifice into one that leaks."""
    k, full, leak = power(random, -1, 1), power(random, -2, 1), power(random, -1, 1)
    empty = 2.0 * np.sqrt(full) / k
    end = float(f"{empty * random.uniform(0.5, 3.0):.5g}")
    text = f"""model m {{
  state h = {full!r}
  state g = 0
  dynamic h' = -{k!r} Hz*sqrt(max(h, 0))
  dynamic g' = {k!r} Hz*sqrt(max(h, 0)) - {leak!r} Hz*g
}}
scene s of m {{ time 0 s to {end!r} s; trace h, g }}
"""

    def truth(t):
        root = np.maximum(np.sqrt(full) - 0.5 * k * t, 0.0)
        inner = np.minimum(t, empty)  # g' + leak g = k (r0 - k t/2) until it is empty, then it decays
        slope, begin = -0.5 * k**2 / leak, k * np.sqrt(full) / leak + 0.5 * k**2 / leak**2
        g = begin + slope * inner - begin * np.exp(-leak * inner)
        return {"h": root**2, "g": g * np.exp(-leak * (t - inner))}

    return text, ("lagrangian",), truth


def offset(random):
    """A small oscillation at a place far away, of which the difference is traced."""
    far, swing, w = power(random, 6, 14), power(random, -3, 0), power(random, -1, 1)
    damped = power(random, -2, 0)
    text = f"""model m {{
  coord x: translation = {far!r} m + {swing!r} m
  let d = x - {far!r} m
  energy T* = 1/2*(1 kg)*x'^2
  energy V = 1/2*({w * w!r} N/m)*(x - {far!r} m)^2
  content D = 1/2*({2.0 * damped * w!r} N.s/m)*x'^2
  init x' = 0 m/s
}}
scene s of m {{ time 0 s to {float(f"{10.0 / w:.5g}")!r} s; trace d; accuracy @ on d relative to range }}
"""

    def truth(t):
        begin = (far + swing) - far
        v = np.sqrt(complex(1.0 - damped**2)) * w
        return {"d": (begin * np.exp(-damped * w * t) * (np.cos(v * t) + damped * w / v * np.sin(v * t))).real}

    return text, ("lagrangian", "hamiltonian"), truth


def span(random):
    """Decays of 1 s to 1e6 s beside spans up to 1e12 s, and one event shortly before the end."""
    end = power(random, 6, 12)
    tau, period = power(random, 0, 6), end / random.uniform(1.0, 4.0)
    w, late = float(f"{2.0 * np.pi / period:.8g}"), float(f"{end - power(random, 1, 5):.14g}")
    text = f"""model m {{
  discrete n = 0
  state y = 0
  dynamic y' = (sin({w!r} rad/s*t) - y)/({tau!r} s)
  when t >= {late!r} s {{ n := n + 1 }}
}}
scene s of m {{ time 0 s to {end!r} s; trace y, n }}
"""

    def truth(t):
        a, b = 1.0 / (1.0 + (w * tau) ** 2), w * tau / (1.0 + (w * tau) ** 2)
        return {"y": a * np.sin(w * t) - b * np.cos(w * t) + b * np.exp(-t / tau), "n": (t >= late).astype(float)}

    return text, ("lagrangian",), truth


def relaxation(random):
    """Van der Pol's oscillator, stiff or not."""
    mu, end = power(random, -1, 2), power(random, 0.5, 1.7)
    text = f"""model m {{
  state x = 2
  state v = 0
  dynamic x' = v*(1 Hz)
  dynamic v' = ({mu!r}*(1 - x^2)*v - x)*(1 Hz)
}}
scene s of m {{ time 0 s to {end!r} s; trace x }}
"""

    def truth(t):
        return {"x": integrated(lambda _, y: [y[1], mu * (1.0 - y[0] ** 2) * y[1] - y[0]], [2.0, 0.0], t)[0]}

    return text, ("lagrangian",), truth


SORTS = (across_a_source, rectifier, inverse, crank, timer, tank, offset, span, relaxation)


def case(seed):
    """Sort, text, formulation, method, accuracy and truth of a seed."""
    random = np.random.default_rng([seed, 86])
    sort = SORTS[seed % len(SORTS)]
    text, formulations, truth = sort(random)
    method, accuracy = str(random.choice(METHODS)), power(random, -8, -2)
    return sort.__name__, text, str(random.choice(formulations)), method, accuracy, truth


def off(text, formulation, method, accuracy, truth, folder):
    """(the worst error over accuracy * largest value, quantity) of a run that is met; or the reason of a refusal."""
    path = folder / "m.sd"
    path.write_text(text.replace("@", repr(accuracy)))
    options = {"formulation": formulation, "method": method, "accuracy": accuracy, "max_wall": LIMIT}
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            trace = api.simulate(path, output=folder / "m.h5", **options)
    except (api.SolverFailure, api.NotMet, api.ModelError, api.UsageError) as error:
        return None, f"{type(error).__name__}: {error}".splitlines()[0]
    once = np.unique(trace.time, return_index=True)[1]  # the first of two rows at a jump is that of before
    grid = trace.time[once]
    worst = 0.0, ""
    for name, exact in truth(grid).items():
        values = trace[name].values[once]
        error = np.abs(values - exact)
        if name in ("n", "y"):  # at an instant of an event itself either side counts
            jumps = np.flatnonzero(np.diff(trace.time) == 0.0)
            error[np.isin(grid, trace.time[jumps])] = 0.0
        size = np.abs(exact).max() if name != "d" else np.ptp(exact)
        worst = max(worst, (float(error.max() / (accuracy * max(size, 1e-300))), name))
    return worst


def main():
    """What is met and off, what is refused, and a table."""
    number, first = int(sys.argv[1]), int(sys.argv[2]) if len(sys.argv) > 2 else 0
    table, slow = Counter(), []
    with tempfile.TemporaryDirectory() as folder:
        for seed in range(first, first + number):
            sort, text, formulation, method, accuracy, truth = case(seed)
            began = time.process_time()
            ratio, what = off(text, formulation, method, accuracy, truth, Path(folder))
            slow.append((time.process_time() - began, seed))
            verdict = "refused" if ratio is None else "OFF" if ratio > TIMES else "right"
            table[sort, verdict] += 1
            if verdict != "right":
                said = what if ratio is None else f"{what} {ratio:.3g} times"
                print(f"{verdict} {seed} {sort} {formulation} {method} {accuracy:.1e}: {said}", flush=True)
    for (sort, verdict), count in sorted(table.items()):
        print(f"{sort:18s} {verdict:8s} {count}")
    print("slowest (CPU s, seed):", sorted(slow)[-3:])


if __name__ == "__main__":
    main()
