"""Bode, Nyquist, step, margins, root locus, files and objects of a linearisation, against closed forms and scipy."""

import json

import h5py
import numpy as np
import pytest
from linearized import ALL, CLOSE, RLC, alike, linear, values
from scipy import signal
from scipy.io import loadmat
from scipy.linalg import eig
from sysdyn import api
from sysdyn.cli.main import run
from texts import run_json, write

R, L, C = 3.0, 0.5, 0.02


def closed(s):
    """v by u of RLC."""
    return 1.0 / (L * C * s**2 + R * C * s + 1.0)


def answered(capsys, path, *options):
    return linear(capsys, path, "--equilibrium", *options)


@pytest.mark.parametrize("formulation", ALL)
def test_bode_nyquist_and_step_meet_the_closed_form(formulation, tmp_path, capsys):
    options = ("--outputs", "v", "--response", "bode,nyquist,step", "--formulation", formulation)
    (found,) = answered(capsys, write(tmp_path, RLC), *options)["responses"]
    assert (found["output"], found["input"]) == ("v", "u")
    w = np.array(found["bode"]["w"])
    g = closed(1j * w)
    assert w.min() <= 1.0 + 1e-9
    assert w.max() >= 100.0 - 1e-9
    assert w.size > 400
    assert found["bode"]["magnitude"] == pytest.approx(20 * np.log10(abs(g)), abs=1e-9)
    assert found["bode"]["phase"] == pytest.approx(np.degrees(np.unwrap(np.angle(g))), abs=1e-8)
    assert np.array(found["nyquist"]["re"]) + 1j * np.array(found["nyquist"]["im"]) == pytest.approx(g, abs=1e-10)
    t = np.array(found["step"]["t"])
    wd = np.sqrt(100 - 9.0)
    assert found["step"]["y"] == pytest.approx(
        1 - np.exp(-3 * t) * (np.cos(wd * t) + 3 / wd * np.sin(wd * t)), abs=1e-10
    )
    assert np.array(found["step"]["y"])[-1] == pytest.approx(1.0, abs=0.01)
    margins = found["margins"]
    # |G| = 1 beside w = 0: (1 - LC w^2)^2 + (RC w)^2 = 1
    cross = np.sqrt((2 * L * C - (R * C) ** 2) / (L * C) ** 2)
    assert margins["w_gain"] == pytest.approx(cross, rel=CLOSE)
    assert margins["phase"] == pytest.approx(180 + np.degrees(np.angle(closed(1j * cross))), rel=1e-9)
    assert margins["gain"] is None  # it never turns by half a turn


LOOP = """
model loop {
  param k = 4 Hz
  input u: 1 = 0
  state x: 1 = 0
  state y: 1 = 0
  state z: 1 = 0
  dynamic x' = k*u
  dynamic y' = (x - y)/(1 s)
  dynamic z' = (y - z)/(0.2 s)
}
scene s of loop { time 0 s to 1 s; trace z }
"""


def test_the_gain_margin_of_an_integrator_with_two_lags(tmp_path, capsys):
    """4*5/(s (s + 1)(s + 5)): the phase is half a turn at w^2 = 5, where |G| = 20/30."""
    (found,) = linear(capsys, write(tmp_path, LOOP), "--response", "bode")["responses"]
    assert found["margins"]["gain"] == pytest.approx(1.5, rel=1e-9)
    assert found["margins"]["w_phase"] == pytest.approx(np.sqrt(5.0), rel=1e-9)
    w = found["margins"]["w_gain"]
    assert abs(20 / (1j * w * (1j * w + 1) * (1j * w + 5))) == pytest.approx(1.0, rel=1e-9)


def test_a_root_locus_is_that_of_the_polynomial(tmp_path, capsys):
    path = write(tmp_path, RLC.replace("R = 3 ohm", "R = 3e-3 kohm"))  # values are in SI, whatever the text's unit
    found = answered(capsys, path, "--locus", "R=0.1 ohm..30 ohm:9:log", "--outputs", "v")["locus"]
    assert (found["parameter"], found["unit"], found["failed"]) == ("R", "ohm", [])
    assert found["values"] == pytest.approx(np.geomspace(0.1, 30, 9), rel=1e-14)
    for r, pairs in zip(found["values"], found["eigenvalues"], strict=True):
        alike(values(pairs), np.roots([L * C, r * C, 1]))
    curves = np.array([values(p) for p in found["eigenvalues"]])
    steps = np.abs(np.diff(curves[:6], axis=0))
    other = np.abs(curves[1:6, ::-1] - curves[:5])
    assert (steps <= other + 1e-12).all()  # a curve goes on with the nearest


