"""`sysdyn linearize` against closed forms, an independent tableau of random networks, and scipy."""

import os

import numpy as np
import pytest
import sympy as sp
from scipy import signal
from scipy.linalg import eigvals, svdvals
from sysdyn.api import linearize
from sysdyn.cli.main import run
from sysdyn.runtime.linear import tangent
from sysdyn.runtime.numerics.rank import decomposed
from texts import ROOT, run_json, write

CLOSE = 1e-10
NETWORKS = 200 if os.environ.get("SYSDYN_LONG") else 12
"""Random networks in each formulation."""
SEED = ROOT / "models" / "seed"
PRIMAL = ("lagrangian", "hamiltonian")
ALL = (*PRIMAL, "co_lagrangian", "co_hamiltonian")


def linear(capsys, path, *options):
    code, found = run_json(capsys, "linearize", str(path), "--backend", "numpy", *options)
    assert code == 0, found["diagnostics"]
    return found["result"]


def values(pairs):
    return np.array([complex(*p) for p in pairs])


def alike(found, expected, close=CLOSE):
    """Every value of one set stands near one of the other, both ways, relative to the largest."""
    found, expected = list(np.atleast_1d(found)), list(np.atleast_1d(expected))
    assert len(found) == len(expected), (found, expected)
    size = max(map(abs, expected), default=1.0)
    for value in expected:
        near = min(range(len(found)), key=lambda k: abs(found[k] - value))
        assert abs(found.pop(near) - value) <= close * size, (found, expected)


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


RLC = """
model rlc {
  param R = 3 ohm
  param L = 0.5 H
  param C = 0.02 F
  input u: V = 0 V
  node s, a, b: electrical
  supply: effort(e = u) s -> ground
  r: dissipator(e = R*f) s -> a
  l: kinetic(p = L*f) a -> b
  c: potential(q = C*e) b -> ground
}
scene at_rest of rlc { time 0 s to 1 s; trace c.e as v, l.f as i, r.e as v_r, l.e as v_l }
"""


@pytest.mark.parametrize("formulation", ALL)
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


@pytest.mark.parametrize("formulation", ALL)
@pytest.mark.one_in(4)
def test_contrasts_of_many_decades(formulation, tmp_path, capsys):
    """Each eigenvalue to 1e-10 of itself, the slow one beside one up to 1e13 times as fast; gain and zeros too."""
    path = write(tmp_path, RLC)
    random = np.random.default_rng(0)
    for _ in range(12):
        r, l_, c = (10 ** random.uniform(*decades) for decades in ((-3, 6), (-9, 0), (-12, -3)))
        values_ = (f"R={r!r}", f"L={l_!r}", f"C={c!r}")
        options = [part for v in values_ for part in ("--set", v)]
        found = linear(capsys, path, *options, "--formulation", formulation, "--outputs", "v", "--equilibrium")
        root = np.sqrt(complex((r / l_ / 2) ** 2 - 1 / (l_ * c)))
        fast = -r / l_ / 2 - root
        (t,) = found["transfer"]
        for expected in (fast, 1 / (l_ * c) / fast):
            for ours in (values(found["eigenvalues"]), values(t["poles"])):
                assert np.abs(ours - expected).min() <= CLOSE * abs(expected), (r, l_, c)
        assert t["gain"] * l_ * c == pytest.approx(1.0, rel=CLOSE)
        assert t["zeros"] == []


def test_the_reduction_is_a_state_space_of_scipy(tmp_path, capsys):
    found = linear(capsys, write(tmp_path, RLC), "--equilibrium", "--outputs", "c.e")
    small = found["reduced"]
    system = signal.StateSpace(*(np.array(small[k]) for k in "ABCD"))
    time = np.linspace(0.0, 1.5, 40)
    _, response = signal.step(system, T=time)
    w = np.sqrt(100 - 9.0)
    expected = 1 - np.exp(-3 * time) * (np.cos(w * time) + 3 / w * np.sin(w * time))
    assert response == pytest.approx(expected, rel=1e-9, abs=1e-9)


