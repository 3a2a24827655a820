"""Energies and momenta of elements over instants at which sources step: what impulses do, against closed forms."""

import numpy as np
import pytest
from model_runs import FOUR
from sysdyn import api

VELOCITY = """\
model m {
  node b, x: translation
  JUMP
  Q: flow(f = STEP) b -> ground
  K: potential(e = 100 N/m*q) x -> b
  M: kinetic(p = 2 kg*f) x
  Mb: kinetic(p = 3 kg*f) b
}
scene s of m { time 0 s to 0.5 s
  trace Q.energy as EQ, Mb.energy as EM, M.energy as E2, K.energy as EK, Q.p as P every 10 ms; accuracy 1e-6 }
"""
VOLTAGE = """\
model m {
  node a, b: electrical
  V: effort(e = (if t < 0.2 s then 1 V else 3 V)) a -> ground
  C1: potential(q = 2 F*e) a -> b
  C2: potential(q = 1 F*e) b -> ground
  R: dissipator(e = 1 ohm*f) b -> ground
  state Q: C = 0 C
  dynamic Q' = V.f
}
scene s of m { time 0 s to 0.5 s
  init C2.e = 0 V
  trace V.energy as EV, C1.energy as E1, C2.energy as E2, R.energy as ER, Q every 10 ms; accuracy 1e-6 }
"""
STEPS = {
    "text": ("", "(if t < 0.2 s then 0 m/s else 0.5 m/s)"),
    "event": ("discrete u = 0 m/s; when t > 0.2 s { u := 0.5 m/s }", "u"),
    "sample": ("discrete u = 0 m/s; every 0.2 s { u := 2.5 m/s^2*min(t, 0.2 s) }", "u"),
}


def _run(text, folder, **options):
    (folder / "m.sd").write_text(text)
    return api.simulate(folder / "m.sd", output=folder / "m.h5", **options)


def _last(trace, *names):
    return [trace[name].values[-1] for name in names]


@pytest.mark.parametrize("way", STEPS)
@pytest.mark.parametrize("formulation", [*FOUR, "kane"])
@pytest.mark.long
def test_a_source_of_velocity_that_steps_does_the_work_of_its_impulse(tmp_path, formulation, way):
    jump, step = STEPS[way]
    text = VELOCITY.replace("JUMP", jump).replace("STEP", step)
    omega, v, after = np.sqrt(50.0), 0.5, 0.3
    swing = 1.0 - np.cos(omega * after)
    wanted = -(1.5 * v**2 + 2.0 * v**2 * swing), 1.5 * v**2
    for method in ("auto", "bdf", "radau", "rosenbrock"):
        found = _run(text, tmp_path, formulation=formulation, method=method)
        given, base, mass, spring, pushed = _last(found, "EQ", "EM", "E2", "EK", "P")
        assert (given, base) == pytest.approx(wanted, abs=2e-6)
        assert mass == pytest.approx(v**2 * swing**2, abs=2e-6)
        assert given + base + mass + spring == pytest.approx(0.0, abs=2e-6)
        assert pushed == pytest.approx(-(3.0 * v + 2.0 * v * swing), abs=1e-5)


@pytest.mark.parametrize("formulation", FOUR)
@pytest.mark.long
def test_a_source_of_voltage_that_steps_pays_for_the_charge_that_passes_at_once(tmp_path, formulation):
    passed, flows = 4.0 / 3.0, 8.0 / 3.0 * (1.0 - np.exp(-0.1))
    left = 4.0 / 3.0 * np.exp(-0.1)
    for method in ("auto", "bdf", "radau", "rosenbrock"):
        found = _run(VOLTAGE, tmp_path, formulation=formulation, method=method)
        wanted = -(2.0 * passed + 3.0 * flows), (3.0 - left) ** 2 - 1.0, 0.5 * left**2
        assert _last(found, "EV", "E1", "E2") == pytest.approx(wanted, abs=4e-6)
        assert sum(_last(found, "EV", "E1", "E2", "ER")) == pytest.approx(0.0, abs=4e-6)
        assert found["Q"].values[-1] == pytest.approx(-(passed + flows), abs=4e-6)