@pytest.mark.long
def test_matrices_in_files_are_those_of_the_command(tmp_path, capsys, monkeypatch):
    path = write(tmp_path, RLC)
    monkeypatch.chdir(tmp_path)
    names = [f"a{kind}" for kind in (".h5", ".mat", ".json", ".png", ".svg", ".html")]
    options = [part for name in names for part in ("-o", name)]
    found = answered(capsys, path, "--outputs", "v,i", *options)
    assert found["files"] == names
    with h5py.File("a.h5") as file:
        for name in "EABCD":
            assert (file[name][:] == np.array(found[name])).all()
        assert [s.decode() for s in file["outputs"][:]] == ["v", "i"]
        assert file["eigenvalues"][:] == pytest.approx(np.array(found["eigenvalues"]))
        assert file["transfer/0/poles"][:] == pytest.approx(np.array(found["transfer"][0]["poles"]))
        assert file["transfer/1"].attrs["input"] == b"u"
    mat = loadmat("a.mat")
    for name in "EABCD":
        assert (mat[name] == np.array(found[name])).all()
    assert mat["eigenvalues"].ravel() == pytest.approx(values(found["eigenvalues"]))
    held = json.loads((tmp_path / "a.json").read_text())
    assert held["A"] == found["A"]
    assert held["transfer"] == found["transfer"]
    first = {name: (tmp_path / name).read_bytes() for name in names}
    assert first["a.png"].startswith(b"\x89PNG")
    assert b"magnitude, dB" in first["a.svg"]
    assert b"Nyquist" in first["a.html"]
    assert b"Transfer functions" in first["a.html"]
    assert b"http-equiv" in first["a.html"]
    answered(capsys, path, "--outputs", "v,i", *options)
    assert {name: (tmp_path / name).read_bytes() for name in names} == first  # equal runs, equal files


def test_tables_on_the_terminal(tmp_path, capsys):
    options = ["--outputs", "v", "--backend", "numpy", "--response", "bode,step", "--locus", "C=0.01 F,0.04 F"]
    assert run(["linearize", str(write(tmp_path, RLC)), "--equilibrium", *options]) == 0
    out, _ = capsys.readouterr()
    for said in ("magnitude [dB]", "step response", "phase margin 50.2082 deg at 12.8062 rad/s", "C [F]"):
        assert said in out


@pytest.mark.parametrize("formulation", ALL)
@pytest.mark.long
def test_the_energy_of_a_mode_by_the_elements_that_hold_it(formulation, tmp_path, capsys):
    """Of an RLC oscillation half in the coil; of two capacitors C v^2, as their eigenvectors have it."""
    for mode in answered(capsys, write(tmp_path, RLC), "--formulation", formulation)["modes"]:
        if abs(complex(*mode["eigenvalue"])) > 1e-9:
            assert mode["energy"] == pytest.approx({"l": 0.5, "c": 0.5}, rel=1e-9)
            assert max(abs(complex(*v)) for v in mode["shape"].values()) == pytest.approx(1.0)
    text = """
    model two {
      node a, b: electrical
      c1: potential(q = 2 F*e) a -> ground
      r: dissipator(e = 3 ohm*f) a -> b
      c2: potential(q = 5 F*e) b -> ground
      load: dissipator(e = 7 ohm*f) b -> ground
    }
    scene s of two { time 0 s to 1 s; trace b.e }
    """
    a = np.array([[-1 / 6, 1 / 6], [1 / 15, -1 / 15 - 1 / 35]])
    own, vectors = np.linalg.eig(a)
    found = linear(capsys, write(tmp_path, text), "--formulation", formulation)["modes"]
    for value, v in zip(own, vectors.T, strict=True):
        mode = min(found, key=lambda m: abs(complex(*m["eigenvalue"]) - value))
        energy = np.array([2, 5]) * v**2
        assert [mode["energy"][n] for n in ("c1", "c2")] == pytest.approx(energy / energy.sum(), rel=1e-9)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (("--response", "bodo"), "--response 'bodo': of bode, nyquist, step"),
        (("-o", "a.pdf"), "-o 'a.pdf': one of .h5"),
        (("--locus", "Q=1..2:3"), "Q"),
        (("--locus", "R=1 ohm"), "2 to 1000 numbers"),
    ],
)
def test_wrong_usage(options, message, tmp_path, capsys):
    code, found = run_json(capsys, "linearize", str(write(tmp_path, RLC)), "--backend", "numpy", *options)
    assert code == 2
    assert message in found["diagnostics"][0]["message"]


