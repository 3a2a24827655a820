"""Laws without a slope at rest: what cannot start there says so, with what would; radau and bdf pass."""

import math

import pytest
from scipy.integrate import solve_ivp
from sysdyn.cli.main import run
from sysdyn.runtime.model.failures import RowLabel
from sysdyn.runtime.model.slopes import no_slope
from sysdyn.runtime.trace.trace import Trace

VESSELS = """
from std.fluid import tank, valve
model vessels {{
  node a, b: hydraulic
  A: tank(A = 1 m^2) a
  B: tank(A = 1 m^2) b
  O: {law} a -> b
  into: flow(f = 0.1 l/s^2*t) ground -> a
  init a.e = 1e4 Pa
  init b.e = {b}
}}
scene s of vessels {{
  time 0 s to 10 s
  trace O.f as f, a.e, b.e
}}
"""
TURBULENT = "valve(Cr = 1e11 Pa.s^2/m^6)"
LAMINAR = "dissipator(e = 1e11 Pa.s^2/m^6*f*hypot(f, 1e-6 m^3/s))"


def simulated(tmp_path, capsys, law, *options, b="1e4 Pa"):
    (tmp_path / "m.sd").write_text(VESSELS.format(law=law, b=b))
    code = run(["simulate", str(tmp_path / "m.sd"), "-o", str(tmp_path / "t.h5"), *options])
    return code, capsys.readouterr().err


@pytest.mark.parametrize("formulation", ["lagrangian", "hamiltonian", "co_lagrangian", "co_hamiltonian"])
@pytest.mark.one_in(2)
def test_valves_side_by_side_pass_nothing_at_rest(tmp_path, capsys, formulation):
    """None says how much of it the other passes: no slope does, and the laws do, for they are monotone.  A pump that
    starts later: 5 l/s through 1/sqrt(Cr) of both is a head of 360 Pa, between vessels that hold 1.9 m^3 more.
    """
    text = VESSELS.format(law="valve(Cr = 4e7 Pa.s^2/m^6)", b="1e4 Pa").replace("0 s to 10 s", "0 s to 200 s")
    text = text.replace("  into:", "  W: valve(Cr = 9e7 Pa.s^2/m^6) a -> b\n  into:")
    text = text.replace("0.1 l/s^2*t", "10 l/s*smoothstep((t - 10 s)/(5 s))")
    (tmp_path / "m.sd").write_text(text)
    asked = "--formulation", formulation, "--accuracy", "1e-6", "-o", str(tmp_path / "t.h5")
    assert run(["simulate", str(tmp_path / "m.sd"), *asked]) == 0, capsys.readouterr().err
    trace, weight = Trace.open(tmp_path / "t.h5"), 9806.65
    mean, head = 1e4 + 0.5 * weight * 0.01 * (200.0 - 12.5), (0.005 / (4e7**-0.5 + 9e7**-0.5)) ** 2
    assert trace["a.e"].values[-1] == pytest.approx(mean + 0.5 * head, rel=1e-6)
    assert trace["b.e"].values[-1] == pytest.approx(mean - 0.5 * head, rel=1e-6)
    assert trace["f"].values[0] == 0.0


@pytest.mark.parametrize(
    ("formulation", "method", "code"),
    [("lagrangian", "dopri", "E607"), ("co_lagrangian", "dopri", "E607"), ("co_lagrangian", "rosenbrock", "E931")],
)
@pytest.mark.one_in(2)
def test_a_method_that_needs_the_slope_of_a_flat_law_says_so(tmp_path, capsys, formulation, method, code):
    """No function is outside its domain (E933), and no inertia is missing."""
    exit_, said = simulated(tmp_path, capsys, TURBULENT, "--formulation", formulation, "--method", method)
    assert exit_ in (1, 3)
    assert f"error {code}" in said
    assert "no slope at this state" in said
    assert "radau" in said
    assert "hypot" in said
    assert "E933" not in said