@pytest.mark.parametrize("formulation", ALL)
def test_the_descriptor_matrices_have_the_transfer_function(formulation, tmp_path, capsys):
    found = linear(capsys, write(tmp_path, RLC), "--formulation", formulation, "--equilibrium", "--outputs", "v,v_r")
    e, a, b, c, d = (np.array(found[k]) for k in "EABCD")
    for s in (0.3j, 7.0j, 2.0 + 1.0j):
        response = (c + s * np.array(found.get("Cd", 0.0 * c))) @ np.linalg.solve(s * e - a, b) + d
        below = 0.01 * s**2 + 0.06 * s + 1
        assert response[:, 0] == pytest.approx([1 / below, 0.06 * s / below], rel=CLOSE)


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
def test_the_unstable_pendulum(formulation, capsys):
    options = ("--set", "th_0=3.141592653589793", "--formulation", formulation)
    found = linear(capsys, SEED / "inverted_pendulum.sd", *options)
    alike(values(found["eigenvalues"]), [*np.roots([1, 0.2, -9.81]), 0.0])
    (unstable,) = [m for m in found["modes"] if m["eigenvalue"][0] > 0]
    assert unstable["damping"] == pytest.approx(-1.0)


@pytest.mark.parametrize("formulation", PRIMAL)
@pytest.mark.parametrize("index", ["3", "2"])
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


def test_an_input_that_is_differentiated(tmp_path, capsys):
    """A given current through a coil: v = L du/dt."""
    text = """
    model driven {
      param L = 0.25 H
      input u: A = 0 A
      node a: electrical
      source: flow(f = u) ground -> a
      coil: kinetic(p = L*f) a -> ground
    }
    scene s of driven { time 0 s to 1 s; trace coil.f as i, a.e as v }
    """
    for formulation in PRIMAL:
        found = linear(capsys, write(tmp_path, text), "--formulation", formulation)
        i, v = found["transfer"]
        assert (i["gain"], i["improper"]) == (pytest.approx(1.0, rel=CLOSE), [0.0, 0.0])
        assert (v["gain"], v["improper"][0]) == (pytest.approx(0.0, abs=1e-12), pytest.approx(0.25, rel=CLOSE))


def test_an_amplitude_is_held_at_its_instant(capsys):
    """E sin(w t) at 0.05 s: the filter's own transfer function times sin(w t), in either family."""
    for formulation in ALL:
        options = ("--inputs", "E", "--outputs", "e_o", "--at", "0.05", "--formulation", formulation)
        (t,) = linear(capsys, SEED / "lead_filter.sd", *options)["transfer"]
        assert t["gain"] == pytest.approx(np.sin(12.566370614359172 * 0.05), rel=1e-9), formulation
        alike(values(t["zeros"]), [-10.0])
        alike(values(t["poles"]), [-50.0])


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


# -- random networks ---------------------------------------------------------------------------------------------------


def network(random):
    """Text of a connected circuit, and the pencil (E, A) of its modified nodal analysis: E x' = A x."""
    nodes = int(random.integers(3, 7))
    pairs = [(k, int(random.integers(0, k))) for k in range(1, nodes)]
    pairs += [tuple(map(int, random.choice(nodes, 2, replace=False))) for _ in range(int(random.integers(2, 6)))]
    single = [k for k in range(nodes) if sum(k in pair for pair in pairs) == 1]
    pairs += [(k, (k + 1) % nodes) for k in single]
    kinds = [str(random.choice(["R", "L", "C"])) for _ in pairs]
    kinds[: min(3, len(kinds))] = list(random.permutation(["R", "L", "C"]))
    size = 10.0 ** random.uniform(-0.5, 0.5, len(pairs))
    laws = {"R": "dissipator(e = {:.17g} ohm*f)", "L": "kinetic(p = {:.17g} H*f)", "C": "potential(q = {:.17g} F*e)"}
    name = lambda k: "ground" if k == 0 else f"n{k}"  # noqa: E731
    lines = [f"  node {', '.join(name(k) for k in range(1, nodes))}: electrical"]
    for j, ((a, b), kind, value) in enumerate(zip(pairs, kinds, size, strict=True)):
        lines.append(f"  {kind.lower()}{j}: {laws[kind].format(value)} {name(a)} -> {name(b)}")
    coils = [j for j, kind in enumerate(kinds) if kind == "L"]
    n = nodes - 1 + len(coils)
    e, a = np.zeros((n, n)), np.zeros((n, n))
    for j, ((one, two), kind, value) in enumerate(zip(pairs, kinds, size, strict=True)):
        across = np.zeros(nodes)
        across[one], across[two] = 1.0, -1.0
        across = across[1:]
        if kind == "R":
            a[: nodes - 1, : nodes - 1] -= np.outer(across, across) / value
        elif kind == "C":
            e[: nodes - 1, : nodes - 1] += np.outer(across, across) * value
        else:
            k = nodes - 1 + coils.index(j)
            e[k, k] = value
            a[k, : nodes - 1] += across
            a[: nodes - 1, k] -= across
    return "model random_network {\n" + "\n".join(lines) + "\n}\n", e, a