def test_objects_of_scipy(tmp_path):
    found = api.linearize(write(tmp_path, RLC), equilibrium=True, outputs=["v", "i"], backend="numpy")
    assert found.outputs == ("v", "i")
    assert not found.moving
    system = found.state_space()
    assert isinstance(system, signal.StateSpace)
    w = np.geomspace(1, 99, 7)
    g = [(system.C @ np.linalg.solve(1j * x * np.eye(2) - system.A, system.B) + system.D)[0, 0] for x in w]
    assert g == pytest.approx(closed(1j * w), rel=1e-10)
    zpk = found.transfer_function("i", "u")
    _, g = signal.freqresp(zpk, w=w)
    assert g == pytest.approx(C * 1j * w * closed(1j * w), rel=1e-10)
    alike(found.eigenvalues, np.roots([L * C, R * C, 1]))
    # the descriptor form has the same finite eigenvalues
    numbers = eig(found.matrices["A"], found.matrices["E"], right=False)
    alike(numbers[np.abs(numbers) < 1e6], found.eigenvalues, 1e-9)
    (answer, _) = found.answers()
    assert answer.step[-1] == pytest.approx(1.0, abs=0.01)
    (rest,) = api.equilibria(write(tmp_path, RLC), backend="numpy", tries=2)
    assert rest.judged.stability == "asymptotically stable"
    with pytest.raises(api.UsageError):
        api.linearize(write(tmp_path, RLC), at=0.1, equilibrium=True)


def test_objects_of_python_control(tmp_path):
    control = pytest.importorskip("control")
    found = api.linearize(write(tmp_path, RLC), equilibrium=True, outputs=["v"], backend="numpy").control()
    assert isinstance(found, control.StateSpace)
    alike(found.poles(), np.roots([L * C, R * C, 1]))
    assert control.evalfr(found, 7j) == pytest.approx(closed(7j), rel=1e-10)
    assert found.output_labels == ["v"]


# -- systems in closed form --------------------------------------------------------------------------------------------

