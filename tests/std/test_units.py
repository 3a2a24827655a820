"""One text in several coherent unit systems: the numbers of its trace stay the same."""

import numpy as np
import pytest
from runs import INSTANTS, network, traced

AGREES = 1e-9
"""Of each quantity's largest magnitude: what is left is the rounding of unit factors."""
DERIVED = """
unit speed = 1 length/time
unit force = 1 mass.length/time^2
unit energy = 1 force.length
unit power = 1 energy/time
unit pressure = 1 force/length^2
unit volume = 1 length^3
unit volt = 1 power/amp
"""
SYSTEMS = {
    "SI": ("1 m", "1 kg", "1 s", "1 A", "1 K"),
    "mm-t-s": ("1 mm", "1 t", "1 s", "1 mA", "1 K"),
    "cgs": ("1 cm", "1 g", "1 s", "10 A", "1 K"),
    "mm-kg-ms": ("1 mm", "1 kg", "1 ms", "1 uA", "1e-3 K"),
    "ft-lb-min": ("0.3048 m", "0.45359237 kg", "1 min", "3 A", "5/9*1 K"),
}
MODELS = {
    "translation": (
        """
  node x, y: translation
  A: mass(m = 2 mass) x
  K: spring(k = 30 force/length, l0 = 0.7 length) x -> ground
  D: damper(b = 0.8 force.time/length) x -> y
  B: mass(m = 0.5 mass) y
  P: force(F = 3 force*cos(4 rad/time*t)) ground -> y
  init x.q = 1.3 length
  init x.f = -2 speed
  init y.q = -1 length
  init y.f = 0 speed
""",
        "x.q in length, y.f in speed, D.e in force, K.V in energy, P.power in power",
    ),
    "plane": (
        """
  node c, w: planar
  phi x: w.x.q = 0.5 length
  phi y: w.y.q = 0 length
  phi th: w.th.q = 0.3 rad
  B: body2d(m = 1.7 mass, J = 0.2 mass.length^2, gravity = 9 length/time^2) cm = c
  H: revolute2d(ra = [0.4 length, 0.5 length], rb = [0.2 length, 0.1 length]) a = c, b = w
  init c.th.q = 2 rad
  init c.th.f = 1 rad/time
  init c.x.q ~ 1 length
""",
        "c.th.q in deg, c.x.q in length, c.y.f in speed, H.px.on(c.x.q) in force",
    ),
    "electrical": (
        """
  node a, b, c: electrical
  S: voltage(v = 3 volt*sin(5 rad/time*t)) a -> ground
  R1: resistor(R = 0.7 volt/amp) a -> b
  L1: inductor(L = 0.2 volt.time/amp) b -> c
  C1: capacitor(C = 0.4 amp.time/volt) c -> ground
  D: diode(Is = 0.01 amp, vT = 0.5 volt) c -> ground
  init C1.e = -1 volt
  init L1.f = 0.5 amp
""",
        "b.e in volt, c.e in volt, L1.f in amp, D.f in amp, C1.V in energy",
    ),
    "fluid": (
        """
  node a, b: hydraulic
  A: tank(A = 0.5 length^2, rho = 3 mass/length^3, gravity = 9 length/time^2) a = a
  L: pipe(I = 4 pressure.time^2/volume, R = 2 pressure.time/volume) a = a, b = b
  G: accumulator(V0 = 2 volume, p0 = 5 pressure) a = b
  V: valve(Cr = 6 pressure.time^2/length^6) b -> ground
  O: orifice(A = 0.1 length^2, rho = 3 mass/length^3, dp_lam = 2 pressure) b -> ground
  init A.store.q = 3 volume
  init L.inert.f = 0.1 volume/time
  init G.gas.q = 0.2 volume
""",
        "a.e in pressure, b.e in pressure, V.f in volume/time, O.f in volume/time, A.store.q in volume",
    ),
    "heat": (
        """
  node a, b, air: heat
  T: temperature(T = 290 kelvin) air -> ground
  A: capacity(C = 2 energy/kelvin) a -> ground
  B: capacity(C = 3 energy/kelvin) b -> ground
  G: conductance(G = 1.5 power/kelvin) a -> b
  R: resistance(R = 0.8 kelvin/power) b -> air
  Q: heat_flow(Q = 40 power*exp(-t/(1 time))) ground -> a
  init A.e = 350 kelvin
  init B.e = 280 kelvin
""",
        "a.e in kelvin, b.e in kelvin, R.f in power, A.q in energy",
    ),
    "drive": (
        """
  node a: electrical
  node s: rotation
  node x: translation
  S: voltage(v = ctl.u) a -> ground
  M: dc_motor(
    K = 0.6 volt.time/rad, R = 0.5 volt/amp, L = 0.05 volt.time/amp, J = 0.1 mass.length^2, b = 0.02 force.length.time
  ) p = a, n = ground, shaft = s
  R: rack(r = 0.3 length) inp = s, out = x
  A: mass(m = 2 mass) x
  meas: low_pass(tau = 0.05 time) u = x.q
  ctl: pid(
    kp = 20 volt/length, ki = 9 volt/length/time, kd = 3 volt.time/length, tau = 0.04 time,
    lo = -150 volt, hi = 150 volt
  ) r = 0.6 length, y = meas.y
  init x.q = 0 length
  init x.f = 0 speed
  init M.La.f = 0 amp
""",
        "x.q in length, s.f in rad/time, M.La.f in amp, ctl.u in volt",
    ),
}
SPAN = 3.0
SECONDS = {"1 s": 1.0, "1 ms": 1e-3, "1 min": 60.0}
FINE = 2e-10
"""Asked for: step sizes may differ from one system to another, so that traces agree as well as they are accurate."""


