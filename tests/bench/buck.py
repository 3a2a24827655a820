"""A buck converter with feedback against its exact solution, and against ngspice: python tests/bench/buck.py [SWITCHES]

A source of 12 V is switched each 10 us and cut off where a ramp meets the amplified error of the output; an ideal diode
carries the coil's current in between.  Between switches the circuit is linear, so that its exact motion is a matrix
exponential, and each instant of cutting off the root of a known function (bisection and Newton to round-off).  Printed:
the largest error of a duty ratio, of the state at the end, CPU seconds, seconds an event, and the cost of an event
relative to a smooth step of the same model; then ngspice (if it is installed) on the same circuit with a switch and a
diode of small resistances at two settings of its tolerances.
"""

from __future__ import annotations

import argparse
import math
import re
import resource
import shutil
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np
from sysdyn.api import simulate

PERIOD, E, L, C, R, GAIN, WANTED = 1e-5, 12.0, 1e-4, 1e-5, 5.0, 0.2, 5.0
BEGIN = 0.95, 4.7
TEXT = f"""
from std.electrical import switch, resistor, inductor, capacitor, voltage
component ideal_diode {{
  branch: electrical
  psi one_way: f >= 0 A
}}
model buck {{
  node in_, sw, out: electrical
  discrete on = false
  discrete began = 0 s
  Vs: voltage(v = {E} V) in_ -> ground
  S: switch() in_ -> sw, gate = (if on then 1 else 0)
  D: ideal_diode() ground -> sw
  L: inductor(L = {L} H) sw -> out
  C: capacitor(C = {C} F) out -> ground
  R: resistor(R = {R} ohm) out -> ground
  every {PERIOD} s {{
    on := true
    began := t
  }}
  when on and (t - began)/({PERIOD} s) >= 0.5 + {GAIN}*({WANTED} V - C.e)/(1 V) {{ on := false }}
  init L.f = {BEGIN[0]} A
  init C.e = {BEGIN[1]} V
}}
scene s of buck {{
  time 0 s to 1 s
  trace L.f, C.e every 1 s
  limit steps 1000000000
}}
"""
A = np.array([[0.0, -1.0 / L], [1.0 / C, -1.0 / (R * C)]])
ALPHA = 1.0 / (2.0 * R * C)
OMEGA = math.sqrt(1.0 / (L * C) - ALPHA**2)


def flow(t: float) -> np.ndarray:
    """exp(A t)."""
    inner = A + ALPHA * np.eye(2)
    return math.exp(-ALPHA * t) * (math.cos(OMEGA * t) * np.eye(2) + math.sin(OMEGA * t) / OMEGA * inner)


def exact(periods: int) -> tuple[np.ndarray, np.ndarray]:
    """Duty ratios [periods] and the state at the end."""
    x, rest = np.array(BEGIN), np.array([E / R, E])
    duties = np.empty(periods)
    for k in range(periods):

        def lacks(t: float, x: np.ndarray = x) -> float:
            v = (rest + flow(t) @ (x - rest))[1]
            return t / PERIOD - 0.5 - GAIN * (WANTED - v)

        low, high = 0.0, PERIOD
        for _ in range(80):
            middle = 0.5 * (low + high)
            low, high = (middle, high) if lacks(middle) < 0.0 else (low, middle)
        duties[k] = high / PERIOD
        x = rest + flow(high) @ (x - rest)
        x = flow(PERIOD - high) @ x
        assert x[0] > 0.0, "the coil runs dry: the exact solution has no such piece"
    return duties, x


def ours(periods: int, **options: object) -> tuple[np.ndarray, np.ndarray, float, float, int]:
    """Duty ratios, the last state, CPU seconds of the integration, of the whole call; steps."""
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "buck.sd"
        file.write_text(TEXT)
        began = time.process_time()
        trace = simulate(file, scene="s", until=f"{periods * PERIOD!r} s", output=Path(folder) / "t.h5", **options)
        whole = time.process_time() - began
        off = np.array([e.time for e in trace.events if e.name.startswith("when on")])
        last = np.array([trace["L.f"][-1], trace["C.e"][-1]])
        cpu, steps = float(trace.timings["cpu_integrate_s"]), int(trace.statistics["steps"])
    number = min(off.size, periods)
    return off[:number] / PERIOD - np.arange(number), last, cpu, whole, steps


