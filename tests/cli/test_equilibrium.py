"""`sysdyn equilibrium`: states of rest against closed forms and scipy's roots, their stability."""

from types import SimpleNamespace

import numpy as np
import pytest
from scipy.optimize import brentq
from sysdyn import api
from sysdyn.cli.analysis import resting
from sysdyn.cli.main import run
from sysdyn.cli.progress import SEARCH, ProgressLine
from sysdyn.cli.run.request.run_request import RunRequest
from sysdyn.dsl.text.diagnostics import Report
from sysdyn.runtime.linear import rest
from texts import ROOT, run_json, write

SEED = ROOT / "models" / "seed"
PRIMAL = ("lagrangian", "hamiltonian")


def rests(capsys, path, *options, code=0):
    exit_code, found = run_json(capsys, "equilibrium", str(path), "--backend", "numpy", *options)
    assert exit_code == code, found["diagnostics"]
    return found["result"]["equilibria"]


def by(found, name):
    return sorted(found, key=lambda e: e["values"][name])


@pytest.mark.parametrize("formulation", PRIMAL)
@pytest.mark.long
def test_a_pendulum_hangs_or_stands(formulation, capsys):
    found = by(rests(capsys, SEED / "pendulum.sd", "--formulation", formulation), "q2")
    assert [e["values"]["q2"] for e in found] == pytest.approx([-2.34, 2.34], rel=1e-12)
    assert [e["values"]["q1"] for e in found] == pytest.approx([0.0, 0.0], abs=1e-12)
    # reaction: q2 row, m g + 2 kappa q2 = 0
    assert [e["values"]["rod.multiplier"] for e in found] == pytest.approx(1.13 * 9.81 / 2 / np.array([2.34, -2.34]))
    assert [e["stability"] for e in found] == ["stable", "unstable"]
    assert [e["energy"] for e in found] == ["minimum", "maximum"]
    assert found[0]["by"] == "energy"
    # on unit displacements along the circle: 2 kappa
    assert found[0]["stiffness"] == pytest.approx([1.13 * 9.81 / 2.34], rel=1e-10)
    assert found[0]["conservative"] is True


DUFFING = """
model duffing {
  param m = 2 kg
  param c = 0.3 N.s/m
  param k = -8 N/m
  param k3 = 2 N/m^3
  coord x: translation = 0.1 m
  energy T* = 1/2*m*x'^2
  energy V = 1/2*k*x^2 + 1/4*k3*x^4
  content D = 1/2*c*x'^2
}
"""


@pytest.mark.parametrize(("c", "wells"), [("0.3", "asymptotically stable"), ("0", "stable"), ("-0.1", "unstable")])
@pytest.mark.long
def test_a_double_well(c, wells, tmp_path, capsys):
    found = by(rests(capsys, write(tmp_path, DUFFING), "--set", f"c={c}"), "x")
    assert [e["values"]["x"] for e in found] == pytest.approx([-2.0, 0.0, 2.0], abs=1e-12)
    assert [e["stability"] for e in found] == [wells, "unstable", wells]
    middle, well = (np.roots([2.0, float(c), k]) for k in (-8.0, -8.0 + 3 * 2.0 * 4.0))
    for e, expected in ((found[1], middle), (found[0], well)):
        theirs = sorted(expected, key=lambda v: (v.real, v.imag))
        ours = sorted((complex(*v) for v in e["eigenvalues"]), key=lambda v: (v.real, v.imag))
        assert ours == pytest.approx(theirs, rel=1e-10, abs=1e-10)


DIODE = """
model diode {
  param E = 5 V
  param R = 220 ohm
  param Is = 1e-12 A
  param vT = 25.85 mV
  param C = 1 uF
  node s, a: electrical
  supply: effort(e = E) s -> ground
  r: dissipator(e = R*f) s -> a
  d: dissipator(f = Is*(exp(e/vT) - 1)) a -> ground
  c: potential(q = C*e) a -> ground
}
"""


