"""Kane's formulation: without the multipliers of psi, and the same motion and reactions."""

import numpy as np
import pytest
from reduced import ROOT
from reference_values import load
from scipy.integrate import solve_ivp
from sysdyn.api import simulate
from sysdyn.cli.main import run as main
from sysdyn.cli.run.request.run_request import RunRequest
from sysdyn.cli.run.running import run
from sysdyn.dsl.text.diagnostics import Report
from sysdyn.runtime.trace.trace import Trace

REFERENCES = load("references.json")
SKATES = """
model skates {
  param n = 3
  coord x[1..n], y[1..n]: translation
  coord th[1..n]: rotation
  energy T* = sum(i in 1..n: 1/2*i*1 kg*(x[i]'^2 + y[i]'^2) + 1/2*0.4 kg.m^2*th[i]'^2)
  energy V = 1/2*20 N/m*((x[1] - x[2])^2 + (y[2] - y[3])^2)
  for i in 1..n {
    psi edge[i]: sin(th[i])*x[i]' = cos(th[i])*y[i]'
    init x[i] = i*0.1 m
    init y[i] = 0 m
    init th[i] = 0.3*i*1 rad
    init th[i]' = 1 rad/s
    init x[i]' ~ 1 m/s
    init y[i]' ~ 0.3 m/s
  }
}

scene s of skates {
  time 0 s to 3 s
  trace x[1], y[2], th[3], edge[2].multiplier, edge[3].multiplier every 10 ms
}
"""
DRIVEN = """
model belt {
  coord x, z: translation = 0 m
  coord th: rotation = 0 rad
  energy T* = 1/2*2 kg*x'^2 + 1/2*1 kg*z'^2 + 1/2*0.3 kg.m^2*th'^2
  energy V = 1/2*8 N/m*(z - x)^2
  content D = 1/2*0.4 N.m.s/rad*th'^2
  psi slip: x' = 0.2 m/rad*th' + 0.1 m/s*cos(3 rad/s*t)*cos(x*1 rad/m)
  init th' = 2 rad/s
  init x' ~ 0 m/s
  init z' = 0 m/s
}

scene s of belt {
  time 0 s to 4 s
  trace x, th, z, slip.multiplier every 10 ms
}
"""


HELD = """
model rod {
  coord x: translation = 1 m
  coord y: translation = 0 m
  coord th: rotation = 0 rad
  energy T* = 1/2*2 kg*(x'^2 + y'^2) + 1/2*0.3 kg.m^2*th'^2
  energy V = 2 kg*g0*y
  phi rim: x^2 + y^2 = 1 m^2
  psi roll: th' = 2 rad/m*x'*cos(th)
  init y' = 0.3 m/s
  init th' ~ 1 rad/s
}

scene s of rod {
  time 0 s to 2 s
  trace x, y, th, rim.multiplier every 10 ms
}
"""


def simulated(tmp_path, path, formulation, **options):
    report = Report()
    output = tmp_path / f"{formulation}.h5"
    ran = run(RunRequest(str(path), formulation=formulation, output=str(output), **options), report)
    assert ran is not None, [f"{d.code} {d.message}" for d in report]
    assert ran.exit == 0
    return ran, Trace.open(output)


@pytest.mark.parametrize("model", ["knife_edge", "rolling_disk", "em_suspension"])
@pytest.mark.long
def test_reference_values_without_multipliers(tmp_path, model):
    reference = REFERENCES[model]
    options = {"accuracy": 1e-6, "at": ",".join(map(repr, reference["t"])), "scene": "reference", "method": "radau"}
    ran, trace = simulated(tmp_path, ROOT / "models" / "seed" / f"{model}.sd", "kane", **options)
    families = ran.prepared.compiled.form.families
    assert all(f.kind != "mu" for f in families)
    assert ran.outcome.index == "1"
    places = [int(np.argmin(np.abs(trace.time - t))) for t in reference["t"]]
    for name, values in reference["values"].items():
        error = np.max(np.abs(trace[name].values[places] - values)) / np.max(np.abs(values))
        assert error <= 1e-5, name


@pytest.mark.long
def test_a_rolling_rod_is_no_singular_configuration(tmp_path):
    """Its row of slip has the entry 1 everywhere, in momenta as in flows."""
    path = tmp_path / "model.sd"
    path.write_text(HELD)
    ran, _ = simulated(tmp_path, path, "hamiltonian")
    assert (ran.outcome.structure.rank, ran.outcome.structure.singular) == (2, 0)


