"""Jumps and kinks in time: closed forms from text to trace, with the restarts and without."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import brentq
from sysdyn import api
from sysdyn.cli.run.prepare import prepare
from sysdyn.compiler.binding.instants import instants
from sysdyn.dsl import load
from sysdyn.dsl.model import expression as ex
from sysdyn.dsl.text.diagnostics import Report
from sysdyn.dsl.text.source import SourceText
from sysdyn.runtime.accuracy.options import Options
from sysdyn.runtime.integrate.jumps.segments import segments
from sysdyn.runtime.model.failures import SolverFailure
from sysdyn.runtime.simulate import simulate
from sysdyn.runtime.trace.trace import Trace

LEAD = """
from std.electrical import resistor, capacitor, voltage
model m {
  node a, b: electrical
  Vs: voltage(v = 5 V*step(t - 0.1 s)) a -> ground
  R1: resistor(R = 1 kohm) a -> b
  C: capacitor(C = 100 uF) a -> b
  R2: resistor(R = 1 kohm) b -> ground
  init C.e = 0 V
}
scene s of m { time 0 s to 1 s; trace C.e as u, b.e as v, audit.energy as e }
"""
SPRING = """
model m {
  coord x: translation = 0 m
  energy T* = 1/2*(1 kg)*x'^2
  energy V = 2 N/m*x^2
  work (1 N)*step(t - 1 s) on x
  init x' = 0 m/s
}
scene s of m { time 0 s to 5 s; trace x as u, audit.energy as e }
"""
COIL = """
from std.electrical import resistor, inductor, voltage
model m {
  node a, b: electrical
  Vs: voltage(v = 5 V*step(t - 1 s)) a -> ground
  R: resistor(R = 1 ohm) a -> b
  L: inductor(L = 1 uH) b -> ground
  init L.f = 0 A
}
scene s of m { time 0 s to 4 s; trace L.f as u, audit.energy as e every 0.1 s }
"""
PULSES = """
model m {
  state u: 1 = 0
  dynamic u' = ((if mod(t, 0.5 s) < 0.002 s then 100 else 0) - u)/(1 s)
}
scene s of m { time 0 s to 4.75 s; trace u as u }
"""
KINKS = """
table f(x: s) -> 1 linear clamp [ (0, 0), (0.31, 1), (0.33, -7), (0.36, 1), (1.7, 2), (1.71, 50), (1.72, 0) ]
model m {
  state u: 1 = 0
  dynamic u' = f(t)/(1 s)
}
scene s of m { time 0 s to 2 s; trace u as u }
"""
VELOCITY = """
model m {
  coord w, x, y: translation = 0 m
  energy T* = 1/2*(1 kg)*w'^2 + 1/2*(1 kg)*x'^2 + 1/2*(2 kg)*y'^2
  energy V = 2 N/m*(x - w)^2 + 2 N/m*(y - x)^2 + 1 N/m*y^2
  content D = 0.15 kg/s*(x' - w')^2 + 0.15 kg/s*(y' - x')^2
  psi v: w' = 1 m/s*step(t - 1 s)
  init x' = 0 m/s
  init y' = 0 m/s
}
scene s of m { time 0 s to 5 s; trace y as u, w' as v, v.multiplier as k, audit.energy as e }
"""


def run(text, tmp_path, *, stops=True, formulation="lagrangian", instants_wanted=401, **options):
    report = Report()
    with ex.fresh():
        document = load.document(SourceText("m.sd", text), report)
        network = load.network(document, document.models["m"], document.scenes["s"], report)
        assert network is not None, [d.message for d in report]
        made = prepare(network, report, formulation=formulation, backend="numpy")
        assert made is not None, [d.message for d in report]
        end = made.binding.evaluate(network.scene.end)
        found = instants(made.compiled.form, made.binding, 0.0, end, network.tables)
    assert found.note is None
    path = tmp_path / "t.h5"
    given = Options(path, 0.0, end, end / (instants_wanted - 1), stops=found.times if stops else None, **options)
    outcome = simulate(made.manifest, made.arrays, made.carrier, given)
    trace = Trace.open(path)
    return trace.time, {name: trace[name] for name in trace.names}, outcome


def lead(t):
    # R2 C u' = V - u - u R2/R1: half the voltage in the end, time constant 0.05 s
    return np.where(t >= 0.1, 2.5 * (1 - np.exp(-(t - 0.1) / 0.05)), 0.0)


def spring(t):
    return np.where(t >= 1.0, (1 - np.cos(2 * (t - 1))) / 4, 0.0)


def pulses(t):
    total = np.zeros_like(t)
    for k in range(10):
        begin, end = 0.5 * k, 0.5 * k + 0.002
        rise = np.where(t >= begin, 100 * (1 - np.exp(-(t - begin))), 0.0)
        total += rise - np.where(t >= end, 100 * (1 - np.exp(-(t - end))), 0.0)
    return total


def kinks(t):
    x = np.array([0, 0.31, 0.33, 0.36, 1.7, 1.71, 1.72, 2.0])
    z = np.array([0, 1, -7, 1, 2, 50, 0, 0.0])
    area = np.concatenate([[0], np.cumsum(np.diff(x) * (z[1:] + z[:-1]) / 2)])
    k = np.clip(np.searchsorted(x, t, side="right") - 1, 0, len(x) - 2)
    d = t - x[k]
    return area[k] + z[k] * d + (z[k + 1] - z[k]) / (x[k + 1] - x[k]) * d * d / 2


@pytest.mark.parametrize(
    ("text", "exact", "ratio"),
    [(LEAD, lead, 0.5), (SPRING, spring, 0.5), (PULSES, pulses, 30.0), (KINKS, kinks, 8.0)],
)
@pytest.mark.long
def test_closed_forms(text, exact, ratio, tmp_path):
    # the error test alone finds long jumps, at the cost of rejected steps; short pulses it may miss
    errors = []
    for stops in (True, False):
        t, columns, _ = run(text, tmp_path, stops=stops, rtol=1e-6)
        errors.append(np.abs(columns["u"] - exact(t)).max() / np.abs(exact(t)).max())
    assert errors[0] < 3e-5
    assert errors[1] > ratio * errors[0]


@pytest.mark.long
def test_accuracy_is_met_and_the_right_value_stands_at_the_instant(tmp_path):
    t, columns, _ = run(LEAD, tmp_path, accuracy=1e-6)
    assert np.abs(columns["u"] - lead(t)).max() < 5e-6
    at = int(np.argmin(np.abs(t - 0.1)))
    assert t[at] == 0.1
    assert columns["v"][at] == pytest.approx(5.0, rel=1e-6)
    assert abs(columns["v"][at - 1]) < 1e-9
    assert np.abs(columns["e"]).max() < 1e-8


@pytest.mark.long
def test_a_velocity_that_steps_keeps_positions_and_the_energy_books(tmp_path):
    def rates(t, s):
        x, y, vx, vy = s
        w, vw = t - 1, 1.0
        return [
            vx,
            vy,
            -4 * (x - w) + 4 * (y - x) - 0.3 * (vx - vw) + 0.3 * (vy - vx),
            (-4 * (y - x) - 2 * y - 0.3 * (vy - vx)) / 2,
        ]

    reference = solve_ivp(rates, (1, 5), np.zeros(4), rtol=1e-11, atol=1e-13, dense_output=True)
    for formulation in ("lagrangian", "hamiltonian"):
        t, columns, _ = run(VELOCITY, tmp_path, rtol=1e-8, formulation=formulation)
        expected = np.where(t >= 1, reference.sol(np.maximum(t, 1))[1], 0.0)
        assert np.abs(columns["u"] - expected).max() < 3e-6
        assert np.abs(columns["e"]).max() < 3e-6  # 0.5 J of the impulse included
        at = int(np.argmin(np.abs(t - 1)))
        assert columns["v"][at - 1 : at + 1].tolist() == pytest.approx([0.0, 1.0], abs=1e-9)
    with pytest.raises(SolverFailure):
        run(VELOCITY, tmp_path, stops=False, rtol=1e-8)


@pytest.mark.parametrize("formulation", ["lagrangian", "hamiltonian", "co_lagrangian", "co_hamiltonian"])
@pytest.mark.long
def test_a_state_is_kept_where_its_rate_jumps_beyond_every_magnitude(formulation, tmp_path):
    # R/L is 4e6 times what the span resolves: i' = 5e6 A/s after 0 A
    t, columns, _ = run(COIL, tmp_path, rtol=1e-8, formulation=formulation)
    at = int(np.argmin(np.abs(t - 1)))
    assert t[at] == 1.0
    assert np.abs(columns["u"][at - 1 : at + 1]).max() < 1e-9  # of 5 A that follow
    assert columns["u"][-1] == pytest.approx(5.0, rel=1e-6)


def test_both_sides_of_a_jump_are_accepted_steps(tmp_path):
    t, _, outcome = run(SPRING, tmp_path, rtol=1e-6)
    assert outcome.final
    assert outcome.statistics["rejected_steps"] < 3
    assert (np.diff(t) > 0).all()


def test_segments():
    inf = np.inf
    assert [(s.begin, s.end) for s in segments(0.0, 1.0, None)] == [(0.0, 1.0)]
    parts = segments(0.0, 1.0, np.array([0.5, -1.0, 2.0, np.nan]))
    assert [(s.begin, s.end, s.label) for s in parts] == [
        (0.0, np.nextafter(0.5, -inf), 0.0),
        (np.nextafter(0.5, inf), 1.0, 0.5),
    ]
    # what jumps right behind the start
    assert [(s.begin, s.end, s.label) for s in segments(0.0, 1.0, np.zeros(1))] == [
        (0.0, 0.0, 0.0),
        (np.nextafter(0.0, inf), 1.0, 0.0),
    ]
    # the same instant by two formulas is one
    parts = segments(0.0, 1.0, np.array([0.3, 0.1 + 0.2, 0.6]))
    assert len(parts) == 3
    assert parts[1].begin == np.nextafter(0.1 + 0.2, inf)
    assert parts[0].end == np.nextafter(0.3, -inf)


SAW = """
from std.electrical import resistor, capacitor, voltage
model m {
  node a, b: electrical
  Vs: voltage(v = 1 V*mod(t, 0.3 s)/(0.3 s)) a -> ground
  R: resistor(R = 1 kohm) a -> b
  C: capacitor(C = 50 uF) b -> ground
  init C.e = 0 V
}
scene s of m { time 0 s to 0.9 s; trace C.e as u, a.e as v }
"""


def saw(t):
    """u' = (v - u)/(0.05 s) over three teeth of 0.3 s."""
    u, tau, slope = 0.0, 0.05, 1 / 0.3
    for _ in range(3):
        rest = min(t, 0.3)
        u = slope * (rest - tau) + (u + slope * tau) * np.exp(-rest / tau)
        t -= rest
    return u


@pytest.mark.parametrize("method", ["rosenbrock", "radau", "bdf", "dopri", "energy"])
@pytest.mark.one_in(5)
def test_no_step_sees_what_holds_from_the_end_on(method, tmp_path):
    """A saw tooth falls where the run ends: the last step ends before it, the last row stands behind it."""
    t, columns, outcome = run(SAW, tmp_path, accuracy=1e-6, method=method)
    assert outcome.final
    assert outcome.met
    assert t[-1] == 0.9
    assert columns["u"][-1] == pytest.approx(saw(0.9), abs=3e-6)
    assert columns["v"][-1] == pytest.approx(0.0, abs=1e-12)
    assert outcome.statistics["rejected_steps"] < 20


def test_a_last_piece_has_no_length_where_the_text_jumps_at_the_end():
    parts = segments(0.0, 1.0, np.array([0.5, np.nextafter(1.0, 0.0), 1.0]))
    assert [(s.begin, s.end, s.label) for s in parts[1:]] == [
        (np.nextafter(0.5, 2.0), np.nextafter(np.nextafter(1.0, 0.0), 0.0), 0.5),
        (1.0, 1.0, 1.0),
    ]


COMPARATOR = """
model m {
  param fs = 20 kHz
  param fr = 1 kHz
  param am = 0.7
  param ph = 0
  node a: electrical
  V: effort(e = if am*sin(2*pi*fr*t + ph) > 4*abs(frac(t*fs) - 0.5) - 1 then 20 V else -20 V) a -> ground
  L: kinetic(p = 0.1 mH*f) a -> ground
  init L.f = 0 A
}
scene s of m { time 0 s to 2 ms; trace L.f as i }
"""


@pytest.mark.long
def test_round_off_about_an_instant_is_on_neither_side_of_it(tmp_path):
    """The flux of a coil behind a comparator: a step from the old side of it took 20 V for -20 V (6 % off)."""
    path = tmp_path / "m.sd"
    path.write_text(COMPARATOR)
    coil, draw = api.load(path, formulation="co_lagrangian", accuracy=1e-4), np.random.default_rng(7)
    for _ in range(25):
        fs, fr, am, ph = draw.uniform((5e3, 300.0, 0.1, 0.0), (3e4, 3e3, 0.95, 6.0))

        def above(t, fs=fs, fr=fr, am=am, ph=ph):
            return am * np.sin(2 * np.pi * fr * t + ph) - 4 * abs(t * fs % 1 - 0.5) + 1

        every = np.linspace(0.0, 2e-3, 20001)
        turns = [brentq(above, *every[k : k + 2]) for k in np.flatnonzero(np.diff(np.sign(above(every))))]
        pieces = np.array([0.0, *turns, 2e-3])
        flux = 20.0 * np.sum(np.diff(pieces) * np.sign(above(0.5 * (pieces[1:] + pieces[:-1]))))
        current = coil.run({"fs": fs, "fr": fr, "am": am, "ph": ph})["i"].values
        assert current[-1] == pytest.approx(flux / 1e-4, abs=1e-6 * np.abs(current).max())


WHEN = """
model m {{
  param T = 0.1 s
  coord x: translation = 0 m
  energy T* = 1/2*(1 kg)*x'^2
  when t {asked} {{ x' := 3 m/s }}
  init x' = 1 m/s
}}
scene s of m {{ time 0 s to {end}; trace x, x' as v }}
"""


@pytest.mark.parametrize(
    ("asked", "end", "speed"),
    [
        (">= T", "T", 3.0),
        (">= 3*T", "0.3 s", 3.0),
        ("> T", "T", 1.0),
        (">= T + 1 ps", "T", 1.0),
        (">= T", "0.2 s", 3.0),
    ],
)
@pytest.mark.one_in(5)
def test_an_event_at_the_last_instant_happens(asked, end, speed, tmp_path):
    """No step crosses the end of the scene: `when t >= T` there was left out, as if it were strict."""
    path = tmp_path / "m.sd"
    path.write_text(WHEN.format(asked=asked, end=end), encoding="utf-8")
    trace = api.simulate(path, output=tmp_path / "m.h5")
    assert trace["v"].values[-1] == speed
    assert len(trace.events) == (speed == 3.0)
