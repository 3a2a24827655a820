"""`sysdyn linearize` against closed forms, an independent tableau of random networks, and scipy."""

import numpy as np
import pytest
import sympy as sp
from linearized import ALL, CLOSE, PRIMAL, RLC, SEED, alike, linear, values
from scipy.linalg import eigvals, svdvals
from texts import write


def pencil(result, close=1e-9):
    """(E, A) is singular at each eigenvalue: the matrices of the form and the reduction say the same."""
    e, a = np.array(result["E"]), np.array(result["A"])
    assert e.shape == a.shape == (len(result["states"]),) * 2
    for value in values(result["eigenvalues"]):
        matrix = value * e - a
        for _ in range(6):  # rows and columns of like size
            matrix = matrix / np.sqrt(np.abs(matrix).max(axis=1, keepdims=True))
            matrix = matrix / np.sqrt(np.abs(matrix).max(axis=0, keepdims=True))
        sigma = svdvals(matrix)
        assert sigma[-1] <= close * sigma[0], value


PENDULUM = (SEED / "pendulum.sd").read_text()


@pytest.mark.parametrize("index", ["3", "2", "2v", "1", "0"])
@pytest.mark.parametrize("formulation", PRIMAL)
@pytest.mark.long
def test_a_pendulum_at_the_bottom(formulation, index, capsys):
    options = ("--formulation", formulation, "--index", index, "--equilibrium")
    found = linear(capsys, SEED / "pendulum.sd", *options)
    alike(values(found["eigenvalues"]), 1j * np.sqrt(9.81 / 2.34) * np.array([1, -1]))
    pencil(found)
    assert found["index"] == index
    assert not found["moving"]
    for mode in found["modes"]:
        assert mode["frequency"] == pytest.approx(np.sqrt(9.81 / 2.34), rel=CLOSE)
        assert mode["damping"] == pytest.approx(0.0, abs=CLOSE)
        assert sum(mode["participation"].values()) == pytest.approx(1.0)


@pytest.mark.parametrize("formulation", ALL)
@pytest.mark.long
def test_a_series_circuit_in_every_formulation(formulation, tmp_path, capsys):
    found = linear(capsys, write(tmp_path, RLC), "--formulation", formulation, "--equilibrium")
    poles = np.roots([0.5 * 0.02, 3 * 0.02, 1])
    alike([v for v in values(found["eigenvalues"]) if abs(v) > 1e-9], poles)
    pencil(found)
    by_output = {t["output"]: t for t in found["transfer"]}
    assert {t["input"] for t in found["transfer"]} == {"u"}
    # u to v: 1/(LC)/(s^2 + R/L s + 1/LC), and so on
    for name, zeros, gain in (("v", 0, 100.0), ("i", 1, 2.0), ("v_r", 1, 6.0), ("v_l", 2, 1.0)):
        t = by_output[name]
        alike(values(t["poles"]), poles)
        assert values(t["zeros"]) == pytest.approx(np.zeros(zeros), abs=1e-12)
        assert t["gain"] == pytest.approx(gain, rel=CLOSE)
        assert t["improper"] == [0.0, 0.0]
    assert by_output["v"]["static"] == pytest.approx(1.0, rel=CLOSE)


@pytest.mark.long
def test_the_lead_filter_of_the_book(tmp_path, capsys):
    """(6.43): E_o/E_s = (R1 R2 C s + R2)/(R1 R2 C s + R1 + R2)."""
    text = (SEED / "lead_filter.sd").read_text().replace("effort(e = E*sin(w*t))", "effort(e = u)")
    path = write(tmp_path, text.replace("  param E = 1 V\n", "  input u: V = 1 V\n"))
    found = linear(capsys, path, "--outputs", "e_o", "--equilibrium")
    (t,) = found["transfer"]
    r1, r2, c = 1e3, 250.0, 1e-4
    alike(values(t["poles"]), [-(r1 + r2) / (r1 * r2 * c)])
    alike(values(t["zeros"]), [-1 / (r1 * c)])
    assert t["gain"] == pytest.approx(1.0, rel=CLOSE)
    assert t["static"] == pytest.approx(r2 / (r1 + r2), rel=CLOSE)


@pytest.mark.parametrize("formulation", PRIMAL)
@pytest.mark.long
def test_a_dc_motor(formulation, capsys):
    options = ("--inputs", "E", "--outputs", "om,i", "--formulation", formulation)
    found = linear(capsys, SEED / "dc_motor.sd", *options)
    inductance, r, j, b, k = 0.02, 0.8, 0.01, 0.005, 0.25
    below = [inductance * j, inductance * b + r * j, r * b + k * k]
    alike(values(found["eigenvalues"]), np.roots(below))
    om, i = found["transfer"]
    assert om["gain"] == pytest.approx(k / below[0], rel=CLOSE)
    assert om["static"] == pytest.approx(k / below[2], rel=CLOSE)
    assert om["zeros"] == []
    alike(values(i["zeros"]), [-b / j])


