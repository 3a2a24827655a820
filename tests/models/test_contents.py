"""Contents of stores that nothing is said of: zero unless something forces them, in every formulation alike."""

import pytest
from model_runs import FOUR, trace_of
from reduced import ROOT

SCENE = """
}}
scene go of net {{
  time 0 s to 0.5 s
  accuracy 1e-5
  trace {traced} every 0.1 s
}}
"""
CASES = {
    "an ungrounded capacitor": (
        """node x[1..2]: electrical
        R1: dissipator(f = 0.3 S*e) x[1] -> ground
        C: potential(e = 4 V/C*q) x[2] -> x[1]
        R3: dissipator(e = 2 ohm*f) x[2] -> ground
        node src: electrical
        V: effort(e = 1 V*cos(2 rad/s*t)) src -> ground
        RV: dissipator(e = 1 ohm*f) src -> x[1]""",
        {"C.q": 0.0, "x[1].e": 1 / 1.8, "x[2].e": 1 / 1.8},
    ),
    "a source at its peak and stores in parallel behind a gyrator": (  # its rate is what round-off leaves of cos(pi/2)
        """node u, m, a: electrical
        V: effort(e = 325 V*sin(314 rad/s*t + pi/2)) u -> ground
        R: dissipator(e = 2 ohm*f) u -> m
        G: gyrator(e1 = 200 ohm*f2) m -> ground, ground -> a
        C1: potential(e = 1.2e5 V/C*q) a -> ground
        C2: potential(e = 2.4e8 V/C*q) a -> ground""",
        {"R.f": 0.0, "C1.q": 0.0, "C2.q": 0.0},
    ),
    "a source at its peak before inductors in parallel": (
        """node a[0..3]: electrical
        R1: dissipator(e = 1.7 ohm*f) a[0] -> ground
        C2: potential(q = 0.923 F*e) a[0] -> a[1]
        V3: effort(e = 0.283 V*sin(2.77 rad/s*t - pi/2)) a[0] -> a[1]
        R4: dissipator(e = 0.1 ohm*f) a[1] -> a[3]
        R6: dissipator(e = 1.84 ohm*f) a[1] -> a[2]
        L7: kinetic(p = 0.315 H*f) a[2] -> ground
        L8: kinetic(p = 0.904 H*f) a[2] -> ground
        R9: dissipator(e = 5 ohm*f) a[3] -> a[1]""",
        {"L7.f": 0.0, "L8.f": 0.0, "a[1].e": 0.283},
    ),
    "capacitors around a loop": (
        """node a, b: electrical
        C1: potential(e = 4 V/C*q) a -> ground
        C2: potential(e = 4 V/C*q) b -> a
        C4: potential(q = 0.5 F*e) b -> ground
        R: dissipator(e = 2 ohm*f) a -> ground
        init C2.e = -0.5 V""",
        {"C1.q": 0.1, "C2.q": -0.125, "C4.q": -0.05},
    ),
    "capacitors alone on a node": (
        """node a, b: electrical
        C1: potential(e = 4 V/C*q) a -> ground
        C2: potential(e = 4 V/C*q) a -> ground
        C3: potential(q = 1 F*e) b -> ground
        R: dissipator(e = 2 ohm*f) b -> ground
        init C1.e = 0.3 V""",
        {"C1.q": 0.075, "C2.q": 0.075, "C3.q": 0.0},
    ),
    "inductors alone on a node": (
        """node a, b: electrical
        L1: kinetic(p = 0.5 H*f) a -> ground
        L2: kinetic(p = 0.25 H*f) a -> ground
        L3: kinetic(p = 0.5 H*f) b -> ground
        R: dissipator(e = 2 ohm*f) b -> ground
        init L1.f = -0.25 A""",
        {"L1.f": -0.25, "L2.f": 0.25, "L3.f": 0.0},
    ),
    "an inductor said behind one that is not": (
        """node a, b: electrical
        C1: potential(q = 0.5 F*e) a -> ground
        L2: kinetic(p = 0.5 H*f) b -> a
        L3: kinetic(p = 0.5 H*f) a -> ground
        R: dissipator(e = 2 ohm*f) b -> ground
        init L2.f = 0.19 A""",
        {"C1.q": 0.0, "L2.f": 0.19, "L3.f": 0.0, "b.e": -0.38},
    ),
    "inductors that a source and one that is said force": (
        """node a[1..2]: electrical
        I: flow(f = 0.5 A*cos(2 rad/s*t)) ground -> a[1]
        L1: kinetic(p = 0.5 H*f) a[1] -> ground
        L5: kinetic(p = 0.5 H*f) a[1] -> ground
        L8: kinetic(f = 3 A/Wb*p) a[2] -> ground
        C: potential(e = 4 V/C*q) a[2] -> a[1]
        init L1.f = 0.37 A
        init C.e = 0.5 V""",
        {"L1.f": 0.37, "L5.f": 0.04, "L8.f": 0.09, "a[1].e": -1.5 / 7},
    ),
    "a chain of capacitors behind a cut": (
        """param n = 3
        node a[0..n]: electrical
        I: flow(f = 0.5 A + 0.2 A*sin(2 rad/s*t)) ground -> a[0]
        for i in 1..n {{
          C[i]: potential(q = 0.3 F*i*e) a[i-1] -> a[i]
          R[i]: dissipator(e = 1 ohm*f) a[i-1] -> a[i]
          init C[i].e = 0.1 V*i
        }}
        L: kinetic(p = 0.4 H*f) a[n] -> ground""",
        {"a[0].e": 0.76, "a[n].e": 0.16, "L.f": 0.5, "C[2].q": 0.12},
    ),
    "an effort that is said of a store whose law tells no content": (  # q/2 + 1.5 q^3 = 0.3
        """node a, b, c: electrical
        S: effort(e = 1 V) a -> ground
        R: dissipator(e = 3 ohm*f) a -> b
        C1: potential(q = 1 F*e) b -> c
        C2: potential(e = q/(2 F) + 1.5 V/C^3*q^3) c -> ground
        init C2.e = 0.3 V""",
        {"C1.q": 0.0, "C2.q": 0.4032629374759649, "c.e": 0.3},
    ),
    "a coil of which nothing is said beside one whose current tells no flux": (
        """node a, b, c: electrical
        C1: potential(q = 2.4 F*e) a -> ground
        R1: dissipator(e = 1 ohm*f) a -> ground
        L1: kinetic(p = 1.2 H*f) a -> b
        L2: kinetic(f = p/(0.94 H) + 0.845 A/Wb^3*p^3) b -> c
        R2: dissipator(e = 2 ohm*f) b -> ground
        R3: dissipator(e = 3 ohm*f) c -> ground
        init L2.f = 0.8 A""",
        {"L1.f": 0.0, "L2.f": 0.8, "b.e": -1.6, "c.e": 2.4},
    ),
    "coupled coils in parallel": (
        """node a, b: electrical
        S: effort(e = 1 V) a -> ground
        R: dissipator(e = 3 ohm*f) a -> b
        K: coupled_inductors(L1 = 2 H, L2 = 1 H, k = 0.5) one = b -> ground, two = b -> ground
        init K.one.f = 1 A
        init K.two.f = 0.3 A""",
        {"K.one.f": 1.0, "K.two.f": 0.3, "b.e": -2.9},
    ),
    "efforts of such stores in series": (
        """node a, b, c: electrical
        S: effort(e = 1 V) a -> ground
        R: dissipator(e = 3 ohm*f) a -> b
        C1: potential(e = q/(1 F) + 1 V/C^3*q^3) b -> c
        C2: potential(e = q/(2 F) + 1.5 V/C^3*q^3) c -> ground
        init C1.e = 0.5 V
        init C2.e = 0.3 V""",
        {"C1.q": 0.42385379906978327, "C2.q": 0.4032629374759649, "b.e": 0.8},
    ),
    "strings of inductors that end in capacitors": (
        """param n = 2
        param m = 3
        node s: electrical
        node w[1..n, 0..m]: electrical
        V: effort(e = 1 V*cos(2 rad/s*t)) s -> ground
        for i in 1..n {{
          F[i]: dissipator(e = 0.3 ohm*i*f) s -> w[i, 0]
          for j in 1..m {{
            L[i, j]: kinetic(p = 0.1 H*(i + j)*f) w[i, j - 1] -> w[i, j]
          }}
          C[i]: potential(q = 0.2 F*i*e) w[i, m] -> ground
          init C[i].e = 0.1 V*i
        }}""",
        {"C[2].e": 0.2, "L[2, 2].f": 0.0, "w[2, 1].e": 1 - 0.8 * 3 / 12, "w[2, 2].e": 1 - 0.8 * 7 / 12},
    ),
}


