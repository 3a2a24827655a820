"""Parameters outside their physical range are refused, by the name of the element (language, section 11.32)."""

import pytest
from runs import library, names, network, traced, walk
from sysdyn.dsl.tree import syntax

NODES = """
  node a: electrical
  node h: hydraulic
  node x: translation
  node s: rotation
  node w: heat
  node c: planar
"""
REFUSED = (
    "resistor(R = 0 ohm) a -> ground",
    "capacitor(C = -1 uF) a -> ground",
    "inductor(L = 0 H) a -> ground",
    "diode(Is = 0 A) a -> ground",
    "diode(vT = -25 mV) a -> ground",
    "npn(Ies = 0 A) c = a, b = a, e = ground",
    "npn(Ics = -1 fA) c = a, b = a, e = ground",
    "npn(vT = 0 V) c = a, b = a, e = ground",
    "npn(aF = 1.01) c = a, b = a, e = ground",
    "npn(aR = -0.1) c = a, b = a, e = ground",
    "opamp(gain = 0) inp = a, inm = a, out = a",
    "ideal_transformer(n = 0) a = a, b = ground, c = a, d = ground",
    "tank(A = 0 m^2) a = h",
    "tank(A = 1 m^2, rho = -1 kg/m^3) a = h",
    "tank(A = 1 m^2, gravity = -9.8 m/s^2) a = h",
    "valve(Cr = 0 Pa.s^2/m^6) h -> ground",
    "orifice(A = -1 mm^2) h -> ground",
    "orifice(A = 1 mm^2, Cd = 0) h -> ground",
    "orifice(A = 1 mm^2, rho = 0 kg/m^3) h -> ground",
    "orifice(A = 1 mm^2, dp_lam = 0 Pa) h -> ground",
    "pipe(I = -1 Pa.s^2/m^3, R = 1 Pa.s/m^3) a = h, b = ground",
    "pipe(I = 1 Pa.s^2/m^3, R = -1 Pa.s/m^3) a = h, b = ground",
    "accumulator(V0 = 0 l, p0 = 1 bar) a = h",
    "accumulator(V0 = 1 l, p0 = 0 bar) a = h",
    "ram(A = 0 m^2) a = h, rod = x",
    "pump(Dp = 0 m^3/rad) shaft = s, inlet = ground, out = h",
    "mass(m = -1 kg) x",
    "mass.relativistic(m = -1 kg) x",
    "spring(k = -1 N/m) x -> ground",
    "damper(b = -1 N.s/m) x -> ground",
    "coulomb(Fc = -1 N) x -> ground",
    "inertia(J = -1 kg.m^2) s",
    "torsion(k = -1 N.m/rad) s -> ground",
    "rotary_damper(b = -1 N.m.s/rad) s -> ground",
    "gear(ratio = 0) inp = s, out = s",
    "gear.losses(ratio = 2, eta = 1.1) inp = s, out = s",
    "clutch.smooth(clamp = 1 N, mu = -0.1) a = s, b = ground",
    "clutch.smooth(clamp = 1 N, r = 0 m) a = s, b = ground",
    "clutch.smooth(clamp = 1 N, faces = 0) a = s, b = ground",
    "rack(r = 0 m) inp = s, out = x",
    "body2d(m = -1 kg, J = 1 kg.m^2) cm = c",
    "body2d(m = 1 kg, J = -1 kg.m^2) cm = c",
    "capacity(C = 0 J/K) w -> ground",
    "conductance(G = 0 W/K) w -> ground",
    "resistance(R = 0 K/W) w -> ground",
    "dc_motor(K = 1 V.s, R = -1 ohm, L = 1 H, J = 1 kg.m^2, b = 1 N.m.s) p = a, n = ground, shaft = s",
    "dc_motor(K = 1 V.s, R = 1 ohm, L = -1 H, J = 1 kg.m^2, b = 1 N.m.s) p = a, n = ground, shaft = s",
    "dc_motor(K = 1 V.s, R = 1 ohm, L = 1 H, J = -1 kg.m^2, b = 1 N.m.s) p = a, n = ground, shaft = s",
    "dc_motor(K = 1 V.s, R = 1 ohm, L = 1 H, J = 1 kg.m^2, b = -1 N.m.s) p = a, n = ground, shaft = s",
    "dc_motor.thermal(K = 1 V.s, R = 1 ohm, L = 1 H, J = 1 kg.m^2, b = 1 N.m.s, Cth = 0 J/K) "
    "p = a, n = ground, shaft = s",
    "dc_motor.thermal(K = 1 V.s, R = 1 ohm, L = 1 H, J = 1 kg.m^2, b = 1 N.m.s, Rth = 0 K/W) "
    "p = a, n = ground, shaft = s",
    "pid(kp = 1, tau = 0 s, lo = -1 V, hi = 1 V) r = 1 V, y = 0 V",
    "pid(kp = 1, lo = 2 V, hi = 1 V) r = 1 V, y = 0 V",
    "lead_lag(t1 = 1 s, t2 = 0 s) u = 1 V",
    "low_pass(tau = -1 s) u = 1 V",
    "sampled_pi(kp = 1, ki = 1 Hz, Ts = 0 s, lo = -1 V, hi = 1 V) r = 1 V, y = 0 V",
    "sampled_pi(kp = 1, ki = 1 Hz, Ts = 1 s, lo = 2 V, hi = 1 V) r = 1 V, y = 0 V",
    "mosfet(Ron = 0 ohm, gate = if t < 1 s then 1 else 0) d = a, s = ground",
    "mosfet(Ron = 1 ohm, vf = -1 V, gate = if t < 1 s then 1 else 0) d = a, s = ground",
    "pulse(hi = 1 V, rise = 0 s, fall = 1 s, width = 1 s, period = 4 s) a -> ground",
    "pulse(hi = 1 V, rise = 1 s, fall = 0 s, width = 1 s, period = 4 s) a -> ground",
    "pulse(hi = 1 V, rise = 1 s, fall = 1 s, width = -1 s, period = 4 s) a -> ground",
    "pulse(hi = 1 V, rise = 1 s, fall = 1 s, width = 1 s, period = 2 s) a -> ground",
    "piecewise_voltage(n = 1, at = [1 s], v = [1 V]) a -> ground",
    "coupled_inductors(L1 = 0 H, L2 = 1 H, k = 0.1) one = a -> ground, two = a -> ground",
    "coupled_inductors(L1 = 1 H, L2 = 0 H, k = 0.1) one = a -> ground, two = a -> ground",
    "coupled_inductors(L1 = 1 H, L2 = 1 H, k = 1) one = a -> ground, two = a -> ground",
    "pwm(period = 0 s, duty = 0.5)",
    "stops(lo = 1 m, hi = 1 m) x -> ground",
    "stops(lo = 0 m, hi = 1 m, bounce = 1.1) x -> ground",
    "coulomb_joint(Mc = -1 N.m) s -> ground",
    "brake(clamp = 1 N, mu = -0.1, r = 1 m) s -> ground",
    "brake(clamp = 1 N, r = 0 m) s -> ground",
    "brake(clamp = 1 N, r = 1 m, faces = 0) s -> ground",
    "relief_valve(opens = -1 bar, R = 1 Pa.s/m^3) a = h, b = ground",
    "relief_valve(opens = 1 bar, R = 0 Pa.s/m^3) a = h, b = ground",
    "relay(band = -1 V, lo = 0 V, hi = 1 V) u = 1 V",
    "hysteresis(on_at = 1 V, off_at = 1 V, lo = 0 V, hi = 1 V) u = 1 V*t/(1 s)",
    "sample_hold(Ts = 0 s) u = 1 V",
    "quantiser(q = 0 V, Ts = 1 s) u = 1 V",
    "quantiser(q = 1 V, Ts = 0 s) u = 1 V",
    "sampled_pid(kp = 1, Ts = 0 s, lo = -1 V, hi = 1 V) r = 1 V, y = 0 V",
    "sampled_pid(kp = 1, Ts = 1 s, lo = 2 V, hi = 1 V) r = 1 V, y = 0 V",
)


@pytest.mark.parametrize("element", REFUSED)
@pytest.mark.one_in(39)
def test_refused(element, tmp_path):
    found, report = traced(tmp_path, network(f"{NODES}  E: {element}\n", 1.0, "t"), (1.0,))
    assert found is None
    refused = [d for d in report if d.code == "E322"]
    assert len(refused) == 1
    assert " E." in refused[0].message


@pytest.mark.long
def test_every_requirement_has_a_row():
    rows = [names(f"model m {{{NODES}  E: {element}\n}}")[0] for element in REFUSED]
    wanted = {
        name: sum(isinstance(s, syntax.RequireStatement) for s in walk(entry.component.body))
        for name, entry in library().items()
    }
    assert {n: k for n, k in wanted.items() if rows.count(n) < k} == {}
