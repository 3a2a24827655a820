"""Rectifiers of ideal diodes against closed forms: values, instants of commutation, and no event too many."""

import numpy as np
import pytest
from model_runs import trace_of
from sysdyn.api import simulate

W = 100.0 * np.pi
PHASE = 0.3


def run(text, tmp_path, formulation, **options):
    file = tmp_path / "m.sd"
    file.write_text(text)
    return simulate(file, output=tmp_path / "m.h5", formulation=formulation, accuracy=1e-6, **options)


def bridge(phases):
    """Phases against ground, two diodes each, a resistor between both rails."""
    rows = "\n".join(
        f"  node a{k}: electrical\n"
        f"  V{k}: voltage(v = 10 V*sin(100*pi*t/(1 s) + {PHASE} - 2*pi*{k}/{phases})) a{k} -> ground\n"
        f"  P{k}: diode.complementary() a{k} -> p\n"
        f"  N{k}: diode.complementary() n -> a{k}"
        for k in range(phases)
    )
    return f"""from std.electrical import voltage, diode, resistor
model m {{
  node p, n: electrical
{rows}
  R: resistor(R = 5 ohm) p -> n
}}
scene s of m {{
  time 0 s to 20 ms
  trace p.e - n.e as v every 0.1 ms
}}
"""


BRIDGES = [(2, "lagrangian"), (2, "hamiltonian"), (3, "lagrangian"), (5, "lagrangian")]


@pytest.mark.parametrize(("phases", "formulation"), BRIDGES)
@pytest.mark.long
def test_a_bridge_commutates_and_does_nothing_else(phases, formulation, tmp_path):
    trace = run(bridge(phases), tmp_path, formulation)
    waves = [10.0 * np.sin(W * trace.time + PHASE - 2.0 * np.pi * k / phases) for k in range(phases)]
    assert np.abs(trace["v"].values - (np.max(waves, axis=0) - np.min(waves, axis=0))).max() < 1e-9
    # each diode conducts once in a period; two phases that are opposite commutate on both rails at once
    assert len(trace.events) == 4 * phases


LOADS = {
    "r": "  R: resistor(R = 5 ohm) p -> ground",
    "rl": "  node c: electrical\n  L: inductor(L = 10 mH) p -> c\n  R: resistor(R = 5 ohm) c -> ground\n"
    "  init L.f = 0 A",
    "rc": "  C: capacitor(C = 1 mF) p -> ground\n  R: resistor(R = 50 ohm) p -> ground\n  init C.e = 1 V",
}


def half_wave(load):
    return f"""from std.electrical import voltage, diode, resistor, inductor, capacitor
model m {{
  node a, p: electrical
  V: voltage(v = 10 V*sin(100*pi*t/(1 s))) a -> ground
  D: diode.complementary() a -> p
{LOADS[load]}
}}
scene s of m {{
  time 0.1 ms to 50 ms
  trace D.f as i, p.e as v every 0.1 ms
}}
"""


@pytest.mark.parametrize("formulation", ["lagrangian", "hamiltonian"])
@pytest.mark.long
def test_a_half_wave_into_a_resistor(formulation, tmp_path):
    trace = run(half_wave("r"), tmp_path, formulation)
    assert np.abs(trace["i"].values - 2.0 * np.maximum(np.sin(W * trace.time), 0.0)).max() < 1e-9
    assert [e.name for e in trace.events] == ["D.one_way"] * 4


@pytest.mark.parametrize("formulation", ["lagrangian", "hamiltonian"])
@pytest.mark.long
def test_a_half_wave_into_a_capacitor(formulation, tmp_path):
    """The capacitor follows the source until its current turns, then discharges alone until the source is above it."""
    trace = run(half_wave("rc"), tmp_path, formulation)
    tau, end = 0.05, np.pi - np.arctan(W * 0.05)  # C v' + v/R = 0
    for t, i, v in zip(trace.time, trace["i"].values, trace["v"].values, strict=True):
        turn = end / W
        cycles = [turn + 0.02 * k for k in range(3) if turn + 0.02 * k <= t]
        if cycles:
            alone = 10.0 * np.sin(end) * np.exp(-(t - cycles[-1]) / tau)
            wave = 10.0 * np.sin(W * t)
            late = t - cycles[-1] > 0.008
            assert abs(v - max(alone, wave if late else alone)) < 2e-5
        assert i > -1e-5