@pytest.mark.parametrize("formulation", ["lagrangian", "co_lagrangian"])
@pytest.mark.long
def test_the_remedies_hold(tmp_path, capsys, formulation):
    """Other methods from rest; a laminar part; a start in motion."""
    found = []
    for law, method in ((TURBULENT, "radau"), (TURBULENT, "bdf"), (LAMINAR, "dopri"), (LAMINAR, "rosenbrock")):
        exit_, said = simulated(tmp_path, capsys, law, "--formulation", formulation, "--method", method)
        assert exit_ == 0, (law, method, said)
        found.append(float(Trace.open(tmp_path / "t.h5")["f"].values[-1]))
    assert found == pytest.approx([found[0]] * 4, rel=1e-3)
    exit_, said = simulated(tmp_path, capsys, TURBULENT, "--formulation", formulation, "--method", "dopri", b="9e3 Pa")
    assert exit_ == 0, said


@pytest.mark.parametrize("formulation", ["lagrangian", "co_lagrangian"])
@pytest.mark.parametrize("law", ["e = 1e5 Pa.s^2/m^6*abs(f)*f", "f = sign(e)*sqrt(abs(e)/(1e5 Pa.s^2/m^6))"])
@pytest.mark.long
def test_a_start_from_which_no_rate_follows_is_one(tmp_path, capsys, law, formulation):
    """The flow grows as the root of time: the equations hold at the start, a rate of it there is none."""
    (tmp_path / "m.sd").write_text(f"""model m {{
  node a, b: hydraulic
  P: effort(e = 1e5 Pa*sin(t/(1 s))) a
  R: dissipator({law}) a -> b
  C: potential(e = 1e4 Pa/m^3*q) b
  init C.e = 0 Pa
}}
scene s of m {{ time 0 s to 10 s; trace C.e }}
""")
    given = ["--formulation", formulation, "-o", str(tmp_path / "t.h5")]
    assert run(["simulate", str(tmp_path / "m.sd"), *given]) == 0, capsys.readouterr().err
    expected = filled(lambda e, t: rooted((1e5 * math.sin(t) - e) / 1e5), 1e4, 10.0)
    assert Trace.open(tmp_path / "t.h5")["C.e"].values[-1] == pytest.approx(expected, rel=1e-3)


@pytest.mark.parametrize("formulation", ["lagrangian", "hamiltonian", "co_lagrangian", "co_hamiltonian"])
@pytest.mark.parametrize("source", ["flow(f = 1 l/s) ground -> a", "valve(Cr = 1e9 Pa.s^2/m^6) p -> a"])
@pytest.mark.one_in(5)
def test_an_empty_vessel_over_a_valve_fills(tmp_path, capsys, source, formulation):
    """What the valve passes at no pressure has no rate; the pressure of the vessel has."""
    supplied = "node p: hydraulic; P: effort(e = 1 bar) p" if "p ->" in source else ""
    (tmp_path / "m.sd").write_text(f"""
from std.fluid import tank, valve
model m {{
  node a: hydraulic
  {supplied}
  into: {source}
  T: tank(A = 0.1 m^2) a
  out: valve(Cr = 1e9 Pa.s^2/m^6) a
  init T.store.e = 0 Pa
}}
scene s of m {{ time 0 s to 1 s; trace a.e, out.f }}
""")
    given = ["--formulation", formulation, "-o", str(tmp_path / "t.h5")]
    assert run(["simulate", str(tmp_path / "m.sd"), *given]) == 0, capsys.readouterr().err
    trace = Trace.open(tmp_path / "t.h5")
    flow = (lambda e: rooted((1e5 - e) / 1e9)) if supplied else lambda e: 1e-3
    expected = filled(lambda e, t: flow(e) - rooted(e / 1e9), 1000 * 9.80665 / 0.1, 1.0)
    assert trace["a.e"].values[-1] == pytest.approx(expected, rel=1e-4)
    assert trace["out.f"].values[-1] == pytest.approx(rooted(expected / 1e9), rel=1e-4)


@pytest.mark.parametrize(
    ("formulation", "method", "code"),
    [("lagrangian", "dopri", "E607"), ("lagrangian", "rosenbrock", "E931"), ("co_lagrangian", "dopri", "E607")],
)
@pytest.mark.one_in(2)
def test_the_element_is_named_not_the_balance_that_holds_it(tmp_path, capsys, formulation, method, code):
    """R and C are in series: one balance holds both."""
    (tmp_path / "m.sd").write_text("""model m {
  node a, b: hydraulic
  P: effort(e = 1e5 Pa*sin(t/(1 s))) a
  R: dissipator(e = 1e5 Pa.s^2/m^6*abs(f)*f) a -> b
  C: potential(e = 1e4 Pa/m^3*q) b
  init C.e = 0 Pa
}
scene s of m { time 0 s to 10 s; trace R.f }
""")
    given = ["--formulation", formulation, "--method", method, "-o", str(tmp_path / "t.h5")]
    assert run(["simulate", str(tmp_path / "m.sd"), *given]) in (1, 3)
    said = capsys.readouterr().err
    assert f"error {code}" in said
    assert "the law at R has no slope" in said