ALONE = """\
model m {
  node a: electrical
  state W: J = 0 J
  state S: C.V^2 = 0 C.V^2
  V: effort(e = (if t < 0.2 s then 0 V else 5 V)) a -> ground
  C: potential(q = 2 mF*e) a -> ground
  dynamic W' = C.e*C.f
  dynamic S' = POWER
}
scene s of m { time 0 s to 0.3 s; trace C.e as e, W, S every 10 ms; accuracy 1e-6 }
"""


@pytest.mark.parametrize("formulation", FOUR)
@pytest.mark.one_in(5)
def test_what_a_capacitor_takes_at_once_is_integrated_along_its_voltage(tmp_path, formulation):
    """Where nothing has inertia or displacements either, as in the complementary forms."""
    found = _run(ALONE.replace("POWER", "C.e^2*C.f"), tmp_path, formulation=formulation)
    assert _last(found, "e", "W", "S") == pytest.approx((5.0, 0.5 * 2e-3 * 5.0**2, 2e-3 * 5.0**3 / 3.0), rel=1e-9)


@pytest.mark.parametrize("formulation", FOUR)
def test_the_square_of_a_pulse_has_no_integral(tmp_path, formulation):
    """However small it is beside a current that is there: 1e-8 C and 20 A."""
    text = ALONE.replace("C.V^2", "A^2.s").replace("POWER", "(C.f + 20 A)^2").replace("2 mF", "2 nF")
    with pytest.raises(api.SolverFailure, match="endless"):
        _run(text, tmp_path, formulation=formulation)


CURVED = """\
model m {
  node a, b: electrical
  I: flow(f = (if t < 0.2 s then 0.5 A else 0.8 A)) ground -> a
  L1: kinetic(p = 1 Wb*tanh(f/(1 A))) a -> b
  L2: kinetic(p = 2 H*f) a -> b
  R: dissipator(e = 1 ohm*f) b -> ground
}
scene s of m { time 0 s to 0.4 s
  init L2.f = 0.2 A
  trace I.energy as EI, L1.energy as E1, L2.energy as E2, R.energy as ER, L1.f as f, L1.T as T every 10 ms
  accuracy 1e-6 }
"""


@pytest.mark.parametrize("formulation", FOUR[2:])
def test_sources_pay_what_stores_of_any_law_take_along_the_rise(tmp_path, formulation):
    found = _run(CURVED, tmp_path, formulation=formulation)
    given, one, two, lost = _last(found, "EI", "E1", "E2", "ER")
    f = found["f"].values
    flux = np.tanh(f[-1]) - 2.0 * (0.8 - f[-1])
    assert flux == pytest.approx(np.tanh(0.3) - 2.0 * 0.2, abs=1e-7)  # the loop keeps it
    held = f * np.tanh(f) - np.log(np.cosh(f))
    assert one == pytest.approx(held[-1] - held[0], abs=1e-7)
    assert two == pytest.approx((0.8 - f[-1]) ** 2 - 0.2**2, abs=1e-7)
    assert lost == pytest.approx(0.25 * 0.2 + 0.64 * 0.2, abs=1e-7)
    assert given + one + two + lost == pytest.approx(0.0, abs=1e-7)  # 5e-4 by the mean of the flow


@pytest.mark.long
def test_charge_that_jumps_onto_a_capacitor_of_any_law_costs_what_it_stores(tmp_path):
    text = """\
model m {
  node a, b: electrical
  V: effort(e = (if t < 0.2 s then 1 V else 1.3 V)) a -> ground
  C1: potential(e = 1 V*(q/(1 C) + 0.3*(q/(1 C))^3)) a -> b
  C2: potential(q = 1 F*e) b -> ground
  R: dissipator(e = 1 ohm*f) b -> ground
}
scene s of m { time 0 s to 0.3 s; init C2.e = 0 V
  trace V.energy + C1.energy + C2.energy + R.energy as off, V.energy as V every 10 ms; accuracy 1e-6 }
"""
    for formulation in FOUR[:2]:
        found = _run(text, tmp_path, formulation=formulation)
        assert np.abs(found["off"].values).max() < 1e-7  # 1.8e-4 by the mean of the effort
        assert found["V"].values[-1] == pytest.approx(-0.132349, abs=1e-6)