@pytest.mark.parametrize("text", [SKATES, DRIVEN], ids=["arrays", "rheonomic"])
@pytest.mark.one_in(2)
def test_reactions_on_request(tmp_path, text):
    path = tmp_path / "model.sd"
    path.write_text(text)
    _, lagrange = simulated(tmp_path, path, "lagrangian", accuracy=1e-7)
    ran, kane = simulated(tmp_path, path, "kane", accuracy=1e-7)
    assert "mu" in {f.kind for f in ran.prepared.compiled.form.families}
    for name in lagrange.names:
        wanted = lagrange[name].values
        assert np.max(np.abs(kane[name].values - wanted)) <= 1e-6 * np.max(np.abs(wanted)), name
    assert abs(kane["audit/energy"].values).max() <= 1e-5


BOOST = """
from std.electrical import capacitor, diode, inductor, resistor, switch, voltage
model boost {
  param T = 10 us
  param duty = 0.4
  node in_, sw, out: electrical
  V: voltage(v = 12 V) in_
  L: inductor(L = 10 uH) in_ -> sw
  S: switch(gate = (if mod(t, T) < duty*T then 1 else 0)) sw
  D: diode.complementary() sw -> out
  C: capacitor(C = 10 uF) out
  R: resistor(R = 200 ohm) out
  init L.f = 0 A
  init C.e = 12 V
}
scene reference of boost {
  time 0 s to 200 us
  trace L.f as i, C.e as u every 1 us
}
"""


def boosted(end):
    """Current and voltage of BOOST at its end: switched on for 4 us, then until the current of the coil is over."""
    i, u = 0.0, 12.0
    still = lambda t, y: y[0]  # noqa: E731
    still.terminal, still.direction = True, -1
    for _ in range(round(end / 1e-5)):
        i, u = i + 12.0 / 1e-5 * 4e-6, u * np.exp(-4e-6 / (200.0 * 1e-5))
        rates = lambda t, y: [(12.0 - y[1]) / 1e-5, (y[0] - y[1] / 200.0) / 1e-5]  # noqa: E731
        on = solve_ivp(rates, (4e-6, 1e-5), [i, u], events=still, method="DOP853", rtol=1e-12, atol=1e-12)
        i, u = on.y[:, -1]
        u = u * np.exp(-(1e-5 - on.t[-1]) / (200.0 * 1e-5))
    return i, u


@pytest.mark.parametrize("method", ["radau", "bdf"])
def test_a_converter_whose_current_ends_within_each_period(tmp_path, method):
    """Its one-way valve is read by the condition that it shall open: what shares flows with it is Lagrange's."""
    path = tmp_path / "model.sd"
    path.write_text(BOOST)
    _, kane = simulated(tmp_path, path, "kane", accuracy=1e-6, method=method)
    i, u = boosted(200e-6)
    assert kane["u"].values[-1] == pytest.approx(u, rel=1e-6)
    assert kane["i"].values[-1] == pytest.approx(i, abs=1e-6 * 4.8)
    assert abs(kane["audit/energy"].values).max() <= 1e-8


@pytest.mark.long
def test_displacement_constraints_keep_their_multipliers(tmp_path):
    path = tmp_path / "model.sd"
    path.write_text(HELD)
    _, lagrange = simulated(tmp_path, path, "lagrangian", accuracy=1e-7)
    ran, kane = simulated(tmp_path, path, "kane", accuracy=1e-7, method="radau")
    assert [f.kind for f in ran.prepared.compiled.form.families if f.kind in ("kappa", "mu")] == ["kappa"]
    assert ran.outcome.index == "2"
    assert kane["audit/constraints"].values.max() <= 1e-9
    for name in lagrange.names:
        wanted = lagrange[name].values
        assert np.max(np.abs(kane[name].values - wanted)) <= 1e-6 * np.max(np.abs(wanted)), name


FAMILIES = [
    ("kane", "coord X: translation", "T* = 1/2*1 kg", "m"),
    ("co_kane", "cocoord X: electrical", "V* = 1/2*1 F", "Wb"),
]


