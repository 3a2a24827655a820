"""Quasi-velocities: works along them in every formulation, against closed forms."""

import numpy as np
import pytest
from model_runs import attempt, trace_of
from sysdyn.dsl.format.format import format_text

PRIMAL = ("lagrangian", "hamiltonian", "kane")
SKATE = """
## A skate driven along its edge and in its heading: v = v0 + F*t/m, om = om0 + M*t/J.
model skate {
  param m = 2 kg
  param J = 0.5 kg.m^2
  param F = 3 N
  param M = 0.25 N.m
  coord x, y: translation = 0 m
  coord th: rotation = 0
  quasi v: m/s = cos(th)*x' + sin(th)*y'    # along the edge
  quasi om: rad/s = th'
  energy T* = 1/2*m*(x'^2 + y'^2) + 1/2*J*th'^2
  psi edge: sin(th)*x' - cos(th)*y' = 0
  work F on quasi(v)
  work M on quasi(om)
  init x' = 1 m/s
  init th' = 0.5 rad/s
}
scene go of skate {
  time 0 s to 3 s
  accuracy 1e-8
  trace v, om, x, y, th, audit.supplied as W every 0.1 s
}
"""
DISK = """
## A disk that rolls and steers, driven through the speed of its rim: r*ph' - b*th' does no work sideways.
model disk {
  param M = 1.2 kg
  param Ja = 0.05 kg.m^2
  param Jr = 0.09 kg.m^2
  param r = 0.4 m
  param b = 0.1 m
  param P = 0.6 N
  coord x, y: translation = 0 m
  coord th, ph: rotation = 0
  quasi rim: m/s = r*ph' - b*th'
  energy T* = 1/2*M*(x'^2 + y'^2) + 1/2*Ja*th'^2 + 1/2*Jr*ph'^2
  psi ahead: x' = r*ph'*cos(th)
  psi aside: y' = r*ph'*sin(th)
  work P on quasi(rim)
  init th' = 0.5 rad/s
  init ph' = 2 rad/s
}
scene go of disk {
  time 0 s to 3 s
  accuracy 1e-8
  trace rim, th' as om, ph' as nu, x, y every 0.1 s
}
"""
FREE = """
## No constraint: a point pushed along its own polar angle's arc.
model point {
  param m = 2 kg
  param c = 0.5 N.s/m
  coord x: translation = 1 m
  coord y: translation = 0 m
  quasi arc: m^2/s = x*y' - y*x'
  energy T* = 1/2*m*(x'^2 + y'^2)
  work -(c/(1 m^2))*arc on quasi(arc)
  init x' = 0 m/s
  init y' = 1 m/s
}
scene go of point {
  time 0 s to 1 s
  accuracy 1e-8
  trace arc, x, y every 0.1 s
}
"""


def _near(trace, expected, within=1e-7):
    for name, values in expected.items():
        assert trace[name].values == pytest.approx(values, abs=within * np.abs(values).max()), name


@pytest.mark.parametrize("formulation", PRIMAL)
@pytest.mark.long
def test_a_skate_driven_along_its_edge_and_heading(tmp_path, formulation):
    found = trace_of(tmp_path, SKATE, formulation=formulation)
    t = np.linspace(0.0, 3.0, 31)
    v, om, th = 1 + 1.5 * t, 0.5 + 0.5 * t, 0.5 * t + 0.25 * t**2
    # with th as the variable: x' = v cos(th) and v = 1 + 1.5 t, t = sqrt(1 + 4 th) - 1
    fine = np.linspace(0.0, 3.0, 30001)
    angle, h = 0.5 * fine + 0.25 * fine**2, fine[1]
    rates = (1 + 1.5 * fine) * np.array([np.cos(angle), np.sin(angle)])
    thirds = h / 6 * (rates[:, :-2:2] + 4 * rates[:, 1:-1:2] + rates[:, 2::2]) * 2  # Simpson
    path = np.concatenate((np.zeros((2, 1)), np.cumsum(thirds, axis=1)), axis=1)[:, ::500]
    _near(found, {"v": v, "om": om, "th": th, "x": path[0], "y": path[1]})