def finite(e, a):
    """Finite eigenvalues of a pencil, by s = shift + 1/mu: infinite ones are mu = 0."""
    shift = 0.7391
    mu = np.linalg.eigvals(np.linalg.solve(a - shift * e, e))
    return shift + 1.0 / mu[np.abs(mu) > 1e-7]


@pytest.mark.parametrize("formulation", ALL)
@pytest.mark.one_in(8)
def test_random_networks_have_the_eigenvalues_of_a_nodal_tableau(formulation, tmp_path, capsys):
    random = np.random.default_rng(11 + ALL.index(formulation))
    worst, counted = 0.0, 0
    for _ in range(NETWORKS):
        text, e, a = network(random)
        if np.linalg.cond(a - 0.7391 * e) > 1e10:
            continue
        found = linear(capsys, write(tmp_path, text), "--formulation", formulation)
        ours = values(found["eigenvalues"])
        theirs = finite(e, a)
        ours, theirs = ours[np.abs(ours) > 1e-5], theirs[np.abs(theirs) > 1e-5]  # charges and fluxes count in zeros
        assert ours.size == theirs.size, text
        for value in theirs:
            worst = max(worst, float(np.abs(ours - value).min() / max(abs(value), 1.0)))
        counted += ours.size
    assert counted > NETWORKS
    assert worst < CLOSE, worst


LOST = """
model contrasts {
  node n1, n2, n3: electrical
  l0: kinetic(p = 38103.838624862277 H*f) n1 -> ground
  r1: dissipator(e = 376797.26089776639 ohm*f) n2 -> ground
  c2: potential(q = 1.3060954446401942 F*e) n3 -> n2
  r3: dissipator(e = 1.2050549116913142e-07 ohm*f) n1 -> n3
  c4: potential(q = 31.936590008723126 F*e) n1 -> n3
}
"""


@pytest.mark.parametrize("formulation", ALL)
def test_no_mode_is_lost_where_elements_are_twelve_decades_apart(formulation, tmp_path, capsys):
    """Eigenvalues of its nodal pencil in 120 digits; co_ forms add up what is at a node in doubles, and may refuse."""
    path = str(write(tmp_path, LOST))
    code, found = run_json(capsys, "linearize", path, "--formulation", formulation, "--backend", "numpy")
    if code:
        assert formulation.startswith("co_")
        assert [d["code"] for d in found["diagnostics"] if d["severity"] == "error"] == ["E607"]
        return
    expected = np.array([-259839.1696955404, -9.88869355609092, -2.0319706817345224e-06])
    ours = np.sort([v.real for v in values(found["result"]["eigenvalues"]) if v != 0])
    assert ours == pytest.approx(expected, rel=1e-7)


# -- the command -------------------------------------------------------------------------------------------------------