@pytest.mark.parametrize(("formulation", "coordinates", "energy", "unit"), FAMILIES)
def test_what_follows_from_others_is_refused_in_its_own_name(tmp_path, formulation, coordinates, energy, unit):
    path = tmp_path / "model.sd"
    path.write_text(f"""model m {{
  {coordinates.replace("X", "x, y, z")}
  energy {energy}*(x'^2 + y'^2 + z'^2)
  psi one: x' = (1 + z^2/(1 {unit}^2))*y'
  psi two: 2*x' = (2 + 2*z^2/(1 {unit}^2))*y'
}}
""")
    asked = {"formulation": formulation, "until": "1", "redundancy": "drop", "output": str(tmp_path / "t.h5")}
    report = Report()
    assert run(RunRequest(str(path), **asked), report) is None
    (found,) = [d for d in report if d.severity == "error"]
    assert found.code == "E607"
    assert "follows from the others" in found.message
    assert f"formulation {formulation}:" in found.message
    others = [formulation.replace("kane", name) for name in ("lagrangian", "hamiltonian")]
    assert found.help == f"formulation {', '.join(others)}"


@pytest.mark.parametrize(("formulation", "coordinates", "energy", "unit"), FAMILIES)
def test_a_constraint_that_joins_elements_of_a_family_keeps_its_multiplier(
    tmp_path, formulation, coordinates, energy, unit
):
    """x' = v1' + v2' of three of mass 1, v1 on a spring of 6: v1'' = -4 v1, v2'' = -v1''/2."""
    spring = "V = 3 N/m" if formulation == "kane" else "T = 3 H^-1"
    path = tmp_path / "model.sd"
    path.write_text(f"""model m {{
  {coordinates.replace("X", "x")}
  {coordinates.replace("X", "v[1..2]")} = [1 {unit}, 0 {unit}]
  energy {energy}*(x'^2 + v[1]'^2 + v[2]'^2)
  energy {spring}*v[1]^2
  psi one: x' = sum(i in 1..2: v[i]')
}}
scene s of m {{
  time 0 s to 2 s
  trace v[1], v[2], x
  solver auto(keep_flow = true)
  accuracy 1e-7
}}
""")
    ran, trace = simulated(tmp_path, path, formulation)
    assert [f.kind for f in ran.prepared.compiled.form.families if f.kind == "mu"] == ["mu"]
    first = np.cos(2.0 * trace.time)
    for name, wanted in (("v[1]", first), ("v[2]", 0.5 * (1.0 - first)), ("x", 0.5 * (first - 1.0))):
        assert np.max(np.abs(trace[name].values - wanted)) <= 1e-6, name


@pytest.mark.parametrize("model", ["lead_filter", "two_tank", "electrical_transformer", "fluid_transformer"])
@pytest.mark.long
def test_the_complementary_form_meets_the_reference_values(tmp_path, model):
    """Balances of flows projected on the efforts that effort constraints leave free."""
    reference = REFERENCES[model]
    options = {"accuracy": 1e-6, "at": ",".join(map(repr, reference["t"])), "scene": "reference"}
    _, trace = simulated(tmp_path, ROOT / "models" / "seed" / f"{model}.sd", "co_kane", **options)
    places = [int(np.argmin(np.abs(trace.time - t))) for t in reference["t"]]
    for name, values in reference["values"].items():
        error = np.max(np.abs(trace[name].values[places] - values)) / np.max(np.abs(values))
        assert error <= 1e-5, name


@pytest.mark.long
def test_the_complementary_form_has_no_multiplier_of_an_effort_constraint(tmp_path):
    """Example 5.3 in momenta: of phi and psi only the momentum constraint keeps its multiplier."""
    reference = REFERENCES["two_tank"]
    times = reference["t"]
    options = {"accuracy": 1e-6, "at": ",".join(map(repr, times)), "scene": "reference"}
    ran, trace = simulated(tmp_path, ROOT / "models" / "book" / "two_tank.sd", "co_kane", **options)
    assert [f.kind for f in ran.prepared.compiled.form.families if f.kind in ("kappa", "mu")] == ["kappa"]
    places = [int(np.argmin(np.abs(trace.time - t))) for t in times]
    for name, state, factor in (("p2", "pb", 1.0), ("p3", "Q", reference["parameters"]["I1"])):
        values = factor * np.array([float(v) for v in reference["state_values"][state]])
        assert np.max(np.abs(trace[name].values[places] - values)) <= 1e-5 * np.max(np.abs(values)), name