SYSTEMS = {
    "two_masses_damped": (  # m1 s^2 x1 = F - (c s + k)(x1 - x2), m2 s^2 x2 = (c s + k)(x1 - x2) - k2 x2
        """
        input F: N = 0 N
        coord x1, x2: translation
        energy T* = 1/2*(2 kg)*x1'^2 + 1/2*(3 kg)*x2'^2
        energy V = 1/2*(50 N/m)*(x1 - x2)^2 + 1/2*(20 N/m)*x2^2
        content D = 1/2*(0.6 N.s/m)*(x1' - x2')^2
        work F on x1
        """,
        "x1",
        [3, 0.6, 70],
        np.polysub(np.polymul([2, 0.6, 50], [3, 0.6, 70]), np.polymul([0.6, 50], [0.6, 50])),
    ),
    "cart_and_rod": (  # the bob in Cartesian coordinates, index 3; (M + m) and m l, hanging
        """
        input F: N = 0 N
        coord x: translation = 0 m
        coord a: translation ~ 0 m
        coord b: translation ~ -0.8 m
        energy T* = 1/2*(3 kg)*x'^2 + 1/2*(0.5 kg)*(a'^2 + b'^2)
        energy V = 0.5 kg*(10 m/s^2)*b + 1/2*(7 N/m)*x^2
        phi rod: (a - x)^2 + b^2 = (0.8 m)^2
        work F on x
        """,
        "x",
        # M x'' = F - k x + m g (a - x)/l, m a'' = -m g (a - x)/l
        [0.5, 0, 0.5 * 10 / 0.8],
        np.polysub(np.polymul([3, 0, 7 + 0.5 * 10 / 0.8], [0.5, 0, 0.5 * 10 / 0.8]), [(0.5 * 10 / 0.8) ** 2]),
    ),
    "notch": (  # a series resonance to ground behind a resistor
        """
        input u: V = 0 V
        node s, a, m: electrical
        supply: effort(e = u) s -> ground
        r: dissipator(e = 12 ohm*f) s -> a
        l: kinetic(p = 0.1 H*f) a -> m
        c: potential(q = 1 mF*e) m -> ground
        """,
        "a.e",
        [0.1 * 1e-3, 0, 1],
        [0.1 * 1e-3, 12 * 1e-3, 1],
    ),
    "bridged_t": (  # two capacitors, a zero in the left half plane
        """
        input u: V = 0 V
        node s, a: electrical
        supply: effort(e = u) s -> ground
        r1: dissipator(e = 1000 ohm*f) s -> a
        c1: potential(q = 1 uF*e) s -> a
        r2: dissipator(e = 500 ohm*f) a -> ground
        c2: potential(q = 3 uF*e) a -> ground
        """,
        "a.e",
        [1e-6, 1e-3],
        [4e-6, 1e-3 + 2e-3],
    ),
    "motor_and_shaft": (  # L s i = u - R i - k w1, J1 s w1 = k i - c (q1 - q2), J2 s w2 = c (q1 - q2) - b w2
        """
        input u: V = 0 V
        node s, a, m: electrical
        node n1, n2: rotation
        supply: effort(e = u) s -> ground
        r: dissipator(e = 2 ohm*f) s -> a
        l: kinetic(p = 0.05 H*f) a -> m
        g: gyrator(e1 = 0.3 V.s*f2) m -> ground, n1 -> ground
        j1: kinetic(p = 0.02 kg.m^2*f) n1
        shaft: potential(e = 40 N.m*q) n1 -> n2
        j2: kinetic(p = 0.07 kg.m^2*f) n2
        b: dissipator(e = 0.01 N.m.s*f) n2
        """,
        "n2.f",
        [0.3 * 40],
        None,
    ),
    "rolling_car": (  # a quarter car on a road that is given: base excitation
        """
        input z: m = 0 m
        coord w, y: translation
        energy T* = 1/2*(30 kg)*w'^2 + 1/2*(300 kg)*y'^2
        energy V = 1/2*(1.5e5 N/m)*(w - z)^2 + 1/2*(1.6e4 N/m)*(y - w)^2
        content D = 1/2*(1200 N.s/m)*(y' - w')^2
        """,
        "y",
        np.polymul([1200, 1.6e4], [1.5e5]),
        np.polysub(np.polymul([300, 1200, 1.6e4], [30, 1200, 1.66e5]), np.polymul([1200, 1.6e4], [1200, 1.6e4])),
    ),
    "pi_controller": (  # (kp + ki/s) on a lag of 2 s with gain 3
        """
        input w: 1 = 0
        state i: s = 0 s
        state y: 1 = 0
        dynamic i' = w - y
        dynamic y' = (3*(4*(w - y) + 5 Hz*i) - y)/(2 s)
        """,
        "y",
        [6, 7.5],
        [1, 6.5, 7.5],
    ),
    "given_velocity": (  # a flow source moves the end of a spring: psi, index 2
        """
        input v: m/s = 0 m/s
        node a, b: translation
        drive: flow(f = v) a -> ground
        k: potential(e = 90 N/m*q) a -> b
        m: kinetic(p = 4 kg*f) b
        c: dissipator(e = 6 N.s/m*f) b
        """,
        "b.f",
        [90],
        [4, 6, 90],
    ),
}


def _motor():
    """Denominator of motor_and_shaft by its states i, w1, q1 - q2, w2."""
    a = np.zeros((4, 4))
    a[0] = [-2 / 0.05, -0.3 / 0.05, 0, 0]
    a[1] = [0.3 / 0.02, 0, -40 / 0.02, 0]
    a[2] = [0, 1, 0, -1]
    a[3] = [0, 0, 40 / 0.07, -0.01 / 0.07]
    return np.poly(a) * 0.05 * 0.02 * 0.07


@pytest.mark.parametrize("formulation", ["lagrangian", "hamiltonian"])
@pytest.mark.parametrize("name", SYSTEMS)
@pytest.mark.long
def test_poles_zeros_and_gain_of(name, formulation, tmp_path, capsys):
    body, output, above, below = SYSTEMS[name]
    below = _motor() if below is None else below
    path = write(tmp_path, f"model m {{\n{body}\n}}\nscene s of m {{ time 0 s to 1 s; trace {output} as out }}\n")
    found = linear(capsys, path, "--formulation", formulation)
    (t,) = found["transfer"]
    poles, zeros = np.roots(below), np.roots(above)
    alike(values(t["poles"]), poles)
    alike(values(t["zeros"]), zeros)
    assert t["gain"] == pytest.approx(above[0] / below[0], rel=CLOSE)
    moving = [v for v in values(found["eigenvalues"]) if abs(v) > 1e-6 * max(abs(poles))]
    for pole in poles:
        assert min(abs(v - pole) for v in moving) <= CLOSE * max(abs(poles))