def test_the_table_names_modes_and_transfer_functions(tmp_path, capsys):
    assert run(["linearize", str(write(tmp_path, RLC)), "--outputs", "v", "--backend", "numpy"]) == 0
    out, err = capsys.readouterr()
    assert "-3" in out
    assert "v by u" in out
    assert "gain   100, at rest 1" in out
    assert "at rest" in err


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (("--inputs", "uu"), "there is no parameter or input 'uu'; nearest: 'u'"),
        (("--inputs", "supply.e"), "'supply.e' is no parameter or input, but what an element gives"),
        (("--inputs", "u[1]"), "'u[1]': is no array"),
        (("--at", "1", "--equilibrium"), "an instant of a run, or a state of rest"),
        (("--at", "-1"), "--at -1 s lies before the start"),
    ],
)
def test_wrong_usage(options, message, tmp_path, capsys):
    code, found = run_json(capsys, "linearize", str(write(tmp_path, RLC)), "--backend", "numpy", *options)
    assert code == 2
    assert message in found["diagnostics"][0]["message"]


@pytest.mark.parametrize(
    ("inputs", "label"), [((), "u"), (("--inputs", "u"), "u"), (("--inputs", "supply.v"), "supply.v")]
)
def test_an_input_that_follows_a_formula_is_moved_about_it(inputs, label, tmp_path, capsys):
    """Of a linear circuit the transfer function is that of an input that holds a constant."""
    circuit = "from std.electrical import voltage\n" + RLC.replace("effort(e = u)", "voltage(v = u)")
    path = str(write(tmp_path, circuit))
    _, plain = run_json(capsys, "linearize", path, "--outputs", "v", "--inputs", "u", "--backend", "numpy")
    text = circuit.replace("time 0 s to 1 s;", "time 0 s to 1 s; set u = 2 V*sin(3 rad/s*t);")
    path = str(write(tmp_path, text))
    code, found = run_json(capsys, "linearize", path, "--outputs", "v", *inputs, "--at", "0.3", "--backend", "numpy")
    assert code == 0
    ours, theirs = (dict(r["result"]["transfer"][0]) for r in (found, plain))
    assert (ours.pop("input"), theirs.pop("input")) == (label, "u")
    for key in ("gain", "poles", "zeros"):
        assert np.allclose(ours[key], theirs[key], rtol=1e-9)


SQUARE = """model valve {
  input u: 1 = 0
  state x: 1 = 0
  dynamic x' = ((2 + sin(3 rad/s*t) + u)^2 - x)/(1 s)
}
scene s of valve {
  time 0 s to 1 s
  set u = cos(2 rad/s*t)
  trace x
}
"""


def test_a_formula_is_where_the_slope_is_taken(tmp_path, capsys):
    t = 0.7
    code, found = run_json(capsys, "linearize", str(write(tmp_path, SQUARE)), "--at", str(t), "--backend", "numpy")
    assert code == 0
    assert found["result"]["reduced"]["B"][0][0] == pytest.approx(2 * (2 + np.sin(3 * t) + np.cos(2 * t)), rel=1e-9)


def test_an_output_that_does_not_exist(tmp_path, capsys):
    code, found = run_json(capsys, "linearize", str(write(tmp_path, RLC)), "--outputs", "c.z", "--backend", "numpy")
    assert code == 2
    assert found["diagnostics"][0]["severity"] == "error"


@pytest.mark.parametrize(("model", "outputs"), [("motor", ("om", "i")), ("circuit", ("c.e", "v_r"))])
def test_python_control_says_the_same(model, outputs, tmp_path):
    """Poles, zeros, static gain and frequency response by python-control of the reduction, where it is installed."""
    control = pytest.importorskip("control")
    path = SEED / "dc_motor.sd" if model == "motor" else write(tmp_path, RLC)
    found = linearize(path, inputs=["E"] if model == "motor" else None, outputs=outputs)
    system = found.control()
    assert list(system.output_labels) == [name.replace(".", "_") for name in found.outputs]
    alike(np.sort_complex(control.poles(system)), np.sort_complex(found.eigenvalues))
    for k in range(len(outputs)):
        single, ours = system[k, 0], found.transfer_function(k)
        theirs = control.zeros(single)  # those of modes that the output does not see among them
        assert all(np.abs(theirs - zero).min() <= CLOSE * abs(zero) for zero in ours.zeros)
        for s in (0.3j, 7.0j, 200.0j):
            by_poles = ours.gain * np.prod(s - np.asarray(ours.zeros)) / np.prod(s - np.asarray(ours.poles))
            assert single(s) == pytest.approx(by_poles, rel=CLOSE)
        assert single.dcgain() == pytest.approx(found.transfers[k].static, rel=CLOSE, abs=1e-12)