def test_without_flow_constraint_and_quasi_velocity_the_flows_are_the_speeds(capsys):
    """Its rows are Lagrange's; `verify` and `trade` do not run one form under two names."""
    path = str(ROOT / "models" / "seed" / "pendulum.sd")
    texts = []
    for formulation in ("lagrangian", "kane"):
        assert main(["equations", path, "--formulation", formulation, "--quiet"]) == 0
        texts.append(capsys.readouterr().out)
    assert texts[0] == texts[1]
    report = Report()
    request = RunRequest(path, scene="reference", formulation="kane", own=True, until="0.01")
    assert run(request, report) is None
    assert [d.code for d in report if d.severity == "error"] == ["E607"]


@pytest.mark.long
def test_where_every_reaction_is_read_verify_runs_lagrange_alone(tmp_path, capsys):
    """The rows are Lagrange's then: their agreement would show nothing.  Where none is read, they are Kane's own."""
    text = """
    model skate {
      coord x, y: translation = 0 m
      coord th: rotation = 0.4 rad
      energy T* = 1/2*(2 kg)*(x'^2 + y'^2) + 1/2*(0.5 kg.m^2)*th'^2
      psi edge: x'*sin(th) = y'*cos(th)
      work 1 N on x
      init x' = 1 m/s
      init th' = 0.7 rad/s
    }
    scene s of skate { time 0 s to 1 s; trace TRACED }
    """
    for traced, alone in (("th, edge.multiplier", True), ("th", False)):
        (tmp_path / "m.sd").write_text(text.replace("TRACED", traced))
        assert main(["verify", str(tmp_path / "m.sd")]) == 0
        said = capsys.readouterr().out
        assert ("\nkane " not in said) is alone
        assert ("not in kane: E607 formulation kane: the same rows as Lagrange's" in said) is alone


SLED = """
model sled {
  param m = 2 kg
  param J = 0.5 kg.m^2
  coord x, y: translation = 0 m
  coord th: rotation = 0
  quasi v: m/s = cos(th)*x' + sin(th)*y'
  quasi om: rad/s = th'
  quasi twice: m/s = 2*v
  energy T* = 1/2*m*(x'^2 + y'^2) + 1/2*J*th'^2
  psi edge: sin(th)*x' - cos(th)*y' = 0
  work 3 N - 0.4 N.s/m*v on quasi(v)
  work 0.25 N.m on quasi(om)
  init x' = 1 m/s
  init th' = 0.5 rad/s
}
scene go of sled {
  time 0 s to 3 s
  accuracy 1e-8
  trace v, om, edge.residual as slip every 0.1 s
}
"""


def test_quasi_velocities_are_the_unknown_speeds(tmp_path, capsys):
    """m v' = F - b v, J om' = M beside f = S u: Kane's equations, no multiplier, no flow's rate; regular where the edge
    points along y.
    """
    path = tmp_path / "sled.sd"
    path.write_text(SLED)
    assert main(["equations", str(path), "--formulation", "kane", "--quiet"]) == 0
    lines = [line.strip() for line in capsys.readouterr().out.splitlines()]
    for wanted in ("f_x = cos(th) v", "f_y = sin(th) v", "f_th = om", "m v' = -0.4 v + 3", "J om' = 1/4"):
        assert wanted in lines, lines
    ran, trace = simulated(tmp_path, path, "kane")
    form = ran.prepared.compiled.form
    assert [f.name for f in form.families if form.is_speed(f)] == ["v", "om"]
    assert "mu" not in {f.kind for f in form.families}
    t = trace.time
    exact = 7.5 - 6.5 * np.exp(-0.2 * t)
    assert np.max(np.abs(trace["v"].values - exact)) <= 1e-7 * 7.5
    assert np.max(np.abs(trace["om"].values - (0.5 + 0.5 * t))) <= 1e-7 * 2
    assert 0.5 * np.pi < 0.5 * 3 + 0.25 * 9  # the heading has passed pi/2
    assert np.max(np.abs(trace["slip"].values)) <= 1e-9


DIMMER = """
from std.electrical import thyristor, resistor, inductor
model dimmer {
  param fired = 60 deg
  let at = mod(t, 20 ms) - fired/(2*pi*50 Hz)
  node a, b, c: electrical
  V: effort(e = 325 V*sin(2*pi*50 Hz*t)) a -> ground
  T: thyristor() gate = (if at > 0 s and at < 1 ms then 1 else 0), a -> b
  R: resistor(R = 20 ohm) b -> c
  L: inductor(L = 60 mH) c -> ground
}
scene s of dimmer { time 0 s to 45 ms; trace L.f as i; accuracy 1e-6; formulation kane }
"""
TWICE = """
model sleds {
  coord x, y: translation = 0 m
  energy T* = 1/2*(1 kg)*x'^2 + 1/2*(2 kg)*y'^2
  work 1 N on x
  psi a: x' = y'
  psi b: 2*x' = 2*y'
}
scene s of sleds {
  time 0 s to 1 s; trace a.multiplier as a, b.multiplier as b
  formulation kane; redundancy minimum_norm
}
"""