@pytest.mark.parametrize("formulation", FOUR)
@pytest.mark.long
def test_a_source_beside_others_pays_what_a_capacitor_of_any_law_takes(tmp_path, formulation):
    """The charges at its node add up by an integrated row, in which nobody keeps that of the source."""
    text = """\
model m {
  node a: electrical
  V: effort(e = (if t < 0.2 s then 1 V else 3 V)) a -> ground
  C: potential(e = 2 V*(q/(1 C) + 0.3*(q/(1 C))^3)) a -> ground
  R: dissipator(e = 1 ohm*f) a -> ground
}
scene s of m { time 0 s to 0.3 s
  trace C.energy as EC, R.energy as ER, V.energy as EV, C.q as q every 10 ms; accuracy 1e-6 }
"""
    found = _run(text, tmp_path, formulation=formulation)
    q = found["q"].values
    took = (q**2 + 0.15 * q**4)[[0, -1]]
    assert _last(found, "EC", "ER") == pytest.approx((took[1] - took[0], 1.0 * 0.2 + 9.0 * 0.1), abs=1e-7)
    assert sum(_last(found, "EC", "ER", "EV")) == pytest.approx(0.0, abs=1e-7)  # 0.059 J by the mean of the voltage


@pytest.mark.long
def test_a_mean_that_is_zero_is_no_energy_that_is(tmp_path):
    """From -3 V to 3 V the mean effort is nothing, what a capacitor of cubic law takes on the way is not."""
    text = """\
model m {
  node a, b: electrical
  V: effort(e = (if t < 0.2 s then -3 V else 3 V)) ground -> a
  N: potential(e = 3 V*(q/(1 C) + 0.2*(q/(1 C))^3)) b -> a
  C: potential(q = 0.2 F*e) ground -> b
  R: dissipator(e = 1 ohm*f) a -> b
}
scene s of m { time 0 s to 0.4 s
  trace V.energy + N.energy + C.energy + R.energy as off, V.energy as V every 10 ms; accuracy 1e-6 }
"""
    found = _run(text, tmp_path, formulation="lagrangian")
    assert np.abs(found["off"].values).max() < 1e-6 * np.abs(found["V"].values).max()


@pytest.mark.long
def test_what_events_change_at_fixed_contents_is_no_work_of_the_store(tmp_path):
    """A stiffness that an event doubles: the store absorbs what the mass has lost, and no more."""
    text = """\
model m {
  node x: translation
  discrete k = 100 N/m
  K: potential(e = k*q) x
  M: kinetic(p = 2 kg*f) x
  init x.q = 0.1 m
  when t > 0.2 s { k := 200 N/m }
}
scene s of m { time 0 s to 0.5 s; trace K.energy as K, M.energy as M, x.f as v every 10 ms; accuracy 1e-6 }
"""
    for formulation in FOUR:
        found = _run(text, tmp_path, formulation=formulation)
        stored, moved, v = (found[name].values for name in ("K", "M", "v"))
        np.testing.assert_allclose(moved, v**2, atol=1e-6)
        np.testing.assert_allclose(stored + moved, 0.0, atol=1e-6)


READ = (
    VOLTAGE.replace(", Q every", ", D.f as D every")
    .replace("a, b:", "a, b, d:")
    .replace(
        "  state Q",
        """\
  W: effort(e = Q/(1 F)) d -> ground
  D: dissipator(e = 1 ohm*f) d -> ground
  state Q""",
    )
)


@pytest.mark.parametrize("formulation", FOUR)
@pytest.mark.one_in(5)
def test_an_integral_that_the_model_reads_jumps_by_the_charge_that_passes_at_once(tmp_path, formulation):
    """2 V more over 2/3 F: 4/3 C.  It was refused, where its rate was no pulse of its own it stayed."""
    found = _run(READ, tmp_path, formulation=formulation)
    at = np.flatnonzero(np.abs(found.time - 0.2) < 1e-9)
    before, behind = found["D"].values[at[[0, -1]]]
    assert abs(abs(behind - before) - 4.0 / 3.0) < 1e-6


def test_an_integral_that_the_model_reads_and_whose_rate_is_curved_is_refused_where_it_would_jump(tmp_path):
    text = READ.replace("Q' = V.f", "Q' = V.f*(2 + Q/(1 C))")
    with pytest.raises(api.SolverFailure, match=r"pulsed.*unknown Q"):
        _run(text, tmp_path, formulation="lagrangian")