@pytest.mark.parametrize("formulation", [*PRIMAL, "co_lagrangian", "co_hamiltonian"])
@pytest.mark.long
def test_the_operating_point_of_a_diode(formulation, tmp_path, capsys):
    (found,) = rests(capsys, write(tmp_path, DIODE), "--formulation", formulation)
    current = lambda v: 1e-12 * (np.exp(v / 0.02585) - 1.0)  # noqa: E731
    v = brentq(lambda v: (5.0 - v) / 220.0 - current(v), 0.0, 1.0, xtol=1e-15)
    assert found["efforts"] == pytest.approx({"s": 5.0, "a": v}, rel=1e-9)
    slope = 1 / 220 + (current(v) + 1e-12) / 0.02585
    eigenvalues = [complex(*e) for e in found["eigenvalues"] if abs(complex(*e)) > 1.0]
    assert eigenvalues == pytest.approx([-slope / 1e-6], rel=1e-9)
    assert found["stability"] == "asymptotically stable"


def test_a_diode_at_its_voltage(tmp_path, capsys):
    """The operating point itself, by what the linearisation says of it."""
    options = ("--equilibrium", "--inputs", "E", "--outputs", "d.e,d.f", "--backend", "numpy")
    code, found = run_json(capsys, "linearize", str(write(tmp_path, DIODE)), *options)
    assert code == 0
    v = brentq(lambda v: (5.0 - v) / 220.0 - 1e-12 * (np.exp(v / 0.02585) - 1.0), 0.0, 1.0, xtol=1e-15)
    resistance = 0.02585 / (1e-12 * np.exp(v / 0.02585))
    by_voltage, by_current = found["result"]["transfer"]
    assert by_voltage["static"] == pytest.approx(resistance / (resistance + 220.0), rel=1e-9)
    assert by_current["static"] == pytest.approx(1.0 / (resistance + 220.0), rel=1e-9)


@pytest.mark.long
def test_levitation_rests_where_the_magnet_bears_the_load(capsys):
    found = by(rests(capsys, SEED / "em_suspension.sd"), "x")
    gap = 4.42 / 5.0 * np.sqrt(0.004 / (2 * 19.62))
    assert [e["values"]["x"] + 0.01 for e in found] == pytest.approx([-gap, gap], rel=1e-9)
    assert {e["stability"] for e in found} == {"unstable"}
    assert found[1]["values"]["q2'"] == pytest.approx(4.42 / 5.0, rel=1e-12)
    assert found[1]["energy"] is None  # a current flows


def test_a_motor_turns_steadily(capsys):
    (found,) = rests(capsys, SEED / "dc_motor.sd")
    speed = 0.25 * 12.0 / (0.8 * 0.005 + 0.25**2)
    assert found["values"]["shaft'"] == pytest.approx(speed, rel=1e-12)
    assert found["stability"] == "asymptotically stable"


@pytest.mark.long
def test_four_rests_of_a_double_pendulum(capsys):
    found = rests(capsys, SEED / "two_link_arm.sd")
    angles = {tuple(np.round(np.sin([e["values"]["th1"], e["values"]["th2"]])).astype(int)): e for e in found}
    assert len(found) == len(angles) == 4
    assert angles[-1, -1]["stability"] == "stable"
    assert {angles[k]["stability"] for k in ((1, 1), (1, -1), (-1, 1))} == {"unstable"}
    # [V_11, V_22] = -(m1 + m2) g l1 sin th1, -m2 g l2 sin th2
    assert sorted(angles[1, -1]["stiffness"]) == pytest.approx([-2.0 * 9.81, 0.8 * 9.81 * 0.7], rel=1e-10)


def test_redundant_constraints_do_not_disturb(capsys):
    found = by(rests(capsys, SEED / "redundant_pendulum.sd"), "q2")
    assert [e["stability"] for e in found] == ["stable", "unstable"]
    assert found[0]["free"] == ["th"]