def test_rows_that_hold_by_turns_may_follow_from_each_other(tmp_path):
    """A thyristor blocks, or lets pass one way, the same current; two rows of one bond share its force."""
    (tmp_path / "dimmer.sd").write_text(DIMMER)
    at = [0.002, 0.005, 0.009, 0.018, 0.026, 0.033]
    trace = simulate(tmp_path / "dimmer.sd", at=at, output=tmp_path / "o.h5")
    w, fired, late = 100 * np.pi, np.pi / 3, np.arctan2(100 * np.pi * 0.06, 20.0)
    angle = np.mod(w * np.array(at), 2 * np.pi)
    decay = np.exp(-(angle - fired) * 20.0 / (w * 0.06))
    whole = 325 / np.hypot(20.0, w * 0.06) * (np.sin(angle - late) - np.sin(fired - late) * decay)
    expected = np.where(angle > fired, np.maximum(whole, 0.0), 0.0)  # of one sign between fired and a whole turn
    found = trace["i"][np.searchsorted(trace.time, at)]
    assert found == pytest.approx(expected, abs=3e-6 * expected.max())
    (tmp_path / "sleds.sd").write_text(TWICE)
    trace = simulate(tmp_path / "sleds.sd", output=tmp_path / "o.h5")
    assert trace["a"][-1] == pytest.approx(2 / 15, rel=1e-9)
    assert trace["b"][-1] == pytest.approx(4 / 15, rel=1e-9)


BICYCLE = """
model bicycle {
  param a = 0.5 m
  param b = 1.2 m
  coord x, y: translation = 0 m
  coord th: rotation = 0
  input delta: 1 = 0.3*sin(1.5 rad/s*t)
  energy T* = 1/2*(90 kg)*(x'^2 + y'^2) + 1/2*(12 kg.m^2)*th'^2
  psi rear: -x'*sin(th) + y'*cos(th) - a*th' = 0 m/s
  psi front: -x'*sin(th + delta) + y'*cos(th + delta) + (b - a)*th'*cos(delta) = 0 m/s
  work 20 N*cos(th) on x
  work 20 N*sin(th) on y
  init x' = 2 m/s
}
scene s of bicycle {
  time 0 s to 4 s
  trace x, y, th every 50 ms
}
"""


def test_two_edges_of_one_body_leave_a_motion_without_further_factors(tmp_path):
    """The motion that both leave was multiplied by a coefficient that is zero at the start: E516."""

    def rates(t, s):
        th, u = s[2:]
        d, bend = 0.3 * np.sin(1.5 * t), np.tan(0.3 * np.sin(1.5 * t)) / 1.2
        inertia = 90 * (1 + (0.5 * bend) ** 2) + 12 * bend**2
        change = 2 * (90 * 0.25 + 12) * bend * 0.45 * np.cos(1.5 * t) / np.cos(d) ** 2 / 1.2
        side = 0.5 * bend * u
        forward = [u * np.cos(th) - side * np.sin(th), u * np.sin(th) + side * np.cos(th)]
        return [*forward, bend * u, (20 - 0.5 * change * u) / inertia]

    path = tmp_path / "m.sd"
    path.write_text(BICYCLE)
    trace = simulate(path, formulation="kane", accuracy=1e-7, output=tmp_path / "t.h5")
    found = solve_ivp(rates, (0.0, 4.0), [0.0, 0.0, 0.0, 2.0], "DOP853", trace.time, rtol=1e-11, atol=1e-12)
    for name, true in zip(("x", "y", "th"), found.y, strict=False):
        assert np.abs(trace[name].values - true).max() < 1e-6 * np.abs(true).max()


def test_check_counts_the_flow_constraints_whose_reactions_are_left_out(tmp_path, capsys):
    """It said 'm2 0, dof 3' beside a claim dof == 1 that held."""
    path = tmp_path / "m.sd"
    path.write_text(BICYCLE.replace("  time 0 s", "  formulation kane\n  expect static: dof == 1\n  time 0 s"))
    assert main(["check", str(path)]) == 0
    assert "coordinates 3, m1 0, m2 2, dof 1, index 1" in capsys.readouterr().err