@pytest.mark.parametrize("formulation", ["lagrangian", "hamiltonian"])
@pytest.mark.long
def test_a_half_wave_into_a_coil(formulation, tmp_path):
    """The coil carries the current on beyond the half wave, until it ends; then nothing flows up to the next."""
    trace = run(half_wave("rl"), tmp_path, formulation)
    size, lag = 10.0 / np.hypot(5.0, W * 0.01), np.arctan2(W * 0.01, 5.0)
    wanted = np.zeros_like(trace.time)
    for begin in (1e-4, 0.02, 0.04):
        s = trace.time - begin
        wave = size * (np.sin(W * trace.time - lag) - np.sin(W * begin - lag) * np.exp(-s * 500.0))
        wanted += np.where((s > 0.0) & (s < 0.0195) & (wave > 0.0), wave, 0.0)
    assert np.abs(trace["i"].values - wanted).max() < 1e-5
    assert len(trace.events) == 4


BUCK = """from std.electrical import switch, diode, voltage, inductor, resistor, pwm
model m {
  node i, x, o: electrical
  V: voltage(v = 24 V) i -> ground
  P: pwm(period = 20 us, duty = 0.4)
  S: switch(gate = P.gate) i -> x
  D: diode.complementary() ground -> x
  L: inductor(L = 100 uH) x -> o
  R: resistor(R = 3 ohm) o -> ground
  init L.f = 0 A
}
scene s of m {
  time 0 s to 1 ms
  trace L.f as i every 10 us
}
"""


@pytest.mark.parametrize("formulation", ["lagrangian", "hamiltonian"])
@pytest.mark.parametrize("method", ["radau", "bdf"])
@pytest.mark.one_in(5)
def test_a_buck_converter_against_its_exponentials(method, formulation, tmp_path):
    trace = run(BUCK, tmp_path, formulation, method=method)
    assert trace.statistics["error_estimate"] <= 1e-6
    period, duty, tau = 20e-6, 0.4, 100e-6 / 3.0
    begins = [0.0]
    for _ in range(50):
        on = 8.0 - (8.0 - begins[-1]) * np.exp(-duty * period / tau)
        begins.append(on * np.exp(-(1.0 - duty) * period / tau))
    for t, i in zip(trace.time, trace["i"].values, strict=True):
        k = int(t / period + 1e-9)
        s = t - k * period
        rise = 8.0 - (8.0 - begins[k]) * np.exp(-min(s, duty * period) / tau)
        assert abs(i - rise * np.exp(-max(s - duty * period, 0.0) / tau)) < 4e-6
    off = np.array([e.time for e in trace.events if e.name.startswith("when on")])
    assert len(off) == 50
    assert np.abs(off / period - np.arange(50) - duty).max() < 1e-9


VALVES = """from std.fluid import check_valve
model m {
  node chamber, line: hydraulic
  piston: flow(f = 0.1 l/s*sin(10 rad/s*t)) ground -> chamber
  oil: potential(e = 1e11 Pa/m^3*q) chamber -> ground
  suction: check_valve() ground -> chamber
  pressure: check_valve() chamber -> line
  vessel: potential(e = 1e9 Pa/m^3*q) line -> ground
  load: dissipator(e = 5e9 Pa.s/m^3*f) line -> ground
  init oil.e = 1 bar
  init vessel.e = 1 bar
}
scene s of m {
  time 0 s to 0.1 s
  trace pressure.f as p, suction.f as s every 1 ms
}
"""


@pytest.mark.long
def test_valves_in_series_begin_with_the_flow_that_keeps_both_pressures_alike(tmp_path):
    """An open valve joins both vessels: 0.02 l/s that leak divide as the stiffnesses do."""
    trace = run(VALVES, tmp_path, "lagrangian")
    assert trace["p"].values[0] == pytest.approx(1e5 / 5e9 / 101.0, rel=1e-9)
    assert abs(trace["s"].values[0]) < 1e-15