def test_a_free_chain_of_two_masses(tmp_path, capsys):
    text = """
    model chain {
      param m1 = 2 kg
      param m2 = 3 kg
      param k = 50 N/m
      coord x1, x2: translation
      energy T* = 1/2*m1*x1'^2 + 1/2*m2*x2'^2
      energy V = 1/2*k*(x2 - x1)^2
    }
    """
    omega = np.sqrt(50 * (1 / 2 + 1 / 3))
    for formulation in ("lagrangian", "hamiltonian"):
        found = linear(capsys, write(tmp_path, text), "--formulation", formulation)
        moving = [v for v in values(found["eigenvalues"]) if abs(v) > 1.0]
        alike(moving, [1j * omega, -1j * omega])
        assert np.abs([v for v in values(found["eigenvalues"]) if abs(v) < 1.0]).max() < 1e-6  # a double root


@pytest.mark.parametrize("formulation", PRIMAL)
@pytest.mark.long
def test_the_unstable_pendulum(formulation, capsys):
    options = ("--set", "th_0=3.141592653589793", "--formulation", formulation)
    found = linear(capsys, SEED / "inverted_pendulum.sd", *options)
    alike(values(found["eigenvalues"]), [*np.roots([1, 0.2, -9.81]), 0.0])
    (unstable,) = [m for m in found["modes"] if m["eigenvalue"][0] > 0]
    assert unstable["damping"] == pytest.approx(-1.0)


@pytest.mark.parametrize("formulation", PRIMAL)
@pytest.mark.parametrize("index", ["3", "2"])
@pytest.mark.long
def test_a_slider_on_an_incline(formulation, index, tmp_path, capsys):
    """A constraint of index 3 with damping: m s^2 + c s + k along the line."""
    text = """
    model slider {
      param m = 0.7 kg
      param k = 40 N/m
      param c = 1.3 N.s/m
      param a = 0.6 rad
      input F: N = 0 N
      coord x, y: translation
      energy T* = 1/2*m*(x'^2 + y'^2)
      energy V = 1/2*k*(x^2 + y^2)
      content D = 1/2*c*(x'^2 + y'^2)
      phi line: y*cos(a) = x*sin(a)
      work F on x
      init x = 0 m
    }
    scene s of slider { time 0 s to 1 s; trace x, y }
    """
    found = linear(capsys, write(tmp_path, text), "--formulation", formulation, "--index", index)
    alike(values(found["eigenvalues"]), np.roots([0.7, 1.3, 40]))
    pencil(found)
    x, y = found["transfer"]
    assert x["gain"] == pytest.approx(np.cos(0.6) ** 2 / 0.7, rel=CLOSE)
    assert y["gain"] == pytest.approx(np.cos(0.6) * np.sin(0.6) / 0.7, rel=CLOSE)


@pytest.mark.long
def test_levitation_about_its_rest(capsys):
    """m x'' = F - b0 i^2/(2 (b1 + x)^2), d/dt(b0 i/(b1 + x)) = E - R i; the rest has i = E/R (book, 3.54)."""
    mass, b0, b1, r, force, volt = 2.0, 0.004, 0.01, 5.0, 19.62, 5.0
    found = linear(capsys, SEED / "em_suspension.sd", "--equilibrium", "--set", "E=5", "--outputs", "x")
    i = volt / r
    gap = i * np.sqrt(b0 / (2 * force))
    stiff, ki = b0 * i**2 / gap**3, b0 * i / gap**2
    inductance = b0 / gap
    # m s^2 x = stiff x - ki i;  (L s + R) i = ki s x
    alike(values(found["eigenvalues"]), np.roots([mass * inductance, mass * r, ki**2 - stiff * inductance, -stiff * r]))
    assert found["point"]["x"] == pytest.approx(gap - b1, rel=1e-9)


@pytest.mark.long
def test_two_tanks(tmp_path, capsys):
    text = """
    model tanks {
      param C1 = 2e-6 m^3/Pa
      param C2 = 3e-6 m^3/Pa
      param R = 5e4 Pa.s/m^3
      param R2 = 8e4 Pa.s/m^3
      input Q: m^3/s = 0 m^3/s
      node a, b: hydraulic
      pump: flow(f = Q) ground -> a
      t1: potential(q = C1*e) a -> ground
      pipe: dissipator(e = R*f) a -> b
      t2: potential(q = C2*e) b -> ground
      out: dissipator(e = R2*f) b -> ground
    }
    scene s of tanks { time 0 s to 1 s; trace b.e as p2 }
    """
    a = np.array([[-1 / (2e-6 * 5e4), 1 / (2e-6 * 5e4)], [1 / (3e-6 * 5e4), -(1 / 5e4 + 1 / 8e4) / 3e-6]])
    for formulation in ALL:
        found = linear(capsys, write(tmp_path, text), "--formulation", formulation, "--equilibrium")
        (t,) = found["transfer"]
        alike(values(t["poles"]), eigvals(a))
        assert t["static"] == pytest.approx(8e4, rel=CLOSE), formulation
        assert t["zeros"] == []


