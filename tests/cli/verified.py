"""Models and runs of `sysdyn verify`."""

import os

from schema import NUMBER

LONG = os.environ.get("SYSDYN_LONG") == "1"

FOUR = ["lagrangian", "hamiltonian", "co_lagrangian", "co_hamiltonian"]

GAP = {"variable": str, "time": NUMBER, "ratio": (*NUMBER, type(None)), "values": list}

CIRCUIT = """\
from std.electrical import resistor, capacitor, inductor, voltage

model ring {
  node a, b: electrical
  V1: voltage(v = 5 V*sin(40 rad/s*t)) a -> ground
  L1: inductor(L = 10 mH) a -> b
  C1: capacitor(C = 2 mF) b -> ground
  R1: resistor(R = 3 ohm) b -> ground
  init C1.e = 1 V
  init L1.f = 0 A
}

scene hum of ring {
  time 0 s to 0.1 s
  trace b.e as v, L1.f as i
}
"""


def names(result):
    """(formulation, method) of each run at the accuracy asked; the last is the reference's finer one."""
    return [(r["formulation"], r["method"]) for r in result["runs"][:-1]]


def both(*formulations):
    """Each formulation by both methods, bdf first."""
    return [(f, m) for f in formulations for m in ("bdf", "radau")]