EXTREMES = """
model extremes {
  param n = 3
  state s[1..3]: 1 = [1, 2, 3]
  for i in 1..n { dynamic s[i]' = -i*s[i]/(1 s) }
  let low = min(i in 1..n: s[i])
  let high = max(i in 1..n: s[i]^2)
  let all = prod(i in 1..n: s[i])
  let most = sum(i in 1..n: max(j in 1..n: i*s[j]))
}

scene run of extremes {
  time 0 s to 1 s
  trace low, high, all, most
}
"""


def test_extremes_and_products_over_a_range_have_slopes(tmp_path, capsys):
    found = linear(capsys, write(tmp_path, EXTREMES), "--scene", "run")
    slopes = dict(zip(found["outputs"], np.array(found["C"]), strict=True))
    expected = {"low": [1.0, 0.0, 0.0], "high": [0.0, 0.0, 6.0], "all": [6.0, 3.0, 2.0], "most": [0.0, 0.0, 6.0]}
    assert found["states"] == ["s[1]", "s[2]", "s[3]"]
    for name, row in expected.items():
        assert np.abs(slopes[name] - row).max() <= CLOSE


VESSEL = """
model vessel {
  param Q = 12 l/min
  param R = 2e9 Pa.s/m^3
  node a, m: hydraulic
  feed: flow(f = Q) ground -> a
  gas: potential(e = 60 bar*0.6 l/(0.6 l - q)) a -> ground
  seat: effort(e = 95 bar) a -> m
  loss: dissipator(e = R*f) m -> ground
  psi one_way: seat.f >= 0 m^3/s
  init gas.q = 0.15 l
}

scene run of vessel {
  time 0 s to 1 s
  trace a.e
}
"""


@pytest.mark.parametrize("formulation", PRIMAL)
def test_a_flow_that_is_given_hides_no_balance(formulation, tmp_path, capsys):
    """The flow of a source weighs 1e10 times as much as those beside a stiff law: it hid the balance of its node."""
    path = write(tmp_path, VESSEL)
    found = linear(capsys, path, "--scene", "run", "--formulation", formulation, "--inputs", "Q", "--no-prune")
    assert np.abs(values(found["eigenvalues"])).max() <= 1e-12
    a, b, c, d = (np.array(found["reduced"][name]) for name in "ABCD")
    slope = 60e5 * 0.6e-3 / 0.45e-3**2  # of the pressure by the volume
    at = 2.0j
    assert complex((c @ np.linalg.solve(at * np.eye(len(a)) - a, b) + d)[0, 0]) == pytest.approx(slope / at, rel=CLOSE)


BIASED = """
model coil {
  input u: H = 0.1 H
  node a, b: electrical
  V: effort(e = 10 V) a -> ground
  R: dissipator(e = 5 ohm*f) a -> b
  L: kinetic(p = u*f) b -> ground
}
model gap {
  input u: F = 1 mF
  node a, b: electrical
  V: effort(e = 10 V) a -> ground
  R: dissipator(e = 5 ohm*f) a -> b
  L: potential(q = u*e) b -> ground
}
scene coil_s of coil { time 0 s to 1 s
  trace L.f as i, L.e as v }
scene gap_s of gap { time 0 s to 1 s
  trace L.f as i, L.e as v }
"""
"""L i0 = 0.1 H x 2 A, q0 = 1 mF x 10 V: what moves the inductance or the gap of a loaded store moves it by its rate."""