@pytest.mark.long
def test_a_gear_between_a_flywheel_and_a_spring(tmp_path, capsys):
    text = """
    model geared {
      param J1 = 0.3 kg.m^2
      param J2 = 0.05 kg.m^2
      param n = 4
      param k = 12 N.m/rad
      coord a, b: rotation
      energy T* = 1/2*J1*a'^2 + 1/2*J2*b'^2
      energy V = 1/2*k*a^2
      psi mesh: b' = n*a'
    }
    """
    for formulation in PRIMAL:
        found = linear(capsys, write(tmp_path, text), "--formulation", formulation)
        oscillating = [v for v in values(found["eigenvalues"]) if abs(v) > 1e-6]
        alike(oscillating, 1j * np.sqrt(12 / (0.3 + 16 * 0.05)) * np.array([1, -1]))


def test_a_nonholonomic_sleigh_moves_straight(tmp_path, capsys):
    """A knife edge with its mass behind it: the straight run decays at rate m a v/(J + m a^2)."""
    text = """
    model sleigh {
      param m = 2 kg
      param J = 0.4 kg.m^2
      param a = 0.3 m
      param v = 1.5 m/s
      coord x, y: translation
      coord th: rotation
      let xc = x + a*cos(th)
      let yc = y + a*sin(th)
      energy T* = 1/2*m*(xc'^2 + yc'^2) + 1/2*J*th'^2
      psi edge: y'*cos(th) - x'*sin(th) = 0
      init x' = v
      init th' = 0 rad/s
      init th = 0 rad
    }
    """
    found = linear(capsys, write(tmp_path, text), "--outputs", "x", "--formulation", "lagrangian")
    slow = [v for v in values(found["eigenvalues"]) if abs(v) > 1e-3]  # its place does not matter
    alike(slow, [-2 * 0.3 * 1.5 / (0.4 + 2 * 0.3**2)])
    assert not found["moving"]  # nothing depends on x


def frozen_values(e, a):
    """Finite eigenvalues of a frozen pencil of index 3: chains of infinite ones of length 3 stand near 1e-5."""
    shift = 0.7391
    mu = np.linalg.eigvals(np.linalg.solve(a - shift * e, e))
    return shift + 1.0 / mu[np.abs(mu) > 1e-3]


@pytest.mark.parametrize(("formulation", "mass"), [("lagrangian", 1.0), ("hamiltonian", 1.13)])
def test_about_a_moving_pendulum(formulation, mass, capsys):
    """In q1 along the motion: the slopes of q1'' as the constraint gives it, not those of the frozen pencil."""
    found = linear(capsys, SEED / "pendulum.sd", "--set", "th_0=0.9", "--at", "0.7", "--formulation", formulation)
    length, g = 2.34, 9.81
    q, f = sp.symbols("q f")
    y = -sp.sqrt(length**2 - q**2)
    th = sp.asin(q / length)
    rate = f / (length * sp.cos(th))
    acceleration = length * (sp.cos(th) * (-g / length * sp.sin(th)) - sp.sin(th) * rate**2)
    at = {q: found["point"]["q1"], f: found["point"]["q1'"]}
    slopes = [float(sp.diff(acceleration, v).subs(at)) for v in (q, f)]
    assert found["reduced"]["states"] == ["q1", "q1'" if formulation == "lagrangian" else "q1.p"]
    expected = np.array([[0, 1 / mass], [mass * slopes[0], slopes[1]]])
    assert np.array(found["reduced"]["A"]) == pytest.approx(expected, rel=1e-8, abs=1e-9)
    frozen = frozen_values(np.array(found["E"]), np.array(found["A"]))
    own = np.linalg.eigvals(expected)
    assert min(abs(frozen - own[0])) > 0.01 * abs(own[0])  # what the form's pencil says of a moving state
    assert float(y.subs(at)) == pytest.approx(found["point"]["q2"], rel=1e-10)
    assert found["moving"]


def test_a_parameter_whose_formula_others_follow(tmp_path, capsys):
    text = RLC.replace("param L = 0.5 H", "param w0 = 10 rad/s\n  param L = 1/(C*w0^2)").replace(
        "input u: V = 0 V", "param u = 2 V"
    )
    found = linear(capsys, write(tmp_path, text), "--inputs", "u,C", "--outputs", "c.q", "--equilibrium")
    by_u, by_c = found["transfer"]
    assert by_u["static"] == pytest.approx(0.02, rel=CLOSE)
    assert by_c["static"] == pytest.approx(2.0, rel=CLOSE)