@pytest.mark.long
def test_dynamic_variables_alone(tmp_path, capsys):
    """Van der Pol: 0 is unstable, its eigenvalues are those of s^2 - mu s + 1."""
    text = """
    model vdp {
      param mu = 0.5
      param tau = 1 s
      state x: 1 = 0.1
      state y: 1 = 0
      dynamic x' = y/tau
      dynamic y' = (mu*(1 - x^2)*y - x)/tau
    }
    """
    (found,) = rests(capsys, write(tmp_path, text))
    assert found["stability"] == "unstable"
    ours = sorted((complex(*v) for v in found["eigenvalues"]), key=lambda v: v.imag)
    assert ours == pytest.approx(sorted(np.roots([1, -0.5, 1]), key=lambda v: v.imag), rel=1e-10)


SHAFT = """
model drive {
  param J1 = 0.2 kg.m^2
  param J2 = 0.5 kg.m^2
  param k = 30 N.m/rad
  param b = 0.4 N.m.s/rad
  param M = 6 N.m
  coord a, c: rotation
  energy T* = 1/2*J1*a'^2 + 1/2*J2*c'^2
  energy V = 1/2*k*(a - c)^2
  content D = 1/2*b*c'^2
  work M on a
}
"""


@pytest.mark.parametrize("formulation", PRIMAL)
@pytest.mark.one_in(2)
def test_two_wheels_turn_together(formulation, tmp_path, capsys):
    """A driven shaft: speed M/b, twist M/k; one eigenvalue at zero is its angle's, the others decide."""
    (found,) = rests(capsys, write(tmp_path, SHAFT), "--formulation", formulation)
    assert [found["values"][n] for n in ("a'", "c'")] == pytest.approx([15.0, 15.0], rel=1e-10)
    assert found["values"]["a"] - found["values"]["c"] == pytest.approx(0.2, rel=1e-10)
    assert found["stability"] == "asymptotically stable"
    assert found["free"] == ["a", "c"]
    # J1 s^2 a = -k (a - c),  J2 s^2 c = k (a - c) - b s c
    expected = np.roots([0.2 * 0.5, 0.2 * 0.4, 30 * 0.7, 30 * 0.4])
    ours = [complex(*v) for v in found["eigenvalues"] if abs(complex(*v)) > 1e-9]
    assert len(ours) == 3
    for value in expected:
        assert min(abs(v - value) for v in ours) < 1e-9


FREE = """
model free_mass {
  param m = 1 kg
  input F: N = 1 N
  coord x: translation = 0 m
  energy T* = 1/2*m*x'^2
  work F on x
}
"""


def test_what_has_no_rest_says_so(tmp_path, capsys):
    assert rests(capsys, write(tmp_path, FREE), code=3) == []
    assert run(["equilibrium", str(write(tmp_path, FREE)), "--backend", "numpy", "--quiet"]) == 3
    assert "no state of rest was found" in capsys.readouterr().err


def test_a_free_mass_goes_on_and_is_not_called_stable(tmp_path, capsys):
    (found,) = rests(capsys, write(tmp_path, FREE), "--set", "F=0")
    assert found["stability"] == "undecided"
    assert found["free"] == ["x'"]


@pytest.mark.long
def test_the_table(tmp_path, capsys):
    assert run(["equilibrium", str(write(tmp_path, DUFFING)), "--backend", "numpy"]) == 0
    out, err = capsys.readouterr()
    assert "3 found" in err
    assert out.count("asymptotically stable by the eigenvalues (Lyapunov's indirect method)") == 2
    assert "x = -2" in out


def test_what_a_scene_measures_is_no_rest_left_open(tmp_path, capsys):
    model = """model m {
  node x: translation
  F: effort(e = 2 N) ground -> x
  M: kinetic(p = 1 kg*f) x
  S: potential(e = 4 N/m*q) x
  D: dissipator(e = 1 N.s/m*f) x
}
scene s of m { time 0 s to 1 s; trace S.energy, D.energy, F.energy }
"""
    (found,) = rests(capsys, write(tmp_path, model))
    assert (found["free"], found["stability"]) == ([], "asymptotically stable")
    assert found["values"] == pytest.approx({"x": 0.5, "x'": 0.0})


