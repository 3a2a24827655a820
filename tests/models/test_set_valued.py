"""setsign in gammas and in laws that give a flow: closed forms, the dissipator that says the same; what is refused."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import brentq
from set_valued import ALL, PRIMAL, run
from sysdyn import api

G0 = 9.80665
BLOCK = """\
model block {
  param mu = 0.5
  param slope = 0.3
  coord x: translation = 0 m
  coord y: translation = START
  energy T* = 1/2*(2 kg)*(x'^2 + y'^2)
  work -(2 kg)*g0*sin(slope) on x
  work -(2 kg)*g0*cos(slope) on y
  phi floor: y >= 0 m restitution BOUNCE
  FRICTION
  init x' = 2 m/s
  init y' = 0 m/s
}
scene s of block {
  time 0 s to 2 s
  trace x, x', READ as F, y every 0.05 s
}
"""
GAMMA = "implicit F: N ~ 0 N; work F on x; gamma rub: F + mu*floor.multiplier*setsign(x') = 0 N"
TWIN = "rub: dissipator(e = mu*floor.multiplier*setsign(f)) on x"


def block(friction, start="0 m", bounce="0"):
    text = BLOCK.replace("START", start).replace("BOUNCE", bounce).replace("FRICTION", friction)
    return text.replace("READ", "F" if friction is GAMMA else "-rub.e")


@PRIMAL
@pytest.mark.parametrize("method", ["bdf", "radau", "rosenbrock", "auto"])
@pytest.mark.parametrize("accuracy", [1e-3, 1e-6, 1e-9])
@pytest.mark.long
def test_a_block_stops_on_a_slope(tmp_path, formulation, method, accuracy):
    """Below the angle of friction it stays where it stops, and friction is what the weight asks for."""
    trace = run(tmp_path, block(GAMMA), formulation, accuracy, method=method)
    slows = G0 * (np.sin(0.3) + 0.5 * np.cos(0.3))
    stop, t = 2.0 / slows, np.minimum(trace.time, 2.0 / slows)
    assert np.abs(trace["x"].values - (2.0 * t - 0.5 * slows * t**2)).max() < max(accuracy, 1e-13)
    assert [e.time for e in trace.events] == pytest.approx([stop], abs=max(accuracy, 1e-12))
    moves = trace.time < stop - 1e-6
    expected = np.where(moves, -G0 * np.cos(0.3), 2 * G0 * np.sin(0.3))
    assert np.abs(trace["F"].values - expected)[np.abs(trace.time - stop) > 1e-6].max() < 1e-10


@PRIMAL
def test_a_block_slides_back_above_the_angle_of_friction(tmp_path, formulation):
    trace = run(tmp_path, block(GAMMA).replace("mu = 0.5", "mu = 0.2"), formulation)
    up, down = (G0 * (np.sin(0.3) + sign * 0.2 * np.cos(0.3)) for sign in (1.0, -1.0))
    stop = 2.0 / up
    before, behind = np.minimum(trace.time, stop), np.maximum(trace.time - stop, 0.0)
    expected = 2.0 * before - 0.5 * up * before**2 - 0.5 * down * behind**2
    assert np.abs(trace["x"].values - expected).max() < 1e-9


@PRIMAL
@pytest.mark.parametrize(("start", "bounce"), [("0.5 m", "0"), ("1 m", "0.5")])
@pytest.mark.parametrize("mu", [0.1, 0.9])
@pytest.mark.one_in(5)
def test_an_impact_rubs_by_its_impulse(tmp_path, formulation, start, bounce, mu):
    """Friction on a reaction has an impulse with it, at most what stops the block: as that of a dissipator."""
    texts = [block(text, start, bounce).replace("mu = 0.5", f"mu = {mu}") for text in (GAMMA, TWIN)]
    one, other = (run(tmp_path, text, formulation, method="radau") for text in texts)
    at = np.linspace(0.0, 2.0, 41)[1:]
    for name in ("x", "x'", "y"):
        values = [np.interp(at, trace.time, trace[name].values) for trace in (one, other)]
        assert np.abs(values[0] - values[1]).max() < 1e-10, name


@PRIMAL
@pytest.mark.one_in(2)
def test_what_lands_and_stops_at_one_instant_sticks(tmp_path, formulation):
    """In flight either sense does nothing, and a relation of no bound seemed to let its value through: behind the last
    bounce, where the speed is round-off, both senses were driven back (E930).
    """
    text = block(GAMMA, "1 m", "0.5").replace("mu = 0.5", "mu = 0.9")
    one, other = (run(tmp_path, text, formulation, accuracy=1e-8, method=method) for method in ("bdf", "radau"))
    assert np.abs(one["x"].values[-1] - other["x"].values[-1]) < 1e-8
    assert np.abs([trace["x'"].values[-1] for trace in (one, other)]).max() < 1e-12


BELT = """\
model belt {
  param v = 0.5 m/s
  coord x: translation = 0 m
  energy T* = 1/2*(1 kg)*x'^2
  energy V = 1/2*(40 N/m)*x^2
  FRICTION
  init x' = 0 m/s
}
scene s of belt {
  time 0 s to 5 s
  trace x, x', READ as F every 0.1 s
}
"""


@PRIMAL
@pytest.mark.parametrize("accuracy", [1e-3, 1e-6, 1e-9])
@pytest.mark.one_in(12)
def test_sticks_and_slips_on_a_belt_as_a_dissipator_does(tmp_path, formulation, accuracy):
    """The bound falls with the speed (Stribeck): it sticks again and again."""
    law = "3 N*setsign({0})*(1 + 1/(1 + ({0})^2/(1 m^2/s^2)))"
    gamma = f"implicit F: N ~ 0 N; work F on x; gamma rub: F + {law.format(chr(120) + chr(39) + ' - v')} = 0 N"
    twin = f"node m: translation; M: flow(f = v) m -> ground; rub: dissipator(e = {law.format('f')}) x -> m"
    texts = [BELT.replace("FRICTION", f).replace("READ", r) for f, r in ((gamma, "F"), (twin, "-rub.e"))]
    one, other = (run(tmp_path, text, formulation, accuracy) for text in texts)
    assert len(one.events) == len(other.events) > 5
    at = np.linspace(0.05, 4.95, 50)  # no instant of an event
    for name in ("x", "F"):
        values = [np.interp(at, trace.time, trace[name].values) for trace in (one, other)]
        assert np.abs(values[0] - values[1]).max() < 20 * accuracy, name


TWO = """\
model two {
  coord x: translation = 0 m
  coord y: translation = 0 m
  energy T* = 1/2*(2 kg)*x'^2 + 1/2*(1 kg)*y'^2
  work 5 N*sin(2 rad/s*t) on x
  FRICTION
}
scene s of two { time 0 s to 10 s; trace x, y every 0.1 s }
"""


@PRIMAL
@pytest.mark.parametrize("method", ["bdf", "radau", "rosenbrock"])
@pytest.mark.long
def test_two_bodies_rub_on_each_other(tmp_path, formulation, method):
    """Which of both sticks is one question."""
    gammas = """implicit F, G: N ~ 0 N; work F on x; work -F on y; work G on y
  gamma f: F = -(3 N)*setsign(x' - y'); gamma g: G = -(1.5 N)*setsign(y')"""
    twin = "A: dissipator(e = 3 N*setsign(f)) on x - y; B: dissipator(e = 1.5 N*setsign(f)) on y"
    texts = [TWO.replace("FRICTION", said) for said in (gammas, twin)]
    one, other = (run(tmp_path, text, formulation, method=method) for text in texts)
    for name in ("x", "y"):
        values = [np.interp(np.linspace(0, 10, 101), t.time, t[name].values) for t in (one, other)]
        assert np.abs(values[0] - values[1]).max() < (1e-6 if method == "rosenbrock" else 1e-12)


@pytest.mark.parametrize("law", [
    "gamma g: F = -(3 N)*setsign(x')",
    "gamma g: -F = 3 N*setsign(x')",
    "gamma g: F = -(3 N)*setsign(2*x')",
    "gamma g: F = -(2 N)*setsign(x') - 1 N*setsign(2*x')",
    "implicit s: 1 ~ 0; gamma h: s = setsign(x'); gamma g: F = -(3 N)*s",
    "gamma g: F = 0 N; rub: dissipator(e = 3 N*setsign(2*f)) on x",
    "gamma g: F = 0 N; rub: effort(e = 3 N*setsign(x')) on x",
    "gamma g: F = 0 N; implicit s: 1 ~ 0; gamma h: s = setsign(x'); work -(3 N)*s on x",
])  # fmt: skip
@pytest.mark.long
def test_one_friction_however_it_is_said(tmp_path, law):
    """Slips to a stop, sticks until 5 N sin 2t is 3 N, slips on."""
    text = f"""\
model one {{
  coord x: translation = 0 m
  energy T* = 1/2*(2 kg)*x'^2
  work 5 N*sin(2 rad/s*t) on x
  implicit F: N ~ 0 N
  work F on x
  {law}
  init x' = 0.2 m/s
}}
scene s of one {{ time 0 s to 1.2 s; trace x, x' every 0.05 s }}
"""
    trace = run(tmp_path, text, accuracy=1e-8)
    stop = brentq(lambda t: 0.2 - 1.5 * t + 1.25 * (1.0 - np.cos(2 * t)), 0.1, 0.3)
    again, t = np.arcsin(0.6) / 2, trace.time
    assert {round(e.time, 7) for e in trace.events} == {round(stop, 7), round(again, 7)}
    first = 0.2 - 1.5 * t + 1.25 * (1.0 - np.cos(2 * t))
    second = 1.25 * (np.cos(2 * again) - np.cos(2 * t)) - 1.5 * (t - again)
    expected = np.select([t < stop, t < again], [first, 0.0], second)
    assert np.abs(trace["x'"].values - expected).max() < 1e-7


def test_a_law_reads_another_speed_than_its_own(tmp_path):
    """e = c setsign(f - y') on x: the effort acts along x, whatever moves y."""
    text = TWO.replace("FRICTION", "A: dissipator(e = 3 N*setsign(f - y')) on x; init x' = 1 m/s")
    trace = run(tmp_path, text)
    assert np.abs(trace["y"].values).max() == 0.0


PLAY = """\
model play {
  coord x: translation = 0 m
  coord y: translation = 0 m
  energy T* = 1/2*(2 kg)*x'^2
  energy V = 1/2*(200 N/m)*(x - y)^2
  DAMPER
  work 9 N*sin(3 rad/s*t) on x
  FRICTION
  init x' = 1 m/s
}
scene s of play { time 0 s to 2 s; trace x, y every 0.02 s }
"""


@PRIMAL
@pytest.mark.parametrize("damper", ["", "content D = 1/2*(1 N.s/m)*(x' - y')^2"])
@pytest.mark.parametrize("friction", [
    "implicit F: N ~ 0 N; work F on y; gamma g: F = -(3 N)*setsign(y')", "rub: dissipator(e = 3 N*setsign(f)) on y",
])  # fmt: skip
@pytest.mark.long
def test_what_rubs_without_a_mass_starts_between_both_senses(tmp_path, formulation, damper, friction):
    """A spring before a friction: without a damper the play of 3/200 m (Prandtl); Euler's small steps say the same."""
    trace = run(tmp_path, PLAY.replace("DAMPER", damper).replace("FRICTION", friction), formulation)
    d, h, t_end = float(bool(damper)), 2e-5, 2.0
    (x, v, y), seen = (0.0, 1.0, 0.0), []
    for k in range(round(t_end / h) + 1):
        if k % 1000 == 0:
            seen.append((x, y))
        stretch = 200.0 * (x - y)
        if d:
            drive = stretch + d * v
            u = (drive - np.clip(drive, -3.0, 3.0)) / d
            force = stretch + d * (v - u)
            y += h * u
        else:
            force = np.clip(stretch, -3.0, 3.0)
        v += h * (9 * np.sin(3 * k * h) - force) / 2
        x += h * v
        if not d:
            y = min(max(y, x - 0.015), x + 0.015)
    at = np.arange(len(seen)) * 1000 * h
    for name, column in (("x", 0), ("y", 1)):
        values = np.interp(at, trace.time, trace[name].values)
        assert np.abs(values - np.array(seen)[:, column]).max() < 2e-4, name


def test_what_a_relation_leaves_open_is_refused(tmp_path):
    """y rests whatever F is, and F moves x: any value of the set would do."""
    text = TWO.replace("FRICTION", "implicit F: N ~ 0 N; work F on x; gamma g: F = -(3 N)*setsign(y')")
    with pytest.raises(api.ModelError) as caught:
        run(tmp_path, text)
    assert [d.code for d in caught.value.diagnostics if d.severity == "error"] == ["E516"]


@PRIMAL
@pytest.mark.long
def test_two_frictions_on_one_body_are_their_sum(tmp_path, formulation):
    """What each takes while both hold is open, and moves nothing."""
    two = """implicit F, G: N ~ 0 N; work F + G on x; gamma g: F = -(2 N)*setsign(x'); gamma h: G = -(1 N)*setsign(x')
  init x' = 0.2 m/s"""
    one = "implicit F: N ~ 0 N; work F on x; gamma g: F = -(3 N)*setsign(x'); init x' = 0.2 m/s"
    traces = [run(tmp_path, TWO.replace("FRICTION", text), formulation) for text in (two, one)]
    at = np.linspace(0.0, 10.0, 101)
    values = [np.interp(at, trace.time, trace["x"].values) for trace in traces]
    assert np.abs(values[0] - values[1]).max() < 1e-9


@PRIMAL
@pytest.mark.long
def test_frictions_of_an_array_in_components(tmp_path, formulation):
    """A component with a gamma, its own row of an array, and dissipators: one motion."""
    parts = """\
component rubbing { param c = 3 N; port p: translation; implicit F: N ~ 0 N; push: effort(e = F) ground -> p
  gamma g: F = -c*setsign(p.f) }
"""
    chain = """\
model chain {
  param n = 4
  node x[1..n]: translation
  for i in 1..n { M[i]: kinetic(p = 1 kg*f) x[i]; init x[i].q = 0 m; init x[i].f = 2 m/s }
  for i in 1..n-1 { K[i]: potential(e = 30 N/m*q) x[i] -> x[i+1] }
  FRICTION
}
scene s of chain { time 0 s to 3 s; trace x[1].q, x[4].q every 0.1 s }
"""
    said = (
        "for i in 1..n { R[i]: rubbing(c = i*1 N) p = x[i] }",
        """implicit F[1..n]: N ~ 0 N; for i in 1..n { A[i]: effort(e = F[i]) ground -> x[i] }
  for i in 2..n { gamma g[i]: F[i] = -i*1 N*setsign(x[i].f) }; gamma g[1]: F[1] = -1 N*setsign(x[1].f)""",
        "for i in 1..n { R[i]: dissipator(e = i*1 N*setsign(f)) x[i] }",
    )
    traces = [run(tmp_path, parts + chain.replace("FRICTION", text), formulation) for text in said]
    at = np.linspace(0.05, 2.95, 30)
    for name in ("x[1].q", "x[4].q"):
        first, *others = (np.interp(at, trace.time, trace[name].values) for trace in traces)
        assert all(np.abs(other - first).max() < 1e-12 for other in others)


@pytest.mark.parametrize("formulation", ["co_lagrangian", "co_hamiltonian"])
@pytest.mark.parametrize("text", [
    """\
model rubbing {
  param n = 4
  node x[1..n]: translation
  for i in 1..n {
    M[i]: kinetic(p = 1 kg*f) x[i]
    R[i]: dissipator(e = i*1 N*setsign(f)) x[i]
    init x[i].q = 0 m
    init x[i].f = 2 m/s
  }
  for i in 1..n-1 { K[i]: potential(e = 30 N/m*q) x[i] -> x[i+1] }
}
scene s of rubbing { time 0 s to 3 s; trace x[1].f as a, x[4].f as b, R[2].e as c every 0.1 s }
""", """\
model clamp {
  node a, b: electrical
  Vs: effort(e = 50 V*sin(314 rad/s*t)) a -> ground
  R: dissipator(e = 1 kohm*f) a -> b
  Z: dissipator(e = 30 V*setsign(f) + 10 V*setsign(f - 5 mA) + 10 ohm*f) b -> ground
}
scene s of clamp { time 0 s to 40 ms; trace Z.f as a, Z.e as b, b.e as c every 0.5 ms }
""",
])  # fmt: skip
@pytest.mark.long
def test_dry_friction_is_one_in_both_families(tmp_path, formulation, text):
    one, other = (run(tmp_path, text, f, method="radau") for f in ("lagrangian", formulation))
    assert len(one.events) == len(other.events) > 3
    end = one.time[-1]
    at = np.linspace(0.011 * end, 0.989 * end, 40)  # no instant of an event
    for name in "abc":
        values = [np.interp(at, trace.time, trace[name].values) for trace in (one, other)]
        assert np.abs(values[0] - values[1]).max() < 1e-6 * np.abs(values[0]).max(), name


@ALL
@pytest.mark.one_in(5)
def test_elements_of_one_label_are_said_one_by_one(tmp_path, formulation):
    """Of frictions in two loops, and of limiters by themselves, each has a sense of its own."""
    text = """\
model row {
  node x[1..4]: translation
  for i in 1..4 { M[i]: kinetic(p = 1 kg*f) x[i]; init x[i].q = 0 m; init x[i].f = i*1 m/s }
  for i in 1..2 { R[i]: dissipator(e = i*1 N*setsign(f)) x[i] }
  for i in 3..3 { R[i]: dissipator(e = i*1 N*setsign(f)) x[i] }
  R[4]: dissipator(e = 2 N*setsign(f)) x[4]
}
scene s of row { time 0 s to 3 s; trace x[1].f, x[2].f, x[3].f, x[4].f every 0.5 s }
"""
    trace = run(tmp_path, text, formulation)
    for i, slows in ((1, 1.0), (2, 2.0), (3, 3.0), (4, 2.0)):
        expected = np.maximum(i - slows * trace.time, 0.0)
        assert np.abs(trace[f"x[{i}].f"].values - expected).max() < 1e-9


@PRIMAL
def test_a_bead_rubs_on_a_hoop_by_its_reaction(tmp_path, formulation):
    """Friction 0.2 of what the hoop bears, of either sign: against the angle's own equation, piece by piece."""
    text = """\
model hoop {
  coord x: translation = 1 m
  coord y: translation = 0 m
  energy T* = 1/2*(2 kg)*(x'^2 + y'^2)
  work -(2 kg)*g0 on y
  phi hoop: x^2 + y^2 = 1 m^2
  implicit F: N ~ 0 N
  work -F*y/(1 m) on x
  work F*x/(1 m) on y
  gamma rub: F = -0.2*abs(2*hoop.multiplier*1 m)*setsign((x*y' - y*x')/(1 m))
  init y' = 0 m/s
}
scene s of hoop { time 0 s to 6 s; trace x, y every 0.05 s }
"""
    trace = run(tmp_path, text, formulation, method="radau")
    angle, begin, pieces, sense = 0.0, 0.0, [], -1.0
    while sense:

        def rate(_, z, sense=sense):
            return [z[1], -G0 * np.cos(z[0]) - 0.2 * sense * abs(z[1] ** 2 - G0 * np.sin(z[0]))]

        def halts(_, z):
            return z[1]

        halts.terminal, halts.direction = True, -sense
        found = solve_ivp(rate, (begin, 9.0), [angle, sense * 1e-14], rtol=1e-11, atol=1e-13, events=halts,
                          dense_output=True, max_step=0.02)  # fmt: skip
        pieces.append((begin, found.sol))
        begin, angle = found.t[-1], found.y[0, -1]
        sense = -np.sign(np.cos(angle)) if abs(np.cos(angle)) > 0.2 * abs(np.sin(angle)) else 0.0
    expected = [next((s(t)[0] for b, s in reversed(pieces) if b <= t), 0.0) if t < begin else angle for t in trace.time]
    assert np.abs(trace["x"].values - np.cos(expected)).max() < 1e-6
    turns = [e.time for e in trace.events if e.time > 0.0]
    assert turns == pytest.approx([*(b for b, _ in pieces[1:]), begin], abs=1e-6)


@PRIMAL
@pytest.mark.parametrize("method", ["radau", "bdf"])
@pytest.mark.long
def test_what_sticks_is_let_go_while_its_bound_falls_to_zero(tmp_path, formulation, method):
    """A clutch of 150 N.m is opened between 1.5 s and 1.6 s: its moment is what the second disc asks for up to their
    release, then what it can bear.
    """
    text = """\
table opens(x: s) -> 1 linear clamp [ (0, 1), (1.5, 1), (1.6, 0) ]
model clutch {
  node a, b: rotation
  Ja: kinetic(p = 0.2 kg.m^2*f) a
  Jb: kinetic(p = 0.3 kg.m^2*f) b
  M: effort(e = 20 N.m - 0.1 N.m.s*a.f) ground -> a
  implicit F: N.m ~ 0 N.m
  work -F on a.q
  work F on b.q
  gamma rub: F = 150 N.m*opens(t)*setsign(a.f - b.f)
  init Ja.f = 20 rad/s
  init Jb.f = 20 rad/s
}
scene s of clutch { time 0 s to 2 s; trace a.f, b.f }
"""
    release = brentq(lambda t: 1500.0 * (1.6 - t) - 0.3 * 36.0 * np.exp(-0.2 * t), 1.5, 1.6, xtol=1e-14)
    together, left = 200.0 - 180.0 * np.exp(-0.2 * release), 1.6 - release
    driven = together + 2500.0 * left**2
    # 0.2 f' = 20 - 0.1 f - 1500 (1.6 - t), of which -29800 - 15000 (1.6 - t) is a solution; then without it
    opened = (together + 29800.0 + 15000.0 * left) * np.exp(-0.5 * left) - 29800.0
    driver = 200.0 + (opened - 200.0) * np.exp(-0.2)
    for asked in (*({"accuracy": None, "rtol": 10.0**-k} for k in range(3, 10)), {"accuracy": 1e-6}):
        trace = run(tmp_path, text, formulation, **{"method": method} | asked)
        found = [trace[name].values[-1] for name in ("b.f", "a.f")]
        limit = 1e-6 if "rtol" not in asked else 100.0 * asked["rtol"]
        assert found == pytest.approx([driven, driver], rel=limit)
