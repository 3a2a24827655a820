"""Circuits of ideal diodes by ours, Siconos and ngspice in one run: python tests/bench/event_race.py

bridge: a coil and a capacitor in parallel ring through a bridge of four diodes into a resistor (Siconos' example);
the resistor sees the magnitude of the voltage, so the ringing is that of a linear circuit.  rectifier: a sine behind a
diode into a capacitor and a resistor; it follows the sine until the current turns, then discharges.  Error: against
these closed forms, the largest at 200 instants over the largest value.  CPU: ours `cpu_integrate_s` of `--accuracy`
(all runs of the control); Siconos the time stepping alone; ngspice its process less that of an empty deck.  Printed:
every run, then the least CPU at which each meets an error.  A peer that is not installed is said to be missing.

Then what an event costs: events of one kind, and little between them, with the core's transitions and impacts and with
the handler asked for every one; CPU of all runs of the control over the events of the trace.
"""

from __future__ import annotations

import json
import math
import re
import resource
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np
from sysdyn.api import simulate
from sysdyn.runtime.integrate.jumps import pieces

SAMPLES = 200
WANTED = (1e-2, 1e-3, 1e-4, 1e-5, 1e-6, 1e-8)
HEAD = """from std.electrical import resistor, inductor, capacitor, voltage
component ideal_diode {
  branch: electrical
  psi one_way: f >= 0 A
}
"""
TEXT = {
    "bridge": HEAD
    + """model m {
  node a, p, n: electrical
  C: capacitor(C = 1 uF) a -> ground
  L: inductor(L = 10 mH) a -> ground
  D1: ideal_diode() a -> p
  D2: ideal_diode() ground -> p
  D3: ideal_diode() n -> a
  D4: ideal_diode() n -> ground
  R: resistor(R = 1 kohm) p -> n
  init C.e = 10 V
  init L.f = 0 A
}
scene s of m { time 0 s to 5 ms; trace C.e as v every 25 us }
""",
    "rectifier": HEAD
    + """model m {
  node s, a: electrical
  V: voltage(v = 10 V*sin(2*pi*(50 Hz)*t)) s -> ground
  D: ideal_diode() s -> a
  C: capacitor(C = 1 mF) a -> ground
  R: resistor(R = 50 ohm) a -> ground
  init C.e = 1 V
}
scene s of m { time 0 s to 0.1 s; trace C.e as v every 0.5 ms }
""",
}
DECK = {
    "bridge": """C1 a 0 1u IC=10
L1 a 0 10m IC=0
D1 a p DM
D2 0 p DM
D3 n a DM
D4 n 0 DM
R1 p n 1k
""",
    "rectifier": """V1 s 0 SIN(0 10 50)
D1 s a DM
C1 a 0 1m IC=1
R1 a 0 50
""",
}
SPAN = {"bridge": 5e-3, "rectifier": 0.1}
PLAIN = {
    "assignments": """model m {
  state x = 0
  discrete u = 1
  discrete n = 0
  dynamic x' = u/(1 s)
  when x >= 0.01 { u := -1; n := n + 1 }
  when x <= -0.01 { u := 1; n := n + 1 }
}
scene s of m { time 0 s to SPAN s; trace x every 0.37 s }
""",
    "samples": """model m {
  state x = 0
  discrete u = 0
  discrete i = 0
  dynamic x' = (u - x)/(0.1 s)
  every 20 ms { i := i + 0.02*(1 - x); u := 2*(1 - x) + i }
}
scene s of m { time 0 s to SPAN s; trace x every 0.37 s }
""",
    "flows": """model m {
  coord x: translation = 0 m
  energy T* = 1/2*(1 g)*x'^2
  when x >= 1 cm { x' := -x' }
  when x <= -1 cm { x' := -x' }
  init x' = 1 m/s
}
scene s of m { time 0 s to SPAN s; trace x every 0.37 s }
""",
    "impacts": """model m {
  coord x: translation = 0 m
  energy T* = 1/2*(1 g)*x'^2
  phi right: x <= 1 cm restitution 1
  phi left: x >= -1 cm restitution 1
  init x' = 1 m/s
}
scene s of m { time 0 s to SPAN s; trace x every 0.37 s }
""",
}
"""An event every 20 ms."""
EVENTS = {True: 10_000, False: 1000}
"""By the core, by the handler."""
AGAIN = 3
"""Runs of which the fastest counts."""


def bridge(t: np.ndarray) -> np.ndarray:
    """C v' = -(i + v/R), L i' = v from 10 V."""
    rate, w = 500.0, math.sqrt(1e8 - 500.0**2)
    return 10.0 * np.exp(-rate * t) * (np.cos(w * t) - rate / w * np.sin(w * t))


def rectifier(t: np.ndarray) -> np.ndarray:
    """The sine, or the discharge since the current turned."""
    w, tau = 100.0 * math.pi, 0.05
    turns = math.pi - math.atan(w * tau)

    def one(s: float) -> float:
        wave, k = 10.0 * math.sin(w * s), math.floor((w * s - turns) / (2.0 * math.pi))
        if k < 0:
            return max(wave, math.exp(-s / tau))
        since = s - (turns + 2.0 * math.pi * k) / w
        alone = 10.0 * math.sin(turns) * math.exp(-since / tau)
        return max(alone, wave if since > 0.005 else alone)

    return np.array([one(float(s)) for s in t])


EXACT = {"bridge": bridge, "rectifier": rectifier}