def test_a_long_search_says_how_far_it_is(tmp_path, monkeypatch):
    told = []
    path = write(tmp_path, DUFFING)
    clock = iter(np.arange(0.0, 1e4, 2.0))
    monkeypatch.setattr(resting, "time", SimpleNamespace(monotonic=lambda: float(next(clock))))
    found = resting.equilibria(RunRequest(str(path)), 9, Report(), lambda done, left: told.append((done, left)))
    assert found is not None
    assert [done for done, _ in told] == [k / 10 for k in range(10)]
    for k, (_, left) in list(enumerate(told))[1:]:  # one look a point: 2 s each, and as many as are left
        assert left == pytest.approx(2.0 * (10 - k))


def test_a_search_that_takes_long_names_its_own_option(capsys):
    ProgressLine("auto", SEARCH)(0.01, 7200.0)
    assert capsys.readouterr().err == "about 2.0 h of search lie ahead: fewer --tries would shorten it\n"


GAP = """model two {
  param F = 40 N
  coord x: translation = 0 m
  coord y: translation = 1 m
  energy T* = 1/2*(1 kg)*x'^2 + 1/2*(2 kg)*y'^2
  energy V = 1/2*(10 N/m)*x^2 + 1/2*(20 N/m)*(y - 1 m)^2
  content D = 1/2*(1 N.s/m)*(x'^2 + y'^2)
  work F on x
  phi gap: y - x >= 0 m
  init x' = 0 m/s
  init y' = 0 m/s
}
scene s of two { time 0 s to 1 s; trace x, y }
"""


def test_a_rest_does_not_pass_through_a_stop(tmp_path, capsys):
    """Open up to 10 N, where x = F/10; closed both move as one: 30 x = F + 20, mass 3, drag 2, stiffness 30."""
    (found,) = rests(capsys, write(tmp_path, GAP))
    assert found["contacts"] == {"gap": "holds"}
    assert [found["values"][name] for name in ("x", "y")] == pytest.approx([2.0, 2.0], rel=1e-9)
    values = np.array(found["eigenvalues"])
    np.testing.assert_allclose(np.sort(values[:, 1]), np.sqrt(10.0 - 1.0 / 9.0) * np.array([-1.0, 1.0]), rtol=1e-9)
    (found,) = rests(capsys, write(tmp_path, GAP), "--set", "F=4")
    assert found["contacts"] == {"gap": "free"}
    assert [found["values"][name] for name in ("x", "y")] == pytest.approx([0.4, 1.0], rel=1e-9)


@pytest.mark.parametrize(("friction", "rest"), [("abs(x')", (0.25, 0.0)), ("hypot(x', y')", (0.15, 0.2))])
def test_a_rest_with_dry_friction_sticks(tmp_path, capsys, friction, rest):
    """From (0.6, 0.8) m, where the springs of 4 N/m pull with 4 N: nearest within the bound of 1 N."""
    y = 0.8 if "y" in friction else 0.0
    text = f"""model m {{
  coord x: translation = {0.6 if y else 1.0} m
  coord y: translation = {y} m
  energy T* = 1/2*(1 kg)*(x'^2 + y'^2)
  energy V = 1/2*(4 N/m)*(x^2 + y^2)
  content D = (1 N)*{friction}
  init x' = 0 m/s
  init y' = 0 m/s
}}
scene s of m {{ time 0 s to 1 s; trace x, y }}
"""
    (found,) = rests(capsys, write(tmp_path, text), "--tries", "0")
    assert list(found["contacts"].values()) == ["sticks"]
    assert (found["values"]["x"], found["values"]["y"]) == pytest.approx(rest, abs=1e-9)
    assert "x" in found["free"]
    assert not any(abs(im) > 1e-9 for _, im in found["eigenvalues"]) or "y" not in friction


def test_what_only_a_sign_depends_on_does_not_grow_for_ever(tmp_path, capsys):
    """x' = 0.3 - sign(x) is never zero; b' = a and z' = step(a) are quadratures."""
    text = """model relay {
  state x: 1 = 1
  dynamic x' = (0.3 - sign(x))/(1 s)
}
scene s of relay { time 0 s to 1 s; trace x }
"""
    assert rests(capsys, write(tmp_path, text), "--tries", "3", code=3) == []
    text = """model sums {
  state a: 1 = 1
  state b: 1 = 0
  state z: 1 = 0
  dynamic a' = (1 - a)/(1 s)
  dynamic b' = a/(1 s)
  dynamic z' = step(a - 0.5)/(1 s)
}
scene s of sums { time 0 s to 1 s; trace a }
"""
    (found,) = rests(capsys, write(tmp_path, text), "--tries", "3")
    assert found["free"] == ["b", "z"]