INVERTER = """from std.electrical import capacitor, pulse, voltage
component nmos {
  port d, g, s: electrical
  let on = max(g.e - s.e - 0.7 V, 0 V)
  let back = max(g.e - d.e - 0.7 V, 0 V)
  channel: dissipator(f = 1.1e-4 A/V^2*(on^2 - back^2)) d -> s
}
component pmos {
  port d, g, s: electrical
  let on = max(s.e - g.e - 0.8 V, 0 V)
  let back = max(d.e - g.e - 0.8 V, 0 V)
  channel: dissipator(f = 1e-4 A/V^2*(on^2 - back^2)) s -> d
}
model m {
  node vdd, a, b, c: electrical
  supply: voltage(v = 3.3 V) vdd -> ground
  gate: pulse(lo = 0 V, hi = 3.3 V, rise = 100 ps, fall = 100 ps, width = 4 ns, period = 10 ns,
      delay = 1 ns) a -> ground
  N: nmos() d = b, g = a, s = ground
  P: pmos() d = b, g = a, s = vdd
  C: capacitor(C = 50 fF) b -> ground
  N2: nmos() d = c, g = b, s = ground
  P2: pmos() d = c, g = b, s = vdd
  C2: capacitor(C = 100 fF) c -> ground
  init C.f = 0 A
  init C2.f = 0 A
}
scene s of m { time 0 s to 20 ns; trace b.e as v every 0.1 ns }
"""


@pytest.mark.long
def test_a_gate_whose_transistors_are_off_by_turns(tmp_path):
    """An off transistor's law is zero, and its row has no term beside its residual; the discharge has a closed form."""
    file = tmp_path / "m.sd"
    file.write_text(INVERTER)
    for rtol in (1e-11, 1e-10, 1e-8):
        trace = simulate(file, output=tmp_path / "m.h5", method="radau", rtol=rtol)
        # a step that is tried at half its length counts as one
        assert trace.statistics["newton_failures"] < 0.1 * trace.statistics["steps"]
    at = {round(t * 1e10): v for t, v in zip(trace.time, trace["v"].values, strict=True)}
    # in its linear region C v' = -beta (u v - v^2/2), u = 2.6 V: v/(2u - v) falls as exp(-beta u t/C)
    u, rate = 2.6, 2.2e-4 * 2.6 / 50e-15
    begin, end = at[17], at[27]
    fallen = begin / (2.0 * u - begin) * np.exp(-rate * 1e-9)
    assert abs(end - 2.0 * u * fallen / (1.0 + fallen)) < 1e-6


SHARED = """from std.electrical import capacitor, switch
model shared {
  node a, b: electrical
  C1: capacitor(C = 1 mF) a -> ground
  C2: capacitor(C = 2 mF) b -> ground
  S: switch(gate = if t > 0.37 s then 1 else 0) a -> b
  init C1.e = 10 V
  init C2.e = 1 V
}
scene s of shared {
  time 0 s to 0.5 s
  trace C1.e as v1, C2.e as v2 every 50 ms
}
"""


@pytest.mark.parametrize("formulation", ["lagrangian", "hamiltonian"])
@pytest.mark.long
def test_two_capacitors_and_a_switch_alone(formulation, tmp_path):
    """One flow through all three, which nothing resists: its row alone says where the charge is behind the jump."""
    trace = run(SHARED, tmp_path, formulation)
    behind = trace.time >= 0.37
    assert np.abs(trace["v1"].values - np.where(behind, 4.0, 10.0)).max() < 1e-12
    assert np.abs(trace["v2"].values - np.where(behind, 4.0, 1.0)).max() < 1e-12


