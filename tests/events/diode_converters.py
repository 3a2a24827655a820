"""Converters whose switch opens on a coil: three topologies, three loads, an exponential or an ideal diode.

    python tests/events/diode_converters.py [--formulation F]    the table: met, refused, wrong; error beside SciPy

The coil's current and the capacitor's voltage are the whole state; between the switch's instants SciPy integrates

    buck       L i' = v_x - v_C,   C v_C' = i - load          v_x = Vs closed, -v_D(i) open
    boost      L i' = Vs - v_x,    C v_C' = i_D - load        v_x = 0 closed,  v_C + v_D(i) open, i_D = i open
    inverting  L i' = v_x,         C v_C' = -i_D - load       v_x = Vs closed, v_C - v_D(i) open, i_D = i open

with v_D(i) = vT ln(1 + i/Is), the inverse of the exponential law, which bears whatever current the coil has.  An ideal
diode has v_D = 0.  Behind i = 0 the diode blocks, with -Is (1e-7 of the current) or 0: the coil's current stays.
"""

import argparse
import itertools
import sys
import tempfile
from pathlib import Path

import numpy as np
from scipy.integrate import solve_ivp

VS, L, C = 12.0, 47e-6, 4.7e-6
IS, VT = 20e-9, 45e-3
END = 40e-6
I0 = 0.3
TOPOLOGIES = {
    "buck": ("S: switch(gate = on) i -> x", "D: {diode} ground -> x", "L: inductor(L = 47 uH) x -> o", 4.0),
    "boost": ("S: switch(gate = on) x -> ground", "D: {diode} x -> o", "L: inductor(L = 47 uH) i -> x", 15.0),
    "inverting": ("S: switch(gate = on) i -> x", "D: {diode} o -> x", "L: inductor(L = 47 uH) x -> ground", -8.0),
}
LOADS = {"10 ohm": "R: resistor(R = 10 ohm) o -> ground", "100 ohm": "R: resistor(R = 100 ohm) o -> ground"}
LOADS["coil"] = "R: resistor(R = 10 ohm) o -> r; M: inductor(L = 100 uH) r -> ground; init M.f = 0.2 A"
DIODES = {"exponential": "diode(Is = 20 nA, vT = 45 mV)", "ideal": "diode.complementary()"}
OPENINGS = (1e-6, 7.3e-6, 20e-6)
FORMS = ("lagrangian", "hamiltonian", "co_lagrangian", "co_hamiltonian")


def text(topology, load, diode, opening):
    """The model: closed until `opening` (s), and again in the last quarter."""
    *parts, vc = TOPOLOGIES[topology]
    lines = [part.format(diode=DIODES[diode]) for part in parts] + LOADS[load].split("; ")
    nodes = "i, x, o" + (", r" if load == "coil" else "")
    return f"""from std.electrical import capacitor, diode, inductor, resistor, switch, voltage
model converter {{
  node {nodes}: electrical
  let on = if t < {opening!r} s then 1 else if t < {0.75 * END!r} s then 0 else 1
  V: voltage(v = {VS} V) i -> ground
  {chr(10).join("  " + line for line in lines).strip()}
  C: capacitor(C = 4.7 uF) o -> ground
  init L.f = {I0} A
  init C.e = {vc} V
}}
scene s of converter {{
  time 0 s to {END!r} s
  trace L.f, C.e every 0.2 us
}}
"""


def reference(topology, load, diode, opening, times):
    """L.f (A) and C.e (V) at times (s), each instant of the switch told from both sides by the caller."""
    vc = TOPOLOGIES[topology][3]
    state = np.array([I0, vc, 0.2])

    def drop(i):
        return VT * np.log1p(max(i, 0.0) / IS) if diode == "exponential" else 0.0

    def rates(closed, blocked):
        def rate(_, y):
            i, v, m = y
            drawn = m if load == "coil" else v / (10.0 if load == "10 ohm" else 100.0)
            dm = (v - 10.0 * m) / 100e-6 if load == "coil" else 0.0
            back = IS if diode == "exponential" else 0.0  # the current of the diode that blocks
            if topology == "buck":
                di, into = (VS if closed else -drop(i)) - v, i
            elif topology == "boost":
                di, into = VS - (0.0 if closed else v + drop(i)), -back if closed else i
            else:
                di, into = VS if closed else v - drop(i), back if closed else -i
            if blocked:
                di, into = 0.0, 0.0
            return [di / L, (into - drawn) / C, dm]

        return rate

    turns = {"buck": lambda _, y: y[1], "boost": lambda _, y: y[1] - VS, "inverting": lambda _, y: -y[1]}
    found = np.zeros((2, times.size))
    for begin, end, closed in ((0.0, opening, True), (opening, 0.75 * END, False), (0.75 * END, END, True)):
        at, blocked = begin, False
        while at < end:
            ends = () if closed else (turns[topology] if blocked else lambda _, y: y[0],)
            for turn in ends:
                turn.terminal, turn.direction = True, -1
            way = solve_ivp(
                rates(closed, blocked), (at, end), state, "Radau", dense_output=True, rtol=1e-9, atol=1e-13, events=ends
            )
            here = (times > at) & (times <= way.t[-1]) if at > 0.0 else times <= way.t[-1]
            found[:, here] = way.sol(times[here])[:2]
            at, state = way.t[-1], way.y[:, -1]
            if at < end:
                blocked, state = not blocked, state * [0.0, 1.0, 1.0]
    return found


def error(trace, topology, load, diode, opening):
    """Largest error of the coil's current and the capacitor's voltage, each of its largest value."""
    times = np.asarray(trace.time)
    right = reference(topology, load, diode, opening, times)
    rows = (np.asarray(trace[name]) for name in ("L.f", "C.e"))
    return max(np.abs(row - wanted).max() / np.abs(wanted).max() for row, wanted in zip(rows, right, strict=True))


def cases():
    """Topology, load, diode, instant of opening (s)."""
    return itertools.product(TOPOLOGIES, LOADS, DIODES, OPENINGS)


def main():
    sys.path.insert(0, str(Path(__file__).parents[1] / "extremes"))
    from running import ran

    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--formulation", action="append", choices=FORMS)
    parser.add_argument("--accuracy", type=float, default=1e-5)
    asked = parser.parse_args()
    for formulation in asked.formulation or FORMS:
        met, refused, wrong = 0, [], []
        for case in cases():
            with tempfile.TemporaryDirectory() as folder:
                run = ran(Path(folder), text(*case), formulation=formulation, accuracy=asked.accuracy, max_wall="30")
                off = np.inf if run.refused else error(run.trace, *case)
            if run.refused or not run.met:
                refused.append((*case, run.refused[:90] or "not met"))
            elif off <= 1e-4:
                met += 1
            else:
                wrong.append((*case, f"{off:.1e}"))
        print(f"{formulation}: {met} right, {len(refused)} refused, {len(wrong)} wrong", flush=True)
        for name, items in (("refused", refused), ("wrong", wrong)):
            for item in items:
                print("  ", name, *item)
    return 0


if __name__ == "__main__":
    sys.exit(main())