def test_a_state_that_a_sample_would_change_is_no_rest(tmp_path, capsys):
    """x' = u - x + 0.5 with u held at 0 would rest at 0.5 m; sampled u = -2 x rests at 1/6 m."""
    text = """model sampled {
  param u0 = 0 m/s
  state x: m = 1 m
  discrete u: m/s = u0
  dynamic x' = u - x/(1 s) + 0.5 m/s
  every 10 ms { u := -2 s^-1*x }
}
scene s of sampled { time 0 s to 1 s; trace x }
"""
    path = write(tmp_path, text)
    assert rests(capsys, path, "--tries", "0", code=3) == []
    assert run(["equilibrium", str(path), "--backend", "numpy", "--tries", "0"]) == 3
    assert "'every 10 ms' sets u from 0 to -1" in capsys.readouterr().err
    (found,) = rests(capsys, path, "--tries", "0", "--set", "u0=-1/3*(1 m/s)")
    assert found["values"]["x"] == pytest.approx(1.0 / 6.0)
    assert found["stability"] is None
    assert run(["linearize", str(path), "--backend", "numpy"]) == 0
    assert "events do not act: u held" in capsys.readouterr().err


def test_a_block_on_a_running_belt_rests_where_it_slips(tmp_path, capsys):
    """Its spring of 40 N/m holds the 2 N with which the belt rubs; beside it the friction is constant."""
    text = """model belt {
  coord x: translation = 0 m
  energy T* = 1/2*(1 kg)*x'^2
  energy V = 1/2*(40 N/m)*x^2
  content D = (2 N)*abs(x' - 0.5 m/s) + 1/2*(1 N.s/m)*x'^2
  init x' = 0 m/s
}
scene s of belt { time 0 s to 1 s; trace x }
"""
    (found,) = rests(capsys, write(tmp_path, text), "--tries", "0")
    assert found["values"]["x"] == pytest.approx(0.05, rel=1e-9)
    assert found["stability"] == "asymptotically stable"
    np.testing.assert_allclose(np.array(found["eigenvalues"])[:, 0], -0.5, rtol=1e-9)


def test_what_nothing_depends_on_makes_no_two_rests_of_one_in_large_models_either(tmp_path, capsys, monkeypatch):
    """b' = a - 1 m/s: wherever b is.  Large models are not asked what their rows leave open."""
    monkeypatch.setattr(rest, "DENSE", 0)
    text = """model sums {
  state a: m/s = 3 m/s
  state b: m = 2 m
  dynamic a' = (1 m/s - a)/(1 s)
  dynamic b' = a - 1 m/s
}
scene s of sums { time 0 s to 1 s; trace a }
"""
    (found,) = rests(capsys, write(tmp_path, text), "--tries", "5")
    assert found["values"] == pytest.approx({"a": 1.0, "b": 2.0})


@pytest.mark.long
def test_large_models_are_not_tried_at_random_points(tmp_path, capsys, monkeypatch):
    path = write(tmp_path, DUFFING)
    assert len(rests(capsys, path)) == 3
    monkeypatch.setattr(rest, "MANY", 1)
    assert len(rests(capsys, path)) == 1