GROUNDED = """from std.electrical import capacitor, switch
model grounded {
  node n1, n2, n3: electrical
  C0: capacitor(C = 1 mF) n1 -> ground
  C1: capacitor(C = 3 mF) n2 -> ground
  C2: capacitor(C = 4 mF) n3 -> n1
  C3: capacitor(C = 2 mF) n3 -> n2
  S: switch(gate = if t > 0.211 s then 1 else 0) ground -> n3
  init C0.e = 2 V
  init C1.e = 4 V
  init C2.e = 5 V
}
scene s of grounded {
  time 0 s to 0.5 s
  trace C0.e as v0, C1.e as v1, C2.e as v2, C3.e as v3 every 50 ms
}
"""


@pytest.mark.parametrize("formulation", ["lagrangian", "hamiltonian"])
@pytest.mark.long
def test_what_series_capacitors_hold_besides_their_flow_stays_where_charge_jumps(formulation, tmp_path):
    """n3 at 7 V is grounded: each branch loses it in the inverse proportion of its capacities, its own charge stays."""
    trace = run(GROUNDED, tmp_path, formulation)
    behind = trace.time >= 0.211
    for name, before, after in (("v0", 2.0, 2 - 5.6), ("v1", 4.0, 4 - 2.8), ("v2", 5.0, 5 - 1.4), ("v3", 3.0, 3 - 4.2)):
        assert np.abs(trace[name].values - np.where(behind, after, before)).max() < 1e-12


TWICE = """from std.electrical import capacitor, resistor, switch
model twice {
  node a, b: electrical
  C: capacitor(C = 1 mF) a -> ground
  S: switch(gate = if t > 0.2 s then 1 else 0) a -> b
  T: switch(gate = if t > 0.4 s then 1 else 0) a -> b
  R: resistor(R = 100 ohm) b -> ground
  init C.e = 10 V
}
scene s of twice {
  time 0 s to 1 s
  trace C.e every 0.1 s
}
"""


@pytest.mark.parametrize("formulation", ["lagrangian", "hamiltonian", "co_lagrangian", "co_hamiltonian"])
@pytest.mark.one_in(2)
def test_closed_switches_side_by_side_discharge_a_capacitor_and_their_shares_are_a_choice(tmp_path, formulation):
    """From 0.4 s on both say the same (E931 before)."""
    with pytest.warns(UserWarning, match=r"at times S.blocks, T.blocks leave S.f open: .* one of many"):
        trace = run(TWICE.replace("trace C.e", "trace C.e, S.f, R.e"), tmp_path, formulation)
    exact = 10.0 * np.exp(-np.maximum(trace.time - 0.2, 0.0) / 0.1)
    assert np.abs(trace["C.e"].values - exact).max() < 1e-4
    closed = (np.abs(trace.time - 0.2) > 1e-9) & (trace.time > 0.2)
    assert np.abs(trace["R.e"].values - exact)[closed].max() < 1e-4


HALF_WAVE = """
from std.electrical import resistor, capacitor, voltage, diode
model rectifier {
  node a, b: electrical
  Vs: voltage(v = 5 V*sin(2*pi*10 Hz*t)) a -> ground
  D: diode.complementary() a -> b
  R: resistor(R = 10 ohm) b -> ground
  C: capacitor(C = 100 uF) b -> ground
  init C.e = 0 V
}
scene s of rectifier { time 0 s to 0.2 s; trace b.e }
"""


@pytest.mark.parametrize("method", ["bdf", "radau"])
@pytest.mark.parametrize("accuracy", [1e-3, 1e-4, 1e-5, 1e-6, 1e-7])
@pytest.mark.long
def test_a_diode_before_a_capacitor_lets_go_at_every_accuracy(tmp_path, accuracy, method):
    """Its current ends while the voltage across it is nothing: what a draft leaves of that is no voltage.  Closed form:
    the source, from where the current is nothing the capacitor over the resistor.
    """
    trace = trace_of(tmp_path, HALF_WAVE, accuracy=accuracy, method=method)
    w, time = 20 * np.pi, np.mod(trace.time, 0.1)
    off = (np.pi - np.arctan(w * 10 * 1e-4)) / w
    falling = 5 * np.sin(w * off) * np.exp(-(time - off) / 1e-3)
    expected = np.where(time <= off, 5 * np.sin(w * time), falling)
    assert np.abs(trace["b.e"].values - expected).max() <= 5 * accuracy