def test_an_accuracy_that_a_flat_law_costs_is_told_by_it(tmp_path, capsys):
    """Rosenbrock passes the start in Lagrange's form, and misses behind it."""
    asked = "--formulation", "lagrangian", "--method", "rosenbrock", "--accuracy", "1e-5"
    exit_, said = simulated(tmp_path, capsys, TURBULENT, *asked)
    assert exit_ == 3
    assert "error E920" in said
    assert "the law at O has no slope at the start" in said
    assert "help: --method radau, bdf or auto" in said


def rooted(x):
    return math.copysign(math.sqrt(abs(x)), x)


def filled(flow, stiffness, end):
    """The pressure of an empty vessel in the end, by SciPy."""
    rates = lambda t, e: [stiffness * flow(e[0], t)]  # noqa: E731
    return solve_ivp(rates, (0.0, end), [0.0], method="Radau", rtol=1e-9, atol=1e-3).y[0, -1]


def test_a_law_that_is_steep_but_has_a_slope_is_none_of_these(tmp_path, capsys):
    """The exponential of a diode, which the values contradict: the reason said is that."""
    (tmp_path / "m.sd").write_text("""from std.electrical import diode, resistor, voltage
model m {
  node a, b: electrical
  V: voltage(v = 5 V) a
  D: diode() a -> b
  R: resistor(R = 1 kohm) b -> ground
  init D.e = 3 V
}
scene s of m { time 0 s to 1 ms; trace D.e }
""")
    assert run(["simulate", str(tmp_path / "m.sd")]) in (1, 3)
    assert "no slope" not in capsys.readouterr().err


@pytest.mark.parametrize("law", ["f*abs(f)", "f*abs(f) + 1e8 s/m^3*f^3"])
@pytest.mark.one_in(2)
def test_what_a_slope_does_at_rest_is_told(tmp_path, capsys, law):
    given = ["--formulation", "co_lagrangian", "--method", "dopri"]
    exit_, said = simulated(tmp_path, capsys, f"dissipator(e = 1e11 Pa.s^2/m^6*({law}))", *given)
    assert exit_ in (1, 3), said
    assert "no slope at this state (it vanishes where nothing flows)" in said


def test_what_a_slope_does_is_said_where_it_is_known_of_all():
    falls, rises = RowLabel("A.law", slope="vanishes"), RowLabel("B", slope="grows without bound")
    assert "the law at A has no slope at this state (it vanishes where" in no_slope((falls,))
    assert "the law at B has no slope at the start (it grows without bound where" in no_slope((rises,), "the start")
    for unknown in ((falls, rises), (RowLabel("C"),)):
        assert "(it vanishes, or grows without bound, where nothing flows)" in no_slope(unknown)


@pytest.mark.parametrize("formulation", ["lagrangian", "co_lagrangian"])
def test_a_vessel_that_runs_empty_names_the_law_that_is_flat_there(tmp_path, capsys, formulation):
    """A square law: the slope vanishes as the flow does (E930 of a tank without a reason, or 'grows without bound')."""
    (tmp_path / "m.sd").write_text("""from std.fluid import tank, valve
model vessel {
  node a: hydraulic
  A: tank(A = 1 m^2) a
  O: valve(Cr = 1e11 Pa.s^2/m^6) a -> ground
  init a.e = 1e4 Pa
}
scene s of vessel { time 0 s to 3 h; trace a.e }
""")
    given = ["--formulation", formulation, "--method", "dopri", "-o", str(tmp_path / "t.h5")]
    assert run(["simulate", str(tmp_path / "m.sd"), *given]) == 3
    said = capsys.readouterr().err
    assert "error E931" in said
    assert "the law at O has no slope at this state (it vanishes where nothing flows)" in said
    assert "m.sd:5" in said
    assert "--method radau, bdf or auto" in said
    assert run(["simulate", str(tmp_path / "m.sd"), *given, "--method", "radau"]) == 0