def test_operating_points_are_in_si_for_programs_and_in_their_units_for_people(tmp_path, capsys):
    """A node that the scene traces in bar was 3 among pascals."""
    path = write(
        tmp_path,
        """
model pipes {
  node a, b: hydraulic
  S: effort(e = 3 bar) a -> ground
  R1: dissipator(e = 1e9 Pa.s/m^3*f) a -> b
  R2: dissipator(e = 2e9 Pa.s/m^3*f) b -> ground
  C: potential(e = 1e12 Pa/m^3*q) b -> ground
  init C.q = 0 m^3
}

scene fill of pipes {
  time 0 s to 1 s
  trace a.e in bar
}
""",
    )
    (found,) = rests(capsys, path)
    assert found["efforts"] == pytest.approx({"a": 3e5, "b": 2e5})
    assert run(["equilibrium", path]) == 0
    out = capsys.readouterr().out
    assert "nodes a = 3 bar, b = 200000 Pa" in out
    assert "C = 2e-07 m^3" in out


SHORTED = """
model servo {
  node a, b: electrical
  node w, w2: rotation
  node hot: heat
  U: effort(e = 6 V) a -> ground
  Rw: dissipator(e = 1.2 ohm*(1 + 0.0039 K^-1*(hot.e - 293.15 K))*f) a -> b
  L: kinetic(p = 2 mH*f) b -> ground
  K: gyrator(e1 = 0.05 V.s*f2) b -> ground, w -> ground
  J: kinetic(p = 2e-5 kg.m^2*f) w
  k: potential(e = 0.8 N.m*q + 3 N.m*q^3) w -> w2
  d: dissipator(e = 1e-3 N.m.s*f) w -> w2
  J2: kinetic(p = 5e-5 kg.m^2*f) w2
  T: effort(e = 0.02 N.m) w2 -> ground
  C: potential(q = 15 J/K*e) hot -> ground
  G: flow(f = 0.2 W/K*(hot.e - 293.15 K) + 1e-9 W/K^4*(hot.e^4 - (293.15 K)^4)) hot -> ground
  joule: flow(f = Rw.e*Rw.f) ground -> hot
  init C.e = 300 K
}
scene s of servo { time 0 s to 1 s; trace k.q }
"""


def test_rest_is_not_sought_where_what_is_left_open_hides_the_rows(tmp_path):
    """With heat and angles left open 40 states were told, 39 of them at 1e16 rad: rows held beside that alone."""
    path = tmp_path / "servo.sd"
    path.write_text(SHORTED)
    found = api.equilibria(path)
    assert 1 <= len(found) <= 4
    for state in found:
        hot = state.efforts["hot"][0]
        joule = 36.0 / (1.2 * (1.0 + 0.0039 * (hot - 293.15)))
        lost = 0.2 * (hot - 293.15) + 1e-9 * (hot**4 - 293.15**4)
        assert joule == pytest.approx(lost, rel=1e-6)
        assert abs(state.values["w"]) < 1.0


LADDER = """from std.electrical import capacitor, resistor, voltage
model ladder {
  param n = 400
  node v[0..n]: electrical
  V: voltage(v = 1 V) v[0] -> ground
  for i in 1..n {
    R[i]: resistor(R = 1 ohm) v[i-1] -> v[i]
    C[i]: capacitor(C = 1 mF) v[i] -> ground
    D[i]: dissipator(f = 0.1 ohm^-1*(1 V^-2)*e^3) v[i] -> ground
    init C[i].e = 0 V
  }
}
scene s of ladder { time 0 s to 1 s; trace v[1].e as first, v[2].e as second }
"""


def test_a_long_ladder_of_flat_laws_rests(tmp_path, capsys):
    """At the guess all slopes are zero; backwards v[i - 1] = v[i] + the currents of what follows, from the last on."""

    def ends(last):
        volts, current = [last], 0.0
        while len(volts) < 401 and volts[-1] < 10.0:
            current += 0.1 * volts[-1] ** 3
            volts.append(volts[-1] + current)
        return volts

    last = brentq(lambda v: ends(v)[-1] - 1.0 if len(ends(v)) == 401 else 10.0, 1e-4, 0.1, xtol=1e-18, rtol=1e-14)
    path = write(tmp_path, LADDER)
    (found,) = rests(capsys, path, "--tries", "2")
    volts = ends(last)
    charges = [found["values"][f"C[{k}]"] for k in (1, 2, 400)]
    assert charges == pytest.approx([1e-3 * volts[-2], 1e-3 * volts[-3], 1e-3 * volts[0]], rel=1e-8)
