"""Circuits of ideal diodes by Siconos (Moreau's time stepping, Lemke): /usr/bin/python3 siconos_circuits.py NAME STEPS

Prints as JSON: CPU seconds of the time stepping, and the first state at 1/200, 2/200, ... of the span.  The
complementarity systems are x' = A x + B l, y = C x + D l, 0 <= y, l >= 0, y l = 0 (Acary and Brogliato 2008).
"""

import json
import sys
import time

import numpy as np
from siconos.kernel import (
    LCP,
    ComplementarityConditionNSL,
    EulerMoreauOSI,
    FirstOrderLinearDS,
    FirstOrderLinearTIR,
    Interaction,
    NonSmoothDynamicalSystem,
    TimeDiscretisation,
    TimeStepping,
)

SAMPLES = 200


def bridge():
    """Coil and capacitor in parallel, a bridge of four diodes, a resistor behind it: (span, x0, A, B, C, D)."""
    c, coil, r = 1e-6, 1e-2, 1e3
    g = 1.0 / r
    a = [[0.0, -1.0 / c], [1.0 / coil, 0.0]]
    b = [[0.0, 0.0, -1.0 / c, 1.0 / c], [0.0] * 4]
    e = [[0.0, 0.0], [0.0, 0.0], [-1.0, 0.0], [1.0, 0.0]]
    d = [[g, g, -1.0, 0.0], [g, g, 0.0, -1.0], [1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0]]
    return 5e-3, [10.0, 0.0], a, b, e, d


def rectifier():
    """A source of 10 V at 50 Hz (two states), a diode, 1 mF and 50 ohm."""
    w, c, r = 100.0 * np.pi, 1e-3, 50.0
    a = [[-1.0 / (r * c), 0.0, 0.0], [0.0, 0.0, w], [0.0, -w, 0.0]]
    return 0.1, [1.0, 0.0, 10.0], a, [[1.0 / c], [0.0], [0.0]], [[1.0, -1.0, 0.0]], [[0.0]]


def main():
    """Runs and prints."""
    span, x0, a, b, e, d = {"bridge": bridge, "rectifier": rectifier}[sys.argv[1]]()
    steps = int(sys.argv[2])
    system = FirstOrderLinearDS(np.array(x0), np.array(a))
    relation = FirstOrderLinearTIR(np.array(e), np.array(b))
    relation.setDPtr(np.array(d))
    model = NonSmoothDynamicalSystem(0.0, span)
    model.insertDynamicalSystem(system)
    model.link(Interaction(ComplementarityConditionNSL(len(d)), relation), system)
    stepping = TimeStepping(model, TimeDiscretisation(0.0, span / steps), EulerMoreauOSI(0.5), LCP())
    every, found = steps // SAMPLES, []
    began = time.process_time()
    for k in range(steps):
        stepping.computeOneStep()
        if (k + 1) % every == 0:
            found.append(float(system.x()[0]))
        stepping.nextStep()
    print(json.dumps({"cpu": time.process_time() - began, "values": found}))


if __name__ == "__main__":
    main()