@pytest.mark.one_in(2)
@pytest.mark.parametrize("formulation", ALL)
@pytest.mark.parametrize("index", ["3", "1", "0"])
@pytest.mark.parametrize("scene", ["coil_s", "gap_s"])
def test_an_input_in_a_loaded_store_acts_by_its_rate(scene, index, formulation, tmp_path, capsys):
    options = ("--scene", scene, "--equilibrium", "--formulation", formulation, "--index", index)
    found = linear(capsys, write(tmp_path, BIASED), *options)
    for s in (3j, 70.0 + 1j):
        current = -s * 2 / (0.1 * s + 5) if scene == "coil_s" else s * 10 / (1e-3 * s + 0.2) / 5
        expected = np.array([current, -5 * current])
        assert _descriptor(found, s)[:, 0] == pytest.approx(expected, rel=CLOSE)
        assert _reduction(found, s)[:, 0] == pytest.approx(expected, rel=CLOSE)


BASE = """
model base {
  input v: m/s = 0 m/s
  input u: m = 0.2 m
  node b, x: translation
  F: flow(f = v) b -> ground
  K: potential(e = 100 N/m*q) b -> x
  D: dissipator(e = 1 N.s/m*f) b -> x
  M: kinetic(p = 1 kg*f) x
  Mb: kinetic(p = 2 kg*f) b
}
scene base_s of base { time 0 s to 1 s
  trace x.f as vx, F.e as F }
model frame {
  input u: m = 0.2 m
  coord x: translation = 0 m
  let z = x + u
  let y = 2*x + u^2/(1 m)
  energy T* = 1/2*(1 kg)*z'^2
  energy V = 1/2*(9 N/m)*x^2
  work -(0.5 N.s/m)*x' on x
}
scene frame_s of frame { time 0 s to 1 s
  trace x, x'' as a, y, y' as yd }
"""


@pytest.mark.one_in(2)
@pytest.mark.parametrize("index", ["3", "2", "2v", "1", "0"])
@pytest.mark.parametrize("formulation", ["lagrangian", "hamiltonian", "kane"])
def test_matrices_of_every_index_hold_the_rates_of_inputs(formulation, index, tmp_path, capsys):
    """The base moved with v: x'' + x' + 100 x = v' + ...; in the frame x'' + u'' + x'/2 + 9 x = 0."""
    path = write(tmp_path, BASE)
    options = ("--formulation", formulation, "--index", index)
    for s in (3j, 2.0 + 11j):
        found = linear(capsys, path, "--scene", "base_s", "--inputs", "v", *options)
        speed = (100 + s) / (s * s + s + 100)
        expected = np.array([speed, -(2 * s + (100 + s) * (1 - speed) / s)])
        assert _descriptor(found, s)[:, 0] == pytest.approx(expected, rel=CLOSE)
        assert _reduction(found, s)[:, 0] == pytest.approx(expected, rel=CLOSE)
        found = linear(capsys, path, "--scene", "frame_s", *options)
        x = -s * s / (s * s + s / 2 + 9)
        expected = np.array([x, s * s * x, 2 * x + 0.4, s * (2 * x + 0.4)])
        assert _descriptor(found, s)[:, 0] == pytest.approx(expected, rel=CLOSE)
        assert _reduction(found, s)[:, 0] == pytest.approx(expected, rel=CLOSE)


def _descriptor(found, s):
    e, a, b, c, d = (np.array(found[k]) for k in "EABCD")
    return (c + s * np.array(found.get("Cd", 0.0 * c))) @ np.linalg.solve(s * e - a, b) + d


def _reduction(found, s):
    small = found["reduced"]
    a, b, c, d = (np.array(small[k]) for k in "ABCD")
    rates = s * np.array(small.get("D1", 0.0 * d)) + s * s * np.array(small.get("D2", 0.0 * d))
    return c @ np.linalg.solve(s * np.eye(len(a)) - a, b) + d + rates