def smooth(seconds: float, **options: object) -> float:
    """CPU seconds a step of the same circuit that is always on."""
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "buck.sd"
        text = re.sub(r"  every .*?\}\n  when.*?\n", "", TEXT, flags=re.DOTALL).replace("on = false", "on = true")
        file.write_text(text)
        trace = simulate(file, scene="s", until=f"{seconds!r} s", output=Path(folder) / "t.h5", **options)
        return float(trace.timings["cpu_integrate_s"]) / int(trace.statistics["steps"])


def ngspice(periods: int, reltol: float, share: float) -> tuple[float, np.ndarray] | None:
    """CPU seconds and the last state; None where it is not installed or ends otherwise."""
    if shutil.which("ngspice") is None:
        return None
    end = periods * PERIOD
    deck = f"""buck
V1 in 0 {E}
Vr ramp 0 PULSE(0 1 0 {PERIOD * (1 - 2e-6):.12g} {PERIOD * 1e-6:.12g} 1e-15 {PERIOD})
Bc ctl 0 V = (0.5 + {GAIN}*({WANTED} - V(out))) > V(ramp) ? 1 : 0
S1 in sw ctl 0 SM
.model SM SW(Ron=1e-4 Roff=1e7 Vt=0.5 Vh=0)
D1 0 sw DM
.model DM D(Is=1e-9 N=0.01)
L1 sw out {L} IC={BEGIN[0]}
C1 out 0 {C} IC={BEGIN[1]}
R1 out 0 {R}
.options reltol={reltol} abstol=1e-9 vntol=1e-9
.tran {PERIOD * share:.12g} {end:.12g} {end - PERIOD * share:.12g} {PERIOD * share:.12g} uic
.control
run
print i(l1)[length(i(l1))-1] v(out)[length(v(out))-1]
quit
.endc
.end
"""
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "buck.cir"
        file.write_text(deck)
        before = resource.getrusage(resource.RUSAGE_CHILDREN)
        try:
            line = ["ngspice", "-b", str(file)]
            done = subprocess.run(line, capture_output=True, text=True, timeout=600, check=False)
        except subprocess.TimeoutExpired:
            return None
        after = resource.getrusage(resource.RUSAGE_CHILDREN)
    found = re.findall(r"\]\s*=\s*([-+0-9.eE]+)", done.stdout)
    cpu = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    return (cpu, np.array([float(x) for x in found[:2]])) if len(found) >= 2 else None


def main() -> int:
    """Runs and prints; 1 where a duty ratio is off by 1e-9 or more."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("switches", nargs="?", type=int, default=2000)
    given = parser.parse_args()
    periods = given.switches // 2
    duties, last = exact(periods)
    ok = True
    for method, rtol in (("radau", 1e-8), ("radau", 1e-10), ("bdf", 1e-10)):
        found, state, cpu, whole, steps = ours(periods, method=method, rtol=rtol)
        off = float(np.abs(found - duties[: found.size]).max()) if found.size == periods else math.inf
        error = float(np.abs(state / last - 1.0).max())
        each = cpu / (2 * periods)
        line = f"{method} rtol {rtol:g}: duty ratio off by {off:.2e}, last state by {error:.2e}"
        step = smooth(2e-3, method=method, rtol=rtol)
        work = (cpu - steps * step) / (2 * periods)
        print(f"{line}; {cpu:.2f} s CPU ({whole:.2f} s the call), {steps} steps, {1e6 * each:.0f} us a switch;")
        said = f"  a smooth step {1e6 * step:.1f} us, an event {1e6 * work:.0f} us = {work / step:.0f} steps"
        print(said, flush=True)
        ok = ok and (off < 1e-9 or rtol > 1e-9)
    for reltol, share in ((1e-3, 0.02), (1e-5, 0.002)):
        peer = ngspice(periods, reltol, share)
        if peer is not None:
            error = float(np.abs(peer[1] / last - 1.0).max())
            said = f"ngspice reltol {reltol:g}, steps of at most {share:g} periods"
            print(f"{said}: last state off by {error:.2e}; {peer[0]:.2f} s CPU")
    return int(not ok)


if __name__ == "__main__":
    sys.exit(main())