def text_in(system, model):
    names = ("length", "mass", "time", "amp", "kelvin")
    units = "".join(f"unit {name} = {value}\n" for name, value in zip(names, SYSTEMS[system], strict=True))
    body, traces = MODELS[model]
    return units + DERIVED + network(body, SPAN, traces, unit="time")


def values(folder, system, model):
    """Of each trace, in the units of the system."""
    return accepted(folder, text_in(system, model), SECONDS[SYSTEMS[system][2]])


def accepted(folder, text, second=1.0):
    found, report = traced(folder, text, SPAN * INSTANTS * second, accuracy=FINE)
    assert found is not None, [f"{d.code} {d.message}" for d in report]
    return found


def difference(found, wanted):
    """The largest, of each quantity's largest magnitude."""
    assert found.keys() == wanted.keys()
    return max(float(np.max(np.abs(found[name] - v)) / np.max(np.abs(v))) for name, v in wanted.items())


@pytest.fixture(scope="module", params=MODELS)
def model_in_si(request, tmp_path_factory):
    return request.param, values(tmp_path_factory.mktemp("si"), "SI", request.param)


@pytest.mark.parametrize("system", [s for s in SYSTEMS if s != "SI"])
@pytest.mark.long
def test_same_numbers_in_every_coherent_system(model_in_si, system, tmp_path, record_property):
    model, wanted = model_in_si
    error = difference(values(tmp_path, system, model), wanted)
    record_property("error", error)
    assert error <= AGREES


PREFIXED = {
    "translation": (
        """
  node x: translation
  M: mass(m = 2500 g) x
  K: spring(k = 90 mN/mm, l0 = 40 cm) x -> ground
  D: damper(b = 8 N.s/m) x -> ground
  P: force(F = 0.003 kN*sin(120 deg/s*t)) ground -> x
  init x.q = 700 mm
  init x.f = 4.32 km/h
""",
        """
  node x: translation
  M: mass(m = 2.5 kg) x
  K: spring(k = 90 N/m, l0 = 0.4 m) x -> ground
  D: damper(b = 8 kg/s) x -> ground
  P: force(F = 3 N*sin(2*pi/3*1 s^-1*t)) ground -> x
  init x.q = 0.7 m
  init x.f = 1.2 m/s
""",
        {"x.q in mm": 1e-3, "x.f in km/h": 1 / 3.6, "K.e in kN": 1e3},
    ),
    "rotation": (
        """
  node s: rotation
  J1: inertia(J = 3000 g.cm^2) s
  K: torsion(k = 20 mN.m/deg) s -> ground
  D: rotary_damper(b = 1 mN.m/rpm) s -> ground
  init s.q = 90 deg
  init s.f = 30 rpm
""",
        """
  node s: rotation
  J1: inertia(J = 3e-4 kg.m^2) s
  K: torsion(k = 3.6/pi*1 J) s -> ground
  D: rotary_damper(b = 0.03/pi*1 J.s) s -> ground
  init s.q = pi/2
  init s.f = pi*1 s^-1
""",
        {"s.q in deg": np.pi / 180, "s.f in rpm": np.pi / 30, "K.e in mN.m": 1e-3},
    ),
    "electrical": (
        """
  node a, b: electrical
  S: voltage(v = 5000 mV) a -> ground
  R1: resistor(R = 2 kohm) a -> b
  C1: capacitor(C = 300 uF) b -> ground
  R2: resistor(R = 0.01 Mohm) b -> ground
  init C1.q = 0.6 mC
""",
        """
  node a, b: electrical
  S: voltage(v = 5 V) a -> ground
  R1: resistor(R = 2e3 kg.m^2/s^3/A^2) a -> b
  C1: capacitor(C = 3e-4 A.s/V) b -> ground
  R2: resistor(R = 1e4 ohm) b -> ground
  init C1.q = 6e-4 A.s
""",
        {"b.e in mV": 1e-3, "R1.f in uA": 1e-6, "C1.q in nC": 1e-9},
    ),
    "fluid": (
        """
  node a, b: hydraulic
  A: tank(A = 50 cm^2, rho = 0.9 kg/l, gravity = 9800 mm/s^2) a = a
  L: pipe(I = 2 bar.s^2/l, R = 0.1 bar.s/l) a = a, b = b
  O: orifice(A = 80 mm^2, rho = 900 g/l, dp_lam = 2 mbar) b -> ground
  init A.store.q = 3000 cm^3
  init L.inert.f = 0 l/min
""",
        """
  node a, b: hydraulic
  A: tank(A = 5e-3 m^2, rho = 900 kg/m^3, gravity = 9.8 m/s^2) a = a
  L: pipe(I = 2e8 kg/m^4, R = 1e7 kg/m^4/s) a = a, b = b
  O: orifice(A = 8e-5 m^2, rho = 900 kg/m^3, dp_lam = 200 Pa) b -> ground
  init A.store.q = 3e-3 m^3
  init L.inert.f = 0 m^3/s
""",
        {"a.e in mbar": 100.0, "O.f in l/min": 1e-3 / 60, "A.store.q in l": 1e-3},
    ),
    "heat": (
        """
  node a, air: heat
  T: temperature(T = celsius(20)) air -> ground
  A: capacity(C = 0.5 Wh/K) a -> ground
  R: resistance(R = 2 K/W) a -> air
  Q: heat_flow(Q = 0.04 kW) ground -> a
  init A.e = celsius(60)
""",
        """
  node a, air: heat
  T: temperature(T = 293.15 K) air -> ground
  A: capacity(C = 1800 J/K) a -> ground
  R: resistance(R = 2 K.s/J) a -> air
  Q: heat_flow(Q = 40 J/s) ground -> a
  init A.e = 333.15 K
""",
        {"A.q in kJ": 1e3, "R.f in mW": 1e-3, "Q.f in J/h": 1 / 3600},
    ),
}


