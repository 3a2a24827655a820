"""Full bridges in series, each on a source that nothing but its diodes ties to the rest, and their voltages by other
equations: two diodes carry the current of a bridge, ln(1 + i / Is) is its unknown.
"""

import numpy as np
from scipy.integrate import solve_ivp

IS, VT, RS, LEAK, LOAD, FREQ = 1e-12, 0.02585, 2.0, 100.0, 1000.0, 50.0
BRIDGE = """  V{k}: voltage(v = {a} V*sin(2*pi*{f} Hz*t + {phase})) s{k} -> b{k}
  R{k}: resistor(R = {rs} ohm) s{k} -> a{k}
  D1_{k}: diode(Is = {i_s} A, vT = {vt} V) a{k} -> p{k}
  D2_{k}: diode(Is = {i_s} A, vT = {vt} V) b{k} -> p{k}
  D3_{k}: diode(Is = {i_s} A, vT = {vt} V) m{k} -> a{k}
  D4_{k}: diode(Is = {i_s} A, vT = {vt} V) m{k} -> b{k}
  C{k}: capacitor(C = {c} F) p{k} -> m{k}
  T{k}: resistor(R = {leak} ohm) m{k} -> {before}
  init C{k}.e = 0 V
"""


def values(number):
    """Amplitudes [V], phases and capacities [F] of the bridges."""
    k = np.arange(number)
    return 50.0 + 3.0 * k, np.round(0.1 * k, 1), 1e-6 * np.round(100.0 + 10.0 * k)


def text(number, end, every, accuracy):
    """The model: the load's voltage as v, that of the first capacitor as w."""
    nodes = ", ".join(f"s{k}, a{k}, b{k}, p{k}, m{k}" for k in range(number))
    fixed = {"f": FREQ, "rs": RS, "i_s": IS, "vt": VT, "leak": LEAK}
    bridges = "".join(
        BRIDGE.format(k=k, a=a, phase=phase, c=c, before=f"p{k - 1}" if k else "ground", **fixed)
        for k, (a, phase, c) in enumerate(zip(*values(number), strict=True))
    )
    return f"""from std.electrical import diode, voltage, capacitor, resistor
model bridges {{
  node {nodes}: electrical
{bridges}  load: resistor(R = {LOAD} ohm) p{number - 1} -> ground
}}
scene run of bridges {{
  time 0 s to {end} s
  trace load.e as v, C0.e as w every {every} s
  accuracy {accuracy}
}}
"""


def through(drive, held):
    """Current [A] of a bridge at the sizes of its source's voltage and of its capacitor's [V]."""
    beyond = drive - held
    x = np.where(beyond > 0.0, np.log1p(np.maximum(beyond, 1e-9) / RS / IS), beyond / (2.0 * VT))
    x = np.where(beyond > 0.0, np.minimum(x, beyond / (2.0 * VT)), x)
    for _ in range(60):
        missing = RS * IS * np.expm1(x) + 2.0 * VT * x - beyond
        x = x - missing / (RS * IS * np.exp(x) + 2.0 * VT)
    return IS * np.expm1(x)


def reference(number, time):
    """v, w [V] at instants [s]."""
    amplitude, phase, capacity = values(number)
    around = LEAK * number + LOAD

    def rate(t, v):
        drive = np.abs(amplitude * np.sin(2.0 * np.pi * FREQ * t + phase))
        return (through(drive, v) - v.sum() / around) / capacity

    options = {"method": "Radau", "rtol": 1e-9, "atol": 1e-11, "max_step": 2e-4}
    found = solve_ivp(rate, (0.0, time[-1]), np.zeros(number), t_eval=time, **options)
    return {"v": found.y.sum(axis=0) * LOAD / around, "w": found.y[0]}