@pytest.mark.parametrize("formulation", PRIMAL)
@pytest.mark.long
def test_a_disk_driven_at_its_rim(tmp_path, formulation):
    found = trace_of(tmp_path, DISK, formulation=formulation)
    t = np.linspace(0.0, 3.0, 31)
    om = 0.5 - 0.6 * 0.1 / 0.05 * t
    nu = 2 + 0.6 * 0.4 / (0.09 + 1.2 * 0.4**2) * t
    _near(found, {"om": om, "nu": nu, "rim": 0.4 * nu - 0.1 * om})


@pytest.mark.parametrize("formulation", PRIMAL)
@pytest.mark.long
def test_without_constraint(tmp_path, formulation):
    """The same as the two works -c arc x on y and c arc y on x; Kane's form has nothing to leave out."""
    found = trace_of(tmp_path, FREE, formulation=formulation)
    works = "work -(c/(1 m^2))*arc*x on y\n  work (c/(1 m^2))*arc*y on x"
    plain = FREE.replace("work -(c/(1 m^2))*arc on quasi(arc)", works).replace("quasi arc: m^2/s =", "let arc =")
    again = trace_of(tmp_path, plain, formulation="lagrangian")
    _near(found, {name: again[name].values for name in ("arc", "x", "y")})


def test_the_complementary_family_has_no_quasi_velocity_of_positions(tmp_path):
    ran, report = attempt(tmp_path, SKATE, formulation="co_lagrangian")
    assert ran is None
    assert {d.code for d in report if d.severity == "error"} <= {"E602", "E603"}


@pytest.mark.parametrize(
    ("change", "code", "said"),
    [
        (("cos(th)*x' + sin(th)*y' ", "x'*y'/(1 m/s) "), "E319", "quasi 'v' is not linear in the flow x'"),
        (("cos(th)*x' + sin(th)*y' ", "x/(1 s) "), "E319", "quasi 'v' contains no flow"),
        (("quasi om: rad/s", "quasi om: m/s"), "E207", "quasi 'om' is declared m/s but set to 1/s"),
        (("work F on quasi(v)", "work F on quasi(om)"), "E208", "work: effort*displacement is N, not J (factor: m)"),
        (("work F on quasi(v)", "work F on v"), "E319", "work on an expression that contains the flow x'"),
        (("work F on quasi(v)", "work quasi(v) on x"), "E319", "quasi(w) is what a work acts on"),
        (("work F on quasi(v)", "work F on quasi()"), "E206", "quasi takes one argument, 0 given"),
        (("work F on quasi(v)", "work F on quasi(x)"), "E208", None),
    ],
)
def test_what_is_no_quasi_velocity(tmp_path, change, code, said):
    assert change[0] in SKATE
    ran, report = attempt(tmp_path, SKATE.replace(*change))
    assert ran is None
    found = [(d.code, d.message) for d in report if d.severity == "error"]
    assert found[0][0] == code, found
    assert said is None or found[0][1] == said


def test_an_array(tmp_path):
    text = """
model pair {
  param n = 2
  coord x[1..n], y[1..n]: translation = 0 m
  coord th[1..n]: rotation = 0.3
  energy T* = sum(i in 1..n: 1/2*(1 kg)*(x[i]'^2 + y[i]'^2) + 1/2*(1 kg.m^2)*th[i]'^2)
  for i in 1..n {
    quasi v[i]: m/s = cos(th[i])*x[i]' + sin(th[i])*y[i]'
    psi edge[i]: sin(th[i])*x[i]' - cos(th[i])*y[i]' = 0
    work (1 N)*i on quasi(v[i])
  }
  init th[1..n]' = 0 rad/s
  init x[1..n]' = 0 m/s
}
scene go of pair {
  time 0 s to 1 s
  trace v[1] as a, v[2] as b every 0.5 s
}
"""
    for formulation in PRIMAL:
        found = trace_of(tmp_path, text, formulation=formulation)
        _near(found, {"a": np.array([0, 0.5, 1]), "b": np.array([0, 1.0, 2])}, 1e-6)


def test_fmt_is_idempotent():
    once = format_text(SKATE.replace("quasi v: m/s =", "quasi  v :m/s="))
    assert "  quasi v: m/s = cos(th)*x' + sin(th)*y'" in once
    assert format_text(once) == once