@pytest.mark.parametrize("model", PREFIXED)
@pytest.mark.long
def test_prefixed_units(model, tmp_path, record_property):
    prefixed, plain, units = PREFIXED[model]
    texts = [
        network(prefixed, SPAN, ", ".join(f"{trace} as y{k}" for k, trace in enumerate(units))),
        network(plain, SPAN, ", ".join(f"{trace.partition(' ')[0]} as y{k}" for k, trace in enumerate(units))),
    ]
    found, wanted = (accepted(tmp_path, text) for text in texts)
    error = difference({f"y{k}": found[f"y{k}"] * unit for k, unit in enumerate(units.values())}, wanted)
    record_property("error", error)
    assert error <= AGREES


def loop(store, quantity, action):
    """A controller, a lag and a lead around one store: the numbers are the same whatever is controlled."""
    body = f"""
  {store}
  meas: low_pass(tau = 0.2 s) u = plant
  ref: lead_lag(t1 = 0.5 s, t2 = 0.3 s) u = 3 quantity
  ctl: pid(
    kp = 2 action/quantity, ki = 3 action/quantity/s, kd = 0.1 action.s/quantity, tau = 50 ms,
    lo = -100 action, hi = 100 action
  ) r = ref.y, y = meas.y
"""
    units = f"unit quantity = 1 {quantity}\nunit action = 1 {action}\n"
    return units + network(body, SPAN, "plant, meas.y, ref.y, ctl.u")


LOOPS = {
    "rotation": (
        "node x: rotation; J1: inertia(J = 0.7 kg.m^2) x; P: torque(M = ctl.u) ground -> x; let plant = x.f; "
        "init x.f = 1 rad/s",
        "rad/s",
        "N.m",
    ),
    "translation": (
        "node x: translation; M: mass(m = 0.7 kg) x; P: force(F = ctl.u) ground -> x; let plant = x.f; "
        "init x.f = 1 m/s",
        "m/s",
        "N",
    ),
    "electrical": (
        "node x: electrical; C1: capacitor(C = 0.7 F) x -> ground; P: current(i = ctl.u) ground -> x; "
        "let plant = x.e; init C1.e = 1 V",
        "V",
        "A",
    ),
    "heat": (
        "node x: heat; C1: capacity(C = 0.7 J/K) x -> ground; P: heat_flow(Q = ctl.u) ground -> x; "
        "let plant = x.e; init C1.e = 1 K",
        "K",
        "W",
    ),
}


@pytest.mark.parametrize("domain", [d for d in LOOPS if d != "rotation"])
@pytest.mark.long
def test_unit_variables_fit_every_domain(domain, tmp_path, record_property):
    wanted, found = (accepted(tmp_path, loop(*LOOPS[d])) for d in ("rotation", domain))
    error = difference(found, wanted)
    record_property("error", error)
    assert error <= AGREES