ROW = """
model row {
  param u = 10 N/m
  param n = 3
  param c = 2
  for i in 1..n { param k[i] = u*i }
  param kk[1..3] = [u, c*u, 5*u]
  coord x[1..n]: translation = 0 m
  energy T* = sum(i in 1..n: 1/2*(1 kg)*x[i]'^2)
  energy V = sum(i in 1..n: 1/2*(k[i] + kk[i])*x[i]^2)
  for i in 1..n { work 5 N - (0.3 N.s/m)*x[i]' on x[i] }
}
scene s of row { time 0 s to 1 s
  set kk[3] = 40 N/m
  trace x[1], x[2], x[3] }
"""


@pytest.mark.parametrize(("asked", "slopes"), [("u", (2, 4, 3)), ("c", (0, 10, 0)), ("kk[2]", (0, 1, 0))])
def test_arrays_by_formula_follow_an_input(asked, slopes, tmp_path, capsys):
    found = linear(capsys, write(tmp_path, ROW), "--equilibrium", "--inputs", asked)
    s, stiffness = 3j, (20, 40, 70)
    expected = [-m * 5 / k / (s * s + 0.3 * s + k) for m, k in zip(slopes, stiffness, strict=True)]
    assert _descriptor(found, s)[:, 0] == pytest.approx(expected, rel=CLOSE)
    assert _reduction(found, s)[:, 0] == pytest.approx(expected, rel=CLOSE)


SEATS = """
component seat {
  param k = 100 N/m
  input u: m
  port x: translation
  let z = x.q + u
  energy T* = 1/2*(2 kg)*z'^2
  K: potential(e = k*q) x -> ground
}
model two {
  input u[1..2]: m = [0.1 m, 0.2 m]
  input w: m = 0 m
  node a, b: translation
  A: seat(k = 50 N/m) u = u[1] + 2*w, x = a
  B: seat() u = u[2], x = b
}
scene s of two { time 0 s to 1 s
  trace a.q as xa, b.q as xb }
"""


def test_an_input_that_is_an_array_is_one_input_an_element(tmp_path, capsys):
    """Each seat: 2 (x'' + u'') + k x = 0."""
    found = linear(capsys, write(tmp_path, SEATS), "--equilibrium")
    assert found["inputs"] == ["u[1]", "u[2]", "w"]
    s = 0.3 + 3j
    one, other = (-s * s / (s * s + k / 2) for k in (50, 100))
    expected = np.array([[one, 0, 2 * one], [0, other, 0]])
    for response in (_descriptor(found, s), _reduction(found, s)):
        assert np.abs(response - expected).max() < CLOSE


def test_a_response_of_nothing_says_what_is_missing(tmp_path, capsys):
    text = "model m {\n  state v: V = 1 V\n  dynamic v' = (3 V*sin(t/(1 s)) - v)/(1 s)\n}\n"
    path = write(tmp_path, text + "scene s of m { time 0 s to 1 s; trace v }\n")
    for options, said in (((), "the model has no input"), (("--inputs", "t"), None)):
        code = run(["linearize", str(path), "--response", "bode", "--backend", "numpy", *options])
        err = capsys.readouterr().err
        assert (code, "no bode: " in err) == ((0, True) if said else (2, False))
        assert said is None or said in err


def test_a_long_ladder_takes_no_singular_vectors(capsys, monkeypatch):
    """Of 575 unknowns and rates: factors leave no doubt of what rows determine.  Its modes by a closed form."""
    cells, asked = 72, []
    monkeypatch.setattr(tangent, "decomposed", lambda matrix: (asked.append(min(matrix.shape)), decomposed(matrix))[1])
    path = ROOT / "models" / "benchmark" / "rc_ladder.sd"
    found = values(linear(capsys, path, "--set", f"n={cells}")["eigenvalues"])
    odd = 2.0 * np.arange(1, cells + 1) - 1.0
    wanted = -4.0 * cells**2 * np.sin(odd * np.pi / (2.0 * (2 * cells + 1))) ** 2
    assert np.abs(np.sort(found.real) / np.sort(wanted) - 1.0).max() < 1e-9
    assert np.abs(found.imag).max() == 0.0
    assert max(asked) <= cells
