"""What an event of a large model costs: python tests/bench/many_events.py [--sizes 30,100,300] [NAME...]

Of a bank of n thermostats, of n balls that bounce, of n carts in a row that collide: events of the run, CPU of its
integration (`cpu_integrate_s`, both runs) and of an event (ms).  Events grow as n; what is watched does too, so that an
event that asks all of it in Python costs as n again.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
from pathlib import Path

from sysdyn.api import simulate

TEXTS = {
    "thermostats": """
model m {
  param n = 10
  param P = 2 kW
  for i in 1..n {
    state T[i]: K = 15 K + 3 K*i/n
    discrete heating[i] = true
    dynamic T[i]' = (50 W/K*(5 K - T[i]) + (if heating[i] then P else 0 W))/(100 kJ/K)
    when T[i] >= 21 K { heating[i] := false }
    when T[i] <= 19 K { heating[i] := true }
  }
}
scene s of m {
  time 0 s to 1500 s
  trace T[1] as first, T[n] as last
}
""",
    "balls": """
model m {
  param n = 10
  coord h[1..n]: translation
  for i in 1..n {
    energy T* = 1/2*1 kg*h[i]'^2
    energy V = 1 kg*9.81 m/s^2*h[i]
    phi floor[i]: h[i] >= 0 m restitution 0.5
    init h[i] = 1 m + 1 m*i/n
    init h[i]' = 0 m/s
  }
}
scene s of m {
  time 0 s to 4 s
  trace h[1] as first, h[n] as last
}
""",
    "carts": """
model m {
  param n = 10
  coord x[1..n]: translation
  for i in 1..n {
    energy T* = 1/2*1 kg*x[i]'^2
    init x[i] = 20 cm*i
    init x[i]' = if i == 1 then 5 m/s else 0 m/s
  }
  for i in 1..n - 1 {
    phi touch[i]: x[i + 1] - x[i] >= 10 cm restitution 0.7
  }
}
scene s of m {
  time 0 s to 5 s
  trace x[1] as first, x[n] as last
}
""",
}


def main() -> None:
    """A line a model and size."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--sizes", default="30,100,300")
    parser.add_argument("names", nargs="*", default=list(TEXTS))
    asked = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        for name in asked.names:
            model = Path(folder) / f"{name}.sd"
            model.write_text(TEXTS[name])
            for n in map(int, asked.sizes.split(",")):
                run = simulate(model, set={"n": n}, output=Path(folder) / "t.h5")
                seconds, events = run.timings["cpu_integrate_s"], len(run.events)
                each = 1e3 * seconds / max(events, 1)
                print(f"{name} {n}: {events} events, {seconds:.2f} s, {each:.2f} ms an event", flush=True)


if __name__ == "__main__":
    sys.exit(main())