@pytest.mark.parametrize("formulation", FOUR)
@pytest.mark.parametrize("case", CASES)
@pytest.mark.long
def test_contents(tmp_path, case, formulation):
    body, start = CASES[case]
    text = "from std.electrical import coupled_inductors\nmodel net {{\n" + body + SCENE
    text = text.format(traced=", ".join(start))
    trace = trace_of(tmp_path, text, formulation=formulation)
    reference = trace_of(tmp_path, text, formulation="lagrangian")
    for name, value in start.items():
        assert trace[name].values[0] == pytest.approx(value, abs=1e-9), name
        assert trace[name].values == pytest.approx(reference[name].values, abs=1e-4), name


@pytest.mark.parametrize("formulation", FOUR)
@pytest.mark.one_in(5)
def test_what_may_stay_stays(tmp_path, formulation):
    """What follows from the state is free to move: laws that read an effort, an inductor that is said by its flow."""
    text = (ROOT / "tests" / "mutation" / "laws.sd").read_text()
    lines = [line for line in text.splitlines() if "init P.f" not in line and "init y.f" not in line]
    trace = trace_of(tmp_path, "\n".join(lines).replace("trace c.e", "trace P.f, c.e"), formulation=formulation)
    assert trace["P.f"].values[0] == 0.0
    assert trace["y.f"].values[0] == 0.0
    assert trace["L.f"].values[0] == pytest.approx(0.2, rel=1e-12)