SUMS = {
    "springs side by side": """\
  node x0, x1, x2: translation
  M0: kinetic(p = 2 kg*f) x0
  K0: potential(e = 37 N/m*q) x0 -> x2
  M1: kinetic(p = 2 kg*f) x1
  D1: dissipator(e = 2 N.s/m*f) x1 -> x2
  M2: kinetic(p = 2 kg*f) x2
  K2: potential(e = 44 N/m*q) x2 -> x0
  Q: flow(f = (if t < 0.2 s then 2 m/s else 3 m/s)) x2 -> ground""",
    "a damper between masses": """\
  node x0, x1: translation
  M0: kinetic(p = 2 kg*f) x0
  D0: dissipator(e = 4 N.s/m*f) x0 -> x1
  M1: kinetic(p = 1 kg*f) x1
  D1: dissipator(e = 3 N.s/m*f) x1 -> ground
  Q: flow(f = (if t < 0.2 s then -1 m/s else 2 m/s)) x0 -> ground""",
    "two sources": """\
  node x0, x1: translation
  M0: kinetic(p = 3 kg*f) x0
  K0: potential(e = 45 N/m*q) x0 -> x1
  M1: kinetic(p = 3 kg*f) x1
  Q: flow(f = (if t < 0.2 s then 3 m/s else -3 m/s)) x0 -> ground
  F: effort(e = (if t < 0.2 s then 2 N else 3 N)) ground -> x1""",
}


@pytest.mark.parametrize("formulation", FOUR)
@pytest.mark.parametrize("case", SUMS)
@pytest.mark.long
def test_what_all_elements_absorb_is_nothing(tmp_path, case, formulation):
    """Runs of the complementary formulations leave momenta out that nothing reads: pulses are told by their rows."""
    labels = [line.split(":")[0].strip() for line in SUMS[case].splitlines()[1:]]
    traced = " + ".join(f"{label}.energy" for label in labels)
    scene = f"scene s of m {{ time 0 s to 0.5 s; trace {traced} as sum, Q.energy as Q every 10 ms }}"
    text = f"model m {{\n{SUMS[case]}\n}}\n{scene}\n"
    found = _run(text, tmp_path, formulation=formulation, accuracy=1e-6)
    size = np.abs(found["Q"].values).max()
    assert size > 5.0
    assert np.abs(found["sum"].values).max() < 1e-5 * size


TABLE = """\
model m {
  node b, x: translation
  Q: flow(f = 1 m/s*cos(10*t/(1 s))) b -> ground
  M: kinetic(p = 2 kg*f) x
  F: effort(e = 20 N) x -> ground
  init x.q = 0.5 m
  init x.f = 0 m/s
  phi c: x.q - b.q >= 0 m restitution 0.7
}
scene s of m { time 0 s to 3 s
  trace Q.energy as EQ, M.energy as EM, F.energy as EF, b.f as vb, x.f as vx every 10 ms; accuracy 1e-6 }
"""


@pytest.mark.parametrize("method", ["radau", "bdf"])
@pytest.mark.parametrize("formulation", FOUR[:2])
@pytest.mark.long
def test_a_table_that_is_struck_many_times_does_the_work_of_each_impact(tmp_path, formulation, method):
    """The core takes such impacts by itself only where no integral gains by them: 3.6 J were missing of 7.9 J lost."""
    trace = _run(TABLE, tmp_path, formulation=formulation, method=method)
    t, table, ball = trace.time, trace["vb"].values, trace["vx"].values
    struck = np.flatnonzero(np.diff(t) == 0.0)
    assert struck.size > 30
    lost = np.sum((ball[struck] - table[struck]) ** 2 - (ball[struck + 1] - table[struck + 1]) ** 2)
    assert abs(sum(_last(trace, "EQ", "EM", "EF")) + lost) <= 1e-5 * lost


@pytest.mark.parametrize("formulation", FOUR)
@pytest.mark.long
def test_what_is_sampled_at_the_start_counts(tmp_path, formulation):
    """Two capacitors that a sample charges at once: what sources gave is what stores and resistors have."""
    source = "discrete u = 1 V; every 10 ms { u := 4 V - u }; V: effort(e = u) a -> ground"
    text = VOLTAGE.replace("V: effort(e = (if t < 0.2 s then 1 V else 3 V)) a -> ground", source)
    trace = _run(text, tmp_path, formulation=formulation)
    total = sum(trace[name].values for name in ("EV", "E1", "E2", "ER"))
    assert np.abs(trace["EV"].values).max() > 2.0
    assert np.abs(total).max() <= 1e-6