def error(name: str, values: np.ndarray) -> float:
    """Of values at 1/200, 2/200, ... of the span."""
    wanted = EXACT[name](SPAN[name] * np.arange(1, SAMPLES + 1) / SAMPLES)
    return float(np.abs(values - wanted).max() / 10.0) if values.shape == wanted.shape else math.inf


def ours(name: str, accuracy: float) -> tuple[float, float]:
    """CPU seconds, error."""
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "m.sd"
        file.write_text(TEXT[name])
        cpu, values = math.inf, np.zeros(0)
        for _ in range(AGAIN):
            trace = simulate(file, scene="s", accuracy=accuracy, output=Path(folder) / "t.h5", unmet="warn")
            cpu = min(cpu, float(trace.timings["cpu_integrate_s"]))
            grid = SPAN[name] * np.arange(1, SAMPLES + 1) / SAMPLES
            at = [int(np.abs(trace.time - s).argmin()) for s in grid]
            values = trace["v"].values[at]
    return cpu, error(name, values)


def siconos(name: str, steps: int) -> tuple[float, float] | None:
    """The same; None where it is missing or fails."""
    script = Path(__file__).parent / "peers" / "siconos_circuits.py"
    best: tuple[float, float] | None = None
    for _ in range(AGAIN):
        line = ["/usr/bin/python3", str(script), name, str(steps)]
        done = subprocess.run(line, capture_output=True, text=True, timeout=600, check=False)
        if done.returncode != 0:
            return None
        said = json.loads(done.stdout.splitlines()[-1])
        found = float(said["cpu"]), error(name, np.array(said["values"]))
        best = found if best is None or found[0] < best[0] else best
    return best


def ngspice(name: str, reltol: float, emission: float, share: float) -> tuple[float, float] | None:
    """The same; steps of at most `share` of the span, diodes of this emission coefficient."""
    end = SPAN[name]
    tail = f"""
.model DM D(Is=1e-12 N={emission})
.options reltol={reltol} abstol=1e-12 vntol=1e-9 method=gear maxord=3
.tran {end / SAMPLES!r} {end!r} 0 {end * share!r} uic
.control
run
linearize v(a)
print v(a)
quit
.endc
.end
"""
    best = found = math.inf
    for _ in range(AGAIN):
        cpu, text = _deck(f"{name}\n{DECK[name]}{tail}")
        rows = re.findall(r"^\d+\s+(\S+)\s*$", text, flags=re.MULTILINE)
        if len(rows) <= SAMPLES:
            return None
        found = error(name, np.array([float(x) for x in rows[1 : SAMPLES + 1]]))
        best = min(best, cpu)
    empty = min(_deck("none\nR1 a 0 1\n.end\n")[0] for _ in range(AGAIN))
    return max(best - empty, 1e-4), found


def _deck(text: str) -> tuple[float, str]:
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "m.cir"
        file.write_text(text)
        before = resource.getrusage(resource.RUSAGE_CHILDREN)
        done = subprocess.run(["ngspice", "-b", str(file)], capture_output=True, text=True, timeout=600, check=False)
        after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime, done.stdout


def runs(name: str) -> list[tuple[str, str, float, float]]:
    """(who, setting, CPU, error) of every run."""
    found = [("ours", f"--accuracy 1e-{k}", *ours(name, 10.0**-k)) for k in range(2, 10)]
    for steps in (200, 1000, 4000, 20_000, 100_000):
        one = siconos(name, steps)
        if one is not None:
            found.append(("siconos", f"{steps} steps", *one))
    for reltol, emission, share in ((1e-3, 0.1, 0.01), (1e-4, 0.01, 0.002), (1e-5, 1e-3, 5e-4), (1e-6, 1e-3, 1e-4)):
        peer = ngspice(name, reltol, emission, share) if shutil.which("ngspice") else None
        if peer is not None:
            found.append(("ngspice", f"reltol {reltol:g}, N {emission:g}, steps of {share:g}", *peer))
    return found


def an_event(name: str, *, core: bool) -> float:
    """CPU seconds an event."""
    serves, known = pieces.serves, EVENTS[core]
    pieces.serves = serves if core else lambda *_: False
    try:
        with tempfile.TemporaryDirectory() as folder:
            file = Path(folder) / "m.sd"
            file.write_text(PLAIN[name].replace("SPAN", f"{0.02 * known:g}"))
            trace = simulate(file, scene="s", output=Path(folder) / "t.h5")
        return float(trace.timings["cpu_integrate_s"]) / len(trace.events)
    finally:
        pieces.serves = serves


def main() -> int:
    """Runs and prints."""
    for name in PLAIN:
        core, handler = an_event(name, core=True), an_event(name, core=False)
        said = f"{1e6 * core:7.1f} us an event, by the handler {1e6 * handler:7.0f}"
        print(f"{name:12} {said}: {handler / core:.0f} times")
    for name in TEXT:
        found = runs(name)
        print(f"{name}")
        for who, setting, cpu, off in found:
            print(f"  {who:8} {setting:36} {1e3 * cpu:9.2f} ms  error {off:.1e}")
        missing = [f"({who} is missing)" for who in ("siconos", "ngspice") if who not in {f[0] for f in found}]
        print(f"  least CPU in ms at an error of {', '.join(f'{w:g}' for w in WANTED)}:", *missing)
        for who in ("ours", "siconos", "ngspice"):
            own = [f for f in found if f[0] == who]
            least = [min((1e3 * f[2] for f in own if f[3] <= w), default=math.inf) for w in WANTED]
            print(f"  {who:8}", *(f"{x:9.2f}" if x < math.inf else "        -" for x in least))
    return 0


if __name__ == "__main__":
    sys.exit(main())
